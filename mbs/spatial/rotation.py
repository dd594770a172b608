"""Rotations about coordinate axes, by matrices and by quaternions.

A rotation about an axis needs four multiplications and two additions per vector, and none if its
angle is a multiple of 90 degrees. Two successive rotations need fewer than their product matrix.
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
"""Numeric (3, 3) matrix, row by row."""

_AXES = "xyz"

_NOISE = 1e-14
"""Element of a unit vector or rotation below which it counts as rounding error of its source: a
product of a few rotations has errors of 1e-15, while intended tilts are far larger."""

_ORTHONORMAL = 5e-16
"""Tolerance on the elements of R'R - I: two units in the last place of 1."""

_ROUNDS = 8
"""Maximum number of iterations: convergence is quadratic from errors of 1e-6, and setting zeros
needs two more."""

_TIE = 1e-6
"""Difference below which elements of a unit vector count as equal when the major axis is chosen:
rounding errors must not decide it."""


class Rotation(Protocol):
    """Protocol of the rotation from a frame j to a frame i."""

    @property
    def matrix(self) -> SX:
        """(3, 3) orientation of frame j relative to frame i: its columns are the axes of j in i."""

    def apply(self, vector: SX) -> SX:
        """Transform a vector (3, 1) from frame j to frame i."""

    def apply_inverse(self, vector: SX) -> SX:
        """Transform a vector (3, 1) from frame i to frame j."""

    def apply_to_tensor(self, tensor: SX) -> SX:
        """Transform a symmetric tensor (3, 3) from frame j to frame i."""

    def apply_to_square(self, square: SX) -> SX:
        """Transform a general tensor `square` (3, 3) from frame j to frame i."""


@dataclass(frozen=True, slots=True)
class AxisRotation:
    """Rotation about a coordinate axis, by its sine and cosine.

    Attributes:
        axis: "x", "y" or "z".
        s: sine of the angle.
        c: cosine of the angle.
    """

    axis: str
    s: SX
    c: SX

    @property
    def along(self) -> int:
        """Index of the axis: 0, 1 or 2 for x, y or z."""
        return _AXES.index(self.axis)

    @property
    def across(self) -> tuple[int, int]:
        """Indices (k, h) of the two other axes, in cyclic order.

        A positive angle rotates axis k towards axis h.
        """
        return _across(self.axis)

    @property
    def matrix(self) -> SX:
        """(3, 3) orientation of the rotated frame relative to the fixed frame."""
        return _rotation_matrix(self.s, self.c, self.axis)

    def apply(self, vector: SX) -> SX:
        """Transform a vector (3, 1) from the rotated frame to the fixed frame."""
        return _rotate_vector(vector, self.s, self.c, self.axis)

    def apply_inverse(self, vector: SX) -> SX:
        """Transform a vector (3, 1) from the fixed frame to the rotated frame."""
        return _rotate_vector(vector, -self.s, self.c, self.axis)

    def apply_to_tensor(self, tensor: SX) -> SX:
        """Transform a symmetric tensor (3, 3) from the rotated to the fixed frame.

        The cost is 8 multiplications.

        Args:
            tensor: (3, 3) symmetric tensor.
        """
        return _rotate_square(tensor, self.s, self.c, self.axis, self._angle_case, True)

    def apply_to_square(self, square: SX) -> SX:
        """Transform a general tensor (3, 3) from the rotated to the fixed frame.

        The cost is 12 multiplications.

        Args:
            square: (3, 3) tensor, not necessarily symmetric.
        """
        return _rotate_square(square, self.s, self.c, self.axis, self._angle_case, False)

    @property
    def _angle_case(self) -> str:
        """Case of the angle in `_rotate_square`.

        "quarter" for +-90 degrees, "still" for 0 or 180 degrees, else "any".
        """
        return "quarter" if self.c.is_zero() else "still" if self.s.is_zero() else "any"


def _across(axis: str) -> tuple[int, int]:
    """Return the indices (k, h) of the two axes normal to "x", "y" or "z", in cyclic order."""
    along = _AXES.index(axis)
    return (along + 1) % 3, (along + 2) % 3


@formula((1, 1), (1, 1))
def _rotation_matrix(s: SX, c: SX, axis: str) -> SX:
    """Return the matrix (3, 3) of a rotation about "x", "y" or "z" with sine s and cosine c."""
    k, h = _across(axis)
    R = SX(DM.eye(3))
    R[k, k], R[k, h], R[h, k], R[h, h] = c, -s, s, c
    return casadi.densify(R)


@formula((3, 1), (1, 1), (1, 1))
def _rotate_vector(vector: SX, s: SX, c: SX, axis: str) -> SX:
    """Return a vector (3, 1) rotated about an axis "x", "y" or "z" with sine s and cosine c."""
    k, h = _across(axis)
    turned = +vector
    turned[k] = c * vector[k] - s * vector[h]
    turned[h] = s * vector[k] + c * vector[h]
    return turned


