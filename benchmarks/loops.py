"""Closed loops: mbs against exudyn and MuJoCo in one process and in turns, and its own limits.

    python benchmarks/loops.py [--cases n1,bricard] [--rounds 5] [--output table.md]
    python benchmarks/loops.py --build          # seconds to build N = 1, 10, 40 windows
    python benchmarks/loops.py --calls          # what a user's call costs beside the integration
    python benchmarks/loops.py --growth         # to the first step, N = 10 .. 160, nothing cached
    python benchmarks/loops.py --windows        # a run of 10 s, N = 10 .. 320
    python benchmarks/loops.py --long           # 1000 s of a four-bar

A time is the shortest of several runs of the integration alone, of models that are built already;
each round runs every contender. The error is the rms over outputs of (y - y_ref) / max(|y_ref|,
1e-3), the measure of the benchmark library. A ratio compares a peer with the loosest tolerance of
mbs whose error is not larger.
"""

from __future__ import annotations

import argparse
import itertools
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from exudyn_twins import ExudynTwin
from loops_cases import CASES, Case, Made, made, outputs, plain_of, run
from loops_references import rms_error
from mujoco_twins import MujocoTwin

import mbs
from mbs.loops.configuration import start
from mbs.models.state.signals import effort_function
from mbs.models.state.tree import full_state
from mbs.robots import n_four_bar
from mbs.simulate.segments import integrate_segments
from mbs.simulate.tolerances import step_tolerances

GROWTH = (10, 20, 40, 80, 160)
"""Windows of which `--growth` takes the time."""
STUDY = 10
"""Cases of a sweep, each with its own start and file."""
WINDOWS = (10, 20, 40, 80, 160, 320)
"""Windows of which `--windows` takes the time."""
WINDOWS_HEAD = ["mechanism", "run of 10 s, ms", "ms for a window"]
GROWTH_HEAD = ["mechanism", "assembly", "equations, C text", "compiler", "together", "s", "MB"]
Array = np.ndarray[Any, Any]
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
SHOWN = (1e-6, 1e-9)
"""Tolerances with columns of their own."""
TARGET = 20
PEERS = ("exudyn", "mujoco")
_SHARE = 0.1
"""Seconds that a contender may take in a round, when one run takes less."""


@dataclass
class Contender:
    """A way to compute a motion: `setting` is a tolerance or a step [s]."""

    who: str
    setting: float
    call: Callable[[], Array]
    error: float
    best: float

    def round(self) -> None:
        """Run it, more than once when it is quick."""
        for _ in range(max(1, min(50, round(_SHARE / self.best)))):
            self.best = min(self.best, _seconds(self.call)[0])


@dataclass
class Row:
    """What was measured of a case."""

    case: Case
    seconds: dict[str, float]
    contenders: list[Contender]

    def of(self, who: str) -> list[Contender]:
        """The contenders of mbs or of a peer."""
        return [c for c in self.contenders if c.who == who]

    def ratio(self, peer: Contender) -> tuple[float, float] | None:
        """How many times longer a peer takes, and the tolerance of mbs that is as good."""
        for own in self.of("mbs"):
            if own.error <= peer.error:
                return peer.best / own.best, own.setting
        return None


def main() -> None:
    """Measure and print."""
    arguments = _arguments()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MBS_CACHE_DIR"] = folder  # so that compiling is measured
        if arguments.growth:
            text = growth_table()
        elif arguments.windows:
            text = windows_table(arguments.rounds)
        elif arguments.build:
            text = build_table()
        elif arguments.calls:
            text = call_table()
        elif arguments.long:
            text = long_run()
        else:
            names = arguments.cases.split(",")
            text = tables([measured(CASES[name], arguments.rounds) for name in names])
    if arguments.output:
        with open(arguments.output, "w", encoding="utf-8") as file:
            file.write(text)
    print(text)


def measured(case: Case, rounds: int) -> Row:
    """A case: everything built, every motion compared with the reference, then timed in turns."""
    own = made(case)
    row = Row(case, own.seconds, contenders(case, own))
    for _ in range(rounds):
        for contender in row.contenders:
            contender.round()
    for c in row.contenders:
        told = f"{c.who} {c.setting:.3g}: error {c.error:.1e}, {c.best:.3g} s"
        print(f"{case.name}: {told}", file=sys.stderr)
    return row


def contenders(case: Case, own: Made) -> list[Contender]:
    """mbs at some tolerances and the peers at some steps, each run once."""
    reference = case.reference(case.times)
    numbers = plain_of(case, own)
    exudyn, mujoco = ExudynTwin(numbers), MujocoTwin(numbers)
    found = []

    def add(who: str, setting: float, call: Callable[[], Array], places: Any) -> None:
        seconds, result = _seconds(call)
        error = rms_error(places(result), reference)
        found.append(Contender(who, setting, call, error, seconds))

    for tolerance in TOLERANCES:
        call = run(case, own, tolerance, case.times)
        add("mbs", tolerance, call, lambda states: outputs(case, own.system, states))
    for who, steps, twin in (
        ("exudyn", case.steps.exudyn, exudyn),
        ("mujoco", case.steps.mujoco, mujoco),
    ):
        for step in steps:
            call = _bound(twin, step, case)
            add(who, step, call, lambda raw, twin=twin: twin.places(raw)[:, case.axes])
    return found


