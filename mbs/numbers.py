"""What counts as numbers in a call, of lists, arrays and scalars, and what stands for zero."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.text import quoted

NONZERO = 1e-300
"""Stands for zero where one divides: zero over it is zero, numbers up to 1e8 over it are finite,
and it is below the square of every length and speed that means anything."""


def doubles(value: Any) -> NDArray[np.float64] | str:
    """The numbers in a value as doubles; integers, booleans and shorter floats become doubles.

    Args:
        value: anything.

    Returns:
        an array, the value itself where it is one of doubles already; or, of what holds no
        numbers, what is wrong and what to do, the end of a sentence.
    """
    if isinstance(value, np.ma.MaskedArray):
        return "has a mask, which would be passed over; give array.filled(value)"
    try:
        array = np.asarray(value)
    except ValueError:
        return f"is {quoted(value)}; give numbers"
    if array.dtype.kind not in "biuf":
        what = f"an array of {array.dtype}" if isinstance(value, np.ndarray) else quoted(value)
        return f"is {what}; give numbers"
    return array.astype(float, copy=False)
