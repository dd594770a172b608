"""What is kept of the run of an FMU: rows of variables, and events."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbs.errors import SolverError
from mbs.result import Result
from mbs.simulate.fmu_variables import NUMBERS, columns_of, reader

Event = tuple[float, str, str]


@dataclass(slots=True)
class Recording:
    """Rows and events of a run, while it lasts.

    Attributes:
        name: of the model.
        columns: name of a column to its unit.
        read: the values of a row now.
        watched: names of the discrete variables.
        modes: their values now.
        reached: told the time of every row.
        times: of the rows [s].
        rows: values.
        events: time, name and words.
    """

    name: str
    columns: dict[str, str]
    read: Callable[[], list[float]]
    watched: list[str]
    modes: Callable[[], list[float]]
    reached: Callable[[float], None]
    times: list[float] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    last: list[float] = field(default_factory=list)

    def begin(self, time: float) -> None:
        """The first row."""
        self.last = self.modes() if self.watched else []
        self.row(time)

    def row(self, time: float) -> None:
        """Keep the values of now, once where nothing has changed at that time.

        Raises:
            SolverError: one of them is not finite.
        """
        values = self.read()
        for column, value in zip(self.columns, values, strict=True):
            if not math.isfinite(value):
                raise SolverError(f"FMU {self.name}: {column} is not finite at time {time:g} s")
        if not self.times or self.times[-1] != time or self.rows[-1] != values:
            self.times.append(time)
            self.rows.append(values)
        self.reached(time)

    def happened(self, time: float, otherwise: Iterable[tuple[str, str]] = ()) -> None:
        """Keep every discrete variable that has changed, or where none has, these names and words.

        Args:
            time: [s].
            otherwise: what is said where no discrete variable changed.
        """
        now = self.modes() if self.watched else []
        changed = [
            (time, name, f"{before:g} -> {after:g}")
            for name, before, after in zip(self.watched, self.last, now, strict=True)
            if before != after
        ]
        self.last = now
        self.events.extend(changed or [(time, name, words) for name, words in otherwise])

    def ended(self, time: float) -> None:
        """The FMU asks for the end."""
        self.events.append((time, self.name, "ends the simulation"))

    def result(self, stopped: tuple[float, str] | None = None) -> Result:
        """All of it.

        Args:
            stopped: time, s, and sentence of what stopped the run early; None where it is complete.
        """
        values = np.array(self.rows, dtype=float).reshape(len(self.times), len(self.columns))
        return Result(
            np.array(self.times),
            values,
            self.columns,
            self.name,
            events=tuple(self.events),
            stopped=stopped,
        )


def recording_of(
    instance: Any, description: Any, variables: list[Any], reached: Callable[[float], None]
) -> Recording:
    """A recording of an instance, still empty.

    Args:
        instance: of an FMU, an object of fmpy.
        description: its model description.
        variables: to keep.
        reached: told the time of every row.
    """
    watched = [
        v
        for v in description.modelVariables
        if v.variability == "discrete"
        and v.causality in ("output", "local")
        and v.type in NUMBERS
        and not v.dimensions
    ]
    return Recording(
        name=description.modelName,
        columns=columns_of(variables),
        read=reader(instance, variables),
        watched=[v.name for v in watched],
        modes=reader(instance, watched),
        reached=reached,
    )
