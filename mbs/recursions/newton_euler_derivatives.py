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
from mbs.recursions.joint_axes import AxesStep, Drift, JointAxes, Line, Twist, joint_axes
from mbs.recursions.newton_euler import inertial_wrench, rotor_efforts, rotor_moments, spin_momenta
from mbs.recursions.poses import LinkPose
from mbs.recursions.regrouping import regroup, shift_frames
from mbs.recursions.velocities import Acceleration, link_accelerations
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

# What a joint must know of everything behind it: inertia, its rate, and the wrench it takes.
#
# Source: Khalil, Bennis & Gautier 1990 (composite links); Singh, Russell & Wensing 2022 (their
# composite matrix B, of which twelve numbers are left for an observer at rest or in steady
# motion).


@dataclass(frozen=True, slots=True, eq=False)
class SubtreeMotion:
    """Links that move together, about a point and for an observer who moves with it.

    With r and r_dot the place and velocity of an element of mass dm, N = integral of r_dot r' dm.

    Attributes:
        body: their inertia.
        K: (3, 3) 2 (tr(N) - N): times an angular velocity, the moment that it adds to bodies
            that move [kg m^2/s].
        n: (3, 1) twice their linear momentum [kg m/s].
        f: (3, 1) force that they take [N].
        m: (3, 1) moment that they take [N m].
    """

    body: Inertia
    K: SX
    n: SX
    f: SX
    m: SX

    @staticmethod
    def zero() -> SubtreeMotion:
        """No link at all."""
        return SubtreeMotion(Inertia.zero(), zeros(3, 3), zeros(), zeros(), zeros())

    @staticmethod
    def of_link(pseudo: PseudoInertia, motion: Acceleration, spin: SX, moment: SX) -> SubtreeMotion:
        """One link, for an observer at the origin of its frame.

        Args:
            pseudo: of the link, about and in its frame.
            motion: of the link.
            spin: (3, 1) angular momentum of rotors on the link, seen from it, in its frame.
            moment: (3, 1) moment that their spin takes.
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
        """Both, about the same point."""
        return SubtreeMotion(
            self.body + other.body,
            self.K + other.K,
            self.n + other.n,
            self.f + other.f,
            self.m + other.m,
        )

    def rotate(self, R: Rotation) -> SubtreeMotion:
        """In the axes of frame i, R being the orientation of the present ones in i."""
        f, m = R.apply(self.f), R.apply(self.m)
        return SubtreeMotion(self.body.rotate(R), R.apply_to_square(self.K), R.apply(self.n), f, m)

    def shift(self, axis: int, t: SX) -> SubtreeMotion:
        """Displaced by t [m] along a coordinate axis."""
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
        """For an observer to whom everything has half of `twice` added to its velocity."""
        ms, K = self.body.ms, SX(self.K)
        for k in range(3):
            for h in {0, 1, 2} - {k}:
                K[k, k] += twice[h] * ms[h]
                K[k, h] -= twice[k] * ms[h]
        return SubtreeMotion(self.body, K, self.n + self.body.m * twice, self.f, self.m)

    def through(self, step: AxesStep) -> SubtreeMotion:
        """Seen from the other end of a step."""
        if isinstance(step, Drift):
            return self.drifting(step.twice)
        return step.body(self)

    def wrench_of(self, twist: Twist) -> Wrench:
        """Momentum for a velocity; force and moment for an acceleration."""
        return self.body.momentum(twist.linear, twist.angular)

    def wrench_of_spin(self, s: SX) -> Wrench:
        """What an angular velocity added to all of them adds to the wrench."""
        return cross(s, self.n), casadi.mtimes(self.K, s)

    def wrench_of_displacement(self, unit: Twist) -> Wrench:
        """What a displacement changes of the wrench that goes with it."""
        t, s = unit.linear, unit.angular
        return cross(s, self.f), cross(s, self.m) + cross(t, self.f)

    def spin_of(self, unit: Twist) -> SX:
        """(3, 1) times an angular velocity: the effort that it adds along a unit motion."""
        return casadi.mtimes(self.K.T, unit.angular) + cross(self.n, unit.linear)


def subtree_motions(
    tree: Tree, axes: list[JointAxes], own: list[SubtreeMotion]
) -> list[SubtreeMotion]:
    """Everything behind each joint, in its axes.

    Args:
        tree: the links.
        axes: of the joints.
        own: of each link alone, in its frame.
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


# What one joint changes of the wrench behind it, on its way to the joints before.
#
# Source: Singh, Russell & Wensing 2022.


@dataclass(frozen=True, slots=True, eq=False)
class Couple:
    """What a rotor that spins with a joint takes of its carrier, (3, 1) each.

    Attributes:
        dv: moment for a unit velocity of the joint.
        da: for a unit acceleration.
    """

    dv: SX
    da: SX

    def rotate(self, R: Rotation) -> Couple:
        """In the axes of frame i, R being the orientation of the present ones in i."""
        return Couple(R.apply(self.dv), R.apply(self.da))


