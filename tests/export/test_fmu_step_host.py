"""A bare program in C makes the steps of an FMU through singular configurations."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmu_instances import Fmu

import mbs
from mbs.native import compiler_found, find_compiler
from mbs.simulate.fmu import fmu

HOST = Path(__file__).parents[1] / "support" / "step_host.c"
TOLERANCE, STEP, STEPS = 1e-8, 0.01, 1000
MECHANISMS = {
    "n_four_bar": (lambda: mbs.robots.n_four_bar().assemble(active=["a0"]), ("a0.v", -3.0)),
    "five_bar": (lambda: mbs.robots.five_bar().assemble(), ("q1.v", 0.5)),
}


def stepped(unpacked, fmi, start, names, folder):
    """(STEPS, len(names)) values after every step of the program."""
    program = folder / "step_host"
    flags = ["-O1", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    headers = f"-I{Path(unpacked.folder, 'sources')}"
    version = ["-DFMI3"] if fmi == "3.0" else []
    command = [*find_compiler().command, *flags, *version, headers, str(HOST)]
    subprocess.run([*command, "-o", str(program), "-ldl"], check=True)
    library = next(Path(unpacked.folder, "binaries").glob("*/*.so"))
    references = unpacked.references
    words = [program, library, unpacked.description.guid, TOLERANCE, STEPS, STEP]
    words += [references[start[0]], start[1], *(references[name] for name in names)]
    answer = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    return np.array([line.split() for line in answer.stdout.splitlines()], dtype=float)


@pytest.mark.skipif(not compiler_found(), reason="there is no C compiler")
@pytest.mark.skipif(sys.platform == "win32", reason="the program opens libraries by dlopen")
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", MECHANISMS)
def test_steps_from_c_are_those_of_fmpy(tmp_path, name, fmi):
    build, start = MECHANISMS[name]
    system = build()
    path = mbs.export.fmu(system, tmp_path / "x.fmu", fmi=fmi, outputs=["energy"])
    shown = fmu(path, STEPS * STEP, start=dict([start]), tolerance=TOLERANCE, step=STEP, quiet=True)
    joints = [f"{speed.name}.{end}" for speed in system.speeds for end in ("q", "v")]
    names = ["energy.kinetic", "energy.potential", *joints]
    rows = stepped(Fmu(path, tmp_path / "x"), fmi, start, names, tmp_path)
    assert len(rows) == STEPS
    energy = rows[:, 0] + rows[:, 1]
    assert np.ptp(energy) < 10 * TOLERANCE * rows[:, 0].max()
    expected = np.array([shown[name][1:] for name in names]).T
    assert np.abs(rows[:, :2] - expected[:, :2]).max() < 100 * TOLERANCE * rows[:, 0].max()
    assert rows[-1] == pytest.approx(expected[-1], abs=1e-4)
