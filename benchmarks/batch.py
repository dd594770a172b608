"""Batches of states: mbs in vector lanes, mbs one state at a time, and pinocchio's C++ loop.

    python benchmarks/batch.py [--robots puma560,iiwa] [--turns 40] [--output table.md]

One process, contenders in turns of four blocks, each time the best of many blocks: 32768 states for
mbs in lanes, 1024 for loops. "cached" is the same block again and again; "memory" is one block
after the other of a million states, which no cache holds. mbs in lanes is
`mbs.native.batch(f)(..., threads=1)` called from Python, results written to arrays; one state at a
time is a C++ loop over `compiled(f, fast=True)` (the fastest scalar code, sines of a call in lanes)
and over the text of `compiled(f)`, results not kept; pinocchio is the prebuilt library of its
wheel, results not kept. "cores" is the whole million with all cores of this process. In brackets:
how many times longer it takes than mbs in lanes. Values are compared before anything is timed.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pinocchio_twin import twin
from robots import frictionless
from timing import Array, InLibrary, Peer, harness

import mbs
import mbs.models
from mbs.assembly import System
from mbs.native import c_source, cached_library
from mbs.native.kernel import kernel_library

BLOCK, MANY = 32768, 1_000_000
LOOP = 1024
TURN = 4
ROBOTS = ("puma560", "rx90", "iiwa", "panda_like")
BUILDERS = {
    "IDM": mbs.models.inverse_dynamics,
    "DDM": mbs.models.direct_dynamics,
    "dIDM": mbs.models.inverse_dynamics_derivatives,
    "dDDM": mbs.models.direct_dynamics_derivatives,
}
Timer = Callable[[int], float]
"""Nanoseconds a state, of the block that begins at a state."""


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--algorithms", default=",".join(BUILDERS))
    parser.add_argument("--turns", type=int, default=40)
    parser.add_argument("--output", help="Markdown file to write")
    arguments = parser.parse_args()
    loops, rows = harness(), []
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.robots.split(","):
            system = frictionless(name, Path(folder))
            for algorithm in arguments.algorithms.split(","):
                rows.append(_row(name, algorithm, system, loops, Path(folder), arguments.turns))
                print(rows[-1], file=sys.stderr, flush=True)
    text = "\n".join([*_HEAD, *rows, ""])
    if arguments.output:
        Path(arguments.output).write_text(text, encoding="utf-8")
    print(text)


_HEAD = (
    "| robot | model | batch ns: cached | memory | cores | fast scalar: cached | memory"
    " | plain scalar: cached | pinocchio: cached | memory | difference |",
    "|---|---|---|---|---|---|---|---|---|---|---|",
)


def _row(name: str, algorithm: str, system: System, loops: Any, folder: Path, turns: int) -> str:
    function = BUILDERS[algorithm](system)
    batch = mbs.native.batch(function)
    rng = np.random.default_rng(0)
    inputs = [rng.uniform(-2, 2, (MANY, port.size)) for port in batch.inputs]
    outputs = batch(*inputs)
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    file = folder / f"{name}.txt"
    twin(system).saveToText(str(file))
    fast = InLibrary(loops, _path(kernel_library([function])), function, inputs)
    text = {"function.c": c_source(function)}
    flags = ("-O2", "-march=native", "-fPIC", "-shared")
    plain = InLibrary(loops, cached_library(text, flags), function, inputs)
    peer = Peer(loops, file, algorithm, inputs, fast.value(0).size)
    wrong = max(_difference(outputs, other) for other in (fast, peer))
    timers: dict[str, Timer] = {
        "batch": lambda first: _of_batch(batch, inputs, outputs, first),
        "fast": lambda first: _of_loop(fast, first),
        "plain": lambda first: _of_loop(plain, first),
        "peer": lambda first: _of_loop(peer, first),
    }
    cached, memory = _best(timers, turns, 0), _best(timers, turns, BLOCK)
    cores = min(_of_cores(batch, inputs, outputs) for _ in range(5))
    cells = [f"{cached['batch']:.1f}", f"{memory['batch']:.1f}", f"{cores:.1f}"]
    for who, times in (("fast", cached), ("fast", memory), ("plain", cached)):
        cells.append(f"{times[who]:.0f} ({times[who] / times['batch']:.1f})")
    for times in (cached, memory):
        cells.append(f"{times['peer']:.0f} ({times['peer'] / times['batch']:.1f})")
    return f"| {' | '.join([name, algorithm, *cells, f'{wrong:.0e}'])} |"


def _best(timers: dict[str, Timer], turns: int, step: int) -> dict[str, float]:
    """The best of all blocks; each block begins `step` states after the one before it."""
    best = dict.fromkeys(timers, float("inf"))
    for turn in range(turns):
        for who, timer in timers.items():
            for block in range(TURN):
                first = (turn * TURN + block) * step % (MANY - BLOCK) // 8 * 8
                best[who] = min(best[who], timer(first))
    return best


def _of_batch(batch: Any, inputs: Sequence[Array], outputs: Sequence[Array], first: int) -> float:
    some = [x[first : first + BLOCK] for x in inputs]
    out = tuple(y[first : first + BLOCK] for y in outputs)
    start = time.perf_counter()
    batch(*some, out=out, threads=1)
    return (time.perf_counter() - start) / BLOCK * 1e9


def _of_cores(batch: Any, inputs: Sequence[Array], outputs: tuple[Array, ...]) -> float:
    start = time.perf_counter()
    batch(*inputs, out=outputs)
    return (time.perf_counter() - start) / MANY * 1e9


def _of_loop(contender: Any, first: int) -> float:
    """A contender over one block; it keeps all states."""
    every = contender._inputs
    contender._inputs = [x[first : first + LOOP] for x in every]
    try:
        return float(contender.time(LOOP, 1))
    finally:
        contender._inputs = every


def _difference(outputs: Sequence[Array], other: Any) -> float:
    """The largest difference over some states, relative to the largest element."""
    worst = 0.0
    for state in range(0, MANY, 50_021):
        own = np.concatenate([y[state].ravel(order="F") for y in outputs])
        there = other.value(state)
        worst = max(worst, float(np.max(np.abs(own - there)) / np.max(np.abs(there))))
    return worst


def _path(library: Path | None) -> Path:
    assert library is not None
    return library


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
