"""Poses of frames, wrenches, and elementary displacements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

import casadi
from casadi import DM, SX

from mbs.spatial.rotation import AxisRotation, MatrixRotation, Rotation, axis_rotation
from mbs.spatial.vectors import (
    cross,
    elements,
    exact_product,
    formula,
    is_zero,
    numbers,
    zeros,
)

_EYE = casadi.densify(SX(DM.eye(3)))


@dataclass(frozen=True, slots=True)
class SymbolicRotation:
    """Rotation about the axis "x", "y" or "z" by a symbolic angle [rad]."""

    axis: str
    angle: SX


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of a frame j relative to a frame i.

    Attributes:
        R: (3, 3) orientation; its columns are the axes of j in frame i.
        p: (3, 1) origin of j in frame i [m].
        chain: factors of a pose with symbolic orientation: rotations by symbolic angles, and poses
            with numeric orientation. They preserve the angles, whose signs the matrix does not
            determine. Empty for a numeric R, and for a symbolic R of unknown factors.
    """

    R: SX
    p: SX
    chain: tuple[SymbolicRotation | Pose, ...] = ()

    @staticmethod
    def identity() -> Pose:
        """Return the pose of a frame relative to itself."""
        return Pose(+_EYE, zeros())

    @staticmethod
    def rotation(R: SX) -> Pose:
        """Return the pose with zero origin and the orientation R (3, 3), with an empty `chain`."""
        return Pose(casadi.densify(R), zeros())

    @staticmethod
    def about(axis: str, angle: SX) -> Pose:
        """Return the pose of a frame with the same origin, rotated about a coordinate axis.

        Args:
            axis: "x", "y" or "z".
            angle: angle [rad], a number or an expression. An expression is kept in the chain.
        """
        R = axis_rotation(axis, angle).matrix
        return Pose(R, zeros(), () if R.is_constant() else (SymbolicRotation(axis, angle),))

    @staticmethod
    def translation(p: SX) -> Pose:
        """Return the pose of a frame with the same orientation and the origin p (3, 1) [m]."""
        return Pose(Pose.identity().R, casadi.densify(p))

    @property
    def steps(self) -> tuple[SymbolicRotation | Pose, ...]:
        """Factors of the pose: its chain, or the pose itself if the chain is empty."""
        return self.chain or (self,)

    def __matmul__(self, other: Pose) -> Pose:
        """Return the product T_ik = T_ij T_jk."""
        chain = _join(self, other) if self.chain or other.chain else ()
        for one, rest in ((self, other), (other, self)):
            if one.is_identity():
                return Pose(_with_lone_ones(_dense_copy(rest.R)), _dense_copy(rest.p), chain)
        return Pose(
            _with_lone_ones(exact_product(self.R, other.R)),
            exact_product(self.R, other.p, self.p),
            chain,
        )

    def inverse(self) -> Pose:
        """Return T_ji, the pose of frame i relative to frame j."""
        R = self.R.T
        return Pose(
            R,
            zeros() if self.p.is_zero() else exact_product(-R, self.p),
            tuple(
                SymbolicRotation(step.axis, -step.angle)
                if isinstance(step, SymbolicRotation)
                else step.inverse()
                for step in reversed(self.chain)
            ),
        )

    @property
    def matrix(self) -> SX:
        """(4, 4) homogeneous transform [[R, p], [0, 1]] of points from frame j to frame i."""
        return _homogeneous(self.R, self.p)

    def at(self, p: SX) -> Pose:
        """Return the pose with the same orientation and another origin.

        Args:
            p: (3, 1) origin of frame j in frame i [m]; it replaces the present origin.
        """
        turns = (
            step if isinstance(step, SymbolicRotation) else Pose.rotation(step.R)
            for step in self.chain
        )
        return Pose(self.R, p, (Pose.translation(p), *turns) if self.chain else ())

    def is_identity(self) -> bool:
        """Return whether R is the constant identity and p the constant zero."""
        return self.p.is_zero() and SX.binary(casadi.OP_SUB, self.R, _EYE).is_zero()


def _dense_copy(value: SX) -> SX:
    """Return a dense copy of a matrix, so that changes in place do not affect the argument."""
    return +value if value.is_dense() else casadi.densify(value)


@formula((3, 3), (3, 1))
def _homogeneous(R: SX, p: SX) -> SX:
    """Return the (4, 4) homogeneous transform of orientation R (3, 3) and origin p (3, 1)."""
    return casadi.vertcat(casadi.horzcat(R, p), casadi.horzcat(SX(DM([[0, 0, 0]])), SX(1)))


