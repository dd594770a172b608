"""URDF files that mbs writes: read again, the mechanism is the same to 1e-12."""

from dataclasses import replace

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.random_trees import random_tree
from support.written_files import assert_coupling_is_kept, assert_same_tree, names_of, written_arm

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Free,
    Revolute,
    Shape,
    Spherical,
)
from mbs.errors import ModelError
from mbs.expressions import to_float


def same(one, other, rng):
    """Every frame, the order of the coordinates, the matrices and poses."""
    assert names_of(other.coordinates) == names_of(one.coordinates)
    assert set(one.frames) <= set(other.frames)
    assert_same_tree(one, other, rng)


def again(system, tmp_path):
    path = tmp_path / "again.urdf"
    mbs.export.urdf(system, path)
    return mbs.load(path)


@pytest.mark.parametrize("name", ["puma560", "stanford", "scara", "rx90", "two_branch_tree"])
def test_robots_of_the_catalogue(tmp_path, name):
    system = catalogue_system(name)
    same(system, again(system, tmp_path).assemble(), np.random.default_rng(1))


@pytest.mark.parametrize("seed", range(8))
def test_random_trees(tmp_path, seed):
    rng = np.random.default_rng(seed)
    kinds = ("revolute", "prismatic", "universal", "cylindrical", "planar", "free")
    system = random_tree(seed, 5, kinds=kinds, aligned=bool(seed % 2)).mechanism.assemble()
    down = replace(system.tree, gravity=casadi.SX([0, 0, -9.81]))
    system = replace(system, tree=down, _cache={})
    same(system, again(system, tmp_path).assemble(), rng)


def test_what_a_file_says_is_kept(tmp_path):
    mechanism = again(written_arm(), tmp_path)
    assert mechanism.notes == []
    same(written_arm().assemble(), mechanism.assemble(), np.random.default_rng(2))
    j, s = mechanism.joints()
    assert j.limits == (("", (-1.0, 2.0)),)
    assert (j.velocity, j.effort) == ((-3.0, 3.0), (-40.0, 40.0))
    assert [to_float(x) for x in (j.Fv, j.Fs, j.Ia)] == [0.5, 0.2, 0.3]
    assert (s.limits, s.velocity, s.effort) == ((), None, None)
    assert {body.name for body in mechanism.bodies()} >= {"pedestal", "link", "slide", "tool"}


def test_pinocchio_reads_what_is_written(tmp_path):
    pytest.importorskip("pinocchio")
    from robot_files import compared

    path = tmp_path / "arm.urdf"
    mbs.export.urdf(written_arm(), path)
    outcome = compared(path, False, 20)
    assert (outcome.kind, outcome.text) == ("equal", "")


def test_a_coupling_of_degree_one_is_a_mimic(tmp_path):
    assert_coupling_is_kept(written_arm(), lambda mechanism: again(mechanism, tmp_path))


def test_what_urdf_cannot_say_is_refused(tmp_path):
    def refused(mechanism, message):
        with pytest.raises(ModelError) as error:
            mbs.export.urdf(mechanism, tmp_path / "x.urdf")
        assert message in str(error.value)

    refused(mbs.load("four_bar"), "closes a loop, which URDF cannot say")
    refused("puma560", "is a str; give a System or a Mechanism")
    ball = written_arm()
    ball.connect(ball.world, Spherical("ball"), ball.add(Body("b", mass=1, inertia=(1, 1, 1))))
    refused(ball, "ball is a spherical joint")
    sprung = Mechanism("m")
    body = sprung.add(Body("b", mass=1, inertia=(1, 1, 1)))
    sprung.connect(sprung.world, Revolute("j", stiffness=2.0), body)
    refused(sprung, "j has a rotor or a spring")
    symbol = Mechanism("m")
    body = symbol.add(Body("b", mass="M", inertia=(1, 1, 1)))
    symbol.connect(symbol.world, Free("f"), body)
    refused(symbol, "M has no value, and URDF files have no symbols")
    symbol = Mechanism("m", gravity=(0, 0, 0))
    symbol.connect(symbol.world, Free("f"), symbol.add(Body("b", mass=1, inertia=(1, 1, 1))))
    refused(symbol, "gravity is [0.0, 0.0, 0.0]")


