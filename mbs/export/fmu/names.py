"""Names: those that a user gives of what an FMU is to hold, and those of its variables."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import quoted

_INDEX = r"(?:\[\d+(?:,\d+)*\])?"
_QUOTED = r"""'(?:[\w!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['"?\\abfnrtv])+'"""
_PART = rf"(?:[A-Za-z_]\w*|{_QUOTED}){_INDEX}"
_PATH = rf"{_PART}(?:\.{_PART})*"
_STRUCTURED = re.compile(rf"{_PATH}|der\({_PATH}(?:,\d+)?\)", re.ASCII)
_WHOLE_PART = re.compile(_PART, re.ASCII)
_STEM_AND_INDEX = re.compile(rf"(.+?)({_INDEX})", re.ASCII)
_ESCAPED = str.maketrans({mark: f"\\{mark}" for mark in "'\"\\"})


def once(system: System, what: str, names: Sequence[str]) -> list[str]:
    """Names as a list.

    Raises:
        ModelError: one is no text or is given twice.
    """
    if not isinstance(names, Iterable):
        raise ModelError(f"{system.name}: {what} is {quoted(names)}; give a list of texts")
    given = [names] if isinstance(names, str) else list(names)
    for name in given:
        if not isinstance(name, str):
            raise ModelError(f"{system.name}: {what} name {quoted(name)}; give texts")
        if given.count(name) > 1:
            raise ModelError(f"{system.name}: {what} name {name!r} twice; name it once")
    return given


def structured(name: str) -> str:
    """A name as the naming convention `structured` of FMI has it, such as `'left-arm'.q`.

    A path of identifiers stays as it is. A part between two dots that is no identifier is put in
    single quotes. A name with characters beyond ASCII, for which the convention has no place, stays
    too: see `is_structured`.

    Args:
        name: of a variable or terminal.
    """
    if is_structured(name) or not (name.isascii() and name.isprintable()):
        return name
    parts = name.split(".")
    return ".".join(map(_part, parts)) if all(parts) else _part(name)


def is_structured(name: str) -> bool:
    """Whether the naming convention `structured` of FMI knows such a name."""
    return _STRUCTURED.fullmatch(name) is not None


def _part(text: str) -> str:
    """A part of a path, quoted where it is no identifier; its indices stay behind the quotes."""
    if not text or _WHOLE_PART.fullmatch(text):
        return text
    found = _STEM_AND_INDEX.fullmatch(text)
    assert found is not None  # any text is a stem without index
    stem, index = found.groups()
    return f"'{stem.translate(_ESCAPED)}'{index}"
