"""The tree core beside straight lines and pinocchio's C++ library, in one process and in turns.

    python benchmarks/tree_core.py [--robots chain6,chain30] [--quick] [--output table.md]
    python benchmarks/tree_core.py --compile [--robots chain30]

Every model is a loop of C++ over 64 random states, as in benchmarks/dynamics.py; a time is the best
of many blocks of 0.15 ms. "core" is `mbs.models.tree_core`, "lines" are the straight lines of
`mbs.native.compiled(f, fast=True)`, where there are up to 60,000 operations. Values are compared
with pinocchio's before anything is timed. Seconds of the processor and the largest memory are those
of the compiler, from an empty cache.

`--compile`: what `compiled(ddm, fast=True)` and its Jacobian take, by loops and by straight lines,
each in a process of its own with an empty cache: seconds of the processor and the largest memory.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi
from dynamics import BUILDERS, INPUTS, difference_of, random_states
from pinocchio_twin import to_twin, twin
from robots import frictionless
from timing import ALGORITHMS, Array, Contender, InLibrary, Peer, best_times, harness

from mbs.assembly import System
from mbs.models import direct_dynamics
from mbs.models._tree_core import core_library
from mbs.native import compiled
from mbs.native.kernel import kernel_library

ROBOTS = ("chain6", "chain12", "chain30", "chain60", "chain100", "chain300", "humanoid")
NAMES = ("idm", "inertia", "ddm", "idm_derivatives", "ddm_derivatives")
MANY = 60_000
"""Operations beyond which straight lines are left out: compiling them takes a minute and more."""
LARGEST = {"A": 100, "DDM": 100, "dIDM": 40, "dDDM": 40}
"""Velocities beyond which the straight lines of a model are not even derived."""


@dataclass
class Row:
    """One model of one robot."""

    robot: str
    model: str
    times: dict[str, float] = field(default_factory=dict)
    error: float = float("nan")
    lines: str = ""


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--models", default=",".join(ALGORITHMS))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--core-alone", action="store_true", help="no straight lines")
    parser.add_argument("--output")
    parser.add_argument("--compile", action="store_true", help="what compiled takes")
    arguments = parser.parse_args()
    if arguments.compile:
        for name in arguments.robots.split(","):
            compiling(name)
        return
    loops = harness()
    text = ""
    for name in arguments.robots.split(","):
        with tempfile.TemporaryDirectory() as folder:
            os.environ["MBS_CACHE_DIR"] = folder  # so that compiling is measured
            text += report(*measure(name, loops, Path(folder), arguments))
        if arguments.output:
            Path(arguments.output).write_text(text, encoding="utf-8")
    print(text)


def measure(
    name: str, loops: Any, folder: Path, arguments: argparse.Namespace
) -> tuple[list[Row], str]:
    """The rows of a robot, and what compiling the core took."""
    system = frictionless(name, folder)
    library, first = _compiled(lambda: core_library(system).path)
    library.unlink()
    library, again = _compiled(lambda: core_library(system).path)
    note = f"{first}, and where it is in the cache {again}"
    model, file = twin(system), folder / f"{name}.txt"
    model.saveToText(str(file))
    states = random_states(system)
    rows, contenders = [], dict[Any, Contender]()
    for algorithm in arguments.models.split(","):
        row = Row(name, algorithm)
        rows.append(row)
        inputs = [states[x] for x in INPUTS[algorithm]]
        shape = core_library(system).shapes[NAMES[ALGORITHMS.index(algorithm)]]
        core = InLibrary(loops, library, shape, inputs)
        there = [to_twin(system, states["q"]), *inputs[1:]]
        peer = Peer(loops, file, algorithm, there, core.value(0).size)
        row.error = difference_of(core, peer)
        contenders[algorithm, "core"], contenders[algorithm, "pinocchio"] = core, peer
        if not arguments.core_alone:
            lines = _lines(row, system, loops, inputs)
            if lines is not None:
                contenders[algorithm, "lines"] = lines
        print(name, algorithm, f"differs by {row.error:.0e}", row.lines, file=sys.stderr)
    for (algorithm, who), best in best_times(contenders, 40 if arguments.quick else 200).items():
        next(row for row in rows if row.model == algorithm).times[who] = best
    return rows, f"{name}: compiling the core takes {note}\n"


def _lines(row: Row, system: System, loops: Any, inputs: list[Array]) -> Contender | None:
    """Straight lines, compiled; None when they are too many."""
    if system.nv > LARGEST.get(row.model, system.nv):
        return None
    function = BUILDERS[row.model](system)
    size = function.n_instructions() if function.is_a("SXFunction") else 0
    if size > MANY:
        row.lines = f"{size} operations"
        return None
    library, note = _compiled(lambda: _required(function))
    row.lines = note
    return InLibrary(loops, library, function, inputs)


def _required(function: casadi.Function) -> Path:
    library = kernel_library([function])
    assert library is not None
    return library


def _compiled(build: Callable[[], Path]) -> tuple[Path, str]:
    """What a process of its own builds, and what its compiler took."""
    fork = multiprocessing.get_context("fork")
    ours, theirs = fork.Pipe()

    def work() -> None:
        path = build()
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        theirs.send((path, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024))

    process = fork.Process(target=work)
    process.start()
    path, seconds, memory = ours.recv()
    process.join()
    return path, f"{seconds:.1f} s, {memory:.0f} MB"


LARGEST_COMPILED = {"value": 300, "jacobian": 30}
"""Velocities beyond which straight lines are not compiled: they would take many minutes."""


def compiling(name: str) -> None:
    """Print what `compiled` takes for the direct model of a robot."""
    with tempfile.TemporaryDirectory() as folder:
        system = frictionless(name, Path(folder))
    model = direct_dynamics(system)
    for what, largest in LARGEST_COMPILED.items():
        for loops in (True, False) if system.nv <= largest else (True,):
            with tempfile.TemporaryDirectory() as folder:
                os.environ["MBS_CACHE_DIR"] = folder
                note = _used(model, what, loops)
            print(name, what, "with loops" if loops else "straight lines", note, flush=True)


def _used(model: casadi.Function, what: str, loops: bool) -> str:
    """Seconds and memory of a process that compiles a model, and of its compilers."""
    fork = multiprocessing.get_context("fork")
    ours, theirs = fork.Pipe()

    def work() -> None:
        before = time.process_time()
        f = compiled(model, fast=True, loops=loops)
        if what == "jacobian":
            f.jacobian()
        own, cc = (resource.getrusage(k) for k in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        seconds = time.process_time() - before + cc.ru_utime + cc.ru_stime
        theirs.send(f"{seconds:.1f} s, {max(own.ru_maxrss, cc.ru_maxrss) / 1024:.0f} MB")

    process = fork.Process(target=work)
    process.start()
    note: str = ours.recv()
    process.join()
    return note


def report(rows: list[Row], note: str) -> str:
    """The rows as Markdown."""
    lines = ["| robot | model | core ns | pinocchio | lines | differs by | compiling lines |"]
    lines.append("|---|---|---|---|---|---|---|")
    for row in rows:
        core = row.times["core"]
        other = (
            f"{row.times[who] / core:.2f}" if who in row.times else "-"
            for who in ("pinocchio", "lines")
        )
        cells = [row.robot, row.model, f"{core:.0f}", *other, f"{row.error:.0e}", row.lines]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", note, ""])


if __name__ == "__main__":
    main()
