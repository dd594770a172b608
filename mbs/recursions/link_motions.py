"""Motions of the links: poses, velocities and accelerations, link by link.

Source: Khalil & Kleinfinger 1986; Khalil & Creusot 1997, eq. 1 and 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.joints import Motion
from mbs.spatial import (
    Displacement,
    FreeDisplacement,
    MatrixRotation,
    Pose,
    Rotation,
    ScrewDisplacement,
    Wrench,
    axis_rotation,
    cross,
    formula,
    is_zero,
    origin,
    quaternion_rotation,
    transform_wrench_along,
    vector,
    zeros,
)


@dataclass(frozen=True, slots=True, eq=False)
class LinkPose:
    """Pose of frame j relative to its antecedent i, as displacements that are cheap to apply.

    Attributes:
        seat: displacements from frame i to the joint frame on link i (the seat), whose z axis is
            the axis of joint j.
        motion: displacements from the seat to frame j: rotation and translation of the joint.
        run: indices of the consecutive revolute joints with parallel axes that end with this
            joint. It holds j alone if the axis of the antecedent is not parallel.
        spin: rotation by the summed angles of the run.
    """

    seat: tuple[Displacement, ...]
    motion: tuple[Displacement, ...]
    run: tuple[int, ...]
    spin: Rotation

    @property
    def steps(self) -> tuple[Displacement, ...]:
        """Displacements from frame i to frame j: `seat`, then `motion`."""
        return self.seat + self.motion

    @property
    def foot(self) -> SX:
        """(3, 1) origin of the joint frame on link i, in frame i [m]."""
        return origin(self.seat)

    @property
    def p(self) -> SX:
        """(3, 1) origin of frame j in frame i [m]."""
        return origin(self.steps)

    @property
    def height(self) -> SX:
        """Distance from the joint frame on link i to frame j, along the axis of the joint [m]."""
        return origin(self.motion)[2]

    @property
    def matrix(self) -> SX:
        """(3, 3) orientation of frame j relative to frame i."""
        R = Pose.identity().R
        for step in self.steps:
            R = casadi.mtimes(R, step.rotation.matrix)
        return R

    def at_seat(self, vector: SX) -> SX:
        """Express a vector (3, 1) of frame i in the axes of the joint frame on link i."""
        for step in self.seat:
            vector = step.rotation.apply_inverse(vector)
        return vector

    def apply(self, vector: SX) -> SX:
        """Express a vector (3, 1) of frame j in the axes of frame i."""
        for step in reversed(self.steps):
            vector = step.rotation.apply(vector)
        return vector

    def apply_inverse(self, vector: SX) -> SX:
        """Express a vector (3, 1) of frame i in the axes of frame j."""
        for step in self.steps:
            vector = step.rotation.apply_inverse(vector)
        return vector

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Transform a wrench about the origin and in axes of frame j to frame i.

        Args:
            f: (3, 1) force [N].
            m: (3, 1) moment [N m].

        Returns:
            force and moment about the origin and in axes of frame i.
        """
        return transform_wrench_along(self.steps, f, m)

    def after(self, pose: Pose) -> Pose:
        """Return the pose of frame j relative to a third frame.

        Args:
            pose: pose of frame i relative to the third frame.
        """
        rows = pose.R.T
        for step in self.steps:
            rows = casadi.horzcat(*(step.rotation.apply_inverse(rows[:, k]) for k in range(3)))
        return Pose(rows.T, pose.p + casadi.mtimes(pose.R, self.p))


def link_poses(tree: Tree, q: SX) -> list[LinkPose]:
    """Return the pose of each link relative to its antecedent, by link.

    Args:
        tree: the links.
        q: (nq, 1) joint positions [rad or m], and quaternions.
    """
    poses: list[LinkPose] = []
    angles: list[SX] = []
    for j, link in enumerate(tree.links):
        i, at = link.antecedent, link.placement
        seat = _without_identities(
            *(screw for frame in link.via for screw in frame.fixed), *at.seat
        )
        angle = at.theta + q[link.q] if link.motion is Motion.REVOLUTE else at.theta
        run: tuple[int, ...] = (j,)
        if link.motion is Motion.REVOLUTE and i >= 0 and _is_parallel(tree.links[i], seat):
            run, angle = (*poses[i].run, j), angles[i] + angle
        angles.append(angle)
        seat, motion = _joint_displacements(link, seat, q[link.q])
        spin = axis_rotation("z", angle) if len(run) > 1 else motion[0].rotation
        poses.append(LinkPose(seat, motion, run, spin))
    return poses


