"""Motions of mechanisms through singular configurations: how many pass, stop, or are wrong.

    python benchmarks/passages.py [--starts 20] [--duration 3] [--only kite,delta] [--seed 1]
    python benchmarks/passages.py --fmu cs [--fmi 2.0] [--tolerances 1e-4,1e-6]
    python benchmarks/passages.py --falls [--duration 10] [--only delta]

A motion is wrong where its energy changes by more than 300 times the tolerance, in parts of the
largest kinetic energy; no force is dissipative. Starts have random positions and velocities of the
independent joints, tolerances are random from 1e-10 to 1e-3 where none are given.

`--falls` lets FMUs fall from rest, in both interfaces of both versions of FMI, and prints for each
tolerance the energy error in parts of the largest kinetic energy, or when the FMU stopped.
"""

from __future__ import annotations

import argparse
import re
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import mbs
from mbs import MbsError, System
from mbs.components import Body, Prismatic, Revolute
from mbs.simulate import fmu

WRONG = 300.0
KINDS = {"cs": "CoSimulation", "me": "ModelExchange"}
FALLS = ("sr400", "five_bar", "delta", "stewart_platform")
GRAVITY = (0, -9.81, 0)


def main() -> None:
    """Run and print."""
    arguments = _arguments()
    if arguments.falls:
        print(*_falls(arguments), sep="\n")
        return
    chosen = arguments.only.split(",") if arguments.only else list(MECHANISMS)
    fixed = [float(x) for x in arguments.tolerances.split(",")] if arguments.tolerances else None
    print(f"{'mechanism':18} {'pass':>5} {'stop':>5} {'wrong':>5}  median, largest dE/Ekin/tol   s")
    for name in chosen:
        system = MECHANISMS[name]()
        start = time.perf_counter()
        runner = _of_run if arguments.fmu is None else _of_fmu(system, arguments)
        counts, parts, told = [0, 0, 0], [], []
        for tolerance, q0, v0 in starts(system, arguments.starts, arguments.seed, fixed):
            try:
                energy, kinetic = runner(system, arguments.duration, q0, v0, tolerance)
            except MbsError as error:
                counts[1] += 1
                told.append(f"    {tolerance:.1e} {q0} {v0}: {str(error)[:160]}")
                continue
            part = np.ptp(energy) / (kinetic.max() * tolerance)
            parts.append(part)
            counts[0 if part < WRONG else 2] += 1
            if part >= WRONG:
                told.append(f"    {tolerance:.1e} {q0} {v0}: wrong, {part:.3g}")
        spent = time.perf_counter() - start
        median, largest = (np.median(parts), np.max(parts)) if parts else (np.nan, np.nan)
        print(
            f"{name:18} {counts[0]:5} {counts[1]:5} {counts[2]:5}  {median:10.2g} {largest:10.2g}"
            f" {spent:8.1f}",
            *told[: arguments.told],
            sep="\n",
            flush=True,
        )


