"""Rotations as sequences of elementary ones about coordinate axes.

A rotation about an axis costs four multiplications and two additions a vector, and nothing when its
angle is a multiple of a quarter turn: two rotations are cheaper than the matrix they make.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import casadi
from casadi import DM, SX

from mbs.spatial.vectors import formula, product_with_vector, sin_cos, skew

Rows = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
"""A (3, 3) matrix of numbers, row by row."""

_AXES = "xyz"

_NOISE = 1e-14
"""Elements of a unit vector or rotation below this came from the rounding of whoever computed it:
a product of a few rotations is off by some 1e-15. Tilts that were meant are far larger."""

_ORTHONORMAL = 5e-16
"""What R'R may differ from the identity: two units of the last digit of one."""

_ROUNDS = 8
"""The iteration doubles the digits each time, from 1e-6 on; setting zeros costs another two."""

_TIE = 1e-6
"""Elements of a unit vector that differ by less are equal for a choice between axes."""


class Rotation(Protocol):
    """Something that rotates vectors of a frame j into vectors of a frame i."""

    @property
    def matrix(self) -> SX:
        """(3, 3) orientation of frame j seen from frame i."""

    def apply(self, vector: SX) -> SX:
        """The vector of frame j, (3, 1), in frame i."""

    def apply_inverse(self, vector: SX) -> SX:
        """The vector of frame i, (3, 1), in frame j."""

    def apply_to_tensor(self, tensor: SX) -> SX:
        """The symmetric tensor of frame j, (3, 3), in frame i."""

    def apply_to_square(self, square: SX) -> SX:
        """Any tensor of frame j, (3, 3), in frame i."""


@dataclass(frozen=True, slots=True)
class AxisRotation:
    """A rotation about a coordinate axis, by its sine and cosine."""

    axis: str
    s: SX
    c: SX

    @property
    def along(self) -> int:
        """Number of the axis: 0, 1 or 2 for x, y or z."""
        return _AXES.index(self.axis)

    @property
    def across(self) -> tuple[int, int]:
        """Numbers of the axes that rotate, the first towards the second."""
        return _across(self.axis)

    @property
    def matrix(self) -> SX:
        """(3, 3) orientation of the rotated frame."""
        return _rotation_matrix(self.s, self.c, self.axis)

    def apply(self, vector: SX) -> SX:
        """The vector of the rotated frame in the fixed one."""
        return _rotate_vector(vector, self.s, self.c, self.axis)

    def apply_inverse(self, vector: SX) -> SX:
        """The vector of the fixed frame in the rotated one."""
        return _rotate_vector(vector, -self.s, self.c, self.axis)

    def apply_to_tensor(self, tensor: SX) -> SX:
        """The symmetric tensor of the rotated frame in the fixed one; eight multiplications."""
        return _rotate_square(tensor, self.s, self.c, self.axis, self._block, True)

    def apply_to_square(self, square: SX) -> SX:
        """Any tensor of the rotated frame in the fixed one; twelve multiplications."""
        return _rotate_square(square, self.s, self.c, self.axis, self._block, False)

    @property
    def _block(self) -> str:
        """How the two axes across it turn: by a quarter, not at all, or by any angle."""
        return "quarter" if self.c.is_zero() else "still" if self.s.is_zero() else "any"


def _across(axis: str) -> tuple[int, int]:
    """Numbers of the axes that rotate, the first towards the second."""
    along = _AXES.index(axis)
    return (along + 1) % 3, (along + 2) % 3


@formula((1, 1), (1, 1))
def _rotation_matrix(s: SX, c: SX, axis: str) -> SX:
    k, h = _across(axis)
    R = SX(DM.eye(3))
    R[k, k], R[k, h], R[h, k], R[h, h] = c, -s, s, c
    return casadi.densify(R)


@formula((3, 1), (1, 1), (1, 1))
def _rotate_vector(vector: SX, s: SX, c: SX, axis: str) -> SX:
    k, h = _across(axis)
    turned = +vector
    turned[k] = c * vector[k] - s * vector[h]
    turned[h] = s * vector[k] + c * vector[h]
    return turned


@formula((3, 3), (1, 1), (1, 1))
def _rotate_square(square: SX, s: SX, c: SX, axis: str, block: str, symmetric: bool) -> SX:
    """A tensor turned.

    With w = c (a - e) - s (b + d) the turned block is [[e + c w, b + s w], [d + s w, a - c w]]
    for the block [[a, b], [d, e]].
    """
    (k, h), m = _across(axis), _AXES.index(axis)
    a, b, d, e = square[k, k], square[k, h], square[h, k], square[h, h]
    turned = +square
    if block == "quarter":
        turned[k, k], turned[k, h], turned[h, k], turned[h, h] = e, -d, -b, a
    elif block == "any":
        w = c * (a - e) - s * (b + d)
        cw, sw = c * w, s * w
        turned[k, k], turned[h, h] = e + cw, a - cw
        turned[k, h], turned[h, k] = b + sw, d + sw
    for first, second in (((k, m), (h, m)), ((m, k), (m, h))):
        turned[first] = c * square[first] - s * square[second]
        turned[second] = s * square[first] + c * square[second]
    if symmetric:
        turned[h, k], turned[m, k], turned[m, h] = turned[k, h], turned[k, m], turned[h, m]
    return turned