def _is_parallel(before: Link, seat: tuple[ScrewDisplacement, ...]) -> bool:
    """Return whether joint `before` is revolute and parallel to the axis at the end of `seat`."""
    return before.motion is Motion.REVOLUTE and not any(_rotates(step) for step in seat)


def base_poses(tree: Tree, poses: list[LinkPose]) -> list[Pose]:
    """Return the pose of each link frame in the base frame, by link.

    Args:
        tree: the links.
        poses: pose of each link relative to its antecedent.
    """
    result: list[Pose] = []
    for link, pose in zip(tree.links, poses, strict=True):
        i = link.antecedent
        result.append(pose.after(result[i] if i >= 0 else Pose.identity()))
    return result


def _joint_displacements(
    link: Link, seat: tuple[ScrewDisplacement, ...], q: SX
) -> tuple[tuple[ScrewDisplacement, ...], tuple[Displacement, ...]]:
    """Return the displacements to the joint frame on the antecedent, and from there to the link.

    `seat` are the displacements to the joint axis, and `q` is the position of the joint.
    """
    at = link.placement
    match link.motion:
        case Motion.REVOLUTE:
            return seat, (ScrewDisplacement.about("z", at.theta + q, at.r),)
        case Motion.PRISMATIC:
            return seat, (ScrewDisplacement.about("z", at.theta, at.r + q),)
    return seat + _without_identities(ScrewDisplacement.about("z", at.theta, at.r)), (
        _free_displacement(link, q),
    )


def _free_displacement(link: Link, q: SX) -> FreeDisplacement:
    """Return the displacement of a spherical or free joint at q.

    Its inverse for a backward joint.
    """
    R = quaternion_rotation(q[link.motion.nq - 4 :])
    R = R.T if link.backward else R
    if link.motion is not Motion.FREE:
        return FreeDisplacement(MatrixRotation(R), zeros())
    return FreeDisplacement(
        MatrixRotation(R), -casadi.mtimes(R, q[0:3]) if link.backward else q[0:3]
    )


def _without_identities(*steps: ScrewDisplacement) -> tuple[ScrewDisplacement, ...]:
    """Return the steps that are not the constant identity."""
    return tuple(step for step in steps if _rotates(step) or not step.t.is_zero())


def _rotates(step: ScrewDisplacement) -> bool:
    """Return whether a step rotates. A tiny angle has a cosine of one and a nonzero sine."""
    return not (step.rotation.s.is_zero() and step.rotation.c.is_one())


# Motion subspaces of joints: velocities that a joint adds to its link, and efforts along them.
#
# The directions of a motion are constant in frame j. The directions of a backward motion are
# constant in its seat (the joint frame on the antecedent), which is frame_b of the joint; positive
# velocities move frame j opposite to them.


def motion_at_joint(link: Link, v: SX) -> tuple[SX, SX]:
    """Return the velocity of link j relative to its antecedent i, in axes of constant direction.

    The reference point and the axes belong to frame j or, for a backward joint, to the joint frame
    on link i.

    Args:
        link: link j with its joint.
        v: velocity of the joint, (nv, 1) for its nv velocities.

    Returns:
        linear and angular velocity, (3, 1) each.
    """
    match link.motion:
        case Motion.REVOLUTE:
            return zeros(), _along_z(v)
        case Motion.PRISMATIC:
            return _along_z(v), zeros()
    v = -v if link.backward else v
    return (zeros(), v) if link.motion is Motion.SPHERICAL else (v[0:3], v[3:6])


def _along_z(v: SX) -> SX:
    """Return the vector (3, 1) of length v along z."""
    column = zeros()
    column[2] = v
    return column


def effort_at_joint(link: Link, f: SX, m: SX) -> SX:
    """Return the joint effort of a wrench on link j.

    Args:
        link: link j with its joint.
        f: (3, 1) force, in the axes of `motion_at_joint`.
        m: (3, 1) moment about its reference point, in the same axes.
    """
    match link.motion:
        case Motion.REVOLUTE:
            return m[2]
        case Motion.PRISMATIC:
            return f[2]
    along = m if link.motion is Motion.SPHERICAL else casadi.vertcat(f, m)
    return -along if link.backward else along


