"""Parameter studies: one simulation for each case, over any executor."""

from __future__ import annotations

import inspect
import os
import pickle
import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ThreadPoolExecutor,
    as_completed,
)
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mbs.archives import check_archive
from mbs.assembly import System
from mbs.errors import Interrupted, MbsError, ModelError, SolverError
from mbs.messages import did_you_mean, quoted
from mbs.progress import progress
from mbs.result import Result
from mbs.simulate.cases import Case, Folder, Grid, cases_of
from mbs.simulate.fmu import fmu
from mbs.simulate.fmu_variables import numbers_of
from mbs.simulate.run import run
from mbs.simulate.study import study_of
from mbs.simulate.swept import Sweep

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
    among the options are told apart by their names alone.

    Args:
        model: a system, simulated by `run`; or the path of an FMU, simulated by `fmu`.
        grid: name to its values, for every combination, the last name fastest; or a sequence with
            one dict of names to values for each case. Names of a system are parameters, positions
            and velocities at the start such as `j1.q` and `j1.v`, and constant efforts such as
            `j1.tau`; those of an FMU are parameters, inputs and start values.
        duration: [s]; needed for a system.
        folder: where results are kept; one that lasts as long as the answer when left out.
        executor: any executor of `concurrent.futures`, also that of a cluster; this process when
            left out. Executors of processes need the path of an FMU that all of them can read; the
            results are sent back and written here.
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
    study = study_of(model, cases, options)
    kept = tempfile.mkdtemp(prefix="mbs-sweep-") if folder is None else folder
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
            return Answer(None, _said(error))


def _said(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"


@dataclass(frozen=True, slots=True)
class _Run:
    """Simulation of a system."""

    system: System

    def __call__(self, case: Case, options: Mapping[str, Any]) -> Result:
        given = _arguments(self.system, case)
        return run(self.system, quiet=True, **_merged(options, given))


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
        return fmu(self.path, quiet=True, **_merged(options, given))


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
    if isinstance(model, System) and not isinstance(executor, ThreadPoolExecutor):
        raise ModelError(
            "sweep: a System stays in its process; write it by mbs.export.fmu and give the path of"
            " the FMU, or use a ThreadPoolExecutor"
        )
    if isinstance(executor, ProcessPoolExecutor):
        try:
            pickle.dumps(dict(options))
        except Exception as error:
            raise ModelError(
                f"sweep: the options cannot be sent to other processes ({error}); give numbers,"
                " arrays and functions that a module defines"
            ) from error


def _arguments(system: System, case: Case) -> dict[str, dict[str, float]]:
    """The arguments of `run` that the names of a case belong to."""
    given: dict[str, dict[str, float]] = {}
    for name, value in case.items():
        known = name in system.symbol_table
        ending = "" if known else next((e for e in _START if name.endswith(e)), "")
        given.setdefault(_START.get(ending, "parameters"), {})[name.removesuffix(ending)] = value
    return given


def _merged(options: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of all cases, with the values of one."""
    merged = dict(options)
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
            yield futures[future], _answered(future)
    except BrokenExecutor as error:
        raise SolverError(
            f"sweep: a process of the executor ended ({error}); start the study again with the same"
            " folder, and what was written is kept"
        ) from error
    finally:  # those that have not begun when one breaks the study off
        for future in futures:
            future.cancel()


def _answered(future: Future[Answer]) -> Answer:
    try:
        return future.result()
    except BrokenExecutor:
        raise
    except Exception as error:  # lost on the way, such as a worker of a cluster
        return Answer(None, _said(error))
