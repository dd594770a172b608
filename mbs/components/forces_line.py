"""Forces along the line between two points: springs, dampers, attraction of two masses.

Source: Haug 1989 for translational springs, dampers and actuators.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.components.forces import PairForce, Pull, RelativeMotion
from mbs.components.placement import SymbolTable
from mbs.expressions import Scalar, to_sx
from mbs.spatial import zeros

SHORTEST = 1e-12
"""Length [m] that is added to every distance as the root of a sum of squares."""


@dataclass(frozen=True, slots=True)
class LineForce(PairForce):
    """A tension along the line from a to b, a function of the distance L and of its rate.

    L is sqrt(d'd + (1e-12 m)^2), d being the vector from a to b: where the points coincide the
    direction is not defined, and the force is zero there instead of not a number.
    """

    def tension(self, length: SX, rate: SX, symbols: SymbolTable) -> SX:
        """Force that draws the points together [N] at this distance [m] and rate [m/s]."""
        raise NotImplementedError

    def potential(self, length: SX, symbols: SymbolTable) -> SX:
        """Energy [J] whose slope in the distance is the tension at rest."""
        raise NotImplementedError

    def pull(self, motion: RelativeMotion, symbols: SymbolTable) -> Pull:
        """The tension, towards b."""
        length = regular_length(motion.p)
        along = motion.p / length
        rate = casadi.dot(along, motion.V)
        return Pull(along * self.tension(length, rate, symbols), zeros(), zeros())

    def energy(self, motion: RelativeMotion, symbols: SymbolTable) -> SX:
        """The potential of the distance."""
        return self.potential(regular_length(motion.p), symbols)


def regular_length(p: SX) -> SX:
    """Length of a vector (3, 1), regular where it is zero."""
    return casadi.sqrt(casadi.dot(p, p) + SHORTEST**2)


@dataclass(frozen=True, slots=True)
class Spring(LineForce):
    """A spring, with a damper beside it: tension k (L - L0) + c dL/dt.

    Attributes:
        stiffness: k [N/m].
        length: free length L0 [m].
        damping: c [N s/m].
    """

    stiffness: Scalar
    length: Scalar = 0.0
    damping: Scalar = 0.0

    def __post_init__(self) -> None:
        PairForce.__post_init__(self)
        self._normalise("stiffness", "length", "damping")
        self._require_magnitudes("stiffness", "length", "damping")
        self._require_effect("stiffness", "damping")

    def tension(self, length: SX, rate: SX, symbols: SymbolTable) -> SX:
        """The stretch times the stiffness, and the damping times the rate."""
        stretch = length - to_sx(self.length, symbols)
        return to_sx(self.stiffness, symbols) * stretch + to_sx(self.damping, symbols) * rate

    def potential(self, length: SX, symbols: SymbolTable) -> SX:
        """Half the stiffness times the square of the stretch."""
        stretch = length - to_sx(self.length, symbols)
        return 0.5 * to_sx(self.stiffness, symbols) * stretch**2


@dataclass(frozen=True, slots=True)
class Damper(LineForce):
    """A damper alone: tension c dL/dt.

    Attributes:
        damping: c [N s/m].
    """

    damping: Scalar

    def __post_init__(self) -> None:
        PairForce.__post_init__(self)
        self._normalise("damping")
        self._require_magnitudes("damping")
        self._require_effect("damping")

    def tension(self, length: SX, rate: SX, symbols: SymbolTable) -> SX:
        """The damping times the rate of the distance."""
        return to_sx(self.damping, symbols) * rate

    def potential(self, length: SX, symbols: SymbolTable) -> SX:
        """A damper stores nothing."""
        return SX(0)


@dataclass(frozen=True, slots=True)
class Attraction(LineForce):
    """Attraction by the inverse square of the distance: tension mu / L^2.

    Central gravity of a body of mass m: mu = G M m, its points the two centres of mass.

    Attributes:
        strength: mu [N m^2]; below zero the points repel each other, as equal charges do.
    """

    strength: Scalar

    def __post_init__(self) -> None:
        PairForce.__post_init__(self)
        self._normalise("strength")
        self._require_effect("strength")

    def tension(self, length: SX, rate: SX, symbols: SymbolTable) -> SX:
        """The strength over the square of the distance."""
        return to_sx(self.strength, symbols) / length**2

    def potential(self, length: SX, symbols: SymbolTable) -> SX:
        """-mu / L, zero at infinity."""
        return -to_sx(self.strength, symbols) / length
