"""What every model of every mechanism gives, kept beside a change that must not move it.

Every builder of tests/support/builders.py makes its Function of every mechanism of the catalogue
and of the seeded ones there. The file holds, by mechanism and builder, values at a seeded point (a
closed configuration where there are loops), names and sizes of inputs and outputs, operations and
a digest of the C code, or the error; for arms and loops also branches, and configurations of a
pose:

python benchmarks/snapshot.py take before.json                    everything: several minutes
python benchmarks/snapshot.py take before.json --only puma560 sr400 loop
python benchmarks/snapshot.py compare before.json after.json      what changed, and by how much
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from casadi import Function

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from fingerprint import c_text, digest
from support.builders import ALONE, BUILDERS, CLOSED_ALONE, OPEN_ALONE, SYSTEMS, numbers, point

import mbs
from mbs import MbsError
from mbs.assembly import System
from mbs.loops import assembly_modes
from mbs.loops.plan import plan
from mbs.models import inverse_geometry
from mbs.operations import count
from mbs.robots import catalogue

CHEAP = 30000
"""Instructions up to which C code is written and digested."""

MANY = 12
"""Velocities beyond which nothing that searches for closed forms or base parameters is asked."""

SHOWN = 1e-13
"""Relative differences of values above this are listed one by one: what a change may move."""

Record = dict[str, Any]


def systems() -> dict[str, Callable[[], System]]:
    """The catalogue, and the seeded mechanisms."""
    loaded = {name: lambda name=name: mbs.load(name).assemble() for name in catalogue()}
    return loaded | SYSTEMS


def builders(name: str, system: System) -> dict[str, Callable[[System], Any]]:
    """What makes Functions of a system."""
    alone = dict(ALONE.get(name, {}))
    if name in catalogue():
        alone |= ALONE["four_bar"] if system.is_closed else ALONE["rx90"]
    if system.nv > MANY:
        alone = {key: build for key, build in alone.items() if "function" not in key}
    return {**BUILDERS, **(CLOSED_ALONE if system.is_closed else OPEN_ALONE), **alone}


def record(system: System, build: Callable[[System], Any]) -> Record:
    """One Function: its values, names, operations and C code, or why there is none."""
    start = time.perf_counter()
    try:
        f = build(system)
        f = f if isinstance(f, Function) else f.function
        values = [value.ravel(order="F").tolist() for value in numbers(f(*point(system, f)))]
    except (MbsError, RuntimeError, KeyError, AttributeError, ValueError) as error:
        return {"error": f"{type(error).__name__}: {error}"}
    sizes = [[f.name_in(k), *f.size_in(k)] for k in range(f.n_in())]
    sizes += [[f.name_out(k), *f.size_out(k)] for k in range(f.n_out())]
    found: Record = {"names": sizes, "values": values}
    if f.is_a("SXFunction"):
        found["operations"] = str(count(f))
        if f.n_instructions() < CHEAP:
            found["C"] = digest(c_text(f))
    found["seconds"] = round(time.perf_counter() - start, 2)
    return found


def branches(system: System) -> Record:
    """Names of the branches, and the configurations of an arm for one pose of its tool."""
    try:
        if system.is_closed:
            chosen = [f"{s.name}: {s.labels[s.chosen]} of {s.labels}" for s in plan(system)]
            return {
                "names": [*chosen, *(", ".join(mode.branch) for mode in assembly_modes(system))]
            }
        q = np.random.default_rng(11).uniform(0.2, 0.9, system.nq)
        T = np.array(mbs.models.direct_geometry(system)(q))
        found = inverse_geometry.solve(system, T)
        rows = [np.asarray(solution.q, dtype=float).ravel().tolist() for solution in found]
        labels = [str(getattr(solution, "branch", "")) for solution in found]
        return {"names": labels, "values": rows}
    except (MbsError, RuntimeError, ValueError) as error:
        return {"error": f"{type(error).__name__}: {error}"}


def take(path: Path, only: Sequence[str], leave: Sequence[str]) -> None:
    """Write the records of some mechanisms, or of all but some; kept after every mechanism."""
    found: dict[str, dict[str, Record]] = {}
    for name, make in systems().items():
        if (only and name not in only) or name in leave:
            continue
        start = time.perf_counter()
        system = make()
        found[name] = {key: record(system, build) for key, build in builders(name, system).items()}
        if system.nv <= MANY:
            found[name]["branches"] = branches(system)
        path.write_text(json.dumps(found))
        print(f"{name}: {len(found[name])} in {time.perf_counter() - start:.1f} s", flush=True)


def distance(first: Sequence[Sequence[float]], other: Sequence[Sequence[float]]) -> float:
    """The largest difference of values, relative to the largest of its output."""
    worst = 0.0
    for a, b in zip(first, other, strict=True):
        x, y = np.array(a, dtype=float), np.array(b, dtype=float)
        if x.shape != y.shape or not np.array_equal(np.isnan(x), np.isnan(y)):
            return float("inf")
        size = max(1.0, float(np.nanmax(np.abs(x), initial=0)))
        worst = max(worst, float(np.nanmax(np.abs(x - y), initial=0)) / size)
    return worst


def differences(
    first: dict[str, dict[str, Record]], other: dict[str, dict[str, Record]]
) -> Iterator[str]:
    """A line for everything that changed, the largest difference of all values at the end."""
    worst, at, compared = 0.0, "", 0
    for name in sorted(first.keys() & other.keys()):
        for key in sorted(first[name].keys() | other[name].keys()):
            a, b = first[name].get(key, {}), other[name].get(key, {})
            where = f"{name} / {key}"
            for part in ("error", "names", "operations", "C"):
                if a.get(part) != b.get(part):
                    yield f"{where} / {part}: {a.get(part)} | {b.get(part)}"
            if "values" not in a or "values" not in b or len(a["values"]) != len(b["values"]):
                continue
            compared, apart = compared + 1, distance(a["values"], b["values"])
            if apart > worst:
                worst, at = apart, where
            if apart > SHOWN:
                yield f"{where} / values: {apart:.1e}"
    yield f"{compared} records compared, largest difference {worst:.1e} {at}".rstrip()
    for name in sorted(first.keys() ^ other.keys()):
        yield f"{name}: in one of the files alone"


def main() -> None:
    """Take a snapshot, or compare two."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    taking = commands.add_parser("take")
    taking.add_argument("file", type=Path)
    taking.add_argument("--only", nargs="*", default=(), help="mechanisms; all when left out")
    taking.add_argument("--leave", nargs="*", default=(), help="mechanisms to leave out")
    comparing = commands.add_parser("compare")
    comparing.add_argument("files", type=Path, nargs=2)
    given = parser.parse_args()
    if given.command == "take":
        take(given.file, given.only, given.leave)
        return
    first, other = (json.loads(path.read_text()) for path in given.files)
    print("\n".join(differences(first, other)))


if __name__ == "__main__":
    main()
