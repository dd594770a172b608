"""Problems of optimal control whose optimum is known from equations written by hand."""

import casadi
import numpy as np
import pytest
from casadi import MX, SX, Function
from support.rod_mechanisms import acrobot

from mbs.models import dae
from mbs.native import compiled

STAGES, DURATION, LARGEST = 60, 4.0, 30.0
OPTIMUM = 53.527
"""Of equations of Lagrange written by hand, for the same steps."""


def runge_kutta(d, h):
    """step(x, u) -> x of the classical method."""
    rates = Function("rates", [d.x, d.u], [d.ode])
    x, u = SX.sym("x", d.x.numel()), SX.sym("u")
    k1 = rates(x, u)
    k2 = rates(x + h / 2 * k1, u)
    k3 = rates(x + h / 2 * k2, u)
    k4 = rates(x + h * k3, u)
    return Function("step", [x, u], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)], {"cse": True})


@pytest.mark.parametrize("evaluate", [Function, lambda f: compiled(f, derivatives=2)])
def test_acrobot_swings_up_with_the_known_effort(evaluate):
    h = DURATION / STAGES
    step = evaluate(runge_kutta(dae(acrobot()), h))
    x, u = MX.sym("x", 4, STAGES + 1), MX.sym("u", 1, STAGES)
    gaps = casadi.vec(Function.map(step, STAGES)(x[:, :STAGES], u) - x[:, 1:])
    problem = {"x": casadi.vertcat(casadi.vec(x), casadi.vec(u)), "f": h * casadi.sumsqr(u)}
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
    solver = casadi.nlpsol("solver", "ipopt", {**problem, "g": gaps}, options)
    ends = np.array([[-np.pi / 2, 0, 0, 0], [np.pi / 2, 0, 0, 0]])
    states = np.linspace(*ends, STAGES + 1)
    lower, upper = np.full(states.shape, -np.inf), np.full(states.shape, np.inf)
    lower[[0, -1]] = upper[[0, -1]] = ends
    found = solver(
        x0=np.concatenate([states.ravel(), np.zeros(STAGES)]),
        lbx=np.concatenate([lower.ravel(), np.full(STAGES, -LARGEST)]),
        ubx=np.concatenate([upper.ravel(), np.full(STAGES, LARGEST)]),
        lbg=0,
        ubg=0,
    )
    assert solver.stats()["success"]
    assert solver.stats()["iter_count"] <= 42
    assert float(found["f"]) == pytest.approx(OPTIMUM, abs=5e-4)
