"""Parameter sweeps: simulation of many cases, by any executor of `concurrent.futures`."""

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
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.pickling import packed, unpacked
from mbs.errors import ExportError, Interrupted, MbsError, ModelError, SolverError
from mbs.files import check_archive, path_of, write_text
from mbs.numbers import numbers_given
from mbs.progress import progress
from mbs.result import Result, State, optional_module, state_of
from mbs.simulate._fmu import fmu
from mbs.simulate.fmu_variables import numbers_of
from mbs.simulate.options import SimulatorArguments
from mbs.simulate.simulator import run, simulator_of
from mbs.text import did_you_mean, error_text, quoted

# Cases of a parameter sweep, and the folder of their results.


_INDEX = "study.json"

Case = dict[str, float]
Grid = Mapping[str, Iterable[float]] | Sequence[Mapping[str, float]]


def cases_of(grid: Grid) -> tuple[Case, ...]:
    """Return the cases of a grid.

    Args:
        grid: dict from name to values, for all combinations (the last name varies fastest), or
            sequence of cases, each a dict from name to value.

    Raises:
        ModelError: the grid has no case, or a value is not a number.
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
class ResultStore:
    """Folder of the results of a sweep, with one file per case.

    Attributes:
        path: absolute path, because threads that load FMUs change the working directory.
    """

    path: Path

    @staticmethod
    def opened(path: object, study: Mapping[str, object]) -> ResultStore:
        """Make the folder of a sweep, or open it if it contains the same sweep.

        Args:
            path: path of the folder.
            study: JSON description of the sweep, as returned by `study_of`.

        Raises:
            ModelError: the folder contains another sweep, or results without description.
            ExportError: the folder cannot be written.
        """
        folder = ResultStore(_make_folder(path_of(path).absolute()))
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
        """Return the path of the result of a case."""
        return self.path / f"case_{number:06d}.npz"

    def partial_file(self, number: int) -> Path:
        """Return the path of the partial result of a case that failed."""
        return self.path / f"part_{number:06d}.npz"

    def write(self, number: int, result: Result | None, error: str = "") -> None:
        """Write the result of a case, or its error message and partial result.

        Args:
            number: index of the case.
            result: complete result, or the rows before the stop; None if there are no rows.
            error: error message; empty if the case succeeded.

        Raises:
            ExportError: the folder cannot be written.
        """
        file, part = self._error_file(number), self.partial_file(number)
        part.unlink(missing_ok=True)
        if error:
            write_text(error, file)
        else:
            file.unlink(missing_ok=True)
        if result is not None:
            result.save(part if error else self.file(number))

    def error_of(self, number: int) -> str:
        """Return the error message of a case without complete result."""
        file = self._error_file(number)
        return file.read_text(encoding="utf-8") if file.is_file() else "not simulated yet"

    def model_and_cases(self) -> tuple[str, tuple[Case, ...]]:
        """Return the name of the model and the cases of the sweep in this folder.

        Raises:
            ModelError: the folder contains no sweep.
        """
        try:
            study = json.loads((self.path / _INDEX).read_text(encoding="utf-8"))
            return str(study["model"]), tuple(dict(case) for case in study["cases"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ModelError(
                f"sweep: {self.path} holds no study; give the folder that a sweep was given"
            ) from error

    def _error_file(self, number: int) -> Path:
        return self.path / f"case_{number:06d}.txt"

    def missing(self, count: int) -> list[int]:
        """Return the indices, below `count`, of the cases without complete result."""
        return [number for number in range(count) if not zipfile.is_zipfile(self.file(number))]


def _make_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(
            f"folder {folder} cannot be made ({error.strerror}); choose another one"
        ) from error
    return folder


# Identity of a parameter sweep: model content, cases and options.


_ADDRESS = re.compile(r" at 0x[0-9A-Fa-f]+")  # address of an object in the memory of one process


def study_of(
    model: System | str | os.PathLike[str], cases: Sequence[Case], options: Mapping[str, Any]
) -> dict[str, object]:
    """Return the JSON description of a sweep, which identifies it.

    Args:
        model: system, or path of an FMU.
        cases: dict from name to value of each simulation.
        options: further arguments of all simulations.

    Raises:
        ModelError: the FMU cannot be read, or `model` is neither a System nor a path.
    """
    identity = (
        _system_identity(model, options) if isinstance(model, System) else _fmu_identity(model)
    )
    name, content = identity
    described = {option: _describe(value) for option, value in sorted(options.items())}
    digest = hashlib.sha256(content).hexdigest()
    return {"model": name, "content": digest, "cases": list(cases), "options": described}


_LAWS = tuple(field.name for field in fields(SimulatorArguments) if field.kw_only)
"""Options common to all cases. Efforts and inputs of a case are numeric inputs of the simulator, so
that all cases have the same equations."""


def _system_identity(system: System, options: Mapping[str, Any]) -> tuple[str, bytes]:
    """Return the name of the system, and the cache key of system and laws."""
    laws = {name: options[name] for name in _LAWS if name in options}
    return system.name, simulator_of(system, **laws).content()


def _fmu_identity(path: object) -> tuple[str, bytes]:
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
    """Return a text of an option that is the same in every process."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {_describe(value[key])}" for key in value) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_describe(part) for part in value) + "]"
    if isinstance(value, np.ndarray):
        return f"array {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    return getattr(value, "__qualname__", None) or _ADDRESS.sub("", repr(value))


