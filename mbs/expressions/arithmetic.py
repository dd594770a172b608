"""The operators of the grammar on numbers, or on anything that adds and multiplies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

_ROUNDING = 4e-16
"""Functions of quarter turns miss -1, 0 and 1 by this much; they are put exactly there."""


def apply_float(operator: str, values: list[float]) -> float:
    """The result of an operator or function on numbers, NaN where there is none."""
    try:
        with np.errstate(all="ignore"):
            result = arithmetic(operator, [np.float64(v) for v in values])
        if result is None:
            result = getattr(math, operator)(*values)
            nearest = round(result)
            result = nearest if abs(result - nearest) < _ROUNDING else result
        return float(result)
    except (ArithmeticError, ValueError):
        return math.nan


def arithmetic(operator: str, values: list[Any]) -> Any:
    """The result of an operator, None for a function."""
    first, *rest = values
    match operator:
        case "+":
            return first + rest[0]
        case "-":
            return first - rest[0]
        case "*":
            return first * rest[0]
        case "/":
            return first / rest[0]
        case "^":
            return first ** rest[0]
        case "negate":
            return -first
    return None
