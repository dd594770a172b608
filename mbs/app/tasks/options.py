"""Options of an action from the texts of a command or a form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin, get_type_hints

from mbs.app.tasks.laws import number
from mbs.errors import ModelError
from mbs.options import option_fields, value_kinds
from mbs.text import did_you_mean


def keywords(
    options: type,
    texts: Mapping[str, Any],
    where: str,
    known: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Return the values of options from texts, as keyword arguments.

    A number may be a text such as "pi/2". An empty text or list of an option whose default is None
    is ignored.

    Args:
        options: dataclass of the options.
        texts: text, list of texts or value of options by name. Other options keep their defaults.
        where: name of the system, for error messages.
        known: values of the symbols that numbers may contain.

    Returns:
        Values by name.

    Raises:
        ExpressionError: a number cannot be read.
        ModelError: a value is not among the choices of its option, or a number contains an unknown
            symbol.
    """
    hints, kinds = get_type_hints(options), value_kinds(options)
    found: dict[str, Any] = {}
    for name, (field, _) in option_fields(options).items():
        if name not in texts:
            continue
        value, kind, hint = texts[name], kinds.get(name), hints[name]
        if field.default is None and value in ("", (), []):
            continue
        if get_origin(hint) is Literal and value not in get_args(hint):
            raise ModelError(
                f"{where}: there is no {name} {value!r}; {did_you_mean(value, get_args(hint))}"
            )
        found[name] = number(value, f"{where}: {name}", known) if kind == "number" else value
    return found
