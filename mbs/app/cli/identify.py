"""`mbs identify`: base inertial parameters from a record of a motion."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mbs.app.cli.arguments import Gravity, Json, Mount, Output, Parameters, Robot, examples
from mbs.app.cli.loading import system
from mbs.app.cli.places import require_places
from mbs.app.cli.printing import note, print_json
from mbs.errors import DescriptionError
from mbs.text import quoted

if TYPE_CHECKING:
    from mbs.app.tasks.identification import Identified

EXAMPLES = examples(
    "mbs identify rx90 record.csv --bandwidth 10",
    "mbs identify my_robot.toml record.csv --method robust --output estimate.csv",
    "mbs identify rx90 record.csv --equations energy --residuals residuals.csv --json",
)


Record = Annotated[
    Path,
    typer.Argument(
        metavar="RECORD",
        help="CSV file with the columns time, NAME.q, NAME.tau and perhaps NAME.v, in SI"
        " units, efforts on the joints' side of the gears; `mbs simulate --output` writes such"
        " files.",
        show_default=False,
    ),
]
Bandwidth = Annotated[
    str,
    typer.Option(
        "--bandwidth",
        "-b",
        metavar="HZ",
        help="Of the filters: five to ten times the highest frequency of the motion.",
    ),
]
Velocities = Annotated[
    str, typer.Option(metavar="SOURCE", help="differences of positions, or measured.")
]
Residuals = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="CSV file of measured and predicted efforts over time.",
        show_default=False,
    ),
]


def identify(
    robot: Robot,
    record: Record,
    *,
    bandwidth: Bandwidth = "10",
    velocities: Velocities = "differences",
    options: dict[str, Any],
    residuals: Residuals = None,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
    output: Output = None,
    json: Json = False,
) -> None:
    """Identify a robot from a record: base parameters, deviations, errors, bodies.

    The geometry and the friction law of ROBOT are used, its inertial parameters are not. --output
    writes the base parameters as CSV.
    """
    from mbs.app.tasks import identification as task
    from mbs.app.tasks.identification import LARGEST
    from mbs.files import write_text

    require_places(output, residuals)
    settings = task.IdentificationSettings(bandwidth, velocities, options)
    content = _content(record, LARGEST)
    found = task.identify(system(robot, parameter, gravity, mount), content, settings)
    for path, text in ((output, found.csv), (residuals, found.residuals_csv)):
        if path is not None:
            write_text(text(), path)
            note(f"wrote {path}")
    if json:
        print_json(_data(found))
    else:
        typer.echo(found.text)


def identify_options() -> type:
    """Return the dataclass of the options of an identification."""
    from mbs.identification.options import IdentifyArguments

    return IdentifyArguments


def _content(path: Path, most: int) -> bytes:
    """Return the content of a record file; of a too large file only the first `most` + 1 bytes.

    Raises:
        DescriptionError: the file cannot be read.
    """
    try:
        with path.open("rb") as stream:
            return stream.read(most + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DescriptionError(
            f"record {quoted(str(path))} cannot be read ({reason}); give the path of a CSV file"
        ) from None


def _data(found: Identified) -> dict[str, Any]:
    """Return the result of an identification as data for JSON."""
    return {
        "robot": found.name,
        "parameters": [asdict(row) for row in found.rows],
        "efforts": [asdict(row) for row in found.efforts],
        "total_percent": found.total_percent,
        "held_out_percent": found.held_out_percent,
        "bodies": found.bodies or None,
    }
