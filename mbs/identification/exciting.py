"""Exciting trajectories for parameter identification, optimised by nonlinear programming."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, SX, Function, Sparsity

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError, SolverError
from mbs.identification._base_parameters import BaseParameters, base_parameters
from mbs.identification.leading import leads_of, positions
from mbs.identification.regressors import Column, require_columns
from mbs.identification.trajectory import (
    Bound,
    FourierSeries,
    Margin,
    MotionLimit,
    MotionLimits,
    Plane,
    Trajectory,
    between_samples,
    harmonic_terms,
    instant,
    limits_of,
    resting_coefficients,
)
from mbs.numbers import NONZERO
from mbs.progress import progress
from mbs.text import did_you_mean, quoted

# Excitation criteria of the observation matrix W, with exact gradients.

# Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997 (log-determinant); Gautier & Khalil 1992
# (condition number).


Array = npt.NDArray[np.float64]

Criterion = Callable[[Array], tuple[float, Array]]
"""Function of the Gram matrix G = W'W (n, n) that returns a criterion and its gradient (n, n)."""

_POWER = 8


def log_det(G: Array) -> tuple[float, Array]:
    """Return -log det(G)/n and its gradient (n, n), as a criterion of excitation.

    It is the mean logarithm of the parameter variances. A change of units adds a constant only.

    Args:
        G: (n, n) Gram matrix W'W of the observation matrix. If it is not positive definite, value
            and gradient are NaN.
    """
    size = np.sqrt(np.maximum(np.diag(G), NONZERO))
    values, vectors = np.linalg.eigh(G / np.outer(size, size))
    if values[0] <= 0:
        return np.nan, np.full(G.shape, np.nan)
    inverse = (vectors / values) @ vectors.T / np.outer(size, size)
    return -float(np.log(values).sum() + 2 * np.log(size).sum()) / len(G), -inverse / len(G)


def condition(G: Array) -> tuple[float, Array]:
    """Return a smooth upper bound of log(cond(W)) and its gradient (n, n) in G.

    The largest eigenvalue of G is replaced by a high-order norm of all eigenvalues, and the
    smallest by the same norm of their inverses.

    Args:
        G: (n, n) Gram matrix W'W of the observation matrix. If it is not positive definite, value
            and gradient are NaN.
    """
    values, vectors = np.linalg.eigh(G)
    if values[0] <= 0:
        return np.nan, np.full(G.shape, np.nan)
    up, down = (values / values[-1]) ** _POWER, (values[0] / values) ** _POWER
    value = np.log(values[-1] / values[0]) + np.log(up.sum() * down.sum()) / _POWER
    slope = (up / up.sum() - down / down.sum()) / values
    return float(value / 2), (vectors * (slope / 2)) @ vectors.T


def scaled_condition(G: Array) -> tuple[float, Array]:
    """Return `condition` for columns of W scaled to unit length, which is independent of units.

    Args:
        G: (n, n) Gram matrix W'W of the observation matrix.

    Returns:
        Value, and its gradient (n, n) in G.
    """
    size = np.sqrt(np.maximum(np.diag(G), NONZERO))
    S = G / np.outer(size, size)
    value, slope = condition(S)
    gradient = slope / np.outer(size, size)
    np.fill_diagonal(gradient, (np.diag(slope) - np.sum(slope * S, axis=1)) / size**2)
    return value, gradient


CRITERIA: Mapping[str, Criterion] = {
    "log_det": log_det,
    "condition": condition,
    "scaled_condition": scaled_condition,
}


