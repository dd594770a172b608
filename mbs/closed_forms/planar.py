"""Closed forms of plane loops of three unknown joints: revolute, prismatic, parallelograms."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.closed_forms.centres import with_spherical
from mbs.closed_forms.ring import (
    always_zero,
    gap_samples,
    is_planar,
    with_elbow,
    without_unused_freedom,
)
from mbs.closed_forms.roots import (
    LoopBranches,
    Positions,
    across,
    angle_onto,
    in_plane,
    last_angle,
    positions,
    root_angle,
    signed,
    square,
)
from mbs.components.joints import Motion
from mbs.recursions.chain import Ring, frames_at_zero

# A planar loop with three unknown revolute joints: the law of cosines at the joint in the middle.
#
# g is the vector from the first axis to the third, d2 and d3 are the links between them, in the
# plane: |d2 + R d3| = |g| is X cos t + Y sin t = Z in the middle angle t. The sign is the side of
# the stretched position to which the middle joint is rotated.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 8.


def three_revolute(ring: Ring) -> LoopBranches:
    """Return the two branches of a planar loop of three unknown revolute joints.

    Args:
        ring: loop chain with the joints a, b, c, where c may be spherical. The branch is the sign
            of joint b.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    return LoopBranches(
        {label: _three_revolute_root(ring, sign) for label, sign in signed(ring.joints[1])}
    )


def _three_revolute_root(ring: Ring, sign: int) -> Positions:
    """Return the positions of a triangle of three revolute joints on branch `sign` (1 or -1)."""
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    g, d2, d3 = (in_plane(p) for p in (X1.inverse().p, X2.p, X3.p))
    R1, R2, R3 = (in_plane(pose.R) for pose in (X1, X2, X3))
    m = R2.T @ d2
    Z = (square(g) - square(m) - square(d3)) / 2
    b = root_angle(m.T @ d3, -across(m, d3), Z, sign)
    a = angle_onto(d2 + R2 @ (b.matrix @ d3), g)
    before = R1[0, :] @ a.matrix @ R2 @ b.matrix @ R3
    return positions(ring.joints, (a.value, b.value, last_angle(before)))


# A planar loop with two unknown revolute joints and a prismatic joint: a quadratic equation in the
# displacement.
#
# Relative to the first axis, the third axis moves on a line e + r u. Its distance is the length of
# the known vector g: r = -u.e +- sqrt(g^2 - (u x e)^2). The sign is the end of the stroke.
#
# Source: Khalil & Creusot 1997, section 3.3, equations of types 2 and 4.


def one_prismatic(ring: Ring) -> LoopBranches:
    """Return the two branches of a planar loop of a prismatic joint between two revolute joints.

    Args:
        ring: loop chain with the joints a, b, c, where b is prismatic and c may be spherical.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    return LoopBranches(
        {label: _one_prismatic_root(ring, sign) for label, sign in signed(ring.joints[1])}
    )


def _one_prismatic_root(ring: Ring, sign: int) -> Positions:
    """Return the positions of a plane loop with a prismatic middle joint on branch `sign`."""
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R = X2.R @ X3.R
    g, e, u = (in_plane(p) for p in (X1.inverse().p, X2.p + X2.R @ X3.p, X2.R[:, 2]))
    r = sign * casadi.sqrt(square(g) - across(u, e) ** 2) - u.T @ e
    a = angle_onto(e + u * r, g)
    before = in_plane(X1.R)[0, :] @ a.matrix @ in_plane(R)
    return positions(ring.joints, (a.value, r, last_angle(before)))


# A planar loop with one unknown revolute joint and two prismatic joints: the angle is the remaining
# rotation of the loop; the displacements are linear.
#
# Source: Khalil & Creusot 1997, section 3.3, equations of types 1 and 3.


def two_prismatic(ring: Ring) -> LoopBranches:
    """Return the only branch of a planar loop of a revolute and two prismatic unknown joints.

    Args:
        ring: loop chain with the joints a, b, c, where a is revolute.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R = X2.R @ X3.R
    e, u, v = (in_plane(p) for p in (X2.p + X2.R @ X3.p + R @ X1.p, X2.R[:, 2], R[:, 2]))
    a, whole = last_angle(in_plane(R @ X1.R)), across(u, v)
    values = (a, -across(e, v) / whole, -across(u, e) / whole)
    return LoopBranches({"": positions(ring.joints, values)})


# A planar loop with equal opposite sides: the parallelogram, and its mirror image that crosses.
#
# A known axis splits the vector g from the first axis to the third into P and Q, which are as long
# as the two unknown links B and A. One solution is A = Q, B = P at all positions; the other
# solution is its mirror image about g. This definition, in contrast to a side, keeps the label of a
# branch when it passes through the flat position, where both meet.


