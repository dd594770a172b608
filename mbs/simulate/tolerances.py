"""Tolerances of a motion, common to all states or by unit and name of states."""

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
Tolerance = float | Mapping[str, float | tuple[float, float]]
"""Tolerance of all states, or dict of tolerances by unit or name of states. In a dict, a pair is an
absolute and a relative tolerance."""

OTHERS = "others"
"""Key of the tolerance of the states without entry in the dict."""
DEFAULT = 1e-8
"""Default absolute tolerance of a motion [rad, m, rad/s or m/s]."""
_SHARE = 0.04
"""Error tolerance of a step as a fraction of the tolerance of the motion."""
_RELATIVE = 0.025
"""Ratio of the relative to the absolute tolerance of a motion. It is small because an angle that
counts revolutions is large, but must not have a larger error."""
_LEAST_ABSOLUTE, _LEAST_RELATIVE = 1e-13, 1e-14
"""Smallest tolerances of a step, of the order of rounding errors of numbers of size one."""
_SMALL = 100.0
"""Number of tolerances below which a motion is small: its relative error exceeds one percent."""


@dataclass(frozen=True, slots=True, eq=False)
class Tolerances:
    """Tolerances of the states of a motion.

    Attributes:
        common: absolute tolerance of the states that are not named.
        absolute, relative: (nx,) tolerances of all states.
        named: Whether single states or units have different tolerances.
    """

    common: float
    absolute: Array
    relative: Array
    named: bool

    def of_step(self) -> tuple[float, float, Array | None]:
        """Return relative and absolute tolerance of a step, and factors of the states or None.

        The tolerance of a step is 1/25 of the tolerance of the motion, because the errors of steps
        accumulate. Smaller tolerances than rounding errors would only shorten the steps. The
        factors (2, nx) multiply the absolute and relative tolerance of each state.
        """
        rtol, atol = step_tolerances(self.common)
        if not self.named:
            return rtol, atol, None
        absolute = np.maximum(_SHARE * self.absolute, _LEAST_ABSOLUTE) / atol
        relative = np.maximum(_SHARE * self.relative, _LEAST_RELATIVE) / rtol
        return rtol, atol, np.array([absolute, relative])


def step_tolerances(tolerance: float) -> tuple[float, float]:
    """Return relative and absolute tolerance of a step for a common tolerance of the motion."""
    relative = max(_SHARE * _RELATIVE * tolerance, _LEAST_RELATIVE)
    return relative, max(_SHARE * tolerance, _LEAST_ABSOLUTE)


def tolerances_of(system: System, given: Tolerance) -> Tolerances:
    """Return the tolerances of the states q, v and z of a system.

    Args:
        system: open or closed system.
        given: absolute tolerance of all states, or dict of tolerances by unit, such as "rad" and
            "m/s", and by name, such as "j1.q". A name has priority over a unit. "others" is for
            the other states, 1e-8 by default. A number is an absolute tolerance, and the relative
            tolerance is 1/40 of it. In a dict, a pair is an absolute and a relative tolerance.

    Raises:
        ModelError: a key is neither a unit nor a state of the system, or a tolerance is not a
            finite positive number.
    """
    if isinstance(given, tuple | list):
        raise ModelError(
            f"{system.name}: tolerance is {quoted(given)}; give a number, or pairs of an absolute"
            ' and a relative tolerance in a dict, such as {"rad": (1e-8, 1e-6)}'
        )
    if not isinstance(given, Mapping):
        common = positive(given, "tolerance", system.name)
        every = np.full(system.nq + system.nv + len(system.states), common)
        return Tolerances(common, every, _RELATIVE * every, False)
    states = [(f"{c.name}.q", c.unit) for c in system.coordinates]
    states += [(f"{s.name}.v", s.unit) for s in system.velocity_coordinates]
    states += list(system.states)
    known = [OTHERS, *dict.fromkeys(unit for _, unit in states), *(name for name, _ in states)]
    numbers = dict[str, tuple[float, float]]()
    for key, value in given.items():
        if key not in known:
            base = str(key).removesuffix(".q").removesuffix(".v")
            if base in [coordinate.name for coordinate in system.cut_coordinates]:
                raise ModelError(
                    f"{system.name}: tolerance names {quoted(key)}, which is no state, since its"
                    " joint was cut to open a loop; name another joint of the loop, or cut another"
                    " one with m.cut(joint)"
                )
            raise ModelError(
                f"{system.name}: tolerance names {quoted(key)}, which is no unit and no state;"
                f" {did_you_mean(str(key), known)}"
            )
        numbers[key] = _pair(value, f"tolerance of {key}", system.name)
    others = numbers.get(OTHERS, (DEFAULT, _RELATIVE * DEFAULT))
    pairs = [numbers.get(name, numbers.get(unit, others)) for name, unit in states]
    absolute, relative = np.array(pairs).reshape(-1, 2).T
    return Tolerances(others[0], absolute, relative, True)


def _pair(value: object, what: str, where: str) -> tuple[float, float]:
    """Return the absolute and the relative tolerance of a number or a pair."""
    if isinstance(value, tuple | list):
        if len(value) != 2:
            raise ModelError(
                f"{where}: {what} is {quoted(value)}; give a number, or a pair of an absolute and a"
                " relative tolerance"
            )
        absolute, relative = (positive(one, what, where) for one in value)
        return absolute, relative
    number = positive(value, what, where)
    return number, _RELATIVE * number


def small_motions(system: System, q: Array, tolerances: Tolerances) -> tuple[str, ...]:
    """Return the names of positions that move, but by less than 100 tolerances.

    Args:
        system: open or closed system.
        q: positions of a motion, (n, nq).
        tolerances: tolerances of the motion.
    """
    columns = np.ascontiguousarray(q.T)  # extrema of rows are several times faster
    moved = columns.max(axis=1) - columns.min(axis=1) if len(q) else np.zeros(q.shape[1])
    found = (moved > 0) & (moved < _SMALL * tolerances.absolute[: q.shape[1]])
    return tuple(c.name for c, small in zip(system.coordinates, found, strict=True) if small)