@dataclass(frozen=True, slots=True, eq=False)
class EffortColumn:
    """How the wrench of a subtree changes with its joint, and its effort with other joints.

    Attributes:
        dq: change of the wrench with the position of the joint.
        dv: with its velocity.
        momentum: with its acceleration; its power with an acceleration of everything behind the
            joint is the effort that this takes.
        spin: (3, 1) times an angular velocity given to everything behind the joint: the effort.
    """

    dq: Wrench
    dv: Wrench
    momentum: Wrench
    spin: SX

    def through(self, step: AxesStep) -> EffortColumn:
        """Seen from the other end of a step."""
        if isinstance(step, Drift):
            return self.drifting(step.twice)
        return EffortColumn(
            step.wrench(*self.dq),
            step.wrench(*self.dv),
            step.wrench(*self.momentum),
            step.rotation.apply(self.spin),
        )

    def rotate(self, R: Rotation) -> EffortColumn:
        """In the axes of frame i, R being the orientation of the present ones in i."""
        dq, dv, momentum = ((R.apply(f), R.apply(m)) for f, m in (self.dq, self.dv, self.momentum))
        return EffortColumn(dq, dv, momentum, R.apply(self.spin))

    def drifting(self, twice: SX) -> EffortColumn:
        """For an observer to whom everything has half of `twice` added to its velocity."""
        spin = self.spin + cross(twice, self.momentum[0])
        return EffortColumn(self.dq, self.dv, self.momentum, spin)

    def with_couple(self, couple: Couple) -> EffortColumn:
        """With couples that velocity and acceleration of the joint take besides."""
        (f_v, m_v), (f_a, m_a) = self.dv, self.momentum
        return EffortColumn(
            self.dq, (f_v, m_v + couple.dv), (f_a, m_a + couple.da), self.spin + couple.dv
        )

    def row(self, line: Line) -> tuple[SX, SX, SX]:
        """Effort of the column's joint for position, velocity and acceleration along a line."""
        return (
            line.second.power(*self.momentum) + casadi.dot(self.spin, line.spin),
            line.faster.power(*self.momentum) + casadi.dot(self.spin, line.unit.angular),
            line.unit.power(*self.momentum),
        )

    def efforts(self, line: Line) -> tuple[SX, SX, SX]:
        """Effort along a line for position, velocity and acceleration of the column's joint."""
        unit = line.unit
        return unit.power(*self.dq), unit.power(*self.dv), unit.power(*self.momentum)


def effort_column(subtree: SubtreeMotion, line: Line) -> EffortColumn:
    """What a joint changes that moves a subtree along a line, in the axes of both."""
    spinning = add_wrenches(subtree.wrench_of(line.second), subtree.wrench_of_spin(line.spin))
    return EffortColumn(
        dq=add_wrenches(spinning, subtree.wrench_of_displacement(line.unit)),
        dv=add_wrenches(subtree.wrench_of(line.faster), subtree.wrench_of_spin(line.unit.angular)),
        momentum=subtree.wrench_of(line.unit),
        spin=subtree.spin_of(line.unit),
    )


def rotor_couple(rotor: CarriedRotor, axes: JointAxes) -> Couple:
    """The couple of a rotor, in the axes of the joint of the link that carries it."""
    momentum = rotor.momentum if axes.rotation is None else axes.rotation.apply(rotor.momentum)
    return Couple(cross(axes.w, momentum), momentum)


# Which columns of the derivatives cost less in the base than through the axes of all joints.


_TURN, _SLIDE, _DRIFT, _PAIR = 42, 12, 12, 17
"""Operations of a column on its way through the axes of the joints before."""

_BASE_PAIR, _BASE_COLUMN, _BASE_LINE = 67, 130, 150
"""Operations in the base: of a pair, and of the way there of a column and of a line."""


def links_by_base(tree: Tree, axes: list[JointAxes]) -> set[int]:
    """Links whose columns cost less by way of the base; empty when too few do.

    In the base a pair of joints costs the same however far they are apart and however their axes
    lie; on the path through the joints right angles and vanishing distances are cheaper still.
    """
    saved: dict[int, int] = {}
    for j, link in enumerate(tree.links):
        path = tree.path(j)
        pairs = sum(tree.links[i].motion.nv for i in path[:-1])
        walk = sum(_cost(step) for i in path[1:] for step in axes[i].path)
        turns = sum(
            axes[i].rotation is not None and not axes[k].parallel for i, k in pairwise(path)
        )
        saving = walk + _TURN * turns - (_BASE_PAIR - _PAIR) * pairs - _BASE_COLUMN
        if saving > 0:
            saved[j] = saving * link.motion.nv
    return set(saved) if sum(saved.values()) > _BASE_LINE * tree.nv else set()


def _cost(step: AxesStep) -> int:
    """Operations that a step takes of a column."""
    match step:
        case Drift():
            return _DRIFT
        case ScrewDisplacement():
            quarter = step.rotation.c.is_zero() or step.rotation.s.is_zero()
            return _TURN * (not quarter) + _SLIDE * (not step.t.is_zero())
    return 3 * (_TURN + _SLIDE)


