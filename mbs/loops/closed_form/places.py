"""Where positions stand: those of q, then those of cut joints, then the spins of rods.

A rod between two balls may spin about its own line, which no closure row sees: one velocity of a
quaternion is independent then, and no element of q belongs to it. Its position here is the angle by
which the rod is turned about its line [rad], from where the shortest way leads from its orientation
in the assembled posture.
"""

from __future__ import annotations

from mbs.assembly import System
from mbs.assembly.tree import Link
from mbs.components.motion import Motion
from mbs.errors import NoClosedForm


def cut_places(system: System) -> tuple[int, ...]:
    """Where the positions of each cut joint begin, and the end of all."""
    counts = [max(1, len(cut.edge.joint.freedoms)) for cut in system.cuts]
    return tuple(system.nq + sum(counts[:k]) for k in range(len(counts) + 1))


def spin_places(system: System) -> dict[int, int]:
    """The place of each spin, by the number in q at which the quaternion of its ball begins."""
    balls = [
        link.q.start
        for link in system.tree.links
        for k in system.free
        if link.motion is Motion.SPHERICAL and link.v.start <= k < link.v.stop
    ]
    first = cut_places(system)[-1]
    return {start: first + number for number, start in enumerate(balls)}


def extent(system: System) -> int:
    """How many positions there are, those of cut joints and spins included."""
    return cut_places(system)[-1] + len(spin_places(system))


def independent_places(system: System) -> list[int]:
    """The places of the independent joints, in the order of `system.free`.

    Raises:
        NoClosedForm: a body is free, or a ball turns freely in more than one way.
    """
    spins, places = spin_places(system), list[int]()
    for k in system.free:
        link = next(link for link in system.tree.links if link.v.start <= k < link.v.stop)
        place = link.q.start if link.motion.nq == 1 else spins.get(link.q.start)
        if place is None or place in places:
            raise NoClosedForm(_refusal(system, link))
        places.append(place)
    return places


def _refusal(system: System, link: Link) -> str:
    return (
        f"{system.name}: the quaternion of {link.name} turns freely, and the positions of"
        " independent joints cannot tell how; use mbs.loops.solve without branch"
    )
