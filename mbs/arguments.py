"""Checks of arguments that are lists of names or dicts of values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from mbs.errors import MbsError, ModelError
from mbs.text import quoted


def names_given(
    title: str, value: Any, example: str, error: type[MbsError] = ModelError
) -> tuple[str, ...]:
    """Return the names in an argument; none if it is None.

    Args:
        title: mechanism and argument, such as "arm: inputs".
        value: value of the argument.
        example: name that the message shows.
        error: class of the error.

    Raises:
        MbsError: the value is a text or has no elements.
    """
    if value is None:
        return ()
    names = () if isinstance(value, str) else elements_of(value)
    if isinstance(value, str) or names is None:
        shown = value if isinstance(value, str) else example
        raise error(f"{title} is {quoted(value)}; give a list of names, such as [{quoted(shown)}]")
    for name in names:
        if not isinstance(name, str):
            raise error(f"{title} has the element {quoted(name)}; give names, such as {example!r}")
    return names


def elements_of(value: Any) -> tuple[Any, ...] | None:
    """Return the elements of a value; None if it has none, as a number or a matrix of CasADi."""
    if not isinstance(value, Iterable):
        return None
    try:
        return tuple(value)
    except TypeError:
        return None


def values_given(
    title: str, value: Any, example: str, error: type[MbsError] = ModelError
) -> dict[str, Any]:
    """Return the values by name in an argument; an empty dict if it is left out.

    Args:
        title: mechanism and argument, such as "arm: inputs".
        value: value of the argument.
        example: entry that the message shows, such as '"j1.tau": 2.0'.
        error: class of the error.

    Raises:
        MbsError: the value is no dict.
    """
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise error(f"{title} is {quoted(value)}; give a dict such as {{{example}}}")
    return dict(value)
