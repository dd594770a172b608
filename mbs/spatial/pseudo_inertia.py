"""The second, first and zeroth moments of a body's mass.

They hold the ten inertial parameters in the form in which the moment of a turning body takes the
fewest products.

Source: Balafoutis, Patel & Misra 1988 (Euler's tensor of a body).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import casadi
from casadi import SX

from mbs.spatial.inertia import Inertia
from mbs.spatial.rotation import Rotation
from mbs.spatial.vectors import exact_sum, zeros


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
        """From the inertia tensor: S = tr(J) / 2 - J."""
        J = inertia.J
        S = casadi.densify(-J)
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            S[k, k] = 0.5 * exact_sum(J[m, m] + J[n, n], -J[k, k])
        return PseudoInertia(S, inertia.ms, inertia.m)

    def inertia(self) -> Inertia:
        """With the inertia tensor: J = tr(S) - S."""
        S = self.S
        J = casadi.densify(-S)
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            J[k, k] = S[m, m] + S[n, n]
        return Inertia(J, self.ms, self.m)

    def __add__(self, other: PseudoInertia) -> PseudoInertia:
        """Two bodies welded together, in one frame."""
        return PseudoInertia(self.S + other.S, self.ms + other.ms, self.m + other.m)

    def turned(self, R: Rotation) -> PseudoInertia:
        """The same body about the same point in the axes of frame i."""
        return PseudoInertia(R.apply_to_tensor(self.S), R.apply(self.ms), self.m)

    def slid(self, axis: int, t: SX) -> PseudoInertia:
        """The body displaced by t [m] along a coordinate axis."""
        if t.is_zero():
            return self
        S, ms = SX(self.S), SX(self.ms)
        ms[axis] = exact_sum(ms[axis], self.m * t)
        for k in ((axis + 1) % 3, (axis + 2) % 3):
            S[axis, k] = S[k, axis] = exact_sum(S[axis, k], t * self.ms[k])
        S[axis, axis] = exact_sum(S[axis, axis], t * exact_sum(self.ms[axis], ms[axis]))
        return PseudoInertia(S, ms, self.m)

    def along_axis(self) -> tuple[PseudoInertia, PseudoInertia]:
        """Two bodies that make this one: the first has no S33, MZ, M.

        The second is mass on the z axis: no turn about it can be felt.
        """
        S, on_axis, ms, height = SX(self.S), zeros(3, 3), SX(self.ms), zeros()
        on_axis[2, 2], S[2, 2] = S[2, 2], 0
        height[2], ms[2] = ms[2], 0
        return PseudoInertia(S, ms, SX(0)), PseudoInertia(on_axis, height, self.m)

    def rotational(self) -> tuple[PseudoInertia, PseudoInertia]:
        """Two bodies that make this one: the first has no S, the second S alone."""
        return PseudoInertia(zeros(3, 3), self.ms, self.m), PseudoInertia(self.S, zeros(), SX(0))

    def massive(self) -> tuple[PseudoInertia, PseudoInertia]:
        """Two bodies that make this one: the first has no mass, the second M alone."""
        return PseudoInertia(self.S, self.ms, SX(0)), PseudoInertia(zeros(3, 3), zeros(), self.m)


Body = TypeVar("Body", Inertia, PseudoInertia)
"""A rigid body in either form of its ten parameters."""
