"""A relation between two coordinates, such as a gear makes."""

from __future__ import annotations

from dataclasses import dataclass

from casadi import SX


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateCoupling:
    """driven = sum of c_k driver^k between two elements of q.

    Attributes:
        name: of the coupling.
        driven, driver: numbers in q.
        coefficients: c_0, c_1, ...
    """

    name: str
    driven: int
    driver: int
    coefficients: tuple[SX, ...]

    def value(self, driver: SX) -> SX:
        """The driven coordinate for a position of the driver."""
        return sum((c * driver**k for k, c in enumerate(self.coefficients)), SX(0))
