"""Mechanisms as FMUs in model exchange and co-simulation beside simulation; the cost of writing.

    python benchmarks/fmu_mechanisms.py [--only four_bar,sr400] [--output table.md]

Every mechanism moves over its experiment, its motors ramping up to different efforts. The FMU runs
in fmpy, in model exchange with CVode and in co-simulation, and is compared with `mbs.simulate.run`;
a deviation is relative to one plus the largest value of the position.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi
import fmpy
import numpy as np
from fmpy.validation import validate_fmu

import mbs
from mbs.components import Body, Box, CoulombFriction, Free, Prismatic, Revolute, RigidStop
from mbs.files import write_text

TOLERANCE = 1e-10
ROWS = 100


@dataclass(frozen=True, slots=True)
class Case:
    """A mechanism and its experiment.

    Attributes:
        system: makes it.
        seconds: how long it moves; where it falls freely it ends before a singular configuration.
        effort: of the first motor at the end; the others have less [N m or N].
    """

    system: Callable[[], mbs.System]
    seconds: float
    effort: float


def floating_body() -> mbs.System:
    """A rigid body thrown into the air."""
    m = mbs.Mechanism("floating_body", gravity=(0, 0, -9.81))
    hull = m.add(Body("hull", mass=3, com=(0.05, 0, 0.02), inertia=(0.2, 0.3, 0.25)))
    m.connect(m.world, Free("body"), hull)
    return m.assemble()


def rubbing_pendulum() -> mbs.System:
    """A pendulum with motor, hard stops and Coulomb friction."""
    m = mbs.Mechanism("rubbing_pendulum", gravity=(0, -9.81, 0))
    rod = m.add(Box("rod", length=0.5, width=0.05, density=2700))
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), rod.left)
    m.add(RigidStop("stop", "j1", lower=-2.0, upper=0.4, restitution=0.6))
    m.add(CoulombFriction("rub", "j1", sliding=0.3))
    return m.assemble()


def two_roots() -> mbs.System:
    """A pendulum and a slide beside each other on the ground."""
    m = mbs.Mechanism("two_roots", gravity=(0, -9.81, 0))
    rod = m.add(Box("rod", length=0.5, width=0.05, density=2700))
    bar = m.add(Box("bar", length=0.4, width=0.05, density=2700))
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), rod.left)
    m.connect(m.world.at(1, 0, 0), Prismatic("j2", axis="x", actuated=True), bar.left)
    return m.assemble()


def massless_slide() -> mbs.System:
    """A pendulum on a slide without mass."""
    m = mbs.Mechanism("massless_slide", gravity=(0, -9.81, 0))
    slide = m.add(Body("slide", mass=0, com=(0, 0, 0), inertia=(0, 0, 0)))
    bob = m.add(Body("bob", mass=1, com=(0.4, 0, 0), inertia=(0.01, 0.02, 0.02)))
    m.connect(m.world, Prismatic("j1", axis="x", actuated=True), slide)
    m.connect(slide, Revolute("j2", axis="z"), bob)
    return m.assemble()


def _catalogue(name: str) -> Callable[[], mbs.System]:
    return lambda: mbs.load(name).assemble()


CASES = {
    "puma560": Case(_catalogue("puma560"), 2.0, 20.0),
    "sr400": Case(_catalogue("sr400"), 0.5, 20.0),
    "four_bar": Case(_catalogue("four_bar"), 2.0, 3.0),
    "andrews_squeezer": Case(_catalogue("andrews_squeezer"), 0.03, 0.033),
    "five_bar": Case(_catalogue("five_bar"), 0.3, 1.0),
    "rubbing_pendulum": Case(rubbing_pendulum, 2.0, 2.0),
    "delta": Case(_catalogue("delta"), 0.4, 1.0),
    "stewart_platform": Case(_catalogue("stewart_platform"), 0.25, 60.0),
    "floating_body": Case(floating_body, 2.0, 0.0),
    "two_roots": Case(two_roots, 1.0, 3.0),
    "massless_slide": Case(massless_slide, 0.5, 3.0),
    "bricard": Case(_catalogue("bricard"), 0.5, 0.3),
}


def main() -> None:
    """Measure and print."""
    arguments = _arguments()
    rows = ["| mechanism | states | write [s] | file [kB] | ME | CS | ME - CS |", "|" + "---|" * 7]
    with tempfile.TemporaryDirectory() as name:
        for case in arguments.only.split(",") if arguments.only else CASES:
            rows.append(_measured(case, CASES[case], Path(name)))
            print(rows[-1], flush=True)
    text = "\n".join(rows)
    print(text)
    if arguments.output:
        write_text(text + "\n", arguments.output)


def _measured(name: str, case: Case, folder: Path) -> str:
    system = case.system()
    begin = time.perf_counter()
    path = mbs.export.fmu(system, folder / f"{name}.fmu", stop_time=case.seconds)
    seconds = time.perf_counter() - begin
    if problems := validate_fmu(str(path)):
        raise SystemExit(f"{name}: {problems}")
    wanted = simulated(system, case)
    me, cs = (imported(path, system, case, kind) for kind in ("ModelExchange", "CoSimulation"))
    states = fmpy.read_model_description(str(path)).numberOfContinuousStates
    scale = 1 + np.abs(wanted).max(axis=0)
    errors = [np.max(np.abs(a - b) / scale) for a, b in ((me, wanted), (cs, wanted), (me, cs))]
    cells = [name, str(states), f"{seconds:.1f}", f"{path.stat().st_size / 1e3:.0f}"]
    return f"| {' | '.join([*cells, *(f'{error:.1e}' for error in errors)])} |"


def _motors(system: mbs.System) -> list[int]:
    return [k for k in system.independent if system.velocity_coordinates[k].actuated]


def _ends(system: mbs.System, case: Case) -> list[float]:
    """Effort of each motor at the end of its ramp."""
    return [case.effort / (k + 1) for k in range(len(_motors(system)))]


def simulated(system: mbs.System, case: Case) -> np.ndarray:
    """Positions of all joints, one row for each time."""

    def effort(t, q, v):
        tau = casadi.SX.zeros(system.nv)
        tau[_motors(system)] = casadi.DM(_ends(system, case)) * t / case.seconds
        return tau

    step = case.seconds / ROWS
    result = mbs.simulate.run(
        system, case.seconds, tau=effort, step=step, tolerance=TOLERANCE, quiet=True
    )
    return _gridded(result.time, [result[f"{c.name}.q"] for c in system.coordinates], case)


def imported(path: Path, system: mbs.System, case: Case, kind: str) -> np.ndarray:
    """The same from the FMU in fmpy."""
    ends = zip(_motors(system), _ends(system, case), strict=True)
    ramp = np.array([0.0, case.seconds])
    result = mbs.simulate.fmu(
        path,
        case.seconds,
        inputs={
            f"{system.velocity_coordinates[k].name}.tau": (ramp, end * ramp / case.seconds)
            for k, end in ends
        },
        kind=kind,
        step=case.seconds / ROWS,
        tolerance=TOLERANCE,
        quiet=True,
    )
    return _gridded(result.time, [result[f"{c.name}.q"] for c in system.coordinates], case)


def _gridded(times, columns, case: Case) -> np.ndarray:
    """The rows on the grid; of two rows at an event the last one."""
    grid = np.linspace(0.0, case.seconds, ROWS + 1)
    order = np.searchsorted(times, grid + 1e-9 * case.seconds) - 1
    if not np.allclose(np.asarray(times)[order], grid, atol=1e-8 * case.seconds):
        raise SystemExit("a row of the grid is missing")
    return np.column_stack([np.asarray(column, dtype=float)[order] for column in columns])


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only")
    parser.add_argument("--output")
    return parser.parse_args()


if __name__ == "__main__":
    main()
