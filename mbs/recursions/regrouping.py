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
from mbs.spatial import Body, Inertia, Screw, elements

_ROUNDING = 1e-15


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
            bodies[link.antecedent] += _seen_through(moved, link.motion, poses[j])
    return _without_rounding(bodies)


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
    for step in reversed(pose.seat):
        body = step.body(body)
    return body


def _without_rounding(bodies: list[Body]) -> list[Body]:
    """Sums of constants that ought to cancel made zero, so that they fold."""
    every = [value for body in bodies for value in _entries(body)]
    numbers = [abs(float(value)) for value in every if value.is_constant()]
    least = _ROUNDING * max(numbers, default=0.0)

    def clean(matrix: SX) -> SX:
        kept = SX(matrix)
        for k in range(kept.numel()):
            if kept[k].is_constant() and abs(float(kept[k])) <= least:
                kept[k] = 0
        return kept

    return [type(b)(*(clean(part) for part in _moments(b))) for b in bodies]


def _moments(body: Body) -> tuple[SX, SX, SX]:
    return body.J if isinstance(body, Inertia) else body.S, body.ms, body.m


def _entries(body: Body) -> list[SX]:
    return elements(casadi.vertcat(*(casadi.vec(part) for part in _moments(body))))
