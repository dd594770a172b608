"""FMUs for other computers: what Linux must offer, and Windows beside Linux.

    python benchmarks/fmu_platforms.py [--only puma560,rubbing_pendulum] [--linux]

Libraries are made with ziglang (the first for Windows takes minutes). The one for Linux must need
no glibc newer than 2.17. The one for Windows runs under wine in a C program, and every number that
it calculates over a second must be that of Linux to twelve digits.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import tempfile
from pathlib import Path

import fmpy
import numpy as np
from elf_versions import glibc_versions
from fmu_mechanisms import CASES

import mbs
from mbs.native.compiler import PLATFORMS, cross_compiler

HERE = Path(__file__).parent
STEPS, STEP = 100, 0.01
OLDEST_GLIBC = (2, 17)
DIGITS = 1e-12


def main() -> None:
    """Measure, print, and fail where a promise does not hold."""
    arguments = _arguments()
    goals = ["x86_64-linux"] if arguments.linux else ["x86_64-linux", "x86_64-windows"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for case in arguments.only.split(","):
            path = mbs.export.fmu(
                CASES[case].system(), folder / f"{case}.fmu", platforms=goals, tolerance=1e-8
            )
            unzipped = Path(fmpy.extract(str(path), str(folder / case)))
            newest = max(glibc_versions(_library(unzipped, "linux64").read_bytes()))
            print(f"{case}: needs glibc {newest[0]}.{newest[1]}", flush=True)
            if newest > OLDEST_GLIBC:
                raise SystemExit(f"{case}: glibc {newest} is newer than {OLDEST_GLIBC}")
            if not arguments.linux:
                _compare(case, unzipped, folder)


def _compare(case: str, unzipped: Path, folder: Path) -> None:
    here = _trace(_program(folder, "x86_64-linux"), unzipped, "linux64")
    there = _trace(_program(folder, "x86_64-windows"), unzipped, "win64")
    error = np.max(np.abs(there - here) / np.maximum(np.abs(here), 1.0))
    same = np.array_equal(here, there)
    print(f"{case}: {here.size} values, Windows - Linux {error:.1e}, all bits equal: {same}")
    if not error < DIGITS:
        raise SystemExit(f"{case}: Windows differs from Linux by {error:.1e}")


def _program(folder: Path, platform: str) -> Path:
    """The C program for a platform."""
    goal = PLATFORMS[platform]
    target = folder / ("trace.exe" if goal.suffix == ".dll" else "trace")
    if not target.exists():
        headers = Path(fmpy.__file__).parent / "c-code"
        command = [*cross_compiler(goal).command, "-O1", "-std=gnu99", f"-I{headers}"]
        subprocess.run([*command, str(HERE / "fmu_trace.c"), "-o", str(target)], check=True)
    return target


def _trace(program: Path, unzipped: Path, platform: str) -> np.ndarray:
    """What the program prints, one row for each step."""
    description = fmpy.read_model_description(str(unzipped))
    library = _library(unzipped, platform)
    words = [program, library, description.guid, len(description.modelVariables), STEPS, STEP]
    runner = [_wine()] if program.suffix == ".exe" else []
    with tempfile.TemporaryFile("w+") as said, tempfile.TemporaryFile("w+") as complaints:
        # files, not pipes: the server that wine leaves behind would keep those open
        status = subprocess.run([*runner, *map(str, words)], stdout=said, stderr=complaints)
        said.seek(0)
        complaints.seek(0)
        if status.returncode:
            raise SystemExit(f"{program.name}: {status.returncode}: {complaints.read()[-300:]}")
        return np.array([line.split() for line in said], dtype=float)


def _wine() -> str:
    found = shutil.which("wine")
    if found is None:
        raise SystemExit("wine is not installed; use --linux")
    return found


def _library(unzipped: Path, platform: str) -> Path:
    return next((unzipped / "binaries" / platform).iterdir())


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="puma560,four_bar,rubbing_pendulum")
    parser.add_argument("--linux", action="store_true")
    return parser.parse_args()


if __name__ == "__main__":
    main()
