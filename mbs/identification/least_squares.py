"""Least squares: ordinary, effort by effort, weighted, robust, with instruments."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, SX, Function

from mbs.errors import ModelError, SolverError
from mbs.identification.estimate import Estimate, repetition
from mbs.identification.leading import (
    active_indices,
    configuration_of,
    is_explicit,
    of_motion,
)
from mbs.identification.observations import Observations, known_of, motion_of, require_visible
from mbs.identification.record import Samples
from mbs.identification.triangle import triangle, triangle_solved

# The equations of every effort by itself: least squares with a deviation for each of them.


Array = npt.NDArray[np.float64]

_ROUNDING = 1e-9
"""Part of the largest effort below which a deviation is rounding of sums over a record, and weights
of it would count nothing else; its square [N m or N] where all efforts are zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A weighted least-squares solution.

    Attributes:
        values: (k,) parameters.
        root: (k, k); root' root is the inverse of the matrix of the normal equations.
        own: (m,) parameters that each effort pays for, the trace of its part of the projection.
    """

    values: Array
    root: Array
    own: Array


@dataclass(frozen=True, slots=True, eq=False)
class EffortEquations:
    """For each effort [W y] in as few rows as they have columns, and how its errors repeat.

    Attributes:
        triangles: of each effort, (at most k + 1, k + 1).
        rows: equations of each effort.
        repeated: (m,) equations that say as much as one of independent error, one or more.
    """

    triangles: tuple[Array, ...]
    rows: int
    repeated: Array

    @classmethod
    def of(cls, observations: Observations) -> EffortEquations:
        """Of observations, the errors taken as independent until `with_errors`."""
        W, y = observations.W, observations.y
        m = y.shape[1]
        parts = tuple(triangle(np.column_stack([W[:, j], y[:, j]])) for j in range(m))
        return cls(parts, len(y), np.ones(m))

    def with_errors(self, error: Array) -> EffortEquations:
        """The same, errors (n, m) showing by how much each row repeats the one before."""
        return EffortEquations(self.triangles, self.rows, repetition(error))

    def solved(self, weights: Array) -> Fit:
        """The parameters of least weighted squares, by QR of columns scaled to length one.

        Args:
            weights: (m,) of the efforts.
        """
        rows = np.vstack([w * T for w, T in zip(weights, self.triangles, strict=True)])
        A, b = rows[:, :-1], rows[:, -1]
        k, lengths = A.shape[1], np.linalg.norm(A, axis=0)
        T = triangle(np.column_stack([A / lengths, b]))
        inverse = np.linalg.inv(T[:k, :k]) / lengths[:, None]
        pairs = zip(weights, self.triangles, strict=True)
        own = [np.sum((w * X[:, :-1] @ inverse) ** 2) for w, X in pairs]
        return Fit(inverse @ T[:k, k], inverse.T, np.array(own))

    def squares(self, values: Array) -> Array:
        """(m,) sums of the squared errors of each effort."""
        with_effort = np.append(values, -1.0)
        return np.array([np.sum((T @ with_effort) ** 2) for T in self.triangles])

    def deviations(self, fit: Fit) -> Array:
        """(m,) deviation of the error of each effort [N m or N].

        Every effort pays for its part of the parameters: sum of squares over rows less `own`.
        """
        left = np.maximum(self.rows - fit.own, 1.0)
        efforts = [np.linalg.norm(T[:, -1]) / np.sqrt(self.rows) for T in self.triangles]
        return above_rounding(np.sqrt(self.squares(fit.values) / left), np.array(efforts))

    def covariance(self, fit: Fit, weights: Array, deviations: Array) -> Array:
        """(k, k) covariance of the parameters when the efforts have these deviations.

        Weights need not be those of the deviations. Rows that repeat others count as fewer.

        Source: White 1980 (deviations that differ).
        """
        scale = weights * deviations * np.sqrt(self.repeated)
        pairs = zip(weights * scale, self.triangles, strict=True)
        spread = np.vstack([f * T[:, :-1] @ fit.root.T for f, T in pairs]) @ fit.root
        return np.asarray(spread.T @ spread, dtype=float)


def above_rounding(deviations: Array, efforts: Array) -> Array:
    """(m,) deviations of errors, none so small that it is rounding.

    Args:
        deviations: (m,).
        efforts: (m,) root mean square of each effort.
    """
    least = max(_ROUNDING * float(efforts.max()), _ROUNDING**2)
    return np.asarray(np.maximum(deviations, least), dtype=float)


def least_squares(observations: Observations) -> Estimate:
    """The parameters that make the sum of squared errors of all efforts least.

    The standard deviations are those of errors that differ from effort to effort and repeat
    themselves from row to row as the residuals do.

    Source: Gautier & Khalil 1988; Khalil & Dombre 2002, chapter 12.

    Args:
        observations: that show every parameter.

    Raises:
        ModelError: the parameters that they do not show.
    """
    require_visible(observations)
    weights = np.ones(observations.y.shape[1])
    equations = EffortEquations.of(observations)
    return weighted_solution(observations, equations, weights, "least squares", 1)


def weighted_solution(
    observations: Observations,
    equations: EffortEquations,
    weights: Array,
    method: str,
    rounds: int,
) -> Estimate:
    """Least squares with given weights (m,) of the efforts.

    What the errors are like is taken from least squares with the weights that they ask for, so
    that an effort of small error does not get those of the others.
    """
    fit = equations.solved(weights)
    better = equations.solved(1 / equations.deviations(fit))
    errors = equations.with_errors(observations.y - observations.W @ better.values)
    covariance = errors.covariance(fit, weights, errors.deviations(better))
    return Estimate(
        method, observations.columns, fit.values, covariance, weights, observations, rounds
    )


# Least squares with a weight for each joint.


def weighted(observations: Observations) -> Estimate:
    """Every effort is divided by the deviation of its error that least squares left.

    Source: Gautier 1997; Khalil & Dombre 2002, chapter 12.

    Args:
        observations: that show every parameter.

    Raises:
        ModelError: the parameters that they do not show.
    """
    require_visible(observations)
    equations = EffortEquations.of(observations)
    first = equations.solved(np.ones(observations.y.shape[1]))
    weights = 1 / equations.deviations(first)
    return weighted_solution(observations, equations, weights, "weighted least squares", 1)


def reweighted(observations: Observations, tolerance: float = 1e-3, most: int = 50) -> Estimate:
    """Weights and parameters in turn, until the weights stay as they are.

    Its end is the most likely set of parameters for errors that are normal with a deviation of
    each joint.

    Source: Gautier 1997.

    Args:
        observations: that show every parameter.
        tolerance: relative change of the weights at which it ends.
        most: rounds before it is given up.

    Raises:
        ModelError: the parameters that they do not show.
        SolverError: the weights did not settle.
    """
    require_visible(observations)
    equations, change = EffortEquations.of(observations), np.inf
    weights = 1 / equations.deviations(equations.solved(np.ones(observations.y.shape[1])))
    for number in range(1, most + 1):
        following = 1 / equations.deviations(equations.solved(weights))
        change = float(np.abs(following / weights - 1).max())
        if change < tolerance:
            method = "iteratively re-weighted least squares"
            return weighted_solution(observations, equations, weights, method, number)
        weights = following
    raise SolverError(
        f"re-weighted least squares: the weights still change by {change:.2g} after {most} rounds;"
        " use weighted(), or a larger tolerance"
    )


# Least squares that outliers do not move.


HUBER = 1.345
"""Bound at which 95 % of the efficiency of least squares is left for normal errors."""

_MEDIAN_OF_NORMAL = 0.6745
"""Median of the sizes of normal errors of deviation one."""


def robust(
    observations: Observations, bound: float = HUBER, tolerance: float = 1e-2, most: int = 100
) -> Estimate:
    """Errors beyond some deviations count by their size, not by their square.

    The deviation of each joint is taken from the median of its errors, which outliers hardly move.

    Source: Huber 1964; Holland & Welsch 1977 (by re-weighted least squares).

    Args:
        observations: that show every parameter.
        bound: deviations beyond which an error counts less.
        tolerance: change of the parameters, in standard deviations, at which it ends.
        most: rounds before it is given up.

    Raises:
        ModelError: the parameters that they do not show.
        SolverError: the parameters did not settle.
    """
    start = weighted(observations)
    equations, values = EffortEquations.of(observations), start.values
    for number in range(1, most + 1):
        error = observations.y - observations.W @ values
        scale = _deviations(error, observations.y)
        following = _solved(observations, np.sqrt(_trust(error / scale, bound)) / scale)
        change = np.abs(following - values) / start.deviations
        values = following
        if change.max() < tolerance:
            covariance = _robust_covariance(observations, equations, values, bound)
            method = "robust least squares (Huber)"
            return Estimate(
                method, observations.columns, values, covariance, 1 / scale, observations, number
            )
    raise SolverError(
        f"robust least squares: the parameters still change by {change.max():.2g} deviations after"
        f" {most} rounds; use a larger bound or tolerance"
    )


def _trust(size: Array, bound: float) -> Array:
    """(n, m) weight of each error, given in deviations: one up to the bound, less beyond."""
    return np.asarray(bound / np.maximum(np.abs(size), bound), dtype=float)


def _solved(observations: Observations, rows: Array) -> Array:
    """(k,) least squares with a weight for each row and effort, (n, m)."""
    W, y = observations.rows
    w = rows.reshape(-1)
    A, lengths = W * w[:, None], np.linalg.norm(W * w[:, None], axis=0)
    return np.asarray(triangle_solved(A / lengths, y * w) / lengths, dtype=float)


def _robust_covariance(
    observations: Observations, equations: EffortEquations, values: Array, bound: float
) -> Array:
    """(k, k) covariance of the parameters, the part of trusted errors taken for each effort.

    Source: Huber 1964 (variance of his estimator); Street, Carroll & Ruppert 1988.
    """
    error = observations.y - observations.W @ values
    scale = _deviations(error, observations.y)
    trusted = np.mean(np.abs(error) < bound * scale, axis=0)
    kept = error * _trust(error / scale, bound)
    weights = np.sqrt(trusted) / scale
    fit = equations.solved(weights)
    left = np.maximum(len(error) - fit.own, 1.0)
    deviations = np.sqrt(np.sum(kept**2, axis=0) / left) / trusted
    return equations.with_errors(kept).covariance(fit, weights, deviations)


def _deviations(error: Array, efforts: Array) -> Array:
    """(m,) deviation of each column by the median of its sizes."""
    size = np.median(np.abs(error), axis=0) / _MEDIAN_OF_NORMAL
    return above_rounding(size, np.sqrt(np.mean(efforts**2, axis=0)))


# Instrumental variables: least squares that noise in the regressor does not bias.


def instrumental(
    observations: Observations, instruments: Observations, weights: Array | None = None
) -> Estimate:
    """The parameters whose errors are uncorrelated with the instruments: Z' (y - W K) = 0.

    Source: Janot, Vandanjon & Gautier 2014, section III (IDIM-IV).

    Args:
        observations: y = W K, W made of measured motion.
        instruments: of the same rows and columns, Z in place of W, made of a motion that is free
            of the measurement's noise, such as `simulated_motion` or the motion that was ordered.
        weights: (m,) of each effort [1/(N m) or 1/N]; ones when None.

    Raises:
        ModelError: the instruments do not fit, or they do not show every parameter.
    """
    if instruments.W.shape != observations.W.shape or instruments.names != observations.names:
        raise ModelError(
            f"instruments: W has the shape {instruments.W.shape}, the observations"
            f" {observations.W.shape}; make both from the same instants and columns"
        )
    require_visible(observations)
    require_visible(instruments)
    used = np.ones(observations.y.shape[1]) if weights is None else np.asarray(weights, dtype=float)
    w = np.broadcast_to(used, observations.y.shape).reshape(-1)
    (W, y), (Z, _) = observations.rows, instruments.rows
    lengths = np.linalg.norm(Z * w[:, None], axis=0)
    A = (Z * w[:, None] / lengths).T @ (W * w[:, None] / lengths)
    inverse = np.linalg.inv(A) / lengths[:, None]
    x = inverse @ ((Z * (w * w)[:, None] / lengths).T @ y)
    covariance = _instrumental_covariance(
        instruments, inverse / lengths, used, observations.y - observations.W @ x
    )
    return Estimate(
        "instrumental variables", observations.columns, x, covariance, used, observations
    )


def _instrumental_covariance(
    instruments: Observations, inverse: Array, weights: Array, error: Array
) -> Array:
    """(k, k) of the parameters (Z' W)^-1 Z' y, every effort with the deviation of its error."""
    n, m = error.shape
    left = max(n - inverse.shape[0] / m, 1.0)
    deviations = np.sqrt(np.sum(error**2, axis=0) * repetition(error) / left)
    spread = np.einsum("j,njk,ik->nji", weights**2 * deviations, instruments.W, inverse)
    rows = spread.reshape(-1, spread.shape[2])
    return np.asarray(rows.T @ rows, dtype=float)


# The motion of a robot with the parameters found so far, for instruments.


_STEP_KINDS = ("Fs", "Fsm")


def simulated_motion(
    regressor: Any, values: npt.ArrayLike, samples: Samples, tracking: float | None = None
) -> Samples:
    """The measured efforts drive the robot; a slow controller keeps it near the measured motion.

    Noise of the measured positions passes the controller only below its bandwidth, and that of the
    efforts is integrated twice. Runge-Kutta's method of fourth order, a step for each sample;
    Coulomb friction changes its sign with the measured motion.

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
    q_a = q[:, active_indices(regressor.system)]
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
    D = of_motion(regressor)(configuration_of(regressor.system, q), v, a)
    function = Function("efforts", [q, v, a], [casadi.mtimes(D, DM(K))])
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
