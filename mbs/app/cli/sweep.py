"""`mbs sweep`: a simulation for each case of a parameter sweep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mbs.app.cli.arguments import Gravity, Json, Mount, Output, Parameters, Robot, examples
from mbs.app.cli.loading import system
from mbs.app.cli.places import require_places
from mbs.app.cli.printing import note, print_json
from mbs.app.cli.simulate import Q0, V0, Duration, Tau, assigned

if TYPE_CHECKING:
    from mbs.app.tasks.sweeping import SweepTable

EXAMPLES = examples(
    "mbs sweep planar_2r --over q1.q=0:1:0.25 --duration 1",
    "mbs sweep four_bar --over 'j1.tau=0, 2, 4' --over j1.v=0:1:0.5 --output study.csv",
    "mbs sweep my_robot.toml --over L2=0.2:0.4:0.1 --folder study --json",
)


Over = Annotated[
    list[str],
    typer.Option(
        metavar="NAME=VALUES",
        help="What varies: a symbol, NAME.q or NAME.v at the start or a constant NAME.tau;"
        " FROM:TO:STEP or values with commas between. Repeated, every combination is taken.",
        show_default=False,
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Where the results of all cases are kept; a study that was interrupted goes on.",
        show_default=False,
    ),
]


def sweep(
    robot: Robot,
    *,
    over: Over,
    duration: Duration = "2",
    options: dict[str, Any],
    q0: Q0 = None,
    v0: V0 = None,
    tau: Tau = None,
    folder: Folder = None,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
    output: Output = None,
    json: Json = False,
) -> None:
    """Simulate a robot for every case of a parameter sweep, and write a CSV line per case.

    A line contains the varied values, then the final value of every signal, as NAME.q.end. Failed
    cases have empty fields. They are reported on the standard error, and the exit code is 1.
    """
    from mbs.app.tasks import simulation, sweeping
    from mbs.app.tasks.laws import assignments

    require_places(output)
    grid = sweeping.grid_of(assignments(over, "--over"))
    laws = assigned(q0=q0, v0=v0, tau=tau)
    settings = simulation.SimulationSettings(duration=duration, options=options, **laws)
    table = sweeping.sweep(system(robot, parameter, gravity, mount), grid, settings, folder=folder)
    if output is not None:
        from mbs.files import write_text

        write_text(table.csv(), output)
        note(f"wrote {output}")
    if json:
        print_json(_data(table))
    elif output is None:
        typer.echo(table.csv(), nl=False)
    for case, sentence in table.failures.items():
        note(f"mbs: case {case} failed: {sentence}")
    if table.failures:
        raise typer.Exit(1)


def _data(table: SweepTable) -> dict[str, Any]:
    """Return the table of a sweep as data for JSON."""
    return {
        "units": dict(zip(table.columns, table.units, strict=True)),
        "cases": [dict(zip(table.columns, row, strict=True)) for row in table.rows.tolist()],
        "failures": table.failures,
    }
