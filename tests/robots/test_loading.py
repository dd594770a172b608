"""Arguments of `mbs.load`: the base, locked joints, strict reading, what is no robot file."""

import os

import numpy as np
import pytest

import mbs
from mbs.components import Free
from mbs.errors import DescriptionError

INERTIAL = """<inertial><origin xyz=".1 .2 .3"/><mass value="2"/>
<inertia ixx=".3" iyy=".4" izz=".35" ixy=".01" ixz=".02" iyz=".03"/></inertial>"""
LEG = f"""<robot name="leg"><link name="torso">{INERTIAL}</link>
<link name="thigh">{INERTIAL}</link><link name="shank">{INERTIAL}</link>
<joint name="hip" type="revolute"><parent link="torso"/><child link="thigh"/>
<origin xyz="0 .1 .2" rpy=".1 .2 0"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/>
<origin xyz="0 .1 .2"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
FREE = LEG.replace(
    '<link name="torso">',
    '<link name="world"/><joint name="float" type="floating"><parent link="world"/>'
    '<child link="torso"/></joint><link name="torso">',
)


@pytest.fixture
def file(tmp_path):
    def write(text, name="robot.urdf"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_a_free_base_is_that_of_pinocchio(file):
    pinocchio = pytest.importorskip("pinocchio")
    path = file(LEG)
    system = mbs.load(path, base="free").assemble()
    assert [c.name for c in system.coordinates] == [
        *(f"root_joint.{k}" for k in ("x", "y", "z", "qw", "qx", "qy", "qz")),
        *("hip", "knee"),
    ]
    assert [s.name for s in system.velocity_coordinates[:6]] == [
        f"root_joint.{k}" for k in ("vx", "vy", "vz", "wx", "wy", "wz")
    ]
    assert [s.actuated for s in system.velocity_coordinates] == [False] * 6 + [True] * 2
    model = pinocchio.buildModelFromUrdf(str(path), pinocchio.JointModelFreeFlyer())
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-1, 1, 9), *rng.uniform(-1, 1, (2, 8))
    q[3:7] /= np.linalg.norm(q[3:7])
    theirs = np.concatenate([q[:3], q[4:7], q[3:4], q[7:]])  # the quaternion's w is last there
    tau = pinocchio.rnea(model, model.createData(), theirs, v, a)
    ours = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    assert ours == pytest.approx(tau, rel=1e-11, abs=1e-11)


def test_the_base_as_the_file_says(file):
    assert [j.name for j in mbs.load(file(LEG)).joints()] == ["hip", "knee"]
    assert [j.name for j in mbs.load(file(LEG), base="fixed").joints()] == ["hip", "knee"]
    mechanism = mbs.load(file(FREE))
    assert isinstance(next(mechanism.joints()), Free)
    assert [j.name for j in mbs.load(file(FREE), base="free").joints()] == ["float", "hip", "knee"]


def test_a_free_root_is_locked_where_the_guess_has_it(file):
    """As the same leg welded to the world: the floating joint stands at zero."""
    fixed = mbs.load(file(FREE), base="fixed").assemble()
    welded = mbs.load(file(LEG)).assemble()
    state = ([0.3, 0.4], [0.5, 0.6], [0.7, 0.8])
    efforts = [np.array(mbs.models.inverse_dynamics(s)(*state)) for s in (fixed, welded)]
    assert efforts[0] == pytest.approx(efforts[1], rel=1e-13)


def test_locked_on_load(file):
    system = mbs.load(file(LEG.replace('"knee"', '"the knee"')), lock={"the knee": 0.4}).assemble()
    whole = mbs.load(file(LEG)).assemble()
    one = np.array(mbs.models.inverse_dynamics(system)([0.3], [0.5], [0.7]))
    two = np.array(mbs.models.inverse_dynamics(whole)([0.3, 0.4], [0.5, 0], [0.7, 0]))
    assert one[0, 0] == pytest.approx(two[0, 0], rel=1e-13)
    arm = mbs.load("puma560", lock={"q4": 0.1, "q5": 0.2, "q6": 0.3}).assemble()
    assert arm.nv == 3


def test_tables_have_no_base_that_could_be_free():
    with pytest.raises(DescriptionError, match="its base cannot be free, since no body of its own"):
        mbs.load("puma560", base="free")
    table = {"name": "arm", "frame": [{"antecedent": 0}], "body": [{"frame": 1, "ZZ": 1.0}]}
    with pytest.raises(DescriptionError, match="its base cannot be free"):
        mbs.load(table, base="free")
    assert mbs.load(table, base="fixed").assemble().nv == 1


def test_wrong_arguments_are_refused(file):
    with pytest.raises(DescriptionError, match="base is 'floating'; give 'fixed', 'free' or None"):
        mbs.load(file(LEG), base="floating")
    with pytest.raises(DescriptionError, match="lock is 'hip'; give a dict"):
        mbs.load(file(LEG), lock="hip")
    with pytest.raises(DescriptionError, match="'ankle' is no joint that could be locked"):
        mbs.load(file(LEG), lock={"ankle": 0})


def test_strict_loading_refuses_notes(file):
    path = file(LEG.replace('lower="-1" upper="1"', ""))
    assert len(mbs.load(path).notes) == 2
    with pytest.raises(DescriptionError, match="line 8: joint 'hip': its limits"):
        mbs.load(path, strict=True)
    mbs.load(file(LEG), strict=True)


@pytest.mark.parametrize("suffix", [".urdf", ".toml", ".par", ".xml"])
def test_pipes_folders_and_devices_are_refused(tmp_path, suffix):
    if suffix == ".xml":
        pytest.importorskip("mujoco")
    pipe = tmp_path / f"pipe{suffix}"
    os.mkfifo(pipe)
    device = tmp_path / f"device{suffix}"
    device.symlink_to("/dev/zero")
    folder = tmp_path / f"folder{suffix}"
    folder.mkdir()
    for path in (pipe, device, folder):
        with pytest.raises(DescriptionError, match="it is a folder, a pipe or a device"):
            mbs.load(path)


@pytest.mark.parametrize("mark", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("suffix", [".toml", ".par"])
def test_byte_order_marks_of_tables(tmp_path, suffix, mark):
    path = tmp_path / f"arm{suffix}"
    mbs.load("planar_2r")
    table = mbs.formats.from_dict(
        {"name": "arm", "frame": [{"antecedent": 0}], "body": [{"frame": 1, "ZZ": 1.0}]}
    )
    {".toml": mbs.formats.write_toml, ".par": mbs.formats.write_par}[suffix](table, path)
    path.write_bytes(path.read_text().encode(mark))
    assert mbs.load(path).name == "arm"


XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="1"/><xacro:arg name="tool" default="false"/>
<xacro:macro name="body" params="name"><link name="${name}"><inertial><mass value="$(arg mass)"/>
<inertia ixx="${0.1 + 0.2}" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
</xacro:macro>
<xacro:body name="a"/><xacro:body name="b"/>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>
<xacro:if value="$(arg tool)"><link name="tool"/><joint name="t" type="fixed">
<parent link="b"/><child link="tool"/></joint></xacro:if></robot>"""