@dataclass(frozen=True, slots=True)
class MatrixRotation:
    """A rotation by its matrix, where no axis is special (quaternions)."""

    matrix: SX

    def apply(self, vector: SX) -> SX:
        """The vector of the rotated frame in the fixed one."""
        return product_with_vector(self.matrix, vector)

    def apply_inverse(self, vector: SX) -> SX:
        """The vector of the fixed frame in the rotated one."""
        return product_with_vector(self.matrix.T, vector)

    def apply_to_tensor(self, tensor: SX) -> SX:
        """The symmetric tensor of the rotated frame in the fixed one."""
        return self.apply_to_square(tensor)

    def apply_to_square(self, square: SX) -> SX:
        """Any tensor of the rotated frame in the fixed one."""
        return _turned_by_matrix(square, self.matrix)


@formula((3, 3), (3, 3))
def _turned_by_matrix(square: SX, R: SX) -> SX:
    return casadi.mtimes(casadi.mtimes(R, square), R.T)


def axis_rotation(axis: str, angle: SX) -> AxisRotation:
    """The turn by an angle [rad] about the axis "x", "y" or "z"."""
    s, c = sin_cos(angle)
    return AxisRotation(axis, s, c)


def align_z(direction: Sequence[float]) -> SX:
    """A constant rotation whose z axis is along `direction`, three numbers.

    For a coordinate axis the other two are coordinate axes too, so that no oblique numbers
    appear: x, y and z of the new frame are (y, z, x) for direction x and (z, x, y) for y.
    """
    z = unit_vector([float(x) for x in direction])
    # the axis that z is nearest to; of nearly equal ones the first, whatever their last digits
    largest = max(map(abs, z))
    major = next(k for k in range(3) if abs(z[k]) > largest - _TIE)
    helper = [0.0, 0.0, 0.0]
    helper[major - 1] = 1.0
    y = unit_vector([h - z[major - 1] * x for h, x in zip(helper, z, strict=True)])
    x = [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]
    return casadi.densify(SX(DM([[x[k], y[k], z[k]] for k in range(3)])))


def unit_vector(vector: Sequence[float]) -> tuple[float, float, float]:
    """The direction of three numbers, what is only rounding in it zero."""
    length = math.hypot(*vector)
    x, y, z = (0.0 if abs(x) <= _NOISE * length else x / length for x in vector)
    length = math.hypot(x, y, z)  # a second time: the first one leaves a unit of the last digit
    return x / length, y / length, z / length


def nearest_rotation(matrix: Sequence[Sequence[float]], noise: float = _NOISE) -> Rows:
    """The rotation next to a (3, 3) matrix whose digits were cut off, its noise taken out.

    Elements below the noise become zero, an element alone in its row becomes 1 or -1, and the rows
    are made orthonormal again, all together, so that the result is a rotation to the last digit.

    Source: Higham 1986 for the iteration to the orthogonal polar factor.
    """
    R = [[float(x) for x in row] for row in matrix]
    for _ in range(_ROUNDS):
        R = [[0.0 if abs(x) < noise else x for x in row] for row in R]
        for row in R:
            if sum(x != 0 for x in row) == 1:
                row[:] = [math.copysign(1.0, x) if x else 0.0 for x in row]
        gram = [[sum(R[k][i] * R[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
        off = max(abs(gram[i][j] - (i == j)) for i in range(3) for j in range(3))
        if off <= _ORTHONORMAL:
            break
        half = [[1.5 * (i == j) - 0.5 * gram[i][j] for j in range(3)] for i in range(3)]
        R = [[sum(R[i][k] * half[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    first, second, third = ((row[0], row[1], row[2]) for row in R)
    return first, second, third


# Unit quaternions w, x, y, z for joints that rotate freely.


@formula((4, 1))
def quaternion_rotation(quaternion: SX) -> SX:
    """(3, 3) orientation of the rotated frame, of a unit quaternion (w, x, y, z).

    The diagonal is w2 + x2 - y2 - z2 and so on, which keeps R' R = |quaternion|^4 I when the norm
    is not one.

    Source: Khalil & Dombre 2002, section 3.6.
    """
    w, x, y, z = (quaternion[k] for k in range(4))
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return casadi.vertcat(
        casadi.horzcat(ww + xx - yy - zz, 2 * (x * y - w * z), 2 * (x * z + w * y)),
        casadi.horzcat(2 * (x * y + w * z), ww - xx + yy - zz, 2 * (y * z - w * x)),
        casadi.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), ww - xx - yy + zz),
    )


def quaternion_rate(quaternion: SX, angular_velocity: SX) -> SX:
    """(4, 1) time derivative of the quaternion of a frame that rotates with the velocity [rad/s].

    Args:
        quaternion: (4, 1) w, x, y, z.
        angular_velocity: (3, 1) in the rotated frame.
    """
    w, e = quaternion[0], quaternion[1:4]
    return 0.5 * casadi.vertcat(
        -casadi.dot(e, angular_velocity),
        w * angular_velocity + casadi.mtimes(skew(e), angular_velocity),
    )
