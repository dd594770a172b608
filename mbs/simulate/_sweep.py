"""Parameter sweeps: simulation of many cases, by any executor of `concurrent.futures`."""

from __future__ import annotations

import functools
import inspect
import os
import pickle
import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mbs.assembly import System
from mbs.assembly.pickling import packed, unpacked
from mbs.errors import Interrupted, MbsError, ModelError, SolverError
from mbs.files import check_archive, path_of
from mbs.progress import progress
from mbs.result import Result, State, state_of
from mbs.simulate._fmu import fmu
from mbs.simulate.fmu_variables import numbers_of
from mbs.simulate.simulator import run, simulator_of
from mbs.simulate.sweep_cases import Case, Grid, cases_of
from mbs.simulate.sweep_identity import LAWS, study_of
from mbs.simulate.sweep_results import Sweep
from mbs.simulate.sweep_store import ResultStore
from mbs.text import did_you_mean, error_text, quoted

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
        laws = {name: merged.pop(name) for name in LAWS if name in merged}
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
    positions, speeds = (
        (c.name for c in system.coordinates),
        [s.name for s in system.velocity_coordinates],
    )
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