def test_xacro_files(file):
    pytest.importorskip("xacrodoc")
    path = file(XACRO, "robot.urdf.xacro")
    plain = mbs.load(path)
    assert [body.name for body in plain.bodies()] == ["a", "b"]
    assert plain.notes == []
    given = mbs.load(path, xacro={"mass": 3, "tool": True}).assemble()
    assert [body.name for body in given.bodies] == ["b", "tool"]
    assert [body.mass for body in given.bodies] == [3, 0]
    with pytest.raises(DescriptionError, match=r"xacro cannot expand it: .*unknown_macro"):
        mbs.load(file(XACRO.replace("<xacro:if", "<xacro:unknown_macro/><xacro:if"), "x.xacro"))


def test_without_xacrodoc_a_sentence_says_what_to_install(file, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    with pytest.raises(DescriptionError, match=r"casadi-mbs\[xacro\]"):
        mbs.load(file(XACRO, "robot.xacro"))


def test_gravity_and_mount_of_every_format(tmp_path):
    """Efforts against the weight are those in the gravity that the base has in its own axes."""
    arm = mbs.load("puma560")
    mbs.export.par(arm, tmp_path / "p.par")
    mbs.export.urdf(arm, tmp_path / "p.urdf")
    mbs.export.sdf(arm, tmp_path / "p.sdf")
    mbs.formats.write_toml(mbs.formats.read_par(tmp_path / "p.par"), tmp_path / "p.toml")
    q, zero = np.linspace(0.2, 0.7, 6), np.zeros(6)

    def weight(source, **given):
        system = mbs.load(source, **given).assemble()
        return mbs.models.inverse_dynamics(system)(q, zero, zero).full().ravel()

    R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    expected = weight("puma560", gravity=R.T @ (1.0, 2.0, -9.0))
    assert np.abs(expected - weight("puma560")).max() > 1.0
    for name in ("p.par", "p.urdf", "p.sdf", "p.toml"):
        for mount in (R, ("z", "pi/2"), [("x", 0.3), ("x", -0.3), ("z", "pi/2")]):
            found = weight(tmp_path / name, gravity=(1, 2, -9), mount=mount)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gravity": 9.81}, "planar_2r, gravity: 9.81 has not three values"),
        ({"gravity": (0, 0, np.nan)}, "planar_2r, gravity, z: nan is not a finite number"),
        ({"mount": ("w", 1)}, "planar_2r, mount: rotation axis 'w' is not 'x', 'y' or 'z'"),
        ({"mount": -np.eye(3)}, "planar_2r, mount: rotation array"),
        ({"mount": (0, 0, 1)}, r"planar_2r, mount: rotation \(0, 0, 1\) is not a rotation"),
    ],
)
def test_impossible_gravity_and_mount(given, message):
    with pytest.raises(DescriptionError, match=message):
        mbs.load("planar_2r", **given)


def test_a_free_root_falls_along_the_gravity_of_its_mount(file):
    """Coordinates of the root are relative to the base, which is rotated."""
    system = mbs.load(file(LEG), base="free", gravity=(0, 0, -2), mount=("x", "pi/2")).assemble()
    q = np.array(system.configuration)
    assert q[:4].tolist() == [0, 0, 0, 1]
    a = mbs.models.direct_dynamics(system)(q, np.zeros(8), np.zeros(8)).full().ravel()
    np.testing.assert_allclose(a, [0, -2, *np.zeros(6)], rtol=0, atol=1e-12)