class CriterionFunction(casadi.Callback):
    """CasADi callback ``criterion(G) -> f`` of a Gram matrix G (n, n), with its exact gradient.

    Keep a reference to it for as long as a Function that contains it is used.
    """

    def __init__(self, criterion: Criterion, n: int) -> None:
        casadi.Callback.__init__(self)
        self._criterion = criterion
        self._n = n
        self._slopes: list[_CriterionGradient] = []
        self.construct("criterion", {})

    def get_n_in(self) -> int:
        """Number of inputs: G."""
        return 1

    def get_n_out(self) -> int:
        """Number of outputs: the value of the criterion."""
        return 1

    def get_sparsity_in(self, _: int) -> Sparsity:
        """Shape (n, n) of G."""
        return Sparsity.dense(self._n, self._n)

    def get_sparsity_out(self, _: int) -> Sparsity:
        """Shape (1, 1) of the value."""
        return Sparsity.dense(1, 1)

    def eval(self, arguments: Sequence[DM]) -> list[DM]:
        """Return the value of the criterion for the Gram matrix in `arguments`."""
        return [DM(self._criterion(np.array(arguments[0]))[0])]

    def has_jacobian(self) -> bool:
        """Whether a Jacobian is available: always."""
        return True

    def get_jacobian(self, name: str, *_: Any) -> casadi.Function:
        """Return a callback of (G, f) for the gradient as one row (1, n^2), with this name."""
        self._slopes.append(_CriterionGradient(self._criterion, self._n, name))
        return self._slopes[-1]


class _CriterionGradient(casadi.Callback):
    """CasADi callback ``(G, f) -> df/dG`` (1, n^2): gradient of a criterion of G (n, n)."""

    def __init__(self, criterion: Criterion, n: int, name: str) -> None:
        casadi.Callback.__init__(self)
        self._criterion = criterion
        self._n = n
        self.construct(name, {})

    def get_n_in(self) -> int:
        return 2

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, k: int) -> Sparsity:
        return Sparsity.dense(self._n, self._n) if k == 0 else Sparsity.dense(1, 1)

    def get_sparsity_out(self, _: int) -> Sparsity:
        return Sparsity.dense(1, self._n**2)

    def eval(self, arguments: Sequence[DM]) -> list[DM]:
        gradient = self._criterion(np.array(arguments[0]))[1]
        return [DM(gradient.reshape(1, -1))]


# Optimisation by IPOPT with progress reports.


Watch = Callable[[float], None]
"""Progress callback; its argument is the completed fraction of the work, between 0 and 1."""

_OUTPUTS = ("x", "f", "g", "lam_x", "lam_g", "lam_p")


class SolverFollower(casadi.Callback):
    """Iteration callback of a CasADi nlpsol solver that reports the progress of the optimisation.

    Keep a reference to it for as long as the solver is used. `watch` is called with the completed
    fraction of `most` iterations.
    """

    def __init__(
        self, programme: Mapping[str, SX | MX], most: int, watch: Watch | None = None
    ) -> None:
        casadi.Callback.__init__(self)
        self._sizes = [programme[name].numel() for name in "xfg"]
        self._most = most
        self._watch = watch
        self._steps = 0
        self.construct("follower", {})

    @property
    def options(self) -> dict[str, Any]:
        """Solver options that install the callback; empty if there is no `watch`."""
        return {} if self._watch is None else {"iteration_callback": self}

    def get_n_in(self) -> int:
        """Number of inputs: outputs of the solver at an iteration."""
        return len(_OUTPUTS)

    def get_n_out(self) -> int:
        """Number of outputs: the stop flag."""
        return 1

    def get_name_in(self, k: int) -> str:
        """Name of input k, equal to that of the solver output."""
        return _OUTPUTS[k]

    def get_sparsity_in(self, k: int) -> Sparsity:
        """Shape of input k, a column; the programme has no parameters."""
        x, f, g = self._sizes
        return Sparsity.dense((x, f, g, x, g, 0)[k], 1 if k < 5 else 0)

    def eval(self, _: Sequence[DM]) -> list[int]:
        """Report the progress and return 0, which lets the solver continue."""
        self._steps += 1
        if self._watch is not None:
            self._watch(min(self._steps / self._most, 1.0))
        return [0]


# Optimisation of Fourier coefficients as a nonlinear programme with exact gradients.


_STARTS = 30
"""Number of random motions, of which the motion with the lowest criterion is the initial guess."""
_FILLED = 0.9
"""Largest fraction of the ranges that random motions use; a half and a quarter of it are tried
as well. The motions are thus inside all ranges, with a margin for limits such as efforts, which
may be reached earlier."""
_ROUNDING = 1e-12
"""Magnitude, relative to the largest element of its column, below which a matrix element counts
as zero. Rounding errors of sines are 1e-16; the smallest nonzero elements are far above 1e-6."""