# The axes of the joints seen from the base, where every joint meets every other at once.
#
# Source: Singh, Russell & Wensing 2022 (all vectors in the ground frame).


@dataclass(frozen=True, slots=True, eq=False)
class BaseAxes:
    """The axes of a joint in the base.

    Attributes:
        place: where they stand.
        twice: (3, 1) twice the velocity of their origin, in the base [m/s].
        lines: the motions of the joint, about the origin of the base, for an observer at rest.
    """

    place: FreeDisplacement
    twice: SX
    lines: tuple[Line, ...]


def base_axes(tree: Tree, axes: list[JointAxes]) -> list[BaseAxes]:
    """The axes of every joint in the base."""
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
            R, p, twice = _after(step, R, p, twice)
        place = FreeDisplacement(MatrixRotation(R), p)
        lines = (line.displaced(R, p).drifting(twice) for line in own.lines)
        result.append(BaseAxes(place, twice, tuple(lines)))
    return result


def _after(step: AxesStep, R: SX, p: SX, twice: SX) -> tuple[SX, SX, SX]:
    if isinstance(step, Drift):
        return R, p, twice + casadi.mtimes(R, step.twice)
    p = p + casadi.mtimes(R, step.point(zeros()))
    return _rotate(R, step.rotation), p, twice


def _rotate(R: SX, turn: Rotation) -> SX:
    """R times the matrix of a turn."""
    return casadi.horzcat(*(turn.apply_inverse(R[k, :].T) for k in range(3))).T


Passage = tuple[int, tuple[Line, ...], EffortColumn]
"""A joint that a column passes, the motions of this joint, and the column in the same axes."""


@dataclass(frozen=True, slots=True, eq=False)
class EffortDerivatives:
    """Joint efforts, without drives, friction and springs, and their derivatives.

    Attributes:
        dq: (nv, nv) along the velocities of the joints: column k is the rate of the efforts when
            the positions move with unit velocity k while v and a stay as they are.
        dv: (nv, nv) with respect to velocities.
        A: (nv, nv) with respect to accelerations: the inertia matrix.
        efforts: (nv, 1).
    """

    dq: SX
    dv: SX
    A: SX
    efforts: SX


def newton_euler_derivatives(
    tree: Tree, poses: list[LinkPose], v: SX, a: SX, base: Acceleration
) -> EffortDerivatives:
    """Derivatives of the efforts of `newton_euler`.

    Inertia, its rate and the wrench of everything behind a joint run from the leaves to the
    base. From them come, for each joint, the change of that wrench with its position, velocity
    and acceleration; each runs on to the base and gives an effort at every joint it passes.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base; see `resting_base`.

    Returns:
        derivatives along the velocities of the joints, in the order of v [N m or N, by the unit
        of the velocity].
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
) -> tuple[Couple | None, Couple | None]:
    """Of the rotor of joint j on its own link, and on the link before."""
    rotor = tree.links[j].rotor
    if rotor is None or rotor.carrier < 0:
        return None, None
    couple = rotor_couple(rotor, axes[rotor.carrier])
    return (couple, None) if rotor.carrier == j else (None, couple)


def _through_axes(
    tree: Tree, axes: list[JointAxes], j: int, column: EffortColumn, couple: Couple | None
) -> Iterator[Passage]:
    """A column of joint j in the axes of every joint before, one after the other.

    Args:
        tree: the links.
        axes: of the joints.
        j: the joint.
        column: in its axes.
        couple: of its rotor on the link before, in the axes of that link.
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
    tree: Tree, placed: list[BaseAxes], j: int, column: EffortColumn, couple: Couple | None
) -> Iterator[Passage]:
    """The same, with every joint before it in the base."""
    i = tree.links[j].antecedent
    column = column.through(placed[j].place).drifting(placed[j].twice)
    if couple is not None:
        column = column.with_couple(couple.rotate(placed[i].place.rotation))
    for before in tree.path(i):
        yield before, placed[before].lines, column


def _set_own(
    result: EffortDerivatives, k: int, start: int, lines: tuple[Line, ...], column: EffortColumn
) -> None:
    """The entries of velocity k with those of its own joint, from number `start` on."""
    for h, line in enumerate(lines, start):
        result.dq[k, h], result.dv[k, h], result.A[k, h] = column.row(line)


def _turn_row(
    result: EffortDerivatives, k: int, start: int, lines: tuple[Line, ...], subtree: SubtreeMotion
) -> None:
    """Add what velocity k of a backward joint, fixed on the link before, does not turn with it."""
    unit = lines[k - start].unit
    for h, line in enumerate(lines, start):
        result.dq[k, h] += line.unit.rate_on(unit).power(subtree.f, subtree.m)


def _set_pairs(
    result: EffortDerivatives, k: int, start: int, lines: tuple[Line, ...], column: EffortColumn
) -> None:
    """The entries of velocity k with those of a joint before, from number `start` on."""
    _set_own(result, k, start, lines, column)
    for h, line in enumerate(lines, start):
        result.dq[h, k], result.dv[h, k], result.A[h, k] = column.efforts(line)
