"""Names of variables of FMUs and results, such as j1.q, as alternatives to coordinate names."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from mbs.errors import ModelError

_KINDS = {
    "q": ("a position", "q0"),
    "v": ("a velocity", "v0"),
    "tau": ("an effort", "tau"),
    "solved": ("a guess", "guess"),
}
"""Quantity and argument of `run`, by the end of the name of a variable."""

POSITIONS = ("q",)
"""Ends of the names of positions."""

GUESSES = ("q", "solved")
"""Ends of the names of guesses: in FMUs, j2.solved is the guess of a dependent position."""

VELOCITIES = ("v",)
"""Ends of the names of velocities."""

EFFORTS = ("tau",)
"""Ends of the names of efforts."""


def by_coordinate(
    owner: str, values: Mapping[str, Any], names: Collection[str], kinds: Collection[str]
) -> dict[str, Any]:
    """Return values by the names of coordinates; unknown names stay as they are.

    Args:
        owner: name of the system, for messages.
        values: values by the names of coordinates, such as j1, or of variables, such as j1.q.
        names: names of the coordinates.
        kinds: ends of the names of variables that are accepted.

    Raises:
        ModelError: a value is given by both names, or the variable is another quantity.
    """
    found: dict[str, Any] = {}
    given: dict[str, str] = {}
    for name, value in values.items():
        base, _, kind = str(name).rpartition(".")
        plain = name
        if name not in names and base in names and kind in _KINDS:
            if kind not in kinds:
                what, argument = _KINDS[kind]
                raise ModelError(
                    f"{owner}: {name} is {what}, which has no effect here; give it in {argument}"
                )
            plain = base
        if plain in found:
            raise ModelError(
                f"{owner}: {given[plain]} and {name} are the same variable; give it once"
            )
        found[plain], given[plain] = value, str(name)
    return found
