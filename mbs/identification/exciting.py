"""Motions that show the parameters of a robot, found by a nonlinear programme."""

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
from mbs.identification.base_parameters import BaseParameters, base_parameters
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

# How badly observations W tell parameters apart, as a number with an exact gradient.
#
# Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997 (log-determinant); Gautier & Khalil
# 1992 (condition number).


Array = npt.NDArray[np.float64]

Criterion = Callable[[Array], tuple[float, Array]]
"""Value, and its (n, n) gradient, for the Gram matrix W'W (n, n) of the observations."""

_POWER = 8


def log_det(G: Array) -> tuple[float, Array]:
    """-log det(W'W)/n: the mean logarithm of the variances, the same in all units but for a sum."""
    size = np.sqrt(np.maximum(np.diag(G), NONZERO))
    values, vectors = np.linalg.eigh(G / np.outer(size, size))
    if values[0] <= 0:
        return np.nan, np.full(G.shape, np.nan)
    inverse = (vectors / values) @ vectors.T / np.outer(size, size)
    return -float(np.log(values).sum() + 2 * np.log(size).sum()) / len(G), -inverse / len(G)


def condition(G: Array) -> tuple[float, Array]:
    """The logarithm of the condition number of W in SI units, made smooth.

    The largest and the smallest eigenvalue of W'W are taken as norms of high order of all
    eigenvalues and of their inverses, which are never smaller.
    """
    values, vectors = np.linalg.eigh(G)
    if values[0] <= 0:
        return np.nan, np.full(G.shape, np.nan)
    up, down = (values / values[-1]) ** _POWER, (values[0] / values) ** _POWER
    value = np.log(values[-1] / values[0]) + np.log(up.sum() * down.sum()) / _POWER
    slope = (up / up.sum() - down / down.sum()) / values
    return float(value / 2), (vectors * (slope / 2)) @ vectors.T


def scaled_condition(G: Array) -> tuple[float, Array]:
    """The same of W with columns of length one, which no choice of units moves."""
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
    """``criterion(G) -> f`` within a CasADi graph; its Jacobian is the gradient of the criterion.

    It must be kept as long as a Function that holds it.
    """

    def __init__(self, criterion: Criterion, n: int) -> None:
        casadi.Callback.__init__(self)
        self._criterion = criterion
        self._n = n
        self._slopes: list[_Slope] = []
        self.construct("criterion", {})

    def get_n_in(self) -> int:
        """G."""
        return 1

    def get_n_out(self) -> int:
        """Its value."""
        return 1

    def get_sparsity_in(self, _: int) -> Sparsity:
        """(n, n)."""
        return Sparsity.dense(self._n, self._n)

    def get_sparsity_out(self, _: int) -> Sparsity:
        """(1, 1)."""
        return Sparsity.dense(1, 1)

    def eval(self, arguments: Sequence[DM]) -> list[DM]:
        """The value."""
        return [DM(self._criterion(np.array(arguments[0]))[0])]

    def has_jacobian(self) -> bool:
        """Yes."""
        return True

    def get_jacobian(self, name: str, *_: Any) -> casadi.Function:
        """The gradient as one row."""
        self._slopes.append(_Slope(self._criterion, self._n, name))
        return self._slopes[-1]


class _Slope(casadi.Callback):
    """``(G, f) -> df/dG`` (1, n^2)."""

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


# A search by IPOPT that tells how far it has come.


Watch = Callable[[float], None]
"""Is told the part of a long work that is over, between 0 and 1."""

_OUTPUTS = ("x", "f", "g", "lam_x", "lam_g", "lam_p")


class SolverFollower(casadi.Callback):
    """Called by the solver after every step; it must be kept as long as the solver."""

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
        """What the solver has to know; nothing where nobody watches."""
        return {} if self._watch is None else {"iteration_callback": self}

    def get_n_in(self) -> int:
        """What the solver gives after a step."""
        return len(_OUTPUTS)

    def get_n_out(self) -> int:
        """Whether it is to stop."""
        return 1

    def get_name_in(self, k: int) -> str:
        """As the solver calls its outputs."""
        return _OUTPUTS[k]

    def get_sparsity_in(self, k: int) -> Sparsity:
        """Columns; there are no parameters."""
        x, f, g = self._sizes
        return Sparsity.dense((x, f, g, x, g, 0)[k], 1 if k < 5 else 0)

    def eval(self, _: Sequence[DM]) -> list[int]:
        """Never stops the solver."""
        self._steps += 1
        if self._watch is not None:
            self._watch(min(self._steps / self._most, 1.0))
        return [0]


