"""Matrices A, B and Q of Lagrange's form, from augmented bodies without differentiation.

Every particle of the system has the velocity r_dot = J v. Thus A is the integral of J' J over the
mass, and B is the integral of J' dJ/dt, so that dA/dt = B + B'. B v are the Coriolis and
centrifugal efforts. For revolute and prismatic joints, B consists of the Christoffel symbols. For
quaternion joints, whose velocities are not rates of positions, B extends the Christoffel symbols.
Column j of B depends on the moments of the mass of link j and its descendants and on their rates:
the augmented body of link j.

Source: Renaud 1986; Khalil & Creusot 1997, section 5.5; Echeandia & Wensing 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import DM, SX

from mbs.assembly.tree import Link, Tree, position_rate
from mbs.components.joints import Motion
from mbs.recursions.link_motions import (
    LinkPose,
    effort_at_joint,
    link_accelerations,
    motion_at_joint,
    motion_behind,
    resting_base,
    unit_motions_at_joint,
)
from mbs.recursions.newton_euler import momentum_on, spin_momenta
from mbs.recursions.regrouping import regroup, shift_frames
from mbs.spatial import (
    Displacement,
    FreeDisplacement,
    MatrixRotation,
    PseudoInertia,
    ScrewDisplacement,
    cross,
    skew,
    zeros,
)
from mbs.spatial.rotation import AxisRotation

# Augmented body of a link: moments of the mass of the link and its descendants, and their rates.
#
# Source: Renaud 1986 (augmented bodies); Echeandia & Wensing 2021.


@dataclass(frozen=True, slots=True, eq=False)
class VelocityField:
    """Integrals over the mass of the velocity field u of a unit joint velocity, in a frame.

    The vector r points from the origin of the frame to a particle, and u is the velocity of this
    particle for a unit joint velocity.

    Attributes:
        f, m: (3, 1) integrals of u and of r x u: linear and angular momentum.
        f_rate, m_rate: (3, 1) integrals of du/dt and of r x du/dt.
        drag: (3, 1) integral of dr/dt x u.
    """

    f: SX
    m: SX
    f_rate: SX
    m_rate: SX
    drag: SX

    @staticmethod
    def nothing() -> VelocityField:
        """Return the integrals over no mass: zeros."""
        return VelocityField(zeros(), zeros(), zeros(), zeros(), zeros())

    def __add__(self, other: VelocityField) -> VelocityField:
        """Add the integrals of a second mass with the same velocity field, in the same frame."""
        return VelocityField(
            self.f + other.f,
            self.m + other.m,
            self.f_rate + other.f_rate,
            self.m_rate + other.m_rate,
            self.drag + other.drag,
        )

    def through(self, step: Displacement, velocity: SX) -> VelocityField:
        """Transform to the frame before a displacement, about its origin.

        Args:
            step: displacement to the present frame.
            velocity: (3, 1) rate of its translation, in the axes before it [m/s].
        """
        f, m = step.wrench(self.f, self.m)
        f_rate, m_rate = step.wrench(self.f_rate, self.m_rate)
        drag = step.rotation.apply(self.drag) + cross(velocity, f)
        return VelocityField(f, m, f_rate, m_rate, drag)

    def row(self, link: Link, w: SX) -> SX:
        """Return the entries of the Coriolis matrix B of this velocity, in the columns of a link.

        Args:
            link: link whose joint velocities select the columns.
            w: (3, 1) angular velocity of the axes of its joint [rad/s].
        """
        return effort_at_joint(link, cross(self.f, w), cross(self.m, w) + self.drag)


@dataclass(frozen=True, slots=True, eq=False)
class SubtreeInertia:
    """Moments of the mass on the distal side of a joint, about the origin and axes of a frame.

    Attributes:
        mass: moments of order 0, 1 and 2.
        rate: half the rate of the moments, relative to the frame.
        spin: (3, 1) half the angular momentum about the origin, relative to the frame.
    """

    mass: PseudoInertia
    rate: PseudoInertia
    spin: SX

    @staticmethod
    def of(body: PseudoInertia, spin: SX) -> SubtreeInertia:
        """Return the moments of a body at rest in the frame.

        Args:
            body: moments of the mass of the body.
            spin: (3, 1) half the angular momentum of the rotors on the body.
        """
        return SubtreeInertia(body, PseudoInertia(zeros(3, 3), zeros(), SX(0)), spin)

    @staticmethod
    def nothing() -> SubtreeInertia:
        """Return the moments of no mass: zeros."""
        return SubtreeInertia.of(PseudoInertia(zeros(3, 3), zeros(), SX(0)), zeros())

    def __add__(self, other: SubtreeInertia) -> SubtreeInertia:
        """Add the moments of a second body, in the same frame."""
        return SubtreeInertia(
            self.mass + other.mass, self.rate + other.rate, self.spin + other.spin
        )

    def through(self, step: Displacement) -> SubtreeInertia:
        """Transform to the frame before a constant displacement, about its origin.

        Args:
            step: displacement to the present frame.
        """
        _, spin = step.wrench(self.rate.ms, self.spin)
        return SubtreeInertia(step.body(self.mass), step.body(self.rate), spin)

    def moved(self, linear: SX, angular: SX) -> SubtreeInertia:
        """Transform to a reference frame that coincides with the current frame, which moves in it.

        Args:
            linear: (3, 1) half the velocity of the current frame in the reference frame [m/s].
            angular: (3, 1) half its angular velocity [rad/s].
        """
        S, ms, m = self.mass.S, self.mass.ms, self.mass.m
        flow = casadi.mtimes(linear, ms.T) + casadi.mtimes(skew(angular), S)
        rate = PseudoInertia(
            self.rate.S + flow + flow.T,
            self.rate.ms + m * linear + cross(angular, ms),
            SX(0),
        )
        spin = self.spin + cross(ms, linear) + _inertia_times(S, angular)
        return SubtreeInertia(self.mass, rate, spin)

    def column(self, w: SX, linear: SX, angular: SX) -> VelocityField:
        """Return the integrals of the velocity field u = linear + angular x r.

        Args:
            w: (3, 1) angular velocity of the frame.
            linear: (3, 1) velocity at the origin, constant in the frame.
            angular: (3, 1) angular velocity of the field, constant in the frame.
        """
        S, ms = self.mass.S, self.mass.ms
        f = self.mass.m * linear + cross(angular, ms)
        change, twist = _inertia_times(self.rate.S, angular), cross(angular, self.spin)
        flow = cross(w, ms) + 2 * self.rate.ms
        return VelocityField(
            f=f,
            m=cross(ms, linear) + _inertia_times(S, angular),
            f_rate=cross(w, f) + 2 * cross(angular, self.rate.ms),
            m_rate=cross(ms, cross(w, linear))
            - cross(angular, casadi.mtimes(S, w))
            + change
            + twist,
            drag=cross(flow, linear) + casadi.mtimes(S, cross(w, angular)) + change - twist,
        )


def rotor_column(link: Link, carrier: int, w: SX) -> VelocityField:
    """Return the integrals of a unit joint velocity over the rotor that the joint drives.

    Args:
        link: link whose joint drives the rotor.
        carrier: index of a link. The result is zero if the rotor is not mounted on this link.
        w: (3, 1) angular velocity of the carrier, in its frame.
    """
    momentum = momentum_on(link, carrier)
    half_turn = 0.5 * cross(w, momentum)
    return VelocityField(zeros(), momentum, zeros(), half_turn, half_turn)


def _inertia_times(S: SX, a: SX) -> SX:
    """Return J a (3, 1) with the inertia tensor J = tr(S) - S, without terms that cancel."""
    rows = []
    for k in range(3):
        m, n = (k + 1) % 3, (k + 2) % 3
        rows.append(S[m, m] * a[k] + S[n, n] * a[k] - S[k, m] * a[m] - S[k, n] * a[n])
    return casadi.vertcat(*rows)


Step = tuple[Displacement, SX]
"""Displacement and the rate (3, 1) of its translation, both in the axes before it."""


@dataclass(frozen=True, slots=True, eq=False)
class LagrangeForm:
    """Matrices of the dynamic model tau = A a + B v + Q.

    Attributes:
        A: (nv, nv) symmetric inertia matrix [kg m^2, kg m, kg].
        B: (nv, nv) Coriolis matrix; dA/dt - 2 B is skew-symmetric.
        Q: (nv, 1) gravity efforts [N m or N].
    """

    A: SX
    B: SX
    Q: SX


@dataclass(frozen=True, slots=True, eq=False)
class _FormPlace:
    """Frame in which the columns of joint j are computed: joint frame on link i, or link frame j.

    The directions of the joint are constant in this column frame. Link i is the antecedent.
    Successive joints with parallel axes may have parallel column frames. Vectors of their
    descendants are then rotated once, by the sum of the joint angles.

    Attributes:
        w: (3, 1) angular velocity of link j, or of link i if the joint is backward.
        g: (3, 1) gravity acceleration.
        inner: displacements from the column frame to frame j. Empty if both are the same.
        outer: displacements to the column frame from the column frame of joint i if `parallel`,
            else from frame i.
        parallel: Whether the column frames of joints i and j are parallel.
    """

    w: SX
    g: SX
    inner: list[Step]
    outer: list[Step]
    parallel: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _FormWork:
    """Matrices that are being filled, and the data of the tree required for their entries.

    Attributes:
        form: matrices A, B and Q, filled in place.
        tree: the links.
        places: column frames of the joints.
        w: (3, 1) angular velocity of each link, in the link frame.
    """

    form: LagrangeForm
    tree: Tree
    places: list[_FormPlace]
    w: list[SX]


def lagrange_form(tree: Tree, poses: list[LinkPose], v: SX) -> LagrangeForm:
    """Return the matrices A, B and Q of the dynamic model tau = A a + B v + Q.

    Args:
        tree: the links.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
    """
    bodies = [PseudoInertia.of(link.inertia) for link in tree.links]
    poses, bodies = shift_frames(tree, poses, bodies)
    bodies = regroup(tree, poses, bodies)
    rest, base = zeros(tree.nv), resting_base(zeros())
    w = [motion.w for motion in link_accelerations(tree, poses, v, rest, base)]
    places = _column_frames(tree, poses, v, w)
    spins = spin_momenta(tree, 0.5 * v)
    framed = [SubtreeInertia.of(body, spins.get(j, zeros())) for j, body in enumerate(bodies)]
    placed = [SubtreeInertia.nothing()] * len(bodies)
    form = LagrangeForm(zeros(tree.nv, tree.nv), zeros(tree.nv, tree.nv), zeros(tree.nv))
    work = _FormWork(form, tree, places, w)
    for j in reversed(range(len(tree.links))):
        link, place = tree.links[j], places[j]
        body = framed[j]
        for step, _ in reversed(place.inner):
            body = body.through(step)
        body = body + placed[j]
        moved = body.moved(*motion_at_joint(link, 0.5 * v[link.v]))
        _fill_columns(work, j, moved if link.backward else body)
        if link.antecedent >= 0:
            body = moved
            for step, _ in reversed(place.outer):
                body = body.through(step)
            (placed if place.parallel else framed)[link.antecedent] += body
    _add_drives(form, tree, v)
    return form


def _column_frames(tree: Tree, poses: list[LinkPose], v: SX, w: list[SX]) -> list[_FormPlace]:
    """Return the column frame of each joint: the frame in which its columns are computed.

    `v` (nv, 1) are the joint velocities and `w` the angular velocities (3, 1) of the links. A joint
    on the base (not backward) uses its link frame, because it has no ancestors.
    """
    result: list[_FormPlace] = []
    gravity: list[SX] = []
    for j, link in enumerate(tree.links):
        pose, i = poses[j], link.antecedent
        linear, angular = motion_behind(link, pose, v[link.v])
        w_i, g_i = (w[i], gravity[i]) if i >= 0 else (zeros(), tree.gravity)
        gravity.append(pose.apply_inverse(g_i))
        if link.motion is Motion.REVOLUTE and _shares_direction(tree, poses, j, w):
            result.append(_parallel_place(pose, result[i], angular))
            continue
        steps = _moving_steps(pose, w_i, linear)
        seat = len(pose.seat)
        if link.backward:
            at_seat = pose.at_seat(w_i), pose.at_seat(g_i)
            result.append(_FormPlace(*at_seat, steps[seat:], steps[:seat]))
        elif i < 0 or link.motion.nv > 1:
            result.append(_FormPlace(w[j], gravity[j], [], steps))
        else:
            seat_w, seat_g = pose.at_seat(w_i) + angular, pose.at_seat(g_i)
            result.append(_FormPlace(seat_w, seat_g, steps[seat:], steps[:seat]))
    return result


def _shares_direction(tree: Tree, poses: list[LinkPose], j: int, w: list[SX]) -> bool:
    """Return whether joint j is parallel to the previous joint and their direction varies.

    `w` are the angular velocities of the links. If the direction is constant, the links move in a
    plane, and one rotation per joint keeps more zeros.
    """
    run = poses[j].run
    root = tree.links[run[0]].antecedent
    if len(run) == 1 or root < 0:
        return False
    turning = poses[run[0]].at_seat(w[root])
    return not (turning[0].is_zero() and turning[1].is_zero())


def _parallel_place(pose: LinkPose, before: _FormPlace, angular: SX) -> _FormPlace:
    """Return the column frame of a joint with pose `pose`, parallel to that of the previous joint.

    `before` is that of the previous joint, and `angular` (3, 1) the angular velocity of the joint.
    """
    inner, _ = before.inner[0]
    p = inner.point(pose.foot)
    outer = FreeDisplacement(MatrixRotation(SX(DM.eye(3))), p)
    motion = pose.motion[0]
    assert isinstance(motion, ScrewDisplacement)
    assert isinstance(pose.spin, AxisRotation)
    w = before.w + angular
    screw = ScrewDisplacement(pose.spin, motion.t)
    return _FormPlace(
        w,
        before.g,
        [(screw, cross(w, screw.point(zeros())))],
        [(outer, cross(before.w, p))],
        parallel=True,
    )


def _moving_steps(pose: LinkPose, w: SX, linear: SX) -> list[Step]:
    """Return the displacements from frame i to frame j, with the rates of their translations.

    `w` (3, 1) is the angular velocity of frame i. The last displacement also translates at `linear`
    (3, 1), in the axes of frame j.
    """
    steps: list[Step] = []
    for number, step in enumerate(pose.steps, 1):
        velocity = cross(w, step.point(zeros()))
        if number == len(pose.steps):
            velocity = velocity + step.rotation.apply(linear)
        steps.append((step, velocity))
        w = step.rotation.apply_inverse(w)
    return steps


def _fill_columns(work: _FormWork, j: int, body: SubtreeInertia) -> None:
    """Fill rows and columns of joint j in place: its diagonal block and those with its ancestors.

    `body` are the moments of link j and its descendants, in the column frame of the joint.
    """
    form, link, place = work.form, work.tree.links[j], work.places[j]
    spin = _transformed(place.inner, rotor_column(link, j, work.w[j]))
    for number, (linear, angular) in enumerate(unit_motions_at_joint(link)):
        k = link.v.start + number
        column = body.column(place.w, linear, angular)
        form.Q[k] = -casadi.dot(place.g, column.f)
        column = column + spin
        form.A[link.v, k] = effort_at_joint(link, column.f, column.m)
        form.B[link.v, k] = effort_at_joint(link, column.f_rate, column.m_rate)
        if link.rotor is not None:
            form.A[k, k] += link.rotor.seen_at_joint + effort_at_joint(link, spin.f, spin.m)
            form.B[k, k] += spin.row(link, place.w)
        _fill_ancestors(work, j, k, column)


def _add_drives(form: LagrangeForm, tree: Tree, v: SX) -> None:
    """Add the drive inertia Ia of each joint to A in place, and its Coriolis terms to B.

    Only a free joint has Coriolis terms: there Ia is also a mass, whose velocity is in rotating
    axes.
    """
    for link in tree.links:
        for k in range(link.v.start, link.v.stop):
            form.A[k, k] += link.Ia
        if link.motion is Motion.FREE and not link.Ia.is_zero():
            linear, angular = slice(link.v.start, link.v.start + 3), v[link.v][3:6]
            form.B[linear, linear] += link.Ia * skew(angular)


def _fill_ancestors(work: _FormWork, j: int, k: int, column: VelocityField) -> None:
    """Fill the entries of velocity k of joint j with the ancestors of j, in place.

    `column` contains the integrals for this velocity, in the column frame of joint j.
    """
    form, tree, places, w = work.form, work.tree, work.places, work.w
    driven = tree.links[j]
    while (i := tree.links[j].antecedent) >= 0:
        link, at_place = tree.links[i], places[j].parallel
        column = _transformed(places[j].outer, column)
        if tree.links[j] is driven:
            carried = rotor_column(driven, i, w[i])
            column = column + (_transformed(places[i].inner, carried) if at_place else carried)
        if link.backward:
            column, at_place = _transformed(places[i].inner, column), True
        entries = effort_at_joint(link, column.f, column.m)
        form.A[link.v, k], form.A[k, link.v] = entries, entries.T
        form.B[link.v, k] = effort_at_joint(link, column.f_rate, column.m_rate)
        form.B[k, link.v] = column.row(link, places[i].w if at_place else w[i]).T
        column = column if at_place else _transformed(places[i].inner, column)
        j = i


def _transformed(steps: list[Step], column: VelocityField) -> VelocityField:
    """Transform the integrals `column` to the frame before successive displacements."""
    for step, velocity in reversed(steps):
        column = column.through(step, velocity)
    return column


# Coriolis matrix B by differentiation of the inertia matrix (Christoffel symbols).
#
# For quaternion joints, whose velocities are not rates of positions, Hamel's terms are added as a
# skew-symmetric block.
#
# Source: Khalil & Creusot 1997, section 5.5; Hamel 1904 for quasi-velocities.


def christoffel(tree: Tree, q: SX, v: SX, A: SX) -> SX:
    """Return the Coriolis matrix B (nv, nv) of a tree from derivatives of its inertia matrix.

    B = (dA/dt + D - D') / 2 with D = d(A v)/dq N(q) and dq/dt = N(q) v, plus Hamel's blocks of
    quaternion joints.

    Args:
        tree: the links.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) symbols of velocities.
        A: (nv, nv) inertia matrix at q.
    """
    momentum = casadi.mtimes(A, v)
    direction = SX.sym("u", tree.nv)
    rate = position_rate(tree, q, direction)
    D = casadi.jacobian(casadi.jtimes(momentum, q, rate), direction)
    A_rate = casadi.jtimes(A, q, position_rate(tree, q, v))
    B = 0.5 * (A_rate + D - D.T)
    for link in tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            B[link.v, link.v] += _hamel(link.motion, momentum[link.v])
    return B


def _hamel(motion: Motion, momentum: SX) -> SX:
    """Return the skew-symmetric block of B of a quaternion joint, from its momentum p.

    Its product with the joint velocity is w x p, for a free joint (`motion`) also V x p.
    """
    if motion is Motion.SPHERICAL:
        return -skew(momentum)
    linear, angular = skew(momentum[0:3]), skew(momentum[3:6])
    return -casadi.vertcat(casadi.horzcat(SX.zeros(3, 3), linear), casadi.horzcat(linear, angular))
