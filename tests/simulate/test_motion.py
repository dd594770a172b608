"""Motions that are prescribed: the law is kept, and the drive does the work."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.messages import refused

import mbs
from mbs.components import Body, Prismatic, Revolute
from mbs.errors import ModelError


def energy(result):
    return result["kinetic_energy"] + result["potential_energy"]


def work(result, name):
    return np.trapezoid(result[f"{name}.tau"] * result[f"{name}.v"], result.time)


def run(system, seconds=1.0, **options):
    return mbs.simulate.run(system, seconds, quiet=True, **options)


def test_a_crank_that_is_turned_gives_its_work_to_the_loop():
    system = catalogue_system("four_bar")
    start = system.configuration[0]
    result = run(system, 2.0, motion={"j1.q": lambda t: start + 2 * t + 0.3 * t**2}, step=1e-3)
    t = result.time
    assert result["j1.q"] == pytest.approx(start + 2 * t + 0.3 * t**2, abs=1e-11)
    assert result["j1.v"] == pytest.approx(2 + 0.6 * t, abs=1e-11)
    assert result["j1.a"] == pytest.approx(np.full_like(t, 0.6), abs=1e-9)
    assert result["closure_residual"].max() < 1e-12
    gained = energy(result)[-1] - energy(result)[0]
    assert abs(gained) > 1
    assert work(result, "j1") == pytest.approx(gained, rel=1e-5)


def test_every_joint_of_an_arm_driven_needs_the_efforts_of_the_inverse_model():
    system = catalogue_system("puma560")
    names = [c.name for c in system.coordinates]
    laws = {
        f"{n}.q": (lambda t, k=k: 0.1 * k * (1 - casadi.cos(2 * t))) for k, n in enumerate(names)
    }
    result = run(system, motion=laws)
    idm = mbs.models.inverse_dynamics(system)
    for row in (0, 37, 100):
        q, v, a, tau = ([result[f"{n}.{x}"][row] for n in names] for x in ("q", "v", "a", "tau"))
        assert np.array(idm(q, v, a)).ravel() == pytest.approx(tau, abs=1e-9)


def test_velocities_and_accelerations_leave_their_positions_to_be_integrated():
    system = catalogue_system("puma560")
    laws = {"q1.v": 1.0, "q2.a": lambda t: t}
    result = run(system, motion=laws, q0={"q1": 0.5}, v0={"q2": 0.2}, tolerance=1e-10)
    assert result["q1.q"][-1] == pytest.approx(1.5, abs=1e-9)
    assert result["q2.v"][-1] == pytest.approx(0.7, abs=1e-9)
    assert result["q2.q"][-1] - result["q2.q"][0] == pytest.approx(0.2 + 1 / 6, abs=1e-9)


def test_a_pendulum_on_a_shaken_pivot_obeys_its_equation():
    """With the pivot at s(t): L theta'' = -g sin theta - s'' cos theta."""
    m = mbs.Mechanism("shaken", gravity=(0, -9.81, 0))
    cart = m.add(Body("cart", mass=3.0))
    bob = m.add(Body("bob", mass=1.0, com=(0, -0.5, 0)))
    m.connect(m.world, Prismatic("s", axis="x"), cart)
    m.connect(cart, Revolute("theta", axis="z"), bob)
    system = m.assemble()
    law = {"s.q": lambda t: 0.1 * casadi.sin(5 * t)}
    result = run(system, 2.0, motion=law, q0={"theta": 0.4}, tolerance=1e-10)
    theta, t = result["theta.q"], result.time
    push = -2.5 * np.sin(5 * t)
    expected = (-9.81 * np.sin(theta) - push * np.cos(theta)) / 0.5
    assert result["theta.a"] == pytest.approx(expected, abs=1e-8)
    swing = 0.5 * (result["theta.a"] * np.cos(theta) - result["theta.v"] ** 2 * np.sin(theta))
    assert result["s.tau"] == pytest.approx(4.0 * push + 1.0 * swing, abs=1e-7)


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ({"j1.x": 1}, "motion names 'j1.x', which is no position"),
        ({"j1": 1}, "motion names 'j1', which is no position"),
        ({"j1.q": "fast"}, "the motion of j1.q is 'fast'; give a finite number, or a function"),
        ({"j1.q": float("nan")}, "give a finite number"),
        ({"j1.q": lambda t: casadi.SX.sym("k") * t}, "the motion of j1.q holds the symbols k;"),
        ({"j1.q": lambda t: t * casadi.SX.sym("k")}, "holds the symbols k; make it of the time"),
        ({"j1.q": lambda t: t + casadi.SX.sym("t")}, "holds the symbols t"),
        ({"j1.q": lambda t: casadi.SX.sym("k")}, "holds the symbols k"),
        ({"j1.q": lambda t: casadi.vertcat(t, t)}, "give a finite number, or a function"),
        ({"j1.v": lambda t: {}["rate"]}, "j1.v raises KeyError: 'rate'; correct the function"),
        ({"j1.q": lambda: 0.3}, "takes 0 positional arguments but 1 was given"),
        ({"j1.q": 0.1, "j1.v": 1}, "motion prescribes j1 more than once"),
        ({"j1.v": 1, "j4.v": 1}, "j1, j4 cannot all be prescribed"),
        (3, "motion is 3; give a dict"),
    ],
)
def test_impossible_motions_are_refused(law, told):
    system = catalogue_system("four_bar")
    refused(ModelError, told, by=lambda: run(system, motion=law))


def test_a_start_against_the_law_is_refused():
    system = catalogue_system("four_bar")
    law = {"j1.q": lambda t: 0.3 + t}
    assert run(system, 0.1, motion=law, q0={"j1": 0.3})["j1.q"][0] == pytest.approx(0.3)
    refused(
        ModelError,
        "q0 gives j1 = 0.5, but its motion starts at 0.3; leave it out of q0",
        by=lambda: run(system, motion=law, q0={"j1": 0.5}),
    )
    refused(
        ModelError,
        "v0 is given as a sequence, beside motion",
        by=lambda: run(system, motion=law, v0=[0.0] * system.nv),
    )