# The search for Fourier coefficients as a nonlinear programme with exact gradients.


_STARTS = 30
"""Random motions of which the best is taken to begin with."""
_FILLED = 0.9
"""Part of the ranges that these fill at most, a half and a quarter of it as well: inside all
limits, and with room for limits of models, such as efforts, that are met sooner."""
_ROUNDING = 1e-12
"""Part of the largest element of its column below which an element of the rates is zero: sines are
rounded to 1e-16, and the least of those that are not zero is far above 1e-6."""


@dataclass(frozen=True, slots=True, eq=False)
class SearchEnd:
    """How a search ended.

    Attributes:
        x: variables.
        value: of the criterion.
        violation: largest of a limit, as part of its range.
        status: of IPOPT.
        steps: of IPOPT.
    """

    x: Array
    value: float
    violation: float
    status: str
    steps: int


@dataclass(frozen=True, slots=True, eq=False)
class Programme:
    """A motion of rest-to-rest Fourier series and what is asked of it.

    The variables are q0 (m, 1), then the coefficients of each joint in the basis of motions that
    start at rest.

    Attributes:
        period: [s].
        harmonics: two or more.
        samples: instants in equal steps of one period.
        instant: see `mbs.identification.trajectory.instant`.
        criterion: of the observations at all samples.
        limits: of the motion.
    """

    period: float
    harmonics: int
    samples: int
    instant: Function
    criterion: Criterion
    limits: MotionLimits

    @property
    def joints(self) -> int:
        """M."""
        return int(self.instant.size1_in(0))

    def series(self, x: Array) -> FourierSeries:
        """The motion that variables stand for."""
        m, H = self.joints, self.harmonics
        Y = x[m:].reshape(m, 2 * H - 2) @ resting_coefficients(self.period, H).T
        return FourierSeries(self.period, x[:m], Y[:, :H], Y[:, H:])

    def start(self, rng: np.random.Generator) -> Array:
        """Variables of the best of some random motions that keep the ranges of the joints.

        Raises:
            SolverError: none of them gives observations that tell all columns apart.
        """
        rates, value_at = self._rates(), self._evaluation()
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
        """Variables of a motion that fills this part of the ranges about their middles."""
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
    ) -> SearchEnd:
        """Variables at a minimum of the criterion within the limits.

        Args:
            x: to start from.
            tightened: (r,) by how much the ranges of the models' quantities are narrowed.
            rounds: largest number of steps.
            watch: is told the part of the steps that is over, between 0 and 1.

        Returns:
            the last variables, also where they are no minimum.
        """
        variables, W, bounded = self._graph()
        criterion = CriterionFunction(self.criterion, W.shape[0])
        rates = self._bounded_rates()
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
        return SearchEnd(
            np.array(answer["x"]).ravel(),
            float(answer["f"]),
            float(np.maximum(lower - reached, reached - upper).max()),
            str(status["return_status"]),
            int(status["iter_count"]),
        )

    def _graph(self) -> tuple[MX, MX, MX]:
        """Variables, W' (k, m samples) and bounded (r, samples)."""
        variables = MX.sym("x", self.joints * (2 * self.harmonics - 1))
        moved = casadi.reshape(_product(self._rates(), variables), self.samples, 3 * self.joints).T
        q, v, a = casadi.vertsplit(moved, self.joints)
        W, bounded = self.instant.map(self.samples)(q, v, a)
        return variables, W, bounded

    def _evaluation(self) -> Callable[[Array], float]:
        variables, W, _ = self._graph()
        gram = Function("gram", [variables], [W @ W.T])
        return lambda x: self.criterion(np.array(gram(x)))[0]

    def _rates(self) -> Array:
        """(3 m samples, variables): positions, velocities, accelerations, joint by joint."""
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
        """(3 m,) ends of the ranges of positions, velocities and accelerations."""
        ends = np.array([(limit.lower, limit.upper) for limit in self.limits.of_rates])
        limited = np.isfinite(ends).all(axis=1)
        half = np.where(limited[:, None], ends, 0.0).sum(axis=1) / 2
        return half + part * (ends[:, 0] - half), half + part * (ends[:, 1] - half)

    def _bounded_rates(self) -> tuple[Array, Array, Array]:
        """Rows of `_rates` that are limited, and the ends of their ranges between samples too."""
        lower, upper = self._ranges(between_samples(self.samples, self.harmonics))
        limited = np.repeat(np.isfinite(lower) & np.isfinite(upper), self.samples)
        first, last = (np.repeat(x, self.samples)[limited] for x in (lower, upper))
        return self._rates()[limited], first, last

    def _bounded_models(self, tightened: Array) -> tuple[list[int], Array]:
        """Rows of the models' quantities that are limited, and (rows, 2) ends of their ranges."""
        every: tuple[MotionLimit, ...] = self.limits.of_models
        rows = [k for k, limit in enumerate(every) if limit.is_finite]
        ends = [(every[k].lower + tightened[k], every[k].upper - tightened[k]) for k in rows]
        return rows, np.array(ends).reshape(-1, 2)


