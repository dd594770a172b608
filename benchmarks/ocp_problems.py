"""The problems of optimal control that are timed; all data stand here."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from casadi import MX, Function

PANDA_STAGES = 40
PANDA_SECONDS = 1.0
PANDA_START = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0])
PANDA_END = np.array([1.0, 0.3, -0.5, -1.2, 0.4, 2.0, 0.6])
PANDA_EFFORTS = np.array([87.0] * 4 + [12.0] * 3)
QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}


@dataclass(frozen=True, slots=True)
class Solved:
    """What a solution cost.

    Attributes:
        optimum: of the problem.
        iterations: of IPOPT.
        build: seconds to make the solver, stage Functions not counted.
        solve: seconds of all iterations.
        functions: seconds in Functions and their derivatives, of these.
    """

    optimum: float
    iterations: int
    build: float
    solve: float
    functions: float


def panda_point_to_point(idm: Function, longest: int = 1000) -> Solved:
    """The least integral of the squared efforts from configuration to configuration, at rest at
    both ends.

    States q and v, accelerations constant on each stage; the efforts are those at its begin and
    are limited. The inverse dynamic model is mapped over the stages.

    Args:
        idm: inverse dynamic model of seven joints.
        longest: iterations after which it is given up.
    """
    begin = time.perf_counter()
    N, h = PANDA_STAGES, PANDA_SECONDS / PANDA_STAGES
    q, v, a = MX.sym("q", 7, N + 1), MX.sym("v", 7, N + 1), MX.sym("a", 7, N)
    tau = Function.map(idm, N)(q[:, :N], v[:, :N], a)
    position = q[:, :N] + h * v[:, :N] + h * h / 2 * a - q[:, 1:]
    rows = [position, v[:, :N] + h * a - v[:, 1:], tau]
    unknowns, g = (casadi.vertcat(*map(casadi.vec, parts)) for parts in ([q, v, a], rows))
    problem = {"x": unknowns, "f": h * casadi.sumsqr(tau), "g": g}
    solver = casadi.nlpsol("solver", "ipopt", problem, {**QUIET, "ipopt.max_iter": longest})
    built = time.perf_counter()
    reach = np.concatenate([np.zeros(14 * N), np.tile(PANDA_EFFORTS, N)])
    found = solver(lbg=-reach, ubg=reach, **_panda_ends(N))
    return _solved(solver, found, begin, built)


@dataclass(frozen=True, slots=True)
class StageDerivatives:
    """What a solver needs of the efforts of one stage, x = [q; v; a].

    Attributes:
        efforts: (x) -> tau (7, 1).
        jacobian: (x) -> dtau/dx (7, 21).
        hessian: (x, y) -> second derivative of y'tau (21, 21).
    """

    efforts: Function
    jacobian: Function
    hessian: Function

    @classmethod
    def of(cls, idm: Function, evaluate: Callable[[Function], Function]) -> StageDerivatives:
        """Of an inverse dynamic model; `evaluate` is `mbs.native.compiled`, or the identity."""
        n = idm.size1_in(0)
        x, y = casadi.SX.sym("x", 3 * n), casadi.SX.sym("y", n)
        tau = idm(x[:n], x[n : 2 * n], x[2 * n :])
        H = casadi.hessian(casadi.dot(y, tau), x)[0]
        parts = [("efforts", [x], tau), ("jacobian", [x], casadi.jacobian(tau, x))]
        made = (
            evaluate(Function(name, inputs, [casadi.densify(output)], {"cse": True}))
            for name, inputs, output in [*parts, ("hessian", [x, y], H)]
        )
        return cls(*made)


def panda_by_stages(stage: StageDerivatives, longest: int = 1000) -> Solved:
    """The problem of `panda_point_to_point` with its Jacobian and Hessian put together by stages.

    The unknowns are [q; v; a] stage by stage, so that the Hessian of the Lagrangian has a block of
    its own for each: that of sigma h tau'tau + lambda'tau.

    Args:
        stage: derivatives of the efforts.
        longest: iterations after which it is given up.
    """
    begin = time.perf_counter()
    N, h = PANDA_STAGES, PANDA_SECONDS / PANDA_STAGES
    w, p = MX.sym("w", 21 * N + 14), MX.sym("p", 0)
    sigma, multiplier = MX.sym("sigma"), MX.sym("lambda", 21 * N)
    x = casadi.reshape(w[: 21 * N], 21, N)
    tau, J = stage.efforts.map(N)(x), casadi.horzsplit(stage.jacobian.map(N)(x), 21)
    gaps = _next(h) @ x - casadi.reshape(_knots(w, N), 14, N)
    f, g = h * casadi.sumsqr(tau), casadi.vec(casadi.vertcat(gaps, tau))
    gradient = 2 * h * casadi.vertcat(*(S.T @ tau[:, k] for k, S in enumerate(J)), MX(14, 1))
    y = casadi.reshape(multiplier, 21, N)[14:, :] + 2 * h * sigma * tau
    curved = casadi.horzsplit(stage.hessian.map(N)(x, y), 21)
    blocks = [H + 2 * h * sigma * casadi.mtimes(S.T, S) for H, S in zip(curved, J, strict=True)]
    linear = casadi.jacobian(casadi.vec(casadi.vertcat(gaps, MX(7, N))), w)
    slopes = casadi.diagcat(*(casadi.vertcat(MX(14, 21), S) for S in J))
    slopes = linear + casadi.horzcat(slopes, MX(21 * N, 14))
    hessian = casadi.triu(casadi.diagcat(*blocks, MX(14, 14)))
    lagrange = [w, p, sigma, multiplier]
    given = {
        "grad_f": Function("grad_f", [w, p], [f, gradient], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": Function("jac_g", [w, p], [g, slopes], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": Function(
            "hess_lag", lagrange, [hessian], ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
        ),
    }
    problem = {"x": w, "p": p, "f": f, "g": g}
    options = {**QUIET, "ipopt.max_iter": longest, "no_nlp_grad": True, **given}
    solver = casadi.nlpsol("solver", "ipopt", problem, options)
    built = time.perf_counter()
    reach = np.tile(np.concatenate([np.zeros(14), PANDA_EFFORTS]), N)
    ends = {name: _by_stages(value, N) for name, value in _panda_ends(N).items()}
    found = solver(lbg=-reach, ubg=reach, **ends)
    return _solved(solver, found, begin, built)


def _next(h: float) -> casadi.DM:
    """(14, 21) the next q and v of [q; v; a]."""
    one = casadi.DM.eye(7)
    position = casadi.horzcat(one, h * one, h * h / 2 * one)
    return casadi.vertcat(position, casadi.horzcat(casadi.DM(7, 7), one, h * one))


def _knots(w: MX, N: int) -> MX:
    """q and v at the ends of the stages."""
    return casadi.vertcat(*(w[21 * k : 21 * k + 14] for k in range(1, N + 1)))


def _by_stages(values: Any, N: int) -> Any:
    """Values of all q, then all v, then all a, stage by stage."""
    q, v, a = np.split(np.asarray(values), [7 * (N + 1), 14 * (N + 1)])
    stacked = np.concatenate([q.reshape(N + 1, 7), v.reshape(N + 1, 7)], axis=1)
    whole = np.concatenate([stacked[:N], a.reshape(N, 7)], axis=1).ravel()
    return np.concatenate([whole, stacked[N]])


def _panda_ends(N: int) -> dict[str, Any]:
    """Bounds of the first and the last configuration, and a smooth motion between them as a
    guess."""
    s, way = np.linspace(0, 1, N + 1), (PANDA_END - PANDA_START)[:, None]
    guess = [PANDA_START[:, None] + way * (3 * s**2 - 2 * s**3), way * (6 * s - 6 * s**2)]
    guess.append(way * (6 - 12 * s[:-1]))
    lower = [np.full(part.shape, -np.inf) for part in guess]
    upper = [np.full(part.shape, np.inf) for part in guess]
    for bounds in (lower, upper):
        bounds[0][:, [0, -1]] = np.stack([PANDA_START, PANDA_END], axis=1)
        bounds[1][:, [0, -1]] = 0
    flat = (np.concatenate([p.ravel("F") for p in parts]) for parts in (guess, lower, upper))
    return dict(zip(("x0", "lbx", "ubx"), flat, strict=True))


def acrobot_swing_up(rates: Function, evaluate: Callable[[Function], Function]) -> Solved:
    """The least integral of u^2 that swings two rods of 1 m and 1 kg up in 4 s, |u| <= 30.

    Sixty steps of the classical method of Runge and Kutta; a straight line of states as a guess.

    Args:
        rates: (x, u) -> dx/dt, the motor at the elbow.
        evaluate: what becomes of the stage Function, such as `mbs.native.compiled`.
    """
    begin = time.perf_counter()
    N, h = 60, 4 / 60
    x, u = MX.sym("x", 4, N + 1), MX.sym("u", 1, N)
    step = evaluate(runge_kutta(rates, h))
    gaps = casadi.vec(Function.map(step, N)(x[:, :N], u) - x[:, 1:])
    unknowns = casadi.vertcat(casadi.vec(x), casadi.vec(u))
    problem = {"x": unknowns, "f": h * casadi.sumsqr(u), "g": gaps}
    solver = casadi.nlpsol("solver", "ipopt", problem, QUIET)
    built = time.perf_counter()
    ends = np.array([[-np.pi / 2, 0, 0, 0], [np.pi / 2, 0, 0, 0]])
    guess = np.linspace(*ends, N + 1)
    lower, upper = np.full((N + 1, 4), -np.inf), np.full((N + 1, 4), np.inf)
    lower[[0, -1]] = upper[[0, -1]] = ends
    found = solver(
        x0=np.concatenate([guess.ravel(), np.zeros(N)]),
        lbx=np.concatenate([lower.ravel(), np.full(N, -30.0)]),
        ubx=np.concatenate([upper.ravel(), np.full(N, 30.0)]),
        lbg=0,
        ubg=0,
    )
    return _solved(solver, found, begin, built)


def runge_kutta(rates: Function, h: float) -> Function:
    """``step(x, u) -> x``, a step of length h in scalar operations."""
    x, u = casadi.SX.sym("x", rates.size1_in(0)), casadi.SX.sym("u", rates.size1_in(1))
    k1 = rates(x, u)
    k2 = rates(x + h / 2 * k1, u)
    k3 = rates(x + h / 2 * k2, u)
    k4 = rates(x + h * k3, u)
    after = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return Function("step", [x, u], [after], ["x", "u"], ["after"], {"cse": True})


def _solved(solver: Function, found: dict[str, Any], begin: float, built: float) -> Solved:
    end, stats = time.perf_counter(), solver.stats()
    inside = sum(value for name, value in stats.items() if name.startswith("t_wall_nlp"))
    if not stats["success"]:
        raise RuntimeError(f"IPOPT ends with {stats['return_status']}")
    return Solved(float(found["f"]), stats["iter_count"], built - begin, end - built, inside)
