"""Inertial parameters moved towards the base, where fewer of them take part in the motion.

What joint j cannot tell from a part of link i belongs to link i: mass on the axis of a revolute
joint, the whole rotational inertia behind a prismatic joint, the mass at the centre of a
spherical joint. The equations stay the same; their constants are sums that are computed once.

Source: Gautier & Khalil 1990.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components.motion import Motion
from mbs.recursions.poses import LinkPose
from mbs.spatial import Body, Inertia, Screw, body_through, elements, exact_sum


def regrouped(tree: Tree, poses: list[LinkPose], bodies: list[Body]) -> list[Body]:
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
            bodies[link.antecedent] = _joined(bodies[link.antecedent], part)
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
            body = body.turned(step.turn)
        return body
    screw = pose.motion[0]
    if isinstance(screw, Screw):
        body = body.slid(2, screw.t)
    return body_through(pose.seat, body)


def _joined(body: Body, part: Body) -> Body:
    """Two bodies welded together; numbers that cancel are zero, so that they fold."""
    both = zip(_moments(body), _moments(part), strict=True)
    return type(body)(*(_sum(a, b) for a, b in both))


def _sum(a: SX, b: SX) -> SX:
    entries = (exact_sum(x, y) for x, y in zip(elements(a), elements(b), strict=True))
    return casadi.reshape(casadi.vertcat(*entries), *a.shape)


def _moments(body: Body) -> tuple[SX, SX, SX]:
    return body.J if isinstance(body, Inertia) else body.S, body.ms, body.m
