"""Ten inertial parameters of a rigid body about the origin of a frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import casadi
from casadi import SX

from mbs.spatial.rotation import Rotation
from mbs.spatial.vectors import cross, exact_sum, formula, plus, skew, times, zeros

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
        """Return the inertia without mass: J (3, 3), ms (3, 1) and m are exact zeros."""
        return Inertia(zeros(3, 3), zeros(), SX(0))

    @staticmethod
    def about_com(mass: SX, com: SX, tensor: SX) -> Inertia:
        """Return the inertia about the origin, by the Huygens-Steiner theorem.

        Args:
            mass: mass [kg].
            com: (3, 1) centre of mass in the frame [m].
            tensor: (3, 3) inertia tensor about the centre of mass, in the axes of the frame
                [kg m^2].
        """
        c = skew(com)
        return Inertia(tensor + mass * casadi.mtimes(c, c.T), mass * com, mass)

    @staticmethod
    def from_parameters(ten: SX) -> Inertia:
        """Return the inertia with ten given parameters, unchanged.

        Args:
            ten: (10, 1) XX XY XZ YY YZ ZZ [kg m^2], MX MY MZ [kg m] and M [kg], about the origin of
                the frame.
        """
        XX, XY, XZ, YY, YZ, ZZ = (ten[k] for k in range(6))
        J = casadi.vertcat(
            casadi.horzcat(XX, XY, XZ), casadi.horzcat(XY, YY, YZ), casadi.horzcat(XZ, YZ, ZZ)
        )
        return Inertia(J, ten[6:9], ten[9])

    @property
    def parameters(self) -> SX:
        """(10, 1) inertial parameters XX XY XZ YY YZ ZZ MX MY MZ M."""
        J = self.J
        return casadi.densify(
            casadi.vertcat(J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2], self.ms, self.m)
        )

    def __add__(self, other: Inertia) -> Inertia:
        """Return the inertia of two welded bodies, in the same frame."""
        return Inertia(self.J + other.J, self.ms + other.ms, self.m + other.m)

    def momentum(self, linear: SX, angular: SX) -> tuple[SX, SX]:
        """Return linear momentum and angular momentum about the origin of the frame, (3, 1) each.

        Args:
            linear: (3, 1) velocity of the origin, in axes of the frame [m/s].
            angular: (3, 1) angular velocity of the body, in axes of the frame [rad/s].

        Returns:
            m linear + angular x ms [kg m/s], and J angular + ms x linear [kg m^2/s], in axes of the
            frame.
        """
        return _momentum(self.J, self.ms, self.m, linear, angular)

    def seen_from(self, R: Rotation, p: SX) -> Inertia:
        """Transform the inertia to the origin and the axes of frame i.

        Source: Khalil, Bennis & Gautier 1990 (generalised links); Khalil & Creusot 1997,
        eq. 27-30.

        Args:
            R: orientation of the current frame j relative to frame i.
            p: (3, 1) origin of frame j in frame i [m].
        """
        moved = self.rotate(R)
        for axis in range(3):
            moved = moved.shift(axis, p[axis])
        return moved

    def rotate(self, R: Rotation) -> Inertia:
        """Transform to a frame i with the same origin and other axes.

        Args:
            R: orientation of the current axes relative to i: it maps a vector from current axes to
                i.
        """
        return Inertia(R.apply_to_tensor(self.J), R.apply(self.ms), self.m)

    def shift(self, axis: int, t: SX) -> Inertia:
        """Return the inertia of the body displaced by t along an axis, about the same origin.

        The cost is three products: let h = ms + m t along the axis, then the moments of inertia
        about both normal axes change by t (ms + h).

        Args:
            axis: index of the axis: 0, 1 or 2 for x, y or z.
            t: displacement [m]; frame axes are kept.
        """
        if t.is_zero():
            return self
        J, ms = +self.J, +self.ms
        ms[axis] = exact_sum(ms[axis], times(self.m, t))
        across, opposite = times(t, exact_sum(self.ms[axis], ms[axis])), -t
        for k in ((axis + 1) % 3, (axis + 2) % 3):
            J[k, k] = exact_sum(J[k, k], across)
            J[axis, k] = J[k, axis] = exact_sum(J[axis, k], times(opposite, self.ms[k]))
        return Inertia(J, ms, self.m)

    def along_axis(self) -> tuple[Inertia, Inertia]:
        """Split the inertia in two terms, whose sum it is.

        A rotation about z does not change the second term.

        Returns:
            term with zero YY, MZ and M (XX is XX - YY), and term with XX = YY, MZ and M: mass on
            the z axis.
        """
        J, on_axis = +self.J, zeros(3, 3)
        on_axis[0, 0] = on_axis[1, 1] = self.J[1, 1]
        J[0, 0], J[1, 1] = exact_sum(self.J[0, 0], -self.J[1, 1]), 0
        ms, height = +self.ms, zeros()
        height[2], ms[2] = self.ms[2], 0
        return Inertia(J, ms, SX(0)), Inertia(on_axis, height, self.m)

    def rotational(self) -> tuple[Inertia, Inertia]:
        """Split the inertia in two terms, whose sum it is.

        Returns:
            term with first moments and mass (J is zero), and term with J only.
        """
        return Inertia(zeros(3, 3), self.ms, self.m), Inertia(self.J, zeros(), SX(0))

    def massive(self) -> tuple[Inertia, Inertia]:
        """Split the inertia in two terms, whose sum it is.

        Returns:
            term with J and first moments (the mass is zero), and the mass as a point at the origin.
        """
        return Inertia(self.J, self.ms, SX(0)), Inertia(zeros(3, 3), zeros(), self.m)


@formula((3, 3), (3, 1), (1, 1), (3, 1), (3, 1))
def _momentum(J: SX, ms: SX, m: SX, linear: SX, angular: SX) -> tuple[SX, SX]:
    """Return m v + w x ms and J w + ms x v, (3, 1) each; v is `linear` and w is `angular`."""
    return m * linear + cross(angular, ms), casadi.mtimes(J, angular) + cross(ms, linear)


# Second, first and zeroth moments of mass of a body.
#
# In this form of the ten inertial parameters the moment of a rotating body needs the fewest
# products.
#
# Source: Balafoutis, Patel & Misra 1988 (Euler's tensor of a body).


@dataclass(frozen=True, slots=True)
class PseudoInertia:
    """Mass distribution of a body, about the origin of a frame and in its axes.

    Attributes:
        S: (3, 3) symmetric second moments, the integral of r r' dm [kg m^2].
        ms: (3, 1) first moments, the integral of r dm [kg m].
        m: mass [kg].
    """

    S: SX
    ms: SX
    m: SX

    @staticmethod
    def of(inertia: Inertia) -> PseudoInertia:
        """Convert from the inertia tensor J about the same origin: S = tr(J) / 2 - J."""
        J = inertia.J
        S = casadi.densify(-J)
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            S[k, k] = times(SX(0.5), exact_sum(plus(J[m, m], J[n, n]), -J[k, k]))
        return PseudoInertia(S, inertia.ms, inertia.m)

    def inertia(self) -> Inertia:
        """Convert to the inertia tensor about the same origin: J = tr(S) - S."""
        S = self.S
        J = casadi.densify(-S)
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            J[k, k] = S[m, m] + S[n, n]
        return Inertia(J, self.ms, self.m)

    def __add__(self, other: PseudoInertia) -> PseudoInertia:
        """Return the inertia of two welded bodies, in the same frame."""
        return PseudoInertia(self.S + other.S, self.ms + other.ms, self.m + other.m)

    def rotate(self, R: Rotation) -> PseudoInertia:
        """Transform to a frame i with the same origin and other axes.

        Args:
            R: orientation of the current axes relative to i: it maps a vector from current axes to
                i.
        """
        return PseudoInertia(R.apply_to_tensor(self.S), R.apply(self.ms), self.m)

    def shift(self, axis: int, t: SX) -> PseudoInertia:
        """Return the inertia of the body displaced by t along an axis, about the same origin.

        Args:
            axis: index of the axis: 0, 1 or 2 for x, y or z.
            t: displacement [m]; frame axes are kept.
        """
        if t.is_zero():
            return self
        S, ms = +self.S, +self.ms
        ms[axis] = exact_sum(ms[axis], times(self.m, t))
        for k in ((axis + 1) % 3, (axis + 2) % 3):
            S[axis, k] = S[k, axis] = exact_sum(S[axis, k], times(t, self.ms[k]))
        across = times(t, exact_sum(self.ms[axis], ms[axis]))
        S[axis, axis] = exact_sum(S[axis, axis], across)
        return PseudoInertia(S, ms, self.m)

    def along_axis(self) -> tuple[PseudoInertia, PseudoInertia]:
        """Split the inertia in two terms, whose sum it is.

        A rotation about z does not change the second term.

        Returns:
            term with zero S33, MZ and M, and term with S33, MZ and M only: mass on the z axis.
        """
        S, on_axis, ms, height = +self.S, zeros(3, 3), +self.ms, zeros()
        on_axis[2, 2], S[2, 2] = S[2, 2], 0
        height[2], ms[2] = ms[2], 0
        return PseudoInertia(S, ms, SX(0)), PseudoInertia(on_axis, height, self.m)

    def rotational(self) -> tuple[PseudoInertia, PseudoInertia]:
        """Split the inertia in two terms, whose sum it is.

        Returns:
            term with first moments and mass (S is zero), and term with S only.
        """
        return PseudoInertia(zeros(3, 3), self.ms, self.m), PseudoInertia(self.S, zeros(), SX(0))

    def massive(self) -> tuple[PseudoInertia, PseudoInertia]:
        """Split the inertia in two terms, whose sum it is.

        Returns:
            term with S and first moments (the mass is zero), and the mass as a point at the origin.
        """
        return PseudoInertia(self.S, self.ms, SX(0)), PseudoInertia(zeros(3, 3), zeros(), self.m)


Body = TypeVar("Body", Inertia, PseudoInertia)
"""Type of a rigid body in one of the two forms of its ten parameters."""
