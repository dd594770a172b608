"""Parts of error messages, and foreign texts inside of comments."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from difflib import get_close_matches

DISTRIBUTION = "casadi-mbs"
"""Name of the package on PyPI, where `mbs` is another project."""
_LONGEST_QUOTE = 80
_LONGEST_LIST = 20
_LONGEST_REASON = 200
_MOST_COMPARED = 1000


def quoted(value: object) -> str:
    """Return the repr of a value on one line, shortened to about 80 characters."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # an integer with more digits than Python converts
        text = f"a {type(value).__name__} of more digits than can be read"
    return shortened(text)


def shortened(text: str) -> str:
    """Return the text, with the middle left out if it is longer than 80 characters."""
    half = _LONGEST_QUOTE // 2
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:half]}...{text[-half:]}"


def listed(names: Sequence[str]) -> str:
    """Return names as an enumeration: "a", "a and b", "a, b and c". At least one is required."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def without_values(names: Sequence[str]) -> str:
    """Return the error message about parameters without value, with the remedy.

    Args:
        names: names of the parameters, at least one.
    """
    values = ", ".join(f"{name!r}: 1.0" for name in names)
    how = f"such as mbs.load(source, parameters={{{values}}}), or in the call"
    if len(names) == 1:
        return (
            f"parameter {names[0]!r} has no value; give it a default where the mechanism is"
            f" described, {how}"
        )
    return (
        f"parameters {listed([repr(name) for name in names])} have no value; give them defaults"
        f" where the mechanism is described, {how}"
    )


def install_command(extra: str) -> str:
    """Return the command that installs an extra of this package, from PyPI or in a clone.

    Args:
        extra: key of [project.optional-dependencies] in pyproject.toml.
    """
    return f'pip install "{DISTRIBUTION}[{extra}]" (or, in a clone, pip install -e ".[{extra}]")'


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return the end of an error message about an unknown name, such as "did you mean 'j1'?".

    Args:
        name: unknown name.
        known: valid names.

    Returns:
        the nearest valid names, then the others, at most 20.
    """
    names = list(dict.fromkeys(shortened(str(one)) for one in known))
    near = get_close_matches(shortened(str(name)), names[:_MOST_COMPARED], n=3)
    hint = f"did you mean {' or '.join(repr(n) for n in near)}?" if near else ""
    if near and len(near) == len(names):
        return hint
    more = len(names) - _LONGEST_LIST
    rest = f" and {more} more" if more > 0 else ""
    listed = f"use one of {', '.join(names[:_LONGEST_LIST]) or '(none)'}{rest}"
    return f"{hint} {listed}".strip()


# Foreign texts inside of comments: they must not end the comment or change its meaning.
#
# Names, sources and units come from files of any origin. Even a path such as
# `D:\robots\*\arm.toml` may end a comment. There is one function for each comment syntax. Its
# result contains neither opening nor closing marks of that syntax, nor characters that join lines.


_C_MARKS = re.compile(r"(?<=/)(?=\*)|(?<=\*)(?=/)|(?<=\?)(?=\?)")
"""Position between the characters of `/*`, `*/` and `??`, which begins a trigraph."""

_BRACKET_MARKS = re.compile(r"(?<=\()(?=\*)|(?<=\*)(?=\))")
"""Position between the two characters of `(*` and `*)`."""

_UNSEEN = ("Cc", "Cf", "Cs")
"""Categories of Unicode: control, format (which may reorder adjacent text), surrogate."""


def one_line(text: str) -> str:
    """Return the text on one line, with single blanks and without invisible characters."""
    return " ".join(seen(" ".join(text.split())).split())


def error_text(error: BaseException) -> str:
    """Return type and first line of an error, such as "KeyError: 'gain'", at most 200 characters.

    Errors of CasADi have further lines with prototypes and code.
    """
    lines = [line for line in map(one_line, str(error).splitlines()) if line]
    text, kind = lines[0] if lines else "", type(error).__name__
    if text.startswith("Wrong number or type of arguments"):
        text = "an operation of CasADi was given what it does not take"
    return f"{kind}: {text[:_LONGEST_REASON].rstrip('.:')}" if text else kind


def seen(text: str) -> str:
    """Return the text without control, format and surrogate characters."""
    return "".join(c for c in text if unicodedata.category(c) not in _UNSEEN)


def ascii_line(text: str) -> str:
    """Return the text on one line in ASCII: accents and other characters are removed."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode("ascii")
    return one_line(plain)


def in_c_comment(text: str) -> str:
    """Return the text for a comment `/* ... */`: without backslashes, `/*`, `*/` and trigraphs."""
    return _C_MARKS.sub(" ", _without_backslashes(text))


def in_line_comment(text: str) -> str:
    """Return the text for a comment up to the end of the line: as for a comment of C.

    A backslash at the end of the line would join the next line in C, Rust and Maple. A Fortran
    preprocessor interprets comments of C.
    """
    return in_c_comment(text)


def in_bracket_comment(text: str) -> str:
    """Return the text for a comment `(* ... *)`, which may be nested: without these marks."""
    return _BRACKET_MARKS.sub(" ", one_line(text))


def in_wolfram_comment(text: str) -> str:
    r"""Return the text for a comment `(* ... *)` of Mathematica, where `\.2a` may be a letter."""
    return _BRACKET_MARKS.sub(" ", _without_backslashes(text))


def in_docstring(text: str) -> str:
    """Return the text for a string in triple quotes: without double quotes and backslashes."""
    return _without_backslashes(text).replace('"', "'")


def _without_backslashes(text: str) -> str:
    """Return the text on one line, with slashes in place of backslashes."""
    return one_line(text).replace("\\", "/")


def joint_label(name: str) -> str:
    """Return the part of a coordinate name for derived names: "2" for q2, else the name itself."""
    return name[1:] if re.fullmatch(r"q\d+", name) else name
