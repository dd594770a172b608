"""Identification from a record that somebody sent: tables and series of plain numbers."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs import identification as identified_by
from mbs.app.tasks.identification_record import record_of
from mbs.app.tasks.simulation_laws import number
from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification import Identification, Residuals
from mbs.identification.estimation.methods import METHODS as _METHODS
from mbs.identification.observations.equations import EQUATIONS as _EQUATIONS
from mbs.messages import did_you_mean

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
