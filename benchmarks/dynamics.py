"""mbs against pinocchio's C++ library, and other code generators, in one process and in turns.

    python benchmarks/dynamics.py [--robots puma560,iiwa] [--quick] [--output table.md]
                                  [--others PYTHON]
    python benchmarks/dynamics.py --calls
    python benchmarks/dynamics.py --compile

Every algorithm is a loop of C++ over 64 random states; a time is the best of many blocks of
0.15 ms. pinocchio is the prebuilt library of the installed `pin` wheel; mbs is
`mbs.native.compiled(f, fast=True)`, gcc -O2 -march=native. dIDM and dDDM are all that pinocchio's
functions of that purpose compute: derivatives with respect to q, v and a or efforts, and the
efforts or accelerations themselves. Values are compared before anything is timed. `--others` names
a Python that has adam or urdf2casadi: their C code is compiled with the same flags and timed too.
`--calls` times calls of compiled Functions from Python instead, by what their arguments are;
`--compile` what `compiled(ddm)` takes, and its derivatives when they are asked for.
"""

from __future__ import annotations

import argparse
import functools
import os
import resource
import sys
import tempfile
import time
import timeit
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from other_generators import generated_by_others
from pinocchio_twin import to_twin, twin
from robots import CATALOGUE, LINKS, frictionless
from timing import ALGORITHMS, STATES, Array, Contender, InLibrary, Peer, best_times, harness

import mbs
import mbs.models
from mbs.assembly import System
from mbs.assembly.tree import quaternion_slices
from mbs.native import compiled
from mbs.native.kernel import kernel_library
from mbs.operations import count

ROBOTS = (*CATALOGUE, *LINKS)
TARGETS = {
    **dict.fromkeys(("puma560", "rx90", "stanford"), (10, 10, 15, 12, 11)),
    **dict.fromkeys(("iiwa", "panda_like"), (7, 7, 10, 6, 6)),
    "quadruped": (5, 7, 7, 6, 5),
    "humanoid": (3.5, 3.5, 4, 2.5, 2),
    **dict.fromkeys(("chain30", "chain100"), (3.5, 4, 4, 2.5, 2)),
}
INPUTS = {"IDM": "qva", "A": "q", "DDM": "qva", "dIDM": "qva", "dDDM": "qva"}
AGREEMENT = 1e-10
MANY = 400_000
"""Operations beyond which a function is left out: its code would fill any cache."""
BUILDERS = {
    "IDM": mbs.models.inverse_dynamics,
    "A": mbs.models.inertia_matrix,
    "DDM": mbs.models.direct_dynamics,
    "dIDM": mbs.models.inverse_dynamics_derivatives,
    "dDDM": mbs.models.direct_dynamics_derivatives,
}


@dataclass
class Row:
    """One algorithm of one robot."""

    robot: str
    algorithm: str
    operations: str = "-"
    build: float = 0.0
    compile: float = 0.0
    error: float = float("nan")
    python: float = float("nan")
    casadi: float = float("nan")
    times: dict[str, float] = field(default_factory=dict)
    note: str = ""


def main() -> None:
    """Measure and write."""
    arguments = _arguments()
    if arguments.calls:
        print(calls())
        return
    if arguments.compile:
        print("\n".join(compiling()))
        return
    loops = harness()
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MBS_CACHE_DIR"] = folder  # so that compiling is measured
        for name in arguments.robots.split(","):
            rows += measure(name, loops, Path(folder), arguments)
            text = report(rows)
            if arguments.output:
                Path(arguments.output).write_text(text, encoding="utf-8")
    print(text)


