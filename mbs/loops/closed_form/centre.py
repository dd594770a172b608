"""Points of a loop that its unknown joints turn about: balls, and turns whose axes meet.

What lies beyond such a centre only sees a point, whatever the joints in it do.
"""

from __future__ import annotations

from dataclasses import dataclass

from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.ring import Gap, Ring, Unknown
from mbs.loops.closed_form.survey import always_zero, axes_meet, meeting_point
from mbs.spatial import Pose, vector


@dataclass(frozen=True, slots=True, eq=False)
class Centre:
    """Consecutive unknown joints that leave one point where it is.

    Attributes:
        first: number of the first of them in the loop.
        count: how many: one ball, or two or three turns.
        before: (3, 1) the point in the frame before the first one.
        after: (3, 1) the point in the frame after the last one.
    """

    first: int
    count: int
    before: SX
    after: SX

    def places(self, size: int) -> list[int]:
        """Its joints in a loop of so many joints."""
        return [(self.first + k) % size for k in range(self.count)]


def centres(ring: Ring, q: SX, p: SX) -> list[Centre]:
    """Every ball of a loop, and every two or three neighbours that turn about one point."""
    found = list[Centre]()
    for k, joint in enumerate(ring.joints):
        if joint.motion is Motion.SPHERICAL:
            found.append(Centre(k, 1, vector([0, 0, 0]), vector([0, 0, 0])))
        elif _turns(ring, k, 2) and axes_meet(_gap(ring, k + 1), q, p):
            first, second = meeting_point(_gap(ring, k + 1))
            found.append(Centre(k, 2, vector([0, 0, first]), vector([0, 0, second])))
            if _turns(ring, k, 3):
                seen = _gap(ring, k + 2).inverse()
                third = seen.p + seen.R @ vector([0, 0, second])
                if always_zero(third[0:2], q, p):
                    found.append(Centre(k, 3, vector([0, 0, first]), vector([0, 0, third[2]])))
    return found


def with_balls(ring: Ring, q: SX, p: SX) -> Ring:
    """The loop with a ball in the place of every three turns whose axes meet in one point."""
    for centre in centres(ring, q, p):
        if centre.count == 3 and len(ring.joints) > 3:
            return with_balls(collapsed(ring, centre), q, p)
    return ring


def collapsed(ring: Ring, centre: Centre) -> Ring:
    """The loop begun at a centre, with a ball in its place."""
    begun = ring.rotated(centre.first)
    joints, gaps = begun.joints[centre.count :], begun.gaps[centre.count :]
    name = ", ".join(joint.name for joint in begun.joints[: centre.count])
    ball = Unknown(name, Motion.SPHERICAL, None, 1)
    first = begun.gaps[0].then(Pose.moved(centre.before))
    leave = Gap(Pose.moved(-centre.after))
    if not joints:
        return Ring((ball,), (first.after(leave),))
    return Ring((ball, *joints), (first, gaps[0].after(leave), *gaps[1:]))


def _gap(ring: Ring, k: int) -> Pose:
    return ring.gaps[k % len(ring.gaps)].pose


def _turns(ring: Ring, first: int, count: int) -> bool:
    """Whether so many different neighbours are turns."""
    n = len(ring.joints)
    among = [ring.joints[(first + k) % n] for k in range(count)]
    return count <= n and all(joint.motion is Motion.REVOLUTE for joint in among)
