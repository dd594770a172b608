"""Analysis of the loops of a system: mobility, independent rows, independent joints.

Ranks are determined at several assembled configurations, because rows that are independent in
general can be dependent at a single configuration.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly import Closure, Coordinate, LoopRow, System
from mbs.components import MotionJoint
from mbs.errors import LoopError
from mbs.loops.assembled import assembled_configuration
from mbs.loops.closing import (
    Closing,
    candidates,
    closure_parameters,
    constraint_sizes,
    difference,
    mechanism_size,
    unwound,
)
from mbs.loops.closure_equations import row_groups
from mbs.loops.cut_positions import cut_positions
from mbs.loops.guess_target import GuessTarget
from mbs.loops.nearest import nearest_of
from mbs.loops.velocity import constraint_jacobian
from mbs.solvers.least_squares import MANY
from mbs.solvers.rank import dense, independent_rows, null_space_of, rank

Matrix = NDArray[np.float64]

_CONFIGURATIONS, _TRIES, _SEED = 5, 25, 20260102
"""Number of closed configurations that are compared with the assembled one, number of random starts
that search them, and seed of the random numbers."""
_REACH = 0.5
"""Largest difference of a random start from the assembled configuration [rad or m]."""
_GAP = 1e-5
"""Relative singular value below which a value counts as zero: Gauss-Newton ends at a distance of
about the square root of its tolerance, 1e-6, from a singular configuration, and the small singular
values have this size. At regular configurations of the catalogue nonzero values are above 1e-2 and
zero values below 1e-13, in lengths of the size of the mechanism. A motion that loops hold by less
than 1e-5 counts as free."""
_FEWEST, _RIGID = 3, 1e-3
"""Number of closed configurations from random starts that shows whether a motion exists, and their
largest distance [rad or m] without motion: iterations end 1e-6 away from a singular configuration
that is the only solution, and motions have distances of 0.1."""
_BRANCH = 0.1
"""Distance of independent positions from a singular configuration [rad, or sizes of the mechanism]:
models are accurate there, and branches differ by about as much."""
_CLEAR = 1e-4
"""Difference of distances that decides on which side of a singular configuration the result is:
distances are accurate to 1e-6."""
_MODES = 64
"""Largest number of configurations of a search for branches: four-bars have two."""
_SAME_SHARE = 1e-6
"""Change of the coefficients of a dropped row, as a combination of the kept rows, above which they
depend on the configuration: closing leaves 1e-12 in rows, which singular values of `_GAP` amplify
to 1e-7."""


def analyse(system: System, guess: Mapping[str, float], chosen: tuple[int, ...] = ()) -> System:
    """Return the system with closed loops, and the constraints of the loops in `closure`.

    Args:
        system: system with open loops.
        guess: approximate positions by coordinate name. If the nearest configuration is singular,
            a regular configuration nearby is used.
        chosen: indices of velocities that the user requires as independent, in addition to motors.

    Raises:
        Unclosable: no configuration closes the loops.
        LoopError: the loops close in one singular configuration only, without motion.

    Returns:
        System at its assembled configuration, with closure, loops and motors.
    """
    p = closure_parameters(system)
    assembled = assembled_configuration(system, guess, p)
    configuration = assembled.q
    nearby = Closing(system, p).nearby(configuration, _REACH, _TRIES, _SEED)
    configurations = [configuration, *islice(nearby, _CONFIGURATIONS)]
    J = constraint_jacobian(system)
    rows, columns = _measures(system, p)
    jacobians = [dense(J(q, p)) for q in configurations]
    ranks = _ranks([m / rows * columns for m in jacobians])
    generic = max(ranks)
    configuration = configurations[ranks.index(generic)]
    regular = [m for m, found in zip(jacobians, ranks, strict=True) if found == generic]
    labels = _labels(system)
    positions = sum(len(rows) for rows, _ in labels)
    held = generic
    if positions < len(rows):
        held = max(_ranks([(m / rows * columns)[:positions] for m in regular])) if positions else 0
    kept = _kept_rows(regular, positions, held, generic - held)
    if generic < system.nv:
        _require_mobile(system, configurations)
    drive = _drive(system, chosen, regular, system.nv - generic)
    active, others = drive.active, assembled.others
    if ranks[0] < generic:

        def is_regular(q: Matrix) -> bool:
            found = _ranks([m / rows * columns for m in (dense(J(q, p)), regular[0])])
            return found[0] == generic

        target = _target_near(system, guess, assembled.q, p)
        branches = _branches(target, assembled.q, active, is_regular)
        if branches:
            given = {row.name: guess[row.name] for row in system.coordinates if row.name in guess}
            start = np.array(system.position(given))
            branches = [unwound(Closing(system, p), q, start) for q in branches]
            configuration, others = branches[0], tuple(branches[1:])
    closure = Closure(
        rows=kept.positions,
        slips=kept.slips,
        independent=active,
        motors=drive.motors,
        passive=tuple(k for k in range(system.nv) if k not in active),
        chosen_coordinates=_free_positions(regular, kept, active),
        varies=_varies(regular, positions, kept),
        gruebler=system.nv - sum(len(rows) + len(slips) for rows, slips in labels),
        guess=tuple((name, float(guess[name])) for name in _names(system) if name in guess),
        at_cut=_at_cut(system, guess, configuration, p),
        others=tuple(tuple(q.tolist()) for q in others),
        meets=ranks[0] < generic,
        dead=ranks[0] == generic and drive.leads < _GAP,
        residual=float(np.max(np.abs(Closing(system, p).rows(configuration)[0]), initial=0.0)),
    )
    return replace(
        system,
        coordinates=_with_motors(system.coordinates, drive.named),
        velocity_coordinates=_with_motors(system.velocity_coordinates, drive.named),
        configuration=tuple(float(x) for x in configuration),
        closure=closure,
        loops=_with_rows(system.loops, labels, kept),
        _cache={},
    )


def _require_mobile(system: System, configurations: Sequence[Matrix]) -> None:
    """Raise an error for loops with velocities but no motion, such as bars in one line.

    Args:
        system: a system with closed loops.
        configurations: the assembled configuration, and closed configurations that were found from
            random starts around it.
    """
    first, *others = configurations
    apart = [float(np.max(np.abs(difference(system, q, first)))) for q in others]
    if len(apart) < _FEWEST or max(apart) > _RIGID:
        return
    names = [coordinate.name for coordinate in system.coordinates]
    at = ", ".join(f"{name} = {x:.4g}" for name, x in zip(names, first, strict=True))
    raise LoopError(
        f"{system.name}: the loops close in one configuration only, {at}, and are singular there,"
        " as bars that are stretched in one line: they allow a velocity but no motion, and their"
        " forces have no finite value; change lengths or positions of joints"
    )


def _target_near(system: System, guess: Mapping[str, float], q: Matrix, p: Matrix) -> GuessTarget:
    """Return a target for the search of a closed configuration: the guess, and q for other joints.

    Args:
        system: mechanism with loops.
        guess: approximate positions by coordinate name.
        q: (nq,) closed configuration. Positions of cut joints without a guess are computed from it.
        p: (np,) parameters.
    """
    names = [coordinate.name for coordinate in system.coordinates]
    start = np.array([guess.get(name, x) for name, x in zip(names, q, strict=True)])
    return GuessTarget.of(system, p, start, guess, _cut_values(system, q, p))


def _branches(
    target: GuessTarget,
    q: Matrix,
    active: Sequence[int],
    is_regular: Callable[[Matrix], bool],
) -> list[Matrix]:
    """Return regular closed configurations on the branches that meet at a singular configuration q.

    Independent positions are displaced by 0.1 in both directions. All configurations of the result
    have the same independent positions; the nearest to the target is first. The list is empty if
    none is found, if an independent velocity has no position of its own, or in large mechanisms.

    Args:
        target: guessed positions, and those of q for joints without a guess.
        q: (nq,) singular configuration.
        active: indices of the independent velocities.
        is_regular: callable that returns whether the rank at a configuration is the general rank.
    """
    system = target.system
    names = {coordinate.name: k for k, coordinate in enumerate(system.coordinates)}
    if not all(system.velocity_coordinates[k].name in names for k in active) or system.nq >= MANY:
        return []
    locked = tuple(sorted(names[system.velocity_coordinates[k].name] for k in active))
    closing = Closing(system, target.p, locked)
    steps = _BRANCH * closing.position_units[list(locked)]
    best, found = list[Matrix](), list[Matrix]()
    for sign in (1.0, -1.0):
        start = q.copy()
        start[list(locked)] += sign * steps
        options = [x for x in candidates(closing, start, _MODES) if is_regular(x)]
        nearest = nearest_of(closing, options, target)[:1]
        if nearest and (not best or _is_clearly_nearer(closing, target, nearest[0], best[0])):
            best, found = nearest, options
    return best + [x for x in found if x is not best[0]]


def _is_clearly_nearer(closing: Closing, target: GuessTarget, q: Matrix, other: Matrix) -> bool:
    """Whether q (nq,) is nearer to the guess than `other` by more than 1e-4.

    Distances are compared in this order: Euclidean distance from the guessed positions, then
    largest difference of any position.
    """
    pairs = [(target.miss(closing, x), target.distances(closing, x)[1]) for x in (q, other)]
    for distance, least in zip(*pairs, strict=True):
        if abs(distance - least) > _CLEAR:
            return bool(distance < least)
    return False


def _names(system: System) -> list[str]:
    """Return the names of all coordinates: of the tree, then of the cut joints."""
    return [row.name for row in (*system.coordinates, *system.cut_coordinates)]


def _cut_values(system: System, q: Matrix, p: Matrix) -> Matrix:
    """Return the positions (c,) of the cut joints at q (nq,) for parameters p (np,)."""
    return np.array(cut_positions(system)(q, p)).ravel()


def _at_cut(
    system: System, guess: Mapping[str, float], q: Matrix, p: Matrix
) -> tuple[tuple[str, float], ...]:
    """Return (name, position at q) of each cut-joint coordinate that has a guess, or ()."""
    names = [row.name for row in system.cut_coordinates]
    if not any(name in guess for name in names):
        return ()
    found = zip(names, map(float, _cut_values(system, q, p)), strict=True)
    return tuple((name, value) for name, value in found if name in guess)


def _measures(system: System, p: Matrix) -> tuple[Matrix, Matrix]:
    """Return factors that make the constraint Jacobian (m, nv) dimensionless.

    The first array (m, 1) divides the rows, the second (nv,) multiplies the columns.
    """
    at = Function("sizes", [system.p], [mechanism_size(system), constraint_sizes(system)])
    size, rows = at(p)
    slides = [speed.unit.startswith("m") for speed in system.velocity_coordinates]
    return np.array(rows), np.where(slides, float(size), 1.0)


def _ranks(jacobians: Sequence[Matrix]) -> list[int]:
    """Return the rank of each of the `jacobians`, relative to the largest singular value of all."""
    values = [np.linalg.svd(_without_zeros(matrix), compute_uv=False) for matrix in jacobians]
    largest = max(float(np.max(row, initial=0.0)) for row in values)
    return [int(np.sum(row > _GAP * largest)) for row in values]


def _without_zeros(matrix: Matrix) -> Matrix:
    """Return the rows of a matrix that are not entirely zero."""
    return matrix[matrix.any(axis=1)]


@dataclass(frozen=True, slots=True)
class _Kept:
    """Indices of the independent constraint rows that the model keeps.

    Attributes:
        positions: indices among the rows that constrain positions.
        slips: indices among the rows that constrain velocities only, counted from zero.
    """

    positions: tuple[int, ...]
    slips: tuple[int, ...]


def _kept_rows(jacobians: Sequence[Matrix], positions: int, held: int, slips: int) -> _Kept:
    """Return indices of independent constraint rows. Rows on positions precede velocity rows.

    Args:
        jacobians: constraint Jacobians (m, nv) at regular configurations, rows on positions first.
        positions: number of rows that constrain positions.
        held: rank of these rows.
        slips: increase of the rank by the velocity rows.
    """
    rows = independent_rows([J[:positions] for J in jacobians], held)
    every = independent_rows(jacobians, held + slips, tuple(rows))
    return _Kept(tuple(rows), tuple(k - positions for k in every if k >= positions))


def _varies(jacobians: Sequence[Matrix], positions: int, kept: _Kept) -> bool:
    """Whether the dependent rows are combinations of the kept rows that vary with configuration.

    If they vary, no fixed selection of rows is independent at all configurations.

    Args:
        jacobians: constraint Jacobians (m, nv) at several configurations.
        positions: number of rows that constrain positions.
        kept: indices of the kept rows.
    """
    rows = [*kept.positions, *(positions + k for k in kept.slips)]
    dropped = [k for k in range(len(jacobians[0])) if k not in rows]
    if not dropped:
        return False
    shares = [J[dropped] @ np.linalg.pinv(J[rows]) for J in jacobians]
    return (
        max(float(np.max(np.abs(share - shares[0]), initial=0.0)) for share in shares) > _SAME_SHARE
    )


def rows_at(system: System, q: Matrix, p: Matrix) -> System:
    """Return the system with the constraint rows that are most independent at a configuration.

    Args:
        system: mechanism with closed loops.
        q: (nq,) positions that close the loops.
        p: (np,) parameters.
    """
    closure = system.closure
    assert closure is not None
    J = np.array(constraint_jacobian(system)(q, p))
    labels = _labels(system)
    positions = sum(len(rows) for rows, _ in labels)
    kept = _kept_rows([J], positions, len(closure.rows), len(closure.slips))
    return replace(
        system,
        closure=replace(closure, rows=kept.positions, slips=kept.slips),
        loops=_with_rows(system.loops, labels, kept),
        _cache={},
    )


def _free_positions(
    jacobians: Sequence[Matrix], kept: _Kept, active: Sequence[int]
) -> tuple[int, ...]:
    """Return indices in v of the coordinates whose positions can be chosen freely.

    They are the independent velocities (`active`), then further ones that only velocity rows, such
    as no-slip conditions, constrain.
    """
    if not kept.slips:
        return tuple(active)
    size = jacobians[0].shape[1] - len(kept.positions)
    free = [null_space_of(J[list(kept.positions)], size) for J in jacobians]
    return tuple(independent_rows(free, size, tuple(active)))


@dataclass(frozen=True, slots=True)
class _Drive:
    """Independent velocities of a mechanism, and the velocities that motors drive.

    Attributes:
        active: indices in v of the independent velocities.
        motors: indices in v of the velocities whose efforts drive the mechanism.
        named: names of velocities that the user named as independent beyond the mobility. They are
            driven too.
        leads: smallest singular value of the independent velocities in an orthonormal basis of all
            velocities at the first configuration; 0 at a dead centre.
    """

    active: tuple[int, ...]
    motors: tuple[int, ...]
    named: tuple[str, ...] = ()
    leads: float = 1.0


def _drive(
    system: System, chosen: tuple[int, ...], jacobians: Sequence[Matrix], mobility: int
) -> _Drive:
    """Select independent velocities: the user's choice first, then motors, then any others.

    Their number is the mobility. If the user's choice and the motors are dependent, pivoting
    selects independent ones among them. All of these drive the mechanism, together with velocities
    for the remaining mobility.

    Args:
        system: mechanism with loops.
        chosen: indices in v of velocities that the user requires as independent.
        jacobians: constraint Jacobians (m, nv) at regular configurations.
        mobility: number of independent velocities.
    """
    if mobility == 0:
        return _Drive(
            (), tuple(k for k, speed in enumerate(system.velocity_coordinates) if speed.actuated)
        )
    free = [null_space_of(_without_zeros(J), mobility) for J in jacobians]
    motors = tuple(k for k, speed in enumerate(system.velocity_coordinates) if speed.actuated)
    first = tuple(dict.fromkeys([*chosen, *motors]))
    if len(_independent(free, (), first)) == len(first):
        known = _own_velocities(system)
        if len(known) < system.nv:
            first = _independent(free, first, known)
        active = tuple(independent_rows(free, mobility, first))
        return _Drive(active, active, leads=_hold(free[0], active))
    own = _independent(free, (), chosen)
    active = _independent(free, _independent(free, own, motors), range(system.nv))
    surplus = chosen if len(own) < len(chosen) else ()
    driving = tuple(sorted({*motors, *surplus}))
    rest = _independent(free, _independent(free, (), driving), active)
    names = tuple(system.velocity_coordinates[k].name for k in surplus)
    leads = _hold(free[0], active)
    return _Drive(tuple(sorted(active)), tuple(sorted({*driving, *rest})), names, leads)


def _hold(free: Matrix, active: Sequence[int]) -> float:
    """Return the smallest singular value of rows `active` of a basis `free` (nv, m) of velocities.

    It is 0 if the independent velocities `active` do not determine the others.
    """
    return float(np.min(np.linalg.svd(free[list(active)], compute_uv=False), initial=1.0))


def _own_velocities(system: System) -> list[int]:
    """Return indices in v of all velocities, without those of frames of imposed motions."""
    placed = {f"{p.name}.free" for p in system.parts if isinstance(p.element, MotionJoint)}
    return [k for k, speed in enumerate(system.velocity_coordinates) if speed.joint not in placed]


def _independent(
    free: Sequence[Matrix], taken: Sequence[int], candidates: Sequence[int]
) -> tuple[int, ...]:
    """Return the given velocities, and the candidates that are independent of all before them.

    Args:
        free: bases (nv, m) of the velocities that the loops allow, one per configuration.
        taken: indices of velocities that are independent.
        candidates: indices of velocities.
    """
    every = tuple(dict.fromkeys([*taken, *candidates]))
    if not every:
        return ()
    rows = [N[list(every)] for N in free]
    count = max(rank(N, _GAP) for N in rows)
    return tuple(every[k] for k in independent_rows(rows, count, tuple(range(len(taken)))))


def _with_motors(
    coordinates: tuple[Coordinate, ...], names: Sequence[str]
) -> tuple[Coordinate, ...]:
    """Return the same coordinates, with the named coordinates marked as driven by motors."""
    return tuple(replace(c, actuated=c.actuated or c.name in names) for c in coordinates)


_Labels = list[tuple[list[str], tuple[str, ...]]]
"""Labels of the position rows and of the velocity rows of each loop."""


def _labels(system: System) -> _Labels:
    """Return the labels of the position rows and of the velocity rows of each loop or component."""
    return [
        ([label for label, _ in group.positions], tuple(label for label, _ in group.velocities))
        for group in row_groups(system)
    ]


def _with_rows(loops: Sequence[LoopRow], labels: _Labels, kept: _Kept) -> tuple[LoopRow, ...]:
    """Return the loop table with the labels of all rows, and of the dropped (dependent) rows."""
    result = []
    row = slip = 0
    for loop, (names, slips) in zip(loops, labels, strict=True):
        dropped = [n for k, n in enumerate(names, start=row) if k not in kept.positions]
        dropped += [n for k, n in enumerate(slips, start=slip) if k not in kept.slips]
        result.append(replace(loop, rows=(*names, *slips), dropped=tuple(dropped)))
        row, slip = row + len(names), slip + len(slips)
    return tuple(result)
