"""Commands whose options are derived from the fields of a dataclass."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import Field
from typing import Annotated, Any, get_type_hints

import typer
import typer.core
import typer.main

from mbs.app.cli.arguments import help_of, without_markup
from mbs.options import OptionInfo, ValueKind, default_text, option_fields, value_kinds

_METAVARS = {"s": "SECONDS"}
"""Words for the value of a number by its unit. Other numbers are NUMBER."""
_LONGEST = 40
"""Longest list of choices in the column of values [characters]: half of a terminal."""


def add_derived(
    commands: typer.Typer,
    name: str,
    function: Callable[..., None],
    options: Callable[[], type],
    epilog: str,
) -> None:
    """Add a command to a group, with the fields of a dataclass as options.

    The dataclass is imported when the command is called, and not for the help of other commands.

    Args:
        commands: group of the command.
        name: name of the command.
        function: function of the command. Its argument `options` is a dict from the names of
            options to their texts, without the options that were left out.
        options: function that returns the dataclass.
        epilog: end of the help page.
    """

    class Derived(_DerivedCommand):
        def make(self) -> Callable[..., None]:
            return with_options(function, options())

    def command() -> None:
        """Stand in for the function until it is made."""

    commands.command(name, cls=Derived, help=help_of(function), epilog=epilog)(command)


class _DerivedCommand(typer.core.TyperCommand):
    """Command whose function is made by `make` when its parameters or callback are first used."""

    def make(self) -> Callable[..., None]:
        """Return the function of the command; subclasses implement it."""
        raise NotImplementedError

    @functools.cached_property
    def made(self) -> Any:
        """Command that typer derives from the function."""
        alone = typer.Typer(add_completion=False)
        alone.command()(self.make())
        return typer.main.get_command(alone)

    @property
    def params(self) -> Any:
        """Parameters of the command."""
        return self.made.params

    @params.setter
    def params(self, value: Any) -> None:
        """Ignore the parameters of the stand-in."""

    @property
    def callback(self) -> Any:
        """Function that is called with the parameters."""
        return self.made.callback

    @callback.setter
    def callback(self, value: Any) -> None:
        """Ignore the stand-in."""


def with_options(function: Callable[..., None], options: type) -> Callable[..., None]:
    """Return a command with one argument per option instead of its argument `options`.

    Args:
        function: function of a command with an argument `options`, a dict of texts by name.
        options: dataclass of the options.
    """
    known = option_fields(options)
    hints = get_type_hints(function, include_extras=True)
    derived = list(_parameters(options, known))
    parameters: list[inspect.Parameter] = []
    for one in inspect.signature(function).parameters.values():
        own = one.replace(annotation=hints[one.name])
        parameters += derived if one.name == "options" else [own]

    @functools.wraps(function)
    def command(**words: Any) -> None:
        given = {one.name: words.pop(one.name) for one in derived}
        texts = {name: _text(known[name][1], value) for name, value in given.items()}
        texts = {name: text for name, text in texts.items() if text is not None}
        function(**words, options=texts)

    command.__annotations__ = {one.name: one.annotation for one in parameters}
    vars(command)["__signature__"] = inspect.Signature(parameters)
    return command


def _parameters(
    options: type, known: Mapping[str, tuple[Field[Any], OptionInfo]]
) -> Iterator[inspect.Parameter]:
    """Yield a parameter of a typer command for every option that the command line has.

    `known` are the fields of the dataclass `options` by name.
    """
    kinds = value_kinds(options)
    for name, (field, option) in known.items():
        if option.command:
            kind = "flag" if _flag(option) else kinds[name]
            type_, default, about = _TYPED[kind](field, option)
            shown = typer.Option(_names(field, option), help=_help(option, kind), **about)
            yield inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=default,
                annotation=Annotated[type_, shown],
            )


_TYPED: dict[ValueKind, Callable[[Field[Any], OptionInfo], tuple[Any, Any, dict[str, Any]]]] = {
    "flag": lambda field, option: (bool, field.default is True, {}),
    "number": lambda field, option: (
        str,
        default_text(field),
        {
            "metavar": _METAVARS.get(option.unit, "NUMBER"),
            "show_default": field.default is not None,
        },
    ),
    "names": lambda field, option: (
        list[str] | None,
        None,
        {"metavar": "NAME", "show_default": False},
    ),
    "choice": lambda field, option: (str, field.default, {"metavar": _choices(field, option)}),
    "text": lambda field, option: (
        str,
        field.default,
        {"metavar": "TEXT", "show_default": bool(field.default)},
    ),
}
"""Type, default and appearance of an option of the command line, by the kind of its values."""


def _choices(field: Field[Any], option: OptionInfo) -> str:
    """Return the choices of an option as "a|b", or its name if this text is too long."""
    every = "|".join(option.choices)
    return every if len(every) <= _LONGEST else field.name.upper()


def _names(field: Field[Any], option: OptionInfo) -> str:
    """Return the names of an option for typer, with a --no- name if it is on by default."""
    if field.default is True:
        return f"{option.command}/{option.command.replace('--', '--no-', 1)}"
    return option.command


def _flag(option: OptionInfo) -> str:
    """Return the choice that the bare name of an option selects; "" if the option has a value."""
    name = option.command.removeprefix("--")
    return name if name in option.choices else ""


def _text(option: OptionInfo, value: Any) -> Any:
    """Return the value of an option as text or texts; None if it was left out."""
    flag = _flag(option)
    return (flag if value else None) if flag else value


def _help(option: OptionInfo, kind: ValueKind) -> str:
    """Return the help text of an option."""
    text = without_markup(option.command_text or option.text)
    again = " May be repeated." if kind == "names" else ""
    return f"{text[:1].upper()}{text[1:]}{again}"
