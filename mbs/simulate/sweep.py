"""Parameter studies: one simulation for each case, over any executor."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mbs.assembly import System
from mbs.errors import MbsError, ModelError
from mbs.messages import did_you_mean, quoted
from mbs.result import Result
from mbs.simulate.cases import Case, Folder, Grid, cases_of
from mbs.simulate.fmu import fmu
from mbs.simulate.progress import progress
from mbs.simulate.run import run
from mbs.simulate.study import study_of

_START = {".q": "q0", ".v": "v0", ".tau": "tau"}


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """The results of a parameter study; they are read from disk one by one.

    Attributes:
        cases: name to value, of each simulation.
        folder: where the results are.
        failures: number of a case that failed, and what it said.
    """

    cases: tuple[Case, ...]
    folder: Folder
    failures: Mapping[int, str]

    def __repr__(self) -> str:
        return f"<Sweep: {len(self.cases)} cases, {len(self.failures)} failed, {self.folder.path}>"

    def __len__(self) -> int:
        return len(self.cases)

    def __iter__(self) -> Iterator[tuple[Case, Result]]:
        """Each case that succeeded, with its result."""
        return ((case, self[k]) for k, case in enumerate(self.cases) if k not in self.failures)

    def __getitem__(self, number: int) -> Result:
        """The result of a case.

        Raises:
            ModelError: it failed, or there is no such case.
        """
        if not isinstance(number, int) or not 0 <= number < len(self.cases):
            raise ModelError(f"sweep: there is no case {number!r}; they are 0 to {len(self) - 1}")
        if number in self.failures:
            raise ModelError(f"sweep: case {number} failed: {self.failures[number]}")
        return Result.load(self.folder.file(number))


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
            left out. Executors of processes need the path of an FMU that all of them can read.
        quiet: no progress bar.
        **options: further arguments of `run` or `fmu`, the same for all cases.

    Returns:
        the cases and their results.

    Raises:
        ModelError: the grid is empty, a name in it is unknown to the system, the folder holds
            another study, there is no such FMU, a system has no duration, or the model cannot be
            sent to other processes.
        ExportError: the folder cannot be written.
    """
    cases = cases_of(grid)
    if duration is not None:
        options["duration"] = duration
    elif isinstance(model, System):
        raise ModelError(
            f"sweep: {model.name} is a system and has no duration; give one in seconds"
        )
    if not isinstance(executor, Executor | None):
        raise ModelError(
            f"sweep: executor is {quoted(executor)}; give one of concurrent.futures, such as"
            " ThreadPoolExecutor(2)"
        )
    if isinstance(model, System):
        _require_names(model, cases)
        if executor is not None:
            _require_threads(executor)
    study = study_of(model, cases, options)
    kept = tempfile.mkdtemp(prefix="mbs-sweep-") if folder is None else folder
    place = Folder.opened(kept, study)
    if folder is None:
        weakref.finalize(place, shutil.rmtree, kept, ignore_errors=True)
    tasks = {k: _Task(model, cases[k], options, place.file(k)) for k in place.missing(len(cases))}
    label = f"{len(tasks)} simulations of {study['model']}"
    with progress(label, 0.0, len(tasks), quiet=quiet) as reached:
        answers = _in_turn(tasks) if executor is None else _spread(tasks, executor)
        failures: dict[int, str] = {}
        for done, (number, complaint) in enumerate(answers, start=1):
            reached(float(done))
            if complaint:
                failures[number] = complaint
    return Sweep(cases, place, dict(sorted(failures.items())))


@dataclass(frozen=True, slots=True)
class _Task:
    """One simulation, and the file of its result."""

    model: System | str | os.PathLike[str]
    case: Case
    options: Mapping[str, Any]
    file: Path

    def __call__(self) -> str:
        """Simulate and write the result; what went wrong, or nothing."""
        try:
            answer = _run(self) if isinstance(self.model, System) else _fmu(self)
        except MbsError as error:
            return str(error)
        answer.save(self.file)
        return ""


def _run(task: _Task) -> Result:
    assert isinstance(task.model, System)
    given = _arguments(task.model, task.case)
    return run(task.model, quiet=True, **_merged(task.options, given))


def _arguments(system: System, case: Case) -> dict[str, dict[str, float]]:
    """The arguments of `run` that the names of a case belong to."""
    given: dict[str, dict[str, float]] = {}
    for name, value in case.items():
        known = name in system.symbol_table
        ending = "" if known else next((e for e in _START if name.endswith(e)), "")
        given.setdefault(_START.get(ending, "parameters"), {})[name.removesuffix(ending)] = value
    return given


def _require_names(system: System, cases: Sequence[Case]) -> None:
    """Refuse a name that the system does not have, before anything is simulated.

    Raises:
        ModelError: says which one, and what there is.
    """
    coordinates = [c.name for c in system.coordinates], [s.name for s in system.speeds]
    known = {*system.symbol_table, *(f"{name}.q" for name in coordinates[0])}
    known |= {f"{name}{ending}" for name in coordinates[1] for ending in (".v", ".tau")}
    for name in dict.fromkeys(name for case in cases for name in case):
        if name not in known:
            raise ModelError(
                f"sweep: {system.name} has no {name!r} to vary; {did_you_mean(name, sorted(known))}"
            )


def _fmu(task: _Task) -> Result:
    import fmpy

    assert not isinstance(task.model, System)
    description = fmpy.read_model_description(os.fspath(task.model), validate=False)
    parameters = {v.name for v in description.modelVariables if v.causality == "parameter"}
    given: dict[str, Any] = {}
    for name, value in task.case.items():
        given.setdefault("parameters" if name in parameters else "start", {})[name] = value
    return fmu(task.model, quiet=True, **_merged(task.options, given))


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


def _in_turn(tasks: Mapping[int, Callable[[], str]]) -> Iterator[tuple[int, str]]:
    return ((number, task()) for number, task in tasks.items())


def _spread(tasks: Mapping[int, _Task], executor: Executor) -> Iterator[tuple[int, str]]:
    futures = {executor.submit(task): number for number, task in tasks.items()}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:  # those that have not begun when one breaks the study off
        for future in futures:
            future.cancel()


def _require_threads(executor: Executor) -> None:
    """Refuse a System where it would have to be sent to another process.

    Raises:
        ModelError: says what to give.
    """
    if not isinstance(executor, ThreadPoolExecutor):
        raise ModelError(
            "sweep: a System stays in its process; write it by mbs.export.fmu and give the path of"
            " the FMU, or use a ThreadPoolExecutor"
        )
