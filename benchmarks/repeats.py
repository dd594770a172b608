"""C text with every operation once, and with sequences that recur as functions in loops.

    python benchmarks/repeats.py [--mechanisms bars10,bars160,chain30] [--largest 200000]

Both texts are those of exported libraries: `direct_dynamics` of a mechanism and its Jacobian, with
the bits of the interpreted Functions, which is checked. A time is the shortest of many, in turns.
Straight lines of Jacobians beyond --largest operations are not compiled.
"""

from __future__ import annotations

import argparse
import ctypes
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from robots import LINKS, frictionless

import mbs
from mbs.assembly import System
from mbs.native import find_compiler
from mbs.native.compiler import flags_for
from mbs.native.repeats import LEAST
from mbs.native.scalar_source import plain_source
from mbs.robots import n_four_bar

MECHANISMS = "bars10,bars40,bars160,bars320,stewart_platform,chain30,chain100"
_ROUNDS = 40
_SHARE = 0.01
"""Seconds that a contender may take in a round."""
_POINTER = ctypes.POINTER(ctypes.c_double)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mechanisms", default=MECHANISMS)
    parser.add_argument("--largest", type=int, default=200_000)
    arguments = parser.parse_args()
    print("| | lines of C | text, s | compiler, s | ns |\n|---|---|---|---|---|")
    for name in arguments.mechanisms.split(","):
        with tempfile.TemporaryDirectory() as folder:
            value = casadi.Function(mbs.models.direct_dynamics(system_named(name, Path(folder))))
            for function in (value, value.jacobian()):
                measure(name, function, Path(folder), arguments.largest)


def system_named(name: str, folder: Path) -> System:
    """A row of so many windows, or a robot by its name."""
    if name.startswith("bars"):
        return n_four_bar(int(name.removeprefix("bars"))).assemble()
    if name.startswith("chain") or name in LINKS:
        return frictionless(name, folder)
    return mbs.load(name).assemble()


def measure(name: str, function: casadi.Function, folder: Path, largest: int) -> None:
    """A row of the table: repeats, and in brackets straight lines."""
    if function.n_instructions() > largest:
        print(f"{function.name()} of {name}: {function.n_instructions()} ops", file=sys.stderr)
        return
    rng = np.random.default_rng(0)
    inputs = [rng.uniform(-1, 1, function.nnz_in(k)) for k in range(function.n_in())]
    wanted = [np.array(output.nonzeros()) for output in function.call(inputs)]
    cells, calls = [], []
    for least in (LEAST, sys.maxsize):
        row, call, outputs = built(function, least, folder, inputs)
        cells.append(row)
        calls.append(call)
        call(1)
        for found, expected in zip(outputs, wanted, strict=True):
            np.testing.assert_array_equal(found, expected)
    for row, best in zip(cells, shortest(calls), strict=True):
        row.append(f"{best * 1e9:.0f}")
    pairs = zip(*cells, strict=True)
    print(f"| {name}, {function.name()} |", " | ".join(f"{a} ({b})" for a, b in pairs), "|")


def built(
    function: casadi.Function, least: int, folder: Path, inputs: list[np.ndarray[Any, Any]]
) -> tuple[list[str], Callable[[int], None], list[np.ndarray[Any, Any]]]:
    """Cells of the table, what calls the code so often, and where its results are."""
    start = time.process_time()
    text, work = plain_source([function], least=least)
    seconds = time.process_time() - start
    file = folder / f"{function.name()}_{least}.c"
    file.write_text(text, encoding="utf-8")
    command = [*find_compiler().command, *flags_for(text), str(file), "-o", f"{file}.so", "-lm"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = ctypes.CDLL(f"{file}.so")[function.name()]
    outputs = [np.empty(function.nnz_out(k)) for k in range(function.n_out())]
    w = np.empty(work.w + 1)
    arg = (_POINTER * len(inputs))(*(x.ctypes.data_as(_POINTER) for x in inputs))
    res = (_POINTER * len(outputs))(*(x.ctypes.data_as(_POINTER) for x in outputs))
    place = w.ctypes.data_as(_POINTER)

    def call(times: int, kept: Any = (w, inputs, outputs)) -> None:  # C knows addresses alone
        for _ in range(times):
            code(arg, res, None, place, 0)

    compiler = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return [str(text.count("\n")), f"{seconds:.1f}", f"{compiler:.1f}"], call, outputs


def shortest(calls: list[Callable[[int], None]]) -> list[float]:
    """Seconds of one call of each, measured in turns."""
    best = [np.inf] * len(calls)
    for _ in range(_ROUNDS):
        for k, call in enumerate(calls):
            times = 1 if best[k] == np.inf else max(1, round(_SHARE / best[k]))
            start = time.perf_counter()
            call(times)
            best[k] = min(best[k], (time.perf_counter() - start) / times)
    return best


if __name__ == "__main__":
    main()
