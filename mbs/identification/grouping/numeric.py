"""Grouping by the rank of the regressor in random states, and the check of the rules by it.

Source: Gautier 1991.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import quaternion_slices
from mbs.errors import ModelError
from mbs.identification.grouping.grouping import Check, Grouping, equation
from mbs.identification.regressors import Column, every_column, numbers_among, regressor
from mbs.loops.closing import Closing
from mbs.loops.examine import examine
from mbs.loops.reduction import reduction_matrix
from mbs.numbers import NONZERO

# Which columns of sampled regressors are independent, and how the others follow from them.
#
# Source: Gautier 1991.


Array = NDArray[np.float64]

_NO_EFFECT = 1e-9
"""A column shorter than this part of the longest has no effect."""
_FLOOR = 1e-16
"""Part of the largest singular value that the others are taken to be at least: ratios of what is
rounding alone would look like gaps."""
_LARGEST_ZERO = 1e-6
"""A singular value above this part of the largest is not rounding."""
_ROUNDING = 1e-8
"""A factor so near to a whole number is one."""


@dataclass(frozen=True, slots=True, eq=False)
class Dependence:
    """The independent columns of a matrix, in the order in which they were looked at.

    Attributes:
        independent: numbers of columns.
        dependent: numbers of the others; those without any effect are among them.
        factors: (independent, dependent), the dependent columns from the independent ones.
        gap: smallest singular value that counts by the largest one that does not, both of columns
            scaled to length one; infinite when all count.
        residual: largest error of a dependent column, by the length of the longest column.
    """

    independent: tuple[int, ...]
    dependent: tuple[int, ...]
    factors: Array
    gap: float
    residual: float


def dependence(W: Array, order: Sequence[int]) -> Dependence:
    """Independent columns of a matrix: the first ones in the order that are not combinations.

    Columns without effect are dropped before the others are scaled, since scaling would turn
    their rounding into a column. The rank is where the singular values fall most; QR without
    pivoting then takes the columns in the given order.

    Args:
        W: (rows, n), at least as many rows as columns.
        order: every number of a column once, the wanted ones first.
    """
    lengths = np.linalg.norm(W, axis=0)
    longest = float(np.max(lengths, initial=0.0))
    alive = [k for k in order if lengths[k] > _NO_EFFECT * longest]
    if not alive:
        return Dependence((), tuple(range(W.shape[1])), np.zeros((0, W.shape[1])), np.inf, 0.0)
    scaled = W[:, alive] / lengths[alive]
    R = np.linalg.qr(scaled, mode="r")
    rank, gap = _rank(np.linalg.svd(R, compute_uv=False))
    diagonal = np.abs(np.diag(R))
    first = sorted(np.argsort(-diagonal, kind="stable")[:rank])
    independent = [alive[k] for k in first]
    dependent = [k for k in range(W.shape[1]) if k not in independent]
    factors = np.zeros((rank, len(dependent)))
    live = [k for k, column in enumerate(dependent) if column in alive]
    basis, others = W[:, independent], W[:, [dependent[k] for k in live]]
    solution = np.linalg.lstsq(basis / lengths[independent], others, rcond=None)[0]
    factors[:, live] = solution / lengths[independent][:, None]
    error = W[:, dependent] - basis @ factors
    residual = float(np.max(np.linalg.norm(error, axis=0), initial=0.0)) / longest
    return Dependence(tuple(independent), tuple(dependent), factors, gap, residual)


def _rank(values: Array) -> tuple[int, float]:
    """Where the falling singular values have their widest gap, and how wide it is."""
    parts = np.maximum(values / values[0], _FLOOR)
    ratios = parts[:-1] / parts[1:]
    small = parts[1:] < _LARGEST_ZERO
    if not np.any(small):
        return len(values), float("inf")
    k = int(np.argmax(np.where(small, ratios, 0.0)))
    return k + 1, float(ratios[k])


def plain(x: float) -> float:
    """A whole number without its rounding."""
    return float(round(x)) if abs(x - round(x)) < _ROUNDING else float(x)


# Random states of a mechanism, those of a closed one on the branch of its assembled configuration.


_STEP, _STEPS = 0.1, 8
"""Of the fastest joint [rad or m], and how many steps lie between two states."""
_CONFIGURATIONS = 40
"""Closed configurations; more states repeat them with other velocities."""
_LEAST_LEAD = 0.02
"""Below this a configuration is so near to a singular one that the walk could change its branch."""


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """Positions, independent velocities and accelerations, one state a column.

    Attributes:
        q: (nq, states).
        v, a: (m, states).
        base: v_0 and a_0, (6, states) each, and R_0, (3, 3 states), of a base that moves.
    """

    q: Array
    v: Array
    a: Array
    base: tuple[Array, Array, Array] | None = None

    @property
    def count(self) -> int:
        """Number of states."""
        return int(self.q.shape[1])

    def on_moving_base(self, seed: int) -> States:
        """The same while the base moves anyhow."""
        rng = np.random.default_rng(seed)
        v_0, a_0 = rng.uniform(-3, 3, (6, self.count)), rng.uniform(-5, 5, (6, self.count))
        turns = np.linalg.qr(rng.standard_normal((self.count, 3, 3)))[0]
        turns *= np.sign(np.linalg.det(turns))[:, None, None]
        return replace(self, base=(v_0, a_0, np.hstack(list(turns))))


def random_states(system: System, p: Array, count: int, seed: int) -> States:
    """States that show every parameter that has an effect.

    Args:
        system: open or closed.
        p: (np,) its parameters.
        count: number of states.
        seed: of the random numbers.

    Raises:
        ModelError: a closed mechanism cannot leave its assembled configuration.
    """
    m, rng = len(system.active), np.random.default_rng(seed)
    if system.is_closed:
        configurations = closed_positions(system, p, _CONFIGURATIONS, seed)
        q = configurations[:, np.arange(count) % configurations.shape[1]]
    else:
        q = _any(system, count, rng)
    return States(q, rng.uniform(-2, 2, (m, count)), rng.uniform(-3, 3, (m, count)))


def _any(system: System, count: int, rng: np.random.Generator) -> Array:
    scale = np.array([np.pi if c.unit == "rad" else 1.0 for c in system.coordinates])
    q = scale[:, None] * rng.uniform(-1, 1, (system.nq, count))
    return _normalise(system, q)


def closed_positions(system: System, p: Array, count: int, seed: int) -> Array:
    """(nq, count) closed configurations, met on a random walk from the assembled one.

    Steps are small and each is closed again, so that the walk stays on its branch; where the
    independent joints hardly lead the others it turns back. The system keeps them.

    Args:
        system: closed.
        p: (np,) its parameters.
        count: number of configurations.
        seed: of the random numbers.

    Raises:
        ModelError: the loops cannot be closed at these parameters.
    """

    def walked() -> Array:
        walk, rng = _ConfigurationWalk.of(system, p), np.random.default_rng(seed)
        q, configurations = walk.start, list[Array]()
        for _ in range(count):
            q = walk.moved(q, rng)
            configurations.append(q)
        return np.array(configurations).T

    positions: Array = system.cached(("closed_positions", p.tobytes(), count, seed), walked)
    return positions


@dataclass(frozen=True, slots=True, eq=False)
class _ConfigurationWalk:
    """What a walk on closed configurations needs."""

    system: System
    closing: Closing
    G: Function
    values: dict[str, float]
    start: Array
    least: float

    @staticmethod
    def of(system: System, p: Array) -> _ConfigurationWalk:
        """From the assembled configuration, closed again for these parameters."""
        closing = Closing(system, p)
        found = closing.nearest(np.array(system.configuration))
        if not found.is_closed:
            raise ModelError(
                f"{system.name}: the loops cannot be closed near the assembled configuration; give"
                " the"
                " symbols of the lengths values that the assembly can use"
            )
        names = [parameter.name for parameter in system.parameters]
        values = dict(zip(names, p.tolist(), strict=True))
        leads = examine(system, found.q.tolist(), parameters=values).leads
        G = Function(reduction_matrix(system))
        return _ConfigurationWalk(system, closing, G, values, found.q, min(_LEAST_LEAD, leads / 4))

    def moved(self, q: Array, rng: np.random.Generator) -> Array:
        """The configuration after some steps in one direction, or back in the other."""
        direction = rng.uniform(-1, 1, len(self.system.active))
        for _ in range(_STEPS):
            following = self._step(q, direction)
            if following is None:
                direction = -rng.uniform(0, 1, direction.shape) * direction
            else:
                q = following
        return q

    def _step(self, q: Array, direction: Array) -> Array | None:
        p = self.closing.p
        arguments = (q, p) if p.size else (q,)
        G = np.array(self.G(*arguments))
        rate = np.array(self.system.qdot(q, G @ direction)).ravel()
        # a direction that moves no position, to rounding, leads nowhere
        ahead = q + rate * (_STEP / max(float(np.max(np.abs(rate))), 1e-9))
        found = self.closing.nearest(ahead)
        if not found.is_closed or np.max(np.abs(found.q - ahead)) > _STEP:
            return None
        state = examine(self.system, found.q.tolist(), parameters=self.values)
        return found.q if state.leads > self.least else None


def _normalise(system: System, q: Array) -> Array:
    for part in quaternion_slices(system.tree):
        q[part] /= np.linalg.norm(q[part], axis=0)
    return q


# Numbers of the dynamic regressor in random states.


def sampled_regressor(system: System, columns: Sequence[Column], states: States, p: Array) -> Array:
    """(rows, columns) the regressor in all states, one below the other.

    The regressor with all columns of these kinds is kept for the next choice of columns.

    Args:
        system: open or closed.
        columns: parameters of the system.
        states: those to take.
        p: (np,) parameters of the system.

    Raises:
        ModelError: a column is no parameter of the system.
    """
    every = every_column(system, columns)
    numbers = numbers_among(system, every, columns)
    D = regressor(system, every, moving_base=states.base is not None)
    inputs = [states.q, states.v, states.a, *(states.base or ())]
    inputs += [np.tile(p[:, None], (1, states.count))] if system.parameters else []
    W = np.array(Function(D).map(states.count)(*inputs))
    rows = W.reshape(-1, states.count, len(every)).transpose(1, 0, 2).reshape(-1, len(every))
    return rows[:, numbers]


_ZERO = 1e-8
"""Factor of a dependent column below which it is rounding: those that count are ratios of lengths
and squares of them, and whole numbers."""
_EXACT = 1e-7
"""Largest error of a grouped regressor that is rounding, by the longest column."""
_NARROW = 1e4
"""A smaller gap of the singular values leaves the rank in doubt."""
_PREFERRED = ("ZZ", "XX", "XY", "XZ", "YZ", "MX", "MY", "YY", "MZ", "M")
"""Inertial parameters of a link in the order in which they are kept."""


@dataclass(frozen=True, slots=True, eq=False)
class RegressorSample:
    """The regressor of a system in many random states.

    Attributes:
        columns: its parameters.
        W: (rows, columns).
    """

    columns: tuple[Column, ...]
    W: Array

    @staticmethod
    def of(
        system: System, columns: Sequence[Column], p: Array, seed: int, *, base_moves: bool = False
    ) -> RegressorSample:
        """At least three rows for every column."""
        count = 8 + -(-3 * len(columns) // max(len(system.active), 1))
        states = random_states(system, p, count, seed)
        states = states.on_moving_base(seed) if base_moves else states
        return RegressorSample(tuple(columns), sampled_regressor(system, columns, states, p))


def preferred_order(columns: Sequence[Column], first: Sequence[int] = ()) -> list[int]:
    """Numbers of the columns, those that should be kept first: near the base, YY MZ M last.

    With this order QR keeps the parameters that the rules of trees keep.
    """
    known = {kind: k for k, kind in enumerate(_PREFERRED)}
    rest = [k for k in range(len(columns)) if k not in first]
    rest.sort(key=lambda k: (columns[k].link, known.get(columns[k].kind, len(known)), k))
    return [*first, *rest]


def grouped_by_rank(sample: RegressorSample, order: Sequence[int]) -> tuple[Grouping, Check]:
    """The independent columns in this order, and the others in terms of them."""
    found = dependence(sample.W, order)
    grouping = applied(Grouping.none(len(sample.columns)), found)
    text = f"the regressor in random states has the rank {len(found.independent)}" + _gap(found)
    check = Check(
        len(found.independent), True, (), True, found.residual, found.gap, _sentence(text)
    )
    return grouping, check


def applied(
    grouping: Grouping, found: Dependence, numbers: Sequence[int] | None = None
) -> Grouping:
    """The grouping with dependent columns taken out.

    Args:
        grouping: so far.
        found: dependence of some of its columns.
        numbers: of these columns, all of them when left out.
    """
    numbers = range(len(grouping.columns)) if numbers is None else numbers
    for k, column in enumerate(found.dependent):
        terms = zip(found.independent, found.factors[:, k], strict=True)
        grouping = grouping.replaced(
            numbers[column], {numbers[i]: SX(plain(x)) for i, x in terms if abs(x) > _ZERO}
        )
    return grouping


def checked(
    sample: RegressorSample, grouping: Grouping, beta: Array, order: Sequence[int]
) -> Check:
    """What random states say of a grouping.

    Args:
        sample: of the regressor.
        grouping: by rules.
        beta: (kept, columns) its coefficients in numbers.
        order: of preference.
    """
    kept, W = grouping.kept, sample.W
    longest = float(np.max(np.linalg.norm(W, axis=0), initial=NONZERO))
    errors = np.linalg.norm(W - W[:, kept] @ beta, axis=0) / longest
    error = float(np.max(errors, initial=0.0))
    full = dependence(W, order)
    rank = len(full.independent)
    found = remainder(sample, grouping, order)
    exact = error < _EXACT
    relations = relation_texts(sample.columns, kept, found) if exact else ()
    agrees = exact and rank == len(kept)
    text = _verdict(len(kept), rank, relations) if exact else _inexact(error)
    return Check(rank, agrees, relations, False, error, full.gap, _sentence(text + _gap(full)))


def remainder(sample: RegressorSample, grouping: Grouping, order: Sequence[int]) -> Dependence:
    """The dependence of the kept columns."""
    kept = grouping.kept
    return dependence(sample.W[:, kept], [kept.index(k) for k in order if k in kept])


def relation_texts(
    columns: Sequence[Column], kept: Sequence[int], found: Dependence
) -> tuple[str, ...]:
    """Dependent columns as equations, D(XX1) = ... of the effects of parameters."""
    lines = []
    for k, column in enumerate(found.dependent):
        pairs = zip(found.independent, found.factors[:, k], strict=True)
        terms = {f"D({columns[kept[i]].name})": SX(plain(x)) for i, x in pairs if abs(x) > _ZERO}
        lines.append(equation(f"D({columns[kept[column]].name})", terms))
    return tuple(lines)


def _inexact(error: float) -> str:
    return (
        f"the rules are not exact: the grouped regressor differs by {error:.2g} of its longest"
        " column"
    )


def _verdict(count: int, rank: int, relations: Sequence[str]) -> str:
    if count == rank:
        return f"the rules keep {count} parameters, which is the rank of the regressor"
    told = "; ".join(relations)
    return f"the rules keep {count} parameters, but the regressor has the rank {rank}: {told}"


def _gap(found: Dependence) -> str:
    if np.isinf(found.gap):
        return ""
    doubt = ", so narrow that the rank is in doubt" if found.gap < _NARROW else ""
    return f" (gap of the singular values {found.gap:.1e}{doubt})"


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]
