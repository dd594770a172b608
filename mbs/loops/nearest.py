"""Search for the closed configuration that is nearest to a guess."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import quaternion_slices
from mbs.loops.closing import CLOSED, Closing, candidates, difference
from mbs.loops.closure import facing, position_rows
from mbs.solvers.rank import rank

Vector = NDArray[np.float64]

_FEW = 24
"""Free positions up to which other configurations of all loops together are searched: a search
takes sixty starts. Larger mechanisms are searched block by block."""
_NEAR = 0.5
"""Distance of a configuration from its start below which no other one is searched [rad, or sizes of
the mechanism]: branches that are nearer to each other meet there."""
_EQUAL = 1e-6
"""Difference of distances that are equal: configurations are closed to 1e-12, and branches of
symmetric mechanisms are equally near up to rounding."""
_MODES = 64  # configurations of a search, of which the nearest is taken
_LOOPS = 3  # that one block may have
_MOST = 400
"""Configurations of blocks that are tried: some ten blocks of which each has several."""
_FLAT = 1e-6
"""Singular values, of the largest, that count as zero: configurations are closed to 1e-12."""


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """A closed configuration.

    Attributes:
        q: (nq,) positions [rad or m].
        others: further configurations with the same locked positions.
    """

    q: Vector
    others: tuple[Vector, ...] = ()


def nearest_configuration(
    closing: Closing, start: Vector, guessed: Sequence[int]
) -> Assembled | None:
    """Return the closed configuration that is nearest to a start, None if none is found.

    Guessed positions are compared first, then all positions, by the largest difference. Lengths are
    divided by the size of the mechanism. Of two configurations at the same distance the one with
    the larger position is returned, at the first position that differs.
    Mechanisms with many free positions are searched block by block. A block is the least number of
    loops that determine their positions, once the blocks before it are closed.

    Args:
        closing: the rows, and the positions that must not change.
        start: (nq,) first guess.
        guessed: indices of the positions of the start that are guesses.
    """
    if not closing.free:
        return Assembled(start) if closes(closing, start) else None
    first = closing.nearest(start)
    q = unwound(closing, first.q, start) if first.is_closed else None
    if q is not None and _distance(closing, q, start, range(closing.system.nq)) < _NEAR:
        return Assembled(q)
    if len(closing.free) > _FEW:
        reached = _by_blocks(closing, start, q, set(guessed))
        return None if reached is None else Assembled(reached)
    found = [] if q is None else [q]
    for other in candidates(closing, start, _MODES):
        if not any(np.abs(difference(closing.system, other, x)).max() < _EQUAL for x in found):
            found.append(other)
    if not found:
        return None
    best = _nearest_of(closing, found, start, set(guessed), range(closing.system.nq))[0]
    others = [x for x in found if np.abs(difference(closing.system, x, best)).max() > _EQUAL]
    return Assembled(best, tuple(others))


def unwound(closing: Closing, q: Vector, start: Vector) -> Vector:
    """The configuration with angles within half a turn of the start, if that closes the loops."""
    near: Vector = start + difference(closing.system, q, start)
    for part in quaternion_slices(closing.system.tree):
        near[part] = q[part]
    near[list(closing.locked)] = q[list(closing.locked)]
    return near if closing.openness(near) < CLOSED else q


def closes(closing: Closing, q: Vector) -> bool:
    """Whether a configuration closes the loops as it is."""
    return closing.openness(q) <= CLOSED and closing.faces(q)


def _distance(closing: Closing, q: Vector, start: Vector, indices: Sequence[int]) -> float:
    """Largest difference of positions from the start [rad, or sizes of the mechanism]."""
    lengths = [c.unit.startswith("m") for c in closing.system.coordinates]
    scales = np.where(lengths, closing.size, 1.0)
    moves = np.abs(difference(closing.system, q, start)) / scales
    return float(np.max(moves[list(indices)], initial=0.0))


def _nearest_of(
    closing: Closing, found: list[Vector], start: Vector, guessed: set[int], own: Sequence[int]
) -> list[Vector]:
    """Configurations, the nearest to the start first, by guessed positions and by own positions."""
    left, ordered = list(found), list[Vector]()
    while left:
        best = left[0]
        for other in left[1:]:
            if _is_nearer(closing, other, best, start, (sorted(guessed & set(own)), own)):
                best = other
        ordered.append(best)
        left = [q for q in left if q is not best]
    return ordered


def _is_nearer(
    closing: Closing,
    q: Vector,
    other: Vector,
    start: Vector,
    groups: tuple[Sequence[int], Sequence[int]],
) -> bool:
    """Whether a configuration is nearer to the start than another one.

    The positions of the groups are compared one group after the other. Of two configurations that
    are equally near, the one with the larger first position is nearer.
    """
    for indices in groups:
        gap = _distance(closing, q, start, indices) - _distance(closing, other, start, indices)
        if abs(gap) > _EQUAL:
            return gap < 0
    moves = difference(closing.system, q, other)
    apart = np.flatnonzero(np.abs(moves) > _EQUAL)
    return bool(len(apart) and moves[apart[0]] > 0)


# Mechanisms with many free positions, block by block.


def _by_blocks(
    closing: Closing, start: Vector, q: Vector | None, guessed: set[int]
) -> Vector | None:
    """The closed configuration that is nearest to a start in one block after the other.

    Args:
        closing: the rows, and the positions that must not change.
        start: (nq,) first guess.
        q: (nq,) a closed configuration; None if Newton's method found none.
        guessed: indices of guessed positions.
    """
    held, at = closing, start
    if q is not None:
        more = _independent(closing, q, guessed)
        held = replace(closing, locked=tuple(sorted({*closing.locked, *more})))
        at = start.copy()
        at[list(held.locked)] = q[list(held.locked)]
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
        ordered = _nearest_of(closing, options, start, guessed, own.free)
        stack += [(number + 1, option) for option in reversed(ordered)]
    return q


def _options(block: Closing, start: Vector) -> list[Vector]:
    """Configurations that close a block; the first is near enough, or others are searched too."""
    first = block.nearest(start)
    found = [unwound(block, first.q, start)] if first.is_closed else []
    if found and _distance(block, found[0], start, block.free) < _NEAR:
        return found
    for other in candidates(block, start, _MODES):
        if not any(np.abs(difference(block.system, other, q)).max() < _EQUAL for q in found):
            found.append(other)
    return found


def _independent(closing: Closing, q: Vector, guessed: set[int]) -> list[int]:
    """Free positions that determine the others at q: guessed ones before others, where possible."""
    J = closing.rows(q)[1] / closing.sizes[:, None]
    lengths = [closing.system.coordinates[k].unit.startswith("m") for k in closing.free]
    J = J * np.where(lengths, closing.size, 1.0)
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
    """The loops in blocks that determine their positions in turn; None if there is one block only.

    Args:
        closing: the rows, and the positions that must not change.
        q: (nq,) configuration at which ranks are measured.
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
    """Indices of the rows of each loop, coupling and component, and of each quaternion's norm."""
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
    """The least connected groups of rows that determine their unknown positions; else all left."""
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
    """The groups of rows that share unknown positions with the first one."""
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
    """The cosines that must be positive and that depend on positions of a block and known ones."""

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
