"""A loop whose turns are all about one direction: the one slide that has a part along it.

Along the direction n of the turns only that slide moves anything: n.e + (n.u) s = 0, linear. What
is left is a plane loop. A ball may stand in the loop, which keeps a point.

Source: Khalil & Creusot 1997, section 3.3, equation of type 1.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.centre import with_balls
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root, positions
from mbs.loops.closed_form.survey import always_zero
from mbs.loops.closed_form.trigonometry import in_plane
from mbs.spatial import Pose


def along_normal(ring: Ring, q: SX, p: SX) -> Root | None:
    """The slide along the turns of a loop; None where it is not the only one, or not all agree."""
    ring = with_balls(ring, q, p)
    kinds = [joint.motion for joint in ring.joints]
    if kinds.count(Motion.SPHERICAL) > 1 or Motion.REVOLUTE not in kinds:
        return None
    if Motion.SPHERICAL in kinds:
        ring = ring.rotated((kinds.index(Motion.SPHERICAL) + 1) % len(kinds))
    poses = _held(ring)
    turns = [pose for k, pose in poses.items() if ring.joints[k].motion is Motion.REVOLUTE]
    normal = turns[0].R[:, 2]
    if not all(always_zero(in_plane(turn.R.T @ normal), q, p) for turn in turns):
        return None
    moving = {
        k: slope
        for k, pose in poses.items()
        if ring.joints[k].motion is Motion.PRISMATIC
        and not always_zero(slope := casadi.dot(normal, pose.R[:, 2]), q, p)
    }
    if len(moving) != 1:
        return None
    ((k, slope),) = moving.items()
    end = list(poses.values())[-1].p
    return Root({"": positions([ring.joints[k]], [-casadi.dot(normal, end) / slope])})


def _held(ring: Ring) -> dict[int, Pose]:
    """Where each joint is when all of them are at zero, seen from the start of the loop."""
    poses, pose = dict[int, Pose](), Pose.identity()
    for k, gap in enumerate(ring.gaps):
        pose = pose @ gap.pose
        poses[k] = pose
    return poses
