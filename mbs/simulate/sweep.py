"""Parameter studies: one simulation for each case, over any executor."""

from __future__ import annotations

import functools
import hashlib
import inspect
import itertools
import json
import os
import pickle
import re
import shutil
import tempfile
import weakref
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.system import packed, unpacked
from mbs.errors import ExportError, Interrupted, MbsError, ModelError, SolverError
from mbs.files import check_archive, path_of, write_text
from mbs.numbers import numbers_given
from mbs.progress import progress
from mbs.result import Result, State, optional_module, state_of
from mbs.simulate.fmu import fmu
from mbs.simulate.fmu_variables import numbers_of
from mbs.simulate.run import run, simulator_of
from mbs.text import did_you_mean, error_text, quoted

# The cases of a parameter study, and the folder that keeps their results.


_INDEX = "study.json"

Case = dict[str, float]
Grid = Mapping[str, Iterable[float]] | Sequence[Mapping[str, float]]


def cases_of(grid: Grid) -> tuple[Case, ...]:
    """Every combination of the values of a grid, the last name fastest; or the cases as listed.

    Args:
        grid: name to its values, or one dict of names to values for each case.

    Raises:
        ModelError: there is no case, or a value is no number.
    """
    if isinstance(grid, Mapping):
        listed = list(_combinations(grid))
    elif isinstance(grid, Sequence) and all(isinstance(case, Mapping) for case in grid):
        listed = [dict(case) for case in grid]
    else:
        raise ModelError(
            f'sweep: the grid is {quoted(grid)}; give a dict such as {{"m": [1.0, 2.0]}}, or a'
            ' list of one dict for each case, such as [{"m": 1.0}, {"m": 2.0}]'
        )
    if not grid or not listed:
        raise ModelError("sweep: the grid has no case; give at least one value for every name")
    return tuple({str(name): _number(name, x) for name, x in case.items()} for case in listed)


def _combinations(grid: Mapping[str, Iterable[float]]) -> Iterable[Case]:
    columns = [
        list(values) if isinstance(values, Iterable) else [values] for values in grid.values()
    ]
    for values in itertools.product(*columns):
        yield dict(zip(grid, values, strict=True))


def _number(name: str, value: object) -> float:
    array = numbers_given(value)
    if isinstance(array, str):
        raise ModelError(f"sweep: {name} {array}")
    if array.size != 1:
        raise ModelError(f"sweep: {name} is {quoted(value)}; give one number for each case")
    return float(array.item())


