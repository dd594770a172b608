"""Loops in space: joints from centres, distances, orientations and translations.

What lies beyond such a centre only sees a point, whatever the joints in it do.
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

# Two revolute joints whose axes meet, as in a universal joint, that aim a known point at a known
# point.
#
# What the second revolute joint can change along the axis of the first gives X cos t + Y sin t = Z.
# The sign says to which side of the plane of the two axes the second joint is rotated.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 2.


def aim(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The branches that aim a link at its other end; None unless two centres are all unknown.

    Args:
        ring: the loop, of which one centre is made of two revolute joints.
        q: symbols of positions.
        p: symbols of parameters.
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
    branches = signed(ring.joints[1])
    return LoopBranches({label: _aim_root(ring, one, other, sign) for label, sign in branches})


def _aim_root(ring: Ring, one: Centre, other: Centre, sign: int) -> Positions:
    X1, X2, X3 = (gap.pose for gap in ring.gaps[:3])
    back = X1.inverse()
    target = back.p + back.R @ other.after - one.before
    arm, x = X3.p + X3.R @ other.before - one.after, X2.R[2, :].T
    dot = x[0] * arm[0] + x[1] * arm[1]
    b = root_angle(dot, -across(x, arm), target[2] - x[2] * arm[2], sign)
    rotated = casadi.vertcat(b.matrix @ in_plane(arm), arm[2])
    a = angle_onto(in_plane(X2.R @ rotated), in_plane(target))
    return positions(ring.joints[:2], (a.value, b.value))


# A spherical joint as the only unknown joint: the quaternion of a known orientation.
#
# Of the four formulas the one with the largest denominator is taken, so that nothing is lost at
# half rotations; the quaternion is the one whose first element is not negative.
#
# Source: Shepperd 1978.


def spherical(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The orientation of a spherical joint of the tree; None unless it alone is unknown."""
    joint = ring.joints[0]
    if len(ring.joints) != 1 or joint.motion is not Motion.SPHERICAL or joint.index is None:
        return None
    R = ring.gaps[0].pose.R
    quaternion = unit_quaternion(R.T if joint.sign > 0 else R)
    return LoopBranches({"": {joint.index + k: quaternion[k] for k in range(4)}})


def unit_quaternion(R: SX) -> SX:
    """(4, 1) unit quaternion w, x, y, z of an orientation, w not negative."""
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


# A spherical joint that two joints confine to a plane: a rotation brings it there.
#
# Two parallel revolute joints, a revolute and a prismatic joint across it, or two prismatic joints
# leave a point in a plane with the normal n. A rotation beyond them brings the spherical joint into
# that plane: X cos t + Y sin t = Z. Then the loop is plane.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 2.


_Z = (0.0, 0.0, 1.0)


