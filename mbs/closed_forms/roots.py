"""What a kernel finds: every branch of a loop, as expressions of what is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.components.joints import Motion
from mbs.recursions.chain import ChainJoint

Positions = Mapping[int, SX]
"""Position of each unknown joint, by its index in q."""


@dataclass(frozen=True, slots=True, eq=False)
class RodSpin:
    """The spin of a rod at a configuration whose quaternion is known.

    Attributes:
        index: number of the spin among the positions.
        angle: expression of all positions [rad].
    """

    index: int
    angle: SX


@dataclass(frozen=True, slots=True, eq=False)
class LoopBranches:
    """The branches of a loop.

    Attributes:
        branches: positions by label, such as "j3:+"; the label is empty where there is one alone.
        spin: the spin on which they depend, if they do.
    """

    branches: Mapping[str, Positions]
    spin: RodSpin | None = None


def positions(joints: Sequence[ChainJoint], values: Sequence[SX]) -> Positions:
    """Positions in q from those along the path around the loop; spherical joints are left out."""
    return {
        joint.index: joint.sign * value
        for joint, value in zip(joints, values, strict=True)
        if joint.index is not None and joint.motion is not Motion.SPHERICAL
    }


def signed(joint: ChainJoint) -> tuple[tuple[str, int], ...]:
    """The labels of a joint with two roots, each with the sign of the root along the loop."""
    return tuple((f"{joint.name}:{label}", sign * joint.sign) for label, sign in _SIGNS)


_SIGNS = (("+", 1), ("-", -1))


# Angles by their sine and cosine: the two roots of X cos t + Y sin t = Z, and turns of vectors.


@dataclass(frozen=True, slots=True, eq=False)
class Angle:
    """An angle t by its cosine and sine, both of which may carry one common positive factor.

    Attributes:
        c, s: size times cosine and sine.
        size: the factor.
    """

    c: SX
    s: SX
    size: SX

    @property
    def value(self) -> SX:
        """The angle in (-pi, pi] [rad]."""
        return SX(casadi.atan2(self.s, self.c))

    @property
    def matrix(self) -> SX:
        """(2, 2) turn of the plane."""
        c, s = self.c / self.size, self.s / self.size
        return casadi.vertcat(casadi.horzcat(c, -s), casadi.horzcat(s, c))


def root_angle(X: SX, Y: SX, Z: SX, sign: int) -> Angle:
    """The root of X cos t + Y sin t = Z that lies on one side of the direction (X, Y).

    Source: Khalil & Creusot 1997, section 3.3, equation of type 2.
    """
    size = X * X + Y * Y
    W = sign * casadi.sqrt(size - Z * Z)
    return Angle(X * Z - Y * W, Y * Z + X * W, size)


def angle_onto(a: SX, b: SX) -> Angle:
    """The turn that brings a, (2, 1), onto b, (2, 1), which is as long."""
    fixed = a if a.is_constant() else b
    return Angle(a[0] * b[0] + a[1] * b[1], across(a, b), fixed[0] * fixed[0] + fixed[1] * fixed[1])


def across(a: SX, b: SX) -> SX:
    """The vector product of two vectors of the plane."""
    return a[0] * b[1] - a[1] * b[0]


def square(a: SX) -> SX:
    """The square of the length of a vector."""
    return SX(casadi.sumsqr(a))


def in_plane(matrix: SX) -> SX:
    """The part of a rotation or of a vector in its plane x, y."""
    return matrix[0:2, 0:2] if matrix.shape[1] > 1 else matrix[0:2]


def last_angle(before: SX) -> SX:
    """The rotation about z that undoes the turn `before`, of which the first row is used [rad]."""
    return SX(casadi.atan2(before[0, 1], before[0, 0]))
