"""Derivatives of the inverse dynamics by recursions over the tree.

Source: Singh, Russell & Wensing 2022; Carpentier & Mansard 2018.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import casadi
from casadi import SX

from mbs.assembly.tree import CarriedRotor, Tree
from mbs.recursions.joint_axes import AxesStep, JointAxes, Line, MovingFrame, Twist, joint_axes
from mbs.recursions.link_motions import Acceleration, LinkPose, link_accelerations
from mbs.recursions.newton_euler import inertial_wrench, rotor_efforts, rotor_moments, spin_momenta
from mbs.recursions.regrouping import regroup, shift_frames
from mbs.spatial import (
    FreeDisplacement,
    Inertia,
    MatrixRotation,
    PseudoInertia,
    Rotation,
    ScrewDisplacement,
    Wrench,
    add_wrenches,
    cross,
    is_zero,
    skew,
    zeros,
)

# Composite quantities of the subtree of a joint: inertia, Coriolis terms and required wrench.
#
# Source: Khalil, Bennis & Gautier 1990 (composite links); Singh, Russell & Wensing 2022 (their
# composite matrix B, which has twelve numbers for an observer at rest or in steady motion).


@dataclass(frozen=True, slots=True, eq=False)
class SubtreeMotion:
    """Composite inertia, Coriolis terms and wrench of a subtree, about a point.

    Velocities are relative to an observer that moves with the point. With position r and velocity
    r_dot of a mass element dm, N = integral of r_dot r' dm.

    Attributes:
        body: composite inertia.
        K: (3, 3) 2 (tr(N) - N): K w is the Coriolis moment of an additional angular velocity w of
            the whole subtree [kg m^2/s].
        n: (3, 1) twice the linear momentum [kg m/s].
        f: (3, 1) force required by the motion [N].
        m: (3, 1) moment required by the motion [N m].
    """

    body: Inertia
    K: SX
    n: SX
    f: SX
    m: SX

    @staticmethod
    def zero() -> SubtreeMotion:
        """Return the quantities of no link: zeros."""
        return SubtreeMotion(Inertia.zero(), zeros(3, 3), zeros(), zeros(), zeros())

    @staticmethod
    def of_link(pseudo: PseudoInertia, motion: Acceleration, spin: SX, moment: SX) -> SubtreeMotion:
        """Return the quantities of a single link, for an observer at the origin of its frame.

        Args:
            pseudo: inertia of the link, about and in its frame.
            motion: motion of the link.
            spin: (3, 1) angular momentum of the rotors on the link relative to it, in its frame.
            moment: (3, 1) moment that the link exerts on these rotors, in its frame.
        """
        twice = 2 * motion.w
        f, m = inertial_wrench(pseudo, motion)
        return SubtreeMotion(
            pseudo.inertia(),
            -casadi.mtimes(skew(twice), pseudo.S) - skew(spin),
            cross(twice, pseudo.ms),
            f,
            m + moment,
        )

    def __add__(self, other: SubtreeMotion) -> SubtreeMotion:
        """Add the value of other links, about the same point."""
        return SubtreeMotion(
            self.body + other.body,
            self.K + other.K,
            self.n + other.n,
            self.f + other.f,
            self.m + other.m,
        )

    def rotate(self, R: Rotation) -> SubtreeMotion:
        """Transform to axes with the same origin.

        R maps a vector from current axes to the new axes.
        """
        f, m = R.apply(self.f), R.apply(self.m)
        return SubtreeMotion(self.body.rotate(R), R.apply_to_square(self.K), R.apply(self.n), f, m)

    def shift(self, axis: int, t: SX) -> SubtreeMotion:
        """Transform to the frame in which the current origin is at t [m] on the axis 0, 1 or 2."""
        if t.is_zero():
            return self
        K, m = SX(self.K), SX(self.m)
        k, h = (axis + 1) % 3, (axis + 2) % 3
        across = t * self.n[axis]
        for row in (k, h):
            K[row, row] += across
            K[row, axis] -= t * self.n[row]
        m[k] -= t * self.f[h]
        m[h] += t * self.f[k]
        return SubtreeMotion(self.body.shift(axis, t), K, self.n, self.f, m)

    def drifting(self, twice: SX) -> SubtreeMotion:
        """Transform to an observer that moves differently, in place of the present observer.

        Args:
            twice: (3, 1) twice the velocity by which all velocities become larger [m/s].
        """
        ms, K = self.body.ms, SX(self.K)
        for k in range(3):
            for h in {0, 1, 2} - {k}:
                K[k, k] += twice[h] * ms[h]
                K[k, h] -= twice[k] * ms[h]
        return SubtreeMotion(self.body, K, self.n + self.body.m * twice, self.f, self.m)

    def through(self, step: AxesStep) -> SubtreeMotion:
        """Transform along one step (displacement or change of observer) between joint axes."""
        if isinstance(step, MovingFrame):
            return self.drifting(step.twice)
        return step.body(self)

    def wrench_of(self, twist: Twist) -> Wrench:
        """Return the momentum of the subtree if it moves as one body with the velocity `twist`.

        It is the wrench if `twist` is an acceleration.
        """
        return self.body.momentum(twist.linear, twist.angular)

    def wrench_of_spin(self, s: SX) -> Wrench:
        """Return the change of the wrench by an angular velocity s (3, 1) added to the subtree."""
        return cross(s, self.n), casadi.mtimes(self.K, s)

    def wrench_of_displacement(self, unit: Twist) -> Wrench:
        """Return the derivative of the wrench by a displacement of the subtree along `unit`."""
        t, s = unit.linear, unit.angular
        return cross(s, self.f), cross(s, self.m) + cross(t, self.f)

    def spin_of(self, unit: Twist) -> SX:
        """Return the gradient (3, 1) of the effort along `unit`.

        It is the gradient by an angular velocity that is added to the whole subtree.
        """
        return casadi.mtimes(self.K.T, unit.angular) + cross(self.n, unit.linear)


def subtree_motions(
    tree: Tree, axes: list[JointAxes], own: list[SubtreeMotion]
) -> list[SubtreeMotion]:
    """Return the quantities of the subtree of each joint (link and descendants), in the joint axes.

    Args:
        tree: links of the tree.
        axes: axes of the joints.
        own: quantities of each link alone, in its frame.
    """
    in_frame, parallel = list(own), [SubtreeMotion.zero()] * len(own)
    result = list(own)
    for j in reversed(range(len(own))):
        turn, i = axes[j].rotation, tree.links[j].antecedent
        here = in_frame[j] if turn is None else in_frame[j].rotate(turn)
        here = result[j] = here + parallel[j]
        if i < 0:
            continue
        for step in axes[j].path:
            here = here.through(step)
        if axes[j].parallel:
            parallel[i] += here
        else:
            in_frame[i] += here
    return result


# Change of the subtree wrench by one joint, passed to all joints between it and the base.
#
# Source: Singh, Russell & Wensing 2022.


@dataclass(frozen=True, slots=True, eq=False)
class RotorMoment:
    """Derivatives of the moment that a carrier link exerts on a joint-driven rotor, (3, 1) each.

    Attributes:
        dv: derivative with respect to the velocity of the joint.
        da: derivative with respect to the acceleration of the joint.
    """

    dv: SX
    da: SX

    def rotate(self, R: Rotation) -> RotorMoment:
        """Transform to other axes; R maps a vector from current axes to the new axes."""
        return RotorMoment(R.apply(self.dv), R.apply(self.da))


@dataclass(frozen=True, slots=True, eq=False)
class EffortColumn:
    """Derivatives of a subtree wrench by its joint, and of the joint effort by other joints.

    Attributes:
        dq: derivative of the wrench with respect to the position of the joint.
        dv: derivative of the wrench with respect to the velocity of the joint.
        momentum: derivative of the wrench with respect to the acceleration of the joint. Its power
            along an acceleration of the whole subtree is the effort of the joint.
        spin: (3, 1) gradient of the joint effort by an additional angular velocity of the subtree.
    """

    dq: Wrench
    dv: Wrench
    momentum: Wrench
    spin: SX

    def through(self, step: AxesStep) -> EffortColumn:
        """Transform along one step (displacement or change of observer) between joint axes."""
        if isinstance(step, MovingFrame):
            return self.drifting(step.twice)
        return EffortColumn(
            step.wrench(*self.dq),
            step.wrench(*self.dv),
            step.wrench(*self.momentum),
            step.rotation.apply(self.spin),
        )

    def rotate(self, R: Rotation) -> EffortColumn:
        """Transform to axes with the same origin.

        R maps a vector from current axes to the new axes.
        """
        dq, dv, momentum = ((R.apply(f), R.apply(m)) for f, m in (self.dq, self.dv, self.momentum))
        return EffortColumn(dq, dv, momentum, R.apply(self.spin))

    def drifting(self, twice: SX) -> EffortColumn:
        """Transform to an observer that moves differently, in place of the present observer.

        Args:
            twice: (3, 1) twice the velocity by which all velocities become larger [m/s].
        """
        spin = self.spin + cross(twice, self.momentum[0])
        return EffortColumn(self.dq, self.dv, self.momentum, spin)

    def with_couple(self, couple: RotorMoment) -> EffortColumn:
        """Return the derivatives with the moment of a rotor that rotates with the joint.

        Args:
            couple: derivatives of this moment, in the same axes.
        """
        (f_v, m_v), (f_a, m_a) = self.dv, self.momentum
        return EffortColumn(
            self.dq, (f_v, m_v + couple.dv), (f_a, m_a + couple.da), self.spin + couple.dv
        )

    def row(self, line: Line) -> tuple[SX, SX, SX]:
        """Return the derivatives of the effort of this joint by the motion of another joint.

        Args:
            line: unit motion of the other joint, in the same axes.

        Returns:
            derivatives by position, velocity and acceleration of the other joint.
        """
        return (
            line.second.power(*self.momentum) + casadi.dot(self.spin, line.spin),
            line.faster.power(*self.momentum) + casadi.dot(self.spin, line.unit.angular),
            line.unit.power(*self.momentum),
        )

    def efforts(self, line: Line) -> tuple[SX, SX, SX]:
        """Return the derivatives of the effort of another joint by the motion of this joint.

        Args:
            line: unit motion of the other joint, in the same axes.

        Returns:
            derivatives by position, velocity and acceleration of this joint.
        """
        unit = line.unit
        return unit.power(*self.dq), unit.power(*self.dv), unit.power(*self.momentum)


def effort_column(subtree: SubtreeMotion, line: Line) -> EffortColumn:
    """Return the derivatives of the wrench of a subtree by the joint that moves it.

    Args:
        subtree: quantities of the subtree, in the joint axes.
        line: unit motion of the joint, in the joint axes.
    """
    spinning = add_wrenches(subtree.wrench_of(line.second), subtree.wrench_of_spin(line.spin))
    return EffortColumn(
        dq=add_wrenches(spinning, subtree.wrench_of_displacement(line.unit)),
        dv=add_wrenches(subtree.wrench_of(line.faster), subtree.wrench_of_spin(line.unit.angular)),
        momentum=subtree.wrench_of(line.unit),
        spin=subtree.spin_of(line.unit),
    )


def rotor_couple(rotor: CarriedRotor, axes: JointAxes) -> RotorMoment:
    """Return the derivatives of the moment on a rotor by velocity and acceleration of its joint.

    Args:
        rotor: rotor that is driven by the joint.
        axes: joint axes of the link that the rotor is mounted on; the result is in these axes.
    """
    momentum = rotor.momentum if axes.rotation is None else axes.rotation.apply(rotor.momentum)
    return RotorMoment(cross(axes.w, momentum), momentum)


# Selection of columns that need fewer operations in base axes than in the axes of all joints.


_TURN, _SLIDE, _DRIFT, _PAIR = 42, 12, 12, 17
"""Numbers of operations to rotate, translate or change the observer of a column on the path
through joint axes, and to evaluate a pair of joints there."""

_BASE_PAIR, _BASE_COLUMN, _BASE_LINE = 67, 130, 150
"""Numbers of operations in base axes: to evaluate a pair of joints, to transform a column and to
transform a line to the base."""


def links_by_base(tree: Tree, axes: list[JointAxes]) -> set[int]:
    """Return the links whose derivative columns need fewer operations in base axes.

    Empty if the total saving does not pay for the base axes. In base axes a pair of joints has a
    constant cost. On the path through joint axes the cost grows with the distance of the joints,
    and is reduced by right angles and zero distances.

    Args:
        tree: the links.
        axes: axes of the joints, by link.
    """
    saved: dict[int, int] = {}
    for j, link in enumerate(tree.links):
        path = tree.path(j)
        pairs = sum(tree.links[i].motion.nv for i in path[:-1])
        walk = sum(_step_cost(step) for i in path[1:] for step in axes[i].path)
        turns = sum(
            axes[i].rotation is not None and not axes[k].parallel for i, k in pairwise(path)
        )
        saving = walk + _TURN * turns - (_BASE_PAIR - _PAIR) * pairs - _BASE_COLUMN
        if saving > 0:
            saved[j] = saving * link.motion.nv
    return set(saved) if sum(saved.values()) > _BASE_LINE * tree.nv else set()


def _step_cost(step: AxesStep) -> int:
    """Return the number of operations that transform a derivative column along a step."""
    match step:
        case MovingFrame():
            return _DRIFT
        case ScrewDisplacement():
            quarter = step.rotation.c.is_zero() or step.rotation.s.is_zero()
            return _TURN * (not quarter) + _SLIDE * (not step.t.is_zero())
    return 3 * (_TURN + _SLIDE)


# Joint axes and unit motions in the base frame, in which all pairs of joints meet directly.
#
# Source: Singh, Russell & Wensing 2022 (all vectors in the ground frame).


@dataclass(frozen=True, slots=True, eq=False)
class BaseAxes:
    """Axes of a joint relative to the base.

    Attributes:
        place: displacement from the base to the joint axes.
        twice: (3, 1) twice the velocity of their origin, in the base [m/s].
        lines: unit motions and rates of the joint, about the origin of the base, for an observer at
            rest.
    """

    place: FreeDisplacement
    twice: SX
    lines: tuple[Line, ...]


def base_axes(tree: Tree, axes: list[JointAxes]) -> list[BaseAxes]:
    """Return the axes of all joints relative to the base, by link.

    Args:
        tree: links of the tree.
        axes: axes of each joint, relative to the axes of its antecedent.
    """
    result: list[BaseAxes] = []
    for link, own in zip(tree.links, axes, strict=True):
        i = link.antecedent
        R, p, twice = SX.eye(3), zeros(), zeros()
        if i >= 0:
            R, p, twice = result[i].place.rotation.matrix, result[i].place.p, result[i].twice
            turn = axes[i].rotation
            if turn is not None and not own.parallel:
                R = _rotate(R, turn)
        for step in reversed(own.path):
            R, p, twice = _axes_after(step, R, p, twice)
        place = FreeDisplacement(MatrixRotation(R), p)
        lines = (line.displaced(R, p).drifting(twice) for line in own.lines)
        result.append(BaseAxes(place, twice, tuple(lines)))
    return result


def _axes_after(step: AxesStep, R: SX, p: SX, twice: SX) -> tuple[SX, SX, SX]:
    """Return orientation, origin and doubled velocity, in the base, of the axes after a step.

    `R` (3, 3), `p` (3, 1) and `twice` (3, 1) are those of the axes before the step.
    """
    if isinstance(step, MovingFrame):
        return R, p, twice + casadi.mtimes(R, step.twice)
    p = p + casadi.mtimes(R, step.point(zeros()))
    return _rotate(R, step.rotation), p, twice


def _rotate(R: SX, turn: Rotation) -> SX:
    """Return R times the matrix of the rotation `turn`, (3, 3)."""
    return casadi.horzcat(*(turn.apply_inverse(R[k, :].T) for k in range(3))).T


Passage = tuple[int, tuple[Line, ...], EffortColumn]
"""Index of a link on the path of a column to the base, unit motions of its joint, and the column in
the same axes."""


@dataclass(frozen=True, slots=True, eq=False)
class EffortDerivatives:
    """Joint efforts, without drives, friction and springs, and their derivatives.

    Attributes:
        dq: (nv, nv) derivative along joint velocities: column k is the rate of the efforts if the
            positions move with unit velocity k while v and a are constant.
        dv: (nv, nv) derivative with respect to velocities.
        A: (nv, nv) derivative with respect to accelerations: the inertia matrix.
        efforts: (nv, 1) joint efforts.
    """

    dq: SX
    dv: SX
    A: SX
    efforts: SX


def newton_euler_derivatives(
    tree: Tree, poses: list[LinkPose], v: SX, a: SX, base: Acceleration
) -> EffortDerivatives:
    """Return the derivatives of the joint efforts of `newton_euler`.

    A backward pass computes composite inertia, Coriolis terms and wrench of each subtree. For each
    joint they determine the derivatives of the subtree wrench by its position, velocity and
    acceleration. These are passed to the base and projected on each joint on the path.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base; see `resting_base`.

    Returns:
        derivatives along the velocities of the joints, in the order of v [N m or N, by the unit of
        the velocity].
    """
    bodies = [PseudoInertia.of(link.inertia) for link in tree.links]
    poses, bodies = shift_frames(tree, poses, bodies, base_rests=is_zero(base.w))
    bodies = regroup(tree, poses, bodies)
    motions = link_accelerations(tree, poses, v, a, base)
    axes = joint_axes(tree, poses, v, motions, base)
    spins, moments = spin_momenta(tree, v), rotor_moments(tree, v, a, motions)
    own = [
        SubtreeMotion.of_link(body, motion, spins.get(j, zeros()), moments.get(j, zeros()))
        for j, (body, motion) in enumerate(zip(bodies, motions, strict=True))
    ]
    subtrees = subtree_motions(tree, axes, own)
    dq, dv, A = (zeros(tree.nv, tree.nv) for _ in range(3))
    efforts = rotor_efforts(tree, a, motions, base)
    for j, link in enumerate(tree.links):
        for k, line in enumerate(axes[j].lines, link.v.start):
            efforts[k] += line.unit.power(subtrees[j].f, subtrees[j].m)
    result = EffortDerivatives(dq, dv, A, efforts)
    _fill(result, tree, axes, subtrees)
    return result


def _fill(
    result: EffortDerivatives, tree: Tree, axes: list[JointAxes], subtrees: list[SubtreeMotion]
) -> None:
    """Fill the derivatives of the efforts in place, joint by joint with all ancestor joints.

    `subtrees` are the quantities of the subtree of each joint.
    """
    by_base = links_by_base(tree, axes)
    placed = base_axes(tree, axes) if by_base else []
    for j, link in enumerate(tree.links):
        own, couple = _rotor_couples(tree, axes, j)
        for k, line in enumerate(axes[j].lines, link.v.start):
            column = effort_column(subtrees[j], line)
            if own is not None:
                column = column.with_couple(own)
            _set_own(result, k, link.v.start, axes[j].lines, column)
            if link.backward:
                _turn_row(result, k, link.v.start, axes[j].lines, subtrees[j])
            if own is not None:
                result.dv[k, k] += casadi.dot(line.unit.angular, own.dv)
                result.A[k, k] += casadi.dot(line.unit.angular, own.da)
            if link.rotor is not None:
                result.A[k, k] += link.rotor.seen_at_joint
            passages = (
                _through_base(tree, placed, j, column, couple)
                if j in by_base
                else _through_axes(tree, axes, j, column, couple)
            )
            for i, lines, passing in passages:
                _set_pairs(result, k, tree.links[i].v.start, lines, passing)


def _rotor_couples(
    tree: Tree, axes: list[JointAxes], j: int
) -> tuple[RotorMoment | None, RotorMoment | None]:
    """Return the moment derivatives of the rotor of joint j in two variants, at least one None.

    The first is set if the rotor is mounted on link j, the second if it is on the antecedent.
    """
    rotor = tree.links[j].rotor
    if rotor is None or rotor.carrier < 0:
        return None, None
    couple = rotor_couple(rotor, axes[rotor.carrier])
    return (couple, None) if rotor.carrier == j else (None, couple)


def _through_axes(
    tree: Tree, axes: list[JointAxes], j: int, column: EffortColumn, couple: RotorMoment | None
) -> Iterator[Passage]:
    """Yield a column of joint j in the axes of each joint on its path to the base.

    Args:
        tree: links of the tree.
        axes: axes of the joints.
        j: index of the joint.
        column: column in the axes of joint j.
        couple: moment derivatives of its rotor on the antecedent, in the joint axes of that link.
    """
    while tree.links[j].antecedent >= 0:
        for step in axes[j].path:
            column = column.through(step)
        joined, j = axes[j].parallel, tree.links[j].antecedent
        turn = axes[j].rotation
        if turn is not None and not joined:
            column = column.rotate(turn)
        if couple is not None:
            column, couple = column.with_couple(couple), None
        yield j, axes[j].lines, column


def _through_base(
    tree: Tree, placed: list[BaseAxes], j: int, column: EffortColumn, couple: RotorMoment | None
) -> Iterator[Passage]:
    """Yield a column of joint j in base axes, with each joint on its path to the base.

    `column` is in the axes of joint j, `placed` are the axes of joints relative to the base, and
    `couple` is as in `_through_axes`.
    """
    i = tree.links[j].antecedent
    column = column.through(placed[j].place).drifting(placed[j].twice)
    if couple is not None:
        column = column.with_couple(couple.rotate(placed[i].place.rotation))
    for before in tree.path(i):
        yield before, placed[before].lines, column


def _set_own(
    result: EffortDerivatives, k: int, start: int, lines: tuple[Line, ...], column: EffortColumn
) -> None:
    """Set row k of the derivatives `result` at the columns of a joint, in place.

    `start` is the index of the first velocity of the joint, `lines` are its unit motions, and
    `column` has the derivatives by velocity k.
    """
    for h, line in enumerate(lines, start):
        result.dq[k, h], result.dv[k, h], result.A[k, h] = column.row(line)


def _turn_row(
    result: EffortDerivatives, k: int, start: int, lines: tuple[Line, ...], subtree: SubtreeMotion
) -> None:
    """Add to row k of dq the term of a backward joint, in place.

    Its unit motions `lines` are fixed on the antecedent and do not move with the joint itself.
    `start` is the index of its first velocity, and `subtree` has the wrench of its subtree.
    """
    unit = lines[k - start].unit
    for h, line in enumerate(lines, start):
        result.dq[k, h] += line.unit.rate_on(unit).power(subtree.f, subtree.m)


def _set_pairs(
    result: EffortDerivatives, k: int, start: int, lines: tuple[Line, ...], column: EffortColumn
) -> None:
    """Set the entries of `result` for velocity k and an ancestor joint, in place.

    Both triangles are set. `start` is the index of the first velocity of the ancestor joint,
    `lines` are its unit motions, and `column` has the derivatives by velocity k in the same axes.
    """
    _set_own(result, k, start, lines, column)
    for h, line in enumerate(lines, start):
        result.dq[h, k], result.dv[h, k], result.A[h, k] = column.efforts(line)