@dataclass(frozen=True, slots=True, eq=False)
class OptimisationEnd:
    """Result of an optimisation.

    Attributes:
        x: variables at the end.
        value: value of the criterion.
        violation: largest violation of a limit, as a fraction of its range.
        status: return status of IPOPT.
        steps: number of iterations of IPOPT.
    """

    x: Array
    value: float
    violation: float
    status: str
    steps: int


@dataclass(frozen=True, slots=True, eq=False)
class Programme:
    """Nonlinear programme for a rest-to-rest Fourier series within limits.

    The variables are q0 (m, 1), followed by the coefficients of each joint in the basis of motions
    that start at rest.

    Attributes:
        period: period of the motion [s].
        harmonics: number of harmonics, two or more.
        samples: number of equally spaced instants in one period.
        instant: Function of `mbs.identification.trajectory.instant`.
        criterion: criterion of the observations at all samples.
        limits: limits of the motion.
    """

    period: float
    harmonics: int
    samples: int
    instant: Function
    criterion: Criterion
    limits: MotionLimits

    @property
    def joints(self) -> int:
        """Number m of independent joints."""
        return int(self.instant.size1_in(0))

    def series(self, x: Array) -> FourierSeries:
        """Return the Fourier series of the programme variables x (m (2 harmonics - 1),)."""
        m, H = self.joints, self.harmonics
        Y = x[m:].reshape(m, 2 * H - 2) @ resting_coefficients(self.period, H).T
        return FourierSeries(self.period, x[:m], Y[:, :H], Y[:, H:])

    def start(self, rng: np.random.Generator) -> Array:
        """Return the variables of the best of 30 random motions within the ranges of the joints.

        Args:
            rng: random number generator.

        Raises:
            SolverError: no random motion gives observations of full column rank.
        """
        rates, value_at = self._motion_matrix(), self._evaluation()
        found: list[tuple[float, Array]] = []
        for k in range(_STARTS):
            x = self._random(rates, _FILLED * 0.5 ** (k % 3), rng)
            value = value_at(x)
            if np.isfinite(value):
                found.append((value, x))
        if not found:
            raise SolverError(
                "excitation: no random motion in the ranges of the joints tells all columns apart;"
                " group them with base_parameters, or give wider ranges"
            )
        return min(found, key=lambda pair: pair[0])[1]

    def _random(self, rates: Array, filled: float, rng: np.random.Generator) -> Array:
        """Return the variables of a random motion over the fraction `filled` of the joint ranges.

        `rates` is the matrix of `_motion_matrix`.
        """
        m = self.joints
        lower, upper = self._ranges(1.0)
        middle = (lower[:m] + upper[:m]) / 2
        Y = rng.standard_normal((m, 2 * self.harmonics - 2))
        moved = (rates[:, m:] @ Y.ravel()).reshape(3, m, self.samples)
        room = np.concatenate([(upper[:m] - lower[:m]) / 2, np.minimum(upper, -lower)[m:]])
        most = (np.abs(moved).max(axis=2) / room.reshape(3, m)).max(axis=0)
        return np.concatenate([middle, (filled * Y / most[:, None]).ravel()])

    def improve(
        self, x: Array, tightened: Array, rounds: int, watch: Watch | None = None
    ) -> OptimisationEnd:
        """Minimise the criterion within the limits.

        Args:
            x: variables of the initial guess.
            tightened: (r,) reduction of the ranges of efforts, passive positions and planes at each
                end, in the units of the limits.
            rounds: maximum number of iterations.
            watch: progress callback; its argument is the completed fraction of the iterations.

        Returns:
            Result with the last variables, even if they are not a minimum.
        """
        variables, W, bounded = self._graph()
        criterion = CriterionFunction(self.criterion, W.shape[0])
        rates = self._limited_motion_rows()
        rows, ends = self._bounded_models(tightened)
        g = casadi.vertcat(_product(rates[0], variables), casadi.vec(bounded[rows, :]))
        scale = np.concatenate([rates[2] - rates[1], np.tile(_spans(ends), self.samples)])
        lower = np.concatenate([rates[1], np.tile(ends[:, 0], self.samples)]) / scale
        upper = np.concatenate([rates[2], np.tile(ends[:, 1], self.samples)]) / scale
        programme: dict[str, Any] = {"x": variables, "f": criterion(W @ W.T), "g": g / DM(scale)}
        follower = SolverFollower(programme, rounds, watch)
        options = follower.options | _options(rounds)
        solver = casadi.nlpsol("excitation", "ipopt", programme, options)
        answer = solver(x0=x, lbg=lower, ubg=upper)
        status = solver.stats()
        reached = np.array(answer["g"]).ravel()
        return OptimisationEnd(
            np.array(answer["x"]).ravel(),
            float(answer["f"]),
            float(np.maximum(lower - reached, reached - upper).max()),
            str(status["return_status"]),
            int(status["iter_count"]),
        )

    def _graph(self) -> tuple[MX, MX, MX]:
        """Return variables, W' (k, m samples) and limited model quantities (r, samples) as MX."""
        variables = MX.sym("x", self.joints * (2 * self.harmonics - 1))
        moved = casadi.reshape(
            _product(self._motion_matrix(), variables), self.samples, 3 * self.joints
        ).T
        q, v, a = casadi.vertsplit(moved, self.joints)
        W, bounded = self.instant.map(self.samples)(q, v, a)
        return variables, W, bounded

    def _evaluation(self) -> Callable[[Array], float]:
        """Return a callable from the variables of a motion to the value of its criterion."""
        variables, W, _ = self._graph()
        gram = Function("gram", [variables], [W @ W.T])
        return lambda x: self.criterion(np.array(gram(x)))[0]

    def _motion_matrix(self) -> Array:
        """Return the matrix (3 m samples, variables) that maps variables to q, v and a."""
        m, H = self.joints, self.harmonics
        t = np.arange(self.samples) * self.period / self.samples
        basis = resting_coefficients(self.period, H)
        ones = np.ones((self.samples, 1))
        blocks = []
        for order in range(3):
            terms = harmonic_terms(t, self.period, H, order) @ basis
            own = np.kron(np.eye(m), ones if order == 0 else 0 * ones)
            blocks.append(np.hstack([own, np.kron(np.eye(m), terms)]))
        return np.vstack(blocks)

    def _ranges(self, part: float) -> tuple[Array, Array]:
        """Return the lower and upper limits (3 m,) of q, v and a; infinite without a limit.

        Finite ranges are scaled about their middles by the factor `part`.
        """
        ends = np.array([(limit.lower, limit.upper) for limit in self.limits.of_rates])
        limited = np.isfinite(ends).all(axis=1)
        half = np.where(limited[:, None], ends, 0.0).sum(axis=1) / 2
        return half + part * (ends[:, 0] - half), half + part * (ends[:, 1] - half)

    def _limited_motion_rows(self) -> tuple[Array, Array, Array]:
        """Return the limited rows of `_motion_matrix`, with their lower and upper limits.

        The ranges are reduced so that the limits also hold between samples.
        """
        lower, upper = self._ranges(between_samples(self.samples, self.harmonics))
        limited = np.repeat(np.isfinite(lower) & np.isfinite(upper), self.samples)
        first, last = (np.repeat(x, self.samples)[limited] for x in (lower, upper))
        return self._motion_matrix()[limited], first, last

    def _bounded_models(self, tightened: Array) -> tuple[list[int], Array]:
        """Return indices and ranges (rows, 2) of the limited quantities of models.

        These are efforts, passive positions and planes. Both ends of each range are reduced by
        `tightened` (r,).
        """
        every: tuple[MotionLimit, ...] = self.limits.of_models
        rows = [k for k, limit in enumerate(every) if limit.is_finite]
        ends = [(every[k].lower + tightened[k], every[k].upper - tightened[k]) for k in rows]
        return rows, np.array(ends).reshape(-1, 2)