def unit_motions_at_joint(link: Link) -> list[tuple[SX, SX]]:
    """Return the (linear, angular) velocity of `motion_at_joint` for each unit joint velocity.

    Args:
        link: link j with its joint.
    """
    identity = SX.eye(link.motion.nv)
    return [motion_at_joint(link, casadi.densify(identity[:, k])) for k in range(link.motion.nv)]


def motion_behind(link: Link, pose: LinkPose, v: SX) -> tuple[SX, SX]:
    """Return the velocity of link j relative to its antecedent, in the axes of frame j.

    Args:
        link: link j with its joint.
        pose: pose of the link relative to its antecedent.
        v: velocity of the joint, (nv, 1) for its nv velocities.

    Returns:
        linear velocity of the origin of frame j, and angular velocity, (3, 1) each.
    """
    return _at_link_frame(link, pose, motion_at_joint(link, v))


def unit_motions(link: Link, pose: LinkPose) -> list[tuple[SX, SX]]:
    """Return the (linear, angular) velocity of `motion_behind` for each unit joint velocity.

    Args:
        link: link j with its joint.
        pose: pose of the link relative to its antecedent.
    """
    return [_at_link_frame(link, pose, unit) for unit in unit_motions_at_joint(link)]


def _at_link_frame(link: Link, pose: LinkPose, velocity: tuple[SX, SX]) -> tuple[SX, SX]:
    """Transform a velocity of `motion_at_joint` to the origin and axes of frame j.

    `velocity` is (linear, angular); `pose` is the pose of `link` relative to its antecedent.
    """
    if not link.backward:
        return velocity
    linear, angular = velocity
    linear = linear + cross(angular, origin(pose.motion))
    turn = pose.motion[0].rotation
    return turn.apply_inverse(linear), turn.apply_inverse(angular)


def effort(link: Link, pose: LinkPose, f: SX, m: SX) -> SX:
    """Return the joint effort of a wrench on link j.

    Args:
        link: link j with its joint.
        pose: pose of the link relative to its antecedent.
        f: (3, 1) force, in axes of frame j [N].
        m: (3, 1) moment about the origin of frame j, in its axes [N m].
    """
    if link.backward:
        f, m = transform_wrench_along(pose.motion, f, m)
    return effort_at_joint(link, f, m)


@dataclass(frozen=True, slots=True, eq=False)
class Velocity:
    """Velocity of a link.

    Attributes:
        V: (3, 1) velocity of the origin of frame j, in frame j [m/s].
        w: (3, 1) angular velocity, in frame j [rad/s].
    """

    V: SX
    w: SX


def link_velocities(
    tree: Tree, poses: list[LinkPose], v: SX, base: Velocity | None = None
) -> list[Velocity]:
    """Return the velocity of each link in its frame.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
        base: velocity of the base; zero by default.
    """
    result: list[Velocity] = []
    for link, pose in zip(tree.links, poses, strict=True):
        i = link.antecedent
        before = result[i] if i >= 0 else (base or Velocity(zeros(), zeros()))
        linear, angular = motion_behind(link, pose, v[link.v])
        moved = before.V if is_zero(before.w) else before.V + cross(before.w, pose.p)
        result.append(
            Velocity(pose.apply_inverse(moved) + linear, pose.apply_inverse(before.w) + angular)
        )
    return result


# Matrix U of a rotating body and its moment, with the fewest products.
#
# Source: Balafoutis, Patel & Misra 1988 for the moment; Khalil & Creusot 1997, eq. 8-10.


@dataclass(frozen=True, slots=True, eq=False)
class RotationRate:
    """Gradient of the acceleration over a rotating body: U = skew(wd) + skew(w) skew(w).

    Attributes:
        U: (3, 3) gradient [rad/s^2].
        spread: differences U33 - U22, U11 - U33 and U22 - U11.
    """

    U: SX
    spread: tuple[SX, SX, SX]


def rotation_rate(w: SX, wd: SX, across: SX | None = None) -> RotationRate:
    """Return U = skew(wd) + skew(w) skew(w), with six products of angular velocities or five.

    Args:
        w: (3, 1) angular velocity.
        wd: (3, 1) angular acceleration.
        across: w[0]^2 + w[1]^2 if it is already known, which saves a product.
    """
    if across is None or w[0].is_zero() or w[1].is_zero():
        U, *spread = _rotation_rate(w, wd, SX(0), False)
    else:
        U, *spread = _rotation_rate(w, wd, across, True)
    return RotationRate(U, (spread[0], spread[1], spread[2]))


