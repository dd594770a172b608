"""`mbs export`: files for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from mbs.app.cli import completion
from mbs.app.cli.arguments import Gravity, Mount, Parameters, Robot, examples, help_of
from mbs.app.cli.derived import add_derived
from mbs.app.cli.group import Commands
from mbs.app.cli.loading import configuration, system
from mbs.app.cli.places import require_places
from mbs.app.cli.printing import note

C_EXAMPLES = examples(
    "mbs export c puma560 build/puma560",
    "mbs export c sr400 sr400.zip --model idm --model ddm",
    "mbs export c scara build/scara --bare --float",
)
FMU_EXAMPLES = examples(
    "mbs export fmu four_bar four_bar.fmu",
    "mbs export fmu puma560 puma560.fmu --fmi 3.0 --output energy --symbolic masses",
    "mbs export fmu rx90 rx90.fmu --platform x86_64-windows --platform x86_64-linux",
)
PAR_EXAMPLES = examples("mbs export par sr400 sr400.par")
TOML_EXAMPLES = examples("mbs export toml sr400 sr400.toml")
HTML_EXAMPLES = examples(
    "mbs export html stewart_platform platform.html", "mbs export html rx90 rx90.html --q q2=0.5"
)

Target = Annotated[
    Path,
    typer.Argument(
        metavar="OUTPUT",
        help="File to write; it is replaced as a whole, or left alone.",
        show_default=False,
    ),
]
Texts = list[str] | None

commands = typer.Typer(
    cls=Commands,
    name="export",
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="Export a robot: C source, FMU, .par, .toml, HTML picture.",
)


Place = Annotated[
    Path,
    typer.Argument(
        metavar="OUTPUT",
        help="Folder to write, or a .zip file with one folder in it.",
        show_default=False,
    ),
]
Model = Annotated[
    Texts,
    typer.Option(
        "--model",
        "-m",
        metavar="KEY",
        help="Model, as `mbs models` lists them; may be repeated; idm and ddm when left out.",
        autocompletion=completion.keys,
        show_default=False,
    ),
]


def export_c(
    robot: Robot,
    path: Place,
    *,
    model: Model = None,
    options: dict[str, Any],
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
) -> None:
    """Export models as C source with a header, CMakeLists.txt and an example."""
    from mbs.app.tasks import exporting

    assembled, keys = system(robot, parameter, gravity, mount), model or exporting.MODELS
    if path.suffix.lower() == ".zip":
        _write(path, exporting.c_library(assembled, keys, library=options))
        return
    exporting.write_c_library(assembled, path, keys, library=options)
    note(f"wrote {path}")


def _c_options() -> type:
    """Return the dataclass of the options of a C library."""
    from mbs.export.c_options import CLibraryOptions

    return CLibraryOptions


def export_fmu(
    robot: Robot,
    path: Target,
    *,
    options: dict[str, Any],
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
) -> None:
    """Export an FMU for Model Exchange and Co-Simulation; this requires a C compiler.

    Inputs are the efforts of motors. Outputs are the motion of all joints and the pose of the
    terminal frame. Every symbol of the robot is a parameter.
    """
    from mbs.app.tasks import exporting

    require_places(path)
    _write(path, exporting.fmu(system(robot, parameter, gravity, mount), options))


def _fmu_options() -> type:
    """Return the dataclass of the options of an FMU."""
    from mbs.export.fmu.options import FmuOptions

    return FmuOptions


def export_par(
    robot: Robot,
    target: Target,
    *,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
) -> None:
    """Export the assembled robot as a SYMORO file; link j is frame j."""
    from mbs.app.tasks import exporting

    _write(target, exporting.par(system(robot, parameter, gravity, mount)))


def export_toml(
    robot: Robot,
    target: Target,
    *,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
) -> None:
    """Export the assembled robot as a table of frames in TOML; link j is frame j."""
    from mbs.app.tasks import exporting

    _write(target, exporting.toml(system(robot, parameter, gravity, mount)))


Q = Annotated[
    Texts,
    typer.Option(
        metavar="NAME=VALUE",
        help="Configuration in rad or m; may be repeated; the others as assembled.",
        show_default=False,
    ),
]


def export_html(
    robot: Robot,
    target: Target,
    *,
    q: Q = None,
    parameter: Parameters = None,
) -> None:
    """Export a 3-D picture as a self-contained HTML file for any browser."""
    from mbs.app.tasks import exporting

    assembled = system(robot, parameter)
    _write(target, exporting.html(assembled, configuration(assembled, q)))


def _write(target: Path, content: bytes) -> None:
    """Write the content of a file and print its path."""
    from mbs.files import write_bytes

    write_bytes(content, target)
    note(f"wrote {target}")


add_derived(commands, "fmu", export_fmu, _fmu_options, FMU_EXAMPLES)
add_derived(commands, "c", export_c, _c_options, C_EXAMPLES)
for _name, _command, _examples in (
    ("par", export_par, PAR_EXAMPLES),
    ("toml", export_toml, TOML_EXAMPLES),
    ("html", export_html, HTML_EXAMPLES),
):
    commands.command(_name, help=help_of(_command), epilog=_examples)(_command)