def _product(A: Array, x: MX) -> MX:
    """Return A x as a dense column; elements of A that are rounding errors count as zero.

    Rows of A that are entirely zero (velocities at rest) remain in the result.
    """
    sizes = np.abs(A)
    structure = np.where(sizes > _ROUNDING * sizes.max(axis=0, initial=0.0), A, 0.0)
    product: MX = casadi.densify(casadi.sparsify(DM(structure)) @ x)
    return product


def _spans(ends: Array) -> Array:
    """Return widths (rows,) of ranges `ends` (rows, 2); 1 for ranges that are open on one side."""
    span = ends[:, 1] - ends[:, 0]
    return np.where(np.isfinite(span), span, 1.0)


def _options(rounds: int) -> dict[str, Any]:
    """Return the options of the Ipopt solver, with at most `rounds` iterations."""
    return {
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "max_iter": rounds,
            "tol": 1e-4,  # of a mean logarithm: such an error does not change deviations
            "hessian_approximation": "limited-memory",
            "mu_strategy": "adaptive",
            "constr_viol_tol": 1e-8,  # fraction of a limit, below the tolerance of the final check
        },
        "print_time": False,
        "error_on_fail": False,
    }


# Exciting motions of a robot within its limits.


_FINE = 8
_TRIES = 4
_FIRST_ROUNDS = 60
_SIGN_PART = 0.02
"""Fraction of the largest velocity over which Coulomb friction changes sign during
optimisation: some samples lie in the transition, and its slope is small enough for a gradient
method."""
_ALLOWED = 1e-6
"""Fraction of a limit by which a motion may exceed it: less than the resolution of any drive,
and more than the tolerance of the optimisation."""
_MORE = 1.2
"""Factor on the excess over a limit by which the limit is tightened, so that the next
optimisation ends inside."""


