"""Plane loops of three unknown joints: turns and slides, parallelograms."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.closed_forms.centres import with_spherical
from mbs.closed_forms.ring import always_zero, gap_samples, is_planar, with_elbow, without_idle
from mbs.closed_forms.roots import (
    Positions,
    Root,
    across,
    in_plane,
    last_angle,
    positions,
    root_angle,
    signed,
    square,
    turn_onto,
)
from mbs.components.joints import Motion
from mbs.recursions.chain import Ring, frames_at_zero

# A planar loop with three unknown turns: the law of cosines at the one in the middle.
#
# With g the way from the first axis to the third, d2 and d3 the links between, seen in the plane:
# |d2 + R d3| = |g| is X cos t + Y sin t = Z in the middle angle t. The sign says to which side of
# the stretched position the middle joint is turned.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 8.


def three_turns(ring: Ring) -> Root:
    """The two ways to close a planar loop of three unknown turns.

    Args:
        ring: its joints a, b, c; b is the one in the middle, c may be spherical.
    """
    return Root({label: _three_turns_root(ring, sign) for label, sign in signed(ring.joints[1])})


def _three_turns_root(ring: Ring, sign: int) -> Positions:
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    g, d2, d3 = (in_plane(p) for p in (X1.inverse().p, X2.p, X3.p))
    R1, R2, R3 = (in_plane(pose.R) for pose in (X1, X2, X3))
    m = R2.T @ d2
    Z = (square(g) - square(m) - square(d3)) / 2
    b = root_angle(m.T @ d3, -across(m, d3), Z, sign)
    a = turn_onto(d2 + R2 @ (b.matrix @ d3), g)
    before = R1[0, :] @ a.matrix @ R2 @ b.matrix @ R3
    return positions(ring.joints, (a.value, b.value, last_angle(before)))


# A planar loop with two unknown turns and a slide: a quadratic equation in the displacement.
#
# Seen from the first axis, the third one moves along a line e + r u; its distance is that of the
# known way g: r = -u.e +- sqrt(g^2 - (u x e)^2). The sign says which end of the stroke it is.
#
# Source: Khalil & Creusot 1997, section 3.3, equations of types 2 and 4.


def one_slide(ring: Ring) -> Root:
    """The two ways to close a planar loop of two unknown turns with a slide between them.

    Args:
        ring: its joints a, b, c; b is the slide, c may be spherical.
    """
    return Root({label: _one_slide_root(ring, sign) for label, sign in signed(ring.joints[1])})


def _one_slide_root(ring: Ring, sign: int) -> Positions:
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R = X2.R @ X3.R
    g, e, u = (in_plane(p) for p in (X1.inverse().p, X2.p + X2.R @ X3.p, X2.R[:, 2]))
    r = sign * casadi.sqrt(square(g) - across(u, e) ** 2) - u.T @ e
    a = turn_onto(e + u * r, g)
    before = in_plane(X1.R)[0, :] @ a.matrix @ in_plane(R)
    return positions(ring.joints, (a.value, r, last_angle(before)))


# A planar loop with one unknown turn and two slides: the turn is what is missing, then linear.
#
# Source: Khalil & Creusot 1997, section 3.3, equations of types 1 and 3.


def two_slides(ring: Ring) -> Root:
    """The only way to close a planar loop of an unknown turn and two slides.

    Args:
        ring: its joints a, b, c; a is the turn.
    """
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R = X2.R @ X3.R
    e, u, v = (in_plane(p) for p in (X2.p + X2.R @ X3.p + R @ X1.p, X2.R[:, 2], R[:, 2]))
    a, whole = last_angle(in_plane(R @ X1.R)), across(u, v)
    values = (a, -across(e, v) / whole, -across(u, e) / whole)
    return Root({"": positions(ring.joints, values)})


# A planar loop of equal opposite sides: the parallelogram, and its mirror image that crosses.
#
# The known way g from the first axis to the third one runs over an axis that splits it into P and
# Q, as long as the two unknown links, B and A. One solution is A = Q, B = P, whatever the
# position; the other one is its mirror image about g. Told apart by this and not by a side,
# either keeps its label through the flat position, where they meet.


def parallelogram(ring: Ring, pivot: int) -> Root:
    """The two ways to close a loop that can be a parallelogram.

    Args:
        ring: its joints a, b, c; b is opposite to the known axis.
        pivot: which known axis of the way from c to a that is.
    """
    name = ring.joints[1].name
    X1 = ring.gaps[0].pose
    back = X1.inverse()
    g = in_plane(back.p)
    Q = g - in_plane((back @ ring.gaps[0].pivots[pivot]).p)
    mirrored = g * (2 * (Q.T @ g) / square(g)) - Q
    return Root(
        {
            f"{name}:parallel": _parallelogram_root(ring, Q, g - Q),
            f"{name}:crossed": _parallelogram_root(ring, mirrored, g - mirrored),
        }
    )


def _parallelogram_root(ring: Ring, A: SX, B: SX) -> Positions:
    """Positions with the first link along A and the second along B, both seen before joint a."""
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R1, R2, R3 = (in_plane(pose.R) for pose in (X1, X2, X3))
    a = turn_onto(in_plane(X2.p), A)
    b = turn_onto(in_plane(X3.p), R2.T @ (a.matrix.T @ B))
    before = R1[0, :] @ a.matrix @ R2 @ b.matrix @ R3
    return positions(ring.joints, (a.value, b.value, last_angle(before)))


_BALL, _SLIDE = Motion.SPHERICAL, Motion.PRISMATIC


def planar(ring: Ring, q: SX, p: SX) -> Root | None:
    """The ways to close a plane loop; None where it is none, or too much of it is unknown.

    What a closing joint can do out of the plane is left out; a ball, or three turns about one
    point, stand for a turn.
    """
    ring = with_spherical(ring, q, p)
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


# A loop whose turns are all about one direction: the one slide that has a part along it.
#
# Along the direction n of the turns only that slide moves anything: n.e + (n.u) s = 0, linear.
# What is left is a plane loop. A ball may stand in the loop, which keeps a point.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 1.


def along_normal(ring: Ring, q: SX, p: SX) -> Root | None:
    """The slide along the turns of a loop; None where it is not the only one, or not all agree."""
    ring = with_spherical(ring, q, p)
    kinds = [joint.motion for joint in ring.joints]
    if kinds.count(Motion.SPHERICAL) > 1 or Motion.REVOLUTE not in kinds:
        return None
    if Motion.SPHERICAL in kinds:
        ring = ring.rotated((kinds.index(Motion.SPHERICAL) + 1) % len(kinds))
    poses = frames_at_zero(ring.gaps)
    turns = [pose for k, pose in enumerate(poses) if ring.joints[k].motion is Motion.REVOLUTE]
    normal = turns[0].R[:, 2]
    if not all(always_zero(in_plane(turn.R.T @ normal), q, p) for turn in turns):
        return None
    moving = {
        k: slope
        for k, pose in enumerate(poses)
        if ring.joints[k].motion is Motion.PRISMATIC
        and not always_zero(slope := casadi.dot(normal, pose.R[:, 2]), q, p)
    }
    if len(moving) != 1:
        return None
    ((k, slope),) = moving.items()
    end = poses[-1].p
    return Root({"": positions([ring.joints[k]], [-casadi.dot(normal, end) / slope])})
