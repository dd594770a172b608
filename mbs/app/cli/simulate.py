"""`mbs simulate`: motion of a robot from given positions under given efforts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mbs.app.cli.arguments import Gravity, Json, Mount, Parameters, Robot, examples, output
from mbs.app.cli.loading import system
from mbs.app.cli.places import require_places
from mbs.app.cli.printing import PrintedTable, note, number, print_json, print_tables
from mbs.errors import Interrupted, SolverError

if TYPE_CHECKING:
    from mbs.assembly import System
    from mbs.result import Result

EXAMPLES = examples(
    "mbs simulate four_bar --duration 2 --q0 j1=0.3",
    "mbs simulate four_bar --tau 'j1=5*sin(2*t)' --output motion.csv --plot motion.png",
    "mbs simulate stewart_platform --duration 1 --film motion.html",
    "mbs simulate planar_2r --tau 'q1=20*(1 - q1.q) - 5*q1.v' --output - | head -3",
    "mbs simulate my_robot.toml --parameter L2=0.3 --duration 10 --step 0.001 --json",
    "mbs simulate puma560 --mount x=pi --gravity 0,0,-1.62",
)

Names = list[str] | None
Duration = Annotated[
    str, typer.Option("--duration", "-t", metavar="SECONDS", help="Simulated time.")
]
Q0 = Annotated[
    Names,
    typer.Option(
        metavar="NAME=VALUE",
        help="Position at the start in rad or m; may be repeated. Loops are closed with it.",
        show_default=False,
    ),
]
V0 = Annotated[
    Names,
    typer.Option(
        metavar="NAME=VALUE", help="Velocity at the start; may be repeated.", show_default=False
    ),
]
Tau = Annotated[
    Names,
    typer.Option(
        metavar="NAME=LAW",
        help="Effort of a motor in N m or N: a number, or a law of t, NAME.q and NAME.v.",
        show_default=False,
    ),
]
Input = Annotated[
    Names,
    typer.Option(
        "--input",
        metavar="NAME=LAW",
        help="Input of a device of a drive line, such as a voltage.",
        show_default=False,
    ),
]
Motion = Annotated[
    Names,
    typer.Option(
        metavar="NAME=LAW",
        help="Prescribed motion: NAME.q, NAME.v or NAME.a as a law of t.",
        show_default=False,
    ),
]

Output = Annotated[Path | None, output("CSV file to write, - for the standard output.")]
Plot = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Picture to write: .png, .svg or .pdf.", show_default=False),
]
Film = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Moving picture to write: .html, .gif, or .mp4 where ffmpeg is.",
        show_default=False,
    ),
]
Signal = Annotated[
    Names,
    typer.Option(
        metavar="NAME",
        help="Signal to draw, such as j1.q; may be repeated; all when left out.",
        show_default=False,
    ),
]


def simulate(
    robot: Robot,
    *,
    duration: Duration = "2",
    options: dict[str, Any],
    q0: Q0 = None,
    v0: V0 = None,
    tau: Tau = None,
    input_: Input = None,
    motion: Motion = None,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
    output: Output = None,
    plot: Plot = None,
    film: Film = None,
    signal: Signal = None,
    json: Json = False,
) -> None:
    """Simulate a robot with closed loops. If the motion stops early, its first part is written.

    The columns are NAME.q, NAME.v, NAME.a and NAME.tau of every coordinate, the energies, the
    closure residual of the loops, devices and sensors.
    """
    from mbs.app.tasks import simulation as task

    to_screen = output is not None and str(output) == "-"
    file = None if to_screen else output
    require_places(file, plot, film)
    laws = assigned(q0=q0, v0=v0, tau=tau, input=input_, motion=motion)
    assembled = system(robot, parameter, gravity, mount)
    settings = task.SimulationSettings(duration=duration, options=options, **laws)
    stop = None
    try:
        result = task.simulate(assembled, settings)
    except (SolverError, Interrupted) as error:
        if error.result is None:
            raise
        result, stop = error.result, error  # the part that was computed is written before the error
    _write(result, file)
    _draw(result, assembled, plot, film, signal)
    if json:
        print_json(data_of(result))
    elif to_screen:
        typer.echo(task.csv_bytes(result).decode("utf-8").replace("\r\n", "\n"), nl=False)
    else:
        _show(result)
    if stop is not None:
        raise stop


def motion_options() -> type:
    """Return the dataclass of the options of a motion."""
    from mbs.simulate.options import MotionOptions

    return MotionOptions


def assigned(**texts: Sequence[str] | None) -> dict[str, Any]:
    """Return arguments of `SimulationSettings` from the texts of options.

    Args:
        **texts: option name, such as tau, to its texts NAME=VALUE.

    Returns:
        Dict from names to values for each argument.

    Raises:
        DescriptionError: a text is not NAME=VALUE.
    """
    from mbs.app.tasks.laws import assignments

    fields = {"input": "inputs"}
    return {
        fields.get(name, name): assignments(given or (), f"--{name}")
        for name, given in texts.items()
    }


def _write(result: Result, file: Path | None) -> None:
    """Write a result as CSV and print the path; do nothing without a file."""
    if file is not None:
        result.to_csv(file)
        note(f"wrote {file}")


def _draw(
    result: Result, assembled: System, plot: Path | None, film: Path | None, signals: Names
) -> None:
    """Write a plot to the file `plot` and a movie to the file `film`, unless they are None.

    `signals` are the names of the signals to plot; None for all.
    """
    if plot is not None:
        result.plot(signals or None, plot)
        note(f"wrote {plot}")
    if film is not None:
        from mbs.view import animate

        animate(result, assembled, film)
        note(f"wrote {film}")


def data_of(result: Result) -> dict[str, Any]:
    """Return a result as data for JSON, with columns by name.

    Args:
        result: result of a simulation.
    """
    return {
        "name": result.name,
        "time": result.time,
        "units": dict(result.units),
        "columns": {name: result[name] for name in result.names},
        "events": [{"time": t, "name": name, "what": what} for t, name, what in result.events],
        "stopped": result.stopped,
    }


def _show(result: Result) -> None:
    """Print a table with start, extreme and final values of the signals, and the events."""
    rows = [
        (name, unit, *map(number, (x[0], x.min(), x.max(), x[-1])))
        for name, unit in result.units.items()
        for x in (result[name],)
    ]
    title = f"{result.name}: {len(result)} rows, {result.time[0]:g} to {result.time[-1]:g} s"
    columns = ("signal", "unit", "start", "least", "greatest", "end")
    print_tables([PrintedTable(title, columns, rows, columns[2:])])
    for time, name, what in result.events:
        typer.echo(f"{time:.6g} s  {name}  {what}")
