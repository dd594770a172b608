"""Closed forms of loops in space, from centres, distances, orientations and translations.

The joints of a centre keep one point fixed. The other joints of the loop depend on that point only.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import casadi
from casadi import SX

from mbs.assembly.tables import CoordinateCoupling
from mbs.closed_forms.centres import (
    Centre,
    centres,
    with_spherical,
)
from mbs.closed_forms.ring import always_zero, parallel, with_elbow
from mbs.closed_forms.roots import (
    Angle,
    LoopBranches,
    Positions,
    RodSpin,
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
from mbs.recursions.chain import Chain, ChainJoint, Ring, frames_at_zero
from mbs.spatial import Pose, cross, quaternion_rotation, vector

# Two revolute joints with intersecting axes, as in a universal joint, that move a point of a link
# to a known point.
#
# The component along the axis of the first joint depends on the angle t of the second joint only:
# X cos t + Y sin t = Z. The sign is the side of the plane of the two axes to which the second joint
# is rotated.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 2.


def aim(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the branches of two joints that aim a link at a centre of the remaining joints.

    None unless the loop consists of a centre of two revolute joints and another centre.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    n = len(ring.joints)
    found = centres(ring, q, p)
    for one in found:
        for other in found:
            next_to = (one.first + one.count - other.first) % n == 0
            if one.count == 2 and next_to and other.count == n - 2:
                return _aim_branches(ring.rotated(one.first), one, other)
    return None


def _aim_branches(ring: Ring, one: Centre, other: Centre) -> LoopBranches:
    """Return both branches of the two intersecting revolute joints with which the loop begins.

    Args:
        ring: loop chain.
        one: centre, at which the axes of these two joints intersect.
        other: centre that the remaining joints keep fixed.
    """
    branches = signed(ring.joints[1])
    return LoopBranches({label: _aim_root(ring, one, other, sign) for label, sign in branches})


def _aim_root(ring: Ring, one: Centre, other: Centre, sign: int) -> Positions:
    """Return the positions of two intersecting revolute joints that direct a link onto a point.

    Args:
        ring: loop chain that begins with these joints.
        one: centre, at which their axes intersect.
        other: centre that the remaining joints keep fixed.
        sign: branch, 1 or -1.
    """
    X1, X2, X3 = (gap.pose for gap in ring.gaps[:3])
    back = X1.inverse()
    target = back.p + back.R @ other.after - one.before
    arm, x = X3.p + X3.R @ other.before - one.after, X2.R[2, :].T
    dot = x[0] * arm[0] + x[1] * arm[1]
    b = root_angle(dot, -across(x, arm), target[2] - x[2] * arm[2], sign)
    rotated = casadi.vertcat(b.matrix @ in_plane(arm), arm[2])
    a = angle_onto(in_plane(X2.R @ rotated), in_plane(target))
    return positions(ring.joints[:2], (a.value, b.value))


# A spherical joint as the only unknown joint: quaternion of a known rotation matrix.
#
# The formula with the largest of four denominators is used, which is accurate at half rotations
# too. The first element of the quaternion is not negative.
#
# Source: Shepperd 1978.


def spherical(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the quaternion of a spherical joint of the tree; None unless it alone is unknown.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    joint = ring.joints[0]
    if len(ring.joints) != 1 or joint.motion is not Motion.SPHERICAL or joint.index is None:
        return None
    R = ring.gaps[0].pose.R
    quaternion = unit_quaternion(R.T if joint.sign > 0 else R)
    return LoopBranches({"": {joint.index + k: quaternion[k] for k in range(4)}})


def unit_quaternion(R: SX) -> SX:
    """Return the unit quaternion w, x, y, z (4, 1) of a rotation, with w >= 0.

    Args:
        R: (3, 3) rotation matrix.
    """
    a, b, c = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    d, e, f = R[1, 2] + R[2, 1], R[0, 2] + R[2, 0], R[0, 1] + R[1, 0]
    trace = casadi.trace(R)
    squares = [1 + trace, *(1 - trace + 2 * R[k, k] for k in range(3))]
    multiples = [
        casadi.vertcat(squares[0], a, b, c),
        casadi.vertcat(a, squares[1], f, e),
        casadi.vertcat(b, f, squares[2], d),
        casadi.vertcat(c, e, d, squares[3]),
    ]
    largest = reduce(casadi.fmax, squares)
    chosen = multiples[3]
    for squared, multiple in zip(squares[2::-1], multiples[2::-1], strict=True):
        chosen = casadi.if_else(squared >= largest, multiple, chosen)
    signed = casadi.if_else(chosen[0] < 0, -chosen, chosen)
    return SX(signed / casadi.norm_2(signed))


# A spherical joint whose centre two joints confine to a plane.
#
# Two parallel revolute joints, a revolute and a prismatic joint perpendicular to it, or two
# prismatic joints keep a point in a plane with the normal n. The rotation t of a third joint moves
# the spherical centre into that plane: X cos t + Y sin t = Z. The remaining loop is plane.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 2.


_Z = (0.0, 0.0, 1.0)


def confine(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the rotation that moves a spherical centre into the plane of two joints.

    None for loops without such joints.

    Args:
        ring: loop chain with one spherical joint and three other unknown joints.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    ring = with_spherical(ring, q, p)
    spherical = [k for k, joint in enumerate(ring.joints) if joint.motion is Motion.SPHERICAL]
    if len(spherical) != 1 or len(ring.joints) != 4:
        return None
    begun = ring.rotated((spherical[0] + 1) % 4)
    for path in (begun, begun.reversed().rotated(1)):
        if path.joints[0].is_rotational:
            normal = _normal(path, q, p)
            if normal is None:
                continue
            across = in_plane(path.gaps[1].pose.R @ normal)  # zero: joint 1 is parallel to it
            if not always_zero(across, q, p):
                return _confine_branches(path, normal)
    return None


def _normal(ring: Ring, q: SX, p: SX) -> SX | None:
    """Return the normal (3, 1) of the plane of motion of joints 2 and 3, before joint 2.

    None if they do not keep a point in a plane.

    q and p are the symbols of positions and parameters.
    """
    second, third = (joint.motion is Motion.PRISMATIC for joint in ring.joints[1:3])
    between = ring.gaps[2].pose
    axis = between.R[:, 2]
    if second and third:
        return cross(vector(_Z), axis)
    if second or third:
        across_it = always_zero(axis[2], q, p)
        return (axis if second else vector(_Z)) if across_it else None
    return vector(_Z) if parallel(between, q, p) else None


def _confine_branches(ring: Ring, normal: SX) -> LoopBranches:
    """Return both angles of joint 1 that move the spherical centre into the plane with `normal`."""
    X1, X2, X3, X4 = (gap.pose for gap in ring.gaps)
    joint, target = ring.joints[0], X1.inverse().p
    m = X2.R @ normal
    Z = casadi.dot(normal, (X3 @ Pose.translation(X4.p)).p) + casadi.dot(m, X2.p)
    X, Y = casadi.dot(in_plane(m), in_plane(target)), across(in_plane(m), in_plane(target))
    return LoopBranches(
        {
            label: positions([joint], [root_angle(X, Y, Z - m[2] * target[2], sign).value])
            for label, sign in signed(joint)
        }
    )


# Coupled coordinates: the driven coordinate by the polynomial, others if they are linear in it.


def coupled_position(
    coupling: CoordinateCoupling, known: Container[int], q: SX
) -> LoopBranches | str:
    """Return the unknown coordinate of a coupling of coordinates.

    Args:
        coupling: coupling with all coordinates but one known.
        known: indices in q of known positions.
        q: (nq, 1) symbols of positions.

    Returns:
        Single branch, or text that describes why the coordinate cannot be solved.
    """
    terms = coupling.coefficients
    unknown = [number for number in coupling.coordinates if number not in known]
    if len(unknown) > 1:
        return "more than one of its coordinates are unknown"
    (number,) = unknown
    if number == coupling.driven:
        return LoopBranches({"": {number: coupling.value(q)}})
    if number == coupling.driver and len(terms) != 2:
        return "its driver follows from a polynomial that is not of degree one"
    # linear in the unknown coordinate, with the factor `slope`
    slope = terms[1] if number == coupling.driver else dict(coupling.others)[number]
    rest = casadi.substitute(coupling.value(q), q[number], SX(0))
    return LoopBranches({"": {number: (q[coupling.driven] - rest) / slope}})


# One joint that sets the distance of two centres of a loop to the length of a rigid link.
#
# A centre is a spherical joint, or revolute joints with intersecting axes. The first centre is at m
# relative to the joint, the second centre at d in the frame after the joint. A revolute joint gives
# X cos t + Y sin t = Z, a prismatic joint a quadratic equation. These are the revolute and the
# prismatic joint "with length constraint" of Modelica's assemblies.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 2; Otter et al. 2003.


@dataclass(frozen=True, slots=True, eq=False)
class RigidLink:
    """Rigid link between two centres, and the loop chain from the end of the link to its start.

    Attributes:
        chain: joints and transforms of the loop outside the link.
        target: (3, 1) end of the link, in the frame before the first transform of `chain`.
        start: (3, 1) start of the link, in the frame after the last transform of `chain`.
        squared: square of the length of the link.
    """

    chain: Chain
    target: SX
    start: SX
    squared: SX


def spans(ring: Ring, q: SX, p: SX) -> Iterator[RigidLink]:
    """Yield each rigid link of a loop between two centres.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.
    """
    n = len(ring.joints)
    found = centres(ring, q, p)
    for one in found:
        for other in found:
            apart = not set(one.joints(n)) & set(other.joints(n))
            if apart and (one.first + one.count - other.first) % n == 0:
                yield _rigid_link(ring.rotated(one.first), one, other)


def _rigid_link(begun: Ring, one: Centre, other: Centre) -> RigidLink:
    """Return rigid link from the centre `one`, where a loop begins, to the next centre, `other`.

    `begun` is the loop that begins at `one`.
    """
    link = begun.gaps[one.count].pose
    after = one.count + other.count
    return RigidLink(
        Chain(begun.joints[after:], (*begun.gaps[after:], begun.gaps[0])),
        other.after,
        one.before,
        square(link.p + link.R @ other.before - one.after),
    )


def at_distance(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the branches of the single joint outside a rigid link between two centres, or None.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    for span in spans(ring, q, p):
        if len(span.chain.joints) == 1:
            m, d = _link_ends(span)
            idle = any(always_zero(in_plane(end), q, p) for end in (m, d))
            if not (idle and span.chain.joints[0].is_rotational):
                return _at_distance(span.chain.joints[0], m, d, span.squared)
    return None


def _link_ends(span: RigidLink) -> tuple[SX, SX]:
    """Return both ends (3, 1) of rigid link `span` relative to the only other joint of its loop.

    These are the end in the frame before the joint, negated, and the start in the frame after it.
    """
    before, after = (gap.pose for gap in span.chain.gaps)
    back = before.inverse()
    return -(back.p + back.R @ span.target), after.p + after.R @ span.start


def _at_distance(joint: ChainJoint, m: SX, d: SX, squared: SX) -> LoopBranches:
    """Return both positions of a joint at which the vector m + D(d) has a given length.

    Args:
        joint: revolute or prismatic joint, whose displacement is D.
        m: (3, 1) vector in the frame before the joint.
        d: (3, 1) point in the frame after the joint.
        squared: (1, 1) square of the length.
    """

    def value(sign: int) -> SX:
        if joint.is_rotational:
            Z = (squared - square(m) - square(d)) / 2 - m[2] * d[2]
            return root_angle(m[0] * d[0] + m[1] * d[1], -across(m, d), Z, sign).value
        w = m + d
        return SX(sign * casadi.sqrt(squared - w[0] * w[0] - w[1] * w[1]) - w[2])

    return LoopBranches(
        {label: positions([joint], (value(sign),)) for label, sign in signed(joint)}
    )


# A free body as the only unknown joint: its position and quaternion from its pose.


def free_body(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the pose of a free body; None unless it is the only unknown joint.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    joint = ring.joints[0]
    if len(ring.joints) != 1 or joint.motion is not Motion.FREE or joint.index is None:
        return None
    pose = ring.gaps[0].pose
    pose = pose.inverse() if joint.sign > 0 else pose
    values = casadi.vertcat(pose.p, unit_quaternion(pose.R))
    return LoopBranches({"": {joint.index + k: values[k] for k in range(7)}})


# Three unknown revolute joints from orientations alone.
#
# R_a X_2 R_b X_3 R_c = X_1': element (3, 3) depends on the middle angle only:
# X cos t + Y sin t = Z. The sign is the side of the plane of the two outer axes to which the middle
# joint is rotated.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 2.


def orientations(ring: Ring) -> LoopBranches:
    """Return the two branches of three unknown revolute joints from orientations only.

    Args:
        ring: loop chain with the joints a, b, c, where b is the joint in the middle.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    return LoopBranches(
        {label: _orientations_root(ring, sign) for label, sign in signed(ring.joints[1])}
    )


