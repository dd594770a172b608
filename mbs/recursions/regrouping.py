"""Regrouping of inertial parameters towards the base, and shift of frames along joint axes.

A part of link j that moves as if fixed on its antecedent i is added to link i: mass on the axis of
a revolute joint, the whole rotational inertia of a link on a prismatic joint, the mass at the
centre of a spherical joint. The equations do not change, and regrouped constants are computed once.

Source: Gautier & Khalil 1990.
"""

from __future__ import annotations

from dataclasses import replace

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components.joints import Motion
from mbs.recursions.link_motions import LinkPose
from mbs.spatial import (
    Body,
    Inertia,
    ScrewDisplacement,
    elements,
    exact_sum,
    transform_inertia_along,
)


def regroup(tree: Tree, poses: list[LinkPose], bodies: list[Body]) -> list[Body]:
    """Return bodies with fewer nonzero parameters and the same equations of motion.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        bodies: inertia of each link, about and in its frame.
    """
    bodies = list(bodies)
    for j in reversed(range(len(tree.links))):
        link = tree.links[j]
        if link.motion is Motion.FREE:
            continue
        bodies[j], moved = _split_body(link.motion, bodies[j])
        if link.antecedent >= 0:
            part = _in_antecedent(moved, link.motion, poses[j])
            bodies[link.antecedent] = _join(bodies[link.antecedent], part)
    return bodies


def _split_body(motion: Motion, body: Body) -> tuple[Body, Body]:
    """Split a body of link j into the part that stays and the part that is moved to its antecedent.

    Both are in frame j. `motion` is the type of joint j.
    """
    match motion:
        case Motion.REVOLUTE:
            return body.along_axis()
        case Motion.PRISMATIC:
            return body.rotational()
    return body.massive()


def _in_antecedent(body: Body, motion: Motion, pose: LinkPose) -> Body:
    """Transform the moved part of a body from frame j to frame i of its antecedent.

    For a prismatic joint the part is a rotational inertia, which only needs a rotation.
    """
    if motion is Motion.PRISMATIC:
        for step in reversed(pose.steps):
            body = body.rotate(step.rotation)
        return body
    screw = pose.motion[0]
    if isinstance(screw, ScrewDisplacement):
        body = body.shift(2, screw.t)
    return transform_inertia_along(pose.seat, body)


def _join(body: Body, part: Body) -> Body:
    """Return the sum of two bodies about the same point; numbers that cancel become exact zeros."""
    both = zip(_moments(body), _moments(part), strict=True)
    return type(body)(*(_sum(a, b) for a, b in both))


def _sum(a: SX, b: SX) -> SX:
    """Return a + b for matrices of equal shape; numbers that cancel become exact zeros."""
    entries = (exact_sum(x, y) for x, y in zip(elements(a), elements(b), strict=True))
    return casadi.reshape(casadi.vertcat(*entries), *a.shape)


def _moments(body: Body) -> tuple[SX, SX, SX]:
    """Return the three moments of a body: of order 2 (J or S), order 1 (ms) and order 0 (m)."""
    return body.J if isinstance(body, Inertia) else body.S, body.ms, body.m


# Shift of frames along the axes of their joints, so that distances vanish.
#
# The origin of the frame of a revolute link may be anywhere on its axis. Three positions save
# operations. First, the foot of the axis (origin of the joint frame on the antecedent) if it is at
# rest: forces on it do no work, and its acceleration is gravity alone. Second, the foot of the axis
# of a last link. Third, the height of the next link if its axis is parallel and the frame already
# has a height above its own foot. A distance that is only moved to a joint without a distance saves
# no operations.


def shift_frames(
    tree: Tree, poses: list[LinkPose], bodies: list[Body], *, base_rests: bool = True
) -> tuple[list[LinkPose], list[Body]]:
    """Return poses and bodies after frames of revolute links were shifted along their axes.

    Shifts make distances zero, which saves operations.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        bodies: inertia of each link, about and in its frame.
        base_rests: whether the base does not move.
    """
    rise = _frame_shifts(tree, poses, base_rests)
    if all(up.is_zero() for up in rise):
        return poses, bodies
    moved = [_shifted_pose(tree, poses, rise, j) for j in range(len(poses))]
    return moved, [body.shift(2, -rise[j]) for j, body in enumerate(bodies)]


def _frame_shifts(tree: Tree, poses: list[LinkPose], base_rests: bool) -> list[SX]:
    """Return the shift [m] of each link frame along its joint axis that saves operations.

    Args:
        tree: links of the mechanism.
        poses: pose of each link relative to its antecedent.
        base_rests: whether the base does not rotate.
    """
    resting = _fixed_origins(tree, poses) if base_rests else set()
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


def _fixed_origins(tree: Tree, poses: list[LinkPose]) -> set[int]:
    """Return indices of links whose joint axis has a fixed origin in the base."""
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


def _shifted_pose(tree: Tree, poses: list[LinkPose], rise: list[SX], j: int) -> LinkPose:
    """Return the pose of link j relative to its antecedent after both frames were shifted.

    `rise` is the shift of each link frame along its joint axis [m].
    """
    pose, i = poses[j], tree.links[j].antecedent
    b = -rise[i] if i >= 0 else SX(0)
    screw = pose.motion[0]
    if isinstance(screw, ScrewDisplacement):
        r = screw.t + rise[j]
        if len(pose.run) > 1 and not b.is_zero():  # parallel axes: combine both shifts in one
            b, r = b + r, SX(0)
        pose = replace(pose, motion=(replace(screw, t=r),))
    if b.is_zero():
        return pose
    return replace(pose, seat=(ScrewDisplacement.about("z", SX(0), b), *pose.seat))
