"""`mbs export` and `mbs convert`: files that are read and run again."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

import mbs

TABLE = """
name = "arm"
parameters = { L2 = 0.4 }
[[frame]]
antecedent = 0
[[frame]]
antecedent = 1
alpha = "pi/2"
d = "L2"
[[body]]
frame = 1
XX = 0.5
YY = 0.5
ZZ = 0.5
[[body]]
frame = 2
M = 2
MX = 0.3
XX = 0.1
YY = 0.2
ZZ = 0.2
"""
URDF = """
<robot name="two"><link name="base"/>
<link name="a"><inertial><mass value="2"/><origin xyz="0.2 0 0"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
<link name="b"><inertial><mass value="1"/><origin xyz="0.1 0 0.1"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<joint name="j1" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="j2" type="continuous"><origin xyz="0.5 0 0" rpy="0.3 0 0"/><parent link="a"/>
<child link="b"/><axis xyz="0 1 0"/></joint></robot>
"""


def efforts(robot: str) -> np.ndarray:
    """tau of the inverse dynamic model at an irregular state, (n,)."""
    system = mbs.load(robot).assemble()
    n, m = system.nq, len(system.independent)
    q = mbs.loops.solve(system, {}) if system.is_closed else np.linspace(0.3, 0.9, n)
    state = (q, np.linspace(1, 2, m), np.linspace(-1, 1, m))
    return np.array(mbs.models.inverse_dynamics(system)(*state)).ravel()


@pytest.mark.parametrize(
    ("name", "text"), [("arm.toml", TABLE), ("two.urdf", URDF)], ids=["table", "urdf"]
)
def test_a_round_trip_keeps_the_inverse_dynamics(command, tmp_path, name, text) -> None:
    (tmp_path / name).write_text(text)
    for source, target in ((name, "x.par"), ("x.par", "y.toml"), ("y.toml", "z.par")):
        answer = command("convert", source, target)
        assert (answer.code, answer.err) == (0, f"wrote {target}\n")
    for made in ("x.par", "y.toml", "z.par"):
        np.testing.assert_allclose(efforts(made), efforts(name), rtol=1e-12, atol=1e-12)


def test_symbols_of_a_table_stay_symbols_and_take_values(command, tmp_path) -> None:
    (tmp_path / "arm.toml").write_text(TABLE)
    command("convert", "arm.toml", "arm.par", "--parameter", "L2=0.7")
    [parameter] = mbs.load("arm.par").parameters()
    assert (parameter.name, parameter.default) == ("L2", 0.7)


def test_notes_of_a_file_are_said_beside_the_output(command) -> None:
    joints = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="b"/>'
        f'<child link="l{k}"/></joint>\n'
        for k in range(5)
    )
    Path("r.urdf").write_text(f'<robot name="r">\n<link name="b"/>{joints}</robot>')
    answer = command("convert", "r.urdf", "r.toml")
    assert "r.urdf: line 2: joint 'j0': it has no <limit>; taken as unlimited" in answer.err
    assert "r.urdf: and 2 notes more, see mechanism.notes" in answer.err
    assert answer.out == ""


@pytest.mark.parametrize("ending", ["sdf", "par", "xml", "toml"])
def test_shapes_that_are_left_out_are_said(command, ending) -> None:
    Path("r.urdf").write_text(
        '<robot name="r"><link name="b"/><link name="l"><inertial><mass value="1"/><inertia ixx="1"'
        ' iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><visual><geometry><box size="1 1 1"/>'
        '</geometry></visual></link><joint name="j" type="continuous"><parent link="b"/>'
        '<child link="l"/></joint></robot>'
    )
    answer = command("convert", "r.urdf", f"s.{ending}")
    note = f"s.{ending}: Shapes that are not in this file: 1, on j."
    assert (answer.code, answer.err) == (0, f"{note}\nwrote s.{ending}\n")


def test_notes_of_assembling_are_said(command) -> None:
    Path("wheel.toml").write_text(
        'name = "wheel"\n[[frame]]\nantecedent = 0\n'
        "[[body]]\nframe = 1\nXX = 1\nYY = 1\nZZ = 3\nM = 1\n"
    )
    answer = command("show", "wheel.toml")
    assert "body 'link1': the principal moments 1, 1, 3 kg m^2 break the triangle" in answer.err


def test_a_closed_robot_is_converted_to_sdf(command) -> None:
    command("convert", "sr400", "sr400.sdf")
    one, other = (mbs.load(name).assemble() for name in ("sr400", "sr400.sdf"))
    assert (one.nv, one.closure.mobility) == (other.nv, other.closure.mobility)


def test_a_robot_is_converted_to_urdf(command) -> None:
    command("convert", "puma560", "puma560.urdf")
    one, other = (mbs.load(name).assemble() for name in ("puma560", "puma560.urdf"))
    q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    M = [np.array(mbs.models.inertia_matrix(system)(q)) for system in (one, other)]
    assert M[1] == pytest.approx(M[0], abs=1e-12)


def test_a_closed_robot_of_the_catalogue_is_converted(command) -> None:
    command("convert", "four_bar", "four_bar.toml")
    command("export", "par", "four_bar", "four_bar.par")
    np.testing.assert_allclose(efforts("four_bar.toml"), efforts("four_bar"), rtol=1e-9)
    np.testing.assert_allclose(efforts("four_bar.par"), efforts("four_bar"), rtol=1e-9)


def test_a_model_file_of_mujoco_is_written(command) -> None:
    pytest.importorskip("mujoco")
    answer = command("convert", "puma560", "puma.xml")
    assert (answer.code, answer.err) == (0, "wrote puma.xml\n")
    np.testing.assert_allclose(efforts("puma.xml"), efforts("puma560"), rtol=1e-12, atol=1e-12)


def test_an_exported_fmu_runs_as_the_system_does(command) -> None:
    words = ("planar_2r", "planar_2r.fmu", "--output", "energy", "--stop-time", "0.2")
    answer = command("export", "fmu", *words)
    assert (answer.code, answer.err) == (0, "wrote planar_2r.fmu\n")
    result = mbs.simulate.fmu("planar_2r.fmu", 0.2, step=0.01)
    expected = mbs.simulate.run(mbs.load("planar_2r").assemble(), 0.2)
    for name in ("q1.q", "q2.q", "q1.v"):
        np.testing.assert_allclose(result[name], expected[name], atol=1e-6)
    assert "energy.kinetic" in result


def test_a_bare_fmu_has_no_heap(command) -> None:
    words = ("planar_2r", "planar_2r.fmu", "--solver", "rk4", "--bare")
    answer = command("export", "fmu", *words)
    assert (answer.code, answer.err) == (0, "wrote planar_2r.fmu\n")
    with zipfile.ZipFile("planar_2r.fmu") as archive:
        assert "sources/memory.c" not in archive.namelist()
        assert "#define MODEL_BARE" in archive.read("sources/model.h").decode()
    answer = command("export", "fmu", *words[:2], "--bare")
    assert answer.code != 0
    assert "use solver='rk4'" in answer.err


def test_c_source_is_a_folder_or_a_zip(command, tmp_path: Path) -> None:
    command("export", "c", "planar_2r", "arm", "--model", "idm", "--model", "inertia")
    header = (tmp_path / "arm" / "arm.h").read_text()
    assert "idm_eval(" in header
    assert "inertia_eval(" in header
    assert "ddm" not in header
    command("export", "c", "planar_2r", "arm.zip")
    names = zipfile.ZipFile(tmp_path / "arm.zip").namelist()
    assert "planar_2r/planar_2r.c" in names


def test_options_of_a_c_library_are_those_of_the_export(command, tmp_path: Path) -> None:
    system = mbs.load("planar_2r").assemble()
    models = {"idm": mbs.models.inverse_dynamics(system)}
    for words, options in (
        (("--bare", "--float"), {"target": "bare", "real": "float"}),
        (("--no-checked",), {"checked": False}),
        ((), {}),
    ):
        command("export", "c", "planar_2r", "arm", "--model", "idm", *words)
        mbs.export.c_library(models, tmp_path / "own" / "arm", **options)
        for file in ("arm.h", "arm.c"):
            made, own = (tmp_path / folder / "arm" / file for folder in ("", "own"))
            assert made.read_text() == own.read_text()
    answer = command("export", "c", "planar_2r", "arm", "--float")
    assert answer.code == 1
    assert "real='float' is for bare libraries" in answer.err


def test_texts_and_names_of_an_fmu_are_options(command) -> None:
    words = ("--author", "A. Author", "--model-version", "1.2", "--flange", "tool", "--reference")
    command("export", "fmu", "planar_2r", "arm.fmu", "--stop-time", "0.1", *words)
    with zipfile.ZipFile("arm.fmu") as archive:
        text = archive.read("modelDescription.xml").decode()
        assert any("ref" in name for name in archive.namelist())
    for part in ('author="A. Author"', 'version="1.2"', 'name="tool.fx"'):
        assert part in text


def test_a_picture_stands_alone(command, tmp_path: Path) -> None:
    command("export", "html", "four_bar", "p.html", "--q", "j1=0.5")
    text = (tmp_path / "p.html").read_text()
    assert "<html" in text
    assert 'src="http' not in text
    assert command("export", "html", "four_bar", "q.html").code == 0
    assert (tmp_path / "q.html").read_text() != text