# Results of a parameter sweep, read from disk on access.


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


_START = {".q": "q0", ".v": "v0", ".tau": "tau"}
_OPTIONS = {
    function.__name__: [n for n in inspect.signature(function).parameters if n != "quiet"][1:]
    for function in (run, fmu)
}


@dataclass(frozen=True, slots=True)
class CaseResult:
    """Result of a case, which can be pickled.

    Attributes:
        result: result of the simulation, or its rows before the stop; None if there are no rows.
        error: error message; empty if the case succeeded.
    """

    result: Result | None
    error: str = ""


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

    Each result is written when its simulation ends. An interrupted sweep resumes if it is started
    again with the same folder; failed cases are simulated again. A sweep is the same if its cases,
    options and model content are equal. Functions in the options are compared by name only.

    Args:
        model: system, simulated by `run`, or path of an FMU, simulated by `fmu`.
        grid: dict from name to values, for all combinations (the last name varies fastest), or
            sequence of cases, each a dict from name to value. Names of a system: parameters,
            initial positions and velocities such as `j1.q` and `j1.v`, constant efforts such as
            `j1.tau`, initial states of components such as `motor.i`, and constant inputs such as
            `motor.voltage`. Names of an FMU: parameters, inputs and start values.
        duration: duration of each simulation [s]; required for a system.
        folder: folder of the results. The default is a temporary folder, which is deleted with the
            returned Sweep.
        executor: executor of `concurrent.futures` or of a cluster. By default the cases run one
            after another in this process. A process of an executor prepares a system once, and
            must be able to read the path of an FMU. Options are pickled. Results are sent back and
            written by this process.
        quiet: Whether to hide the progress bar.
        **options: further arguments of `run` or `fmu`, the same for all cases.

    Returns:
        Sweep with the cases and their results. A case that fails does not end the sweep;
        `Sweep.reached` returns its partial result.

    Raises:
        ModelError: the grid is empty, a name of the grid or an option is unknown, the folder
            contains another sweep, the FMU cannot be read, a system has no duration, or the model
            or an option cannot be sent to other processes.
        ExportError: the folder cannot be written.
        SolverError: a process of the executor ended. `result` is the Sweep of the finished cases.
        Interrupted: control-C was pressed. It is a KeyboardInterrupt; `result` is the Sweep of the
            finished cases, with the partial result of the interrupted case.
    """
    cases = cases_of(grid)
    if duration is not None:
        options["duration"] = duration
    _check_options(model, options)
    simulate = _simulation(model, cases)
    if executor is not None:
        _check_executor(model, executor, options)
    # absolute, because a law may change the working directory
    kept = tempfile.mkdtemp(prefix="mbs-sweep-") if folder is None else path_of(folder).absolute()
    study = study_of(model, cases, options)
    store = ResultStore.opened(kept, study)
    if folder is None:
        weakref.finalize(store, shutil.rmtree, kept, ignore_errors=True)
    tasks = {k: _Task(simulate, cases[k], options) for k in store.missing(len(cases))}
    label = f"{len(tasks)} simulations of {study['model']}"
    whole = Sweep(str(study["model"]), cases, store, {}, tuple(range(len(cases))))
    try:
        with progress(label, 0.0, len(tasks), quiet=quiet) as reached:
            if executor is None:
                finished = _run_serially(tasks)
            else:
                finished = _run_in_executor(tasks, executor)
            for done, (number, found) in enumerate(finished, start=1):
                store.write(number, found.result, found.error)
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
    """Simulation of one case."""

    simulate: Callable[[Case, Mapping[str, Any]], Result]
    case: Case
    options: Mapping[str, Any]

    def __call__(self) -> CaseResult:
        """Simulate the case. An error is returned as a CaseResult, so that other cases continue."""
        try:
            return CaseResult(self.simulate(self.case, self.options))
        except SolverError as error:
            return CaseResult(error.result, str(error))
        except MbsError as error:
            return CaseResult(None, str(error))
        except Exception as error:
            return CaseResult(None, error_text(error))


@dataclass(frozen=True, slots=True)
class _SystemSimulation:
    """Simulation of a system."""

    system: System

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by content, so that a process prepares the system for its first case only."""
        return _unpickled_simulation, self.system.cached("packed", lambda: packed(self.system))

    def __call__(self, case: Case, options: Mapping[str, Any]) -> Result:
        given = _arguments(self.system, case)
        inputs = {f"{name}.tau": x for name, x in given.pop("tau", {}).items()}
        inputs |= given.pop("u", {})
        merged = _merge(options, given)
        laws = {name: merged.pop(name) for name in _LAWS if name in merged}
        simulator = simulator_of(self.system, list(inputs), **laws)
        return simulator(quiet=True, inputs=inputs, **merged)


