"""The results of a parameter study, read from disk one by one."""

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
from mbs.messages import quoted
from mbs.result import Result, optional_module
from mbs.simulate.cases import Case, Folder

Array = NDArray[np.float64]
Measures = Mapping[str, Callable[[Result], float]]
"""Name of a column to a function that makes one number of a result."""

_SHOWN = 20


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """The results of a parameter study; each is read from disk when it is asked for.

    `sweep[k]` is the result of case k, `sweep[-1]` that of the last one, `sweep[2:5]` a study of
    some of the cases.

    Attributes:
        name: of the model.
        cases: name to value, of each simulation.
        folder: where the results are.
        failures: number of a case that failed, and what it said.
        numbers: of the file of each case.
    """

    name: str
    cases: tuple[Case, ...]
    folder: Folder
    failures: Mapping[int, str]
    numbers: tuple[int, ...]

    @classmethod
    def open(cls, folder: str | os.PathLike[str]) -> Sweep:
        """The study in a folder, whole or not, without simulating anything.

        Args:
            folder: that `sweep` was given.

        Returns:
            the study; cases without a result are among the failures.

        Raises:
            ModelError: there is no study.
        """
        place = Folder(path_of(folder))
        name, cases = place.known()
        return cls(name, cases, place, {}, tuple(range(len(cases)))).as_found()

    def as_found(self) -> Sweep:
        """The same study, with the failures that its folder tells of now."""
        missing = self.folder.missing(len(self.cases))
        return replace(self, failures={k: self.folder.complained(k) for k in missing})

    def __repr__(self) -> str:
        return (
            f"<Sweep of {self.name}: {len(self.cases)} cases, {len(self.failures)} failed,"
            f" {self.folder.path}>"
        )

    def __str__(self) -> str:
        """A table of the cases, the first twenty of them."""
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
        """Each case that succeeded, with its result."""
        return ((case, self[k]) for k, case in enumerate(self.cases) if k not in self.failures)

    @overload
    def __getitem__(self, number: int) -> Result: ...
    @overload
    def __getitem__(self, number: slice) -> Sweep: ...
    def __getitem__(self, number: int | slice) -> Result | Sweep:
        """The result of a case, counted from the end where negative; or a study of some cases.

        Raises:
            ModelError: it failed, or there is no such case.
        """
        if isinstance(number, slice):
            return self._part(range(len(self.cases))[number])
        place = _index(number, len(self.cases))
        if place in self.failures:
            raise ModelError(f"sweep: case {place} failed: {self.failures[place]}")
        return Result.load(self.folder.file(self.numbers[place]))

    def reached(self, number: int) -> Result:
        """What a case came to, up to where it stopped if it failed; its `stopped` says so.

        Args:
            number: of the case, counted from the end where negative.

        Raises:
            ModelError: it failed before it had a row, or there is no such case.
        """
        place = _index(number, len(self.cases))
        if place not in self.failures:
            return self[place]
        file = self.folder.part(self.numbers[place])
        if not file.is_file():
            raise ModelError(f"sweep: case {place} reached nothing: {self.failures[place]}")
        return Result.load(file)

    def _part(self, chosen: range) -> Sweep:
        failures = {new: self.failures[k] for new, k in enumerate(chosen) if k in self.failures}
        cases = tuple(self.cases[k] for k in chosen)
        numbers = tuple(self.numbers[k] for k in chosen)
        return Sweep(self.name, cases, self.folder, failures, numbers)

    def summary(self, measures: Measures | None = None) -> dict[str, Array]:
        """One number of each case, for each measure.

        Args:
            measures: name to a function of a `Result`; when left out, the last value of every
                signal, as `j1.q.end` and so on.

        Returns:
            name to (number of cases,) values, in the unit of the measure; NaN where a case failed.

        Raises:
            ModelError: a measure gives no number, or has the name of what varies.
        """
        varied = {name for case in self.cases for name in case}
        for name in measures or ():
            if name in varied:
                raise ModelError(f"sweep: measure {name!r} has the name of what varies; rename it")
        columns: dict[str, Array] = {}
        for k in range(len(self)):
            if k in self.failures:
                continue
            for name, value in _measured(self[k], measures, k):
                column = columns.setdefault(name, np.full(len(self), np.nan))
                column[k] = value
        return columns

    def to_pandas(self, measures: Measures | None = None) -> Any:
        """A pandas DataFrame: a row for each case with its values, then the measures.

        Args:
            measures: as for `summary`.

        Returns:
            the table; `.attrs["failures"]` has what failed cases said.
        """
        pandas = optional_module("pandas", "tables")
        names = list(dict.fromkeys(name for case in self.cases for name in case))
        given = {name: [case.get(name, np.nan) for case in self.cases] for name in names}
        frame = pandas.DataFrame({**given, **self.summary(measures)})
        frame.index.name = "case"
        frame.attrs["failures"] = dict(self.failures)
        return frame

    def to_xarray(self, measures: Measures | None = None) -> Any:
        """An xarray Dataset of the measures.

        Args:
            measures: as for `summary`.

        Returns:
            over the names that were varied where the cases are every combination of their values;
            else over the number of the case.
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


def _measured(result: Result, measures: Measures | None, case: int) -> Iterator[tuple[str, float]]:
    if measures is None:
        ends = result.values[-1].tolist()
        yield from ((f"{name}.end", x) for name, x in zip(result.names, ends, strict=True))
        return
    for name, measure in measures.items():
        try:
            yield name, float(measure(result))
        except Exception as error:
            raise ModelError(
                f"sweep: measure {name!r} gives no number of case {case} ({error}); give a function"
                " of a Result that returns one"
            ) from error


def _axes(cases: tuple[Case, ...]) -> dict[str, tuple[float, ...]] | None:
    """The values of each name, where the cases are all their combinations in order."""
    names = list(cases[0]) if cases else []
    values = {name: tuple(dict.fromkeys(c.get(name, np.nan) for c in cases)) for name in names}
    every = [dict(zip(names, x, strict=True)) for x in itertools.product(*values.values())]
    return values if names and every == list(cases) else None
