"""Options of an action as fields of a frozen dataclass.

The keyword arguments of the action, the text of its docstring, its options on the command line and
its form in the app are derived from the fields. Each field has a default, and its metadata is an
`OptionInfo`.
"""

from __future__ import annotations

import functools
import inspect
import os
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, fields
from types import UnionType
from typing import Any, Literal, ParamSpec, Protocol, TypeVar, get_args, get_origin, get_type_hints

_KEY = "mbs.option"
_WIDTH = 96
"""Longest line of a docstring [characters]: a line of the source without its indentation."""

Check = Callable[[str, object], str]
"""Function of the label and the value of an option: the error as a sentence, "" if it is valid."""


def _always_valid(label: str, value: object) -> str:
    """Return "": the check of an option whose values are all valid."""
    return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class OptionInfo:
    """Description of an option in addition to its name, type and default.

    Attributes:
        text: meaning, and allowed values. The first sentence has no dot inside.
        unit: unit of a number, a name of `mbs.units.UNITS`, or "".
        label: short name in error messages and forms.
        choices: explanation of each allowed value. Empty if other values are allowed.
        offered: names that a form offers for a list of names.
        example: examples of further names in a list. "{joint}" stands for a joint of the mechanism.
        only_with: name of another option and the values of it with which this option has an
            effect. None if it always has.
        check: function of label and value that returns the error as a sentence.
        command: option of the command line, such as "--stop-time". "" if it has none. Of an option
            with choices, a command that is the name of a choice is a flag that selects it.
        command_text: text of the command line if it differs from `text`.
        in_form: whether the form of the app has the option.
    """

    text: str
    unit: str = ""
    label: str = ""
    choices: Mapping[str, str]
    offered: tuple[str, ...] = ()
    example: str = ""
    only_with: tuple[str, tuple[str, ...]] | None = None
    check: Check = _always_valid
    command: str = ""
    command_text: str = ""
    in_form: bool = False

    @property
    def sentences(self) -> str:
        """Text with the unit at the end of the first sentence."""
        if not self.unit:
            return self.text
        first, dot, others = self.text.partition(".")
        return f"{first} [{self.unit}]{dot}{others}"


ValueKind = Literal["flag", "number", "names", "choice", "text"]
"""Kind of the values of an option, which determines how a command or a form asks for them."""


def value_kinds(options: type) -> dict[str, ValueKind]:
    """Return the kind of values of each option of a dataclass, by name.

    Options of other types than those of `ValueKind` are left out.

    Args:
        options: dataclass of the options.
    """
    hints, known = get_type_hints(options), option_fields(options)
    kinds = {name: _value_kind(hints[name], option) for name, (_, option) in known.items()}
    return {name: kind for name, kind in kinds.items() if kind is not None}


def _value_kind(hint: Any, option: OptionInfo) -> ValueKind | None:
    """Return the kind of values of an option with the type `hint`; None for other types."""
    types = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    if bool in types:
        return "flag"
    if float in types:
        return "number"
    if any(get_origin(one) is Sequence and get_args(one) == (str,) for one in types):
        return "names"
    if option.choices:
        return "choice"
    return "text" if hint is str else None


def default_text(field: Field[Any]) -> str:
    """Return the default of a number as its shortest text: 10, 0.01, 1e-8; "" for None.

    Args:
        field: dataclass field whose default is a number or None.
    """
    if field.default is None:
        return ""
    return f"{field.default:g}".replace("e-0", "e-").replace("e+0", "e+")


def title_of(name: str, option: OptionInfo) -> str:
    """Return the label of an option with a capital letter and its unit, such as "Stop time [s]".

    Args:
        name: name of the option, used without underscores if it has no label.
        option: description of the option.
    """
    label = option.label or name.replace("_", " ")
    unit = f" [{option.unit}]" if option.unit else ""
    return f"{label[:1].upper()}{label[1:]}{unit}"


def described(
    text: str, choices: Mapping[str, str] | None = None, **about: Any
) -> dict[str, OptionInfo]:
    """Return the metadata of a dataclass field that is an option.

    Args:
        text: meaning, and allowed values.
        choices: explanation of each allowed value.
        **about: other attributes of `OptionInfo`.
    """
    return {_KEY: OptionInfo(text=text, choices=choices or {}, **about)}


