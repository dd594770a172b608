"""The ten inertial parameters of a rigid body about the origin of a frame."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.spatial.rotation import Rotation
from mbs.spatial.vectors import is_zero, skew, zeros

TEN_PARAMETERS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Names of the inertial parameters, in the order of Khalil & Kleinfinger 1986."""


@dataclass(frozen=True, slots=True)
class Inertia:
    """Inertia of a body about the origin of a frame, in that frame.

    Attributes:
        J: (3, 3) inertia tensor about the origin [kg m^2].
        ms: (3, 1) first moments, mass times centre of mass [kg m].
        m: mass [kg].
    """

    J: SX
    ms: SX
    m: SX

    @staticmethod
    def zero() -> Inertia:
        """No body at all."""
        return Inertia(zeros(3, 3), zeros(), SX(0))

    @staticmethod
    def about_com(mass: SX, com: SX, tensor: SX) -> Inertia:
        """From the tensor about the centre of mass, in the axes of the frame (Huygens)."""
        c = skew(com)
        return Inertia(tensor + mass * casadi.mtimes(c, c.T), mass * com, mass)

    @staticmethod
    def from_parameters(ten: SX) -> Inertia:
        """From XX XY XZ YY YZ ZZ MX MY MZ M."""
        XX, XY, XZ, YY, YZ, ZZ = (ten[k] for k in range(6))
        J = casadi.vertcat(
            casadi.horzcat(XX, XY, XZ), casadi.horzcat(XY, YY, YZ), casadi.horzcat(XZ, YZ, ZZ)
        )
        return Inertia(J, ten[6:9], ten[9])

    @property
    def parameters(self) -> SX:
        """(10, 1) XX XY XZ YY YZ ZZ MX MY MZ M."""
        J = self.J
        return casadi.densify(
            casadi.vertcat(J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2], self.ms, self.m)
        )

    def __add__(self, other: Inertia) -> Inertia:
        """Two bodies welded together, in one frame."""
        return Inertia(self.J + other.J, self.ms + other.ms, self.m + other.m)

    def seen_from(self, R: Rotation, p: SX) -> Inertia:
        """The same body about the origin of frame i and in its axes.

        Source: Khalil, Bennis & Gautier 1990 (generalised links); Khalil & Creusot 1997,
        eq. 27-30.

        Args:
            R: rotation of the present frame j seen from i.
            p: (3, 1) origin of j in i [m].
        """
        ms, J = R.apply(self.ms), R.apply_to_tensor(self.J)
        if is_zero(p):
            return Inertia(J, ms, self.m)
        first = ms + self.m * p
        return Inertia(J + _displacement(p, ms + first), first, self.m)


def _displacement(p: SX, h: SX) -> SX:
    """The tensor that a displacement p adds, (3, 3), with h = 2 ms + m p in the same axes.

    J_i = J_j - (p^ ms^ + its transpose) + m p^ p^' = J_j + (p . h) 1 - (p h' + h p') / 2.
    """
    x, y, z = p[0] * h[0], p[1] * h[1], p[2] * h[2]
    xy = -0.5 * (p[0] * h[1] + p[1] * h[0])
    xz = -0.5 * (p[0] * h[2] + p[2] * h[0])
    yz = -0.5 * (p[1] * h[2] + p[2] * h[1])
    return casadi.vertcat(
        casadi.horzcat(y + z, xy, xz), casadi.horzcat(xy, x + z, yz), casadi.horzcat(xz, yz, x + y)
    )
