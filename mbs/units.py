"""Units of all quantities in mbs: one table for documentation, results and FMUs.

All units are SI. A `Unit` has the exponents of its base units, which an FMU declares, and a display
unit if another unit is usual (degrees). Products such as "kg/m" or "m3/s" are derived from their
factors.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit with exponents of SI base units, and a display unit.

    Attributes:
        name: name in tables and FMUs, such as `N.m`.
        exponents: base unit (kg, m, s, rad) to exponent; zero exponents are left out.
        display: name of the display unit, or None.
        display_factor: value in the display unit = factor * value.
    """

    name: str
    exponents: Mapping[str, int] = field(default_factory=dict)
    display: str | None = None
    display_factor: float = 1.0


_DEGREES = 57.29577951308232  # degrees per radian, 180 / pi

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

_FACTORS: Mapping[str, Mapping[str, int]] = {
    **{unit.name: unit.exponents for unit in _UNITS if unit.name.isalpha()},
    **{name: {name: 1} for name in ("K", "mol", "cd")},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "C": {"A": 1, "s": 1},
    "T": {"kg": 1, "s": -2, "A": -1},
}
"""Units from which products are made."""

_FACTOR = re.compile(r"([A-Za-z]+)(\d?)")


class _Units(Mapping[str, Unit]):
    """Dict of units by name: the table, and products of its units such as "N.s2/m"."""

    def __init__(self, table: tuple[Unit, ...]) -> None:
        self._known = {unit.name: unit for unit in table}

    def __getitem__(self, name: str) -> Unit:
        if name not in self._known:
            self._known[name] = Unit(name, _exponents(name))
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter([unit.name for unit in _UNITS])

    def __len__(self) -> int:
        return len(_UNITS)


def _exponents(name: str) -> dict[str, int]:
    """Return the exponents of base units of a product of units, such as "kg/m" or "m3/s".

    Raises:
        KeyError: the name is no product of known units.
    """
    total: dict[str, int] = {}
    over, *under = name.split("/") if isinstance(name, str) else [""]
    if len(under) > 1:
        raise KeyError(name)
    for sign, part in ((1, over), *((-1, text) for text in under)):
        for factor in part.split("."):
            match = _FACTOR.fullmatch(factor)
            if factor == "1" and sign == 1:
                continue
            if match is None or match[1] not in _FACTORS:
                raise KeyError(name)
            for base, exponent in _FACTORS[match[1]].items():
                total[base] = total.get(base, 0) + sign * exponent * int(match[2] or 1)
    return {base: exponent for base, exponent in total.items() if exponent}


UNITS: Mapping[str, Unit] = _Units(_UNITS)
"""Unit by name. It contains the units of the table and accepts their products."""


def rate_unit(unit: str) -> str:
    """Return the unit of the time derivative of a quantity: "m/s" for "m", "N.m/s" for "N.m"."""
    return f"{unit}.s" if "/" in unit else f"{unit}/s"