@dataclass(frozen=True, slots=True)
class FourierSettings:
    """Settings of the Fourier series of an excitation and of its sampling.

    Attributes:
        period: period [s].
        harmonics: number of multiples of 1/period, two or more.
        samples: number of samples per period at which the criterion and the limits are evaluated.
    """

    period: float = 10.0
    harmonics: int = 5
    samples: int = 100

    def __post_init__(self) -> None:
        if not (np.isfinite(self.period) and self.period > 0):
            raise ModelError(f"excitation: the period is {self.period:g} s; give a positive time")
        for name in ("harmonics", "samples"):
            number = getattr(self, name)
            if not isinstance(number, int):
                raise ModelError(f"excitation: {name} is {quoted(number)}; give a whole number")
        if self.harmonics < 2:
            raise ModelError(
                f"excitation: {self.harmonics} harmonics cannot start and end at rest; give 2 or"
                " more"
            )
        if self.samples < 4 * self.harmonics:
            raise ModelError(
                f"excitation: {self.samples} samples are too few for {self.harmonics} harmonics;"
                f" give {4 * self.harmonics} or more"
            )


def excitation(
    system: System,
    columns: BaseParameters | Sequence[Column] | None = None,
    *,
    series: FourierSettings | None = None,
    position: Bound = None,
    velocity: Bound = None,
    acceleration: Bound = None,
    effort: Bound = None,
    planes: Sequence[Plane] = (),
    objective: str = "log_det",
    starts: int = 3,
    rounds: int = 150,
    seed: int = 1,
    quiet: bool = False,
) -> Trajectory:
    """Compute a periodic rest-to-rest motion within limits that excites the parameters.

    IPOPT minimises a criterion of the regressor at all samples over the Fourier coefficients of the
    independent joints, with exact gradients. Efforts are computed with the present parameters of
    the system. Limits of positions, velocities and accelerations hold at every instant; limits of
    efforts and planes hold at instants eight times as dense as the samples. Closed systems stay
    away from configurations at which the independent joints do not determine the other joints.

    During optimisation, the sign of velocities in Coulomb friction is smoothed over 1/50 of the
    largest velocity. The condition numbers of the result are of the regressor without smoothing.

    Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997.

    Args:
        system: open or closed; its independent joints are revolute or prismatic.
        columns: parameters to be identified: base parameters, or linearly independent columns. The
            default is `base_parameters(system)`.
        series: period, harmonics and samples.
        position: limits of the m independent joints [rad or m]. A number means a symmetric range
            +-; a sequence has one entry for each joint; a dict maps joint names to ranges and may
            contain passive joints. The default is the range of each joint.
        velocity: limits in the same form [rad/s or m/s]. The default is the velocity limits of the
            joints; None in a sequence or dict means no limit.
        acceleration: limits in the same form [rad/s2 or m/s2]. The default is no limit.
        effort: limits in the same form [N m or N]. The default is the effort limits of the joints.
        planes: planes that points of the robot must not cross.
        objective: "log_det" (smallest volume of the confidence ellipsoid of the parameters),
            "condition" (condition number of the regressor in SI units) or "scaled_condition" (with
            columns of unit length).
        starts: number of initial motions that are optimised briefly; the best is optimised further.
        rounds: maximum number of iterations of the final optimisation.
        seed: seed of the random motions.
        quiet: whether to hide the progress bar.

    Raises:
        ModelError: a limit, a name or a number is invalid.
        SolverError: no motion within the limits was found, or no motion gives a regressor of full
            column rank.
    """
    require_system(system)
    _check(system, objective, starts, rounds)
    limits = limits_of(
        system,
        position,
        velocity=velocity,
        acceleration=acceleration,
        effort=effort,
        planes=planes,
    )
    form = _settings(series)
    chosen = _columns(system, columns)
    smooth = _with_smooth_friction(system, limits, form)
    function = instant(smooth, chosen, limits)
    programme = Programme(
        form.period, form.harmonics, form.samples, function, CRITERIA[objective], limits
    )
    measured = partial(_measured_trajectory, system, chosen, programme)
    steps = _FIRST_ROUNDS * (starts if starts > 1 else 0)
    with progress(f"{system.name}: excitation", 0.0, steps + rounds, quiet=quiet) as reached:
        x = _best_start(programme, np.random.default_rng(seed), starts, reached)
        found = _limited_motion(
            programme, measured, x, rounds, lambda part: reached(steps + part * rounds)
        )
    return replace(found, objective=objective)


