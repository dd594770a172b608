"""Grouping by the rank of the regressor at random states, and numeric check of the rules.

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
from mbs.identification.regressors import Column, column_indices, every_column, regressor
from mbs.loops.closing import Closing
from mbs.loops.examination import configuration_report
from mbs.loops.reduction import reduction_matrix
from mbs.numbers import NONZERO

# Independent columns of sampled regressors, and the other columns as their combinations.

# Source: Gautier 1991.


Array = NDArray[np.float64]

_NO_EFFECT = 1e-9
"""Length of a column, relative to the longest, below which it counts as zero: rounding is 1e-15."""
_FLOOR = 1e-16
"""Lower bound of the singular values relative to the largest. It prevents gaps between singular
values that are rounding errors."""
_LARGEST_ZERO = 1e-6
"""Relative singular value above which it cannot be a rounding error."""
_ROUNDING = 1e-8
"""Distance from an integer below which a factor is rounded to the integer."""


@dataclass(frozen=True, slots=True, eq=False)
class Dependence:
    """Independent and dependent columns of a matrix.

    Attributes:
        independent: indices of independent columns, in the order of preference.
        dependent: indices of the other columns, including columns without effect.
        factors: (independent, dependent) factors of the independent columns in the dependent
            columns.
        gap: ratio of the smallest singular value that counts as nonzero to the largest that counts
            as zero, for columns scaled to unit length; infinite if all are nonzero.
        residual: largest error of a dependent column, relative to the longest column.
    """

    independent: tuple[int, ...]
    dependent: tuple[int, ...]
    factors: Array
    gap: float
    residual: float


def dependence(W: Array, order: Sequence[int]) -> Dependence:
    """Select independent columns of a matrix, with preference in the given order.

    Columns without effect are removed before scaling, which would amplify their rounding errors.
    The rank is at the largest gap of the singular values. QR without pivoting then selects the
    columns in the given order.

    Args:
        W: (rows, n) matrix with at least as many rows as columns.
        order: permutation of the column indices, in decreasing preference.

    Returns:
        Independent columns, the other columns as their combinations, and numerical quality.
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
    """Return the rank at the largest ratio of successive singular values, and this ratio.

    `values` are singular values in decreasing order.
    """
    parts = np.maximum(values / values[0], _FLOOR)
    ratios = parts[:-1] / parts[1:]
    small = parts[1:] < _LARGEST_ZERO
    if not np.any(small):
        return len(values), float("inf")
    k = int(np.argmax(np.where(small, ratios, 0.0)))
    return k + 1, float(ratios[k])


def plain(x: float) -> float:
    """Return x, rounded to an integer if it is closer than 1e-8 to it."""
    return float(round(x)) if abs(x - round(x)) < _ROUNDING else float(x)


# Random states of a mechanism. States of a closed one are on its assembled branch.


