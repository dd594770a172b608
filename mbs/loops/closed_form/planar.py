"""Plane loops of three unknown joints: which of the kernels for them fits."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.centre import with_balls
from mbs.loops.closed_form.one_slide import one_slide
from mbs.loops.closed_form.parallelogram import parallelogram
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root
from mbs.loops.closed_form.survey import (
    always_zero,
    gap_samples,
    is_planar,
    with_elbow,
    without_idle,
)
from mbs.loops.closed_form.three_turns import three_turns
from mbs.loops.closed_form.trigonometry import in_plane, square
from mbs.loops.closed_form.two_slides import two_slides

_BALL, _SLIDE = Motion.SPHERICAL, Motion.PRISMATIC


def planar(ring: Ring, q: SX, p: SX) -> Root | None:
    """The ways to close a plane loop; None where it is none, or too much of it is unknown.

    What a closing joint can do out of the plane is left out; a ball, or three turns about one
    point, stand for a turn.
    """
    ring = with_balls(ring, q, p)
    balls = sum(joint.motion is _BALL for joint in ring.joints)
    while len(ring.joints) > 3 and not balls:
        smaller = without_idle(ring, gap_samples(ring, q, p))
        if smaller is ring:
            return None
        ring = smaller
    if len(ring.joints) != 3 or balls > 1:
        return None
    ring = _ball_last(ring)
    if not is_planar(ring, gap_samples(ring, q, p)):
        return None
    slides = [k for k, joint in enumerate(ring.joints) if joint.motion is _SLIDE]
    return _flat(ring, slides, q, p)


def _ball_last(ring: Ring) -> Ring:
    for k, joint in enumerate(ring.joints):
        if joint.motion is _BALL:
            return ring.rotated((k + 1) % len(ring.joints))
    return ring


def _flat(ring: Ring, slides: list[int], q: SX, p: SX) -> Root:
    has_ball = ring.joints[2].motion is _BALL
    if len(slides) == 1:
        slide = slides[0]
        if has_ball and slide == 0:
            ring, slide = _ball_last(ring.reversed()), 1
        return one_slide(ring.rotated((slide + 2) % 3))
    if len(slides) == 2:
        turn = next(k for k in range(3) if k not in slides)
        return two_slides(ring.rotated(turn))
    ring = ring if has_ball else with_elbow(ring, q)
    pivot = _opposite(ring, q, p)
    return three_turns(ring) if pivot is None else parallelogram(ring, pivot)


def _opposite(ring: Ring, q: SX, p: SX) -> int | None:
    """The known axis that makes the loop a parallelogram, if there is one."""
    back = ring.gaps[0].pose.inverse()
    A, B = (square(in_plane(gap.pose.p)) for gap in ring.gaps[1:])
    for number, pivot in enumerate(ring.gaps[0].pivots):
        point = in_plane((back @ pivot).p)
        P, Q = square(point), square(in_plane(back.p) - point)
        if always_zero(casadi.vertcat(P - B, Q - A), q, p):
            return number
    return None
