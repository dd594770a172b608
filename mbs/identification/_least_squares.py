"""Least squares: ordinary, weighted by effort, robust, and with instrumental variables."""

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
    motion_function,
)
from mbs.identification.observations import (
    Observations,
    known_efforts_at,
    motion_of,
    require_visible,
)
from mbs.identification.record import Samples
from mbs.identification.triangle import triangle, triangle_solved

# Separate equations of each effort: least squares with one error deviation per effort.


Array = npt.NDArray[np.float64]

_ROUNDING = 1e-9
"""Smallest standard deviation of an error, as a fraction of the largest effort. Smaller
deviations are rounding errors of sums over a record, and their weights would dominate. Its
square [N m or N] is used if all efforts are zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Weighted least-squares solution.

    Attributes:
        values: (k,) parameters.
        root: (k, k) root of the inverse of the normal matrix: root' root = (A' A)^-1.
        own: (m,) effective number of parameters of each effort: trace of its part of the projection
            matrix.
    """

    values: Array
    root: Array
    own: Array


@dataclass(frozen=True, slots=True, eq=False)
class EffortEquations:
    """Equations [W y] of each effort, compressed by QR, and the autocorrelation of their errors.

    Attributes:
        triangles: triangular factor of each effort, (at most k + 1, k + 1).
        rows: number of equations of each effort.
        repeated: (m,) number of correlated equations with the information of one independent
            equation, at least 1.
    """

    triangles: tuple[Array, ...]
    rows: int
    repeated: Array

    @classmethod
    def of(cls, observations: Observations) -> EffortEquations:
        """Compress observations by QR. Errors count as independent until `with_errors` is called.

        Args:
            observations: equations y = W K of n instants and m efforts.
        """
        W, y = observations.W, observations.y
        m = y.shape[1]
        parts = tuple(triangle(np.column_stack([W[:, j], y[:, j]])) for j in range(m))
        return cls(parts, len(y), np.ones(m))

    def with_errors(self, error: Array) -> EffortEquations:
        """Return a copy that accounts for the autocorrelation of the residuals.

        Args:
            error: (n, m) residuals of the efforts.
        """
        return EffortEquations(self.triangles, self.rows, repetition(error))

    def solved(self, weights: Array) -> Fit:
        """Solve the weighted least-squares problem by QR of columns scaled to unit length.

        Args:
            weights: (m,) weights of the efforts.
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
        """Return the sum of squared residuals (m,) of each effort.

        Args:
            values: (k,) parameters.
        """
        with_effort = np.append(values, -1.0)
        return np.array([np.sum((T @ with_effort) ** 2) for T in self.triangles])

    def deviations(self, fit: Fit) -> Array:
        """Return the standard deviation (m,) of the error of each effort [N m or N].

        It is the root of the sum of squares over the degrees of freedom, rows - `own`.

        Args:
            fit: least-squares solution of these equations.
        """
        left = np.maximum(self.rows - fit.own, 1.0)
        efforts = [np.linalg.norm(T[:, -1]) / np.sqrt(self.rows) for T in self.triangles]
        return above_rounding(np.sqrt(self.squares(fit.values) / left), np.array(efforts))

    def covariance(self, fit: Fit, weights: Array, deviations: Array) -> Array:
        """Return the covariance (k, k) of the parameters of a weighted solution.

        The weights may differ from the inverse deviations. Correlated rows count less.

        Source: White 1980 (heteroscedastic errors).

        Args:
            fit: solution with these weights.
            weights: (m,) weights of the efforts.
            deviations: (m,) standard deviations of the errors of the efforts.
        """
        scale = weights * deviations * np.sqrt(self.repeated)
        pairs = zip(weights * scale, self.triangles, strict=True)
        spread = np.vstack([f * T[:, :-1] @ fit.root.T for f, T in pairs]) @ fit.root
        return np.asarray(spread.T @ spread, dtype=float)


def above_rounding(deviations: Array, efforts: Array) -> Array:
    """Return the standard deviations (m,) of errors, at least as large as rounding errors.

    Args:
        deviations: (m,) standard deviations [N m or N].
        efforts: (m,) root mean square of each effort [N m or N].
    """
    least = max(_ROUNDING * float(efforts.max()), _ROUNDING**2)
    return np.asarray(np.maximum(deviations, least), dtype=float)


def least_squares(observations: Observations) -> Estimate:
    """Estimate parameters by ordinary least squares of all efforts.

    The standard deviations account for different error deviations of the efforts and for the
    autocorrelation of the residuals.

    Source: Gautier & Khalil 1988; Khalil & Dombre 2002, chapter 12.

    Args:
        observations: observations in which every parameter is identifiable.

    Raises:
        ModelError: some parameters are not identifiable; the message names them.
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
    """Solve least squares with given weights of the efforts and estimate the covariance.

    Error deviations are estimated from a second solution with optimal weights, so that large errors
    of one effort do not affect the deviations of the other efforts.

    Args:
        observations: equations y = W K.
        equations: the same equations in compressed form.
        weights: (m,) weights of the efforts [1/(N m) or 1/N].
        method: name of the method in the result.
        rounds: number of iterations in the result.
    """
    fit = equations.solved(weights)
    better = equations.solved(1 / equations.deviations(fit))
    errors = equations.with_errors(observations.y - observations.W @ better.values)
    covariance = errors.covariance(fit, weights, errors.deviations(better))
    return Estimate(
        method, observations.columns, fit.values, covariance, weights, observations, rounds
    )