_STEP, _STEPS = 0.1, 8
"""Step of the fastest joint [rad or m], and number of steps between two states."""
_CONFIGURATIONS = 40
"""Number of closed configurations; further states reuse them with other velocities."""
_LEAST_LEAD = 0.02
"""Squared sine (`leads` of `mbs.loops.configuration_report`) below which a configuration is so
close to a singular one that the random walk could change the branch."""


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """Positions, independent velocities and accelerations, one state per column.

    Attributes:
        q: (nq, states) positions.
        v, a: (m, states) independent velocities and accelerations.
        base: velocity v_0 and acceleration a_0 (6, states each) and orientation R_0 (3, 3 states)
            of a moving base.
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
        """Return the states with a random velocity, acceleration and orientation of the base.

        Args:
            seed: seed of the random numbers.
        """
        rng = np.random.default_rng(seed)
        v_0, a_0 = rng.uniform(-3, 3, (6, self.count)), rng.uniform(-5, 5, (6, self.count))
        turns = np.linalg.qr(rng.standard_normal((self.count, 3, 3)))[0]
        turns *= np.sign(np.linalg.det(turns))[:, None, None]
        return replace(self, base=(v_0, a_0, np.hstack(list(turns))))


def random_states(system: System, p: Array, count: int, seed: int) -> States:
    """Return random states in which every identifiable parameter has an effect.

    Args:
        system: open or closed.
        p: (np,) parameters of the system.
        count: number of states.
        seed: seed of the random numbers.

    Raises:
        ModelError: a closed mechanism cannot leave its assembled configuration.
    """
    m, rng = len(system.independent), np.random.default_rng(seed)
    if system.is_closed:
        configurations = closed_positions(system, p, _CONFIGURATIONS, seed)
        q = configurations[:, np.arange(count) % configurations.shape[1]]
    else:
        q = _random_positions(system, count, rng)
    return States(q, rng.uniform(-2, 2, (m, count)), rng.uniform(-3, 3, (m, count)))


def _random_positions(system: System, count: int, rng: np.random.Generator) -> Array:
    """Return random positions (nq, count) with unit quaternions, for an open system."""
    scale = np.array([np.pi if c.unit == "rad" else 1.0 for c in system.coordinates])
    q = scale[:, None] * rng.uniform(-1, 1, (system.nq, count))
    return _normalise(system, q)


def closed_positions(system: System, p: Array, count: int, seed: int) -> Array:
    """Return closed configurations (nq, count) on a random walk from the assembled one.

    Each small step is projected onto the closed loops, so that the walk stays on its branch. It
    reverses if the independent joints barely determine the other joints. The result is cached in
    the system.

    Args:
        system: closed system.
        p: (np,) parameters of the system.
        count: number of configurations.
        seed: seed of the random numbers.

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
    """Random walk on the closed configurations of a system.

    `G` maps positions to the matrix from independent to tree velocities, `values` are parameters by
    name, `start` (nq,) is the first configuration, and `least` the smallest accepted `leads`.
    """

    system: System
    closing: Closing
    G: Function
    values: dict[str, float]
    start: Array
    least: float

    @staticmethod
    def of(system: System, p: Array) -> _ConfigurationWalk:
        """Return a walk from the assembled configuration, with loops closed at parameters p (np,).

        Raises ModelError if they do not close.
        """
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
        leads = configuration_report(system, found.q.tolist(), parameters=values).leads
        G = Function(reduction_matrix(system))
        return _ConfigurationWalk(system, closing, G, values, found.q, min(_LEAST_LEAD, leads / 4))

    def moved(self, q: Array, rng: np.random.Generator) -> Array:
        """Return configuration (nq,) after eight steps from q; it turns back at singularities.

        Args:
            q: (nq,) closed configuration.
            rng: random number generator of the directions.
        """
        direction = rng.uniform(-1, 1, len(self.system.independent))
        for _ in range(_STEPS):
            following = self._step(q, direction)
            if following is None:
                direction = -rng.uniform(0, 1, direction.shape) * direction
            else:
                q = following
        return q

    def _step(self, q: Array, direction: Array) -> Array | None:
        """Return the closed configuration (nq,) after a step along independent velocities (m,).

        None if the loops do not close nearby, or the result is near a singular configuration.

        q is a closed configuration (nq,), `direction` (m,) the velocities; its length does not
        matter.
        """
        p = self.closing.p
        arguments = (q, p) if p.size else (q,)
        G = np.array(self.G(*arguments))
        rate = np.array(self.system.qdot(q, G @ direction)).ravel()
        # a direction without joint motion (up to rounding) makes no step
        ahead = q + rate * (_STEP / max(float(np.max(np.abs(rate))), 1e-9))
        found = self.closing.nearest(ahead)
        if not found.is_closed or np.max(np.abs(found.q - ahead)) > _STEP:
            return None
        state = configuration_report(self.system, found.q.tolist(), parameters=self.values)
        return found.q if state.leads > self.least else None


def _normalise(system: System, q: Array) -> Array:
    """Scale the quaternions in positions q (nq, count) to unit length, in place; return q."""
    for part in quaternion_slices(system.tree):
        q[part] /= np.linalg.norm(q[part], axis=0)
    return q


# Numeric values of the dynamic regressor at random states.


def sampled_regressor(system: System, columns: Sequence[Column], states: States, p: Array) -> Array:
    """Return the regressor at all states, stacked to a matrix (rows, columns).

    The regressor Function with all columns of these kinds is cached for other selections of
    columns.

    Args:
        system: open or closed.
        columns: parameters of the system.
        states: states at which the regressor is evaluated.
        p: (np,) parameters of the system.

    Raises:
        ModelError: a column is not a parameter of the system.
    """
    every = every_column(system, columns)
    numbers = column_indices(system, every, columns)
    D = regressor(system, every, moving_base=states.base is not None)
    inputs = [states.q, states.v, states.a, *(states.base or ())]
    inputs += [np.tile(p[:, None], (1, states.count))] if system.parameters else []
    W = np.array(Function(D).map(states.count)(*inputs))
    rows = W.reshape(-1, states.count, len(every)).transpose(1, 0, 2).reshape(-1, len(every))
    return rows[:, numbers]


_ZERO = 1e-8
"""Factor of a dependent column below which it is a rounding error: true factors are ratios of
lengths, squares of ratios, and integers."""
_EXACT = 1e-7
"""Largest error of a grouped regressor that counts as rounding, relative to the longest column."""
_NARROW = 1e4
"""Ratio of singular values at the rank below which the rank is reported as uncertain."""
_PREFERRED = ("ZZ", "XX", "XY", "XZ", "YZ", "MX", "MY", "YY", "MZ", "M")
"""Inertial parameters of a link in the order of preference to keep them."""


