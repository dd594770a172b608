"""`mbs convert`: convert a robot file to another format."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mbs.app.cli.arguments import Gravity, Mount, Parameters, Robot, examples
from mbs.app.cli.loading import mechanism, numbers
from mbs.app.cli.printing import note
from mbs.errors import DescriptionError, ExportError
from mbs.text import did_you_mean

if TYPE_CHECKING:
    from mbs.formats import RobotTable

EXAMPLES = examples(
    "mbs convert robot.urdf robot.par",
    "mbs convert robot.par robot.toml",
    "mbs convert robot.urdf robot.xml",
    "mbs convert sr400 sr400.toml",
    "mbs convert puma560 puma560.urdf",
    "mbs convert sr400 sr400.sdf",
)
_TABLES = (".par", ".toml")
_WRITTEN = (*_TABLES, ".urdf", ".sdf", ".xml")


def convert(
    source: Robot,
    target: Annotated[
        Path,
        typer.Argument(
            metavar="TARGET",
            help="File to write: .par (SYMORO), .toml, .urdf, .sdf or .xml (MJCF).",
            show_default=False,
        ),
    ],
    *,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
) -> None:
    """Convert a robot to a .par, .toml, .urdf, .sdf or .xml (MJCF) file.

    Between .par and .toml the table of frames is copied, including symbols. From URDF, SDF, MJCF
    and the catalogue, link j of the assembled robot is frame j. URDF and SDF files contain numbers
    only, and a URDF file contains no loops.
    """
    suffix = target.suffix.lower()
    if suffix not in _WRITTEN:
        raise ExportError(
            f"{target}: files of this kind are not written; {did_you_mean(suffix, _WRITTEN)}"
        )
    is_plain = suffix in _TABLES and not gravity and not mount
    table = _table(source, parameter) if is_plain else None
    left_out = ""
    if suffix == ".xml":
        from mbs.export import mjcf
        from mbs.export.robot_files import shapes_left_out

        assembled = mechanism(source, parameter, gravity, mount).assemble()
        left_out = shapes_left_out(assembled)
        mjcf(assembled, target)
    elif table is not None:
        from mbs.formats import write_par, write_toml

        (write_par if suffix == ".par" else write_toml)(table, target)
    else:
        from mbs.app.tasks import exporting
        from mbs.export.robot_files import shapes_left_out
        from mbs.files import write_bytes

        assembled = mechanism(source, parameter, gravity, mount).assemble()
        left_out = shapes_left_out(assembled)
        writers = {
            ".par": exporting.par,
            ".toml": exporting.toml,
            ".urdf": exporting.urdf,
            ".sdf": exporting.sdf,
        }
        content = writers[suffix](assembled)
        write_bytes(content, target)
    if left_out:
        note(f"{target}: {left_out}")
    note(f"wrote {target}")


def _table(source: str, parameters: list[str] | None) -> RobotTable | None:
    """Return the table of frames in a .par or .toml file `source`; None for other robots.

    `parameters` are NAME=VALUE for symbols. Raise a DescriptionError if the file is invalid or a
    symbol is unknown.
    """
    from mbs.formats import read_par, read_toml
    from mbs.robots import catalogue

    suffix = Path(source).suffix.lower()
    if source in catalogue() or suffix not in _TABLES:
        return None
    table = read_par(source) if suffix == ".par" else read_toml(source)
    given = numbers(parameters, "--parameter")
    try:
        return replace(table, parameters={**table.parameters, **given})
    except DescriptionError as error:
        raise DescriptionError(f"--parameter: {error}") from error
