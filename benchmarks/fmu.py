"""Communication steps a second of FMUs for co-simulation, beside the bare solver and a Python FMU.

    python benchmarks/fmu.py [--rounds 5] [--steps 2000] [--output table.md]

The six-joint arm falls freely; a communication step is 0.01 s, the tolerance 1e-6. Our FMUs run in
a C program (`fmu_host.c`); the bare solver is the compiled one that simulation uses, outside of any
FMU: with the steps that its error control asks for and dense output, as the FMU goes, and with
steps no longer than the communication step. The Python FMU is one of PythonFMU whose equations
CasADi evaluates, called from Python by fmpy.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import casadi
import fmpy
import numpy as np

import mbs
from mbs.files import write_text
from mbs.models.state.independent import minimal_state
from mbs.native import find_compiler
from mbs.solvers import integrate

HERE = Path(__file__).parent
STEP, TOLERANCE = 0.01, 1e-6


def main() -> None:
    """Measure and print."""
    arguments = _arguments()
    system = mbs.load("puma560").assemble()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        host = _host(folder)
        rates = {
            f"FMI {fmi}, {solver}, C program": _in_c(host, system, folder, fmi, solver, arguments)
            for fmi in ("2.0", "3.0")
            for solver in ("dopri5", "rk4", "rodas")
        }
        rates["bare solver (dopri5), its own steps"] = _bare(system, arguments, np.inf)
        rates["bare solver (dopri5), steps of 0.01 s at most"] = _bare(system, arguments, STEP)
        rates |= _python(folder, arguments)
    text = _table(rates)
    print(text)
    if arguments.output:
        write_text(text + "\n", arguments.output)


def _host(folder: Path) -> Path:
    """The C program, compiled."""
    target = folder / "fmu_host"
    headers = Path(fmpy.__file__).parent / "c-code"
    command = [*find_compiler().command, "-O2", "-std=gnu99", f"-I{headers}"]
    subprocess.run(
        [*command, str(HERE / "fmu_host.c"), "-o", str(target), "-ldl", "-lm"], check=True
    )
    return target


def _in_c(
    host: Path,
    system: mbs.System,
    folder: Path,
    fmi: str,
    solver: str,
    arguments: argparse.Namespace,
) -> float:
    """Steps a second of our FMU in the C program."""
    path = mbs.export.fmu(
        system, folder / f"{solver}{fmi}.fmu", fmi=fmi, solver=solver, internal_step=STEP
    )
    unzipped = fmpy.extract(str(path), str(folder / f"{solver}{fmi}"))
    description = fmpy.read_model_description(unzipped)
    library = next(Path(unzipped, "binaries").rglob("*.so"))
    words = [host, library, fmi, description.guid, arguments.steps, STEP, TOLERANCE]
    answer = subprocess.run(
        [*map(str, words), str(arguments.rounds)], check=True, capture_output=True, text=True
    )
    return float(answer.stdout)


def _bare(system: mbs.System, arguments: argparse.Namespace, longest: float) -> float:
    """Rows a second, one for each communication step, of the compiled solver."""
    rhs = minimal_state(system).rhs
    t, x, p = (casadi.MX.sym(name, n) for name, n in (("t", 1), ("x", 12), ("p", 0)))
    zero = [0.0] * rhs.numel_in(3)

    slope = casadi.Function("slope", [t, x, p], [rhs(t, x, [], zero, p)[0]])

    def seconds(steps: int) -> float:
        times = np.arange(steps + 1) * STEP

        def run() -> None:
            integrate(slope, np.zeros(12), times, rtol=TOLERANCE, atol=TOLERANCE, max_step=longest)

        return _best(run, arguments.rounds)

    once = seconds(1)  # what a call costs before the first step
    return arguments.steps / (seconds(arguments.steps) - once)


def _python(folder: Path, arguments: argparse.Namespace) -> dict[str, float]:
    """Steps a second of a Python FMU, and of ours in the same importer."""
    rates = {}
    steps = max(arguments.steps // 10, 50)
    ours = folder / "dopri52.0.fmu"
    rates["FMI 2.0, dopri5, fmpy"] = steps / _best(lambda: _stepped(ours, steps), arguments.rounds)
    try:
        import pythonfmu  # noqa: F401
    except ImportError:
        print("PythonFMU is not installed: pip install pythonfmu", file=sys.stderr)
        return rates
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", str(HERE / "fmu_python_slave.py")]
    subprocess.run([*command, "-d", str(folder)], check=True, capture_output=True)
    theirs = folder / "PumaSlave.fmu"
    best = _best(lambda: _stepped(theirs, steps), max(arguments.rounds // 2, 1))
    return {**rates, "PythonFMU, CasADi from Python, fmpy": steps / best}


def _stepped(path: Path, steps: int) -> float:
    """Seconds of the steps alone."""
    from fmpy.fmi2 import FMU2Slave

    folder = path.with_suffix("")
    if not folder.exists():
        fmpy.extract(str(path), str(folder))
    description = fmpy.read_model_description(str(folder), validate=False)
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="i",
    )
    slave.instantiate()
    slave.setupExperiment(tolerance=TOLERANCE, startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    begin = time.perf_counter()
    for k in range(steps):
        slave.doStep(k * STEP, STEP)
    seconds = time.perf_counter() - begin
    slave.terminate()
    slave.freeInstance()
    return seconds


def _best(call, rounds: int) -> float:
    """The shortest time of a call [s], or of what it says itself."""
    best = float("inf")
    for _ in range(rounds):
        begin = time.perf_counter()
        answer = call()
        best = min(best, answer if answer is not None else time.perf_counter() - begin)
    return best


def _table(rates: dict[str, float]) -> str:
    first = rates["FMI 2.0, dopri5, C program"]
    rows = ["| what | steps a second | part of ours in C |", "|---|---|---|"]
    rows += [f"| {name} | {rate:,.0f} | {rate / first:.4f} |" for name, rate in rates.items()]
    return "\n".join(rows)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=20000)
    parser.add_argument("--output")
    return parser.parse_args()


if __name__ == "__main__":
    main()
