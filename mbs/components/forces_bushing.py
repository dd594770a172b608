"""Bushings: elastic mounts between two frames.

Source: Haug 1989 for forces between bodies; the angles are those of the unit quaternion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
from casadi import SX

from mbs.components.forces import PairForce, Pull, RelativeMotion
from mbs.components.inertia_rules import three
from mbs.components.placement import SymbolTable
from mbs.expressions import to_sx
from mbs.spatial import cross, vector

_HALF_TURN = 1e-12
_STRENGTHS = ("stiffness", "damping", "angular_stiffness", "angular_damping")


@dataclass(frozen=True, slots=True)
class Bushing(PairForce):
    """Springs and dampers along and about the three axes of frame a, at rest where a and b agree.

    The displacement is p, the origin of b in frame a; the angles are phi = 2 sin(theta / 2) u for
    a turn by theta about u, which is the vector of small rotations where theta is small. Forces
    and moments are exact derivatives of the energy p' K p / 2 + phi' K_phi phi / 2 for any turn
    of less than half a turn.

    Attributes:
        stiffness: K along the axes of a [N/m], three numbers, or one for all.
        damping: [N s/m], likewise.
        angular_stiffness: K_phi about the axes of a [N m/rad], likewise.
        angular_damping: [N m s/rad], likewise.
    """

    stiffness: Any = 0.0
    damping: Any = 0.0
    angular_stiffness: Any = 0.0
    angular_damping: Any = 0.0

    def __post_init__(self) -> None:
        PairForce.__post_init__(self)
        for name in _STRENGTHS:
            given = getattr(self, name)
            alike = isinstance(given, str) or not hasattr(given, "__iter__")
            values = three((given,) * 3 if alike else given, f"{self.name}, {name}")
            object.__setattr__(self, name, values)
        self._require_magnitudes(*_STRENGTHS)
        self._require_effect(*_STRENGTHS)

    def pull(self, motion: RelativeMotion, symbols: SymbolTable) -> Pull:
        """Force and moment at the origin of b, carried to the origin of a."""
        half, cosine = _half_turn(motion.R)
        w = motion.w
        rate = cosine * w + cross(w, half)
        force = self._sum("stiffness", motion.p, "damping", motion.V, symbols)
        torque = self._sum("angular_stiffness", 2 * half, "angular_damping", rate, symbols)
        moment = cosine * torque + cross(half, torque)
        return Pull(force, moment + cross(motion.p, force), -moment)

    def energy(self, motion: RelativeMotion, symbols: SymbolTable) -> SX:
        """The energy p' K p / 2 + phi' K_phi phi / 2."""
        half, _ = _half_turn(motion.R)
        total = SX(0)
        for name, x in (("stiffness", motion.p), ("angular_stiffness", 2 * half)):
            total += 0.5 * casadi.dot(x, self._vector(name, symbols) * x)
        return total

    def _sum(self, one: str, x: SX, other: str, rate: SX, symbols: SymbolTable) -> SX:
        return self._vector(one, symbols) * x + self._vector(other, symbols) * rate

    def _vector(self, name: str, symbols: SymbolTable) -> SX:
        return vector(to_sx(value, symbols) for value in getattr(self, name))


def _half_turn(R: SX) -> tuple[SX, SX]:
    """sin(theta / 2) u and cos(theta / 2) of a rotation by theta about u."""
    cosine = 0.5 * casadi.sqrt(1 + casadi.trace(R) + _HALF_TURN**2)
    axis = vector([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return axis / (4 * cosine), cosine
