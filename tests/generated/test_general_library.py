"""C libraries of all configurations of a general arm, called from C."""

import ctypes
import re
import subprocess
import sys

import numpy as np
import pytest
from support.arm_search import plain_arm
from support.arms import general_6r
from support.bare_library import called, loaded
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.export import c_library
from mbs.models.inverse_geometry import function
from mbs.native import find_compiler

Q = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2])
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror")


@pytest.fixture(scope="module")
def functions():
    """Two arms, whose tables must not meet, and another model beside them."""
    crx, other = catalogue_system("crx10"), general_6r(0)
    igm = {name: function(s, branches="all") for name, s in (("crx", crx), ("other", other))}
    return {**igm, "dgm": mbs.models.direct_geometry(crx)}


@pytest.mark.parametrize("target", ["hosted", "bare"])
def test_c_gives_what_python_gives(functions, target, tmp_path):
    folder = c_library(functions, tmp_path / "arms", target=target)
    library = loaded(folder, (*STRICT, "-O0", "-ffp-contract=off", "-fPIC", "-shared"))
    for name in ("crx", "other"):
        T = plain_arm(functions[name].system).pose(Q)
        expected = [np.array(x).ravel(order="F") for x in functions[name].call([T])]
        status, found = called(folder, library, functions[name], [T], name=name)
        assert status == 0
        assert expected[2][0] > 0
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-9, equal_nan=True)
    bad = T.copy()
    bad[0, 0] = np.nan
    status, found = called(folder, library, functions["crx"], [bad], name="crx")
    assert status == 1
    assert np.all(np.isnan(found[2]))
    text = (folder / "arms.c").read_text()
    assert "malloc" not in text
    assert text.count("int pose_round(double *T) {") == 1


def test_the_program_beside_it_prints_poses_that_are_reached(functions, tmp_path):
    folder = c_library(functions["crx"], tmp_path / "arm")
    command = [*find_compiler().command, *STRICT, "arm.c", "example.c", "-o", "example", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    run = subprocess.run(["./example"], cwd=folder, check=True, capture_output=True, text=True)
    count = int(re.search(r"igm_all count (\d+)", run.stdout)[1])
    q = [float(x) for x in re.search(r"igm_all q (.*)", run.stdout)[1].split()]
    assert count > 0
    own = functions["crx"].example("T")
    found = np.reshape(q, (16, 6))[:count]
    assert np.max(plain_arm(functions["crx"].system).residual(own, found)) < 1e-12


def test_two_libraries_stand_in_one_program(functions, tmp_path):
    command = [*find_compiler().command, "-O0", "main.c", "-o", "main"]
    for name in ("left", "right"):
        folder = c_library({name: functions["other"]}, tmp_path / f"{name}_arm")
        command.append(str(folder / f"{name}_arm.c"))
    lines = [f'#include "{name}_arm/{name}_arm.h"' for name in ("left", "right")]
    called = "double T[16] = {0}, q[96], v[16], n, c, w[LEFT_SZ_W];"
    calls = (f"{name}_eval(T, q, v, &n, &c, w)" for name in ("left", "right"))
    lines.append(f"int main(void) {{ {called} return {' | '.join(calls)}; }}\n")
    (tmp_path / "main.c").write_text("\n".join(lines))
    subprocess.run([*command, "-lm"], cwd=tmp_path, check=True)
    assert subprocess.run(["./main"], cwd=tmp_path, check=False).returncode == 0


def test_zig_compiles_it_too(functions, tmp_path):
    pytest.importorskip("ziglang")
    folder = c_library(functions["other"], tmp_path / "arm")
    command = [sys.executable, "-m", "ziglang", "cc", *STRICT, "-shared", "-fPIC", "arm.c"]
    subprocess.run([*command, "-o", "arm.so"], cwd=folder, check=True)
    igm = functions["other"]
    T = plain_arm(igm.system).pose(Q)
    status, found = called(folder, ctypes.CDLL(str(folder / "arm.so")), igm, [T], name="igm_all")
    assert status == 0
    np.testing.assert_allclose(found[0], np.array(igm(T)[0]).ravel(order="F"), atol=1e-12)


def test_what_does_not_fit_is_refused(functions, tmp_path):
    with pytest.raises(ModelError, match="leave real='float' out"):
        c_library(functions["crx"], tmp_path / "a", target="bare", real="float")
    with pytest.raises(ModelError, match="'arm_pose' is a name of C beside"):
        c_library({"arm_pose": functions["crx"]}, tmp_path / "a")
    assert not (tmp_path / "a").exists()
