"""Joint accelerations of a tree by the articulated-body algorithm, with O(n) operations.

An articulated body is a link with its descendants, whose joints are free to move. The recursion
from the leaves to the base solves A x = tau without forming the inertia matrix A.

Source: Featherstone 1983; Brandl, Johanni & Otter 1988; Khalil & Creusot 1997, section 5.4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.joints import Motion
from mbs.recursions.link_motions import Acceleration, LinkPose, link_accelerations
from mbs.recursions.newton_euler import inertial_wrench, rotor_efforts, rotor_moments
from mbs.recursions.regrouping import regroup, shift_frames
from mbs.spatial import (
    Displacement,
    Inertia,
    PseudoInertia,
    Rotation,
    Wrench,
    cross,
    formula,
    is_zero,
    skew,
    transform_inertia_along,
    transform_wrench_along,
    zeros,
)

# Inertia of an articulated body, and elimination of joints from it.
#
# The three 3 x 3 blocks are transformed by elementary screws. The row and the column of an
# eliminated joint are zero if the joint has no drive, and then cost no operations.
#
# Source: Featherstone 1983; Brandl, Johanni & Otter 1988; Khalil & Creusot 1997, section 5.4.


@dataclass(frozen=True, slots=True, eq=False)
class ArticulatedInertia:
    """Articulated inertia, which maps acceleration to wrench: f = M vd + H wd, m = H' vd + J wd.

    Attributes:
        M: (3, 3) symmetric translational block [kg].
        H: (3, 3) coupling block [kg m].
        J: (3, 3) symmetric rotational block [kg m^2].
    """

    M: SX
    H: SX
    J: SX

    @staticmethod
    def of(body: Inertia) -> ArticulatedInertia:
        """Return the articulated inertia of a single rigid body, in the same frame."""
        return ArticulatedInertia(
            casadi.densify(body.m * SX.eye(3)), casadi.densify(-skew(body.ms)), body.J
        )

    def __add__(self, other: ArticulatedInertia) -> ArticulatedInertia:
        """Add the inertia of a body that moves with this one, in the same frame."""
        return ArticulatedInertia(self.M + other.M, self.H + other.H, self.J + other.J)

    def rotate(self, R: Rotation) -> ArticulatedInertia:
        """Transform to axes with the same origin.

        R maps a vector from current axes to the new axes.
        """
        return ArticulatedInertia(
            R.apply_to_tensor(self.M), R.apply_to_square(self.H), R.apply_to_tensor(self.J)
        )

    def shift(self, axis: int, t: SX) -> ArticulatedInertia:
        """Return the inertia of the body displaced by t along an axis, about the same origin.

        The cost is ten products.

        Args:
            axis: index of the axis: 0, 1 or 2 for x, y or z.
            t: displacement [m].
        """
        if t.is_zero():
            return self
        return ArticulatedInertia(self.M, *_translated(self.M, self.H, self.J, t, axis))

    def column(self, direction: int) -> SX:
        """Return the wrench (6, 1), force then moment, of a unit acceleration in one direction.

        Args:
            direction: index of the direction in a twist [linear; angular], 0 to 5.
        """
        if direction < 3:
            return casadi.vertcat(self.M[:, direction], self.H[direction, :].T)
        return casadi.vertcat(self.H[:, direction - 3], self.J[:, direction - 3])

    def without(self, pivot: Pivot) -> ArticulatedInertia:
        """Return the articulated inertia after the joint velocity of `pivot` is eliminated.

        The body then resists motion along this direction by the inertia of the drive only.
        """
        felt = _eliminated(
            self.M, self.H, self.J, pivot.column, pivot.gain, pivot.rest, pivot.direction
        )
        return ArticulatedInertia(*felt)


@formula((3, 3), (3, 3), (3, 3), (1, 1))
def _translated(M: SX, old: SX, tensor: SX, t: SX, axis: int) -> tuple[SX, SX]:
    """Return the blocks H and J of an articulated inertia whose body is displaced along an axis.

    `M`, `old` and `tensor` (3, 3) are the present blocks M, H and J of `ArticulatedInertia`. The
    displacement is t [m] along the axis 0, 1 or 2.
    """
    k, h = (axis + 1) % 3, (axis + 2) % 3
    H, J = SX(old), SX(tensor)
    H[:, k] -= t * M[:, h]
    H[:, h] += t * M[:, k]
    J[k, k] -= t * (old[h, k] + H[h, k])
    J[h, h] += t * (old[k, h] + H[k, h])
    J[k, h] += t * (old[k, k] - H[h, h])
    J[k, axis] -= t * old[h, axis]
    J[h, axis] += t * old[k, axis]
    J[h, k], J[axis, k], J[axis, h] = J[k, h], J[k, axis], J[h, axis]
    return H, J


@formula((3, 3), (3, 3), (3, 3), (6, 1), (6, 1), (6, 1))
def _eliminated(
    M: SX, H: SX, J: SX, column: SX, g: SX, own: SX, direction: int
) -> tuple[SX, SX, SX]:
    """Return the blocks M, H and J (3, 3) of an articulated inertia without one joint velocity.

    The velocity has the index `direction` (0 to 5) in a twist. `column`, `g` and `own` (6, 1) are
    `column`, `gain` and `rest` of the `Pivot` that eliminates it.
    """
    k, u = direction % 3, SX(column)
    u[direction] = 0
    M, H, J = (
        M + _symmetric_product(g[:3], u[:3]),
        H + casadi.mtimes(g[:3], u[3:].T),
        J + _symmetric_product(g[3:], u[3:]),
    )
    if direction < 3:
        M[k, :], M[:, k], H[k, :] = own[:3].T, own[:3], own[3:].T
    else:
        J[k, :], J[:, k], H[:, k] = own[3:].T, own[3:], own[:3]
    return M, H, J


@dataclass(frozen=True, slots=True, eq=False)
class RotorDrive:
    """Inertia of the drive of a joint: Ia and the rotor that rotates with the joint.

    Attributes:
        inertia: part of the inertia D of the joint that the column of its pivot does not contain.
        momentum: (3, 1) angular momentum of the rotor for a unit joint velocity, in the frame of
            the pivot. It also acts on the links.
    """

    inertia: SX
    momentum: SX


@dataclass(frozen=True, slots=True, eq=False)
class Pivot:
    """Elimination of one joint velocity from the equations of motion.

    Attributes:
        direction: index (0 to 5) of the velocity in a twist [linear; angular].
        column: (6, 1) wrench of a unit acceleration, with the momentum of the rotor but without
            the inertia that only the joint has (`RotorDrive.inertia`).
        rest: (6, 1) column of the body after the elimination. Zero without a drive.
        size: inertia D, the effort of a unit acceleration.
        inverse: -1 / D. The minus sign prevents CasADi from rewriting products as divisions.
        gain: (6, 1) -column / D, with a zero at `direction`.
        ratio: fraction of D due to the inertia of the drive.
    """

    direction: int
    column: SX
    rest: SX
    size: SX
    inverse: SX
    gain: SX
    ratio: SX

    @staticmethod
    def of(body: ArticulatedInertia, direction: int, drive: RotorDrive) -> Pivot:
        """Return the pivot that eliminates one velocity of the joint of a body.

        Args:
            body: articulated inertia of the link after the joint, in the frame of the joint.
            direction: index of the velocity in a twist [linear; angular], 0 to 5.
            drive: inertia of the drive of the joint.
        """
        column = body.column(direction)
        return Pivot(direction, *_pivot(column, drive.inertia, drive.momentum, direction))

    def transmit(self, wrench: SX, effort: SX) -> tuple[SX, SX]:
        """Return the wrench that passes the joint, and the effort left to accelerate it.

        Args:
            wrench: (6, 1) wrench that the body needs at zero joint acceleration.
            effort: joint effort.

        Returns:
            wrench (6, 1) on the antecedent, and effort left to accelerate the joint.
        """
        return _transmitted(wrench, effort, self.gain, self.ratio, self.direction)

    def accelerate(self, twist: SX, left: SX) -> tuple[SX, SX]:
        """Return the acceleration (6, 1) of the link after the joint, and the joint acceleration.

        Args:
            twist: (6, 1) acceleration before the joint.
            left: effort left to accelerate the joint, from `transmit`.
        """
        return _accelerated(twist, left, self.gain, self.inverse, self.ratio, self.direction)


@formula((6, 1), (1, 1), (3, 1))
def _pivot(column: SX, inertia: SX, momentum: SX, direction: int) -> tuple[SX, SX, SX, SX, SX, SX]:
    """Return column, rest, size, inverse, gain and ratio, the fields of `Pivot`.

    `column` (6, 1) is the wrench of the body for a unit acceleration in the joint direction of
    index `direction`; `inertia` and `momentum` are those of the `RotorDrive` of the joint.
    """
    column = SX(column)
    column[3:] += momentum
    D = column[direction] + inertia
    inverse = -1 / D
    ratio = -inertia * inverse
    gain, rest = column * inverse, column * ratio
    gain[direction] = 0
    rest[3:] -= momentum
    return column, rest, D, inverse, gain, ratio


@formula((6, 1), (1, 1), (6, 1), (1, 1))
def _transmitted(wrench: SX, effort: SX, gain: SX, ratio: SX, direction: int) -> tuple[SX, SX]:
    """Return the wrench (6, 1) on the antecedent, and the effort left to accelerate the joint.

    `wrench` (6, 1) is what the body needs at zero joint acceleration, and `effort` is the joint
    effort. `gain`, `ratio` and `direction` are those of the `Pivot` of the joint.
    """
    left = effort - wrench[direction]
    wrench = wrench - gain * left
    wrench[direction] = effort - ratio * left
    return wrench, left


@formula((6, 1), (1, 1), (6, 1), (1, 1), (1, 1))
def _accelerated(
    twist: SX, left: SX, gain: SX, inverse: SX, ratio: SX, direction: int
) -> tuple[SX, SX]:
    """Return the acceleration (6, 1) of the link after a joint, and the joint acceleration.

    `twist` (6, 1) is the acceleration before the joint and `left` the second result of
    `_transmitted`. `gain`, `inverse`, `ratio` and `direction` are those of the `Pivot` of the
    joint.
    """
    before = twist[direction]
    own = casadi.dot(gain, twist) - inverse * left + ratio * before
    twist = SX(twist)
    twist[direction] = own
    return twist, own - before


def _symmetric_product(a: SX, b: SX) -> SX:
    """Return the outer product a b' (3, 3) of (3, 1) vectors, which must be symmetric.

    Six multiplications are needed.
    """
    product = zeros(3, 3)
    for row in range(3):
        for column in range(row, 3):
            product[row, column] = product[column, row] = a[row] * b[column]
    return product


_DIRECTIONS = {
    Motion.REVOLUTE: (5,),
    Motion.PRISMATIC: (2,),
    Motion.SPHERICAL: (3, 4, 5),
    Motion.FREE: (0, 1, 2, 3, 4, 5),
}
"""Index of each joint velocity in a twist [linear; angular], in the frame in which the directions
of the joint are constant."""


@dataclass(frozen=True, slots=True, eq=False)
class JointElimination:
    """Elimination of all velocities of a joint, in the frame with the fewest operations.

    Attributes:
        inner: displacements from that frame to the frame of the link.
        outer: displacements from the frame of the antecedent to that frame.
        pivots: eliminated velocities, in the order of elimination.
        sign: -1 if positive velocities move the link against the directions of the pivots.
    """

    inner: tuple[Displacement, ...]
    outer: tuple[Displacement, ...]
    pivots: tuple[Pivot, ...]
    sign: int


def solve_inertia(tree: Tree, poses: list[LinkPose], right: SX) -> SX:
    """Solve A x = right for x (nv, m), without forming the inertia matrix A.

    Args:
        tree: links, rotors included.
        poses: pose of each link relative to its antecedent.
        right: (nv, m) right-hand sides, such as joint efforts.

    Returns:
        x (nv, m), such as joint accelerations due to efforts at rest without gravity.
    """
    poses, bodies = shift_frames(tree, poses, [link.inertia for link in tree.links])
    eliminations = _eliminations(tree, poses, bodies)
    rest = [zeros(6)] * len(tree.links)
    columns = (_solution(tree, eliminations, rest, right[:, k]) for k in range(right.shape[1]))
    return casadi.horzcat(*columns) if right.shape[1] else SX(tree.nv, 0)


def articulated_accelerations(
    tree: Tree,
    poses: list[LinkPose],
    v: SX,
    efforts: SX,
    base: Acceleration,
    external: Mapping[int, Wrench],
) -> SX:
    """Return the joint accelerations (nv, 1) due to joint efforts: forward dynamics of a tree.

    The wrenches of the motion with zero joint accelerations are computed first. The efforts that do
    not balance them accelerate the articulated bodies. Joint friction and springs of the tree are
    not included.

    Args:
        tree: links, rotors included.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
        efforts: (nv, 1) joint efforts, without friction and spring efforts.
        base: motion of the base, see `resting_base`.
        external: wrench that a link exerts on its environment, by link index.
    """
    inertias = [link.inertia for link in tree.links]
    if not external:
        poses, inertias = shift_frames(tree, poses, inertias, base_rests=is_zero(base.w))
    bodies = [PseudoInertia.of(inertia) for inertia in inertias]
    still = SX.zeros(tree.nv)
    motions = link_accelerations(tree, poses, v, still, base)
    wrenches = [
        casadi.vertcat(*inertial_wrench(body, motion))
        for body, motion in zip(regroup(tree, poses, bodies), motions, strict=True)
    ]
    for j, wrench in external.items():
        wrenches[j] += casadi.vertcat(*wrench)
    for carrier, moment in rotor_moments(tree, v, still, motions).items():
        wrenches[carrier] += casadi.vertcat(zeros(), moment)
    left = efforts - rotor_efforts(tree, still, motions, base)
    return _solution(tree, _eliminations(tree, poses, inertias), wrenches, left)


def inertia_pivots(tree: Tree, poses: list[LinkPose]) -> tuple[SX, SX]:
    """Return two inertias (nv, 1) of each joint velocity, with free and with locked descendants.

    The first is the effort for a unit acceleration if the joints of descendants move freely, the
    second if they are locked. If the first is negligible relative to the second, the inertia matrix
    is singular.

    Args:
        tree: links, rotors included.
        poses: pose of each link relative to its antecedent.
    """
    poses, bodies = shift_frames(tree, poses, [link.inertia for link in tree.links])
    rigid = regroup(tree, poses, bodies)
    free, locked = zeros(tree.nv), zeros(tree.nv)
    for link, elimination in zip(tree.links, _eliminations(tree, poses, bodies), strict=True):
        free[link.v] = casadi.vertcat(*(pivot.size for pivot in elimination.pivots))
    for j in reversed(range(len(tree.links))):
        link, body = tree.links[j], rigid[j]
        whole, drive = ArticulatedInertia.of(body), _rotor_drive(tree, poses, j)
        for number, direction in zip(
            _velocity_indices(link), _DIRECTIONS[link.motion], strict=True
        ):
            locked[number] = Pivot.of(whole, direction, drive).size
        if link.antecedent >= 0:
            rigid[link.antecedent] += transform_inertia_along(poses[j].steps, body)
    return free, locked


def _velocity_indices(link: Link) -> range:
    """Return the indices in v of the velocities of the joint of a link."""
    return range(link.v.start, link.v.stop)


def _eliminations(
    tree: Tree, poses: list[LinkPose], bodies: Sequence[Inertia]
) -> list[JointElimination]:
    """Return the elimination of the velocities of each joint, by link.

    `bodies` are the inertias of the links. Eliminations are computed from the leaves to the base.
    """
    rigid = regroup(tree, poses, list(bodies))
    articulated = [ArticulatedInertia.of(body) for body in rigid]
    leaves = set(range(len(tree.links))) - {link.antecedent for link in tree.links}
    result: list[JointElimination] = []
    for j in reversed(range(len(tree.links))):
        link, pose = tree.links[j], poses[j]
        inner: tuple[Displacement, ...] = ()
        outer, body = pose.steps, articulated[j]
        if link.backward:
            inner, outer = pose.motion, pose.seat
            body = transform_inertia_along(inner, body)
        elif j in leaves and link.motion.nv == 1:
            inner, outer = pose.motion, pose.seat
            body = ArticulatedInertia.of(pose.motion[0].body(rigid[j]))
        drive, pivots = _rotor_drive(tree, poses, j), list[Pivot]()
        if inner:
            drive = replace(drive, momentum=inner[0].rotation.apply(drive.momentum))
        for direction in _DIRECTIONS[link.motion]:
            pivots.append(Pivot.of(body, direction, drive))
            body = body.without(pivots[-1])
        result.append(JointElimination(inner, outer, tuple(pivots), -1 if link.backward else 1))
        if link.antecedent >= 0:
            articulated[link.antecedent] += transform_inertia_along(outer, body)
    return result[::-1]


def _rotor_drive(tree: Tree, poses: list[LinkPose], j: int) -> RotorDrive:
    """Return the inertia of the motor and rotor of joint j, in the frame of link j."""
    link = tree.links[j]
    if link.rotor is None:
        return RotorDrive(link.Ia, zeros())
    on_link = link.rotor.carrier == j
    momentum = link.rotor.momentum if on_link else poses[j].apply_inverse(link.rotor.momentum)
    along = momentum[2] if link.motion is Motion.REVOLUTE else SX(0)
    inertia = link.Ia + link.rotor.seen_at_joint + (along if on_link else -along)
    return RotorDrive(inertia, momentum)


def _solution(
    tree: Tree, joints: list[JointElimination], wrenches: Sequence[SX], efforts: SX
) -> SX:
    """Return joint accelerations (nv, 1) for joint efforts (nv, 1).

    Args:
        tree: links of the mechanism.
        joints: eliminations of the joints, by link.
        wrenches: (6, 1) wrench that each link needs at zero joint accelerations.
        efforts: (nv, 1) joint efforts.
    """
    needed, left = list(wrenches), zeros(tree.nv)
    for j in reversed(range(len(tree.links))):
        link, joint = tree.links[j], joints[j]
        wrench = _moved_wrench(joint.inner, needed[j])
        for number, pivot in zip(_velocity_indices(link), joint.pivots, strict=True):
            wrench, left[number] = pivot.transmit(wrench, joint.sign * efforts[number])
        if link.antecedent >= 0:
            needed[link.antecedent] += _moved_wrench(joint.outer, wrench)
    x, twists = zeros(tree.nv), [zeros(6)] * (len(tree.links) + 1)
    for j, link in enumerate(tree.links):
        twist = _moved_twist(joints[j].outer, twists[link.antecedent])
        for number, pivot in reversed(
            list(zip(_velocity_indices(link), joints[j].pivots, strict=True))
        ):
            twist, own = pivot.accelerate(twist, left[number])
            x[number] = joints[j].sign * own
        twists[j] = _moved_twist(joints[j].inner, twist)
    return x


def _moved_wrench(steps: Sequence[Displacement], wrench: SX) -> SX:
    """Transform a wrench (6, 1) from the frame after displacements to the frame before them.

    `steps` are the displacements, in order.
    """
    return casadi.vertcat(*transform_wrench_along(steps, wrench[:3], wrench[3:]))


def _moved_twist(steps: Sequence[Displacement], twist: SX) -> SX:
    """Transform a twist (6, 1) from the frame before displacements to the frame after them.

    `steps` are the displacements, in order.
    """
    v, w = twist[:3], twist[3:]
    for step in steps:
        p = step.point(zeros())
        v, w = step.rotation.apply_inverse(v + cross(w, p)), step.rotation.apply_inverse(w)
    return casadi.vertcat(v, w)
