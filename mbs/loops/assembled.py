"""The configuration at which the loops of a mechanism are assembled: the nearest to the guesses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.components.joints import Motion
from mbs.errors import Unclosable
from mbs.loops.closing import Closing
from mbs.loops.configuration import closed_configuration
from mbs.loops.nearest import Assembled, closes, nearest_configuration, unwound

Vector = NDArray[np.float64]


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
    if closes(Closing(system, p), given):
        return Assembled(given)
    rest = rest_positions(system, p)
    start = np.array(system.position({**{names[k]: x for k, x in rest.items()}, **known}))
    unknown = _unknowns(system)
    guessed = {k for k, name in enumerate(names) if name in known} - unknown
    for locked in _stages(system, unknown, guessed, set(rest)):
        closing = Closing(system, p, tuple(sorted(locked)))
        found = nearest_configuration(closing, start, sorted(guessed))
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
    """Indices of the coordinates that are unknowns of components."""
    names = {
        f"{part.name}.{name}" for part in system.parts for name in part.element.names_of("unknown")
    }
    return {k for k, coordinate in enumerate(system.coordinates) if coordinate.name in names}


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