def _product(A: Array, x: MX) -> MX:
    """A x, dense also where rows of A are zero, as those of velocities at rest are."""
    sizes = np.abs(A)
    structure = np.where(sizes > _ROUNDING * sizes.max(axis=0, initial=0.0), A, 0.0)
    product: MX = casadi.densify(casadi.sparsify(DM(structure)) @ x)
    return product


def _spans(ends: Array) -> Array:
    """(rows,) sizes of ranges; of those open on one side, one."""
    span = ends[:, 1] - ends[:, 0]
    return np.where(np.isfinite(span), span, 1.0)


def _options(rounds: int) -> dict[str, Any]:
    return {
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "max_iter": rounds,
            "tol": 1e-4,  # a criterion is a mean logarithm: what is left changes no deviation
            "hessian_approximation": "limited-memory",
            "mu_strategy": "adaptive",
            "constr_viol_tol": 1e-8,  # in parts of a limit, below what is allowed in the end
        },
        "print_time": False,
        "error_on_fail": False,
    }


# Motions of a robot that show its dynamic parameters as well as its limits allow.


_FINE = 8
_TRIES = 4
_FIRST_ROUNDS = 60
_SIGN_PART = 0.02
"""Part of the largest velocity over which Coulomb friction changes sign in the search: some samples
of a motion see the change, and its slope is one that a search can follow."""
_ALLOWED = 1e-6
"""Part of a limit by which a motion may pass it: less than any drive tells, more than the search
leaves."""
_MORE = 1.2
"""How much more than they are passed limits are narrowed by, so that the next search ends
inside."""


