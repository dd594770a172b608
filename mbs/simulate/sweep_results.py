"""Results of a parameter sweep, read from disk on access."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from mbs.errors import ModelError
from mbs.files import path_of
from mbs.result import Result, optional_module
from mbs.simulate.sweep_cases import Case
from mbs.simulate.sweep_store import ResultStore
from mbs.text import error_text, quoted

Array = NDArray[np.float64]
Measures = Mapping[str, Callable[[Result], float]]
"""Dict from column name to a function that returns a number for a Result."""

_SHOWN = 20


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Results of a parameter sweep. Each result is read from disk on access.

    `sweep[k]` is the result of case k, `sweep[-1]` the result of the last case, and `sweep[2:5]` a
    Sweep of cases 2 to 4. Iteration yields the pairs (case, result) of the successful cases.

    Attributes:
        name: name of the model.
        cases: dict from name to value of each simulation.
        folder: folder of the results.
        failures: dict from the index of a failed case (from 0) to its error message.
        numbers: index of the file of each case.
    """

    name: str
    cases: tuple[Case, ...]
    folder: ResultStore
    failures: Mapping[int, str]
    numbers: tuple[int, ...]

    @classmethod
    def open(cls, folder: str | os.PathLike[str]) -> Sweep:
        """Open the complete or partial results in a folder, without simulation.

        Args:
            folder: folder that was passed to `sweep`.

        Returns:
            Sweep of all cases. Cases without result are in `failures`.

        Raises:
            ModelError: the folder contains no sweep.
        """
        store = ResultStore(path_of(folder).absolute())
        name, cases = store.model_and_cases()
        return cls(name, cases, store, {}, tuple(range(len(cases)))).as_found()

    def as_found(self) -> Sweep:
        """Return a copy with the failures that are now recorded in the folder."""
        missing = self.folder.missing(len(self.cases))
        return replace(self, failures={k: self.folder.error_of(k) for k in missing})

    def __repr__(self) -> str:
        return (
            f"<Sweep of {self.name}: {len(self.cases)} cases, {len(self.failures)} failed,"
            f" {self.folder.path}>"
        )

    def __str__(self) -> str:
        """Return a table of the first twenty cases and their error messages."""
        names = list(dict.fromkeys(name for case in self.cases for name in case))
        rows = [["case", *names, ""]]
        for k, case in enumerate(self.cases[:_SHOWN]):
            values = (f"{case[name]:g}" if name in case else "" for name in names)
            rows.append([str(k), *values, self.failures.get(k, "")])
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
        lines = [
            "  ".join((*(x.rjust(w) for x, w in zip(row, widths, strict=False)), row[-1])).rstrip()
            for row in rows
        ]
        more = len(self.cases) - _SHOWN
        rest = [f"and {more} more"] if more > 0 else []
        return "\n".join([repr(self)[1:-1], *lines, *rest])

    def __len__(self) -> int:
        return len(self.cases)

    def __iter__(self) -> Iterator[tuple[Case, Result]]:
        """Iterate over the pairs (case, result) of the cases that succeeded."""
        return ((case, self[k]) for k, case in enumerate(self.cases) if k not in self.failures)

    @overload
    def __getitem__(self, number: int) -> Result: ...
    @overload
    def __getitem__(self, number: slice) -> Sweep: ...
    def __getitem__(self, number: int | slice) -> Result | Sweep:
        """Return the result of a case (negative: from the end), or a Sweep of a slice.

        Raises:
            ModelError: the case failed, or the index is out of range.
        """
        if isinstance(number, slice):
            return self._slice(range(len(self.cases))[number])
        place = _index(number, len(self.cases))
        if place in self.failures:
            raise ModelError(f"sweep: case {place} failed: {self.failures[place]}")
        return Result.load(self.folder.file(self.numbers[place]))

    def reached(self, number: int) -> Result:
        """Return the result of a case, or its rows before the stop if it failed.

        The `stopped` of a partial result contains the time and the error message.

        Args:
            number: index of the case; negative indices count from the end.

        Raises:
            ModelError: the case failed without a row, or the index is out of range.
        """
        place = _index(number, len(self.cases))
        if place not in self.failures:
            return self[place]
        file = self.folder.partial_file(self.numbers[place])
        if not file.is_file():
            raise ModelError(f"sweep: case {place} reached nothing: {self.failures[place]}")
        return Result.load(file)

    def _slice(self, chosen: range) -> Sweep:
        failures = {new: self.failures[k] for new, k in enumerate(chosen) if k in self.failures}
        cases = tuple(self.cases[k] for k in chosen)
        numbers = tuple(self.numbers[k] for k in chosen)
        return Sweep(self.name, cases, self.folder, failures, numbers)

    def summary(self, measures: Measures | None = None) -> dict[str, Array]:
        """Evaluate measures, each a scalar function of a Result, for all cases.

        Args:
            measures: dict from name to function of a `Result`. The default is the last value of
                every signal, named `j1.q.end` for the signal `j1.q`.

        Returns:
            Dict from name to values (number of cases,) in the unit of the measure. The value of a
            failed case is NaN.

        Raises:
            ModelError: a measure does not return a number, or has the name of a varied quantity.
        """
        varied = {name for case in self.cases for name in case}
        for name in measures or ():
            if name in varied:
                raise ModelError(f"sweep: measure {name!r} has the name of what varies; rename it")
        columns: dict[str, Array] = {}
        for k in range(len(self)):
            if k in self.failures:
                continue
            for name, value in _measure(self[k], measures, k):
                column = columns.setdefault(name, np.full(len(self), np.nan))
                column[k] = value
        return columns

    def to_pandas(self, measures: Measures | None = None) -> Any:
        """Return a pandas DataFrame with one row per case: varied values, then measures.

        Args:
            measures: measures, as in `summary`.

        Returns:
            DataFrame. Its `.attrs["failures"]` contains the error messages of failed cases.
        """
        pandas = optional_module("pandas", "tables")
        names = list(dict.fromkeys(name for case in self.cases for name in case))
        given = {name: [case.get(name, np.nan) for case in self.cases] for name in names}
        frame = pandas.DataFrame({**given, **self.summary(measures)})
        frame.index.name = "case"
        frame.attrs["failures"] = dict(self.failures)
        return frame

    def to_xarray(self, measures: Measures | None = None) -> Any:
        """Return an xarray Dataset of the measures.

        Args:
            measures: measures, as in `summary`.

        Returns:
            Dataset. Its dimensions are the varied names if the cases are all combinations of their
            values in order, and otherwise the index of the case.
        """
        xarray = optional_module("xarray", "tables")
        columns, axes = self.summary(measures), _axes(self.cases)
        if axes is None:
            names = list(dict.fromkeys(name for case in self.cases for name in case))
            given = {n: ("case", [c.get(n, np.nan) for c in self.cases]) for n in names}
            flat = {name: ("case", column) for name, column in columns.items()}
            return xarray.Dataset(flat, coords={"case": np.arange(len(self)), **given})
        shape = tuple(len(values) for values in axes.values())
        data = {name: (tuple(axes), column.reshape(shape)) for name, column in columns.items()}
        return xarray.Dataset(data, coords={name: list(values) for name, values in axes.items()})


def _index(number: object, count: int) -> int:
    if isinstance(number, (int, np.integer)) and -count <= number < count:
        return int(number) % count
    raise ModelError(
        f"sweep: there is no case {quoted(number)}; they are 0 to {count - 1}, or -1 for the last"
    )


def _measure(result: Result, measures: Measures | None, case: int) -> Iterator[tuple[str, float]]:
    if measures is None:
        ends = result.values[-1].tolist()
        yield from ((f"{name}.end", x) for name, x in zip(result.names, ends, strict=True))
        return
    for name, measure in measures.items():
        try:
            yield name, float(measure(result))
        except Exception as error:
            raise ModelError(
                f"sweep: measure {name!r} gives no number of case {case} ({error_text(error)});"
                " give a function of a Result that returns one"
            ) from error


def _axes(cases: tuple[Case, ...]) -> dict[str, tuple[float, ...]] | None:
    """Return the values of each name, or None if the cases are not a full grid in order."""
    names = list(cases[0]) if cases else []
    values = {name: tuple(dict.fromkeys(c.get(name, np.nan) for c in cases)) for name in names}
    every = [dict(zip(names, x, strict=True)) for x in itertools.product(*values.values())]
    return values if names and every == list(cases) else None