@formula((3, 1), (3, 1), (1, 1))
def _rotation_rate(w: SX, wd: SX, across: SX, known: bool) -> tuple[SX, SX, SX, SX]:
    """Return U = skew(wd) + skew(w) skew(w) (3, 3), and U33 - U22, U11 - U33 and U22 - U11.

    `w` and `wd` (3, 1) are angular velocity and acceleration. `across` is w[0]^2 + w[1]^2 if
    `known`, else it is computed.
    """
    x, y, z = w[0], w[1], w[2]
    xx, zz, xy, xz, yz = x * x, z * z, x * y, x * z, y * z
    xy_square = across if known else xx + y * y
    xz_square, xz_difference = xx + zz, xx - zz
    yz_square = xy_square - xz_difference
    U = casadi.vertcat(
        casadi.horzcat(-yz_square, xy - wd[2], xz + wd[1]),
        casadi.horzcat(xy + wd[2], -xz_square, yz - wd[0]),
        casadi.horzcat(xz - wd[1], yz + wd[0], -xy_square),
    )
    return U, xz_square - xy_square, xz_difference, yz_square - xz_square


def moment_of_rotation(S: SX, rate: RotationRate) -> SX:
    """Return the moment (3, 1) J wd + w x (J w), from the skew part of U S.

    Row x is (U S)_zy - (U S)_yz, the integral of y (U r)_z - z (U r)_y over the mass. It needs
    thirteen products if S[2, 2] is zero.

    Args:
        S: (3, 3) second moments of mass of the body.
        rate: rotation rate of the body.
    """
    pairs = [(rate.U[n, m], rate.U[m, n]) for m, n in ((1, 2), (2, 0), (0, 1))]
    signs = tuple(_sign_relation(a, b) for a, b in pairs)
    return _moment_of_rotation(S, rate.U, *rate.spread, signs)


@formula((3, 3), (3, 3), (1, 1), (1, 1), (1, 1))
def _moment_of_rotation(S: SX, U: SX, s_x: SX, s_y: SX, s_z: SX, signs: tuple[int, ...]) -> SX:
    """Return the moment (3, 1) J wd + w x (J w) of a body, see `moment_of_rotation`.

    `S` (3, 3) are its second moments of mass, `U` (3, 3) and s_x, s_y, s_z are `U` and `spread` of
    its `RotationRate`. For each row k with the next indices m, n, `signs` has the `_sign_relation`
    of U[n, m] and U[m, n].
    """
    rows = []
    for k, spread in enumerate((s_x, s_y, s_z)):
        m, n = (k + 1) % 3, (k + 2) % 3
        row = U[n, k] * S[k, m] - U[m, k] * S[k, n] + spread * S[m, n]
        rows.append(row + _difference(U[n, m], S[m, m], U[m, n], S[n, n], signs[k]))
    return casadi.vertcat(*rows)


def _sign_relation(a: SX, b: SX) -> int:
    """Return 1 if a = -b, -1 if a = b, else 0."""
    if SX.binary(casadi.OP_ADD, a, b).is_zero():
        return 1
    return -1 if SX.binary(casadi.OP_SUB, a, b).is_zero() else 0


def _difference(a: SX, first: SX, b: SX, second: SX, sign: int) -> SX:
    """Return ``a * first - b * second``, with one product if `sign` is 1 (a = -b) or -1 (a = b)."""
    if sign:
        return a * (first + second if sign > 0 else first - second)
    return a * first - b * second


# Accelerations of the links, each in its own frame.
#
# Source: Khalil & Creusot 1997, eq. 6 and 8-10.


@dataclass(frozen=True, slots=True, eq=False)
class Acceleration:
    """Angular velocity and accelerations of a link.

    Attributes:
        w: (3, 1) angular velocity in frame j [rad/s].
        wd: (3, 1) angular acceleration in frame j [rad/s^2].
        rate: rotation rate U in frame j.
        vd: (3, 1) acceleration of the origin of frame j, minus gravity, in frame j [m/s^2].
    """

    w: SX
    wd: SX
    rate: RotationRate
    vd: SX