def confine(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The rotation that brings a spherical joint into the plane of two others, or None.

    Args:
        ring: the loop, of which a spherical joint and three joints are unknown.
        q: symbols of positions.
        p: symbols of parameters.
    """
    ring = with_spherical(ring, q, p)
    spherical = [k for k, joint in enumerate(ring.joints) if joint.motion is Motion.SPHERICAL]
    if len(spherical) != 1 or len(ring.joints) != 4:
        return None
    begun = ring.rotated((spherical[0] + 1) % 4)
    for path in (begun, begun.reversed().rotated(1)):
        if path.joints[0].is_rotational:
            normal = _normal(path, q, p)
            if normal is not None and not _is_across(path, normal, q, p):
                return _confine_branches(path, normal)
    return None


def _normal(ring: Ring, q: SX, p: SX) -> SX | None:
    """The normal of the plane that the second and third joint keep, seen before the second."""
    second, third = (joint.motion is Motion.PRISMATIC for joint in ring.joints[1:3])
    between = ring.gaps[2].pose
    axis = between.R[:, 2]
    if second and third:
        return cross(vector(_Z), axis)
    if second or third:
        across_it = always_zero(axis[2], q, p)
        return (axis if second else vector(_Z)) if across_it else None
    return vector(_Z) if parallel(between, q, p) else None


def _is_across(ring: Ring, normal: SX, q: SX, p: SX) -> bool:
    """Whether the first revolute joint moves nothing along the normal either."""
    return always_zero(in_plane(ring.gaps[1].pose.R @ normal), q, p)


def _confine_branches(ring: Ring, normal: SX) -> LoopBranches:
    """The first joint, from the spherical one before it and its height on the normal behind it."""
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


# Two coupled coordinates: the driven one by its polynomial, the driver where that is a line.


def coupled_position(
    coupling: CoordinateCoupling, known: Container[int], q: SX
) -> LoopBranches | str:
    """The unknown one of coupled coordinates, or why it does not follow.

    Args:
        coupling: one of whose coordinates is known.
        known: indices in q of known positions.
        q: (nq, 1) symbols of positions.
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
    # linear in the unknown one, whose factor is its slope
    slope = terms[1] if number == coupling.driver else dict(coupling.others)[number]
    rest = casadi.substitute(coupling.value(q), q[number], SX(0))
    return LoopBranches({"": {number: (q[coupling.driven] - rest) / slope}})


# One joint that brings two centres of a loop to the distance that a rigid link between them
# tells.
#
# The centres are spherical joints, or revolute joints whose axes meet. Seen from the joint, one of
# them is at m, the other one at d beyond the joint. A revolute joint gives X cos t + Y sin t = Z, a
# prismatic joint a quadratic equation. These are the revolute and the prismatic joint "with length
# constraint" of Modelica's assemblies.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 2; Otter et al. 2003.


@dataclass(frozen=True, slots=True, eq=False)
class Span:
    """A rigid link between two centres, and the path around the loop from its end to its start.

    Attributes:
        chain: on that path.
        target: (3, 1) the end of the link, before the first gap.
        start: (3, 1) the start of the link, after the last gap.
        squared: the square of its length.
    """

    chain: Chain
    target: SX
    start: SX
    squared: SX


def spans(ring: Ring, q: SX, p: SX) -> Iterator[Span]:
    """Every rigid link of a loop between two centres."""
    n = len(ring.joints)
    found = centres(ring, q, p)
    for one in found:
        for other in found:
            apart = not set(one.joints(n)) & set(other.joints(n))
            if apart and (one.first + one.count - other.first) % n == 0:
                yield _span(ring.rotated(one.first), one, other)


def _span(begun: Ring, one: Centre, other: Centre) -> Span:
    """The span between the first centre of a loop and the second one, next to it."""
    link = begun.gaps[one.count].pose
    after = one.count + other.count
    return Span(
        Chain(begun.joints[after:], (*begun.gaps[after:], begun.gaps[0])),
        other.after,
        one.before,
        square(link.p + link.R @ other.before - one.after),
    )


def at_distance(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The two branches of a joint where a rigid link fits; None where no link asks for it."""
    for span in spans(ring, q, p):
        if len(span.chain.joints) == 1:
            m, d = _ends(span)
            idle = any(always_zero(in_plane(end), q, p) for end in (m, d))
            if not (idle and span.chain.joints[0].is_rotational):
                return _at_distance(span.chain.joints[0], m, d, span.squared)
    return None


def _ends(span: Span) -> tuple[SX, SX]:
    """What the joint moves, and the rest of the link, seen from it."""
    before, after = (gap.pose for gap in span.chain.gaps)
    back = before.inverse()
    return -(back.p + back.R @ span.target), after.p + after.R @ span.start


def _at_distance(joint: ChainJoint, m: SX, d: SX, squared: SX) -> LoopBranches:
    def value(sign: int) -> SX:
        if joint.is_rotational:
            Z = (squared - square(m) - square(d)) / 2 - m[2] * d[2]
            return root_angle(m[0] * d[0] + m[1] * d[1], -across(m, d), Z, sign).value
        w = m + d
        return SX(sign * casadi.sqrt(squared - w[0] * w[0] - w[1] * w[1]) - w[2])

    return LoopBranches(
        {label: positions([joint], (value(sign),)) for label, sign in signed(joint)}
    )


# A free body as the only unknown joint: its position and quaternion follow from its pose.


def free_body(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The pose of a free body; None unless it alone is unknown."""
    joint = ring.joints[0]
    if len(ring.joints) != 1 or joint.motion is not Motion.FREE or joint.index is None:
        return None
    pose = ring.gaps[0].pose
    pose = pose.inverse() if joint.sign > 0 else pose
    values = casadi.vertcat(pose.p, unit_quaternion(pose.R))
    return LoopBranches({"": {joint.index + k: values[k] for k in range(7)}})


# Three unknown revolute joints from orientations alone.
#
# R_a X_2 R_b X_3 R_c = X_1': the element on the third row and column holds the middle angle
# alone, X cos t + Y sin t = Z. The sign says to which side of the plane of the two other axes the
# middle joint is rotated.
#
# Source: Khalil & Creusot 1997, section 3.3, equation of type 2.


def orientations(ring: Ring) -> LoopBranches:
    """The two branches of a loop of three unknown revolute joints, as far as orientations go.

    Args:
        ring: its joints a, b, c; b is the one in the middle.
    """
    return LoopBranches(
        {label: _orientations_root(ring, sign) for label, sign in signed(ring.joints[1])}
    )


def _orientations_root(ring: Ring, sign: int) -> Positions:
    R1, R2, R3 = (gap.pose.R for gap in ring.gaps)
    x, y = R2[2, :].T, R3[:, 2]
    dot = x[0] * y[0] + x[1] * y[1]
    b = root_angle(dot, -across(x, y), R1[2, 2] - x[2] * y[2], sign)
    rotated = casadi.vertcat(b.matrix @ in_plane(y), y[2])
    a = angle_onto(in_plane(R2 @ rotated), R1[2, 0:2].T)
    row = casadi.vertcat(b.matrix.T @ in_plane(x), x[2])
    c: Angle = angle_onto(in_plane(R1[:, 2]), in_plane(R3.T @ row))
    return positions(ring.joints, (a.value, b.value, c.value))


# Turns from the orientations around a loop, before anything is known of its prismatic joints.
#
# Rotations about one direction are one: the loop is made of up to three directions. One angle is
# what is missing; of two directions each rotation brings the other axis to where it belongs, those
# that share their direction with others staying unknown; three revolute joints are solved as a
# spherical loop.
#
# Source: Khalil & Creusot 1997, section 3.3; for RCCC loops Duffy 1980.


def orientation(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The revolute joints that orientations alone determine; None where there is none."""
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
    """The loop with its prismatic joints locked at zero."""
    for k, joint in enumerate(ring.joints):
        if joint.motion is Motion.PRISMATIC:
            return _revolute_alone(ring.without(k))
    return ring


def _directions(ring: Ring, q: SX, p: SX) -> tuple[Ring, frozenset[str]]:
    """One joint for each direction, and the names of those that stand for several."""
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
    """Whether positions do not hinder three rotations: translations are free, or the axes meet."""
    if len(ring.joints) == len(revolute.joints):
        return any(centre.count == 3 for centre in centres(ring, q, p))
    return len(ring.joints) == len(revolute.joints) + 3


def _two_orientations(ring: Ring, shared: frozenset[str]) -> LoopBranches:
    values: dict[int, SX] = {}
    for begun in (ring, ring.rotated(1)):
        joint, (R1, R2) = begun.joints[0], (gap.pose.R for gap in begun.gaps)
        if joint.name not in shared:
            revolute = angle_onto(R2[0:2, 2], R1[2, 0:2].T)
            values |= positions([joint], [revolute.value])
    return LoopBranches({"": values})


# Prismatic joints alone, or with all rotations about one point: linear equations.
#
# X_1 .. X_n with the prismatic joints at zero leaves a gap e; the prismatic joints move along u_1
# .. u_m, m <= 3, and e + u_1 s_1 + .. + u_m s_m = 0. With fewer than three the normal equations are
# solved, which lose nothing where the loop closes.


_MOST = 3


def prismatic(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The only displacements that close a loop; None where a rotation has a say in them."""
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
    """The prismatic joints that lead from the centre, the first one of the loop, back to it."""
    joints = ring.joints[centre.count :]
    poses = frames_at_zero(ring.gaps[centre.count :], Pose.translation(-centre.after))
    axes, pose = [pose.R[:, 2] for pose in poses], poses[-1]
    if centre.count:
        pose = pose @ ring.gaps[0].pose
    e = pose.p + pose.R @ centre.before
    return LoopBranches({"": positions(joints, _combination(axes, -e))})


def _combination(u: Sequence[SX], e: SX) -> list[SX]:
    """The combination of one to three vectors that gives e."""
    if len(u) == 1:
        return [casadi.dot(u[0], e) / casadi.sumsqr(u[0])]
    if len(u) == 2:
        n = cross(u[0], u[1])
        size = casadi.sumsqr(n)
        return [casadi.dot(cross(e, u[1]), n) / size, casadi.dot(cross(u[0], e), n) / size]
    across = [cross(u[1], u[2]), cross(u[2], u[0]), cross(u[0], u[1])]
    volume = casadi.dot(u[0], across[0])
    return [casadi.dot(e, normal) / volume for normal in across]


# A rod between two spherical joints as all that is unknown: aimed by the shortest rotation, and
# rotated about itself.
#
# The spherical joint rotates the vector u of the rod onto the known vector w. From the orientation
# R_0 of the assembled configuration the shortest rotation M takes R_0 u onto w; before both the rod
# may spin about u.


def spin(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The orientation of a rod that spins; None where more than its two joints is unknown.

    Args:
        ring: the loop.
        q: symbols of positions, that of the spin included.
        p: symbols of parameters.
    """
    ring = with_spherical(ring, q, p)
    for first, joint in enumerate(ring.joints):
        spherical = all(other.motion is Motion.SPHERICAL for other in ring.joints)
        if spherical and len(ring.joints) == 2 and joint.spin is not None:
            return _rod_branches(ring.rotated(first), joint, q)
    return None


def _rod_branches(ring: Ring, joint: ChainJoint, q: SX) -> LoopBranches:
    before, after = ring.gaps[0].pose.inverse().p, ring.gaps[1].pose.p
    u, w = (after, before) if joint.sign > 0 else (before, after)
    u, w = u / casadi.norm_2(u), w / casadi.norm_2(w)
    assert joint.spin is not None
    assert joint.index is not None
    rest = SX(casadi.DM(list(joint.spin.rest)))
    shortest = _product(_shortest_rotation(quaternion_rotation(rest) @ u, w), rest)
    half = q[joint.spin.index] / 2
    rotated = _product(shortest, casadi.vertcat(casadi.cos(half), casadi.sin(half) * u))
    rotated = casadi.if_else(rotated[0] < 0, -rotated, rotated)
    path = {joint.index + k: rotated[k] for k in range(4)}
    given = q[joint.index : joint.index + 4]
    left = _product(casadi.vertcat(shortest[0], -shortest[1:4]), given)
    angle = 2 * casadi.atan2(casadi.dot(u, left[1:4]), left[0])
    return LoopBranches({"": path}, RodSpin(joint.spin.index, SX(angle)))


def _shortest_rotation(a: SX, b: SX) -> SX:
    """The quaternion that rotates the unit vector a onto b about their common normal."""
    whole = casadi.vertcat(1 + casadi.dot(a, b), cross(a, b))
    return SX(whole / casadi.norm_2(whole))


def _product(a: SX, b: SX) -> SX:
    """The product of two quaternions w, x, y, z."""
    vector = a[0] * b[1:4] + b[0] * a[1:4] + cross(a[1:4], b[1:4])
    return casadi.vertcat(a[0] * b[0] - casadi.dot(a[1:4], b[1:4]), vector)


# A point that two or three prismatic joints move and as many rigid links hold: spheres that meet.
#
# Each link tells the distance of a point on what these joints move from a known centre: s'M s + 2
# c_i's + k_i = 0 in the displacements s. Their differences are linear; the line that they leave
# is cut with the first sphere. The sign says on which side of the plane of the centres the point
# is, the first three of which are counted counterclockwise about its normal (of two centres: to
# the left of the line from the first to the second).
#
# Source: Clavel 1988.


@dataclass(frozen=True, slots=True, eq=False)
class _Sphere:
    """s'M s + 2 c's + k = 0.

    Attributes:
        M: (n, n) of the axes of the prismatic joints.
        c: (n, 1).
        k: what is left.
    """

    M: SX
    c: SX
    k: SX


def prismatic_indices(span: Span) -> frozenset[int] | None:
    """Indices in q of the joints between the ends of a link, where two or three are prismatic."""
    if any(joint.motion is not Motion.PRISMATIC for joint in span.chain.joints):
        return None
    indices = frozenset(joint.index for joint in span.chain.joints if joint.index is not None)
    return indices if len(indices) in (2, 3) else None


def independent_links(spans: Mapping[int, Span], q: SX, p: SX) -> list[int] | None:
    """Which links hold the point, the others holding it likewise; None where they are too few.

    Args:
        spans: with the same prismatic joints between their ends, by number of the loop.
        q: symbols of positions.
        p: symbols of parameters.
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
    """What vanishes where vectors do not differ in direction."""
    return a[0] if len(a) == 1 else cross(a[0], a[1])


def point_on_links(name: str, spans: Sequence[Span]) -> LoopBranches:
    """The two positions of a point that rigid links hold.

    Args:
        name: for the labels.
        spans: as many as there are prismatic joints between the ends of each of them.
    """
    indices = sorted(prismatic_indices(spans[0]) or ())
    spheres = [_sphere(span, indices) for span in spans]
    first = spheres[0]
    base, along = _line(spheres)
    A, B = casadi.bilin(first.M, along, along), casadi.dot(along, first.M @ base + first.c)
    C = casadi.bilin(first.M, base, base) + 2 * casadi.dot(first.c, base) + first.k
    root = casadi.sqrt(B * B - A * C)
    branches = {}
    for label, sign in (("+", 1), ("-", -1)):
        point = base + along * ((sign * root - B) / A)
        branches[f"{name}:{label}"] = {index: point[k] for k, index in enumerate(indices)}
    return LoopBranches(branches)


def _sphere(span: Span, indices: Sequence[int]) -> _Sphere:
    *poses, end = frames_at_zero(span.chain.gaps, Pose.translation(-span.target))
    axes = {
        joint.index: joint.sign * at.R[:, 2]
        for joint, at in zip(span.chain.joints, poses, strict=True)
    }
    e = end.p + end.R @ span.start
    U = casadi.horzcat(*(axes[index] for index in indices))
    return _Sphere(U.T @ U, U.T @ e, casadi.sumsqr(e) - span.squared)


def _line(spheres: Sequence[_Sphere]) -> tuple[SX, SX]:
    """A point and the direction of the line on which the spheres meet."""
    first, *others = spheres
    a = [other.c - first.c for other in others]
    h = [(first.k - other.k) / 2 for other in others]
    if len(a) == 1:
        along = vector([a[0][1], -a[0][0]])
        return h[0] * a[0] / casadi.sumsqr(a[0]), along
    along = cross(a[0], a[1])
    base = h[0] * cross(a[1], along) + h[1] * cross(along, a[0])
    return base / casadi.sumsqr(along), along


# Bennett's loop: four revolute joints of skew axes, which moves nevertheless.
#
# Opposite links are alike, so that a half rotation about a line takes the loop onto itself: it
# swaps the axes next to the known one, and takes the known axis to the one opposite. The line lies
# along the sum or the difference of the swapped axes; only one of them closes the loop, all the
# way round.
#
# Source: Bennett 1903.


@dataclass(frozen=True, slots=True, eq=False)
class _Axes:
    """Directions of the axes before, at and after the known one, seen after the last joint."""

    before: SX
    known: SX
    after: SX


def bennett(ring: Ring, q: SX, p: SX) -> LoopBranches | None:
    """The only branch of a loop of three unknown revolute joints and a known one, or None."""
    revolute = all(joint.motion is Motion.REVOLUTE for joint in ring.joints)
    if len(ring.joints) != 3 or not revolute:
        return None
    for first in range(3):
        begun = ring.rotated(first)
        known = begun.gaps[0].pivots
        if len(known) == 1 and not any(gap.pivots for gap in begun.gaps[1:]):
            branches = _closing(begun, known[0], q, p)
            if len(branches) == 1:
                return LoopBranches(
                    {"": positions(ring.rotated(first).joints, [t.value for t in branches[0]])}
                )
    return None


def _closing(ring: Ring, known: Pose, q: SX, p: SX) -> list[list[Angle]]:
    """The angles by the half rotations that close the loop at every position of the known joint."""
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
    """Whether the twists of the unknown links are those of the known ones opposite."""
    _, R2, R3 = (gap.pose.R for gap in ring.gaps)
    first = R2[2, 2] - side * casadi.dot(axes.before, axes.known)
    second = R3[2, 2] - side * casadi.dot(axes.after, axes.known)
    return always_zero(casadi.vertcat(first, second), q, p)


def _angles(ring: Ring, axes: _Axes, swap: int, sense: int) -> list[Angle]:
    """The angles when the half rotation takes the axis after the known one to swap x before."""
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
    """What stays open of the loop, positions and directions."""
    pose = Pose.identity()
    for gap, angle in zip(ring.gaps, angles, strict=True):
        pose = pose @ gap.pose @ _rotation(angle)
    return casadi.vec(pose.matrix - Pose.identity().matrix)


def _rotation(angle: Angle) -> Pose:
    c, s = casadi.cos(angle.value), casadi.sin(angle.value)
    rows = (casadi.horzcat(c, -s, 0), casadi.horzcat(s, c, 0), casadi.horzcat(SX(0), 0, 1))
    return Pose.rotation(casadi.vertcat(*rows))