def _orientations_root(ring: Ring, sign: int) -> Positions:
    """Return the positions of three revolute joints that close the orientations of a loop.

    Args:
        ring: loop chain of three revolute joints.
        sign: branch, 1 or -1.
    """
    R1, R2, R3 = (gap.pose.R for gap in ring.gaps)
    x, y = R2[2, :].T, R3[:, 2]
    dot = x[0] * y[0] + x[1] * y[1]
    b = root_angle(dot, -across(x, y), R1[2, 2] - x[2] * y[2], sign)
    rotated = casadi.vertcat(b.matrix @ in_plane(y), y[2])
    a = angle_onto(in_plane(R2 @ rotated), R1[2, 0:2].T)
    row = casadi.vertcat(b.matrix.T @ in_plane(x), x[2])
    c: Angle = angle_onto(in_plane(R1[:, 2]), in_plane(R3.T @ row))
    return positions(ring.joints, (a.value, b.value, c.value))


# Rotations from the orientations around a loop, before its prismatic joints are known.
#
# Parallel revolute joints are one rotation, so that the loop has up to three directions. One
# unknown angle is the remaining rotation. With two directions, each rotation aligns the other axis;
# joints that share a direction with other joints remain unknown. Three revolute joints are solved
# as a spherical loop.
#
# Source: Khalil & Creusot 1997, section 3.3; for RCCC loops Duffy 1980.