def resting_base(gravity: SX) -> Acceleration:
    """Return the motion of a fixed base, whose acceleration is minus gravity.

    Args:
        gravity: (3, 1) gravity acceleration, in the base frame [m/s^2].
    """
    return moving_base(zeros(), zeros(), -gravity)


def moving_base(w: SX, wd: SX, vd: SX) -> Acceleration:
    """Return the motion of a moving base.

    Args:
        w: (3, 1) angular velocity, in the base frame [rad/s].
        wd: (3, 1) angular acceleration, in the base frame [rad/s^2].
        vd: (3, 1) acceleration of the origin minus gravity, in the base frame [m/s^2].
    """
    return Acceleration(w, wd, rotation_rate(w, wd), vd)


def link_accelerations(
    tree: Tree, poses: list[LinkPose], v: SX, a: SX, base: Acceleration
) -> list[Acceleration]:
    """Return the velocity and acceleration of each link in its frame.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base; see `resting_base`.
    """
    result: list[Acceleration] = []
    for j, link in enumerate(tree.links):
        pose = poses[j]
        before = result[link.antecedent] if link.antecedent >= 0 else base
        linear, angular = motion_behind(link, pose, v[link.v])
        linear_rate, _ = motion_behind(link, pose, a[link.v])
        w, wd, rate = _rotation(tree, poses, j, v, a, [*result, base])
        carried = before.vd + casadi.mtimes(before.rate.U, pose.p)
        vd = pose.apply_inverse(carried) + linear_rate
        vd += cross(2 * pose.apply_inverse(before.w) + angular, linear)
        result.append(Acceleration(w, wd, rate, vd))
    return result


def _rotation(
    tree: Tree, poses: list[LinkPose], j: int, v: SX, a: SX, motions: list[Acceleration]
) -> tuple[SX, SX, RotationRate]:
    """Return angular velocity, angular acceleration and rate U of link j.

    `motions` contains the previous links and, as its last element, the base.
    """
    link, pose = tree.links[j], poses[j]
    before = motions[link.antecedent]
    if link.motion.nv > 1:
        _, angular = motion_behind(link, pose, v[link.v])
        _, angular_rate = motion_behind(link, pose, a[link.v])
        w_i = pose.apply_inverse(before.w)
        w = w_i + angular
        wd = pose.apply_inverse(before.wd) + angular_rate + cross(w_i, angular)
        return w, wd, rotation_rate(w, wd)
    run = _parallel_run(tree, poses, j, motions)
    first = poses[run[0]]
    root = motions[tree.links[run[0]].antecedent]
    w_seat, wd_seat = first.at_seat(root.w), first.at_seat(root.wd)
    turn = pose.spin if len(run) > 1 else pose.motion[0].rotation
    speed, acceleration = SX(0), SX(0)
    if link.motion is Motion.REVOLUTE:
        for k in run:
            speed, acceleration = speed + v[tree.links[k].v], acceleration + a[tree.links[k].v]
    w = turn.apply_inverse(w_seat) + vector([0, 0, speed])
    wd = turn.apply_inverse(wd_seat) + vector([w[1] * speed, -w[0] * speed, acceleration])
    return w, wd, rotation_rate(w, wd, _square_across(before, pose))


def _parallel_run(
    tree: Tree, poses: list[LinkPose], j: int, motions: list[Acceleration]
) -> tuple[int, ...]:
    """Return the joints whose summed angles rotate the angular velocity of link j.

    A run of parallel axes is joined if the angular velocity has a zero x or y component before the
    run, which a rotation at each joint would lose. Otherwise the run is joint j alone.
    """
    run = poses[j].run
    w = poses[run[0]].at_seat(motions[tree.links[run[0]].antecedent].w)
    return run if w[0].is_zero() or w[1].is_zero() else (j,)


def _square_across(before: Acceleration, pose: LinkPose) -> SX | None:
    """Return the squared angular velocity normal to axis j if U of the antecedent i contains it.

    It is equal for both links of the joint. If axis j is parallel to coordinate axis k of frame i,
    it is -U_i[k, k]. Otherwise return None.
    """
    axis = vector([0, 0, 1])
    for step in reversed(pose.seat):
        axis = step.rotation.apply(axis)
    for k in range(3):
        if axis[(k + 1) % 3].is_zero() and axis[(k + 2) % 3].is_zero():
            return SX(-before.rate.U[k, k])
    return None
