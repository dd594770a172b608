"""Command `mbs` with all its subcommands."""

from __future__ import annotations

from typing import Annotated

import typer

from mbs.app.cli import (
    convert,
    count,
    export,
    identify,
    model,
    models,
    robots,
    show,
    simulate,
    solve_ik,
    sweep,
    web,
)
from mbs.app.cli.arguments import examples, help_of
from mbs.app.cli.derived import add_derived
from mbs.app.cli.group import Commands
from mbs.version import __version__

application = typer.Typer(
    cls=Commands,
    name="mbs",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=examples(
        "mbs robots", "mbs model puma560 idm --language c", "mbs simulate four_bar --q0 j1=0.3"
    ),
)


def _version(wanted: bool) -> None:
    """Print the version and exit, if the option --version is given."""
    if wanted:
        typer.echo(f"mbs {__version__}")
        raise typer.Exit


def _start(
    *,
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=_version, is_eager=True),
    ] = False,
) -> None:
    """Equations of robots and mechanisms with closed loops.

    ROBOT is a name that `mbs robots` lists, or a .toml, .par, .urdf, .xacro, .sdf, .world or .xml
    (MJCF) file.
    Units are SI and radians; numbers may be written as pi/2.

    Exit codes: 0 success; 1 an error, with a message on the standard error; 2 unknown commands or
    options.
    """


_OPTIONS = {
    "simulate": simulate.motion_options,
    "sweep": simulate.motion_options,
    "solve-ik": solve_ik.pose_options,
    "identify": identify.identify_options,
}
"""Functions that return the dataclass from which options of a command are derived."""

application.callback(help=help_of(_start))(_start)
for _name, _command, _examples in (
    ("robots", robots.robots, robots.EXAMPLES),
    ("show", show.show, show.EXAMPLES),
    ("models", models.models, models.EXAMPLES),
    ("model", model.model, model.EXAMPLES),
    ("count", count.count, count.EXAMPLES),
    ("solve-ik", solve_ik.solve_ik, solve_ik.EXAMPLES),
    ("simulate", simulate.simulate, simulate.EXAMPLES),
    ("sweep", sweep.sweep, sweep.EXAMPLES),
    ("identify", identify.identify, identify.EXAMPLES),
    ("convert", convert.convert, convert.EXAMPLES),
):
    if _name in _OPTIONS:
        add_derived(application, _name, _command, _OPTIONS[_name], _examples)
    else:
        application.command(_name, help=help_of(_command), epilog=_examples)(_command)
application.add_typer(export.commands, name="export")
application.command("app", help=help_of(web.app), epilog=web.EXAMPLES)(web.app)
