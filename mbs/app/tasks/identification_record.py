"""A measured record from the bytes of a file that somebody sent."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.identification import Record
from mbs.identification.records.table import csv_table
from mbs.messages import did_you_mean

LARGEST = 20_000_000
"""Bytes of the largest record that is read."""

TIME = "time"


def record_columns(system: System) -> dict[str, tuple[str, ...]]:
    """The columns that a record of the system may have, by what they are.

    Returns:
        "time", "q", "v" and "tau" to the names of their columns. In a closed system positions and
        velocities may be of the independent joints alone.
    """
    require_system(system)
    return {
        "time": (TIME,),
        "q": tuple(f"{c.name}.q" for c in system.coordinates),
        "v": tuple(f"{s.name}.v" for s in system.speeds),
        "tau": tuple(f"{system.speeds[k].name}.tau" for k in system.active),
    }


def record_of(system: System, content: bytes) -> Record:
    """The record in a file of comma-separated values.

    Its first line has names: `time` [s], for every joint `NAME.q` [rad or m] and perhaps `NAME.v`
    [rad/s or m/s], for every independent joint `NAME.tau` [N m or N]; in any order, beside other
    columns, which are left alone. What `mbs.Result.to_csv` writes is such a file.

    Args:
        system: open or closed, its measured joints revolute or prismatic.
        content: of the file, in UTF-8.

    Raises:
        ModelError: the file is too large or cannot be read, a column is missing, or its numbers
            are no record of this system.
    """
    wanted = record_columns(system)
    if len(content) > LARGEST:
        raise ModelError(
            f"record: the file has {len(content) / 1e6:.1f} MB, which is more than"
            f" {LARGEST / 1e6:.0f} MB; leave out columns, or cut it into several records"
        )
    with tempfile.TemporaryDirectory(prefix="mbs-record-") as folder:
        path = Path(folder) / "record.csv"
        path.write_bytes(content)
        try:
            table = csv_table(path)
        except ModelError as error:
            raise ModelError(str(error).replace(repr(str(path)), "the file")) from None
    q = _positions(system, wanted["q"], list(table))
    v = [f"{name.removesuffix('.q')}.v" for name in q]
    rates = v if all(name in table for name in v) else None
    missing = [name for name in (TIME, *wanted["tau"]) if name not in table]
    if missing:
        raise ModelError(_without(missing[0], list(table)))
    return Record.from_table(table, q, list(wanted["tau"]), rates, system=system)


def _positions(system: System, every: Sequence[str], there: Sequence[str]) -> list[str]:
    """The columns of positions: of all joints, or of the independent ones of a closed system."""
    missing = [name for name in every if name not in there]
    if not missing:
        return list(every)
    independent = [f"{system.speeds[k].name}.q" for k in system.active]
    if system.is_closed and all(name in there for name in independent):
        return independent
    wanted = [name for name in independent if name not in there] if system.is_closed else missing
    raise ModelError(_without(wanted[0], there))


def _without(name: str, there: Sequence[str]) -> str:
    return (
        f"record: there is no column {name!r} in the file, whose first line must name it;"
        f" {did_you_mean(name, there)}"
    )
