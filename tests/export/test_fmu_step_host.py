"""A bare program in C makes the steps of an FMU through singular configurations."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmu_instances import Fmu, Fmu3, values

import mbs
from mbs.native import compiler_found, find_compiler

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
    flags.append("-Wno-strict-prototypes")  # the header of FMI 3 has function types without them
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


def begun(path, fmi, start, folder):
    """The unpacked FMU, and an instance in fmpy with the same start."""
    if fmi == "2.0":
        unpacked = Fmu(path, folder)
        return unpacked, unpacked.open(FMU2Slave, start=dict([start]), tolerance=TOLERANCE)
    unpacked = Fmu3(path, folder)
    instance = unpacked.open(FMU3Slave)
    instance.setFloat64([unpacked.references[start[0]]], [start[1]])
    instance.enterInitializationMode(tolerance=TOLERANCE)
    instance.exitInitializationMode()
    return unpacked, instance


@pytest.mark.skipif(not compiler_found(), reason="there is no C compiler")
@pytest.mark.skipif(sys.platform == "win32", reason="the program opens libraries by dlopen")
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", MECHANISMS)
def test_steps_from_c_are_those_of_fmpy(tmp_path, name, fmi):
    build, start = MECHANISMS[name]
    system = build()
    path = mbs.export.fmu(system, tmp_path / "x.fmu", fmi=fmi, outputs=["energy"])
    unpacked, instance = begun(path, fmi, start, tmp_path / "x")
    joints = [f"{speed.name}.{end}" for speed in system.velocity_coordinates for end in ("q", "v")]
    names = ["energy.kinetic", "energy.potential", *joints]
    rows = stepped(unpacked, fmi, start, names, tmp_path)
    assert len(rows) == STEPS
    energy = rows[:, 0] + rows[:, 1]
    assert np.ptp(energy) < 10 * TOLERANCE * rows[:, 0].max()
    for k in range(STEPS):
        instance.doStep(k * STEP, STEP)
    assert values(instance, unpacked.description, names).tolist() == rows[-1].tolist()
    instance.freeInstance()
