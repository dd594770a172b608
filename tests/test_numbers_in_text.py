"""Numbers in text are read by one rule."""

import math

import pytest

from mbs.errors import ExpressionError
from mbs.expressions import Parameter, number, plain_numbers, whole_number


@pytest.mark.parametrize(
    ("value", "found"),
    [("pi/2", math.pi / 2), (" -2e-3 ", -2e-3), (3, 3.0), (Parameter("L", 0.5), 0.5)],
)
def test_a_number_is_a_text_without_open_symbols(value, found):
    assert number(value, "x") == found


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("2*L", "x: '2*L' is not a number; write one, such as 0.3 or pi/2"),
        (Parameter("L"), "x: 'L' is not a number; write one, such as 0.3 or pi/2"),
        (True, "x: True is not a number; write one, such as 0.3 or pi/2"),
        ("nan", "x: cannot read 'nan': nan is not a finite number"),
        ("1_0", "x: "),
    ],
)
def test_what_is_not_a_number_is_refused(value, words):
    with pytest.raises(ExpressionError) as caught:
        number(value, "x")
    assert str(caught.value).startswith(words)


def test_whole_numbers_have_no_fraction():
    assert whole_number("6/2", "x") == 3
    for text in ("2.5", "n"):
        with pytest.raises(ExpressionError, match=f"x: '{text}' is not a whole number; write one"):
            whole_number(text, "x")


def test_plain_numbers_are_digits_alone():
    assert plain_numbers(" 1 -2.5e1\t+.5 ", 3, "x") == (1.0, -25.0, 0.5)
    for text in ("1 2", "1 2 3 4", "1 2 pi", "1 2 nan", "1 2 1e999", "1 2 3_0", "1 2 ٣"):
        with pytest.raises(ExpressionError, match=r"is not 3 finite number\(s\); correct it"):
            plain_numbers(text, 3, "x")
