"""Relations between the coordinates of joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mbs.components.component import Component
from mbs.errors import DescriptionError
from mbs.expressions import Scalar, expression
from mbs.messages import quoted


@dataclass(frozen=True, slots=True)
class Coupling(Component):
    """A relation between the positions of two joints: driven = sum of c_k driver^k.

    Gears, mimic joints and joint equalities; one row on the coordinates.

    Attributes:
        driven: name of the coordinate that follows.
        driver: name of the coordinate that leads.
        coefficients: c_0, c_1, ... of the polynomial.
    """

    driven: str = ""
    driver: str = ""
    coefficients: tuple[Scalar, ...] = (0.0, 1.0)

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if isinstance(self.coefficients, str) or not hasattr(self.coefficients, "__iter__"):
            raise DescriptionError(
                f"{self.name}: coefficients {quoted(self.coefficients)} are not a sequence;"
                " give c_0, c_1, ..., such as (0, ratio) for a gear"
            )
        terms = tuple(expression(c, f"{self.name}, coefficients") for c in self.coefficients)
        object.__setattr__(self, "coefficients", terms)
        if self.driven == self.driver:
            raise DescriptionError(
                f"{self.name}: the coordinate {self.driven!r} cannot follow itself; name two"
            )

    def scoped(self, prefix: str) -> Coupling:
        """The same relation inside a mechanism that is placed in another one."""
        inner = Component.scoped(self, prefix)
        return replace(inner, driven=f"{prefix}.{self.driven}", driver=f"{prefix}.{self.driver}")
