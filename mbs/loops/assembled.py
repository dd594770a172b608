"""The configuration at which the loops of a mechanism are assembled: the nearest to the guesses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.components.joints import Motion
from mbs.errors import Unclosable
from mbs.loops.closing import CLOSED, Closing, candidates, difference
from mbs.loops.configuration import closed_configuration, unwound

Vector = NDArray[np.float64]

_FEW = 24
"""Free positions up to which other configurations are searched: a search costs a start each, and
larger mechanisms are assembled near their guesses."""
_NEAR = 0.5
"""Distance of a configuration from its start below which no other one is searched [rad, or sizes of
the mechanism]: branches that are nearer to each other meet there."""
_EQUAL = 1e-6
"""Difference of distances that are equal: configurations are closed to 1e-12, and branches of
symmetric mechanisms are equally near up to rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """A closed configuration.

    Attributes:
        q: (nq,) positions [rad or m].
        others: further configurations with the same locked positions.
    """

    q: Vector
    others: tuple[Vector, ...] = ()


def assembled_configuration(system: System, guess: Mapping[str, float], p: Vector) -> Assembled:
    """Return the configuration that closes the loops and is nearest to a guess.

    A position without a guess counts as zero. A guess that closes the loops is returned unchanged.
    Otherwise some positions are held while the others are solved for. The sets of held positions
    are tried one after the other, until one of them closes the loops:

    1. if a position is guessed: all positions except the unknowns of components, such as the
       parameter of a curve;
    2. guessed positions, positions of motors, and joints with a spring; a joint with a spring that
       has no guess is held where the spring has no force;
    3. smaller sets of these; those without the joints with springs come last.

    The distance of two configurations is the largest difference of a position. Lengths are divided
    by the size of the mechanism. Of two configurations at the same distance, the one with the
    larger position is returned, at the first position that differs.
    Solved angles are within half a turn of their guess, or of zero.

    Args:
        system: its loops need not be closed yet.
        guess: approximate positions by coordinate name [rad or m].
        p: (np,) parameters.

    Raises:
        Unclosable: no configuration closes the loops.
    """
    names = [coordinate.name for coordinate in system.coordinates]
    known = {name: value for name, value in guess.items() if name in names}
    given = np.array(system.position(known))
    if _closes(Closing(system, p), given):
        return Assembled(given)
    rest = rest_positions(system, p)
    start = np.array(system.position({**{names[k]: x for k, x in rest.items()}, **known}))
    unknown = _unknowns(system)
    guessed = {k for k, name in enumerate(names) if name in known} - unknown
    for locked in _stages(system, unknown, guessed, set(rest)):
        closing = Closing(system, p, tuple(sorted(locked)))
        found = _nearest(closing, start, guessed)
        if found is not None:
            return found
    motors = tuple(k for k, c in enumerate(system.coordinates) if c.actuated)
    try:
        q = closed_configuration(Closing(system, p, motors), start, restarts=10)
    except Unclosable:
        q = closed_configuration(Closing(system, p), start)
    return Assembled(unwound(Closing(system, p), q, start))


def rest_positions(system: System, p: Vector) -> dict[int, float]:
    """Return positions at which springs of joints have no force [rad or m], by index in q.

    Joints without a spring are left out.
    """
    found = dict[int, float]()
    for link in system.tree.links:
        if link.motion in (Motion.FREE, Motion.SPHERICAL):
            continue
        values = Function("spring", [system.p], [link.stiffness, link.rest])(p)
        stiffness, rest = (float(value) for value in values)
        if stiffness > 0 and np.isfinite(rest):
            found[link.q.start] = rest
    return found


def _unknowns(system: System) -> set[int]:
    """Indices of the coordinates that are unknowns of components, or massless nodes."""
    names = {
        f"{part.name}.{name}" for part in system.parts for name in part.element.names_of("unknown")
    }
    found = {k for k, coordinate in enumerate(system.coordinates) if coordinate.name in names}
    return found | {position for position, _, _ in system.balanced}


def _stages(
    system: System, unknown: set[int], guessed: set[int], rest: set[int]
) -> Iterator[set[int]]:
    """Indices of locked positions, fewer in each stage."""
    motors = {k for k, c in enumerate(system.coordinates) if c.actuated}
    stages = []
    if unknown and guessed:
        stages.append(set(range(system.nq)) - unknown)
    stages += [guessed | motors | rest, guessed | rest, (guessed & motors) | rest, motors | rest]
    stages += [rest, guessed, guessed & motors, motors, set()]
    for number, locked in enumerate(stages):
        if locked not in stages[:number]:
            yield locked


def _nearest(closing: Closing, start: Vector, guessed: set[int]) -> Assembled | None:
    """The closed configuration nearest to the start; None if none is found."""
    system, free = closing.system, closing.free
    if not free:
        return Assembled(start) if _closes(closing, start) else None
    first = closing.nearest(start)
    if first.is_closed:
        q = unwound(closing, first.q, start)
        if len(free) > _FEW or _distance(closing, q, start, range(system.nq)) < _NEAR:
            return Assembled(q)
    elif len(free) > _FEW:
        return None
    found = [q] if first.is_closed else []
    for other in candidates(closing, start):
        if not any(np.abs(difference(system, other, one)).max() < _EQUAL for one in found):
            found.append(other)
    if not found:
        return None
    best = found[0]
    for other in found[1:]:
        if _is_nearer(closing, other, best, start, guessed):
            best = other
    others = [q for q in found if np.abs(difference(system, q, best)).max() > _EQUAL]
    return Assembled(best, tuple(others))


def _closes(closing: Closing, q: Vector) -> bool:
    """Whether a configuration closes the loops as it is."""
    return closing.openness(q) <= CLOSED and closing.faces(q)


def _distance(closing: Closing, q: Vector, start: Vector, indices: range | list[int]) -> float:
    """Largest difference of positions from the start [rad, or sizes of the mechanism]."""
    lengths = [c.unit.startswith("m") for c in closing.system.coordinates]
    scales = np.where(lengths, closing.size, 1.0)
    moves = np.abs(difference(closing.system, q, start)) / scales
    return float(np.max(moves[list(indices)], initial=0.0))


def _is_nearer(
    closing: Closing, q: Vector, other: Vector, start: Vector, guessed: set[int]
) -> bool:
    """Whether a configuration is nearer to the start than another one.

    Guessed positions are compared first, then all positions, then those of massless nodes, which
    move less than the others; of two configurations that are equally near, the one with the larger
    first position is nearer.
    """
    nodes = [position for position, _, _ in closing.system.balanced]
    for indices in (sorted(guessed), list(range(closing.system.nq)), nodes):
        gap = _distance(closing, q, start, indices) - _distance(closing, other, start, indices)
        if abs(gap) > _EQUAL:
            return gap < 0
    moves = difference(closing.system, q, other)
    apart = np.flatnonzero(np.abs(moves) > _EQUAL)
    return bool(len(apart) and moves[apart[0]] > 0)