def _join(first: Pose, second: Pose) -> tuple[SymbolicRotation | Pose, ...]:
    """Return the chain of factors of the product of two poses.

    Adjacent numeric poses are multiplied. Empty if a factor is a symbolic orientation of unknown
    factors.
    """
    joined: list[SymbolicRotation | Pose] = []
    for step in (*first.steps, *second.steps):
        if isinstance(step, Pose):
            if not step.R.is_constant():
                return ()
            if joined and isinstance(before := joined[-1], Pose):
                joined[-1] = before @ step
                continue
        joined.append(step)
    return tuple(joined)


def _with_lone_ones(R: SX) -> SX:
    """Set a constant of a rotation R that is alone in its row or column to 1 or -1, in place."""
    if R.is_constant() and not _has_lone_constant(numbers(R)):
        return R
    entries = elements(R)
    for place, entry in enumerate(entries):
        if not entry.is_constant() or abs(float(entry)) in (0.0, 1.0):
            continue
        row, column = place % 3, place // 3
        in_row = (entries[row + 3 * k] for k in range(3) if k != column)
        in_column = (entries[k + 3 * column] for k in range(3) if k != row)
        if all(e.is_zero() for e in in_row) or all(e.is_zero() for e in in_column):
            R[place] = 1.0 if float(entry) > 0 else -1.0
    return R


def _has_lone_constant(elements: list[float]) -> bool:
    """Return whether a row or column has a single nonzero element that is not 1 or -1.

    `elements` are its nine numbers, column by column.
    """
    lines = (*(elements[k : k + 3] for k in (0, 3, 6)), *(elements[k::3] for k in range(3)))
    return any(line.count(0.0) == 2 and max(map(abs, line)) != 1.0 for line in lines)


# Wrenches: force and moment about a point.


Wrench = tuple[SX, SX]
"""Force (3, 1) and moment (3, 1) about the origin of a frame, in that frame [N, N m]."""


def add_wrenches(a: Wrench, b: Wrench) -> Wrench:
    """Return the sum (force, moment) of two wrenches about the same point, in the same axes.

    Args:
        a: force and moment, (3, 1) each.
        b: force and moment, (3, 1) each.
    """
    return a[0] + b[0], a[1] + b[1]


def transform_wrench(pose: Pose, wrench: Wrench) -> Wrench:
    """Transform a wrench about the origin and in axes of frame j to frame i.

    Args:
        pose: pose of frame j relative to frame i.
        wrench: force [N] and moment [N m], (3, 1) each, about the origin and in axes of j.

    Returns:
        force and moment about the origin and in axes of i: (R f, R m + p x R f).
    """
    force, moment = (casadi.mtimes(pose.R, part) for part in wrench)
    return force, moment + cross(pose.p, force)


# Elementary displacements: a rotation about a coordinate axis with a translation along it.
#
# A link frame of Khalil and Kleinfinger is a product of two or three displacements from its
# antecedent. A displacement transforms a wrench or an inertia by a few multiplications, while a
# general pose needs dozens.


class Transformable(Protocol):
    """Protocol of a quantity that transforms like an inertia about and in a frame."""

    def rotate(self, R: Rotation) -> Self:
        """Transform to other axes with the same origin.

        R maps a vector from current axes to the new axes.
        """

    def shift(self, axis: int, t: SX) -> Self:
        """Return the quantity of the body displaced by t [m] along the axis 0, 1 or 2."""


Thing = TypeVar("Thing", bound=Transformable)