@functools.lru_cache(maxsize=4)  # simulations of up to 4 sweeps that share a cluster
def _unpickled_simulation(data: bytes, names: tuple[str, ...], graphs: str) -> _SystemSimulation:
    """Unpickle a simulation, or return it from the cache of this process."""
    return _SystemSimulation(unpacked(data, names, graphs))


@dataclass(frozen=True, slots=True)
class _FmuSimulation:
    """Simulation of an FMU."""

    path: Path
    parameters: frozenset[str]

    def __call__(self, case: Case, options: Mapping[str, Any]) -> Result:
        given: dict[str, dict[str, float]] = {}
        for name, value in case.items():
            kind = "parameters" if name in self.parameters else "start"
            given.setdefault(kind, {})[name] = value
        return fmu(self.path, quiet=True, **_merge(options, given))


def _simulation(model: object, cases: Sequence[Case]) -> _SystemSimulation | _FmuSimulation:
    """Return the callable that simulates a case of the model.

    Raises:
        ModelError: the model cannot be read, or a name of the grid is unknown.
    """
    if isinstance(model, System):
        _require_names(model.name, cases, _system_names(model))
        return _SystemSimulation(model)
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
    return _FmuSimulation(
        path, frozenset(name for name, kind in known.items() if kind == "parameter")
    )


def _system_names(system: System) -> set[str]:
    positions, speeds = (c.name for c in system.coordinates), [s.name for s in system.speeds]
    known = {*system.symbol_table, *(f"{name}.q" for name in positions)}
    known = known.union(*_signals(system).values())
    return known | {f"{name}{ending}" for name in speeds for ending in (".v", ".tau")}


def _require_names(model: str, cases: Sequence[Case], known: set[str]) -> None:
    """Raise if a name of a case is unknown to the model."""
    for name in dict.fromkeys(name for case in cases for name in case):
        if name not in known:
            raise ModelError(
                f"sweep: {model} has no {name!r} to vary; {did_you_mean(name, sorted(known))}"
            )


def _check_options(model: object, options: Mapping[str, Any]) -> None:
    """Raise if an option is not an argument of `run` or `fmu`, or the duration is missing."""
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
    """Raise if it is not an Executor, or the model or options cannot be pickled for it."""
    from concurrent.futures import ProcessPoolExecutor  # loads multiprocessing

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
    """Return the values of a case, grouped by argument of `run`."""
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
    """Return names of states and inputs of components, grouped by argument of `run`."""
    return {
        "z0": [name for name, _ in system.states],
        "u": [name for name, _ in system.inputs],
    }


def _merge(options: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of all cases, updated with the values of one case."""
    merged = dict(options)
    state = state_of(merged.get("q0"))
    if isinstance(state, State) and "q0" in given:
        raise ModelError(
            f"sweep: q0 is a state and the grid has {', '.join(given['q0'])}; give q0 as a dict of"
            " independent joints"
        )
    if isinstance(state, State):  # add the remaining values of the state
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


def _run_serially(tasks: Mapping[int, _Task]) -> Iterator[tuple[int, CaseResult]]:
    for number, task in tasks.items():
        try:
            found = task()
        except Interrupted as stop:
            yield number, CaseResult(stop.result, str(stop))
            raise
        yield number, found


def _run_in_executor(
    tasks: Mapping[int, _Task], executor: Executor
) -> Iterator[tuple[int, CaseResult]]:
    futures: dict[Future[CaseResult], int] = {}
    try:
        for number, task in tasks.items():
            futures[executor.submit(task)] = number
        for future in as_completed(futures):
            yield futures[future], _result_of(future)
    except BrokenExecutor as error:
        raise SolverError(
            f"sweep: a process of the executor ended ({error}); start the study again with the same"
            " folder, and what was written is kept"
        ) from error
    finally:  # cancel pending cases if an exception ends the sweep
        for future in futures:
            future.cancel()


def _result_of(future: Future[CaseResult]) -> CaseResult:
    try:
        return future.result()
    except BrokenExecutor:
        raise
    except Exception as error:  # the task was lost, such as with a worker of a cluster
        return CaseResult(None, error_text(error))
