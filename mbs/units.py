"""Units of every quantity that mbs names: one table for documentation, results and FMUs.

Everything is SI. A `Unit` carries its exponents of the base units, which is what an FMU declares,
and a display unit where people read another one (degrees).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: its name, its exponents of SI base units, and the unit people like to read.

    Attributes:
        name: as written in tables and FMUs, such as `N.m`.
        exponents: base unit (kg, m, s, rad) to exponent; zero exponents are left out.
        display: name of the display unit, or None.
        display_factor: value in the display unit = factor * value.
    """

    name: str
    exponents: Mapping[str, int] = field(default_factory=dict)
    display: str | None = None
    display_factor: float = 1.0


_DEGREES = 57.29577951308232  # 180 / pi

_UNITS = (
    Unit("1"),
    Unit("s", {"s": 1}),
    Unit("rad", {"rad": 1}, "deg", _DEGREES),
    Unit("rad/s", {"rad": 1, "s": -1}, "deg/s", _DEGREES),
    Unit("rad/s2", {"rad": 1, "s": -2}, "deg/s2", _DEGREES),
    Unit("m", {"m": 1}),
    Unit("m/s", {"m": 1, "s": -1}),
    Unit("m/s2", {"m": 1, "s": -2}),
    Unit("kg", {"kg": 1}),
    Unit("kg.m", {"kg": 1, "m": 1}),
    Unit("kg.m2", {"kg": 1, "m": 2}),
    Unit("N", {"kg": 1, "m": 1, "s": -2}),
    Unit("N.m", {"kg": 1, "m": 2, "s": -2}),
    Unit("N.s/m", {"kg": 1, "s": -1}),
    Unit("N.m.s/rad", {"kg": 1, "m": 2, "s": -1, "rad": -1}),
    Unit("J", {"kg": 1, "m": 2, "s": -2}),
    Unit("W", {"kg": 1, "m": 2, "s": -3}),
    Unit("1/s", {"s": -1}),
    Unit("A", {"A": 1}),
    Unit("A/s", {"A": 1, "s": -1}),
    Unit("V", {"kg": 1, "m": 2, "s": -3, "A": -1}),
    Unit("ohm", {"kg": 1, "m": 2, "s": -3, "A": -2}),
    Unit("H", {"kg": 1, "m": 2, "s": -2, "A": -2}),
    Unit("N.m/A", {"kg": 1, "m": 2, "s": -2, "A": -1}),
    Unit("N.m/rad", {"kg": 1, "m": 2, "s": -2, "rad": -1}),
)

UNITS: Mapping[str, Unit] = MappingProxyType({unit.name: unit for unit in _UNITS})
"""Every unit by its name."""