def _bound(twin: ExudynTwin | MujocoTwin, step: float, case: Case) -> Callable[[], Array]:
    return lambda: twin.run(step, case.seconds, case.rows)


def tables(rows: Sequence[Row]) -> str:
    """The comparison, one row a mechanism, and every run, as Markdown."""
    head = ["mechanism", "build s", "compile s"]
    head += [f"mbs {tolerance:.0e}: error, ms" for tolerance in SHOWN]
    head += [cell for peer in PEERS for cell in (f"{peer}: step, error, ms", "ratio")]
    lines = []
    for row in rows:
        build = sum(row.seconds.values()) - row.seconds["compile"]
        cells = [row.case.name, f"{build:.2f}", f"{row.seconds['compile']:.2f}"]
        cells += [_figures(c) for c in row.of("mbs") if c.setting in SHOWN]
        for peer in PEERS:
            best = min(row.of(peer), key=lambda c: (row.ratio(c) or (np.inf,))[0])
            cells += [f"{best.setting:g} s, {_figures(best)}", _ratio(row, best)]
        lines.append(cells)
    every = [_run_cells(row, c) for row in rows for c in row.contenders]
    names = ["mechanism", "who", "tolerance or step", "error", "ms", "ratio (mbs at)"]
    return f"{_table(head, lines)}\n{_table(names, every)}"


def _run_cells(row: Row, c: Contender) -> list[str]:
    ratio = "" if c.who == "mbs" else _ratio(row, c)
    return [row.case.name, c.who, f"{c.setting:g}", f"{c.error:.1e}", _ms(c), ratio]


def _figures(c: Contender) -> str:
    return f"{c.error:.1e}, {_ms(c)}"


def _ms(c: Contender) -> str:
    ms = c.best * 1e3
    return f"{ms:.0f}" if ms >= 100 else f"{ms:.3g}"


def _ratio(row: Row, peer: Contender) -> str:
    found = row.ratio(peer)
    if found is None:
        return "mbs is less accurate"
    missed = "" if found[0] >= TARGET else ", missed"
    return f"{found[0]:.0f} ({found[1]:.0e}{missed})"


def build_table() -> str:
    """Seconds from the description to machine code, and of the processor where others share it."""
    lines = []
    for name in ("n1", "n10", "n40"):
        case, before = CASES[name], sum(os.times()[:4])
        own = made(case)
        spent = sum(os.times()[:4]) - before
        rhs, project = own.state.rhs, own.state.project
        size = f"{rhs.n_instructions()} + {project.n_instructions() if project else 0}"
        parts = [f"{seconds:.2f}" for seconds in own.seconds.values()]
        total = sum(own.seconds.values())
        lines.append([case.name, *parts, f"{total:.1f}", f"{spent:.1f}", size])
    head = ["mechanism", *(f"{k} s" for k in own.seconds), "total s", "of CPU s", "operations"]
    return _table(head, lines)


def call_table(duration: float = 10.0, tolerance: float = 1e-6) -> str:
    """Milliseconds of motions of 1000 rows: the integration, and what a user calls around it."""
    lines = []
    for name in ("n1", "n10", "n40"):
        calls = list(_calls(CASES[name], duration, tolerance))
        first = _seconds(calls[1])[0]
        best = [float("inf")] * len(calls)
        for _ in range(30):
            best = [min(t, _seconds(call)[0]) for t, call in zip(best, calls, strict=True)]
        best[-1] /= STUDY
        cells = [f"{1e3 * t:.3g}" for t in best]
        lines.append([CASES[name].name, cells[0], f"{1e3 * first:.0f}", *cells[1:]])
    head = ["mechanism", "integration", "first `run`", "further `run`", "`Simulator`"]
    return _table([*head, "one column", "another start", "case of a sweep"], lines)


