"""Options of an action as fields of a frozen dataclass.

The arguments of the action, the text of its docstring, its options on the command line and its form
in the app are derived from the fields. The metadata of each field is an `OptionInfo`.
"""

from __future__ import annotations

import functools
import inspect
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields
from types import UnionType
from typing import (
    Any,
    Concatenate,
    Literal,
    ParamSpec,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from mbs.text import quoted

_KEY = "mbs.option"
_WIDTH = 96
"""Longest line of a docstring [characters]: a line of the source without its indentation."""

Check = Callable[[str, object], str]
"""Function of the label and the value of an option: the error as a sentence, "" if it is valid."""


def _always_valid(label: str, value: object) -> str:
    """Return "": the check of an option whose values are all valid."""
    return ""


def one_of(names: Sequence[str]) -> Check:
    """Return the check that a value is one of some names."""

    def check(label: str, value: object) -> str:
        if isinstance(value, str) and value in names:
            return ""
        return f"{label} is {quoted(value)}; use {' or '.join(map(repr, names))}"

    return check


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
    kinds = {name: _kind(hints[name], option) for name, (_, option) in known.items()}
    return {name: kind for name, kind in kinds.items() if kind is not None}


def _kind(hint: Any, option: OptionInfo) -> ValueKind | None:
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
        field.name: (field, option_of(field))
        for field in _in_order(options)
        if _KEY in field.metadata
    }


def _in_order(options: Any) -> list[Field[Any]]:
    """Return the fields of a dataclass in the order of its arguments: keyword-only ones last.

    `options` is the dataclass or its instance.
    """
    return sorted(fields(options), key=lambda field: field.kw_only is True)


def faults(options: Any) -> Iterator[str]:
    """Yield the error sentence of every invalid option of a dataclass.

    Args:
        options: instance of a dataclass.
    """
    for name, (_, option) in option_fields(options).items():
        if sentence := option.check(option.label or name, getattr(options, name)):
            yield sentence


def group_values(options: Any, *groups: type) -> dict[str, Any]:
    """Return the values of those options that groups (base classes) of options have, by name.

    Args:
        options: instance of a dataclass that is derived from the groups.
        *groups: dataclasses.
    """
    return {field.name: getattr(options, field.name) for group in groups for field in fields(group)}


# Arguments of a function, from the fields of a dataclass.


_P = ParamSpec("_P")
_Options = TypeVar("_Options")
_Self = TypeVar("_Self")
_Result = TypeVar("_Result")


def arguments_of(
    options: Callable[_P, _Options],
) -> Callable[[Callable[[_Options], _Result]], Callable[_P, _Result]]:
    """Return a decorator that replaces the argument `options` of a function by its fields.

    Signature, annotations and the entry `options` in the docstring are replaced, too.

    Args:
        options: dataclass of all arguments. Its keyword-only fields become keyword-only arguments.
    """

    def decorate(action: Callable[[_Options], _Result]) -> Callable[_P, _Result]:
        made: Callable[_P, _Result] = _with_fields(action, options)
        return made

    return decorate


def method_arguments_of(
    options: Callable[_P, _Options],
) -> Callable[[Callable[[_Self, _Options], _Result]], Callable[Concatenate[_Self, _P], _Result]]:
    """Return the decorator of `arguments_of` for a method.

    Args:
        options: dataclass of all arguments.
    """

    def decorate(
        action: Callable[[_Self, _Options], _Result],
    ) -> Callable[Concatenate[_Self, _P], _Result]:
        made: Callable[Concatenate[_Self, _P], _Result] = _with_fields(action, options)
        return made

    return decorate


def _with_fields(action: Callable[..., Any], options: Any) -> Any:
    """Return a function that has the fields of `options` as parameters in place of `options`.

    It calls `action` with an instance of the dataclass `options`. Its text is executed, as for the
    methods of a dataclass, so that wrong arguments raise the errors of Python with the name of
    `action`.
    """
    every = _in_order(options)
    own = inspect.signature(action)
    first = [p for p in own.parameters.values() if p.name != "options"]
    taken = [inspect.Parameter(f.name, _kind_of(f), default=_default_of(f)) for f in every]
    plain = inspect.Signature(
        [*first, *(p if p.default is p.empty else p.replace(default=None) for p in taken)]
    )
    passed = ", ".join([*(p.name for p in first), f"_options({', '.join(map(_passed, every))})"])
    scope: dict[str, Any] = {"_action": action, "_options": options}
    exec(f"def _call{plain}: return _action({passed})", scope)
    call: Any = functools.wraps(action)(scope["_call"])
    given = [p for p in taken if p.default is not p.empty]
    call.__defaults__ = tuple(p.default for p in given if p.kind is not p.KEYWORD_ONLY)
    call.__kwdefaults__ = {p.name: p.default for p in given if p.kind is p.KEYWORD_ONLY}
    hints = get_type_hints(action) | get_type_hints(options)
    call.__annotations__ = {
        name: hints[name] for name in (*plain.parameters, "return") if name in hints
    }
    shown = [p.replace(annotation=f.type) for p, f in zip(taken, every, strict=True)]
    call.__signature__ = own.replace(parameters=[*first, *shown])
    call.__doc__ = _documented(inspect.getdoc(action) or "", every)
    return call


def _kind_of(field: Field[Any]) -> Any:
    """Return the kind of the parameter of a dataclass field, as in `inspect.Parameter`."""
    kinds = inspect.Parameter
    return kinds.KEYWORD_ONLY if field.kw_only else kinds.POSITIONAL_OR_KEYWORD


def _default_of(field: Field[Any]) -> Any:
    """Return the default of the parameter of a field; `inspect.Parameter.empty` if it has none."""
    return inspect.Parameter.empty if field.default is MISSING else field.default


def _passed(field: Field[Any]) -> str:
    """Return the text that passes the value of a parameter to its field."""
    return f"{field.name}={field.name}" if field.kw_only else field.name


def _documented(doc: str, every: Sequence[Field[Any]]) -> str:
    """Return the docstring `doc` in which the entry `options` is replaced by entries of fields.

    `every` are the fields, in the order of the entries.
    """
    lines = []
    for line in doc.splitlines():
        if line.strip().startswith("options: "):
            indent = line[: len(line) - len(line.lstrip())]
            for field in every:
                lines += textwrap.wrap(
                    f"{field.name}: {option_of(field).sentences}",
                    _WIDTH,
                    initial_indent=indent,
                    subsequent_indent=2 * indent,
                    break_long_words=False,
                    break_on_hyphens=False,
                )
        else:
            lines.append(line)
    return "\n".join(lines)
