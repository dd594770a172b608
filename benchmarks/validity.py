"""What it costs that calls are checked: models beside the same Functions without their checks.

    python benchmarks/validity.py

The two are called in turn, so that both meet the same machine; times are those of the processor,
to which other programs do not add; the ratio is of the medians.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import casadi
import numpy as np

import mbs

ROUNDS, SECONDS = 301, 2e-3


def main() -> None:
    """Print microseconds a call, checked and not, and their ratio."""
    print(f"{'':34}{'checked':>10}{'not':>10}{'ratio':>8}")
    for name in ("panda", "puma560", "five_bar", "delta"):
        system = mbs.load(name).assemble()
        model = mbs.models.direct_dynamics(system)
        plain = casadi.Function(model)
        point = [np.full(model.size1_in(k), 0.3) for k in range(model.n_in())]
        point[0] = np.array(system.configuration) if system.is_closed else point[0]
        pairs = {
            "interpreted": (model, plain),
            "compiled": (mbs.native.compiled(model), mbs.native.compiled(plain)),
        }
        for kind, pair in pairs.items():
            show(f"{name} ddm, {kind}", *(partial(f, *point) for f in pair), 1)
        rows = [np.tile(x, (4096, 1)) for x in point]
        batches = [mbs.native.batch(model, checked=checked) for checked in (True, False)]
        one, other = (partial(f, *rows, threads=1) for f in batches)
        show(f"{name} ddm, a row of a batch", one, other, 4096)


def show(label: str, one: Callable[[], object], other: Callable[[], object], states: int) -> None:
    """A line of the table."""
    times: tuple[list[float], list[float]] = ([], [])
    one(), other()
    started = time.thread_time()
    one()
    calls = max(1, int(SECONDS / (time.thread_time() - started)))
    for _ in range(ROUNDS):
        for call, kept in zip((one, other), times, strict=True):
            started = time.thread_time()
            for _ in range(calls):
                call()
            kept.append((time.thread_time() - started) / calls / states)
    a, b = (float(np.median(kept)) * 1e6 for kept in times)
    print(f"{label:34}{a:10.4g}{b:10.4g}{a / b:8.3f}", flush=True)


if __name__ == "__main__":
    main()
