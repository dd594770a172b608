"""Arguments and options that several commands share."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from mbs.app.cli import completion

Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="Name in the catalogue, or a .toml, .par, .urdf, .xacro, .sdf, .world or .xml file.",
        autocompletion=completion.robots,
        show_default=False,
    ),
]
Parameters = Annotated[
    list[str] | None,
    typer.Option(
        "--parameter",
        "-p",
        metavar="NAME=VALUE",
        help="Value of a symbol of the robot; may be repeated.",
        show_default=False,
    ),
]
Gravity = Annotated[
    str,
    typer.Option(
        "--gravity",
        metavar="X,Y,Z",
        help="Gravity acceleration in the world in m/s2, such as 0,0,-1.62.",
        show_default=False,
    ),
]
Mount = Annotated[
    list[str] | None,
    typer.Option(
        "--mount",
        metavar="NAME=VALUE",
        help="Mount of the base in the world: x=pi rotates it about x, position=0,0,2.5 places it;"
        " may be repeated.",
        show_default=False,
    ),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print JSON on the standard output, and nothing else there.")
]


def output(what: str) -> Any:
    """Return the typer definition of the option --output.

    Args:
        what: help text of the option.
    """
    return typer.Option("--output", "-o", metavar="FILE", help=what, show_default=False)


Output = Annotated[Path | None, output("File to write; it is replaced as a whole, or left alone.")]


def examples(*lines: str) -> str:
    """Return the text with examples at the end of a help page, in rich markup.

    Args:
        *lines: command lines.
    """
    commands = (f"[dim]$[/dim] {without_markup(line)}" for line in lines)
    return "\n".join(["[bold]Examples[/bold]", *commands])


def help_of(command: Callable[..., None]) -> str:
    """Return the docstring of a command with a single line per paragraph; terminals wrap it.

    Args:
        command: function of the command.
    """
    paragraphs = without_markup(inspect.getdoc(command) or "").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def without_markup(text: str) -> str:
    """Return the text with its brackets escaped, which rich would interpret as markup."""
    return text.replace("[", r"\[")