def test_the_armature_of_a_free_joint_is_kept(tmp_path):
    file = tmp_path / "b.xml"
    file.write_text(
        '<mujoco><worldbody><body name="b"><joint name="f" type="free" armature="0.1"/>'
        '<geom size="0.1"/></body></worldbody></mujoco>'
    )
    system = mbs.load(file).assemble()
    mbs.export.urdf(system, tmp_path / "b.urdf")
    again = mbs.load(tmp_path / "b.urdf").assemble()
    q = np.array(system.configuration)
    M, other = (mbs.models.inertia_matrix(one)(q).full() for one in (system, again))
    assert M[0, 0] == pytest.approx(4 / 3 * np.pi + 0.1, abs=1e-12)
    np.testing.assert_allclose(np.diag(other), np.diag(M), rtol=0, atol=1e-12)


@pytest.mark.parametrize("writer", ["urdf", "mjcf", "sdf", "par"])
def test_shapes_that_are_left_out_are_noted_once(writer, tmp_path):
    m = mbs.Mechanism("m")
    body = m.add(Body("arm", 1.0, (0.1, 0, 0), (0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j"), body)
    for x in (0.1, 0.2):
        m.add_shape(body.at(x), Shape("sphere", (0.05,)))
    path = tmp_path / f"m.{'xml' if writer == 'mjcf' else writer}"
    getattr(mbs.export, writer)(m, path)
    assert path.read_text().count("Shapes that are not in this file: 2, on j.") == 1


def test_all_symbols_without_value_are_named(tmp_path):
    m = mbs.Mechanism("m")
    body = m.add(Body("arm", "M", ("L", 0, 0), (0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j"), body)
    text = r"m: M and L have no value, and URDF files have no symbols"
    with pytest.raises(ModelError, match=text):
        mbs.export.urdf(m, tmp_path / "m.urdf")
    text = r"parameters 'M' and 'L' have no value.*parameters=\{'M': 1.0, 'L': 1.0\}"
    with pytest.raises(ModelError, match=text):
        m.assemble().parameter_values()


def test_a_robot_that_hangs_is_written_in_the_world_of_its_mount(tmp_path):
    """The file's world is the frame of the mount: gravity points down in it."""
    mount = {"position": (0.1, 0.2, 2.5), "rotation": [("x", "pi"), ("z", 0.3)]}
    system = mbs.load("puma560", mount=mount).assemble()
    read = again(system, tmp_path).assemble()
    assert [float(g) for g in np.array(casadi.DM(read.tree.gravity)).ravel()] == [0, 0, -9.81]
    q, v, a = np.random.default_rng(3).uniform(-1, 1, (3, 6))
    expected = np.array(mbs.models.transform(system, "link6", "outer_world")(q))
    found = np.array(mbs.models.transform(read, "link6")(q))
    np.testing.assert_allclose(found, expected, atol=1e-14)
    efforts = [np.array(mbs.models.inverse_dynamics(s)(q, v, a)) for s in (system, read)]
    np.testing.assert_allclose(*efforts, atol=1e-11)
    assert "outer_world" not in read.frames


def test_free_joints_on_a_rotated_base_and_other_gravities_are_refused(tmp_path):
    m = Mechanism("m", mount=("x", "pi"))
    m.connect(m.world, Free("free"), m.add(Body("b", mass=1.0)))
    with pytest.raises(ModelError, match="m/free: a free joint on a rotated base"):
        mbs.export.urdf(m, tmp_path / "m.urdf")
    tilted = mbs.load("planar_2r", gravity=(1, 0, -9), mount=("x", "pi"))
    with pytest.raises(ModelError, match=r"gravity is .*give the robot a mount instead"):
        mbs.export.urdf(tilted, tmp_path / "m.urdf")
