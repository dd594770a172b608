"""Numbers in text: files, tables, the command line and the page read them by one rule.

A number is a text of the grammar without symbols, such as 0.3 or pi/2; formats whose own tools
take nothing but digits have plain numbers. Neither is infinite.
"""

from __future__ import annotations

import math
import re

from mbs.errors import ExpressionError
from mbs.expressions.evaluate import to_float
from mbs.expressions.expression import NUMBER, Expression, Scalar, expression
from mbs.text import quoted

_PLAIN = re.compile(rf"[-+]?{NUMBER}", re.ASCII)


def number(value: Scalar, where: str) -> float:
    """The number that a text, or an expression whose symbols have values, is.

    Args:
        value: as it was written.
        where: which file, field or option, for the error message.

    Raises:
        ExpressionError: it is not of the grammar, has a symbol in it, or is True or False.
    """
    found = _find(value, where)
    if found is None:
        raise ExpressionError(
            f"{where}: {_given(value)} is not a number; write one, such as 0.3 or pi/2"
        )
    return found


def whole_number(value: Scalar, where: str) -> int:
    """The whole number that a text or an expression is; arguments and errors as for `number`."""
    found = _find(value, where)
    if found is None or not found.is_integer():
        raise ExpressionError(f"{where}: {_given(value)} is not a whole number; write one")
    return int(found)


def _find(value: Scalar, where: str) -> float | None:
    return None if isinstance(value, bool) else to_float(expression(value, where))


def _given(value: Scalar) -> str:
    return quoted(str(value) if isinstance(value, Expression) else value)


def plain_numbers(text: str, count: int, where: str) -> tuple[float, ...]:
    """Numbers in digits, between blanks.

    Args:
        text: as it was written.
        count: how many there must be.
        where: which file, field or option, for the error message.

    Raises:
        ExpressionError: there are others than so many finite numbers.
    """
    words = text.split()
    values = tuple(float(word) for word in words if _PLAIN.fullmatch(word))
    if not len(values) == len(words) == count or not all(map(math.isfinite, values)):
        raise ExpressionError(
            f"{where}: {quoted(text)} is not {count} finite number(s); correct it"
        )
    return values