def parallelogram(ring: Ring, pivot: int) -> LoopBranches:
    """Return the two branches of a loop that can be a parallelogram.

    Args:
        ring: loop chain with the joints a, b, c, where b is opposite to the known axis.
        pivot: index of the known axis among the known revolute joints from c to a.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    name = ring.joints[1].name
    X1 = ring.gaps[0].pose
    back = X1.inverse()
    g = in_plane(back.p)
    Q = g - in_plane((back @ ring.gaps[0].pivots[pivot]).p)
    mirrored = g * (2 * (Q.T @ g) / square(g)) - Q
    return LoopBranches(
        {
            f"{name}:parallel": _parallelogram_root(ring, Q, g - Q),
            f"{name}:crossed": _parallelogram_root(ring, mirrored, g - mirrored),
        }
    )


def _parallelogram_root(ring: Ring, A: SX, B: SX) -> Positions:
    """Return the positions with the links along A and B (2, 1), in the frame before joint a."""
    X1, X2, X3 = (gap.pose for gap in ring.gaps)
    R1, R2, R3 = (in_plane(pose.R) for pose in (X1, X2, X3))
    a = angle_onto(in_plane(X2.p), A)
    b = angle_onto(in_plane(X3.p), R2.T @ (a.matrix.T @ B))
    before = R1[0, :] @ a.matrix @ R2 @ b.matrix @ R3
    return positions(ring.joints, (a.value, b.value, last_angle(before)))


_SPHERICAL, _PRISMATIC = Motion.SPHERICAL, Motion.PRISMATIC


def planar(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the branches of a plane loop; None if it is not plane or has too many unknowns.

    Motions of a closing joint out of the plane are ignored. A spherical joint, or three revolute
    joints that intersect in one point, count as a revolute joint.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    ring = with_spherical(ring, q, p)
    spherical = sum(joint.motion is _SPHERICAL for joint in ring.joints)
    while len(ring.joints) > 3 and not spherical:
        smaller = without_unused_freedom(ring, gap_samples(ring, q, p))
        if smaller is ring:
            return None
        ring = smaller
    if len(ring.joints) != 3 or spherical > 1:
        return None
    ring = _spherical_last(ring)
    if not is_planar(ring, gap_samples(ring, q, p)):
        return None
    prismatic = [k for k, joint in enumerate(ring.joints) if joint.motion is _PRISMATIC]
    return _planar_branches(ring, prismatic, q, p)


def _spherical_last(ring: Ring) -> Ring:
    """Return the loop with its start chosen so that a spherical joint is its last joint."""
    for k, joint in enumerate(ring.joints):
        if joint.motion is _SPHERICAL:
            return ring.rotated((k + 1) % len(ring.joints))
    return ring


def _planar_branches(ring: Ring, prismatic: list[int], q: SX, p: SX) -> LoopBranches:
    """Return the branches of a plane loop of three joints, according to their types.

    Args:
        ring: loop chain.
        prismatic: indices of the prismatic joints.
        q: symbols of all positions.
        p: symbols of parameters.
    """
    has_spherical = ring.joints[2].motion is _SPHERICAL
    if len(prismatic) == 1:
        index = prismatic[0]
        if has_spherical and index == 0:
            ring, index = _spherical_last(ring.reversed()), 1
        return one_prismatic(ring.rotated((index + 2) % 3))
    if len(prismatic) == 2:
        revolute = next(k for k in range(3) if k not in prismatic)
        return two_prismatic(ring.rotated(revolute))
    ring = ring if has_spherical else with_elbow(ring, q)
    pivot = _parallelogram_axis(ring, q, p)
    return three_revolute(ring) if pivot is None else parallelogram(ring, pivot)


def _parallelogram_axis(ring: Ring, q: SX, p: SX) -> int | None:
    """Return the index of the known axis that makes the loop a parallelogram; None without one.

    q and p are the symbols of positions and parameters.
    """
    back = ring.gaps[0].pose.inverse()
    A, B = (square(in_plane(gap.pose.p)) for gap in ring.gaps[1:])
    for number, pivot in enumerate(ring.gaps[0].pivots):
        point = in_plane((back @ pivot).p)
        P, Q = square(point), square(in_plane(back.p) - point)
        if always_zero(casadi.vertcat(P - B, Q - A), q, p):
            return number
    return None


# A loop with parallel rotations: the single prismatic joint with a component along their direction.
#
# Along the direction n of the revolute axes only that prismatic joint moves: n.e + (n.u) s = 0,
# which is linear. The remaining loop is plane. The loop may contain a spherical joint, which keeps
# a point.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 1.


def along_normal(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the displacement of the only prismatic joint that moves along parallel revolute axes.

    None if the revolute axes are not parallel, or not exactly one prismatic joint moves along them.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    ring = with_spherical(ring, q, p)
    kinds = [joint.motion for joint in ring.joints]
    if kinds.count(Motion.SPHERICAL) > 1 or Motion.REVOLUTE not in kinds:
        return None
    if Motion.SPHERICAL in kinds:
        ring = ring.rotated((kinds.index(Motion.SPHERICAL) + 1) % len(kinds))
    poses = frames_at_zero(ring.gaps)
    revolute = [pose for k, pose in enumerate(poses) if ring.joints[k].motion is Motion.REVOLUTE]
    normal = revolute[0].R[:, 2]
    if not all(always_zero(in_plane(pose.R.T @ normal), q, p) for pose in revolute):
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
    return LoopBranches({"": positions([ring.joints[k]], [-casadi.dot(normal, end) / slope])})