class Displacement(Protocol):
    """Protocol of the rigid displacement from a frame i to a frame j."""

    @property
    def rotation(self) -> Rotation:
        """Orientation of frame j relative to frame i."""

    def point(self, r: SX) -> SX:
        """Return the coordinates (3, 1) in frame i of the point r (3, 1) given in frame j [m]."""

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Return the wrench (f, m) of frame j about the origin and in axes of frame i.

        (3, 1) each, N and N m.
        """

    def body(self, thing: Thing) -> Thing:
        """Return an inertia, or a `Transformable`, of frame j about and in frame i.

        Args:
            thing: inertia about the origin and in axes of frame j.
        """


@dataclass(frozen=True, slots=True)
class ScrewDisplacement:
    """Rotation about a coordinate axis and translation along the same axis.

    Attributes:
        rotation: rotation about the axis.
        t: translation along the axis [m].
    """

    rotation: AxisRotation
    t: SX

    @staticmethod
    def about(axis: str, angle: SX, t: SX) -> ScrewDisplacement:
        """Return the screw of an angle [rad] and a translation t [m] about "x", "y" or "z".

        Args:
            axis: "x", "y" or "z".
            angle: angle of rotation [rad].
            t: translation along the axis [m].
        """
        return ScrewDisplacement(axis_rotation(axis, angle), SX(t))

    @property
    def axis(self) -> int:
        """Index of the axis: 0, 1 or 2 for x, y or z."""
        return self.rotation.along

    def point(self, r: SX) -> SX:
        """Return the coordinates (3, 1) in frame i of the point r (3, 1) given in frame j [m]."""
        return _shift_point(self.rotation.apply(r), self.t, self.axis)

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Return the wrench (f, m) of frame j about the origin and in axes of frame i.

        (3, 1) each, N and N m.
        """
        f, m = self.rotation.apply(f), self.rotation.apply(m)
        return f, m if self.t.is_zero() else _shift_moment(f, m, self.t, *self.rotation.across)

    def body(self, thing: Thing) -> Thing:
        """Return an inertia, or a `Transformable`, of frame j about and in frame i.

        Args:
            thing: inertia about the origin and in axes of frame j.
        """
        return thing.rotate(self.rotation).shift(self.axis, self.t)


@formula((3, 1), (1, 1))
def _shift_point(r: SX, t: SX, axis: int) -> SX:
    """Return the point r (3, 1) shifted by t [m] along the axis 0, 1 or 2."""
    moved = SX(r)
    moved[axis] += t
    return moved


@formula((3, 1), (3, 1), (1, 1))
def _shift_moment(f: SX, m: SX, t: SX, k: int, h: int) -> SX:
    """Return the moment (3, 1) of a wrench (f, m) about a point shifted by -t [m] along an axis.

    `k` and `h` are the indices of the axes normal to it, in cyclic order.
    """
    moved = SX(m)
    moved[k] -= t * f[h]
    moved[h] += t * f[k]
    return moved


@dataclass(frozen=True, slots=True)
class FreeDisplacement:
    """General displacement: translation, then rotation.

    Attributes:
        rotation: orientation of frame j relative to frame i.
        p: (3, 1) origin of frame j in frame i [m].
    """

    rotation: MatrixRotation
    p: SX

    def point(self, r: SX) -> SX:
        """Return the coordinates (3, 1) in frame i of the point r (3, 1) given in frame j [m]."""
        return self.p + self.rotation.apply(r)

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Return the wrench (f, m) of frame j about the origin and in axes of frame i.

        (3, 1) each, N and N m.
        """
        f, m = self.rotation.apply(f), self.rotation.apply(m)
        return f, m if is_zero(self.p) else m + cross(self.p, f)

    def body(self, thing: Thing) -> Thing:
        """Return an inertia, or a `Transformable`, of frame j about and in frame i.

        Args:
            thing: inertia about the origin and in axes of frame j.
        """
        moved = thing.rotate(self.rotation)
        for axis in range(3):
            moved = moved.shift(axis, self.p[axis])
        return moved


def origin(steps: Sequence[Displacement]) -> SX:
    """Return the origin (3, 1) [m] of the last of successive frames, in the first frame.

    Args:
        steps: displacements, each from the frame that the previous displacement reaches.
    """
    p = zeros()
    for step in reversed(steps):
        p = step.point(p)
    return p


def transform_wrench_along(steps: Sequence[Displacement], f: SX, m: SX) -> Wrench:
    """Transform a wrench from the last frame of successive displacements to the first frame.

    Args:
        steps: displacements, each from the frame that the previous displacement reaches.
        f: (3, 1) force [N], in axes of the last frame.
        m: (3, 1) moment about the origin of the last frame [N m], in its axes.

    Returns:
        force and moment about the origin of the first frame, in its axes.
    """
    for step in reversed(steps):
        f, m = step.wrench(f, m)
    return f, m


def transform_inertia_along(steps: Sequence[Displacement], thing: Thing) -> Thing:
    """Transform an inertia from the last frame of successive displacements to the first frame.

    Args:
        steps: displacements, each from the frame that the previous displacement reaches.
        thing: inertia about the origin and in axes of the last frame, or a `Transformable`
            quantity.
    """
    for step in reversed(steps):
        thing = step.body(thing)
    return thing
