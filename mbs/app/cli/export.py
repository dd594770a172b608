"""`mbs export`: files for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mbs.app.cli import completion
from mbs.app.cli.arguments import Gravity, Mount, Parameters, Robot, examples, help_of
from mbs.app.cli.group import Commands
from mbs.app.cli.loading import configuration, system
from mbs.app.cli.places import require_places
from mbs.app.cli.printing import note

C_EXAMPLES = examples(
    "mbs export c puma560 build/puma560",
    "mbs export c sr400 sr400.zip --model idm --model ddm",
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
    target: Place,
    *,
    model: Model = None,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
) -> None:
    """Export models as C source with a header, CMakeLists.txt and an example."""
    from mbs.app.tasks import exporting
    from mbs.export import c_library

    assembled, keys = system(robot, parameter, gravity, mount), model or exporting.MODELS
    if target.suffix.lower() == ".zip":
        _write(target, exporting.c_library(assembled, keys))
        return
    c_library(exporting.c_functions(assembled, keys), target)
    note(f"wrote {target}")


Fmi = Annotated[str, typer.Option(metavar="VERSION", help="2.0 or 3.0.")]
Input = Annotated[
    Texts,
    typer.Option(
        "--input",
        metavar="NAME",
        help="What drives it beside efforts of motors: NAME.q, NAME.a, FRAME.wrench.",
        show_default=False,
    ),
]
Output = Annotated[
    Texts,
    typer.Option(
        metavar="NAME",
        help="What it shows beside the motion: energy, closure, poses, sensors, cut_forces.",
        show_default=False,
    ),
]
Symbolic = Annotated[
    Texts,
    typer.Option(
        metavar="NAME",
        help="Numbers that become parameters: masses, lengths, friction, or single ones: M3.",
        show_default=False,
    ),
]
Platform = Annotated[
    Texts,
    typer.Option(
        metavar="NAME",
        help="Computer that it is for, such as x86_64-windows; this one when left out.",
        show_default=False,
    ),
]
Solver = Annotated[
    str, typer.Option(metavar="METHOD", help="Of co-simulation: dopri5, rodas or rk4.")
]
Bare = Annotated[
    bool,
    typer.Option("--bare", help="For microcontrollers: no heap; co-simulation by rk4 alone."),
]
StopTime = Annotated[str, typer.Option(metavar="SECONDS", help="Default end.")]
StepSize = Annotated[str, typer.Option(metavar="SECONDS", help="Default communication step.")]
MaxStep = Annotated[
    str,
    typer.Option(
        metavar="SECONDS", help="The longest step of dopri5 and rodas.", show_default=False
    ),
]
Tolerance = Annotated[str, typer.Option(metavar="NUMBER", help="Default relative tolerance.")]


def export_fmu(
    robot: Robot,
    target: Target,
    *,
    fmi: Fmi = "2.0",
    input_: Input = None,
    output: Output = None,
    symbolic: Symbolic = None,
    platform: Platform = None,
    solver: Solver = "dopri5",
    bare: Bare = False,
    stop_time: StopTime = "10",
    step_size: StepSize = "0.01",
    tolerance: Tolerance = "1e-8",
    max_step: MaxStep = "",
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
) -> None:
    """Export an FMU for Model Exchange and Co-Simulation; this requires a C compiler.

    Inputs are the efforts of motors. Outputs are the motion of all joints and the pose of the
    terminal frame. Every symbol of the robot is a parameter.
    """
    from mbs.app.tasks import exporting

    settings = exporting.FmuSettings(
        fmi=fmi,
        inputs=tuple(input_ or ()),
        outputs=tuple(output or ()),
        parameters=tuple(symbolic or ()),
        platforms=tuple(platform or ()),
        solver=solver,
        target="bare" if bare else "hosted",
        stop_time=stop_time,
        step_size=step_size,
        tolerance=tolerance,
        max_step=max_step,
    )
    require_places(target)
    _write(target, exporting.fmu(system(robot, parameter, gravity, mount), settings))


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
    from mbs.files import write_bytes

    write_bytes(content, target)
    note(f"wrote {target}")


for _name, _command, _examples in (
    ("c", export_c, C_EXAMPLES),
    ("fmu", export_fmu, FMU_EXAMPLES),
    ("par", export_par, PAR_EXAMPLES),
    ("toml", export_toml, TOML_EXAMPLES),
    ("html", export_html, HTML_EXAMPLES),
):
    commands.command(_name, help=help_of(_command), epilog=_examples)(_command)
