"""No text leaves a comment, in any syntax of comments."""

import unicodedata

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mbs.text import (
    ascii_line,
    in_bracket_comment,
    in_c_comment,
    in_docstring,
    in_line_comment,
    in_wolfram_comment,
    one_line,
)

ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"
PIECES = [
    *"*/()?\\\"'!#%{}=-$&",
    *ENDS,
    "\0",
    "\x1a",
    "\x7f",
    "\u202e",
    "\u2066",
    "\u200b",
    "\ufeff",
]
PIECES += ["\uff0a", "\uff0f", "\uff3c", "\u2047", "\ud800", "a", " ", "\t", "\u00e9", "\U0001f916"]
texts = st.lists(st.sampled_from(PIECES), max_size=12).map("".join) | st.text(max_size=30)
RULES = (in_c_comment, in_line_comment, in_bracket_comment, in_wolfram_comment, in_docstring)


def written(rule):
    """What generated text holds: a rule on a name, with its accents or without."""
    return lambda text: (rule(text), rule(ascii_line(text)))


@pytest.mark.parametrize("rule", [one_line, ascii_line, *RULES])
@given(text=texts)
@example(text="".join(map(chr, range(0x2100))))
def test_one_line_of_letters_that_are_seen(rule, text):
    result = rule(text)
    assert len(result.splitlines()) <= 1
    assert not any(unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") for c in result)
    result.encode("utf-8")


@pytest.mark.parametrize("rule", [in_c_comment, in_line_comment])
@given(text=texts)
@example(text="*\\")
@example(text="*\u200b/")
@example(text="*\uff0f")
@example(text="*?\0?/")
def test_neither_marks_of_c_nor_what_joins_lines(rule, text):
    for result in written(rule)(text):
        assert not any(mark in result for mark in ("*/", "/*", "\\", "??"))


@pytest.mark.parametrize("rule", [in_bracket_comment, in_wolfram_comment])
@given(text=texts)
@example(text="((**))")
@example(text="(*)")
def test_neither_bracket_with_a_star(rule, text):
    for result in written(rule)(text):
        assert "(*" not in result
        assert "*)" not in result


@given(text=texts)
def test_no_escapes_in_mathematica(text):
    assert "\\" not in in_wolfram_comment(text)


@given(text=texts)
def test_nothing_that_ends_a_docstring(text):
    for result in written(in_docstring)(text):
        assert '"' not in result
        assert "\\" not in result


@pytest.mark.parametrize("rule", RULES)
@given(text=texts)
def test_twice_is_once(rule, text):
    assert rule(rule(text)) == rule(text)


@pytest.mark.parametrize("rule", RULES)
def test_what_people_write_stays(rule):
    text = (
        "Armstrong, Khatib & Burdick 1986 (table 1), https://doi.org/10.1/x?y=1#z: 'the' 50 % arm"
    )
    assert rule(text) == text


def test_accents_stay_where_the_text_may_have_them():
    assert in_bracket_comment("  Frédéric\n Boyer ") == "Frédéric Boyer"
    assert ascii_line("Frédéric Boyer") == "Frederic Boyer"
