"""Identification from a record that somebody sent: tables and series of plain numbers."""

from __future__ import annotations

import csv
import io
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbs import identification as identified_by
from mbs.app.tasks.simulation import number
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.identification import Identification, Record, Residuals
from mbs.identification.methods import METHODS as _METHODS
from mbs.identification.observations import EQUATIONS as _EQUATIONS
from mbs.identification.record import csv_table
from mbs.text import did_you_mean

# A measured record from the bytes of a file that somebody sent.


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


METHODS = tuple(_METHODS)
"""Methods of estimation by name."""

EQUATIONS = tuple(_EQUATIONS)
"""Models that the equations come from by name."""

VELOCITIES = ("differences", "measured")
"""Where velocities come from: differences of positions, or the columns of the record."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """How a record is evaluated.

    Attributes:
        bandwidth: of the filters [Hz]; five to ten times the highest frequency of the motion.
        method: one of `METHODS`.
        equations: one of `EQUATIONS`.
        rotors: whether inertias of rotors are looked for.
        offsets: whether a constant effort of each joint is looked for.
        velocities: one of `VELOCITIES`.
    """

    bandwidth: float | str = 10.0
    method: str = "weighted"
    equations: str = "dynamic"
    rotors: bool = True
    offsets: bool = False
    velocities: str = "differences"


@dataclass(frozen=True, slots=True)
class EstimateRow:
    """One base parameter.

    Attributes:
        name: such as XX2R.
        unit: of value and deviation.
        value: estimated.
        deviation: standard deviation.
        percent: deviation in percent of the value; infinite for a value of zero.
        grouping: which parameters it stands for, such as "XX2R = XX2 - YY2".
        essential: whether the record needs it.
    """

    name: str
    unit: str
    value: float
    deviation: float
    percent: float
    grouping: str
    essential: bool


@dataclass(frozen=True, slots=True)
class EffortError:
    """What the parameters leave unexplained of one effort.

    Attributes:
        name: of the joint.
        unit: of the effort.
        rms: root mean square of measured minus predicted.
        percent: the same in percent of the effort.
        held_out_rms: in the last quarter of the record, of parameters found from the rest.
        held_out_percent: the same in percent of the effort there.
    """

    name: str
    unit: str
    rms: float
    percent: float
    held_out_rms: float
    held_out_percent: float


@dataclass(frozen=True, slots=True, eq=False)
class Identified:
    """What a record says of a system, as plain data.

    Attributes:
        name: of the system.
        rows: the base parameters.
        efforts: errors of prediction.
        total_percent: norm of all errors in percent of all efforts.
        held_out_percent: the same in the last quarter, of parameters found from the rest.
        time: (n,) [s] of the equations.
        measured: (n, m) right sides: filtered efforts [N m or N], or what the chosen equations
            have in their place.
        predicted: (n, m) the same from the parameters.
        text: the whole account in plain lines.
        bodies: mass, centre of mass and inertia of every body in plain lines; empty where none
            were found.
    """

    name: str
    rows: tuple[EstimateRow, ...]
    efforts: tuple[EffortError, ...]
    total_percent: float
    held_out_percent: float
    time: Array
    measured: Array
    predicted: Array
    text: str
    bodies: str

    def csv(self) -> str:
        """The base parameters as comma-separated values."""
        head = ("name", "value", "deviation", "percent", "unit", "essential", "grouping")
        rows = (
            (r.name, *map(repr, (r.value, r.deviation, r.percent)), r.unit, _yes(r), r.grouping)
            for r in self.rows
        )
        return _csv(head, rows)

    def residuals_csv(self) -> str:
        """Time, and measured and predicted side of every effort, as comma-separated values."""
        names = [effort.name for effort in self.efforts]
        head = ("time", *(f"{n}.{kind}" for n in names for kind in ("measured", "predicted")))
        pairs = np.stack([self.measured, self.predicted], axis=2).reshape(len(self.time), -1)
        return _csv(head, (map(repr, row) for row in np.column_stack([self.time, pairs]).tolist()))


def identify(
    system: System,
    content: bytes,
    settings: IdentificationSettings | None = None,
    *,
    quiet: bool = False,
) -> Identified:
    """Base parameters from the bytes of a record.

    Args:
        system: open or closed; its inertial parameters and friction are not used.
        content: of a file as `record_of` reads it.
        settings: of the evaluation.
        quiet: no progress bar.

    Raises:
        ModelError: a setting is unknown, the file is no record of this system, or it does not show
            every base parameter.
        SolverError: a search for the base parameters did not end.
    """
    settings = settings or IdentificationSettings()
    _check(system, settings)
    record = record_of(system, content)
    measured = settings.velocities == "measured"
    found = identified_by.identify(
        system,
        record,
        number(settings.bandwidth, f"{system.name}: bandwidth [Hz]"),
        settings.method,
        equations=settings.equations,
        smoothing=identified_by.smoothed_with_velocity if measured else identified_by.smoothed,
        rotors=settings.rotors,
        offsets=settings.offsets,
        quiet=quiet,
    )
    return identified(found)


def identified(found: Identification) -> Identified:
    """The plain data of an identification."""
    residuals = found.estimate.residuals
    return Identified(
        name=found.system.name,
        rows=_rows(found),
        efforts=_efforts(residuals, found.validation),
        total_percent=residuals.total_percent,
        held_out_percent=found.validation.total_percent,
        time=residuals.time,
        measured=residuals.measured,
        predicted=residuals.predicted,
        text=found.text(),
        bodies=found.bodies_table() if found.bodies is not None else "",
    )


def _check(system: System, settings: IdentificationSettings) -> None:
    choices = {
        "method": (settings.method, METHODS),
        "equations": (settings.equations, EQUATIONS),
        "velocities": (settings.velocities, VELOCITIES),
    }
    for what, (given, known) in choices.items():
        if given not in known:
            raise ModelError(f"{system.name}: {what} is {given!r}; {did_you_mean(given, known)}")


def _rows(found: Identification) -> tuple[EstimateRow, ...]:
    estimate = found.estimate
    needed = set(found.essential().estimate.names)
    grouping = dict(zip(found.base.names, found.base.equations, strict=True))
    return tuple(
        EstimateRow(
            column.name,
            column.unit,
            float(value),
            float(deviation),
            float(percent),
            grouping.get(column.name, column.name),
            column.name in needed,
        )
        for column, value, deviation, percent in zip(
            estimate.columns, estimate.values, estimate.deviations, estimate.percent, strict=True
        )
    )


def _efforts(residuals: Residuals, tested: Residuals) -> tuple[EffortError, ...]:
    return tuple(
        EffortError(name, unit, *map(float, numbers))
        for name, unit, *numbers in zip(
            residuals.efforts,
            residuals.effort_units,
            residuals.rms,
            residuals.percent,
            tested.rms,
            tested.percent,
            strict=True,
        )
    )


def _yes(row: EstimateRow) -> str:
    return "yes" if row.essential else "no"


def _csv(head: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return stream.getvalue()
