"""Rows of a record of a closed system that are next to singular postures."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification.leading import led

Array = npt.NDArray[np.float64]
Chosen = npt.NDArray[np.bool_]

_FEWEST = 0.5
_ROUNDING = 1e-9


def led_rows(system: System, q: Array) -> Chosen:
    """(n,) which postures q (n, nq) of a closed system are not next to singular ones.

    Raises:
        ModelError: they are less than half of all.
    """
    good = led(system, q)
    if good.mean() < _FEWEST:
        names = ", ".join(system.speeds[k].name for k in system.active)
        raise ModelError(
            f"{system.name}: {100 * (1 - good.mean()):.0f} % of the record is next to singular"
            f" postures, where {names} do not lead the other joints; record a motion that keeps"
            " away from them, or assemble with other independent joints"
        )
    return good


def on_lines(values: Array, good: Chosen) -> Array:
    """(n, ...) values with straight lines between the rows that are good."""
    if good.all():
        return values
    at, known = np.arange(len(good)), np.flatnonzero(good)
    flat = values.reshape(len(good), -1).copy()
    for k in range(flat.shape[1]):
        flat[:, k] = np.interp(at, known, flat[known, k])
    return flat.reshape(values.shape)


def without(time: Array, bad: Array, ahead: float, back: float) -> Chosen:
    """(n,) instants that have none of the bad ones from `back` before to `ahead` after them."""
    first = np.searchsorted(bad, time - back * (1 + _ROUNDING), side="left")
    last = np.searchsorted(bad, time + ahead * (1 + _ROUNDING), side="right")
    return np.asarray(first == last, dtype=bool)
