"""The motion of a robot with the parameters found so far, for instruments."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, SX, Function

from mbs.errors import ModelError, SolverError
from mbs.identification.observations.evaluated import known_of, motion_of
from mbs.identification.postures import active_places, is_explicit, posture_of
from mbs.identification.records.filters import Samples

Array = npt.NDArray[np.float64]

_STEP_KINDS = ("Fs", "Fsm")


def simulated_motion(
    regressor: Any, values: npt.ArrayLike, samples: Samples, tracking: float | None = None
) -> Samples:
    """The measured efforts drive the robot; a slow controller keeps it near the measured motion.

    Noise of the measured positions passes the controller only below its bandwidth, and that of the
    efforts is integrated twice. Runge-Kutta's method of fourth order, a step for each sample; dry
    friction changes its sign with the measured motion.

    Source: Janot, Vandanjon & Gautier 2014 (simulated instruments).

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`, open or closed.
        values: (k,) parameters of its columns; those of bodies, so that inertia is positive.
        samples: in steps that are short for the motion.
        tracking: bandwidth of the controller [Hz]; half of that of the samples by default, or a
            hundredth of their rate where they were not filtered.

    Returns:
        The simulated q, v, a of the independent joints at the instants of the samples, with the
        measured efforts.

    Raises:
        ModelError: the values are not those of the columns, or the controller does not follow.
        SolverError: the robot left the measured motion; its parameters have no sense.
    """
    K = np.asarray(values, dtype=float)
    if K.shape != (len(regressor.columns),):
        raise ModelError(
            f"simulated instruments: the values have the shape {K.shape} for"
            f" {len(regressor.columns)} columns; give one for each"
        )
    slow = samples.rate / 100 if samples.bandwidth is None else samples.bandwidth / 2
    follow = slow if tracking is None else tracking
    if not follow > 0:
        raise ModelError(
            f"simulated instruments: the bandwidth of the controller is {follow:g} Hz; give more"
            " than zero"
        )
    q, v, _ = motion_of(regressor, samples)
    q_a = q[:, active_places(regressor.system)]
    acceleration = _acceleration(regressor, K, 2 * np.pi * follow)
    step = _runge_kutta(acceleration, 1.0 / samples.rate)
    inputs = np.hstack([q_a, v, samples.tau - known_of(regressor, samples)]).T
    m, count = q_a.shape[1], inputs.shape[1] - 1
    start = np.concatenate([q_a[0], v[0]])
    states = step.mapaccum(count)(DM(start), inputs[:, :-1], inputs[:, 1:]).full()
    states = np.hstack([start[:, None], states])
    a = acceleration.map(count + 1)(states, inputs).full()
    if not (np.isfinite(states).all() and np.isfinite(a).all()):
        raise SolverError(
            "simulated instruments: the simulated robot left the measured motion; the inertia"
            " matrix of the parameters may not be positive, so start from consistent()"
        )
    return replace(samples, q=states[:m].T, v=states[m:].T, a=a.T)


def _acceleration(regressor: Any, K: Array, w: float) -> Function:
    """(state, given) -> a, the robot driven by the measured efforts and the controller."""
    m, kind = int(regressor.size1_in(1)), _kind(regressor)
    state, given, a = kind.sym("state", 2 * m), kind.sym("given", 3 * m), kind.sym("a", m)
    q, v = state[:m], state[m:]
    q_m, v_m, tau = given[:m], given[m : 2 * m], given[2 * m :]
    steps = [c.kind in _STEP_KINDS for c in regressor.columns]
    smooth = _efforts(regressor, np.where(steps, 0.0, K))
    stepping = _efforts(regressor, np.where(steps, K, 0.0))
    rest = kind.zeros(m)
    A = casadi.jacobian(smooth(q, v, a), a)
    H = smooth(q, v, rest) + stepping(q_m, v_m, rest)
    driven = casadi.solve(A, tau - H) + 2 * w * (v_m - v) + w * w * (q_m - q)
    return Function("acceleration", [state, given], [casadi.densify(driven)])


def _efforts(regressor: Any, K: Array) -> Function:
    """(q_a, v_a, a_a) -> D K of the independent joints."""
    m = int(regressor.size1_in(1))
    q, v, a = (MX.sym(name, m) for name in "qva")
    tau = casadi.mtimes(regressor(posture_of(regressor.system, q), v, a), DM(K))
    function = Function("efforts", [q, v, a], [tau])
    return function.expand() if is_explicit(regressor.system) else function


def _kind(regressor: Any) -> Any:
    """SX where the loops close without iteration, else MX."""
    return SX if is_explicit(regressor.system) else MX


def _runge_kutta(acceleration: Function, h: float) -> Function:
    m = acceleration.size1_out(0)
    kind: Any = MX if acceleration.is_a("MXFunction") else SX
    x, now, then = (kind.sym(*pair) for pair in (("x", 2 * m), ("now", 3 * m), ("then", 3 * m)))
    half = (now + then) / 2

    def rate(state: Any, given: Any) -> Any:
        return casadi.vertcat(state[m:], acceleration(state, given))

    k1 = rate(x, now)
    k2 = rate(x + h / 2 * k1, half)
    k3 = rate(x + h / 2 * k2, half)
    k4 = rate(x + h * k3, then)
    return Function("step", [x, now, then], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
