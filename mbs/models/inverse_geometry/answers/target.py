"""A pose that a serial arm is wanted to take: equations free of units, and what differs from it.

Positions are counted in x = q / unit, where the unit is the arm's length for slides and one radian
for turns, so that a number in x or in the equations means the same for every joint and every row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs.models.inverse_geometry.arm import Arm, Array, gap_to

SOLVED = 1e-12
"""Largest residual of a solution, of max(1 m, the arm's length)."""

_LONGEST_STEP, _SETTLED = 0.3, 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """The equations of a wanted pose.

    Attributes:
        arm: that moves the frame.
        T: (4, 4) the wanted pose; (m, 4, 4) of m postures, each its own.
    """

    arm: Arm
    T: Array

    @property
    def unit(self) -> Array:
        """(n,) the unit of every joint [m or rad]."""
        return self.arm.units

    @property
    def tolerance(self) -> float:
        """Largest residual of a solution."""
        return SOLVED * max(1.0, self.arm.length)

    def residual(self, q: Array) -> Array:
        """(...) largest element of pose(q) - T at postures q, (..., n)."""
        return self.arm.residual(q, self.T)

    def excess(self, x: Array) -> tuple[Array, Array]:
        """The equations e(x) = 0, (..., 6), and their derivative to first order, (..., 6, n)."""
        unit, rows = self.unit, np.array([self.arm.length] * 3 + [1.0] * 3)
        T, J = self.arm.pose_and_jacobian(x * unit)
        return -gap_to(self.T, T) / rows, J * unit / rows[:, None]

    def singular_values(self, q: Array) -> Array:
        """(..., n) singular values of the Jacobian, lengths divided by the arm's length."""
        J = self.excess(q / self.unit)[1]
        return np.asarray(np.linalg.svd(J, compute_uv=False), dtype=float)

    def wrapped(self, x: Array) -> Array:
        """Differences x with those of turns brought into [-pi, pi)."""
        return self.arm.wrapped(x)

    def corrected(self, x: Array, held: Array, values: Array, iterations: int = 40) -> Array:
        """Solutions near x, (..., n), at which held @ x = values, by Gauss-Newton.

        Args:
            x: (..., n) first guesses.
            held: (..., k, n) further linear equations.
            values: (..., k) their right sides.
            iterations: at most.

        Returns:
            (..., n) the last iterates; whether they solve the equations is left to the residual.
        """
        for _ in range(iterations):
            e, J = self.excess(x)
            further = (held @ x[..., None])[..., 0] - values
            inverse = np.linalg.pinv(np.concatenate([J, held], axis=-2), rcond=1e-12)
            step = (inverse @ np.concatenate([e, further], axis=-1)[..., None])[..., 0]
            size = np.linalg.norm(step, axis=-1, keepdims=True)
            x = x - step * np.minimum(1.0, _LONGEST_STEP / np.maximum(size, 1e-300))
            if np.max(size) < _SETTLED:
                break
        return x
