"""Inertial parameters moved towards the base, and frames slid to where distances vanish.

What joint j cannot tell from a part of link i belongs to link i: mass on the axis of a revolute
joint, the whole rotational inertia behind a prismatic joint, the mass at the centre of a
spherical joint. The equations stay the same; their constants are sums that are computed once.

Source: Gautier & Khalil 1990.
"""

from __future__ import annotations

from dataclasses import replace

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components.joints import Motion
from mbs.recursions.poses import LinkPose
from mbs.spatial import Body, Inertia, ScrewDisplacement, body_through, elements, exact_sum


def regroup(tree: Tree, poses: list[LinkPose], bodies: list[Body]) -> list[Body]:
    """The bodies of a tree with the same equations of motion and fewer parameters.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        bodies: of the links, about and in their frames.
    """
    bodies = list(bodies)
    for j in reversed(range(len(tree.links))):
        link = tree.links[j]
        if link.motion is Motion.FREE:
            continue
        bodies[j], moved = _parts(link.motion, bodies[j])
        if link.antecedent >= 0:
            part = _seen_through(moved, link.motion, poses[j])
            bodies[link.antecedent] = _join(bodies[link.antecedent], part)
    return bodies


def _parts(motion: Motion, body: Body) -> tuple[Body, Body]:
    """What link j keeps and what belongs to link i, both about and in frame j."""
    match motion:
        case Motion.REVOLUTE:
            return body.along_axis()
        case Motion.PRISMATIC:
            return body.rotational()
    return body.massive()


def _seen_through(body: Body, motion: Motion, pose: LinkPose) -> Body:
    """A moved part about and in frame i; behind a prismatic joint it has no place, only axes."""
    if motion is Motion.PRISMATIC:
        for step in reversed(pose.steps):
            body = body.rotate(step.rotation)
        return body
    screw = pose.motion[0]
    if isinstance(screw, ScrewDisplacement):
        body = body.shift(2, screw.t)
    return body_through(pose.seat, body)


def _join(body: Body, part: Body) -> Body:
    """Two bodies welded together; numbers that cancel are zero, so that they fold."""
    both = zip(_moments(body), _moments(part), strict=True)
    return type(body)(*(_sum(a, b) for a, b in both))


def _sum(a: SX, b: SX) -> SX:
    entries = (exact_sum(x, y) for x, y in zip(elements(a), elements(b), strict=True))
    return casadi.reshape(casadi.vertcat(*entries), *a.shape)


def _moments(body: Body) -> tuple[SX, SX, SX]:
    return body.J if isinstance(body, Inertia) else body.S, body.ms, body.m


# Frames slid along the axes of their joints to where distances vanish.
#
# The origin of the frame of a revolute link may stand anywhere on its axis. Three places save
# operations: the foot of the axis when it is at rest, because no force on it does any work and
# gravity alone accelerates it; the foot of the axis of a last link; the height of the link behind
# it when that one rotates about a parallel axis and the frame stands beside its foot already: a
# distance that is passed on to a joint without one saves nothing.


def shift_frames(
    tree: Tree, poses: list[LinkPose], bodies: list[Body], *, base_rests: bool = True
) -> tuple[list[LinkPose], list[Body]]:
    """The same tree with other frames of revolute links.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        bodies: of the links, about and in their frames.
        base_rests: whether the base has no motion.
    """
    rise = _rises(tree, poses, base_rests)
    if all(up.is_zero() for up in rise):
        return poses, bodies
    moved = [_between(tree, poses, rise, j) for j in range(len(poses))]
    return moved, [body.shift(2, -rise[j]) for j, body in enumerate(bodies)]


def _rises(tree: Tree, poses: list[LinkPose], base_rests: bool) -> list[SX]:
    """How far each frame moves up its axis [m]."""
    resting = _resting(tree, poses) if base_rests else set()
    rise = [SX(0)] * len(poses)
    for j in reversed(range(len(poses))):
        if tree.links[j].motion is not Motion.REVOLUTE:
            continue
        behind = [k for k, link in enumerate(tree.links) if link.antecedent == j]
        if not behind or (len(behind) == 1 and j in resting):
            rise[j] = -poses[j].height
        elif len(behind) == 1 and len(poses[behind[0]].run) > 1 and not poses[j].height.is_zero():
            k = behind[0]
            rise[j] = poses[k].foot[2] + poses[k].height + rise[k]
    return rise


def _resting(tree: Tree, poses: list[LinkPose]) -> set[int]:
    """Links whose axis has its foot at rest."""
    found: set[int] = set()
    for j, link in enumerate(tree.links):
        i = link.antecedent
        if i < 0:
            if link.motion is Motion.REVOLUTE:
                found.add(j)
        elif i in found and poses[j].foot[0].is_zero() and poses[j].foot[1].is_zero():
            on_axis_of_base = tree.links[i].antecedent < 0
            if on_axis_of_base or (poses[j].foot[2].is_zero() and poses[i].height.is_zero()):
                found.add(j)
    return found


def _between(tree: Tree, poses: list[LinkPose], rise: list[SX], j: int) -> LinkPose:
    """The pose of link j when its frame and that of its antecedent are moved."""
    pose, i = poses[j], tree.links[j].antecedent
    b = -rise[i] if i >= 0 else SX(0)
    screw = pose.motion[0]
    if isinstance(screw, ScrewDisplacement):
        r = screw.t + rise[j]
        if len(pose.run) > 1 and not b.is_zero():  # the seat has a height in any case
            b, r = b + r, SX(0)
        pose = replace(pose, motion=(replace(screw, t=r),))
    if b.is_zero():
        return pose
    return replace(pose, seat=(ScrewDisplacement.about("z", SX(0), b), *pose.seat))