def measure(name: str, loops: Any, folder: Path, arguments: Any) -> list[Row]:
    """The rows of a robot: built, compiled, compared, then timed in turns."""
    system = frictionless(name, folder)
    model = twin(system)
    file = folder / f"{name}.txt"
    model.saveToText(str(file))
    states = random_states(system)
    rows, contenders = [], {}
    others = generated_by_others(arguments.others, model, folder) if arguments.others else {}
    for algorithm in arguments.algorithms.split(","):
        row = Row(name, algorithm)
        rows.append(row)
        inputs = [states[k] for k in INPUTS[algorithm]]
        own = _own(row, system, loops, inputs)
        if own is None:
            continue
        there = [to_twin(system, states["q"]), *inputs[1:]]
        size = own.value(0).size
        peer = Peer(loops, file, algorithm, there, size)
        row.error = difference_of(own, peer)
        contenders[algorithm, "mbs"], contenders[algorithm, "pinocchio"] = own, peer
        for other, (path, function) in others.get(algorithm, {}).items():
            contender = InLibrary(loops, path, function, inputs)
            wrong = difference_of(contender, peer)
            row.note += "" if wrong < AGREEMENT else f" {other} differs by {wrong:.0e};"
            contenders[algorithm, other] = contender
        _progress(row)
    for (algorithm, who), best in best_times(contenders, 40 if arguments.quick else 200).items():
        next(row for row in rows if row.algorithm == algorithm).times[who] = best
    return rows


def _own(row: Row, system: System, loops: Any, inputs: Sequence[Array]) -> Contender | None:
    """Our function, compiled; None when it is too long."""
    start = time.perf_counter()
    function = BUILDERS[row.algorithm](system)
    row.build = time.perf_counter() - start
    size = function.n_instructions() if function.is_a("SXFunction") else 0
    if size > MANY:
        row.note = f"{size} operations: not compiled"
        return None
    row.operations = str(count(function))
    start = time.perf_counter()
    library = kernel_library([function])
    row.compile = time.perf_counter() - start
    assert library is not None
    _python_calls(row, function, inputs)
    return InLibrary(loops, library, function, inputs)


def _python_calls(row: Row, function: casadi.Function, inputs: Sequence[Array]) -> None:
    """Microseconds of one call from Python, compiled by mbs and as CasADi does it."""
    fast = compiled(function, derivatives=0, fast=True)
    plain = casadi.Function(function)
    state = [np.ascontiguousarray(x[0]) for x in inputs]
    row.python = _microseconds(lambda: fast(*state))
    row.casadi = _microseconds(lambda: plain(*state))


GIVEN: dict[str, Callable[[Array], Any]] = {
    "doubles, columns in memory": np.asfortranarray,
    "doubles, rows in memory": np.ascontiguousarray,
    "transposed": lambda x: np.array(x.T).T,
    "part of a larger array": lambda x: np.repeat(x, 2, axis=0)[::2],
    "float32": lambda x: x.astype(np.float32),
    "integers": lambda x: np.ones(x.shape, dtype=int),
    "other byte order": lambda x: x.astype(">f8"),
    "column (n, 1)": lambda x: x.reshape(-1, 1) if x.ndim == 1 else x,
    "list of numpy's numbers": lambda x: list(x) if x.ndim == 1 else [list(row) for row in x],
    "list of Python's numbers": np.ndarray.tolist,
}
"""How the same numbers may be given."""


def calls() -> str:
    """Microseconds of a call from Python, by how the arguments are given, as Markdown."""
    system = mbs.load("puma560").assemble()
    T, k = casadi.SX.sym("T", 4, 4), casadi.SX.sym("k")
    square = casadi.Function("square", [T, k], [k * casadi.mtimes(T, T)], ["T", "k"], ["y"])
    x, pose = np.linspace(0.1, 0.6, 6), np.linspace(0, 1, 16).reshape(4, 4)
    functions = {
        "IDM, 3 vectors": (mbs.models.inverse_dynamics(system), (x, x, x)),
        "DDM, 3 vectors": (mbs.models.direct_dynamics(system), (x, x, x)),
        "A, a vector": (mbs.models.inertia_matrix(system), (x,)),
        "(4, 4) and a number": (square, (pose, 2.0)),
    }
    lines = ["| given as | " + " | ".join(functions) + " |", "|---|" + "---|" * len(functions)]
    for given, change in GIVEN.items():
        cells = []
        for function, state in functions.values():
            fast = compiled(function, derivatives=0, fast=True)
            args = [change(a) if isinstance(a, np.ndarray) else a for a in state]
            cells.append(f"{_microseconds(functools.partial(fast, *args)):.2f}")
        lines.append(f"| {given} | {' | '.join(cells)} |")
    return "\n".join(lines)


