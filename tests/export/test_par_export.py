"""Mechanisms written as .par files and read back: the same models."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.random_trees import random_tree

import mbs
import mbs.models
from mbs import Mechanism
from mbs.app.tasks.exporting import toml
from mbs.components import (
    Body,
    Free,
    Revolute,
    Rotor,
    Spherical,
)
from mbs.errors import DescriptionError, ExportError, ModelError
from mbs.formats import FrameRow, InertiaRow, RobotTable, read_par, write_par


def efforts(system, q, v, a, names):
    """Efforts of the tree by the order of the given joints."""
    idm = mbs.models.inverse_dynamics(system, coordinates="tree")
    values = {p.name: p.default for p in system.parameters}
    assert all(value is not None for value in values.values())
    order = [[c.name for c in system.coordinates].index(name) for name in names]
    inputs = [np.zeros(system.nq) for _ in range(3)]
    for array, given in zip(inputs, (q, v, a), strict=True):
        array[order] = given
    return np.array(idm(*inputs)).ravel()[order]


def same_models(before, path):
    system = before.assemble() if isinstance(before, Mechanism) else before
    mbs.export.par(before, path)
    after = mbs.load(path).assemble()
    rng = np.random.default_rng(3)
    for _ in range(3):
        q, v, a = rng.uniform(-1, 1, (3, system.nq))
        ours = efforts(system, q, v, a, [c.name for c in system.coordinates])
        theirs = efforts(after, q, v, a, [f"q{j}" for j in range(1, system.nq + 1)])
        np.testing.assert_allclose(theirs, ours, atol=1e-11 * np.abs(ours).max())
    return system, after


@pytest.mark.parametrize("name", ["puma560", "stanford", "two_branch_tree", "sr400", "scara"])
def test_catalogue_robots_survive(name, tmp_path):
    same_models(catalogue_system(name), tmp_path / f"{name}.par")


@pytest.mark.parametrize("seed", range(4))
def test_random_trees_survive(seed, tmp_path):
    kinds = ("revolute", "prismatic", "universal", "cylindrical", "planar")
    same_models(random_tree(seed, 4, kinds).mechanism, tmp_path / "tree.par")


def test_symbols_stay_symbols(tmp_path):
    m = Mechanism("arm", parameters={"L2": 0.7, "A": 0.3, "M1": 2.0})
    first = m.add(
        Body("first", mass="M1", com=("L2/2", 0, 0), inertia=(0.1, 0.1, "M1*L2^2/12 + 0.1"))
    )
    second = m.add(Body("second", mass=1.0, com=(0, 0.2, 0.1), inertia=(0.2, 0.3, 0.4)))
    m.connect(m.world, Revolute("shoulder", axis="y", Fs=0.2, Fs_width=0.1), first)
    m.connect(
        first.at("L2", 0.1, 0), Revolute("elbow", axis="x", Ia="A", stiffness=3.0, rest=0.2), second
    )
    system, after = same_models(m, tmp_path / "arm.par")
    assert {p.name: p.default for p in after.parameters} == {"L2": 0.7, "A": 0.3, "M1": 2.0}
    text = (tmp_path / "arm.par").read_text()
    assert "M1*L2" in text.replace("L2*M1", "M1*L2")
    other = {"L2": 1.3, "A": 0.1, "M1": 0.5}
    q, v, a = np.random.default_rng(1).uniform(-1, 1, (3, 2))
    ours, theirs = (
        mbs.models.inverse_dynamics(s)(q, v, a, s.parameter_values(other)) for s in (system, after)
    )
    np.testing.assert_allclose(np.array(theirs), np.array(ours), rtol=1e-12)


def slider(length, height, Fv="sqrt(L*L)"):
    """A turntable with a slide, whose length along the axis cancels."""
    m = Mechanism("slider", parameters={"L": -0.4, "M2": 0.3})
    m.add(Body("ballast", mass="(M2 + L)^2", com=(0, 0, 1), inertia=(1, 1, 1)))
    m.connect(m.world, m.components["ballast"])
    table = m.add(Body("table", mass=2.0, com=(0.1, 0, 0), inertia=(0.1, 0.2, 0.3)))
    block = m.add(Body("block", mass=1.0, com=(0.1, 0.2, 0.3), inertia=(0.1, 0.2, 0.3)))
    m.connect(m.world.at(0, 0, length), Revolute("j1", axis="z", Fv=Fv), table)
    m.connect(table.at(0.2, 0, height), Revolute("j2", axis="x"), block)
    return m


@pytest.mark.parametrize(
    ("length", "height", "Fv", "left"),
    [
        ("L", "-L", 0.1, set()),
        ("L - L + M2", 0.1, 0.0, set()),
        ("L", "L - L + M2", "sqrt(L*L)", {"L", "M2"}),
        (0.0, "sqrt(M2^2)", "sqrt((L - M2)^2)/2", {"L", "M2"}),
        (0.0, "atan2(M2, L)", "tan(L)^2/cos(M2)", {"L", "M2"}),
    ],
)
def test_symbols_that_cancel_and_roots_of_squares(length, height, Fv, left, tmp_path):
    system, after = same_models(slider(length, height, Fv), tmp_path / "slider.par")
    assert left <= {p.name for p in after.parameters} <= {"L", "M2"}
    (tmp_path / "slider.toml").write_bytes(toml(system))
    again = mbs.load(tmp_path / "slider.toml").assemble()
    q, v, a = np.random.default_rng(4).uniform(-1, 1, (3, 2))
    for p in ({}, {"L": 0.7, "M2": -0.9}):
        ours, *theirs = (
            mbs.models.inverse_dynamics(s)(q, v, a, *values)
            for s in (system, after, again)
            for values in [[s.parameter_values({k: x for k, x in p.items() if k in names(s)})]]
        )
        for other in theirs:
            np.testing.assert_allclose(np.array(other), np.array(ours), rtol=1e-11, atol=1e-12)


def names(system):
    return [p.name for p in system.parameters]


def test_base_parameters_with_symbols_survive(tmp_path):
    """The values of a link belong to no body, and one of them is a symbol."""
    table = RobotTable(
        "grouped",
        (FrameRow(0, name="a"),),
        (InertiaRow(1, XX=-2.0, ZZ="Z", MX="3*Z", grouped=True),),
        parameters={"Z": 0.2},
    )
    system = mbs.formats.to_mechanism(table).assemble()
    write_par(table, tmp_path / "table.par")
    mbs.export.par(system, tmp_path / "system.par")
    (tmp_path / "system.toml").write_bytes(toml(system))
    for file in ("table.par", "system.par", "system.toml"):
        again = mbs.load(tmp_path / file).assemble()
        assert float(mbs.models.inertia_matrix(again)(0, 0.7)) == 0.7
    assert read_par(tmp_path / "table.par").bodies[0].grouped
    kept = RobotTable("kept", (FrameRow(0),), (InertiaRow(1, ZZ=1.0, grouped=True),))
    write_par(kept, tmp_path / "kept.par")
    assert "grouped" not in (tmp_path / "kept.par").read_text()


def test_messages_speak_of_the_file_that_is_written(tmp_path):
    m = Mechanism("m")
    m.connect(m.world, Spherical("j"), m.add(Body("b", mass=1.0, inertia=(1, 1, 1))))
    system = m.assemble()
    with pytest.raises(ModelError, match=r"a \.toml file has no spherical joint"):
        toml(system)
    with pytest.raises(ModelError, match=r"a \.par file has no spherical joint"):
        mbs.export.par(system, tmp_path / "m.par")


@pytest.mark.parametrize("name", ["q1", "th2", "t1", "theta1", "r1"])
def test_symbols_named_like_joint_variables(name, tmp_path):
    """Those of the variables in the file are refused, the others read as what they are."""
    m = Mechanism("m", parameters={name: 0.3})
    a, b = (m.add(Body(n, mass=1.0, inertia=(1, 1, 1))) for n in "ab")
    m.connect(m.world, Revolute("j1", axis="z"), a.at(0.1, 0, 0, rotation=("z", name)))
    m.connect(a.at(name, 0, 0), Revolute("j2", axis="x"), b)
    if name != "th2":
        same_models(m, tmp_path / "m.par")
        return
    with pytest.raises(DescriptionError, match="th2 has the name of a joint variable"):
        mbs.export.par(m, tmp_path / "m.par")


def test_closed_loops_keep_their_cuts_and_configuration(tmp_path):
    system = catalogue_system("four_bar")
    mbs.export.par(system, tmp_path / "four_bar.par")
    after = mbs.load(tmp_path / "four_bar.par").assemble()
    assert after.is_closed
    assert len(after.independent) == len(system.independent) == 1
    np.testing.assert_allclose(after.configuration, system.configuration, atol=1e-9)
    ours, theirs = (
        mbs.models.inverse_dynamics(s)(s.configuration, 0.7, -0.4) for s in (system, after)
    )
    np.testing.assert_allclose(float(theirs), float(ours), rtol=1e-9)


@pytest.mark.parametrize(("joint", "word"), [(Free("j"), "free"), (Spherical("j"), "spherical")])
def test_joints_that_the_format_does_not_have(joint, word, tmp_path):
    m = Mechanism("m")
    m.connect(m.world, joint, m.add(Body("b", mass=1.0, inertia=(1, 1, 1))))
    with pytest.raises(ModelError, match=f"m/j: a .par file has no {word} joint"):
        mbs.export.par(m, tmp_path / "m.par")
    assert not list(tmp_path.iterdir())


def test_rotors_on_moving_links_are_refused(tmp_path):
    m = Mechanism("m")
    joint = Revolute("j", axis="z", rotor=Rotor(inertia=1e-4, ratio=50))
    m.connect(m.world, joint, m.add(Body("b", mass=1.0, inertia=(1, 1, 1))))
    with pytest.raises(ModelError, match=r"m/j: no rotor is written to a \.par file"):
        mbs.export.par(m, tmp_path / "m.par")


def test_other_arguments_are_refused(tmp_path):
    with pytest.raises(ModelError, match="give a System or a Mechanism"):
        mbs.export.par(casadi.SX(1), tmp_path / "m.par")
    with pytest.raises(ExportError, match="not a path"):
        mbs.export.par(mbs.load("planar_2r"), 3)


MOUNT = {"position": (0.1, 0.2, 2.5), "rotation": [("x", "pi"), ("z", 0.3)]}


@pytest.mark.parametrize("robot", ["puma560", "five_bar"])
def test_the_mount_is_in_the_file(robot, tmp_path):
    system = mbs.load(robot, mount=MOUNT).assemble()
    mbs.export.par(system, tmp_path / "robot.par")
    again = mbs.load(tmp_path / "robot.par").assemble()
    found = [
        np.array(mbs.models.transform(s, "base", "outer_world")(s.configuration))
        for s in (system, again)
    ]
    np.testing.assert_allclose(found[0], found[1], atol=1e-15)
    assert found[0][2, 3] == 2.5


def test_a_mount_whose_symbols_have_no_value_is_named_in_the_file(tmp_path):
    path = tmp_path / "robot.par"
    mbs.export.par(mbs.load("planar_2r", mount={"position": (0, 0, "H")}), path)
    assert "The mount of the base has symbols without a value" in path.read_text()
    mbs.export.par(mbs.load("planar_2r", mount={"position": (0, 0, 1)}), path)
    assert "The mount" not in path.read_text()


def test_a_vector_that_is_no_pose_leaves_a_note(tmp_path):
    path = tmp_path / "robot.par"
    mbs.export.par(mbs.load("planar_2r", mount={"position": (0, 0, 1)}), path)
    text = path.read_text()
    assert "Z = {1,0,0,0," in text
    path.write_text(text.replace("Z = {1,0,0,0,", "Z = {1,0.5,0,0,"))
    mechanism = mbs.load(path)
    assert "outer_world" not in mechanism.assemble().frames
    (note,) = mechanism.notes
    assert str(note) == "vector Z: is no pose of the base in numbers; the base has no mount"
