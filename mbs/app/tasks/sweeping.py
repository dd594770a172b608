"""Parameter sweep from the texts and numbers of a form or a command line, as a table."""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.app.tasks.csv_text import csv_text
from mbs.app.tasks.laws import number
from mbs.app.tasks.simulation import SimulationSettings, run_arguments
from mbs.assembly import System
from mbs.assembly.tables import EFFORT_UNIT
from mbs.errors import ModelError
from mbs.simulate import sweep as simulated_cases
from mbs.text import quoted

_MOST_VALUES = 10_000
_END = ".end"


@dataclass(frozen=True, slots=True, eq=False)
class SweepTable:
    """Table of a parameter sweep: a row per case with the varied values and the final signals.

    Attributes:
        columns: names of the columns; the name of a final value ends with ".end".
        units: units of the columns.
        rows: (cases, columns) values; NaN for final values of failed cases.
        failures: case index (0-based) to the error message, for failed cases.
    """

    columns: tuple[str, ...]
    units: tuple[str, ...]
    rows: NDArray[np.float64]
    failures: Mapping[int, str]

    def csv(self) -> str:
        """Return the table as comma-separated text with a header; empty fields for failed cases."""
        rows = self.rows.tolist()
        return csv_text(self.columns, (["" if x != x else x for x in row] for row in rows))


def grid_of(texts: Mapping[str, str]) -> dict[str, list[float]]:
    """Return the list of values of each name of a grid.

    Args:
        texts: name to "FROM:TO:STEP", with both ends included, or to values separated by commas,
            such as "0, 0.5, pi/2".

    Raises:
        ExpressionError: a value is not a number.
        ModelError: a range does not end, or a name has too many values.
    """
    return {name: _values(text, name) for name, text in texts.items()}


def sweep(
    system: System,
    grid: Mapping[str, Sequence[float]],
    settings: SimulationSettings | None = None,
    *,
    folder: str | os.PathLike[str] | None = None,
    quiet: bool = False,
) -> SweepTable:
    """Simulate a system for every combination of given values.

    Args:
        system: open or closed system.
        grid: name to its values. Names are parameters, initial values such as "j1.q" and "j1.v",
            and constant efforts such as "j1.tau".
        settings: settings of every simulation.
        folder: folder of the results, from which an interrupted sweep resumes. Default: results
            are not stored.
        quiet: whether to hide the progress bar.

    Raises:
        ModelError: a name is unknown, or see `mbs.simulate.sweep`.
    """
    arguments = run_arguments(system, settings or SimulationSettings())
    given = {name: value for name, value in arguments.items() if value is not None}
    study = simulated_cases(system, grid, folder=folder, quiet=quiet, **given)
    summary = study.summary()
    varied = list(grid)
    values = [[case[name] for name in varied] for case in study.cases]
    first = next((result for _, result in study), None)
    units = _units(system) | ({} if first is None else dict(first.units))
    columns = (*varied, *summary)
    return SweepTable(
        columns=columns,
        units=tuple(units.get(name.removesuffix(_END), "1") for name in columns),
        rows=np.column_stack([np.array(values, dtype=float), *summary.values()]),
        failures=dict(study.failures),
    )


def _values(text: str, name: str) -> list[float]:
    """Return the values of a text "FROM:TO:STEP" or "a, b, c".

    Raise a ModelError if it is neither.
    """
    parts = text.split(":")
    if len(parts) == 1:
        return [number(part.strip(), f"grid of {name}") for part in text.split(",")]
    if len(parts) != 3:
        raise ModelError(
            f"grid of {name}: {quoted(text)} is no range; write FROM:TO:STEP, such as 0:1:0.25, or"
            " values with commas between them"
        )
    start, stop, step = (number(part.strip(), f"grid of {name}") for part in parts)
    count = (stop - start) / step if step else -1.0
    if not 0 <= count <= _MOST_VALUES:
        raise ModelError(
            f"grid of {name}: {quoted(text)} has no end or more than {_MOST_VALUES} values; give a"
            " step that leads from the first to the last value"
        )
    # tolerance for steps that are decimal fractions: thousands of them may reach the last value
    whole = round(count) if abs(count - round(count)) < 1e-9 * max(1.0, count) else int(count)
    return [float(f"{start + k * step:.14g}") for k in range(whole + 1)]


def _units(system: System) -> dict[str, str]:
    """Return the units of all quantities that can be varied, by name."""
    positions = ((f"{c.name}.q", c.unit) for c in system.coordinates)
    rates = ((f"{s.name}.v", s.unit) for s in system.velocity_coordinates)
    efforts = ((f"{s.name}.tau", EFFORT_UNIT[s.unit]) for s in system.velocity_coordinates)
    parameters = ((p.name, p.unit) for p in system.parameters)
    return dict(itertools.chain(positions, rates, efforts, parameters))
