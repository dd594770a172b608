"""Checks of the numbers that simulations are asked with."""

import numbers

import numpy as np

from mbs.errors import ModelError
from mbs.text import quoted

LONGEST = 10_000_000
"""Rows of the longest result."""


def positive(value: object, what: str, where: str) -> float:
    """A finite positive number.

    Args:
        value: what was given.
        what: its name and unit, for the message.
        where: of what it is, for the message.

    Raises:
        ModelError: it is anything else.
    """
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        number = float(value)
        if np.isfinite(number) and number > 0:
            return number
    raise ModelError(f"{where}: {what} is {quoted(value)}; give a finite positive number")


def count_steps(duration: float, step: float, where: str) -> int:
    """How many steps make a duration, one at least.

    Args:
        duration: s, positive.
        step: s, positive.
        where: of what it is, for the message.

    Raises:
        ModelError: the result would be too long.
    """
    if not duration / LONGEST <= step:
        raise ModelError(
            f"{where}: {duration:g} s in steps of {step:g} s are more than {LONGEST} rows;"
            " give a longer step"
        )
    return max(1, round(duration / step))
