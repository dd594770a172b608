"""Configuration in which the loops of a mechanism are assembled: the nearest to the guesses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.components.joints import Motion
from mbs.errors import Unclosable
from mbs.loops.closing import Closing, unwound
from mbs.loops.configuration import closed_configuration
from mbs.loops.guess_target import GuessTarget
from mbs.loops.nearest import (
    Assembled,
    closes,
    moved_to_guess,
    nearest_configuration,
    nearest_of,
)

Vector = NDArray[np.float64]

_FEW_GUESSES = 8
"""Largest number of guesses for which each guess is left out once: each takes a search."""


def assembled_configuration(system: System, guess: Mapping[str, float], p: Vector) -> Assembled:
    """Return the configuration that closes the loops and is nearest to a guess.

    A position without a guess counts as zero. A guess that closes the loops is returned unchanged.
    Otherwise some positions are held, and the loops are closed with the other positions. Several
    sets of held positions are tried in turn, until the loops close:

    1. if a position is guessed: all positions except the unknowns of components, such as the
       parameter of a curve;
    2. guessed positions, positions of motors, and joints with a spring; a joint with a spring that
       has no guess is held where the spring has no force;
    3. if no motor is guessed: all guessed positions except one; the nearest result is taken;
    4. smaller sets of these; those without the joints with springs come last.

    The distance of two configurations is the largest difference of a position. Lengths are divided
    by the size of the mechanism. Positions of joints that are cut count too. If two
    configurations are at the same distance, the first position that differs decides, in the order
    of the description: the larger value is taken.
    Solved angles are within half a rotation of their guess, or of zero.

    Args:
        system: mechanism whose loops may be open.
        guess: approximate positions by coordinate name [rad or m].
        p: (np,) parameters.

    Raises:
        Unclosable: no configuration closes the loops.
    """
    names = [coordinate.name for coordinate in system.coordinates]
    known = {name: value for name, value in guess.items() if name in names}
    given = np.array(system.position(known))
    rest = rest_positions(system, p)
    start = np.array(system.position({**{names[k]: x for k, x in rest.items()}, **known}))
    target = GuessTarget.of(system, p, start, guess)
    whole = target.closing({k for k in target.guessed if k >= system.nq})
    if closes(whole, given):
        return Assembled(given)
    unknown = _unknowns(system)
    for group in _stages(system, unknown, set(target.guessed) - unknown, set(rest)):
        closings = (target.closing(held) for held in group)
        found = [one for c in closings if (one := nearest_configuration(c, target)) is not None]
        if found:
            first = nearest_of(Closing(system, p), [one.q for one in found], target)[0]
            return next(one for one in found if one.q is first)
    motors = {k for k, c in enumerate(system.coordinates) if c.actuated}
    held = target.closing(set(target.guessed) & motors)
    try:
        q = closed_configuration(target.closing(motors), start, restarts=10)
    except Unclosable:
        held = Closing(system, p)
        q = closed_configuration(held, start)
    return Assembled(moved_to_guess(held, target, [unwound(held, q, start)])[0])


def rest_positions(system: System, p: Vector) -> dict[int, float]:
    """Return the position at which the spring of a joint has no force [rad or m], by index in q.

    Joints without a spring are left out.

    Args:
        system: open or closed mechanism.
        p: (np,) parameters.
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
    """Return indices in q of the unknowns of components and of massless nodes."""
    names = {
        f"{part.name}.{name}" for part in system.parts for name in part.element.names_of("unknown")
    }
    found = {k for k, coordinate in enumerate(system.coordinates) if coordinate.name in names}
    return found | {position for position, _ in system.nodes}


def _stages(
    system: System, unknown: set[int], guessed: set[int], rest: set[int]
) -> Iterator[list[set[int]]]:
    """Yield groups of index sets. The positions of a set are fixed while the loops are closed.

    The caller compares the results of all sets of a group and tries the next group if none closes.
    Later groups have smaller sets. Indices from nq on belong to cut joints.

    Args:
        system: mechanism with loops.
        unknown: indices of unknowns of components and of massless nodes.
        guessed: indices of guessed positions.
        rest: indices of joints with a spring, fixed where the spring has no force.
    """
    motors = {k for k, c in enumerate(system.coordinates) if c.actuated}
    stages = list[list[set[int]]]()
    if unknown and guessed:
        cut = {k for k in guessed if k >= system.nq}
        stages.append([(set(range(system.nq)) | cut) - unknown])
    stages += [[guessed | motors | rest], [guessed | rest]]
    if 1 < len(guessed) <= _FEW_GUESSES and not guessed & motors:
        stages.append([(guessed - {k}) | rest for k in sorted(guessed)])
    stages += [
        [(guessed & motors) | rest],
        [rest],
        [guessed],
        [guessed & motors],
        [set()],
    ]
    for number, group in enumerate(stages):
        if group not in stages[:number]:
            yield group
