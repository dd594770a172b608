"""The kernel for a loop, chosen by the number, kind and geometry of its unknown joints."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.aim import aim
from mbs.loops.closed_form.distance import leg, rod
from mbs.loops.closed_form.one_slide import one_slide
from mbs.loops.closed_form.parallelogram import parallelogram
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root
from mbs.loops.closed_form.sphere import sphere
from mbs.loops.closed_form.survey import (
    always_zero,
    axes_meet,
    gap_samples,
    is_planar,
    is_spherical,
    without_idle,
)
from mbs.loops.closed_form.three_turns import three_turns
from mbs.loops.closed_form.trigonometry import in_plane, square
from mbs.loops.closed_form.two_slides import two_slides

_BALL, _SLIDE = Motion.SPHERICAL, Motion.PRISMATIC


def closed_form(ring: Ring, q: SX, p: SX) -> Root | str:
    """The ways to close a loop, or why no kernel fits.

    Some positions of a loop may be given alone; the others follow once these are known.

    Args:
        ring: the loop.
        q: (nq, 1) symbols of positions.
        p: (np, 1) symbols of parameters.
    """
    unknown = ", ".join(joint.name for joint in ring.joints)
    if any(joint.motion is Motion.FREE for joint in ring.joints):
        return "a free body is in it"
    if any(joint.motion is _BALL and joint.place is not None for joint in ring.joints):
        return "a spherical joint of the tree is in it"
    balls = sum(joint.motion is _BALL for joint in ring.joints)
    if balls == 2:
        one = len(ring.joints) == 3
        return rod(ring) if one else f"{unknown} are unknown; with a rod one joint can be"
    while len(ring.joints) > 3:
        smaller = without_idle(ring, gap_samples(ring, q, p))
        if smaller is ring:
            return _of_four(ring, q, p) or (
                f"{len(ring.joints)} positions are unknown ({unknown}); three can be"
            )
        ring = smaller
    if len(ring.joints) < 3:
        return f"fewer than three positions are unknown ({unknown})"
    return _of_three(_ball_last(ring), q, p, unknown)


def _ball_last(ring: Ring) -> Ring:
    for k, joint in enumerate(ring.joints):
        if joint.motion is _BALL:
            return ring.rotated((k + 1) % len(ring.joints))
    return ring


def _of_four(ring: Ring, q: SX, p: SX) -> Root | None:
    """The joint of a leg between a universal joint and a ball, if the loop has such a leg."""
    if len(ring.joints) != 4 or all(joint.motion is not _BALL for joint in ring.joints):
        return None
    for way in (_ball_last(ring), _ball_last(ring.reversed())):
        if _aims(way, q, p):
            return leg(way)
    return None


def _aims(ring: Ring, q: SX, p: SX) -> bool:
    """Whether the first two joints are turns whose axes meet."""
    turn = all(joint.motion is Motion.REVOLUTE for joint in ring.joints[:2])
    return turn and axes_meet(ring.gaps[1].pose, q, p)


def _of_three(ring: Ring, q: SX, p: SX, unknown: str) -> Root | str:
    samples = gap_samples(ring, q, p)
    slides = [k for k, joint in enumerate(ring.joints) if joint.motion is _SLIDE]
    if is_planar(ring, samples):
        return _planar(ring, slides, q, p)
    if is_spherical(ring, samples):
        return sphere(_with_elbow(ring, q))
    if ring.joints[2].motion is _BALL and _aims(ring, q, p):
        return aim(ring)
    return f"the axes of {unknown} are neither parallel nor meet in one point"


def _planar(ring: Ring, slides: list[int], q: SX, p: SX) -> Root | str:
    ball = ring.joints[2].motion is _BALL
    if len(slides) == 1:
        slide = slides[0]
        if ball and slide == 0:
            ring, slide = _ball_last(ring.reversed()), 1
        return one_slide(ring.rotated((slide + 2) % 3))
    if len(slides) == 2:
        if ball:
            return "two slides are between a turn that a spherical joint stands for"
        turn = next(k for k in range(3) if k not in slides)
        return two_slides(ring.rotated(turn))
    ring = ring if ball else _with_elbow(ring, q)
    pivot = _opposite(ring, q, p)
    return three_turns(ring) if pivot is None else parallelogram(ring, pivot)


def _with_elbow(ring: Ring, q: SX) -> Ring:
    """The loop begun so that the joint in the middle has rigid links on both sides, if one has."""
    for k in range(3):
        begun = ring.rotated(k)
        sides = casadi.vertcat(*(casadi.vec(gap.pose.matrix) for gap in begun.gaps[1:]))
        if not casadi.depends_on(sides, q):
            return begun
    return ring


def _opposite(ring: Ring, q: SX, p: SX) -> int | None:
    """The known axis that makes the loop a parallelogram, if there is one."""
    back = ring.gaps[0].pose.inverse()
    A, B = (square(in_plane(gap.pose.p)) for gap in ring.gaps[1:])
    for number, pivot in enumerate(ring.gaps[0].pivots):
        point = in_plane(back.p + back.R @ pivot)
        P, Q = square(point), square(in_plane(back.p) - point)
        if always_zero(casadi.vertcat(P - B, Q - A), q, p):
            return number
    return None