def compiling() -> Iterator[str]:
    """Seconds of `compiled(ddm)` and of its derivatives, and what the compilers needed at most."""
    yield "| mechanism | asked for | s | of processor, s | MB |\n|---|---|---|---|---|"
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MBS_CACHE_DIR"] = folder
        for name in ("puma560", "chain30"):
            ddm = mbs.models.direct_dynamics(frictionless(name, Path(folder)))
            wants = {
                "compiled(ddm)": lambda ddm=ddm: compiled(ddm),
                ".forward(1)": lambda ddm=ddm: compiled(ddm).forward(1),
                ".reverse(1)": lambda ddm=ddm: compiled(ddm).reverse(1),
                ".jacobian()": lambda ddm=ddm: compiled(ddm).jacobian(),
            }
            for want, make in wants.items():
                start, before = time.perf_counter(), sum(os.times()[:4])
                make()
                spent = sum(os.times()[:4]) - before
                most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
                took = time.perf_counter() - start
                yield f"| {name} | {want} | {took:.1f} | {spent:.1f} | {most:.0f} |"


def _microseconds(call: Any) -> float:
    once = max(timeit.timeit(call, number=3) / 3, 1e-7)
    number = max(1, int(2e-3 / once))
    return min(timeit.repeat(call, number=number, repeat=7)) / number * 1e6


def difference_of(a: Contender, b: Contender) -> float:
    """The largest difference over some states, relative to the largest element."""
    worst = 0.0
    for state in range(0, STATES, 8):
        x, y = a.value(state), b.value(state)
        worst = max(worst, float(np.max(np.abs(x - y)) / np.max(np.abs(y))))
    return worst


def random_states(system: System) -> dict[str, Array]:
    """Random q, v and a (or efforts), one row a state; quaternions have unit length."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-2, 2, (STATES, system.nq))
    for part in quaternion_slices(system.tree):
        q[:, part] /= np.linalg.norm(q[:, part], axis=1, keepdims=True)
    return {"q": q, **{name: rng.uniform(-2, 2, (STATES, system.nv)) for name in "va"}}


def report(rows: Sequence[Row]) -> str:
    """The tables as Markdown."""
    others = sorted({who for row in rows for who in row.times} - {"mbs", "pinocchio"})
    head = ["robot", "model", "mul/add", "mbs ns", "pinocchio ns", "ratio", "target"]
    head += [f"{who} ns (ratio to mbs)" for who in others]
    head += ["difference", "build s", "compile s", "Python us", "CasADi us", "note"]
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    for row in rows:
        own, peer = (row.times.get(who, float("nan")) for who in ("mbs", "pinocchio"))
        target = TARGETS.get(row.robot, ("",) * 5)[ALGORITHMS.index(row.algorithm)]
        cells = [row.robot, row.algorithm, row.operations, f"{own:.0f}", f"{peer:.0f}"]
        missed = bool(target) and not peer / own >= float(target)
        cells += [f"{peer / own:.1f}{' (missed)' if missed else ''}", str(target)]
        for who in others:
            other = row.times.get(who)
            cells.append(f"{other:.0f} ({other / own:.1f})" if other else "")
        cells += [f"{row.error:.0e}", f"{row.build:.2f}", f"{row.compile:.2f}"]
        cells += [f"{row.python:.2f}", f"{row.casadi:.1f}", row.note]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def _progress(row: Row) -> None:
    if not row.error < AGREEMENT:
        row.note += f" values differ by {row.error:.0e}: not the same model"
    print(
        f"{row.robot} {row.algorithm}: {row.operations}, build {row.build:.2f} s, compile"
        f" {row.compile:.2f} s, difference {row.error:.0e}",
        file=sys.stderr,
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--algorithms", default=",".join(ALGORITHMS))
    parser.add_argument("--quick", action="store_true", help="fewer blocks")
    parser.add_argument("--output", help="Markdown file to write")
    parser.add_argument("--others", help="Python with adam-robotics or urdf2casadi")
    parser.add_argument("--calls", action="store_true", help="calls from Python alone")
    parser.add_argument("--compile", action="store_true", help="what compiling takes alone")
    return parser.parse_args()


if __name__ == "__main__":
    main()
