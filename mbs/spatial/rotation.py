"""Rotations as sequences of turns about coordinate axes.

A turn about an axis costs four multiplications and two additions a vector, and nothing when its
angle is a multiple of a quarter turn: two turns are cheaper than the matrix they make.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.spatial.angles import sin_cos
from mbs.spatial.vectors import snapped

_AXES = "xyz"


class Rotation(Protocol):
    """Something that turns vectors of a frame j into vectors of a frame i."""

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
class Turn:
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
        """Numbers of the axes that turn, the first towards the second."""
        return (self.along + 1) % 3, (self.along + 2) % 3

    @property
    def matrix(self) -> SX:
        """(3, 3) orientation of the turned frame."""
        k, h = self.across
        R = SX(DM.eye(3))
        R[k, k], R[k, h], R[h, k], R[h, h] = self.c, -self.s, self.s, self.c
        return casadi.densify(R)

    def apply(self, vector: SX) -> SX:
        """The vector of the turned frame in the fixed one."""
        return self._turned(vector, self.s)

    def apply_inverse(self, vector: SX) -> SX:
        """The vector of the fixed frame in the turned one."""
        return self._turned(vector, -self.s)

    def _turned(self, vector: SX, s: SX) -> SX:
        k, h = self.across
        turned = +vector
        turned[k] = self.c * vector[k] - s * vector[h]
        turned[h] = s * vector[k] + self.c * vector[h]
        return turned

    def apply_to_tensor(self, tensor: SX) -> SX:
        """The symmetric tensor of the turned frame in the fixed one; eight multiplications."""
        k, h = self.across
        m, turned = self.along, self.apply_to_square(tensor)
        turned[h, k], turned[m, k], turned[m, h] = turned[k, h], turned[k, m], turned[h, m]
        return turned

    def apply_to_square(self, square: SX) -> SX:
        """Any tensor of the turned frame in the fixed one; twelve multiplications.

        With w = c (a - e) - s (b + d) the turned block is [[e + c w, b + s w], [d + s w, a - c w]]
        for the block [[a, b], [d, e]].
        """
        (k, h), m = self.across, self.along
        s, c = self.s, self.c
        a, b, d, e = square[k, k], square[k, h], square[h, k], square[h, h]
        turned = +square
        if c.is_zero():
            turned[k, k], turned[k, h], turned[h, k], turned[h, h] = e, -d, -b, a
        elif not s.is_zero():
            w = c * (a - e) - s * (b + d)
            cw, sw = c * w, s * w
            turned[k, k], turned[h, h] = e + cw, a - cw
            turned[k, h], turned[h, k] = b + sw, d + sw
        for first, second in (((k, m), (h, m)), ((m, k), (m, h))):
            turned[first] = c * square[first] - s * square[second]
            turned[second] = s * square[first] + c * square[second]
        return turned


@dataclass(frozen=True, slots=True)
class MatrixTurn:
    """A rotation by its matrix, where no axis is special (quaternions)."""

    matrix: SX

    def apply(self, vector: SX) -> SX:
        """The vector of the turned frame in the fixed one."""
        return casadi.mtimes(self.matrix, vector)

    def apply_inverse(self, vector: SX) -> SX:
        """The vector of the fixed frame in the turned one."""
        return casadi.mtimes(self.matrix.T, vector)

    def apply_to_tensor(self, tensor: SX) -> SX:
        """The symmetric tensor of the turned frame in the fixed one."""
        return self.apply_to_square(tensor)

    def apply_to_square(self, square: SX) -> SX:
        """Any tensor of the turned frame in the fixed one."""
        return casadi.mtimes(casadi.mtimes(self.matrix, square), self.matrix.T)


def axis_turn(axis: str, angle: SX) -> Turn:
    """The turn by an angle [rad] about the axis "x", "y" or "z"."""
    s, c = sin_cos(angle)
    return Turn(axis, s, c)


def align_z(direction: NDArray[np.float64]) -> SX:
    """A constant rotation whose z axis is the unit vector `direction`.

    For a coordinate axis the other two are coordinate axes too, so that no oblique numbers
    appear: x, y and z of the new frame are (y, z, x) for direction x and (z, x, y) for y.
    """
    z = direction / np.linalg.norm(direction)
    major = int(np.argmax(np.abs(z)))
    helper = np.eye(3)[major - 1]
    y = helper - z * float(z @ helper)
    y /= np.linalg.norm(y)
    return snapped(SX(DM(np.column_stack([np.cross(y, z), y, z]))))