def _calls(case: Case, duration: float, tolerance: float) -> Iterator[Callable[[], Any]]:
    """The integration as `run` has it, `run`, and simulators, in the order of the table."""
    system = case.build().assemble()
    p, times = np.zeros(0), np.linspace(0.0, duration, round(100 * duration) + 1)
    x0 = np.concatenate(start(system, None, case.v0, None))
    rtol, atol = step_tolerances(tolerance)
    state = full_state(system, effort_function(system, case.tau))
    options: dict[str, Any] = {"method": case.method, "rtol": rtol, "atol": atol}
    yield lambda: integrate_segments(system, lambda _: state, x0, times, p, **options)
    laws: dict[str, Any] = {"tau": case.tau, "method": case.method}
    given: dict[str, Any] = {"tolerance": tolerance, "v0": case.v0}
    yield lambda: mbs.simulate.run(system, duration, quiet=True, **laws, **given)
    column = [f"{system.coordinates[0].name}.q"]
    whole = mbs.simulate.Simulator(system, **laws)
    one = mbs.simulate.Simulator(system, outputs=column, **laws)
    yield lambda: whole(duration, **given)
    yield lambda: one(duration, **given)
    # starts that differ from call to call
    speed = system.velocity_coordinates[system.independent[0]].name
    first = system.velocity(case.v0)[system.independent[0]]
    others = ({**(case.v0 or {}), speed: first + 1e-4 * k} for k in itertools.count(1))
    yield lambda: whole(duration, tolerance=tolerance, v0=next(others))

    def study() -> Any:
        places = system.position(None)[0] + 0.1 * np.arange(STUDY)
        grid = {column[0]: places.tolist()}
        same: dict[str, Any] = {"tolerance": tolerance, "v0": case.v0, **laws}
        return mbs.simulate.sweep(system, grid, duration, quiet=True, **same)

    yield study


def growth_table() -> str:
    """Seconds of the processor from the description to the first step, with an empty cache."""
    lines = []
    for count in GROWTH:
        with tempfile.TemporaryDirectory() as folder:
            os.environ["MBS_CACHE_DIR"] = folder
            start, first = time.perf_counter(), os.times()
            system = n_four_bar(count).assemble()
            between = os.times()
            mbs.simulate.run(system, duration=1e-3, v0={"a0": -1.0})
            took, last = time.perf_counter() - start, os.times()
        assembly, equations = between.user - first.user, last.user - between.user
        compiler = last.children_user - first.children_user
        most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        seconds = (assembly, equations, compiler, assembly + equations + compiler, took)
        cells = [f"N = {count}", *(f"{x:.1f}" for x in seconds), f"{most:.0f}"]
        lines.append(cells)
        print(_table(GROWTH_HEAD, lines[-1:]).splitlines()[-1], file=sys.stderr)
    return _table(GROWTH_HEAD, lines)


def windows_table(rounds: int, duration: float = 10.0, tolerance: float = 1e-4) -> str:
    """Milliseconds of the processor for a call of `run` through singular configurations."""
    lines = []
    for count in WINDOWS:
        system, spent = n_four_bar(count).assemble(), list[float]()
        for _ in range(rounds + 1):  # the first call compiles
            start = time.process_time()
            mbs.simulate.run(system, duration, v0={"a0": -1.0}, tolerance=tolerance, quiet=True)
            spent.append(1e3 * (time.process_time() - start))
        best = min(spent[1:])
        lines.append([f"N = {count}", f"{best:.1f}", f"{best / count:.2f}"])
    return _table(WINDOWS_HEAD, lines)


def long_run(seconds: float = 1000.0, tolerance: float = 1e-9) -> str:
    """A four-bar for a long time, through the singular configurations: what drifts, in a table."""
    case = CASES["n1"]
    own = made(case)
    times = np.linspace(0.0, seconds, round(10 * seconds) + 1)
    spent, states = _seconds(run(case, own, tolerance, times))
    observed = own.state.observe.map(len(times))(times.reshape(1, -1), states.T, [])
    *_, E, U, openness = (np.array(value).ravel() for value in observed)
    energy = E + U
    names = [coordinate.name for coordinate in own.system.coordinates]
    a0, b0, a1 = (states[:, names.index(name)] for name in ("a0", "b0", "a1"))
    apart = max(np.max(np.abs(a0 - a1)), np.max(np.abs(a0 + b0)))
    drift = np.max(np.abs(energy - energy[0]))
    lines = [
        ["time", f"{spent:.3g} s for {seconds:g} s"],
        ["largest closure residual", f"{np.max(openness):.1e}"],
        ["energy drift", f"{drift:.1e} J, {drift / np.ptp(U):.1e} of the {np.ptp(U):.3g} J"],
        ["off the parallelogram branch", f"{apart:.1e} rad"],
        ["turns", f"{abs(a0[-1] - a0[0]) / (2 * np.pi):.1f}"],
    ]
    return _table(["1000 s of a four-bar at 1e-9", ""], lines)


def _table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows) + "\n"


def _seconds(call: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--rounds", type=int, default=5, help="turns of the contenders")
    parser.add_argument("--build", action="store_true", help="time building alone")
    parser.add_argument("--calls", action="store_true", help="time a user's calls")
    parser.add_argument("--growth", action="store_true", help="time the way to the first step")
    parser.add_argument("--windows", action="store_true", help="time runs of many windows")
    parser.add_argument("--long", action="store_true", help="1000 s of a four-bar")
    parser.add_argument("--output", help="Markdown file to write")
    return parser.parse_args()


if __name__ == "__main__":
    main()
