"""What is decided about the mechanisms of the catalogue, and the text that follows from it.

Nothing of it may depend on the processor or on the linear-algebra library. NumPy's OpenBLAS takes
other kernels where the variable OPENBLAS_CORETYPE says so, and rounds in another way then:

python benchmarks/fingerprint.py                         prints the fingerprints as JSON
python benchmarks/fingerprint.py --kernels Nehalem Zen   compares them under these kernels
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import casadi
from casadi import Function

import mbs
from mbs import MbsError
from mbs.assembly import System
from mbs.identification import base_parameters, regressor
from mbs.loops import assembly_modes
from mbs.loops.plan import plan
from mbs.models import inverse_geometry
from mbs.operations import count
from mbs.robots import catalogue, n_four_bar

KERNELS = ("Prescott", "Nehalem", "Sandybridge", "Haswell", "SkylakeX", "Zen")
THREADS = ("1", "2")

VARIANTS: dict[str, Callable[[], System]] = {
    "n_four_bar(8)": lambda: n_four_bar(8).assemble(),
    "n_four_bar(20)": lambda: n_four_bar(20).assemble(),
}
"""Mechanisms beside those of the catalogue: many joints tie to be independent."""

OPEN: dict[str, Callable[[System], Function]] = {
    "A": mbs.models.inertia_matrix,
    "J": lambda system: mbs.models.jacobian(system, len(system.links)),
    "D": regressor,
}
"""Further models of open chains."""

CLOSED: dict[str, Callable[[System], Function]] = {
    "tree ddm": lambda system: mbs.models.direct_dynamics(system, coordinates="tree"),
    "closed form": mbs.loops.function,
}
"""Further models of mechanisms with loops."""

BOTH: dict[str, Callable[[System], Function]] = {
    "idm": mbs.models.inverse_dynamics,
    "ddm": mbs.models.direct_dynamics,
}

MANY = 30
"""Coordinates beyond which no model is built, which takes long; what is chosen is known by then."""

FEW = 12
"""Coordinates up to which base parameters are listed: they take long in large mechanisms."""


def names() -> list[str]:
    """Every mechanism that has a fingerprint."""
    return [*catalogue(), *VARIANTS]


def fingerprint(name: str, base: bool = False) -> dict[str, Any]:
    """What is decided about one mechanism, and a digest of every text that it leads to.

    Args:
        name: of the mechanism.
        base: whether base parameters are named too, which takes as long as all else.
    """
    build = VARIANTS.get(name)
    system = build() if build else mbs.load(name).assemble()
    found = {
        "tree": [[link.name, link.antecedent] for link in system.tree.links],
        "cuts": [loop.name for loop in system.loops],
        "rows": [[list(loop.rows), list(loop.dropped)] for loop in system.loops],
        "configuration": [float(x).hex() for x in system.configuration],
        **_closure(system),
    }
    if system.nv > MANY:
        return found
    for key, model in (BOTH | (CLOSED if system.is_closed else OPEN)).items():
        found[key] = _model(system, model)
    if name in catalogue():
        found["branches"] = _branches(system)
        if base and system.nv <= FEW:
            found["base parameters"] = list(base_parameters(system).names)
    return found


def _closure(system: System) -> dict[str, Any]:
    if system.closure is None:
        return {}
    speeds = [speed.name for speed in system.velocity_coordinates]
    return {
        "kept": [list(system.closure.rows), list(system.closure.slips)],
        "independent": [speeds[k] for k in system.closure.independent],
        "passive": [speeds[k] for k in system.closure.passive],
        "free": [speeds[k] for k in system.closure.chosen_coordinates],
        "varies": system.closure.varies,
    }


def _model(system: System, build: Callable[[System], Function]) -> dict[str, Any]:
    """Sparsity, operations and generated C of a model; the reason where it has none."""
    try:
        function = build(system)
    except MbsError as error:
        return {"refused": type(error).__name__}
    patterns = [function.sparsity_out(k) for k in range(function.n_out())]
    return {
        "operations": str(count(function)),
        "zeros": [digest(str((s.size(), s.row(), s.colind()))) for s in patterns],
        "text": digest(c_text(function)),
    }


def _branches(system: System) -> list[str]:
    """The branches of the closed loops, or of the inverse geometry of an arm."""
    try:
        if system.is_closed:
            chosen = [f"{s.name}: {s.labels[s.chosen]} of {s.labels}" for s in plan(system)]
            return [*chosen, *(", ".join(mode.branch) for mode in assembly_modes(system))]
        return [digest(c_text(inverse_geometry.function(system)))]
    except MbsError as error:
        return [type(error).__name__]


def c_text(function: Function) -> str:
    """The C that CasADi writes of a function."""
    generator = casadi.CodeGenerator("model")
    generator.add(function)
    text: str = generator.dump()
    return text


def digest(text: str) -> str:
    """A short mark that differs where texts do."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def under(kernel: str, threads: str, *given: str) -> dict[str, Any]:
    """What a process prints that takes these kernels of linear algebra, for these arguments."""
    around = {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": threads}
    environment = {**os.environ, **around, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    command = [sys.executable, __file__, *given]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def differences(first: Any, other: Any, at: str = "") -> Iterator[str]:
    """Where two fingerprints differ, a line each."""
    if isinstance(first, dict) and isinstance(other, dict):
        for key in sorted(first.keys() | other.keys()):
            yield from differences(first.get(key), other.get(key), f"{at} / {key}" if at else key)
    elif first != other:
        yield f"{at}: {first} | {other}"


def main() -> None:
    """Print the fingerprints, or compare those that several kernels lead to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="mechanisms; all of them when left out")
    parser.add_argument("--kernels", nargs="*", help=f"such as {' '.join(KERNELS)}; these if bare")
    parser.add_argument("--threads", nargs="*", default=THREADS)
    parser.add_argument("--base", action="store_true", help="name base parameters too")
    given = parser.parse_args()
    if given.kernels is None:
        found = {name: fingerprint(name, given.base) for name in given.names or names()}
        print(json.dumps(found))
        return
    arguments = ["--base"] * given.base + given.names
    sys.exit(1 if _compared(given.kernels or KERNELS, given.threads, arguments) else 0)


def _compared(kernels: Sequence[str], threads: Sequence[str], arguments: Sequence[str]) -> int:
    """How many differences there are to the first kernel; each is printed."""
    ways = [(kernel, number) for kernel in kernels for number in threads]
    first, found = None, 0
    with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as workers:
        every = workers.map(lambda way: under(*way, *arguments), ways)
        for (kernel, number), other in zip(ways, every, strict=True):
            first = other if first is None else first
            lines = list(differences(first, other))
            print(f"{kernel}, {number} threads: {len(other)} mechanisms, {len(lines)} differences")
            print("".join(f"  {line}\n" for line in lines), end="", flush=True)
            found += len(lines)
    return found


if __name__ == "__main__":
    main()
