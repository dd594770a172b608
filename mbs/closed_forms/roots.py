"""Solutions of loops: branches as expressions of known quantities, or numeric roots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.components.joints import Motion
from mbs.recursions.chain import ChainJoint

Positions = Mapping[int, SX]
"""Position of each unknown joint, by its index in q."""


@dataclass(frozen=True, slots=True, eq=False)
class RodSpin:
    """Spin of a rod about its line in a configuration with a known quaternion.

    Attributes:
        index: index of the spin among the positions.
        angle: spin [rad] as an expression of all positions.
    """

    index: int
    angle: SX


@dataclass(frozen=True, slots=True, eq=False)
class LoopBranches:
    """Branches of a loop.

    Attributes:
        branches: positions by label, such as "j3:+". The label of a single branch is empty.
        spin: rod spin on which the branches depend; None if they depend on no spin.
    """

    branches: Mapping[str, Positions]
    spin: RodSpin | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Roots:
    """All numeric solutions of some loops, with a statement on their completeness.

    Attributes:
        values: (r, k) unknowns, one row per solution.
        proof: text on the solution method and its certificate, for use within a sentence.
        complete: whether the method proves that no solution is missing.
    """

    values: NDArray[np.float64]
    proof: str
    complete: bool = True


def positions(joints: Sequence[ChainJoint], values: Sequence[SX]) -> Positions:
    """Return a dict from index in q to position, for joints along a loop.

    Spherical joints and joints without index are left out.

    Args:
        joints: joints of the loop.
        values: position of each joint in the direction of the loop.
    """
    return {
        joint.index: joint.sign * value
        for joint, value in zip(joints, values, strict=True)
        if joint.index is not None and joint.motion is not Motion.SPHERICAL
    }


def signed(joint: ChainJoint) -> tuple[tuple[str, int], ...]:
    """Return the two labels of a joint with two roots, each with its sign along the loop.

    Args:
        joint: joint whose two roots are distinguished.
    """
    return tuple((f"{joint.name}:{label}", sign * joint.sign) for label, sign in _SIGNS)


_SIGNS = (("+", 1), ("-", -1))


# Angles by their sine and cosine: the two roots of X cos t + Y sin t = Z, and rotations of vectors.


@dataclass(frozen=True, slots=True, eq=False)
class Angle:
    """Angle t by its cosine and sine, up to a common positive factor.

    Attributes:
        c, s: cosine and sine, times the factor.
        size: factor.
    """

    c: SX
    s: SX
    size: SX

    @property
    def value(self) -> SX:
        """Angle in (-pi, pi] [rad]."""
        return SX(casadi.atan2(self.s, self.c))

    @property
    def matrix(self) -> SX:
        """Rotation matrix (2, 2) of the plane."""
        c, s = self.c / self.size, self.s / self.size
        return casadi.vertcat(casadi.horzcat(c, -s), casadi.horzcat(s, c))


def root_angle(X: SX, Y: SX, Z: SX, sign: int) -> Angle:
    """Return a root of X cos t + Y sin t = Z as an angle.

    Source: Khalil & Creusot 1997, section 3.3, equation of type 2.

    Args:
        X: factor of cos t.
        Y: factor of sin t.
        Z: right side.
        sign: side of the direction (X, Y) on which the root is: +1 at a positive angle from it.
    """
    size = X * X + Y * Y
    W = sign * casadi.sqrt(size - Z * Z)
    return Angle(X * Z - Y * W, Y * Z + X * W, size)


def angle_onto(a: SX, b: SX) -> Angle:
    """Return the angle of the rotation of a plane vector onto another vector of the same length.

    Args:
        a: (2, 1) vector before the rotation.
        b: (2, 1) vector after the rotation.
    """
    fixed = a if a.is_constant() else b
    return Angle(a[0] * b[0] + a[1] * b[1], across(a, b), fixed[0] * fixed[0] + fixed[1] * fixed[1])


def across(a: SX, b: SX) -> SX:
    """Return the scalar cross product a_x b_y - a_y b_x of two plane vectors.

    Args:
        a: (2, 1) first vector.
        b: (2, 1) second vector.
    """
    return a[0] * b[1] - a[1] * b[0]


def square(a: SX) -> SX:
    """Return the squared length of a vector.

    Args:
        a: (n, 1) vector.
    """
    return SX(casadi.sumsqr(a))


def in_plane(matrix: SX) -> SX:
    """Return the x, y part of a rotation matrix (2, 2) or of a vector (2, 1).

    Args:
        matrix: (3, 3) rotation matrix, or (3, 1) vector.
    """
    return matrix[0:2, 0:2] if matrix.shape[1] > 1 else matrix[0:2]


def last_angle(before: SX) -> SX:
    """Return the angle [rad] about z whose rotation is inverse to a given rotation.

    Args:
        before: rotation about z, (2, 2), of which only the first row is used.
    """
    return SX(casadi.atan2(before[0, 1], before[0, 0]))