def orientation(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the positions of revolute joints that orientations alone determine; None without any.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: position expressions in q and p of each solution, by its label.
    """
    if any(joint.motion not in (Motion.REVOLUTE, Motion.PRISMATIC) for joint in ring.joints):
        return None
    revolute = _revolute_alone(ring)
    directions, shared = _directions(revolute, q, p)
    match len(directions.joints):
        case 1 if not shared:
            (joint,) = directions.joints
            return LoopBranches(
                {"": positions([joint], [last_angle(in_plane(directions.gaps[0].pose.R))])}
            )
        case 2 if len(shared) < 2:
            return _two_orientations(directions, shared)
        case 3 if not shared and _is_oriented(ring, revolute, q, p):
            return orientations(with_elbow(directions, q))
    return None


def _revolute_alone(ring: Ring) -> Ring:
    """Return the loop with its prismatic joints locked at zero."""
    for k, joint in enumerate(ring.joints):
        if joint.motion is Motion.PRISMATIC:
            return _revolute_alone(ring.without(k))
    return ring


def _directions(ring: Ring, q: SX, p: SX) -> tuple[Ring, frozenset[str]]:
    """Return the loop with one joint for each set of parallel joints, and names of such joints.

    The names are those of joints that represent several joints.

    q and p are the symbols of positions and parameters.
    """
    shared, k = set[str](), 0
    while k < len(ring.joints) > 1:
        if parallel(ring.gaps[k].pose, q, p):
            shared.discard(ring.joints[k].name)
            shared.add(ring.joints[k - 1].name)
            ring = ring.without(k)
        else:
            k += 1
    return ring, frozenset(shared)


def _is_oriented(ring: Ring, revolute: Ring, q: SX, p: SX) -> bool:
    """Whether the orientations of three revolute joints can be solved before all other joints.

    Translations must be free or the axes intersect. `revolute` is the loop without other joints.
    """
    if len(ring.joints) == len(revolute.joints):
        return any(centre.count == 3 for centre in centres(ring, q, p))
    return len(ring.joints) == len(revolute.joints) + 3


def _two_orientations(ring: Ring, shared: frozenset[str]) -> LoopBranches:
    """Return the positions of two revolute joints that close the orientations of a loop.

    Joints with names in `shared` are left out.
    """
    values: dict[int, SX] = {}
    for begun in (ring, ring.rotated(1)):
        joint, (R1, R2) = begun.joints[0], (gap.pose.R for gap in begun.gaps)
        if joint.name not in shared:
            revolute = angle_onto(R2[0:2, 2], R1[2, 0:2].T)
            values |= positions([joint], [revolute.value])
    return LoopBranches({"": values})


# Prismatic joints alone, or with all rotations about one point: linear equations.
#
# The product X_1 .. X_n with the prismatic joints at zero has the offset e. The m <= 3 prismatic
# joints move along u_1 .. u_m: e + u_1 s_1 + .. + u_m s_m = 0. For m < 3 the normal equations are
# solved, which are exact if the loop closes.


_MOST = 3


def prismatic(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the unique displacements that close a loop; None if they depend on a rotation.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    number = sum(joint.motion is Motion.PRISMATIC for joint in ring.joints)
    if not 1 <= number <= _MOST:
        return None
    if number == len(ring.joints):
        nowhere = Centre(0, 0, vector([0, 0, 0]), vector([0, 0, 0]))
        return _prismatic_branches(ring, nowhere)
    for centre in centres(ring, q, p):
        if centre.count + number == len(ring.joints):
            return _prismatic_branches(ring.rotated(centre.first), centre)
    return None


def _prismatic_branches(ring: Ring, centre: Centre) -> LoopBranches:
    """Return the displacements of the prismatic joints of a loop that starts at a centre."""
    joints = ring.joints[centre.count :]
    poses = frames_at_zero(ring.gaps[centre.count :], Pose.translation(-centre.after))
    axes, pose = [pose.R[:, 2] for pose in poses], poses[-1]
    if centre.count:
        pose = pose @ ring.gaps[0].pose
    e = pose.p + pose.R @ centre.before
    return LoopBranches({"": positions(joints, _combination(axes, -e))})


def _combination(u: Sequence[SX], e: SX) -> list[SX]:
    """Return the factors of one to three vectors u (3, 1) whose combination is e (3, 1)."""
    if len(u) == 1:
        return [casadi.dot(u[0], e) / casadi.sumsqr(u[0])]
    if len(u) == 2:
        n = cross(u[0], u[1])
        size = casadi.sumsqr(n)
        return [casadi.dot(cross(e, u[1]), n) / size, casadi.dot(cross(u[0], e), n) / size]
    across = [cross(u[1], u[2]), cross(u[2], u[0]), cross(u[0], u[1])]
    volume = casadi.dot(u[0], across[0])
    return [casadi.dot(e, normal) / volume for normal in across]


# A rod between two spherical joints as the only unknowns: shortest rotation, then spin.
#
# The spherical joint rotates the vector u of the rod onto the known vector w. Starting from the
# orientation R_0 of the assembled configuration, the shortest rotation M takes R_0 u onto w. Before
# both rotations, the rod may spin about u.


def spin(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the quaternion of a rod at a known spin about its line.

    None unless exactly the two spherical joints of a rod are unknown.

    Args:
        ring: loop chain.
        q: symbols of positions, with the spin of the rod.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    ring = with_spherical(ring, q, p)
    for first, joint in enumerate(ring.joints):
        spherical = all(other.motion is Motion.SPHERICAL for other in ring.joints)
        if spherical and len(ring.joints) == 2 and joint.spin is not None:
            return _rod_branches(ring.rotated(first), joint, q)
    return None


def _rod_branches(ring: Ring, joint: ChainJoint, q: SX) -> LoopBranches:
    """Return the branch of a spherical joint of a rod, for a known spin about the rod.

    `joint` is the spherical joint; the spin is an element of the positions q.
    """
    before, after = ring.gaps[0].pose.inverse().p, ring.gaps[1].pose.p
    u, w = (after, before) if joint.sign > 0 else (before, after)
    u, w = u / casadi.norm_2(u), w / casadi.norm_2(w)
    assert joint.spin is not None
    assert joint.index is not None
    rest = SX(casadi.DM(list(joint.spin.rest)))
    shortest = _quaternion_product(_shortest_rotation(quaternion_rotation(rest) @ u, w), rest)
    half = q[joint.spin.index] / 2
    rotated = _quaternion_product(shortest, casadi.vertcat(casadi.cos(half), casadi.sin(half) * u))
    rotated = casadi.if_else(rotated[0] < 0, -rotated, rotated)
    path = {joint.index + k: rotated[k] for k in range(4)}
    given = q[joint.index : joint.index + 4]
    left = _quaternion_product(casadi.vertcat(shortest[0], -shortest[1:4]), given)
    angle = 2 * casadi.atan2(casadi.dot(u, left[1:4]), left[0])
    return LoopBranches({"": path}, RodSpin(joint.spin.index, SX(angle)))


def _shortest_rotation(a: SX, b: SX) -> SX:
    """Return quaternion (4, 1) that rotates the unit vector a onto b about their common normal."""
    whole = casadi.vertcat(1 + casadi.dot(a, b), cross(a, b))
    return SX(whole / casadi.norm_2(whole))


def _quaternion_product(a: SX, b: SX) -> SX:
    """Return the Hamilton product a b (4, 1) of two quaternions, with the order w, x, y, z."""
    vector = a[0] * b[1:4] + b[0] * a[1:4] + cross(a[1:4], b[1:4])
    return casadi.vertcat(a[0] * b[0] - casadi.dot(a[1:4], b[1:4]), vector)


# Intersection of spheres: two or three prismatic joints, and as many rigid links to a point.
#
# Each link fixes the distance of a moved point from a known centre: s'M s + 2 c_i's + k_i = 0 in
# the displacements s. The differences of these equations are linear. Their common line intersects
# the first sphere in two points. The sign is the side of the plane of the centres on which the
# point is; the first three centres are counterclockwise about the normal of that plane (for two
# centres: the left of the line from the first to the second).
#
# Source: Clavel 1988.


@dataclass(frozen=True, slots=True, eq=False)
class _Sphere:
    """Sphere equation s'M s + 2 c's + k = 0 of prismatic displacements s (n, 1).

    Attributes:
        M: (n, n) Gram matrix of the axes of the prismatic joints.
        c: (n, 1) linear coefficients, halved.
        k: constant term.
    """

    M: SX
    c: SX
    k: SX


def prismatic_indices(span: RigidLink) -> frozenset[int] | None:
    """Return the indices in q of the two or three joints outside a rigid link.

    None if one of these joints is not prismatic, or for another number of joints.

    Args:
        span: rigid link with its loop.
    """
    if any(joint.motion is not Motion.PRISMATIC for joint in span.chain.joints):
        return None
    indices = frozenset(joint.index for joint in span.chain.joints if joint.index is not None)
    return indices if len(indices) in (2, 3) else None


def independent_links(spans: Mapping[int, RigidLink], q: SX, p: SX) -> list[int] | None:
    """Return the loops whose links determine the point; None if there are too few of them.

    Args:
        spans: links whose loops have the same prismatic joints, by loop index.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Loop indices, as many as prismatic joints.
    """
    indices = sorted(prismatic_indices(next(iter(spans.values()))) or ())
    found, centres = list[int](), list[SX]()
    for number, span in spans.items():
        centre = _sphere(span, indices).c
        apart = [other - centres[0] for other in (*centres[1:], centre) if centres]
        if not centres or not always_zero(_span_normal(apart), q, p):
            found.append(number)
            centres.append(centre)
        if len(found) == len(indices):
            return found
    return None


def _span_normal(a: Sequence[SX]) -> SX:
    """Return an expression that is zero if one vector is zero, or two vectors are parallel.

    `a` contains one or two vectors (3, 1).
    """
    return a[0] if len(a) == 1 else cross(a[0], a[1])


def point_on_links(name: str, spans: Sequence[RigidLink]) -> LoopBranches:
    """Return the two positions of prismatic joints at which rigid links hold a point.

    Args:
        name: prefix of the labels of both branches.
        spans: links, as many as prismatic joints in each loop.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    indices = sorted(prismatic_indices(spans[0]) or ())
    spheres = [_sphere(span, indices) for span in spans]
    first = spheres[0]
    base, along = _sphere_line(spheres)
    A, B = casadi.bilin(first.M, along, along), casadi.dot(along, first.M @ base + first.c)
    C = casadi.bilin(first.M, base, base) + 2 * casadi.dot(first.c, base) + first.k
    root = casadi.sqrt(B * B - A * C)
    branches = {}
    for label, sign in (("+", 1), ("-", -1)):
        point = base + along * ((sign * root - B) / A)
        branches[f"{name}:{label}"] = {index: point[k] for k, index in enumerate(indices)}
    return LoopBranches(branches)


def _sphere(span: RigidLink, indices: Sequence[int]) -> _Sphere:
    """Return the equation of a rigid link in the displacements of the joints with these indices."""
    *poses, end = frames_at_zero(span.chain.gaps, Pose.translation(-span.target))
    axes = {
        joint.index: joint.sign * at.R[:, 2]
        for joint, at in zip(span.chain.joints, poses, strict=True)
    }
    e = end.p + end.R @ span.start
    U = casadi.horzcat(*(axes[index] for index in indices))
    return _Sphere(U.T @ U, U.T @ e, casadi.sumsqr(e) - span.squared)


def _sphere_line(spheres: Sequence[_Sphere]) -> tuple[SX, SX]:
    """Return a point and the direction of the line in which the planes of the spheres intersect."""
    first, *others = spheres
    a = [other.c - first.c for other in others]
    h = [(first.k - other.k) / 2 for other in others]
    if len(a) == 1:
        along = vector([a[0][1], -a[0][0]])
        return h[0] * a[0] / casadi.sumsqr(a[0]), along
    along = cross(a[0], a[1])
    base = h[0] * cross(a[1], along) + h[1] * cross(along, a[0])
    return base / casadi.sumsqr(along), along


# Bennett's loop: four revolute joints with skew axes, which is movable by its special dimensions.
#
# Opposite links are equal, so that a half rotation about a line maps the loop onto itself: it swaps
# the two axes next to the known axis, and maps the known axis to the opposite axis. The line is
# along the sum or the difference of the swapped axes. Only one of the two closes the loop.
#
# Source: Bennett 1903.


@dataclass(frozen=True, slots=True, eq=False)
class _Axes:
    """Directions of the axes before, at and after the known joint, in the frame after joint 3."""

    before: SX
    known: SX
    after: SX


def bennett(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """Return the unique branch of Bennett's loop with one known joint; None for other loops.

    Args:
        ring: loop chain.
        q: symbols of positions.
        p: symbols of parameters.

    Returns:
        Branches: expressions of the joint positions for each solution, by its label.
    """
    revolute = all(joint.motion is Motion.REVOLUTE for joint in ring.joints)
    if len(ring.joints) != 3 or not revolute:
        return None
    for first in range(3):
        begun = ring.rotated(first)
        known = begun.gaps[0].pivots
        if len(known) == 1 and not any(gap.pivots for gap in begun.gaps[1:]):
            branches = _closing_angles(begun, known[0], q, p)
            if len(branches) == 1:
                return LoopBranches(
                    {"": positions(ring.rotated(first).joints, [t.value for t in branches[0]])}
                )
    return None


def _closing_angles(ring: Ring, known: Pose, q: SX, p: SX) -> list[list[Angle]]:
    """Return the angles of each half rotation that closes the loop at all known positions.

    `known` is the pose of the known joint in the frame of its transform.
    """
    axes = _Axes(vector(_Z), known.R[:, 2], ring.gaps[0].pose.R[:, 2])
    found = list[list[Angle]]()
    for side in (1, -1):
        if not _has_equal_twists(ring, axes, side, q, p):
            continue
        for swap in (1, -1):
            angles = _angles(ring, axes, swap, side * swap)
            if always_zero(_closure_gap(ring, angles), q, p):
                found.append(angles)
    return found


def _has_equal_twists(ring: Ring, axes: _Axes, side: int, q: SX, p: SX) -> bool:
    """Whether the twists of unknown links equal those of the opposite links, times `side` (+-1).

    `axes` are the directions of the axes of the loop; q and p are the symbols of positions and
    parameters.
    """
    _, R2, R3 = (gap.pose.R for gap in ring.gaps)
    first = R2[2, 2] - side * casadi.dot(axes.before, axes.known)
    second = R3[2, 2] - side * casadi.dot(axes.after, axes.known)
    return always_zero(casadi.vertcat(first, second), q, p)


def _angles(ring: Ring, axes: _Axes, swap: int, sense: int) -> list[Angle]:
    """Return the angles for the half rotation that maps axis `after` to `swap` times `before`.

    `swap` and `sense` are 1 or -1.
    """
    R1, R2, R3 = (gap.pose.R for gap in ring.gaps)
    line = axes.after + swap * axes.before
    across = 2 * casadi.dot(line, axes.known) / casadi.sumsqr(line)
    opposite = sense * (across * line - axes.known)
    a = angle_onto(in_plane(R2[:, 2]), in_plane(R1.T @ opposite))
    before = Pose.rotation(R2.T @ _rotation(a).R.T @ R1.T).R @ axes.before
    b = angle_onto(in_plane(R3[:, 2]), in_plane(before))
    c = angle_onto(in_plane(opposite), R3[2, 0:2].T)
    return [a, b, c]


def _closure_gap(ring: Ring, angles: list[Angle]) -> SX:
    """Return the closure error of the loop (16, 1): pose around the loop minus the identity.

    `angles` are the angles of all joints of the loop.
    """
    pose = Pose.identity()
    for gap, angle in zip(ring.gaps, angles, strict=True):
        pose = pose @ gap.pose @ _rotation(angle)
    return casadi.vec(pose.matrix - Pose.identity().matrix)


def _rotation(angle: Angle) -> Pose:
    """Return the rotation about z by a symbolic angle."""
    c, s = casadi.cos(angle.value), casadi.sin(angle.value)
    rows = (casadi.horzcat(c, -s, 0), casadi.horzcat(s, c, 0), casadi.horzcat(SX(0), 0, 1))
    return Pose.rotation(casadi.vertcat(*rows))