# Least squares with one weight per joint.


def weighted(observations: Observations) -> Estimate:
    """Estimate parameters by least squares, with one weight for each effort.

    A weight is the inverse standard deviation of the residuals of ordinary least squares.

    Source: Gautier 1997; Khalil & Dombre 2002, chapter 12.

    Args:
        observations: observations in which every parameter is identifiable.

    Raises:
        ModelError: some parameters are not identifiable; the message names them.
    """
    require_visible(observations)
    equations = EffortEquations.of(observations)
    first = equations.solved(np.ones(observations.y.shape[1]))
    weights = 1 / equations.deviations(first)
    return weighted_solution(observations, equations, weights, "weighted least squares", 1)


def iteratively_reweighted(
    observations: Observations, tolerance: float = 1e-3, most: int = 50
) -> Estimate:
    """Estimate parameters by iteratively reweighted least squares.

    Weights and parameters are updated alternately until the weights converge. The result is the
    maximum-likelihood estimate for normal errors with a separate deviation of each joint.

    Source: Gautier 1997.

    Args:
        observations: observations in which every parameter is identifiable.
        tolerance: relative change of the weights at convergence.
        most: maximum number of iterations.

    Raises:
        ModelError: some parameters are not identifiable; the message names them.
        SolverError: the weights did not converge.
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


# Least squares that is insensitive to outliers.


HUBER = 1.345
"""Bound of the Huber loss [standard deviations], which keeps 95 % of the efficiency of least
squares for normal errors."""

_MEDIAN_OF_NORMAL = 0.6745
"""Median absolute value of normal errors of unit standard deviation."""


def huber(
    observations: Observations, bound: float = HUBER, tolerance: float = 1e-2, most: int = 100
) -> Estimate:
    """Estimate parameters with the Huber loss, which is linear beyond `bound` standard deviations.

    The error deviation of each joint is estimated from the median absolute residual, which is
    insensitive to outliers.

    Source: Huber 1964; Holland & Welsch 1977 (by re-weighted least squares).

    Args:
        observations: observations in which every parameter is identifiable.
        bound: standard deviations beyond which the loss is linear.
        tolerance: change of the parameters at convergence, in standard deviations.
        most: maximum number of iterations.

    Raises:
        ModelError: some parameters are not identifiable; the message names them.
        SolverError: the parameters did not converge.
    """
    start = weighted(observations)
    equations, values = EffortEquations.of(observations), start.values
    for number in range(1, most + 1):
        error = observations.y - observations.W @ values
        scale = _median_deviations(error, observations.y)
        following = _row_weighted_solution(
            observations, np.sqrt(_huber_weights(error / scale, bound)) / scale
        )
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


def _huber_weights(size: Array, bound: float) -> Array:
    """Return the Huber weight (n, m) of each error: 1 up to `bound`, then bound/|size|.

    `size` (n, m) are errors in standard deviations.
    """
    return np.asarray(bound / np.maximum(np.abs(size), bound), dtype=float)


def _row_weighted_solution(observations: Observations, rows: Array) -> Array:
    """Return the least-squares parameters (k,) with weights `rows` (n, m) of single equations."""
    W, y = observations.rows
    w = rows.reshape(-1)
    A, lengths = W * w[:, None], np.linalg.norm(W * w[:, None], axis=0)
    return np.asarray(triangle_solved(A / lengths, y * w) / lengths, dtype=float)


def _robust_covariance(
    observations: Observations, equations: EffortEquations, values: Array, bound: float
) -> Array:
    """Return the covariance (k, k) of Huber parameters `values` (k,) with the loss bound `bound`.

    Source: Huber 1964 (variance of the estimator); Street, Carroll & Ruppert 1988.
    """
    error = observations.y - observations.W @ values
    scale = _median_deviations(error, observations.y)
    trusted = np.mean(np.abs(error) < bound * scale, axis=0)
    kept = error * _huber_weights(error / scale, bound)
    weights = np.sqrt(trusted) / scale
    fit = equations.solved(weights)
    left = np.maximum(len(error) - fit.own, 1.0)
    deviations = np.sqrt(np.sum(kept**2, axis=0) / left) / trusted
    return equations.with_errors(kept).covariance(fit, weights, deviations)


def _median_deviations(error: Array, efforts: Array) -> Array:
    """Return a standard deviation (m,) of each column of `error` (n, m) from its median magnitude.

    It is at least the rounding error of the `efforts` (n, m).
    """
    size = np.median(np.abs(error), axis=0) / _MEDIAN_OF_NORMAL
    return above_rounding(size, np.sqrt(np.mean(efforts**2, axis=0)))


# Instrumental variables: least squares without bias from noise in the regressor.


def instrumental(
    observations: Observations, instruments: Observations, weights: Array | None = None
) -> Estimate:
    """Estimate parameters by instrumental variables: Z' (y - W K) = 0.

    The residuals are uncorrelated with the instruments Z.

    Source: Janot, Vandanjon & Gautier 2014, section III (IDIM-IV).

    Args:
        observations: equations y = W K, with W from the measured motion.
        instruments: equations of the same rows and columns with Z as W, from a motion without
            measurement noise, such as `simulated_motion` or the reference motion.
        weights: (m,) weight of each effort [1/(N m) or 1/N]; 1 if None.

    Raises:
        ModelError: the shape or the names of the instruments do not match, or a parameter is not
            identifiable from the instruments or the observations.
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
    """Return the covariance (k, k) of the instrumental-variable estimate.

    `inverse` (k, k) is (Z' W)^-1, `weights` (m,) are those of the efforts and `error` (n, m) the
    residuals, whose deviation may differ between efforts.

    `instruments` Z (n, m, k) replace the observation matrix W.
    """
    n, m = error.shape
    left = max(n - inverse.shape[0] / m, 1.0)
    deviations = np.sqrt(np.sum(error**2, axis=0) * repetition(error) / left)
    spread = np.einsum("j,njk,ik->nji", weights**2 * deviations, instruments.W, inverse)
    rows = spread.reshape(-1, spread.shape[2])
    return np.asarray(rows.T @ rows, dtype=float)