def _best_start(
    programme: Programme, rng: np.random.Generator, starts: int, reached: Watch
) -> Array:
    """Return the variables of the random motion with the best result of a short optimisation.

    Args:
        programme: nonlinear programme.
        rng: random number generator of the motions.
        starts: number of random motions.
        reached: callback; its argument is the number of completed iterations.
    """
    x = [programme.start(rng) for _ in range(starts)]
    if starts == 1:
        return x[0]
    still = np.zeros(len(programme.limits.of_models))
    found = []
    for number, first in enumerate(x):
        found.append(programme.improve(first, still, _FIRST_ROUNDS))
        reached(_FIRST_ROUNDS * (number + 1))
    return min(found, key=lambda answer: (answer.violation > _ALLOWED, answer.value)).x


def _limited_motion(
    programme: Programme,
    measured: Callable[[Array], Trajectory],
    x: Array,
    rounds: int,
    watch: Watch,
) -> Trajectory:
    """Return the optimal motion near the variables x that keeps all limits also between samples.

    Limits that `measured` (variables -> Trajectory) finds exceeded are tightened and the
    optimisation is repeated. Raises SolverError if this does not succeed.

    `rounds` is the maximum number of iterations, `watch` the progress callback.
    """
    narrowed = np.zeros(len(programme.limits.of_models))
    fixed = len(programme.limits.of_rates)
    for _ in range(_TRIES):
        answer = programme.improve(x, narrowed, rounds, watch)
        trajectory = measured(answer.x)
        excess = np.array([max(-margin.worst, 0.0) for margin in trajectory.margins[fixed:]])
        parts = np.array([margin.part for margin in trajectory.margins])
        if (parts >= -_ALLOWED).all():
            return replace(trajectory, status=answer.status, steps=answer.steps)
        narrowed, x = narrowed + _MORE * excess, answer.x
    worst = min(trajectory.margins, key=lambda margin: margin.part)
    raise SolverError(
        f"{trajectory.system.name}: the {worst.limit.quantity} of {worst.limit.name} passes its"
        f" limit by {-worst.worst:.3g} {worst.limit.unit} in the best motion that was found; give"
        " wider limits, a longer period or more rounds"
    )


