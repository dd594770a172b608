"""Tolerances of a motion: one number, or numbers for units and single states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.simulate.arguments import positive
from mbs.text import did_you_mean, quoted

Array = NDArray[np.float64]
Tolerance = float | Mapping[str, float]
"""A number for all states; or numbers by the unit or the name of states."""

OTHERS = "others"
"""Key of the tolerance of the states that are not named."""
DEFAULT = 1e-8
"""Tolerance of a motion [rad, m, rad/s or m/s]."""
_SMALL = 100.0
"""Tolerances below which a motion is small: its relative error is more than a percent."""


@dataclass(frozen=True, slots=True, eq=False)
class Tolerances:
    """Tolerances of the states of a motion.

    Attributes:
        common: tolerance of the states that are not named.
        sizes: (nx,) tolerances of all states as multiples of it; None if all are equal.
    """

    common: float
    sizes: Array | None = None


def tolerances_of(system: System, given: Tolerance) -> Tolerances:
    """Return the tolerances of the states q, v and z of a system.

    Args:
        system: open or closed.
        given: a number; or a dict from units, such as "rad" and "m/s", and names, such as "j1.q",
            to numbers. A name counts before a unit. "others" is for the other states, 1e-8 if left
            out.

    Raises:
        ModelError: a key is no unit and no state of the system, or a number is not positive.
    """
    if not isinstance(given, Mapping):
        return Tolerances(positive(given, "tolerance", system.name))
    states = [(f"{c.name}.q", c.unit) for c in system.coordinates]
    states += [(f"{s.name}.v", s.unit) for s in system.speeds]
    states += list(system.states)
    known = [OTHERS, *dict.fromkeys(unit for _, unit in states), *(name for name, _ in states)]
    numbers = dict[str, float]()
    for key, value in given.items():
        if key not in known:
            raise ModelError(
                f"{system.name}: tolerance names {quoted(key)}, which is no unit and no state;"
                f" {did_you_mean(str(key), known)}"
            )
        numbers[key] = positive(value, f"tolerance of {key}", system.name)
    common = numbers.get(OTHERS, DEFAULT)
    every = [numbers.get(name, numbers.get(unit, common)) for name, unit in states]
    return Tolerances(common, np.array(every) / common)


def small_motions(system: System, q: Array, tolerances: Tolerances) -> tuple[str, ...]:
    """Return the names of positions that move, but by less than 100 tolerances.

    Args:
        system: open or closed.
        q: (n, nq) positions of a motion.
        tolerances: of the motion.
    """
    moved = np.ptp(q, axis=0) if len(q) else np.zeros(q.shape[1])
    sizes = np.ones(q.shape[1]) if tolerances.sizes is None else tolerances.sizes[: q.shape[1]]
    least = tolerances.common * sizes
    found = (moved > 0) & (moved < _SMALL * least)
    return tuple(c.name for c, small in zip(system.coordinates, found, strict=True) if small)