def option_of(field: Field[Any]) -> OptionInfo:
    """Return the description of a dataclass field that is an option."""
    option: OptionInfo = field.metadata[_KEY]
    return option


def option_fields(options: Any) -> dict[str, tuple[Field[Any], OptionInfo]]:
    """Return the fields of a dataclass that are options, by name.

    Args:
        options: dataclass or its instance. Fields without `OptionInfo` are left out.
    """
    return {
        field.name: (field, option_of(field)) for field in fields(options) if _KEY in field.metadata
    }


def faults(options: Any) -> Iterator[str]:
    """Yield the error sentence of every invalid option of a dataclass.

    Args:
        options: instance of a dataclass.
    """
    for name, (_, option) in option_fields(options).items():
        if sentence := option.check(option.label or name, getattr(options, name)):
            yield sentence


def group_values(options: Any, group: type) -> dict[str, Any]:
    """Return the values of those options that a group (a base class) of options has, by name.

    Args:
        options: instance of a dataclass that is derived from `group`.
        group: dataclass.
    """
    return {field.name: getattr(options, field.name) for field in fields(group)}


# Keyword arguments of a function, from the fields of the options.


_P = ParamSpec("_P")
_Options = TypeVar("_Options", contravariant=True)
_System = TypeVar("_System", contravariant=True)
_Result = TypeVar("_Result", covariant=True)


class _WithOptions(Protocol[_System, _Options, _Result]):
    """Function of a system, the path of a file to write, and the argument `options`."""

    def __call__(
        self, system: _System, path: str | os.PathLike[str], *, options: _Options
    ) -> _Result: ...


class WithKeywords(Protocol[_System, _P, _Result]):
    """Function of a system, the path of a file to write, and options by keyword."""

    def __call__(
        self,
        system: _System,
        path: str | os.PathLike[str],
        *args: _P.args,
        **kwargs: _P.kwargs,
    ) -> _Result:
        """Call the function."""


def keywords_of(
    options: Callable[_P, _Options],
) -> Callable[[_WithOptions[_System, _Options, _Result]], WithKeywords[_System, _P, _Result]]:
    """Return a decorator that replaces the argument `options` by one keyword for each field.

    Signature, annotations and the entry `options` in the docstring are replaced, too.

    Args:
        options: dataclass, whose fields are keyword-only and have defaults and descriptions.
    """

    def decorate(
        action: _WithOptions[_System, _Options, _Result],
    ) -> WithKeywords[_System, _P, _Result]:
        known = option_fields(options)

        @functools.wraps(action)
        def call(*args: Any, **keywords: Any) -> Any:
            own: dict[str, Any] = {
                name: keywords.pop(name) for name in [*keywords] if name in known
            }
            made: Callable[..., _Options] = options
            return action(*args, options=made(**own), **keywords)

        own = inspect.signature(action)
        taken = [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=field.type
            )
            for name, (field, _) in known.items()
        ]
        others = [p for p in own.parameters.values() if p.name != "options"]
        hints = get_type_hints(action) | get_type_hints(options)
        named = [p.name for p in (*others, *taken)]
        call.__annotations__ = {name: hints[name] for name in (*named, "return")}
        vars(call)["__signature__"] = own.replace(parameters=[*others, *taken])
        call.__doc__ = _documented(inspect.getdoc(action) or "", known)
        return call

    return decorate


def _documented(doc: str, known: Mapping[str, tuple[Field[Any], OptionInfo]]) -> str:
    """Return a docstring in which the entry `options` is replaced by one entry per option."""
    lines = []
    for line in doc.splitlines():
        if line.strip().startswith("options: "):
            indent = line[: len(line) - len(line.lstrip())]
            for name, (_, option) in known.items():
                lines += textwrap.wrap(
                    f"{name}: {option.sentences}",
                    _WIDTH,
                    initial_indent=indent,
                    subsequent_indent=2 * indent,
                    break_long_words=False,
                    break_on_hyphens=False,
                )
        else:
            lines.append(line)
    return "\n".join(lines)
