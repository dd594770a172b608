"""Numbers in text, by one rule for files, tables, the command line and the page.

A number is a text of the grammar without symbols, such as 0.3 or pi/2. Formats whose own tools
accept digits only use plain numbers. Infinite numbers are errors.
"""

from __future__ import annotations

import math
import re

from mbs.errors import ExpressionError
from mbs.expressions._expression import NUMBER, Expression, Scalar, expression
from mbs.expressions.evaluate import to_float
from mbs.text import quoted

_PLAIN = re.compile(rf"[-+]?{NUMBER}", re.ASCII)


def number(value: Scalar, where: str) -> float:
    """Return the value of a number, of its text, or of an expression with known symbols.

    Args:
        value: number, text or expression as the user wrote it.
        where: name of the file, field or option, for the error message.

    Raises:
        ExpressionError: the text is not in the grammar, a symbol has no value, or the value is
            True or False.
    """
    found = _find(value, where)
    if found is None:
        raise ExpressionError(
            f"{where}: {_given(value)} is not a number; write one, such as 0.3 or pi/2"
        )
    return found


def whole_number(value: Scalar, where: str) -> int:
    """Return the value of a whole number, of its text, or of an expression with known symbols.

    Args:
        value: number, text or expression as the user wrote it.
        where: name of the file, field or option, for the error message.

    Raises:
        ExpressionError: the text is not in the grammar, a symbol has no value, or the value is not
            whole.
    """
    found = _find(value, where)
    if found is None or not found.is_integer():
        raise ExpressionError(f"{where}: {_given(value)} is not a whole number; write one")
    return int(found)


def _find(value: Scalar, where: str) -> float | None:
    """Return the value; None for True, False, unknown symbols and values that are not finite.

    `where` is named in the message of the ExpressionError that a wrong text raises.
    """
    return None if isinstance(value, bool) else to_float(expression(value, where))


def _given(value: Scalar) -> str:
    """Return the text of the value for error messages, in quotation marks."""
    return quoted(str(value) if isinstance(value, Expression) else value)


def plain_numbers(text: str, count: int, where: str) -> tuple[float, ...]:
    """Return numbers that are written in digits and separated by blanks.

    Args:
        text: text as the user wrote it.
        count: required number of numbers.
        where: name of the file, field or option, for the error message.

    Raises:
        ExpressionError: the text is not exactly `count` finite numbers.
    """
    words = text.split()
    values = tuple(float(word) for word in words if _PLAIN.fullmatch(word))
    if not len(values) == len(words) == count or not all(map(math.isfinite, values)):
        raise ExpressionError(
            f"{where}: {quoted(text)} is not {count} finite number(s); correct it"
        )
    return values
