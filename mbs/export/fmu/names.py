"""Names that a user gives of what an FMU is to hold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import quoted


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