@dataclass(frozen=True, slots=True, eq=False)
class RegressorSample:
    """Regressor of a system at many random states.

    Attributes:
        columns: parameters of the columns.
        W: (rows, columns) stacked regressor.
    """

    columns: tuple[Column, ...]
    W: Array

    @staticmethod
    def of(
        system: System, columns: Sequence[Column], p: Array, seed: int, *, base_moves: bool = False
    ) -> RegressorSample:
        """Return the regressor at random states, with at least three rows per column.

        Args:
            system: open or closed.
            columns: parameters of the system.
            p: (np,) parameters of the system.
            seed: seed of the random states.
            base_moves: whether the base has a random motion.
        """
        count = 8 + -(-3 * len(columns) // max(len(system.independent), 1))
        states = random_states(system, p, count, seed)
        states = states.on_moving_base(seed) if base_moves else states
        return RegressorSample(tuple(columns), sampled_regressor(system, columns, states, p))


def preferred_order(columns: Sequence[Column], first: Sequence[int] = ()) -> list[int]:
    """Return the column indices by preference as base parameters: links near the base first.

    Within a link, YY, MZ and M come last. With this order, QR keeps the same parameters as the tree
    rules.

    Args:
        columns: parameters of the system.
        first: indices of columns that come before all others.
    """
    known = {kind: k for k, kind in enumerate(_PREFERRED)}
    rest = [k for k in range(len(columns)) if k not in first]
    rest.sort(key=lambda k: (columns[k].link, known.get(columns[k].kind, len(known)), k))
    return [*first, *rest]


def grouped_by_rank(sample: RegressorSample, order: Sequence[int]) -> tuple[Grouping, Check]:
    """Return the grouping by the independent columns of a sampled regressor, and its check.

    Args:
        sample: regressor at random states.
        order: column indices in decreasing preference.
    """
    found = dependence(sample.W, order)
    grouping = applied(Grouping.none(len(sample.columns)), found)
    text = f"the regressor in random states has the rank {len(found.independent)}" + _gap_text(
        found
    )
    check = Check(
        len(found.independent), True, (), True, found.residual, found.gap, _capitalised(text)
    )
    return grouping, check


def applied(
    grouping: Grouping, found: Dependence, numbers: Sequence[int] | None = None
) -> Grouping:
    """Return a grouping without the columns that were found to be dependent.

    Args:
        grouping: grouping to extend.
        found: dependence between some columns.
        numbers: indices of these columns; all columns by default.
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
    """Check a grouping at random states.

    Args:
        sample: regressor at random states.
        grouping: grouping by the rules.
        beta: (kept, columns) numeric coefficients of the grouping.
        order: column indices in order of preference.

    Returns:
        Rank of the regressor, largest error of the grouped regressor, and missing relations.
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
    text = _rank_text(len(kept), rank, relations) if exact else _error_text(error)
    return Check(
        rank, agrees, relations, False, error, full.gap, _capitalised(text + _gap_text(full))
    )


def remainder(sample: RegressorSample, grouping: Grouping, order: Sequence[int]) -> Dependence:
    """Return the linear dependence between the columns that a grouping keeps.

    Indices in the result are those in `grouping.kept`.

    Args:
        sample: regressor at random states.
        grouping: grouping by the rules.
        order: column indices in decreasing preference.
    """
    kept = grouping.kept
    return dependence(sample.W[:, kept], [kept.index(k) for k in order if k in kept])


def relation_texts(
    columns: Sequence[Column], kept: Sequence[int], found: Dependence
) -> tuple[str, ...]:
    """Return the equation of each dependent column as text, such as "D(XX1) = D(ZZ2)".

    Args:
        columns: all parameters of the regressor.
        kept: indices of the columns among which the dependence was computed.
        found: dependence between these columns.
    """
    lines = []
    for k, column in enumerate(found.dependent):
        pairs = zip(found.independent, found.factors[:, k], strict=True)
        terms = {f"D({columns[kept[i]].name})": SX(plain(x)) for i, x in pairs if abs(x) > _ZERO}
        lines.append(equation(f"D({columns[kept[column]].name})", terms))
    return tuple(lines)


def _error_text(error: float) -> str:
    """Return the message that the rules do not reproduce the regressor, with the relative error."""
    return (
        f"the rules are not exact: the grouped regressor differs by {error:.2g} of its longest"
        " column"
    )


def _rank_text(count: int, rank: int, relations: Sequence[str]) -> str:
    """Return text that compares the `count` of kept parameters to the rank of the regressor.

    `relations` are texts of the missing relations.
    """
    if count == rank:
        return f"the rules keep {count} parameters, which is the rank of the regressor"
    told = "; ".join(relations)
    return f"the rules keep {count} parameters, but the regressor has the rank {rank}: {told}"


def _gap_text(found: Dependence) -> str:
    """Return text on the gap of the singular values at rank in `found`; empty if it is infinite."""
    if np.isinf(found.gap):
        return ""
    doubt = ", so narrow that the rank is in doubt" if found.gap < _NARROW else ""
    return f" (gap of the singular values {found.gap:.1e}{doubt})"


def _capitalised(text: str) -> str:
    """Return the text with an upper-case first letter."""
    return text[0].upper() + text[1:]
