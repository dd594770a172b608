"""The motion of a robot with the parameters found so far, for instruments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, SX, Function

from mbs.errors import ModelError, SolverError
from mbs.identification.estimate import Estimate
from mbs.identification.filters import Samples
from mbs.identification.observations import known_of

Array = npt.NDArray[np.float64]

_STEP_KINDS = ("Fs", "Fsm")


def simulated_motion(
    regressor: Any,
    kept: Sequence[str],
    estimate: Estimate,
    samples: Samples,
    tracking: float = 1.0,
) -> Samples:
    """The measured efforts drive the robot; a slow controller keeps it near the measured motion.

    Noise of the measured positions passes the controller only below its bandwidth, and that of the
    efforts is integrated twice. Runge-Kutta's method of fourth order, a step for each sample; dry
    friction changes its sign with the measured motion.

    Source: Janot, Vandanjon & Gautier 2014 (simulated instruments).

    Args:
        regressor: Function D(q, v, a) with `.columns`, of an open system.
        kept: names of the columns that the values of the estimate stand for, in its order.
        estimate: by any method.
        samples: in steps that are short for the motion.
        tracking: bandwidth of the controller [Hz].

    Returns:
        The simulated q, v, a at the instants of the samples, with the measured efforts.

    Raises:
        ModelError: the system is closed, or the names are not those of the estimate.
        SolverError: the robot left the measured motion; its parameters have no sense.
    """
    n = int(regressor.size1_in(0))
    if int(regressor.size1_in(1)) != n or samples.q.shape[1] != n:
        raise ModelError("simulated instruments: the system is closed; give an ordered motion")
    if len(kept) != len(estimate.values):
        raise ModelError(
            f"simulated instruments: {len(kept)} names are given for {len(estimate.values)}"
            " parameters; give the name of the kept column for each"
        )
    K = np.zeros(len(regressor.columns))
    names = [column.name for column in regressor.columns]
    K[[names.index(name) for name in kept]] = estimate.values
    acceleration = _acceleration(regressor, K, 2 * np.pi * tracking)
    step = _runge_kutta(acceleration, n, 1.0 / samples.rate)
    tau = samples.tau - known_of(regressor, samples)
    inputs = np.hstack([samples.q, samples.v, tau]).T
    count = inputs.shape[1] - 1
    start = np.concatenate([samples.q[0], samples.v[0]])
    run = step.mapaccum(count)
    states = np.hstack([start[:, None], run(DM(start), inputs[:, :-1], inputs[:, 1:]).full()])
    if not np.isfinite(states).all():
        raise SolverError(
            "simulated instruments: the simulated robot left the measured motion; the inertia"
            " matrix of the estimate may not be positive, so start from consistent()"
        )
    a = acceleration.map(count + 1)(states, inputs).full()
    return replace(samples, q=states[:n].T, v=states[n:].T, a=a.T)


def _acceleration(regressor: Any, K: Array, w: float) -> Function:
    """(state, input) -> a, the robot driven by the measured efforts and the controller."""
    n = int(regressor.size1_in(0))
    state, given = SX.sym("state", 2 * n), SX.sym("given", 3 * n)
    q, v, a = state[:n], state[n:], SX.sym("a", n)
    q_m, v_m, tau = given[:n], given[n : 2 * n], given[2 * n :]
    steps = [c.kind in _STEP_KINDS for c in regressor.columns]
    smooth, stepping = (DM(np.where(steps, x, y)) for x, y in ((0.0, K), (K, 0.0)))
    efforts = casadi.mtimes(regressor(q, v, a), smooth)
    rest = SX.zeros(n)
    friction = casadi.mtimes(regressor(q_m, v_m, rest), stepping)
    A = casadi.jacobian(efforts, a)
    H = casadi.substitute(efforts, a, rest) + friction
    driven = casadi.solve(A, tau - H) + 2 * w * (v_m - v) + w * w * (q_m - q)
    return Function("acceleration", [state, given], [casadi.densify(driven)])


def _runge_kutta(acceleration: Function, n: int, h: float) -> Function:
    x, now, then = SX.sym("x", 2 * n), SX.sym("now", 3 * n), SX.sym("then", 3 * n)
    half = (now + then) / 2

    def rate(state: SX, given: SX) -> SX:
        return casadi.vertcat(state[n:], acceleration(state, given))

    k1 = rate(x, now)
    k2 = rate(x + h / 2 * k1, half)
    k3 = rate(x + h / 2 * k2, half)
    k4 = rate(x + h * k3, then)
    return Function("step", [x, now, then], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