@formula((3, 3), (1, 1), (1, 1))
def _rotate_square(square: SX, s: SX, c: SX, axis: str, block: str, symmetric: bool) -> SX:
    """Return R T R' for a tensor T (3, 3), `square`, and a rotation R about "x", "y" or "z".

    s and c are sine and cosine of the angle, `block` is its `AxisRotation._angle_case`, and
    `symmetric` is whether T is symmetric. With w = c (a - e) - s (b + d), the block [[a, b], [d,
    e]] of the two rotating axes becomes [[e + c w, b + s w], [d + s w, a - c w]].
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
    """General rotation by its matrix (3, 3), such as of a quaternion."""

    matrix: SX

    def apply(self, vector: SX) -> SX:
        """Transform a vector (3, 1) from the rotated frame to the fixed frame."""
        return product_with_vector(self.matrix, vector)

    def apply_inverse(self, vector: SX) -> SX:
        """Transform a vector (3, 1) from the fixed frame to the rotated frame."""
        return product_with_vector(self.matrix.T, vector)

    def apply_to_tensor(self, tensor: SX) -> SX:
        """Transform a symmetric tensor (3, 3) from the rotated frame to the fixed frame."""
        return self.apply_to_square(tensor)

    def apply_to_square(self, square: SX) -> SX:
        """Transform a general tensor `square` (3, 3) from the rotated frame to the fixed frame."""
        return _rotate_by_matrix(square, self.matrix)


@formula((3, 3), (3, 3))
def _rotate_by_matrix(square: SX, R: SX) -> SX:
    """Return R T R' for a tensor T (3, 3), `square`."""
    return casadi.mtimes(casadi.mtimes(R, square), R.T)


def axis_rotation(axis: str, angle: SX) -> AxisRotation:
    """Return the rotation by an angle [rad] about the axis "x", "y" or "z"."""
    s, c = sin_cos(angle)
    return AxisRotation(axis, s, c)


def align_z(direction: Sequence[float]) -> SX:
    """Return a numeric rotation (3, 3) whose z axis is along a direction.

    Its columns are the new axes in the old frame. For the direction of a coordinate axis the other
    two axes are coordinate axes too, so that the elements are 0, 1 or -1: x, y, z of the new frame
    are (y, z, x) for direction x, (z, x, y) for y.

    Args:
        direction: three numbers, not all zero; the length is irrelevant.
    """
    z = unit_vector([float(x) for x in direction])
    # coordinate axis nearest to z; the first axis in a tie, independent of rounding errors
    largest = max(map(abs, z))
    major = next(k for k in range(3) if abs(z[k]) > largest - _TIE)
    helper = [0.0, 0.0, 0.0]
    helper[major - 1] = 1.0
    y = unit_vector([h - z[major - 1] * x for h, x in zip(helper, z, strict=True)])
    x = [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]
    return casadi.densify(SX(DM([[x[k], y[k], z[k]] for k in range(3)])))


def unit_vector(vector: Sequence[float]) -> tuple[float, float, float]:
    """Return the unit vector along three numbers, not all zero.

    Elements of at most 1e-14 times the length become zero.
    """
    length = math.hypot(*vector)
    x, y, z = (0.0 if abs(x) <= _NOISE * length else x / length for x in vector)
    length = math.hypot(x, y, z)  # normalise again: removes the last rounding error
    return x / length, y / length, z / length


def nearest_rotation(matrix: Sequence[Sequence[float]], noise: float = _NOISE) -> Rows:
    """Return the rotation nearest to a (3, 3) matrix with truncated digits.

    Elements below `noise` become zero, an element alone in its row becomes 1 or -1, and the rows
    are orthonormalised together. The result is a rotation to machine precision.

    Source: Higham 1986 for the iteration to the orthogonal polar factor.

    Args:
        matrix: three rows of an approximate rotation.
        noise: magnitude below which an element is set to zero.
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
    """Return the orientation matrix (3, 3) of a unit quaternion (w, x, y, z), (4, 1).

    The matrix maps a vector from the rotated frame to the fixed frame. The diagonal elements have
    the form w^2 + x^2 - y^2 - z^2, so that R' R = ``|quaternion|^4`` I for any norm.

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
    """Return the time derivative (4, 1) of a quaternion [1/s].

    Args:
        quaternion: (4, 1) quaternion w, x, y, z of a frame.
        angular_velocity: (3, 1) angular velocity of the frame, in its own axes [rad/s].
    """
    w, e = quaternion[0], quaternion[1:4]
    return 0.5 * casadi.vertcat(
        -casadi.dot(e, angular_velocity),
        w * angular_velocity + casadi.mtimes(skew(e), angular_velocity),
    )
