"""Centres of rotation in a loop: the other joints depend on the position of the centre only."""

from __future__ import annotations

from dataclasses import dataclass

from casadi import SX

from mbs.closed_forms.ring import always_zero, axes_meet, meeting_point
from mbs.components.joints import Motion
from mbs.recursions.chain import ChainJoint, Gap, Ring
from mbs.spatial import Pose, vector


@dataclass(frozen=True, slots=True, eq=False)
class Centre:
    """Consecutive unknown joints that keep one point fixed, the centre of their rotations.

    Attributes:
        first: index of the first of these joints in the loop.
        count: number of joints: one spherical joint, or two or three revolute joints.
        before: (3, 1) centre in the frame before the first of these joints.
        after: (3, 1) centre in the frame after the last of these joints.
    """

    first: int
    count: int
    before: SX
    after: SX

    def joints(self, size: int) -> list[int]:
        """Return the indices of its joints in a loop of `size` joints.

        Args:
            size: number of joints of the loop.
        """
        return [(self.first + k) % size for k in range(self.count)]


def centres(ring: Ring, q: SX, p: SX) -> list[Centre]:
    """Return the centres of a loop: points that consecutive joints keep fixed.

    They are spherical joints, and two or three neighbouring revolute joints whose axes intersect in
    one point for all positions.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.
    """
    found = list[Centre]()
    for k, joint in enumerate(ring.joints):
        if joint.motion is Motion.SPHERICAL:
            found.append(Centre(k, 1, vector([0, 0, 0]), vector([0, 0, 0])))
        elif are_revolute(ring, k, 2) and axes_meet(gap_pose(ring, k + 1), q, p):
            first, second = meeting_point(gap_pose(ring, k + 1))
            found.append(Centre(k, 2, vector([0, 0, first]), vector([0, 0, second])))
            if are_revolute(ring, k, 3):
                seen = gap_pose(ring, k + 2).inverse()
                third = seen.p + seen.R @ vector([0, 0, second])
                if always_zero(third[0:2], q, p):
                    found.append(Centre(k, 3, vector([0, 0, first]), vector([0, 0, third[2]])))
    return found


def with_spherical(ring: Ring, q: SX, p: SX) -> Ring:
    """Return the loop with one spherical joint instead of every three intersecting revolute joints.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.
    """
    for centre in centres(ring, q, p):
        if centre.count == 3 and len(ring.joints) > 3:
            return with_spherical(merge_centre(ring, centre), q, p)
    return ring


def merge_centre(ring: Ring, centre: Centre) -> Ring:
    """Return the loop with the joints of a centre as one spherical joint, which is its first joint.

    Args:
        ring: loop chain.
        centre: centre of the loop.
    """
    begun = ring.rotated(centre.first)
    joints, gaps = begun.joints[centre.count :], begun.gaps[centre.count :]
    name = ", ".join(joint.name for joint in begun.joints[: centre.count])
    spherical = ChainJoint(name, Motion.SPHERICAL, None, 1)
    first = begun.gaps[0].then(Pose.translation(centre.before))
    leave = Gap(Pose.translation(-centre.after))
    if not joints:
        return Ring((spherical,), (first.after(leave),))
    return Ring((spherical, *joints), (first, gaps[0].after(leave), *gaps[1:]))


def gap_pose(ring: Ring, k: int) -> Pose:
    """Return the known transform before joint k of a loop.

    Args:
        ring: loop chain.
        k: index of the joint, counted cyclically around the loop.
    """
    return ring.gaps[k % len(ring.gaps)].pose


def are_revolute(ring: Ring, first: int, count: int) -> bool:
    """Whether some neighbouring joints of a loop are revolute and all different.

    Args:
        ring: loop chain.
        first: index of the first joint.
        count: number of joints.
    """
    n = len(ring.joints)
    among = [ring.joints[(first + k) % n] for k in range(count)]
    return count <= n and all(joint.motion is Motion.REVOLUTE for joint in among)
