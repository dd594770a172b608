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
        """Return the pose of a frame with the same origin and the orientation R (3, 3)."""
        return Pose(casadi.densify(R), zeros())

    @staticmethod
    def about(axis: str, angle: SX) -> Pose:
        """Return the pose of a frame rotated by an angle [rad] about "x", "y" or "z"."""
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
                return Pose(_with_lone_ones(_own(rest.R)), _own(rest.p), chain)
        return Pose(
            _with_lone_ones(exact_product(self.R, other.R)),
            exact_product(self.R, other.p, self.p),
            chain,
        )

    def inverse(self) -> Pose:
        """Return T_ji, the inverse of T_ij."""
        R = self.R.T
        return Pose(
            R,
            zeros() if self.p.is_zero() else exact_product(-R, self.p),
            tuple(_inverse(step) for step in reversed(self.chain)),
        )

    @property
    def matrix(self) -> SX:
        """(4, 4) homogeneous transform."""
        return _homogeneous(self.R, self.p)

    def at(self, p: SX) -> Pose:
        """Return the pose with the same orientation and the origin p (3, 1) [m]."""
        turns = (
            step if isinstance(step, SymbolicRotation) else Pose.rotation(step.R)
            for step in self.chain
        )
        return Pose(self.R, p, (Pose.translation(p), *turns) if self.chain else ())

    def is_identity(self) -> bool:
        """Whether the pose is the constant identity."""
        return self.p.is_zero() and SX.binary(casadi.OP_SUB, self.R, _EYE).is_zero()


def _own(value: SX) -> SX:
    """Return a dense copy."""
    return +value if value.is_dense() else casadi.densify(value)


@formula((3, 3), (3, 1))
def _homogeneous(R: SX, p: SX) -> SX:
    return casadi.vertcat(casadi.horzcat(R, p), casadi.horzcat(SX(DM([[0, 0, 0]])), SX(1)))


def _join(first: Pose, second: Pose) -> tuple[SymbolicRotation | Pose, ...]:
    """Join the chains of two poses and multiply adjacent numeric poses; empty if unknown."""
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


def _inverse(step: SymbolicRotation | Pose) -> SymbolicRotation | Pose:
    return (
        SymbolicRotation(step.axis, -step.angle)
        if isinstance(step, SymbolicRotation)
        else step.inverse()
    )


def _with_lone_ones(R: SX) -> SX:
    """Set a constant that is the only nonzero in its row or column of a rotation to 1 or -1."""
    if R.is_constant() and not _has_alone(numbers(R)):
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


def _has_alone(elements: list[float]) -> bool:
    """Whether one of nine elements is alone in its row or column and is not exactly 1 or -1."""
    lines = (*(elements[k : k + 3] for k in (0, 3, 6)), *(elements[k::3] for k in range(3)))
    return any(line.count(0.0) == 2 and max(map(abs, line)) != 1.0 for line in lines)


# Wrenches: force and moment about a point.


Wrench = tuple[SX, SX]
"""Force (3, 1) and moment (3, 1) about the origin of a frame, in that frame [N, N m]."""


def add_wrenches(a: Wrench, b: Wrench) -> Wrench:
    """Return the sum of two wrenches about the same point."""
    return a[0] + b[0], a[1] + b[1]


def transform_wrench(pose: Pose, wrench: Wrench) -> Wrench:
    """Transform a wrench about and in frame j to frame i; `pose` is the pose of j in i."""
    force, moment = (casadi.mtimes(pose.R, part) for part in wrench)
    return force, moment + cross(pose.p, force)


# Elementary displacements: a rotation about a coordinate axis with a translation along it.
#
# A link frame of Khalil and Kleinfinger is a product of two or three displacements from its
# antecedent. A displacement transforms a wrench or an inertia by a few multiplications, while a
# general pose needs dozens.


class Transformable(Protocol):
    """Protocol of a quantity about and in a frame that transforms like an inertia."""

    def rotate(self, R: Rotation) -> Self:
        """Transform to the axes of frame i; R is the orientation of the current axes in i."""

    def shift(self, axis: int, t: SX) -> Self:
        """Return the quantity displaced by t [m] along a coordinate axis."""


Thing = TypeVar("Thing", bound=Transformable)


class Displacement(Protocol):
    """Protocol of a displacement from a frame i to a frame j."""

    @property
    def rotation(self) -> Rotation:
        """Orientation of frame j relative to frame i."""

    def point(self, r: SX) -> SX:
        """Transform a point (3, 1) from frame j to frame i [m]."""

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Transform a force and moment about and in frame j to a wrench about and in frame i."""

    def body(self, thing: Thing) -> Thing:
        """Transform an inertia or a similar quantity from frame j to frame i."""


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
        """Return the screw of an angle [rad] and a distance t [m] on the axis "x", "y" or "z"."""
        return ScrewDisplacement(axis_rotation(axis, angle), SX(t))

    @property
    def axis(self) -> int:
        """Index of the axis: 0, 1 or 2 for x, y or z."""
        return self.rotation.along

    def point(self, r: SX) -> SX:
        """Transform a point (3, 1) from frame j to frame i [m]."""
        return _shift_point(self.rotation.apply(r), self.t, self.axis)

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Transform a force and moment about and in frame j to a wrench about and in frame i."""
        f, m = self.rotation.apply(f), self.rotation.apply(m)
        return f, m if self.t.is_zero() else _shift_moment(f, m, self.t, *self.rotation.across)

    def body(self, thing: Thing) -> Thing:
        """Transform an inertia or a similar quantity from frame j to frame i."""
        return thing.rotate(self.rotation).shift(self.axis, self.t)


@formula((3, 1), (1, 1))
def _shift_point(r: SX, t: SX, axis: int) -> SX:
    moved = SX(r)
    moved[axis] += t
    return moved


@formula((3, 1), (3, 1), (1, 1))
def _shift_moment(f: SX, m: SX, t: SX, k: int, h: int) -> SX:
    """Moment about a point shifted by -t [m] along the axis normal to the axes k and h."""
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
        """Transform a point (3, 1) from frame j to frame i [m]."""
        return self.p + self.rotation.apply(r)

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Transform a force and moment about and in frame j to a wrench about and in frame i."""
        f, m = self.rotation.apply(f), self.rotation.apply(m)
        return f, m if is_zero(self.p) else m + cross(self.p, f)

    def body(self, thing: Thing) -> Thing:
        """Transform an inertia or a similar quantity from frame j to frame i."""
        moved = thing.rotate(self.rotation)
        for axis in range(3):
            moved = moved.shift(axis, self.p[axis])
        return moved


def origin(steps: Sequence[Displacement]) -> SX:
    """(3, 1) origin of the last frame of successive displacements in the first frame [m]."""
    p = zeros()
    for step in reversed(steps):
        p = step.point(p)
    return p


def transform_wrench_along(steps: Sequence[Displacement], f: SX, m: SX) -> Wrench:
    """Transform a force f and moment m from the last frame of displacements to the first frame."""
    for step in reversed(steps):
        f, m = step.wrench(f, m)
    return f, m


def transform_inertia_along(steps: Sequence[Displacement], thing: Thing) -> Thing:
    """Transform an inertia or similar from the last frame of displacements to the first frame."""
    for step in reversed(steps):
        thing = step.body(thing)
    return thing