def starts(
    system: System, count: int, seed: int, tolerances: list[float] | None = None
) -> list[tuple[float, dict[str, float], dict[str, float]]]:
    """Random tolerances, positions and velocities of the independent joints."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(count):
        tolerance = (
            10 ** rng.uniform(-10, -3) if tolerances is None else tolerances[k % len(tolerances)]
        )
        names = [system.velocity_coordinates[j].name for j in system.independent]
        configuration = dict(
            zip((c.name for c in system.coordinates), system.configuration, strict=True)
        )
        q0 = {name: configuration[name] + rng.uniform(-0.3, 0.3) for name in names}
        v0 = {name: rng.uniform(-6, 6) for name in names}
        try:
            mbs.simulate.run(system, 1e-6, q0=q0, v0=v0, step=1e-6, quiet=True)
        except MbsError:
            q0 = {}
        found.append((tolerance, q0, v0))
    return found


def _of_run(system, duration, q0, v0, tolerance):
    result = mbs.simulate.run(
        system, duration, q0=q0, v0=v0, tolerance=tolerance, step=duration / 60, quiet=True
    )
    return result["kinetic_energy"] + result["potential_energy"], result["kinetic_energy"]


def _of_fmu(system: System, arguments: argparse.Namespace) -> Callable:
    path = _exported(system, arguments.fmi, arguments.duration)
    kind = KINDS[arguments.fmu]

    def run(_, duration, q0, v0, tolerance):
        given = {f"{k}.q": x for k, x in q0.items()} | {f"{k}.v": x for k, x in v0.items()}
        return _energies(path, kind, duration, given, tolerance, duration / 60)

    return run


def _exported(system: System, fmi: str, duration: float) -> Path:
    path = Path(tempfile.mkdtemp()) / "m.fmu"
    return mbs.export.fmu(system, path, fmi=fmi, outputs=["energy"], stop_time=duration)


def _energies(path, kind, duration, start, tolerance, step):
    """All and kinetic energy over a motion of an FMU."""
    result = fmu(path, duration, start=start, kind=kind, tolerance=tolerance, step=step, quiet=True)
    kinetic = result["energy.kinetic"]
    return kinetic + result["energy.potential"], kinetic


def _falls(arguments: argparse.Namespace) -> list[str]:
    """A table of falls from rest."""
    tolerances = [1e-4, 1e-6, 1e-8, 1e-10]
    lines = ["| fall | " + " | ".join(f"{x:.0e}" for x in tolerances) + " |"]
    lines.append("|---" * (len(tolerances) + 1) + "|")
    for name in arguments.only.split(",") if arguments.only else FALLS:
        system = MECHANISMS[name]()
        for fmi in ("2.0", "3.0"):
            path = _exported(system, fmi, arguments.duration)
            for kind in KINDS.values():
                found = [_fall(path, kind, arguments.duration, x) for x in tolerances]
                lines.append(f"| `{name}`, {kind}, FMI {fmi} | " + " | ".join(found) + " |")
    return lines


def _fall(path: Path, kind: str, duration: float, tolerance: float) -> str:
    try:
        energy, kinetic = _energies(path, kind, duration, {}, tolerance, 0.01)
    except MbsError as error:
        time = re.search(r"time (?:[-+.\de]+ and )?([-+.\de]+)", str(error))
        return f"stops at {float(time[1]):.3g} s" if time else str(error)
    return f"{np.ptp(energy) / kinetic.max():.1e}"


def rod(name: str, length: float) -> Body:
    """A slender rod of 1 kg/m along x."""
    inertia = length**3 / 12
    return Body(name, mass=length, com=(length / 2, 0, 0), inertia=(0, inertia, inertia))


def linkage(
    crank: float, coupler: float, rocker: float, ground: float, guess: dict[str, float]
) -> Callable[[], System]:
    """A four-bar linkage in the vertical plane."""

    def build() -> System:
        m = mbs.Mechanism("linkage", gravity=GRAVITY)
        a, b, c = (m.add(rod(n, x)) for n, x in zip("abc", (crank, coupler, rocker), strict=True))
        m.connect(m.world, Revolute("j1", actuated=True), a)
        m.connect(a.at(crank), Revolute("j2"), b)
        m.connect(m.world.at(ground), Revolute("j4"), c)
        closing = Revolute("j3")
        m.connect(b.at(coupler), closing, c.at(rocker))
        m.cut(closing)
        return m.assemble(guess=guess)

    return build


def coupling_rod() -> System:
    """A rod on three parallel cranks, over-constrained."""
    m = mbs.Mechanism("coupling_rod", gravity=GRAVITY)
    bar = m.add(rod("bar", 2.0))
    for k in range(3):
        crank = m.add(rod(f"crank{k}", 0.4))
        m.connect(m.world.at(float(k)), Revolute(f"j{k}", actuated=k == 0), crank)
        pin = Revolute(f"p{k}")
        m.connect(crank.at(0.4), pin, bar.at(float(k)))
        if k:
            m.cut(pin)
    return m.assemble(guess={"j0": 1.0, "j1": 1.0, "j2": 1.0, "p0": -1.0})


def piston() -> System:
    """A slider crank whose piston is the independent joint: it turns back at both dead centres."""
    m = mbs.Mechanism("piston", gravity=GRAVITY)
    crank, rod_, head = (
        m.add(rod("crank", 0.3)),
        m.add(rod("rod", 0.8)),
        m.add(Body("head", mass=1)),
    )
    m.connect(m.world, Revolute("j1"), crank)
    m.connect(crank.at(0.3), Revolute("j2"), rod_)
    m.connect(m.world, Prismatic("slide", axis="x", actuated=True), head)
    closing = Revolute("pin")
    m.connect(rod_.at(0.8), closing, head)
    m.cut(closing)
    return m.assemble(active=["slide"], guess={"j1": 1.0, "j2": -1.3, "slide": 0.9})


MECHANISMS: dict[str, Callable[[], System]] = {
    "n_four_bar": lambda: mbs.robots.n_four_bar().assemble(active=["a0"]),
    "a+g=b+c": linkage(0.4, 0.9, 0.7, 1.2, {"j1": 1.0, "j2": -0.5, "j4": 1.5}),
    "kite": linkage(0.5, 1.1, 1.1, 0.5, {"j1": 1.0, "j2": 0.5, "j4": 2.0}),
    "antiparallelogram": linkage(0.4, 1.0, 0.4, 1.0, {"j1": 1.0, "j2": -1.8, "j4": -1.5}),
    "coupling_rod": coupling_rod,
    "sr400": lambda: mbs.robots.sr400().assemble(),
    "five_bar": lambda: mbs.robots.five_bar().assemble(),
    "piston": piston,
    "delta": lambda: mbs.robots.delta().assemble(),
    "stewart_platform": lambda: mbs.robots.stewart_platform().assemble(),
    "n_four_bar(10)": lambda: mbs.robots.n_four_bar(10).assemble(active=["a0"]),
}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--duration", type=float)
    parser.add_argument("--only", default="")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tolerances", default="")
    parser.add_argument("--fmu", choices=["cs", "me"], default=None)
    parser.add_argument("--fmi", default="2.0")
    parser.add_argument("--told", type=int, default=6)
    parser.add_argument("--falls", action="store_true")
    found = parser.parse_args()
    if found.duration is None:
        found.duration = 10.0 if found.falls else 3.0
    return found


if __name__ == "__main__":
    main()
