"""Identification from an uploaded record: tables and series of plain numbers."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs import identification as identified_by
from mbs.app.tasks.csv_text import csv_text
from mbs.app.tasks.laws import number
from mbs.app.tasks.options import keywords
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.identification import Identification, Record, Residuals
from mbs.identification.options import IdentifyArguments
from mbs.identification.record import csv_table
from mbs.text import did_you_mean

# A measured record from the content of an uploaded file.


LARGEST = 20_000_000
"""Maximum size of a record in bytes."""

TIME = "time"


def record_columns(system: System) -> dict[str, tuple[str, ...]]:
    """Return the columns that a record of a system may have, by quantity.

    Args:
        system: open or closed system.

    Returns:
        Names of the columns for each of the quantities "time", "q", "v" and "tau". A record of a
        closed system may contain only positions and velocities of the independent joints.
    """
    require_system(system)
    return {
        "time": (TIME,),
        "q": tuple(f"{c.name}.q" for c in system.coordinates),
        "v": tuple(f"{s.name}.v" for s in system.velocity_coordinates),
        "tau": tuple(f"{system.velocity_coordinates[k].name}.tau" for k in system.independent),
    }


def record_of(system: System, content: bytes) -> Record:
    """Read a record from the content of a file of comma-separated values.

    The first line contains the names of the columns: `time` [s], `NAME.q` [rad or m] and optionally
    `NAME.v` [rad/s or m/s] for every joint, and `NAME.tau` [N m or N] for every independent joint.
    The order is free and other columns are ignored. `mbs.Result.to_csv` writes such files.

    Args:
        system: open or closed system. The measured joints must be revolute or prismatic.
        content: content of the file in UTF-8.

    Raises:
        ModelError: the file is too large or cannot be read, a column is missing, or the values
            are not a record of this system.
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
    """Return the position columns: of all joints, else of the independent joints of loops.

    `every` are all position columns, `there` the columns of the record. Raise a ModelError if one
    is missing.
    """
    missing = [name for name in every if name not in there]
    if not missing:
        return list(every)
    independent = [f"{system.velocity_coordinates[k].name}.q" for k in system.independent]
    if system.is_closed and all(name in there for name in independent):
        return independent
    wanted = [name for name in independent if name not in there] if system.is_closed else missing
    raise ModelError(_without(wanted[0], there))


def _without(name: str, there: Sequence[str]) -> str:
    """Return the error message for a missing column; `there` are the columns of the record."""
    return (
        f"record: there is no column {name!r} in the file, whose first line must name it;"
        f" {did_you_mean(name, there)}"
    )


VELOCITIES = ("differences", "measured")
"""Sources of velocities: differences of positions, or the columns of the record."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """Settings of an identification.

    Attributes:
        bandwidth: bandwidth of the filters [Hz]; five to ten times the highest frequency of the
            motion.
        velocities: source of velocities, a name in `VELOCITIES`.
        options: options of `mbs.identification.identify` by name, such as "method". The others
            have their defaults.
    """

    bandwidth: float | str = 10.0
    velocities: str = "differences"
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class EstimateRow:
    """Estimate of a base parameter.

    Attributes:
        name: name, such as XX2R.
        unit: unit of value and deviation.
        value: estimated value.
        deviation: standard deviation.
        percent: deviation in percent of the value; infinite for a value of zero.
        grouping: linear combination of link parameters, such as "XX2R = XX2 - YY2".
        essential: whether the parameter is needed to explain the record.
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
    """Prediction error of the effort of a joint.

    Attributes:
        name: name of the joint.
        unit: unit of the effort.
        rms: root mean square of measured minus predicted effort.
        percent: error in percent of the effort.
        held_out_rms: rms error in the last quarter of the record, with parameters estimated from
            the other three quarters.
        held_out_percent: error in that quarter in percent of the effort.
    """

    name: str
    unit: str
    rms: float
    percent: float
    held_out_rms: float
    held_out_percent: float


@dataclass(frozen=True, slots=True, eq=False)
class Identified:
    """Result of an identification as plain data.

    Attributes:
        name: name of the system.
        rows: estimates of the base parameters.
        efforts: prediction errors of the efforts.
        total_percent: norm of all errors in percent of all efforts.
        held_out_percent: the same in the last quarter, with parameters estimated from the other
            three quarters.
        time: (n,) times of the equations [s].
        measured: (n, m) right-hand sides: filtered efforts [N m or N], or the equivalent quantity
            of the chosen equations.
        predicted: (n, m) right-hand sides predicted by the parameters.
        text: complete report as plain text.
        bodies: mass, centre of mass and inertia of every body as plain text; empty if they were
            not estimated.
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
        """Return the estimates of the base parameters as comma-separated text with a header."""
        head = ("name", "value", "deviation", "percent", "unit", "essential", "grouping")
        words = {True: "yes", False: "no"}
        rows = (
            (r.name, r.value, r.deviation, r.percent, r.unit, words[r.essential], r.grouping)
            for r in self.rows
        )
        return csv_text(head, rows)

    def residuals_csv(self) -> str:
        """Return time, measured and predicted right-hand sides as comma-separated text."""
        names = [effort.name for effort in self.efforts]
        head = ("time", *(f"{n}.{kind}" for n in names for kind in ("measured", "predicted")))
        pairs = np.stack([self.measured, self.predicted], axis=2).reshape(len(self.time), -1)
        return csv_text(head, np.column_stack([self.time, pairs]).tolist())


def identify(
    system: System,
    content: bytes,
    settings: IdentificationSettings | None = None,
    *,
    quiet: bool = False,
) -> Identified:
    """Estimate the base parameters of a system from the content of a record file.

    Args:
        system: open or closed system; its inertial parameters and friction are not used.
        content: content of the file, see `record_of`.
        settings: settings of the identification.
        quiet: whether to hide the progress bar.

    Raises:
        ModelError: a setting is unknown, the file is no record of this system, or a base
            parameter is not identifiable from it.
        SolverError: a search for the base parameters did not end.
    """
    settings = settings or IdentificationSettings()
    require_system(system)
    if settings.velocities not in VELOCITIES:
        raise ModelError(
            f"{system.name}: velocities is {settings.velocities!r};"
            f" {did_you_mean(settings.velocities, VELOCITIES)}"
        )
    record = record_of(system, content)
    measured = settings.velocities == "measured"
    found = identified_by.identify(
        system,
        record,
        number(settings.bandwidth, f"{system.name}: bandwidth [Hz]"),
        smoothing=identified_by.smoothed_with_velocity if measured else identified_by.smoothed,
        quiet=quiet,
        **keywords(IdentifyArguments, settings.options, system.name),
    )
    return identified(found)


def identified(found: Identification) -> Identified:
    """Convert an identification to plain data.

    Args:
        found: result of `mbs.identification.identify`.
    """
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


def _rows(found: Identification) -> tuple[EstimateRow, ...]:
    """Return the estimates of the base parameters as rows."""
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
    """Return the errors of the efforts; `tested` are the residuals in the last quarter."""
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
