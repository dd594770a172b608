"""Checks of arguments that are lists of names or dicts of values, and of attributes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from mbs.errors import MbsError, ModelError
from mbs.text import quoted


def names_given(
    title: str, value: Any, example: str, error: type[MbsError] = ModelError
) -> tuple[str, ...]:
    """Return the names in an argument of a user, which must be a list of texts.

    It is empty if the argument is None.

    Args:
        title: mechanism and argument, such as "arm: inputs".
        value: value of the argument.
        example: name that the message shows.
        error: class of the error.

    Raises:
        MbsError: the value is a text, has no elements, or an element is no text.
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
    """Return the elements of a value as a tuple; None if it has none, such as a number."""
    if not isinstance(value, Iterable):
        return None
    try:
        return tuple(value)
    except TypeError:
        return None


def values_given(
    title: str, value: Any, example: str, error: type[MbsError] = ModelError
) -> dict[str, Any]:
    """Return the dict of values by name in an argument of a user; empty if it is None.

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


class MadeOnce:
    """Base of classes whose public attributes are set in the constructor and never again.

    Attributes:
        settings: names of the public attributes.
    """

    settings: ClassVar[tuple[str, ...]] = ()

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a private attribute, or a public one for the first time.

        Raises:
            ModelError: the attribute is set already or does not exist; it would have no effect.
        """
        is_new = name in self.settings and name not in self.__dict__
        if not name.startswith("_") and not is_new:
            kind = type(self).__name__
            raise ModelError(
                f"{kind}: attribute {name!r} cannot be set, since a {kind} is prepared when it is"
                f" made; make another {kind}, or give the value to the call"
            )
        super().__setattr__(name, value)
