"""Parts of messages, and texts of others inside of comments."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from difflib import get_close_matches

DISTRIBUTION = "casadi-mbs"
"""Name of the package on an index, where `mbs`, the name of the import, is another project."""
_LONGEST_QUOTE = 80
_LONGEST_LIST = 20
_LONGEST_REASON = 200
_MOST_COMPARED = 1000


def quoted(value: object) -> str:
    """The value as Python writes it, on one line, its middle left out when it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # an integer of more digits than Python converts
        text = f"a {type(value).__name__} of more digits than can be read"
    return shortened(text)


def shortened(text: str) -> str:
    """The text, its middle left out when it is long."""
    half = _LONGEST_QUOTE // 2
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:half]}...{text[-half:]}"


def listed(names: Sequence[str]) -> str:
    """Names in a sentence: "a", "a and b", "a, b and c"."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def without_values(names: Sequence[str]) -> str:
    """Return the message about parameters that have no value, and how to give values."""
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
    """What installs an extra of this package, from an index and in a clone of its source.

    Args:
        extra: a key of [project.optional-dependencies] in pyproject.toml.
    """
    return f'pip install "{DISTRIBUTION}[{extra}]" (or, in a clone, pip install -e ".[{extra}]")'


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """The end of a message about an unknown name.

    Args:
        name: what was written.
        known: names that would have been understood.

    Returns:
        the nearest known names, then the others, the first 20 of them.
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


# Texts of others inside of comments, which they can neither leave nor change the reading of.
#
# Names, sources and units come from files, whose authors may be careless or hostile: a place such
# as `D:\robots\*\arm.toml` may end a comment as well as an attack does. One function for each
# syntax of comments; in what it returns neither an opening nor a closing mark of that syntax is
# left, nor what joins lines.


_C_MARKS = re.compile(r"(?<=/)(?=\*)|(?<=\*)(?=/)|(?<=\?)(?=\?)")
"""Between the letters of `/*`, `*/` and `??`, which begins a trigraph as that of a backslash."""

_BRACKET_MARKS = re.compile(r"(?<=\()(?=\*)|(?<=\*)(?=\))")
"""Between the two letters of `(*` and `*)`."""

_UNSEEN = ("Cc", "Cf", "Cs")
"""Categories of Unicode: control, format (which reorders text that stands beside it), surrogate."""


def one_line(text: str) -> str:
    """The text with a blank for any space or end of a line, without letters that are not seen."""
    return " ".join(seen(" ".join(text.split())).split())


def error_text(error: BaseException) -> str:
    """Return the type and the first line of an error, such as "KeyError: 'gain'".

    CasADi adds lists of prototypes and lines of its code.
    """
    lines = [line for line in map(one_line, str(error).splitlines()) if line]
    text, kind = lines[0] if lines else "", type(error).__name__
    if text.startswith("Wrong number or type of arguments"):
        text = "an operation of CasADi was given what it does not take"
    return f"{kind}: {text[:_LONGEST_REASON].rstrip('.:')}" if text else kind


def seen(text: str) -> str:
    """The text without control and format letters and halves of letters, blanks among others."""
    return "".join(c for c in text if unicodedata.category(c) not in _UNSEEN)


def ascii_line(text: str) -> str:
    """The text on one line with accents left out, which every compiler takes."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode("ascii")
    return one_line(plain)


def in_c_comment(text: str) -> str:
    """The text for a comment `/* ... */`: without backslashes, `/*`, `*/` and trigraphs."""
    return _C_MARKS.sub(" ", _without_backslashes(text))


def in_line_comment(text: str) -> str:
    """The text for a comment to the end of the line, behind a mark and a blank.

    A backslash at the end of the line would join the next one to it in C, Rust and Maple; a
    preprocessor of Fortran looks for comments of C.
    """
    return in_c_comment(text)


def in_bracket_comment(text: str) -> str:
    """The text for a comment `(* ... *)`, which nests in some languages: without both marks."""
    return _BRACKET_MARKS.sub(" ", one_line(text))


def in_wolfram_comment(text: str) -> str:
    r"""The text for a comment `(* ... *)` of Mathematica, where `\.2a` may be read as a letter."""
    return _BRACKET_MARKS.sub(" ", _without_backslashes(text))


def in_docstring(text: str) -> str:
    """The text for a string in triple quotes: without double quotes and backslashes."""
    return _without_backslashes(text).replace('"', "'")


def _without_backslashes(text: str) -> str:
    return one_line(text).replace("\\", "/")
