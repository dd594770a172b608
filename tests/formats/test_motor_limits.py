"""Largest velocities and efforts of joints in files: TOML, URDF, MJCF."""

import dataclasses

import numpy as np
import pytest

import mbs
from mbs.components import Prismatic, Revolute
from mbs.errors import DescriptionError
from mbs.formats import from_dict, read_toml, to_dict, write_toml
from mbs.models import limits

TABLE = {
    "name": "arm",
    "frame": [
        {"antecedent": 0, "joint": "revolute", "velocity": 2.0, "effort": [-3.0, 5.0]},
        {"antecedent": 1, "joint": "prismatic", "alpha": 1.0, "effort": 40.0},
    ],
    "body": [{"frame": 1, "ZZ": 0.1}, {"frame": 2, "M": 2.0}],
}

URDF = """<robot name="r"><link name="world"/>
{}
</robot>"""
LINK = """<link name="{0}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j_{0}" type="{1}"><parent link="{2}"/><child link="{0}"/>{3}</joint>"""

MJCF = """<mujoco><worldbody><body><joint name="a" actuatorfrcrange="-3 5"/><geom size=".1"/>
<body><joint name="b"/><geom size=".1"/><body><joint name="c"/><geom size=".1"/>
<body><joint name="d"/><geom size=".1"/></body></body></body></body></worldbody>
<actuator><motor joint="a" gear="2" ctrlrange="-1 4" forcerange="-9 2"/>
<position joint="b" kp="3" forcerange="-7 7"/><motor joint="b" gear="-10" ctrlrange="-1 2"/>
<motor joint="c"/></actuator></mujoco>"""


def test_a_table_keeps_them(tmp_path):
    table = from_dict(TABLE)
    assert [row.effort for row in table.frames] == [(-3.0, 5.0), (-40.0, 40.0)]
    assert [to_dict(table)["frame"][k].get("velocity") for k in (0, 1)] == [2.0, None]
    assert to_dict(table)["frame"][0]["effort"] == [-3.0, 5.0]
    write_toml(table, tmp_path / "arm.toml")
    assert read_toml(tmp_path / "arm.toml") == table
    found = limits(mbs.load(str(tmp_path / "arm.toml")).assemble())
    np.testing.assert_array_equal(found.v_upper, [2, np.inf])
    np.testing.assert_array_equal(found.tau_lower, [-3, -40])
    np.testing.assert_array_equal(found.tau_upper, [5, 40])


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        ({"velocity": -1}, "arm/frame 1: velocity is -1; give the largest one"),
        ({"effort": [2, 3]}, "arm/frame 1: effort is .2, 3.; give the largest one"),
        ({"joint": "fixed", "effort": 3}, "a fixed frame has a motor or limits"),
    ],
)
def test_a_table_refuses(frame, message):
    with pytest.raises(DescriptionError, match=message):
        from_dict({"name": "arm", "frame": [{"antecedent": 0, **frame}]})


def test_urdf_gives_them_and_zero_says_nothing(tmp_path):
    limit = '<limit lower="-1" upper="1" velocity="{}" effort="{}"/>'
    links = (
        LINK.format("a", "revolute", "world", limit.format(2.5, 80)),
        LINK.format("b", "continuous", "a", limit.format(3, 12)),
        LINK.format("c", "prismatic", "b", limit.format(0, 0)),
    )
    (tmp_path / "r.urdf").write_text(URDF.format("".join(links)))
    joints = {joint.name: joint for joint in mbs.load(str(tmp_path / "r.urdf")).joints()}
    assert (joints["j_a"].velocity, joints["j_a"].effort) == ((-2.5, 2.5), (-80, 80))
    assert (joints["j_b"].velocity, joints["j_b"].effort) == ((-3, 3), (-12, 12))
    assert (joints["j_c"].velocity, joints["j_c"].effort) == (None, None)


def test_mjcf_gives_the_efforts_of_its_actuators(tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "r.xml").write_text(MJCF)
    joints = {joint.name: joint for joint in mbs.load(str(tmp_path / "r.xml")).joints()}
    assert joints["a"].effort == (-2, 4)  # the motor's (-1, 2) times its gear
    assert joints["b"].effort == (-27, 17)
    assert joints["c"].effort is None
    assert joints["d"].effort is None
    assert joints["a"].velocity is None


def test_actuators_with_several_controls_shift_no_others(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    if not hasattr(mujoco.mjtTrn, "mjTRN_SO3"):
        pytest.skip("actuators have one control before MuJoCo 4")
    (tmp_path / "r.xml").write_text(
        """<mujoco><worldbody><site name="ground"/><body name="a"><joint name="ball" type="ball"/>
        <geom size=".1"/><site name="s"/><body name="b" pos="1 0 0"><joint name="j"/>
        <geom size=".1" pos="0 .1 0"/><body name="c" pos="1 0 0"><joint name="free_running"/>
        <geom size=".1" pos="0 .1 0"/><body name="d" pos="1 0 0"><joint name="k"/>
        <geom size=".1" pos="0 .1 0"/></body></body></body></body></worldbody><actuator>
        <orientation joint="ball" input="quat"/><orientation site="s" refsite="ground"/>
        <dcmotor joint="k" motorconst="1" resistance="1" input="pos vel" controller="1 0 5"/>
        <motor joint="j" ctrlrange="-3 4" gear="2"/></actuator></mujoco>"""
    )
    mechanism = mbs.load(str(tmp_path / "r.xml"))
    joints = {joint.name: joint for joint in mechanism.joints()}
    assert joints["j"].effort == (-6, 8)
    actuated = {name: bool(joint.actuated) for name, joint in joints.items()}
    assert actuated == {"ball": True, "j": True, "free_running": False, "k": True}
    assert [note.element for note in mechanism.notes if "not on a joint" in note.text] == [
        "actuator 1"
    ]


def test_an_actuator_without_gear_gives_nothing(tmp_path):
    pytest.importorskip("mujoco")
    idle = '<motor joint="c" gear="0"/><motor joint="d" ctrlrange="-1 2"/>'
    (tmp_path / "r.xml").write_text(
        MJCF.replace('<motor joint="c"/>', idle + '<motor joint="d" gear="0"/>')
    )
    joints = {joint.name: joint for joint in mbs.load(str(tmp_path / "r.xml")).joints()}
    assert joints["c"].effort is None
    assert joints["d"].effort == (-1, 2)


def test_a_joint_is_made_again_from_its_own_fields():
    for joint in (Revolute("j", velocity=2, effort=(-1, 3)), Prismatic("s", effort=7.0)):
        assert dataclasses.replace(joint, name="k") == type(joint)(
            "k", velocity=joint.velocity, effort=joint.effort
        )
