"""Checks of durations, steps and tolerances of simulations."""

import math
import numbers

from mbs.errors import ModelError
from mbs.text import quoted

LONGEST = 10_000_000
"""Maximum number of rows of a result."""


def positive(value: object, what: str, where: str) -> float:
    """Return a value as a finite positive float.

    Args:
        value: value to check.
        what: name and unit of the value, for the error message.
        where: name of the model, for the error message.

    Raises:
        ModelError: the value is not a finite positive number.
    """
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        number = float(value)
        if math.isfinite(number) and number > 0:
            return number
    raise ModelError(f"{where}: {what} is {quoted(value)}; give a finite positive number")


def count_steps(duration: float, step: float, where: str) -> int:
    """Return the number of steps of a duration, at least 1.

    Args:
        duration: positive duration [s].
        step: positive time step [s].
        where: name of the model, for the error message.

    Raises:
        ModelError: the result would have more than `LONGEST` rows.
    """
    if not duration / LONGEST <= step:
        raise ModelError(
            f"{where}: {duration:g} s in steps of {step:g} s are more than {LONGEST} rows;"
            " give a longer step"
        )
    return max(1, round(duration / step))
