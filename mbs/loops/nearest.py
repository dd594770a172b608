"""Search for the closed configuration that is nearest to a guess."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import quaternion_slices
from mbs.loops.closing import CLOSED, Closing, candidates, difference, distance_units, unwound
from mbs.loops.closure_equations import facing, position_rows
from mbs.loops.guess_target import EQUAL, GuessTarget
from mbs.loops.least_distance import MET, is_movable, least_distance, nearest_in_all
from mbs.solvers.least_squares import MANY
from mbs.solvers.rank import rank

Vector = NDArray[np.float64]

_FEW = 24
"""Number of free positions up to which all loops are searched together: a search takes sixty
starts. Larger mechanisms are searched block by block."""
_NEAR = 0.1
"""Distance of a configuration from its start below which no other one is searched [rad, or sizes of
the mechanism]: branches that are nearer to each other meet there."""
_MODES = 64  # largest number of configurations of a search, of which the nearest is selected
_LOOPS = 3  # largest number of loops in a block
_MOST = 400
"""Largest number of block configurations that are tried: about ten blocks with several each."""
_FLAT = 1e-6
"""Relative singular value that counts as zero: configurations are closed to 1e-12."""


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """A closed configuration.

    Attributes:
        q: (nq,) positions [rad or m].
        others: further configurations with the same locked positions.
    """

    q: Vector
    others: tuple[Vector, ...] = ()


def nearest_configuration(closing: Closing, target: GuessTarget) -> Assembled | None:
    """Return the closed configuration that is nearest to a target, None if none is found.

    Guessed positions are compared first, then all positions, by the largest difference. Lengths are
    divided by the size of the mechanism. If two configurations are at the same distance, the first
    position that differs decides, in the order of the description: the larger value is taken.
    If the loops leave motions, and guessed positions are not met, the configuration moves along the
    manifold of closed ones until the sum of squares of the differences of guessed positions is
    minimal (`mbs.loops.least_distance`).
    Mechanisms with many free positions are searched block by block. A block is the least number of
    loops that determine their positions, once the blocks before it are closed. There positions of
    joints that are cut do not count.

    Args:
        closing: closure rows and the locked positions.
        target: guess of all positions.
    """
    start = target.start
    if not closing.free:
        return Assembled(start) if closes(closing, start) else None
    first = closing.nearest(start)
    q = unwound(closing, first.q, start) if first.is_closed else None
    many = len(closing.free) > _FEW
    own = range(closing.system.nq) if many else None
    if q is not None and target.distances(closing, q, own)[1] < _NEAR:
        return Assembled(moved_to_guess(closing, target, [q])[0])
    if many:
        reached = _by_blocks(closing, target, q)
        return None if reached is None else Assembled(_met(closing, target, [reached]))
    if q is None:
        found = candidates(closing, start, _MODES)
        if not found:
            return None
        q = nearest_of(closing, found, target)[0]
        if is_movable(closing, q):
            q = nearest_in_all(closing, target, q)
            found = _modes(closing, target, q)
    else:
        found = _modes(closing, target, q)
    best = nearest_of(closing, found, target)[0]
    met = _met(closing, target, [best, *found])
    if met is not best:
        best, found = met, _modes(closing, target, met)
    return Assembled(best, _others(closing, best, found))


def moved_to_guess(closing: Closing, target: GuessTarget, starts: list[Vector]) -> list[Vector]:
    """Return configurations nearest to the guess, by minimisation from closed configurations.

    The start configurations are returned unchanged if one of them agrees with the guess, or if the
    loops allow no motion.

    Args:
        closing: closure rows and the locked positions.
        target: guess of all positions.
        starts: (nq,) closed configurations.
    """
    if not target.guessed:
        return starts
    missed = [q for q in starts if target.miss(closing, q) > MET]
    if len(missed) < len(starts) or not any(is_movable(closing, q) for q in starts):
        return starts
    return least_distance(closing, target, starts)


def _met(closing: Closing, target: GuessTarget, found: list[Vector]) -> Vector:
    """Return found[0], or a closed configuration that is nearer to the guessed positions.

    Args:
        closing: closure rows and the locked positions.
        target: guess of all positions.
        found: (nq,) closed configurations. The nearest configuration is first.
    """
    q = found[0]
    if not target.guessed or target.miss(closing, q) <= MET or not is_movable(closing, q):
        return q
    if len(closing.free) < MANY:
        found = [*found, *candidates(closing, target.start, _MODES)]
    best = nearest_of(closing, moved_to_guess(closing, target, found), target)[0]
    # random starts may change the branch of loops that do not affect guessed positions
    reached = _by_blocks(closing, target, best)
    if reached is None or target.miss(closing, reached) > target.miss(closing, best) + EQUAL:
        return best
    return nearest_of(closing, [best, reached], target)[0]


def _modes(closing: Closing, target: GuessTarget, q: Vector | None) -> list[Vector]:
    """Return closed configurations that have the same independent positions as q, q first.

    They are found from random starts.

    Args:
        closing: closure rows and the locked positions.
        target: guess of all positions.
        q: (nq,) closed configuration; None if Newton's method found none.
    """
    held, at = _held(closing, target, q)
    found = [] if q is None else [q]
    for other in candidates(held, at, _MODES):
        if not any(np.abs(difference(closing.system, other, x)).max() < EQUAL for x in found):
            found.append(other)
    return found


def _held(closing: Closing, target: GuessTarget, q: Vector | None) -> tuple[Closing, Vector]:
    """Lock as many positions at their values in q as determine the others; guessed ones preferred.

    Args:
        closing: closure rows and the locked positions.
        target: guess of all positions.
        q: (nq,) closed configuration. If it is None, no further position is locked.

    Returns:
        Closure rows with these positions locked, and the start configuration (nq,) with their
        values.
    """
    if q is None:
        return closing, target.start
    parts = quaternion_slices(closing.system.tree)
    turning = {k for part in parts for k in range(part.start, part.stop)}
    more = [k for k in _independent(closing, q, set(target.guessed)) if k not in turning]
    held = replace(closing, locked=tuple(sorted({*closing.locked, *more})))
    at = target.start.copy()
    at[list(held.locked)] = q[list(held.locked)]
    return held, at


def _others(closing: Closing, best: Vector, found: list[Vector]) -> tuple[Vector, ...]:
    """Return the configurations in `found` that differ from `best` and from each other.

    Quaternions do not count, since a rod that spins about its axis is no other configuration.
    """
    turning = np.zeros(closing.system.nq, dtype=bool)
    for part in quaternion_slices(closing.system.tree):
        turning[part] = True
    others = list[Vector]()
    for x in found:  # a rod that spins about its axis is not another configuration
        apart = (np.abs(difference(closing.system, x, one))[~turning] for one in (best, *others))
        if all(np.max(moves, initial=0.0) > EQUAL for moves in apart):
            others.append(x)
    return tuple(others)


def closes(closing: Closing, q: Vector) -> bool:
    """Whether a configuration closes the loops without correction, with no axis opposed.

    Args:
        closing: closure rows and the locked positions.
        q: (nq,) configuration.
    """
    return closing.openness(q) <= CLOSED and closing.faces(q)


def nearest_of(
    closing: Closing, found: list[Vector], target: GuessTarget, own: Sequence[int] | None = None
) -> list[Vector]:
    """Return configurations in the order of their distance from the target.

    Args:
        closing: closure rows of the loops.
        found: (nq,) configurations.
        target: positions with which configurations are compared.
        own: indices in q of the positions that count, as in `GuessTarget.distances`.
    """
    left, ordered = list(found), list[Vector]()
    while left:
        best = left[0]
        for other in left[1:]:
            if _is_nearer(closing, other, best, target, own):
                best = other
        ordered.append(best)
        left = [q for q in left if q is not best]
    return ordered


def _is_nearer(
    closing: Closing, q: Vector, other: Vector, target: GuessTarget, own: Sequence[int] | None
) -> bool:
    """Whether the configuration q is nearer to the target than the configuration `other`.

    Guessed positions are compared first, then all positions, then massless nodes, which move less.
    If both are equally near, the first position that differs decides, in the order of the
    description: the larger value is nearer. Quaternions are compared with a positive first element.
    """
    distances, others = (target.distances(closing, one, own) for one in (q, other))
    for distance, least in zip(distances, others, strict=True):
        if abs(distance - least) > EQUAL:
            return distance < least
    system = closing.system
    order = {row.name: number for number, row in enumerate(system.joints)}
    rows, moves = target.rows, target.moves_between(q, other)
    apart = [k for k in range(len(rows)) if abs(moves[k]) > EQUAL]
    if not apart:
        return False
    first = min(apart, key=lambda k: order.get(rows[k].joint, k))
    if rows[first].kind == "quaternion":  # a quaternion and its negative are one orientation
        own_joint = [k for k in apart if rows[k].joint == rows[first].joint]
        moves = target.signed_positions(q) - target.signed_positions(other)
        first = next((k for k in own_joint if abs(moves[k]) > EQUAL), first)
    return bool(moves[first] > 0)


# Mechanisms with many free positions, block by block.


def _by_blocks(closing: Closing, target: GuessTarget, q: Vector | None) -> Vector | None:
    """Return a closed configuration found block by block, each block nearest to the target.

    If the loops do not separate into blocks or the search fails, q is returned.

    Args:
        closing: closure rows and the locked positions.
        target: guess of all positions.
        q: (nq,) closed configuration; None if Newton's method found none.
    """
    start = target.start
    held, at = _held(closing, target, q)
    blocks = _blocks(held, at if q is None else q)
    if blocks is None:
        return q
    tried = 0
    stack = [(0, at)]
    while stack and tried < _MOST:
        number, reached = stack.pop()
        tried += 1
        if number == len(blocks):
            whole = closing.nearest(reached)
            if whole.is_closed:
                return unwound(closing, whole.q, start)
            continue
        own = blocks[number]
        options = _options(own, reached)
        ordered = nearest_of(closing, options, target, own.free)
        stack += [(number + 1, option) for option in reversed(ordered)]
    return q


def _options(block: Closing, start: Vector) -> list[Vector]:
    """Return configurations that close a block; positions of other loops stay at `start` (nq,).

    A configuration near the start is returned alone.
    """
    first = block.nearest(start)
    found = [unwound(block, first.q, start)] if first.is_closed else []
    near = GuessTarget.at(block, start, ())
    if found and near.distances(block, found[0], block.free)[1] < _NEAR:
        return found
    for other in candidates(block, start, _MODES):
        if not any(np.abs(difference(block.system, other, q)).max() < EQUAL for q in found):
            found.append(other)
    return found


def _independent(closing: Closing, q: Vector, guessed: set[int]) -> list[int]:
    """Return indices in q of free positions that determine the other free positions at q.

    Args:
        closing: closure rows and the locked positions.
        q: (nq,) configuration at which ranks are evaluated.
        guessed: indices of guessed positions, which are preferred.
    """
    J = closing.rows(q)[1] / closing.sizes[:, None]
    J = J * distance_units((closing.system.coordinates[k].unit for k in closing.free), closing.size)
    left = list(range(len(closing.free)))
    full, taken = rank(J, _FLAT), list[int]()
    order = sorted(left, key=lambda k: (closing.free[k] not in guessed, k))
    for k in order:
        if len(left) == full:
            break
        others = [m for m in left if m != k]
        if rank(J[:, others], _FLAT) == full:
            left, taken = others, [*taken, closing.free[k]]
    return taken


def _blocks(closing: Closing, q: Vector) -> list[Closing] | None:
    """Split the loops into blocks that can be closed one after the other; None for a single block.

    A block is a set of loops that determine their positions once the blocks before it are closed.

    Args:
        closing: closure rows and the locked positions.
        q: (nq,) configuration at which ranks are evaluated.
    """
    groups = _row_groups(closing.system)
    J = replace(closing, locked=()).rows(q)[1] / closing.sizes[:, None]
    depends = {
        name: set(np.flatnonzero(np.any(J[rows] != 0, axis=0)).tolist()) & set(closing.free)
        for name, rows in groups.items()
    }
    known, waiting, found = set[int](), list(groups), list[Closing]()
    while waiting:
        names = _next_block(J, groups, depends, known, waiting)
        free = set[int]().union(*(depends[name] for name in names)) - known
        waiting = [name for name in waiting if name not in names]
        known |= free
        if not free:
            continue
        rows = sorted(row for name in names for row in groups[name])
        locked = tuple(k for k in range(closing.system.nq) if k not in free)
        axes = _axes_of(closing.system, known | set(closing.locked), free)
        found.append(Closing(closing.system, closing.p, locked, tuple(rows), axes))
    return found if len(found) > 1 else None


def _row_groups(system: System) -> dict[str, list[int]]:
    """Return row indices of each loop, coupling and component, and of each quaternion norm."""
    groups = dict[str, list[int]]()
    rows = position_rows(system)
    for k, (name, *_) in enumerate(rows):
        groups.setdefault(name, []).append(k)
    for k, part in enumerate(quaternion_slices(system.tree)):
        groups[f"norm of {part.start}"] = [len(rows) + k]
    return groups


def _next_block(
    J: Vector,
    groups: dict[str, list[int]],
    depends: dict[str, set[int]],
    known: set[int],
    waiting: list[str],
) -> list[str]:
    """Return the smallest connected set of unsolved row groups that determines its unknowns.

    If there is none, all groups connected to the first one are returned.

    Args:
        J: (m, nq) dimensionless closure Jacobian.
        groups: row indices of each loop, coupling, component and quaternion norm, by name.
        depends: indices of free positions on which each group depends.
        known: indices of the positions that earlier blocks determine.
        waiting: names of the unsolved groups.
    """
    paths = [[name] for name in waiting]
    for _ in range(_LOOPS):
        for names in paths:
            unknown = sorted(set[int]().union(*(depends[name] for name in names)) - known)
            rows = [row for name in names for row in groups[name]]
            if rank(J[np.ix_(rows, unknown)], _FLAT) == len(unknown):
                return names
        paths = [
            [*names, other]
            for names in paths
            for other in waiting
            if other not in names
            and (set[int]().union(*(depends[name] for name in names)) & depends[other]) - known
        ]
    return list(_connected(depends, known, waiting))


def _connected(depends: dict[str, set[int]], known: set[int], waiting: list[str]) -> Iterator[str]:
    """Yield the unsolved row groups that are connected to waiting[0] by unknown positions.

    Groups connected through further groups are included.
    """
    reached, names = set(depends[waiting[0]]) - known, {waiting[0]}
    grown = True
    while grown:
        grown = False
        for name in waiting:
            if name not in names and reached & depends[name]:
                names.add(name)
                reached |= depends[name] - known
                grown = True
    yield from (name for name in waiting if name in names)


def _axes_of(system: System, known: set[int], free: set[int]) -> tuple[int, ...]:
    """Return indices of the cosines of axes that a block determines, to check against opposed axes.

    Args:
        system: mechanism with loops.
        known: indices of positions that are known after the block.
        free: indices of the positions of the block.
    """

    def build() -> list[set[int]]:
        q = SX.sym("q", system.nq)
        pattern = Function("facing", [q, system.p], [facing(system, q)]).jac_sparsity(0, 0)
        rows, columns = pattern.get_triplet()
        found = [set[int]() for _ in range(pattern.size1())]
        for row, column in zip(rows, columns, strict=True):
            found[row].add(column)
        return found

    depends: list[set[int]] = system.cached("axes of loops", build)
    return tuple(k for k, own in enumerate(depends) if own & free and own <= known)