@dataclass(frozen=True, slots=True)
class Series:
    """The form of the motion and how it is sampled.

    Attributes:
        period: [s].
        harmonics: of 1/period; two or more.
        samples: of one period, at which the criterion and the limits are computed.
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
    series: Series | None = None,
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
    """A periodic motion from rest to rest that shows the parameters well within the limits.

    The coefficients of Fourier series of the independent joints minimise a criterion of the
    regressor at all samples, by IPOPT with exact gradients. Efforts are those of the parameters
    that the system has. Ranges of positions, velocities and accelerations hold at every instant;
    those of efforts and planes, at instants eight times as dense as the samples. Closed systems
    keep clear of configurations at which the independent joints do not lead the others.

    The sign of velocities is smoothed over a fiftieth of the largest velocity while the motion is
    sought; the condition numbers of the answer are of the regressor as it is.

    Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997.

    Args:
        system: open or closed, its independent joints revolute or prismatic.
        columns: what is to be identified: base parameters, or columns that do not depend on each
            other; `base_parameters(system)` when left out.
        series: period, harmonics and samples.
        position: limits of the m independent joints [rad or m]; the ranges of the joints when
            left out. A number is meant as +-; a sequence gives each joint its own; a dict names
            joints, those that follow the independent ones included.
        velocity: likewise [rad/s or m/s], those that the joints describe when left out; None in
            a sequence or dict is no limit.
        acceleration: likewise [rad/s2 or m/s2], none when left out.
        effort: likewise [N m or N], those that the joints describe when left out.
        planes: that points must not pass.
        objective: "log_det" (smallest volume of the parameters' uncertainty), "condition" (of the
            regressor in SI units) or "scaled_condition" (with columns of length one).
        starts: random motions that are improved; the best goes on.
        rounds: largest number of steps of the last search.
        seed: of the random motions.
        quiet: no progress bar.

    Raises:
        ModelError: a limit, a name or a number has no sense.
        SolverError: no motion within the limits was found, or none tells the columns apart.
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
    form = _form(series)
    chosen = _columns(system, columns)
    smooth = _smooth(system, limits, form)
    function = instant(smooth, chosen, limits)
    programme = Programme(
        form.period, form.harmonics, form.samples, function, CRITERIA[objective], limits
    )
    measured = partial(_measure, system, chosen, programme)
    steps = _FIRST_ROUNDS * (starts if starts > 1 else 0)
    with progress(f"{system.name}: excitation", 0.0, steps + rounds, quiet=quiet) as reached:
        x = _best(programme, np.random.default_rng(seed), starts, reached)
        found = _within(programme, measured, x, rounds, lambda part: reached(steps + part * rounds))
    return replace(found, objective=objective)


def _best(programme: Programme, rng: np.random.Generator, starts: int, reached: Watch) -> Array:
    """Variables of the random motion that leads furthest in a short search.

    Args:
        programme: to be solved.
        rng: of the random motions.
        starts: how many there are.
        reached: is told the steps that are over.
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


def _within(
    programme: Programme,
    measured: Callable[[Array], Trajectory],
    x: Array,
    rounds: int,
    watch: Watch,
) -> Trajectory:
    """The motion at the minimum near x, efforts and planes kept between samples too."""
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


def _measure(
    system: System, columns: tuple[Column, ...], programme: Programme, x: Array
) -> Trajectory:
    """The motion with its condition numbers and margins, of the system as it is."""
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


def _form(series: Series | None) -> Series:
    if series is None:
        return Series()
    if not isinstance(series, Series):
        raise ModelError(
            f"excitation: the series is {quoted(series)}; give"
            " mbs.identification.Series(period=, harmonics=, samples=)"
        )
    return series


def _columns(
    system: System, columns: BaseParameters | Sequence[Column] | None
) -> tuple[Column, ...]:
    if columns is None:
        return tuple(base_parameters(system).kept)
    chosen = tuple(columns if isinstance(columns, Sequence) else columns.kept)
    require_columns(system, chosen)
    if not chosen:
        raise ModelError(f"{system.name}: no column is to be identified; give one or more")
    return chosen


def _smooth(system: System, limits: MotionLimits, form: Series) -> System:
    """The system with Coulomb friction that changes sign over a part of the largest velocity."""
    widths = {}
    rows = zip(system.active, limits.position, limits.velocity, strict=True)
    for k, position, velocity in rows:
        span = np.pi * (position.upper - position.lower) / form.period
        fastest = velocity.upper if velocity.is_finite else span
        widths[system.speeds[k].name] = SX(_SIGN_PART * fastest)
    links = tuple(
        replace(link, Fs_width=widths.get(link.name, link.Fs_width)) for link in system.tree.links
    )
    return replace(system, tree=replace(system.tree, links=links), _cache={})


def _check(system: System, objective: str, starts: int, rounds: int) -> None:
    if objective not in CRITERIA:
        raise ModelError(
            f"excitation: there is no objective {objective!r}; {did_you_mean(objective, CRITERIA)}"
        )
    for name, number in {"starts": starts, "rounds": rounds}.items():
        if number < 1:
            raise ModelError(f"excitation: {number} {name} give no motion; give 1 or more")
    if tuple(system.free) != tuple(system.active):
        raise ModelError(
            f"{system.name}: some independent joints have velocities alone, such as discs that"
            " roll; excitation is for positions that are independent too"
        )


def _condition(W: Array) -> float:
    values = np.linalg.svd(W, compute_uv=False)
    return float(values[0] / values[-1])