# Simulated motion of a robot with given parameters, as source of instruments.


_STEP_KINDS = ("Fs", "Fsm")


def simulated_motion(
    regressor: Any, values: npt.ArrayLike, samples: Samples, tracking: float | None = None
) -> Samples:
    """Simulate the robot under the measured efforts and a slow tracking controller.

    The controller keeps the simulation close to the measured motion. Noise of the measured
    positions enters only below the bandwidth of the controller; noise of the efforts is integrated
    twice. The integrator is the Runge-Kutta method of fourth order with one step per sample. The
    sign of Coulomb friction is that of the measured velocity.

    Source: Janot, Vandanjon & Gautier 2014 (simulated instruments).

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`, such as the result of
            `regressor`.
        values: (k,) parameters of the columns, physically consistent, so that the inertia matrix is
            positive definite.
        samples: measured motion; its time step must be short compared with the motion.
        tracking: bandwidth of the controller [Hz]. The default is half the bandwidth of the
            samples, or 1/100 of their rate if they are not filtered.

    Returns:
        Simulated q, v, a of the independent joints at the instants of the samples, with the
        measured efforts.

    Raises:
        ModelError: the number of values differs from the number of columns, or the bandwidth of the
            controller is not positive.
        SolverError: the simulation diverged; the parameters are not physically consistent.
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
    acceleration = _tracked_acceleration(regressor, K, 2 * np.pi * follow)
    step = _runge_kutta(acceleration, 1.0 / samples.rate)
    inputs = np.hstack([q_a, v, samples.tau - known_efforts_at(regressor, samples)]).T
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


def _tracked_acceleration(regressor: Any, K: Array, w: float) -> Function:
    """Return the Function (state, given) -> a (m, 1) of the robot with a tracking controller.

    state is (q, v); given is (q_m, v_m, tau): measured motion and efforts. K (k,) are the
    parameters, `w` is the bandwidth of the controller [rad/s].
    """
    m = int(regressor.size1_in(1))
    kind: Any = SX if is_explicit(regressor.system) else MX  # MX for an iterative loop closure
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
    """Return the Function (q_a, v_a, a_a) -> D K: efforts (m, 1) for the parameters K (k,)."""
    m = int(regressor.size1_in(1))
    q, v, a = (MX.sym(name, m) for name in "qva")
    D = motion_function(regressor)(configuration_of(regressor.system, q), v, a)
    function = Function("efforts", [q, v, a], [casadi.mtimes(D, DM(K))])
    return function.expand() if is_explicit(regressor.system) else function


def _runge_kutta(acceleration: Function, h: float) -> Function:
    """Return the Function (x, now, then) -> x of one Runge-Kutta step of length h [s].

    x is (q, v); now and then are the measured inputs at the start and the end of the step.
    """
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