def _measured_trajectory(
    system: System, columns: tuple[Column, ...], programme: Programme, x: Array
) -> Trajectory:
    """Return the motion of the variables x with its condition numbers and margins.

    They are evaluated at instants eight times as dense as the samples, without smoothed friction.

    `programme` maps x to the motion; `columns` are the parameters to identify.
    """
    motion, limits = programme.series(x), programme.limits
    exact = instant(system, columns, limits)
    n = _FINE * programme.samples
    t = np.arange(n) * programme.period / n
    rates = motion.q(t), motion.v(t), motion.a(t)
    values = [np.array(value) for value in exact.map(n)(*(DM(x.T) for x in rates))]
    if limits.leading:
        values[1][-1] = leads_of(system, positions(system, rates[0]))
    quantities = [*np.hstack(rates).T, *values[1]]
    names: list[MotionLimit] = [*limits.of_rates, *limits.of_models]
    margins = tuple(
        Margin(limit, float(row.min()), float(row.max()))
        for limit, row in zip(names, quantities, strict=True)
    )
    W = values[0].reshape(len(columns), -1)
    lengths = np.linalg.norm(W, axis=1)
    return Trajectory(
        system=system,
        columns=columns,
        series=motion,
        condition=_condition(W),
        scaled_condition=_condition(W / lengths[:, None]),
        margins=margins,
    )


def _settings(series: FourierSettings | None) -> FourierSettings:
    """Return the settings of the Fourier series; defaults for None. Raise for a wrong type."""
    if series is None:
        return FourierSettings()
    if not isinstance(series, FourierSettings):
        raise ModelError(
            f"excitation: the series is {quoted(series)}; give"
            " mbs.identification.FourierSettings(period=, harmonics=, samples=)"
        )
    return series


def _columns(
    system: System, columns: BaseParameters | Sequence[Column] | None
) -> tuple[Column, ...]:
    """Return the parameters to identify: `columns`, or the base parameters of the system for None.

    Raises ModelError for an empty selection or an element that is no Column.
    """
    if columns is None:
        return tuple(base_parameters(system).kept)
    chosen = tuple(columns if isinstance(columns, Sequence) else columns.kept)
    require_columns(system, chosen)
    if not chosen:
        raise ModelError(f"{system.name}: no column is to be identified; give one or more")
    return chosen


def _with_smooth_friction(system: System, limits: MotionLimits, form: FourierSettings) -> System:
    """Return a copy of the system in which Coulomb friction changes its sign continuously.

    The width of the transition is a fraction of the largest velocity of each joint, from `limits`
    or, without a limit, from the position range and the period in `form`.
    """
    widths = {}
    rows = zip(system.independent, limits.position, limits.velocity, strict=True)
    for k, position, velocity in rows:
        span = np.pi * (position.upper - position.lower) / form.period
        fastest = velocity.upper if velocity.is_finite else span
        widths[system.velocity_coordinates[k].name] = SX(_SIGN_PART * fastest)
    links = tuple(
        replace(link, Fs_width=widths.get(link.name, link.Fs_width)) for link in system.tree.links
    )
    return replace(system, tree=replace(system.tree, links=links), _cache={})


def _check(system: System, objective: str, starts: int, rounds: int) -> None:
    """Raise ModelError for an unknown objective or a number of starts or rounds below 1."""
    if objective not in CRITERIA:
        raise ModelError(
            f"excitation: there is no objective {objective!r}; {did_you_mean(objective, CRITERIA)}"
        )
    for name, number in {"starts": starts, "rounds": rounds}.items():
        if number < 1:
            raise ModelError(f"excitation: {number} {name} give no motion; give 1 or more")
    if tuple(system.chosen_coordinates) != tuple(system.independent):
        raise ModelError(
            f"{system.name}: some independent joints have velocities alone, such as discs that"
            " roll; excitation is for positions that are independent too"
        )


def _condition(W: Array) -> float:
    """Return the condition number of the matrix W: its largest over its smallest singular value."""
    values = np.linalg.svd(W, compute_uv=False)
    return float(values[0] / values[-1])
