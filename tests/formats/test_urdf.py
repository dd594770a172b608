import numpy as np
import pytest

from mbs.components import Coupling, Free, Planar, Prismatic, Revolute
from mbs.errors import DescriptionError
from mbs.expressions import to_float
from mbs.formats import read_urdf

INERTIAL = """<inertial><origin xyz=".1 .2 .3" rpy=".1 .2 .3"/><mass value="2"/>
<inertia ixx=".3" iyy=".4" izz=".35" ixy=".01" ixz=".02" iyz=".03"/></inertial>"""
MESH = '<geometry><mesh filename="package://nowhere/none.stl"/></geometry>'
ARM = f"""<?xml version="1.0"?>
<robot name="my arm">
  <link name="base"/>
  <link name="l1">{INERTIAL}<visual>{MESH}</visual><collision>{MESH}</collision></link>
  <link name="l2">{INERTIAL}</link>
  <link name="finger">{INERTIAL}</link>
  <link name="tool.tip"/>
  <link name="puck">{INERTIAL}</link>
  <joint name="finger" type="prismatic">
    <parent link="l2"/><child link="finger"/><limit upper="0.1" effort="1" velocity="1"/>
    <mimic joint="j 1" multiplier="2" offset="0.1"/>
  </joint>
  <joint name="j 1" type="revolute">
    <parent link="base"/><child link="l1"/><origin xyz="0 0 1" rpy="0 .1 .2"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/><dynamics damping=".5" friction=".2"/>
  </joint>
  <joint name="j.2" type="continuous">
    <parent link="l1"/><child link="l2"/><origin xyz=".2 0 0"/>
  </joint>
  <joint name="t" type="fixed">
    <parent link="l2"/><child link="tool.tip"/><origin xyz="0 0 1"/>
  </joint>
  <joint name="slip" type="planar">
    <parent link="l2"/><child link="puck"/><axis xyz="0 0 1"/>
  </joint>
</robot>
"""


@pytest.fixture
def urdf(tmp_path):
    def write(text):
        path = tmp_path / "robot.urdf"
        path.write_text(text)
        return path

    return write


def test_everything_that_moves_is_read(urdf):
    m = read_urdf(urdf(ARM))
    assert m.name == "my_arm"
    joints = {joint.name: joint for joint in m.joints()}
    assert list(joints) == ["j_1", "j_2", "finger", "slip"]
    assert [body.name for body in m.bodies()] == ["l1", "l2", "finger_link", "tool_tip", "puck"]
    j1 = joints["j_1"]
    assert isinstance(j1, Revolute)
    assert j1.axis == (0, 1, 0)
    assert j1.limits == (("", (-1.0, 2.0)),)
    assert (to_float(j1.Fv), to_float(j1.Fs), j1.actuated) == (0.5, 0.2, True)
    assert joints["j_2"].limits == ()
    assert joints["j_2"].axis == (1, 0, 0)
    assert isinstance(joints["finger"], Prismatic)
    assert joints["finger"].actuated is False
    assert isinstance(joints["slip"], Planar)
    (mimic,) = m.couplings()
    assert isinstance(mimic, Coupling)
    assert (mimic.driven, mimic.driver) == ("finger", "j_1")
    assert [to_float(c) for c in mimic.coefficients] == [0.1, 2.0]


def test_root_with_mass_is_welded_to_the_world(urdf):
    m = read_urdf(urdf(f'<robot name="r"><link name="torso">{INERTIAL}</link></robot>'))
    assert [body.name for body in m.bodies()] == ["torso"]
    assert len(m.connections) == 1
    text = '<robot name="r"><link name="torso"/></robot>'
    m = read_urdf(urdf(text))
    assert list(m.bodies()) == []
    assert list(m.frames) == ["torso"]
    m = read_urdf(urdf(f'<robot name="r"><link name="world">{INERTIAL}</link></robot>'))
    assert list(m.bodies()) == []


def test_floating_base(urdf):
    text = f"""<robot name="r"><link name="world"/><link name="b">{INERTIAL}</link>
    <joint name="free" type="floating"><parent link="world"/><child link="b"/></joint></robot>"""
    (joint,) = read_urdf(urdf(text)).joints()
    assert isinstance(joint, Free)
    assert joint.actuated is False


def test_inertia_is_turned_into_the_axes_of_the_link(urdf):
    text = """<robot name="r"><link name="b"><inertial><origin rpy="0 0 1.5707963267948966"/>
    <mass value="1"/><inertia ixx="1" iyy="2" izz="2.5"/></inertial></link></robot>"""
    (body,) = read_urdf(urdf(text)).bodies()
    assert np.allclose([to_float(x) for x in body.inertia], [2, 0, 0, 1, 0, 2.5])


LINKS = '<link name="a"/><link name="b"/>'
JOINT = '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'
TYPED = '<joint name="j" type="{}"><parent link="a"/><child link="b"/>{}</joint>'
BAD = {
    "two roots": (LINKS, "the links have the roots 'a', 'b'; connect them as one tree"),
    "no root": (
        LINKS
        + JOINT
        + JOINT.replace('"j"', '"k"')
        .replace('"b"', '"c"')
        .replace('"a"', '"b"')
        .replace('"c"', '"a"'),
        "the links have no root but a cycle",
    ),
    "cycle": (
        LINKS
        + '<link name="c"/>'
        + JOINT.replace('"a"', '"c"')
        + JOINT.replace('"j"', '"k"')
        .replace('"a"', '"x"')
        .replace('"b"', '"c"')
        .replace('"x"', '"b"'),
        "link 'b' is in a cycle",
    ),
    "two parents": (
        LINKS + JOINT + JOINT.replace('"j"', '"k"'),
        "link 'b' is the child of joints 'j' and 'k'",
    ),
    "unknown parent": (
        LINKS + JOINT.replace('"a"', '"aa"'),
        "joint 'j': parent link 'aa' does not",
    ),
    "no child": (LINKS + JOINT.replace('<child link="b"/>', ""), "child link '' does not exist"),
    "no name": ("<link/>", "there is no <link>"),
    "no links": ("", "there is no <link>"),
    "type": (LINKS + TYPED.format("hinge", ""), "joint 'j': type 'hinge' is unknown"),
    "axis": (LINKS + TYPED.format("revolute", '<axis xyz="0 0"/>'), "xyz: '0 0' is not 3 finite"),
    "zero axis": (LINKS + TYPED.format("revolute", '<axis xyz="0 0 0"/>'), "zero length"),
    "nan": (LINKS + TYPED.format("fixed", '<origin xyz="0 nan 0"/>'), "is not 3 finite"),
    "code": (LINKS + TYPED.format("fixed", '<origin xyz="0 0 id(1)"/>'), "is not 3 finite"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_robot_is_refused(urdf, case):
    content, message = BAD[case]
    with pytest.raises(DescriptionError) as error:
        read_urdf(urdf(f'<robot name="r">{content}</robot>'))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_bad_file_is_refused(urdf, tmp_path):
    with pytest.raises(DescriptionError, match=r"robot.urdf: the file is not XML"):
        read_urdf(urdf("<robot><link"))
    with pytest.raises(DescriptionError, match="the root element is <mujoco>"):
        read_urdf(urdf("<mujoco/>"))
    with pytest.raises(DescriptionError, match=r"none.urdf: the file cannot be read"):
        read_urdf(tmp_path / "none.urdf")