@dataclass(frozen=True, slots=True, weakref_slot=True)
class Folder:
    """Where the results of a study are kept, a file for each case.

    Attributes:
        path: the folder, absolute: threads that load FMUs change the working directory meanwhile.
    """

    path: Path

    @staticmethod
    def opened(path: object, study: Mapping[str, object]) -> Folder:
        """The folder of a study: made, or found with the same study in it.

        Args:
            path: where.
            study: what is studied, as JSON knows it.

        Raises:
            ModelError: it holds another study, or results of an unknown one.
            ExportError: it cannot be written.
        """
        folder = Folder(_make(path_of(path).absolute()))
        index = folder.path / _INDEX
        text = json.dumps(study, indent=1, sort_keys=True) + "\n"
        known = index.read_bytes() if index.exists() else None
        if known == text.encode():
            return folder
        if known is not None or any(folder.path.glob("case_*.npz")):
            raise ModelError(
                f"sweep: folder {folder.path} holds another study; choose another folder, or delete"
                " it"
            )
        write_text(text, index)
        return folder

    def file(self, number: int) -> Path:
        """The file of a case."""
        return self.path / f"case_{number:06d}.npz"

    def part(self, number: int) -> Path:
        """The file of what a case that failed had reached."""
        return self.path / f"part_{number:06d}.npz"

    def keep(self, number: int, result: Result | None, complaint: str = "") -> None:
        """Write the result of a case; or why it failed, with what it had reached.

        Args:
            number: of the case.
            result: whole, or up to where it stopped; None where nothing was reached.
            complaint: why it failed; empty where it did not.

        Raises:
            ExportError: the folder cannot be written.
        """
        said, part = self._complaint(number), self.part(number)
        part.unlink(missing_ok=True)
        if complaint:
            write_text(complaint, said)
        else:
            said.unlink(missing_ok=True)
        if result is not None:
            result.save(part if complaint else self.file(number))

    def complained(self, number: int) -> str:
        """Why a case has no result."""
        said = self._complaint(number)
        return said.read_text(encoding="utf-8") if said.is_file() else "not simulated yet"

    def known(self) -> tuple[str, tuple[Case, ...]]:
        """The name of the model that is studied here, and the cases.

        Raises:
            ModelError: there is no study.
        """
        try:
            study = json.loads((self.path / _INDEX).read_text(encoding="utf-8"))
            return str(study["model"]), tuple(dict(case) for case in study["cases"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ModelError(
                f"sweep: {self.path} holds no study; give the folder that a sweep was given"
            ) from error

    def _complaint(self, number: int) -> Path:
        return self.path / f"case_{number:06d}.txt"

    def missing(self, count: int) -> list[int]:
        """The numbers of the cases, of so many, that have no whole result yet."""
        return [number for number in range(count) if not zipfile.is_zipfile(self.file(number))]


def _make(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(
            f"folder {folder} cannot be made ({error.strerror}); choose another one"
        ) from error
    return folder


# What makes a parameter study the same as an earlier one.


_ADDRESS = re.compile(r" at 0x[0-9A-Fa-f]+")  # of objects in memory, another one every time


def study_of(
    model: System | str | os.PathLike[str], cases: Sequence[Case], options: Mapping[str, Any]
) -> dict[str, object]:
    """A study as JSON knows it.

    Args:
        model: a system, or the path of an FMU.
        cases: name to value, of each simulation.
        options: further arguments of every simulation.

    Raises:
        ModelError: there is no such FMU.
    """
    name, content = _system(model, options) if isinstance(model, System) else _fmu(model)
    described = {option: _describe(value) for option, value in sorted(options.items())}
    digest = hashlib.sha256(content).hexdigest()
    return {"model": name, "content": digest, "cases": list(cases), "options": described}


_LAWS = ("tau", "motion", "u", "method")
"""Options that are the same in all cases; what a case says of efforts and inputs is in their place,
as numbers, so that no case has equations of its own."""


def _system(system: System, options: Mapping[str, Any]) -> tuple[str, bytes]:
    """Its name, and what its motions under these laws follow from, to the last digit."""
    laws = {name: options[name] for name in _LAWS if name in options}
    return system.name, simulator_of(system, **laws).content()


def _fmu(path: object) -> tuple[str, bytes]:
    if not isinstance(path, (str, os.PathLike)):
        raise ModelError(f"sweep: {quoted(path)} is no model; give a System or the path of an FMU")
    file = Path(os.fspath(path))
    try:
        return file.name, file.read_bytes()
    except OSError as error:
        raise ModelError(
            f"sweep: {file} cannot be read ({error.strerror}); give the path of an FMU"
        ) from error


def _describe(value: object) -> str:
    """A text that is the same the next time."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {_describe(value[key])}" for key in value) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_describe(part) for part in value) + "]"
    if isinstance(value, np.ndarray):
        return f"array {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    return getattr(value, "__qualname__", None) or _ADDRESS.sub("", repr(value))


# The results of a parameter study, read from disk one by one.


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
        place = Folder(path_of(folder).absolute())
        name, cases = place.known()
        return cls(name, cases, place, {}, tuple(range(len(cases)))).as_found()

    def as_found(self) -> Sweep:
        """The same study, with the failures that its folder records now."""
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
            for name, value in _measure(self[k], measures, k):
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
    """The values of each name, where the cases are all their combinations in order."""
    names = list(cases[0]) if cases else []
    values = {name: tuple(dict.fromkeys(c.get(name, np.nan) for c in cases)) for name in names}
    every = [dict(zip(names, x, strict=True)) for x in itertools.product(*values.values())]
    return values if names and every == list(cases) else None


_START = {".q": "q0", ".v": "v0", ".tau": "tau"}
_OPTIONS = {
    function.__name__: [n for n in inspect.signature(function).parameters if n != "quiet"][1:]
    for function in (run, fmu)
}


@dataclass(frozen=True, slots=True)
class Answer:
    """What a case comes to; it can be sent between processes.

    Attributes:
        result: of the simulation, up to where it stopped; None where nothing was reached.
        complaint: what went wrong; empty where nothing did.
    """

    result: Result | None
    complaint: str = ""


def sweep(
    model: System | str | os.PathLike[str],
    grid: Grid,
    duration: float | None = None,
    *,
    folder: str | os.PathLike[str] | None = None,
    executor: Executor | None = None,
    quiet: bool = False,
    **options: Any,
) -> Sweep:
    """Simulate a mechanism or an FMU for every case of a grid.

    Each result is written as soon as it is there. A study that was interrupted goes on where it
    stopped when it is started again with the same folder; cases that failed are tried again. It is
    the same study when the cases, the options and the content of the model are the same; functions
    among the options are distinguished by their names alone.

    Args:
        model: a system, simulated by `run`; or the path of an FMU, simulated by `fmu`.
        grid: name to its values, for every combination, the last name fastest; or a sequence with
            one dict of names to values for each case. Names of a system are parameters, positions
            and velocities at the start such as `j1.q` and `j1.v`, constant efforts such as
            `j1.tau`, and of components states at the start such as `motor.i` and constant inputs
            such as `motor.voltage`; those of an FMU are parameters, inputs and start values.
        duration: [s]; needed for a system.
        folder: where results are kept; one that lasts as long as the answer when left out.
        executor: any executor of `concurrent.futures`, also that of a cluster; this process when
            left out. Executors of processes take a system, which is prepared once in each, or the
            path of an FMU that all of them can read; options are sent as pickles. Results are sent
            back and written here.
        quiet: no progress bar.
        **options: further arguments of `run` or `fmu`, the same for all cases.

    Returns:
        the cases and their results. A case that fails, for whatever reason, does not end the study;
        what it had reached is kept too, as `Sweep.reached` gives it.

    Raises:
        ModelError: the grid is empty, a name in it is unknown to the model, there is no such
            option, the folder holds another study, there is no such FMU, a system has no duration,
            or the model or an option cannot be sent to other processes.
        ExportError: the folder cannot be written.
        SolverError: a process of the executor ended; `result` is the `Sweep` of what was done.
        Interrupted: control-C was pressed; a KeyboardInterrupt whose `result` is the `Sweep` of
            what was done, the case under way as far as it had come.
    """
    cases = cases_of(grid)
    if duration is not None:
        options["duration"] = duration
    _check_options(model, options)
    simulate = _simulation(model, cases)
    if executor is not None:
        _check_executor(model, executor, options)
    # a law that is called may change the working directory
    kept = tempfile.mkdtemp(prefix="mbs-sweep-") if folder is None else path_of(folder).absolute()
    study = study_of(model, cases, options)
    place = Folder.opened(kept, study)
    if folder is None:
        weakref.finalize(place, shutil.rmtree, kept, ignore_errors=True)
    tasks = {k: _Task(simulate, cases[k], options) for k in place.missing(len(cases))}
    label = f"{len(tasks)} simulations of {study['model']}"
    whole = Sweep(str(study["model"]), cases, place, {}, tuple(range(len(cases))))
    try:
        with progress(label, 0.0, len(tasks), quiet=quiet) as reached:
            answers = _in_turn(tasks) if executor is None else _spread(tasks, executor)
            for done, (number, answer) in enumerate(answers, start=1):
                place.keep(number, answer.result, answer.complaint)
                reached(float(done))
    except SolverError as error:
        error.result = whole.as_found()
        raise
    except KeyboardInterrupt as error:
        stop = Interrupted(f"sweep of {study['model']} was interrupted")
        stop.result = whole.as_found()
        raise stop from error
    return whole.as_found()


@dataclass(frozen=True, slots=True)
class _Task:
    """One simulation."""

    simulate: Callable[[Case, Mapping[str, Any]], Result]
    case: Case
    options: Mapping[str, Any]

    def __call__(self) -> Answer:
        """Simulate; what went wrong is an answer too, so that the other cases go on."""
        try:
            return Answer(self.simulate(self.case, self.options))
        except SolverError as error:
            return Answer(error.result, str(error))
        except MbsError as error:
            return Answer(None, str(error))
        except Exception as error:
            return Answer(None, error_text(error))


@dataclass(frozen=True, slots=True)
class _Run:
    """Simulation of a system."""

    system: System

    def __reduce__(self) -> tuple[Any, ...]:
        """A process that has simulated a case has what the next one needs."""
        return _run_of, self.system.cached("packed", lambda: packed(self.system))

    def __call__(self, case: Case, options: Mapping[str, Any]) -> Result:
        given = _arguments(self.system, case)
        inputs = {f"{name}.tau": x for name, x in given.pop("tau", {}).items()}
        inputs |= given.pop("u", {})
        merged = _merge(options, given)
        laws = {name: merged.pop(name) for name in _LAWS if name in merged}
        simulator = simulator_of(self.system, list(inputs), **laws)
        return simulator(quiet=True, inputs=inputs, **merged)


@functools.lru_cache(maxsize=4)  # the studies that a cluster works on in turn
def _run_of(data: bytes, names: tuple[str, ...], graphs: str) -> _Run:
    """What was sent to this process, with what earlier cases prepared."""
    return _Run(unpacked(data, names, graphs))


@dataclass(frozen=True, slots=True)
class _Fmu:
    """Simulation of an FMU."""

    path: Path
    parameters: frozenset[str]

    def __call__(self, case: Case, options: Mapping[str, Any]) -> Result:
        given: dict[str, dict[str, float]] = {}
        for name, value in case.items():
            kind = "parameters" if name in self.parameters else "start"
            given.setdefault(kind, {})[name] = value
        return fmu(self.path, quiet=True, **_merge(options, given))


def _simulation(model: object, cases: Sequence[Case]) -> _Run | _Fmu:
    """What simulates a case.

    Raises:
        ModelError: there is no such model, or it does not have a name of the grid.
    """
    if isinstance(model, System):
        _require_names(model.name, cases, _system_names(model))
        return _Run(model)
    if not isinstance(model, (str, os.PathLike)):
        raise ModelError(f"sweep: {quoted(model)} is no model; give a System or the path of an FMU")
    path = Path(os.fspath(model)).resolve()
    if not path.is_file():
        raise ModelError(f"sweep: {path} cannot be read (no such file); give the path of an FMU")
    import fmpy

    try:
        check_archive(path)
        description = fmpy.read_model_description(str(path), validate=False)
    except Exception as error:
        raise ModelError(f"sweep: {path} is not an FMU: {' '.join(str(error).split())}") from error
    known = {name: v.causality for name, v in numbers_of(description).items()}
    _require_names(str(description.modelName), cases, set(known))
    return _Fmu(path, frozenset(name for name, kind in known.items() if kind == "parameter"))


def _system_names(system: System) -> set[str]:
    positions, speeds = (c.name for c in system.coordinates), [s.name for s in system.speeds]
    known = {*system.symbol_table, *(f"{name}.q" for name in positions)}
    known = known.union(*_signals(system).values())
    return known | {f"{name}{ending}" for name in speeds for ending in (".v", ".tau")}


def _require_names(model: str, cases: Sequence[Case], known: set[str]) -> None:
    """Refuse a name that the model does not have, before anything is simulated."""
    for name in dict.fromkeys(name for case in cases for name in case):
        if name not in known:
            raise ModelError(
                f"sweep: {model} has no {name!r} to vary; {did_you_mean(name, sorted(known))}"
            )


def _check_options(model: object, options: Mapping[str, Any]) -> None:
    """Refuse options that the simulation does not have."""
    if isinstance(model, System) and "duration" not in options:
        raise ModelError(
            f"sweep: {model.name} is a system and has no duration; give one in seconds"
        )
    simulation = "run" if isinstance(model, System) else "fmu"
    known = _OPTIONS[simulation]
    for name in options:
        if name not in known:
            raise ModelError(
                f"sweep: {simulation} has no argument {name!r}; {did_you_mean(name, known)}"
            )


def _check_executor(model: object, executor: object, options: Mapping[str, Any]) -> None:
    """Refuse what is no executor, and what it cannot send to other processes."""
    from concurrent.futures import ProcessPoolExecutor  # which loads multiprocessing

    if not isinstance(executor, Executor):
        raise ModelError(
            f"sweep: executor is {quoted(executor)}; give one of concurrent.futures, such as"
            " ThreadPoolExecutor(2)"
        )
    travels = isinstance(model, System) and not isinstance(executor, ThreadPoolExecutor)
    if travels or isinstance(executor, ProcessPoolExecutor):
        try:
            pickle.dumps(dict(options))
        except Exception as error:
            raise ModelError(
                f"sweep: the options cannot be sent to other processes ({error}); give numbers,"
                " arrays and functions that a module defines"
            ) from error
    if travels and isinstance(model, System):
        try:
            packed(model)
        except Exception as error:
            raise ModelError(
                f"sweep: {model.name} cannot be sent to other processes ({error}); define the"
                " classes and functions of its components in a module"
            ) from error


def _arguments(system: System, case: Case) -> dict[str, dict[str, float]]:
    """The arguments of `run` that the names of a case belong to."""
    given: dict[str, dict[str, float]] = {}
    signals = _signals(system)
    for name, value in case.items():
        signal = next((kind for kind, names in signals.items() if name in names), None)
        known = name in system.symbol_table or signal is not None
        ending = "" if known else next((e for e in _START if name.endswith(e)), "")
        kind = signal or _START.get(ending, "parameters")
        given.setdefault(kind, {})[name.removesuffix(ending)] = value
    return given


def _signals(system: System) -> dict[str, list[str]]:
    """States and inputs of components, by the argument of `run` that takes them."""
    return {
        "z0": [name for name, _ in system.states],
        "u": [name for name, _ in system.inputs],
    }


def _merge(options: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of all cases, with the values of one."""
    merged = dict(options)
    state = state_of(merged.get("q0"))
    if isinstance(state, State) and "q0" in given:
        raise ModelError(
            f"sweep: q0 is a state and the grid has {', '.join(given['q0'])}; give q0 as a dict of"
            " independent joints"
        )
    if isinstance(state, State):  # else values of the grid would be the only ones
        merged["v0"] = dict(state.v) if merged.get("v0") is None else merged["v0"]
        merged["z0"] = dict(state.z) if merged.get("z0") is None else merged["z0"]
    for argument, values in given.items():
        common = {} if merged.get(argument) is None else merged[argument]
        if not isinstance(common, Mapping):
            raise ModelError(
                f"sweep: {argument} is {quoted(common)} and the grid has"
                f" {', '.join(values)}; give {argument} as a dict"
            )
        merged[argument] = {**common, **values}
    return merged


def _in_turn(tasks: Mapping[int, _Task]) -> Iterator[tuple[int, Answer]]:
    for number, task in tasks.items():
        try:
            answer = task()
        except Interrupted as stop:
            yield number, Answer(stop.result, str(stop))
            raise
        yield number, answer


def _spread(tasks: Mapping[int, _Task], executor: Executor) -> Iterator[tuple[int, Answer]]:
    futures: dict[Future[Answer], int] = {}
    try:
        for number, task in tasks.items():
            futures[executor.submit(task)] = number
        for future in as_completed(futures):
            yield futures[future], _answer(future)
    except BrokenExecutor as error:
        raise SolverError(
            f"sweep: a process of the executor ended ({error}); start the study again with the same"
            " folder, and what was written is kept"
        ) from error
    finally:  # those that have not begun when one breaks the study off
        for future in futures:
            future.cancel()


def _answer(future: Future[Answer]) -> Answer:
    try:
        return future.result()
    except BrokenExecutor:
        raise
    except Exception as error:  # lost in transit, such as a worker of a cluster
        return Answer(None, error_text(error))
