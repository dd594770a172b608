"""Forces along a coordinate of a joint: stops at its limits, friction that depends on velocity."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.components.forces import JointForce
from mbs.components.placement import SymbolTable
from mbs.components.smooth_sign import smooth_sign
from mbs.expressions import Number, Scalar, to_sx


@dataclass(frozen=True, slots=True, kw_only=True)
class JointStop(JointForce):
    """Elastic stops: nothing between the limits, springs and dampers beyond them.

    Over the first `width` beyond a limit the stiffness grows from zero to its full value, so that
    the force and two derivatives of it are continuous.

    Attributes:
        lower: limit [rad or m]; None for no stop on that side.
        upper: likewise.
        stiffness: [N m/rad or N/m].
        damping: [N m s/rad or N s/m], which grows over the same width.
        width: [rad or m].
    """

    lower: Scalar | None = None
    upper: Scalar | None = None
    stiffness: Scalar
    damping: Scalar = 0.0
    width: Scalar

    def __post_init__(self) -> None:
        JointForce.__post_init__(self)
        self._take_limits()
        self._normalise("stiffness", "damping", "width")
        self._require_magnitudes("damping")
        self._require_positive("stiffness", "width")

    @property
    def needs_position(self) -> bool:
        """A limit is one of a position."""
        return True

    def effort(self, q: SX | None, v: SX, symbols: SymbolTable) -> SX:
        """Stiffness times the depth, and damping where the stop is touched."""
        stiffness, damping = to_sx(self.stiffness, symbols), to_sx(self.damping, symbols)
        total = SX(0)
        for sign, depth, width in self._sides(q, symbols):
            share, ramp, _ = _ramp(depth, width)
            total += sign * stiffness * ramp + damping * share * v
        return total

    def energy(self, q: SX | None, symbols: SymbolTable) -> SX:
        """What the stops store."""
        stiffness = to_sx(self.stiffness, symbols)
        areas = (_ramp(depth, width)[2] for _, depth, width in self._sides(q, symbols))
        return stiffness * sum(areas, SX(0))

    def _sides(self, q: SX | None, symbols: SymbolTable) -> list[tuple[float, SX, SX]]:
        """Direction, depth beyond the limit and width of every stop."""
        assert q is not None
        width = to_sx(self.width, symbols)
        sides = []
        if self.upper is not None:
            sides.append((1.0, q - to_sx(self.upper, symbols), width))
        if self.lower is not None:
            sides.append((-1.0, to_sx(self.lower, symbols) - q, width))
        return sides


def _ramp(depth: SX, width: SX) -> tuple[SX, SX, SX]:
    """A slope that grows smoothly from 0 to 1 over a width, its integral, and that one's.

    With u = depth / width between 0 and 1 the slope is 3 u^2 - 2 u^3; the integral is
    depth - width / 2 from there on.
    """
    u = casadi.fmin(casadi.fmax(depth / width, 0), 1)
    beyond = casadi.fmax(depth - width, 0)
    slope = u**2 * (3 - 2 * u)
    ramp = width * u**3 * (1 - u / 2) + beyond
    area = width**2 * u**4 * (0.25 - 0.1 * u) + 0.5 * beyond * (beyond + width)
    return slope, ramp, area


@dataclass(frozen=True, slots=True, kw_only=True)
class JointFriction(JointForce):
    """Coulomb, Stribeck and viscous friction on a joint.

    Effort (coulomb + stribeck exp(-(v / velocity)^2)) tanh(v / width) + viscous v.

    Attributes:
        coulomb: dry friction while it slides [N m or N].
        stribeck: what dry friction has more than that at rest [N m or N].
        velocity: over which this falls to 1/e [rad/s or m/s].
        viscous: [N m s/rad or N s/m].
        width: velocity over which dry friction changes sign [rad/s or m/s].
    """

    coulomb: Scalar = 0.0
    stribeck: Scalar = 0.0
    velocity: Scalar = 0.1
    viscous: Scalar = 0.0
    width: Scalar = 1e-3

    def __post_init__(self) -> None:
        JointForce.__post_init__(self)
        self._normalise("coulomb", "stribeck", "velocity", "viscous", "width")
        self._require_magnitudes("coulomb", "stribeck", "viscous")
        self._require_positive("velocity", "width")
        self._require_effect("coulomb", "stribeck", "viscous")

    def effort(self, q: SX | None, v: SX, symbols: SymbolTable) -> SX:
        """Dry friction that falls from rest to sliding, and viscous friction."""
        dry = to_sx(self.coulomb, symbols)
        if self.stribeck != Number(0.0):
            falling = casadi.exp(-((v / to_sx(self.velocity, symbols)) ** 2))
            dry = dry + to_sx(self.stribeck, symbols) * falling
        total = to_sx(self.viscous, symbols) * v
        return total + dry * smooth_sign(v, to_sx(self.width, symbols))

    def energy(self, q: SX | None, symbols: SymbolTable) -> SX:
        """Friction stores nothing."""
        return SX(0)
