import sys

import numpy as np
import pytest
from formats.test_urdf import ARM, INERTIAL

import mbs.models
from mbs.assembly import Tree
from mbs.components import Coupling, Fixed, Free, Prismatic, Revolute, Spherical
from mbs.components.joints import Motion
from mbs.errors import DescriptionError
from mbs.expressions import to_float
from mbs.formats import read_mjcf, read_urdf

mujoco = pytest.importorskip("mujoco")
full_inertia = pytest.importorskip("support.mujoco_inertia").full_inertia

TREE = """<mujoco model="a tree">
  <compiler angle="degree" eulerseq="zyx"/>
  <option gravity="0.3 -0.2 -9.7"/>
  <default><joint damping="0.3" armature="0.02"/><default class="x"><joint axis="1 0 0"/></default>
  </default>
  <asset><mesh name="m" file="nowhere.stl"/><material name="steel" texture="t"/>
    <texture name="t" type="2d" file="nowhere.png"/></asset>
  <worldbody>
    <geom type="plane" size="1 1 1" material="steel"/>
    <site name="origin" pos="0 0 1"/>
    <body name="arm.1" pos="0.1 0.2 0.3" euler="30 20 10">
      <joint name="turn" pos="0.1 0 0.2" axis="1 2 3" ref="25" range="-90 180"/>
      <joint name="slide" type="slide" class="x" ref="0.15" frictionloss="0"/>
      <joint name="swing" axis="0 1 0" pos="0 -0.1 0" limited="false" range="-1 1"/>
      <inertial pos=".1 .2 .1" mass="2" fullinertia=".3 .4 .35 .01 .02 .03"/>
      <geom type="mesh" mesh="m"/>
      <body name="hand" pos="0 0.3 0" quat="1 0.3 0.2 0.1">
        <geom type="capsule" size="0.05" fromto="0 0 0 0.3 0.1 0"/>
        <geom type="sphere" size="0.07" pos="0.3 0.1 0" material="steel"/>
        <site name="tip" pos="0.3 0.1 0" euler="10 20 30"/>
        <body name="ball" pos="0.3 0.1 0">
          <joint name="socket" type="ball"/><geom type="box" size=".1 .05 .02" pos=".1 0 .05"/>
        </body>
      </body>
      <frame pos="0.2 0 0" euler="0 0 40">
        <body name="rod"><joint pos="0 0 .1"/>
          <geom type="box" size=".3 .02 .04" pos=".3 0 0"/></body>
      </frame>
    </body>
    <body name="free body" pos="1 2 3" euler="10 20 30"><freejoint/>
      <inertial pos=".1 .2 .1" mass="2" diaginertia=".3 .4 .35" quat="1 1 0 0"/>
      <body name="wheel"><joint axis="0 1 0"/><geom type="cylinder" size="0.2 0.05"/></body>
    </body>
  </worldbody>
  <actuator><motor name="m1" joint="turn" gear="20"/></actuator>
  <sensor><jointpos joint="turn"/></sensor>
</mujoco>
"""
LOOP = """<mujoco><worldbody>
  <body name="a"><joint name="ja" axis="0 1 0" ref="5"/>
    <geom type="capsule" size=".03" fromto="0 0 0 0 0 .4"/>
    <body name="b" pos="0 0 .4"><joint name="jb" axis="0 1 0"/>
      <geom type="capsule" size=".03" fromto="0 0 0 1 0 0.2"/></body></body>
  <body name="c" pos=".8 0 0"><joint name="jc" axis="0 1 0"/>
    <geom type="capsule" size=".03" fromto="0 0 0 0.1 0 .9"/></body>
  <body name="d" pos="0 1 0"><joint name="jd" type="slide" ref=".1"/><geom size=".1"/></body>
  <body name="e" pos="0 2 0" euler="0 0 30"><freejoint name="je"/><geom size=".1"/></body>
</worldbody>
<equality>
  <connect name="close" body1="b" body2="c" anchor="1 0 .2"/>
  <weld body1="d" body2="e" anchor="0.1 0.2 0.3" relpose="0.5 0.4 0.3 1 0.2 0 0.1"/>
  <joint joint1="jd" joint2="ja" polycoef="0.1 0.5 0.2"/>
  <connect body1="a" body2="d" anchor="0 0 0" active="false"/>
</equality></mujoco>
"""


@pytest.fixture
def xml(tmp_path):
    def write(text):
        path = tmp_path / "model.xml"
        path.write_text(text)
        return path

    return write


def test_everything_that_moves_is_read(xml):
    m = read_mjcf(xml(TREE))
    assert m.name == "a_tree"
    assert [to_float(g) for g in m.world.gravity] == [0.3, -0.2, -9.7]
    joints = {joint.name: joint for joint in m.joints()}
    names = ["turn", "slide", "swing", "socket", "rod_joint", "free_body_joint", "wheel_joint"]
    assert list(joints) == names
    kinds = [Revolute, Prismatic, Revolute, Spherical, Revolute, Free, Revolute]
    assert [type(joint) for joint in joints.values()] == kinds
    bodies = ["arm_1", "arm_1_turn", "arm_1_slide", "hand", "ball", "rod", "free_body", "wheel"]
    assert sorted(body.name for body in m.bodies()) == sorted(bodies)
    assert np.allclose(dict(joints["turn"].limits)[""], [-np.pi / 2, np.pi])
    assert joints["swing"].limits == ()
    assert [joint.actuated for joint in joints.values()] == [True, *[False] * 6]
    assert (to_float(joints["turn"].Fv), to_float(joints["turn"].Ia)) == (0.3, 0.02)
    assert set(m.frames) == {"origin", "tip"}


def test_closures(xml):
    m = read_mjcf(xml(LOOP))
    assert m.cuts == ["close", "equality1"]
    assert isinstance(m.components["close"], Spherical)
    assert isinstance(m.components["equality1"], Fixed)
    (coupling,) = m.couplings()
    assert isinstance(coupling, Coupling)
    assert (coupling.driven, coupling.driver) == ("jd", "ja")
    assert all(joint.actuated in (None, False) for joint in m.joints())
    x, x0, y0 = 0.7, np.radians(5), 0.1
    y = sum(to_float(c) * x**k for k, c in enumerate(coupling.coefficients))
    assert np.isclose(y, y0 + 0.1 + 0.5 * (x - x0) + 0.2 * (x - x0) ** 2)


class Twin:
    """Our system and MuJoCo's model of the same file."""

    def __init__(self, system, model):
        self.system, self.model, self.data = system, model, mujoco.MjData(model)
        self.model.dof_frictionloss[:] = 0
        entries = [_joint_entry(model, link.name) for link in system.tree.links]
        self.q_at = [int(model.jnt_qposadr[k]) for k in entries]
        self.v_at = [int(model.jnt_dofadr[k]) for k in entries]

    def place(self, q):
        for link, at in zip(self.system.tree.links, self.q_at, strict=True):
            self.data.qpos[at : at + link.motion.nq] = q[link.q]
        mujoco.mj_kinematics(self.model, self.data)

    def rates(self, q, v, a):
        """MuJoCo's M, M v and d(M v)/dt: the linear velocity of a free joint is in the world."""
        M, bias = np.zeros((self.model.nv, self.model.nv)), np.zeros(self.model.nv)
        for link, at in zip(self.system.tree.links, self.v_at, strict=True):
            n = link.motion.nv
            M[at : at + n, link.v] = np.eye(n)
            if link.motion is Motion.FREE:
                R = np.zeros(9)
                mujoco.mju_quat2Mat(R, q[link.q][3:])
                R = R.reshape(3, 3)
                M[at : at + 3, link.v.start : link.v.start + 3] = R
                own = v[link.v]
                bias[at : at + 3] = R @ np.cross(own[3:], own[:3])
        return M, M @ v, M @ a + bias

    def inverse(self, q, v, a):
        self.model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.place(q)
        M, self.data.qvel[:], self.data.qacc[:] = self.rates(q, v, a)
        mujoco.mj_inverse(self.model, self.data)
        return M.T @ self.data.qfrc_inverse


def _joint_entry(model, name):
    plain = [_clean(model.joint(k).name) for k in range(model.njnt)]
    if name in plain:
        return plain.index(name)
    bodies = [_clean(model.body(k).name) for k in range(model.nbody)]
    return int(model.body_jntadr[bodies.index(name.removesuffix("_joint"))])


def _clean(name):
    return name.replace(" ", "_").replace(".", "_")


def random_state(system, rng):
    q, v, a = (rng.normal(size=n) for n in (system.nq, system.nv, system.nv))
    for link in system.tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            part = q[link.q]
            part[-4:] /= np.linalg.norm(part[-4:])
    return q, v, a


def assert_equal_motion(twin):
    system, rng = twin.system, np.random.default_rng(0)
    idm = mbs.models.inverse_dynamics(system)
    inertia = mbs.models.inertia_matrix(system)
    for _ in range(5):
        q, v, a = random_state(system, rng)
        expected = twin.inverse(q, v, a)
        tau = np.array(idm(q, v, a)).ravel()
        np.testing.assert_allclose(tau, expected, atol=1e-9 * max(1, np.abs(expected).max()))
        M, _, _ = twin.rates(q, v, a)
        full = full_inertia(twin.model, twin.data)
        np.testing.assert_allclose(np.array(inertia(q)), M.T @ full @ M, atol=1e-9)
        _assert_equal_places(twin, q)


def _assert_equal_places(twin, q):
    for k in range(1, twin.model.nbody):
        name = _clean(twin.model.body(k).name)
        if any(row.name == name for row in twin.system.bodies):
            T = np.array(mbs.models.transform(twin.system, name)(q))
            np.testing.assert_allclose(T[:3, 3], twin.data.xpos[k], atol=1e-10)
            np.testing.assert_allclose(T[:3, :3].ravel(), twin.data.xmat[k], atol=1e-10)


def _model_without_assets(text):
    spec = mujoco.MjSpec.from_string(text)
    for geom in list(spec.geoms):
        geom.material = ""
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            spec.delete(geom)
    for asset in [*spec.meshes, *spec.materials, *spec.textures]:
        spec.delete(asset)
    return spec.compile()


def test_mjcf_moves_as_in_mujoco(xml):
    system = read_mjcf(xml(TREE)).assemble()
    twin = Twin(system, _model_without_assets(TREE))
    assert_equal_motion(twin)
    q, *_ = random_state(system, np.random.default_rng(3))
    twin.place(q)
    T = np.array(mbs.models.transform(system, "tip")(q))
    site = twin.model.site("tip").id
    np.testing.assert_allclose(T[:3, 3], twin.data.site_xpos[site], atol=1e-10)
    np.testing.assert_allclose(T[:3, :3].ravel(), twin.data.site_xmat[site], atol=1e-10)


@pytest.mark.skipif(
    int(mujoco.__version__.split(".")[0]) < 4,
    reason="before 4.0 MuJoCo itself reads rotated inertias of URDF files otherwise",
)
def test_urdf_moves_as_in_mujoco(tmp_path):
    text = ARM.replace('<mimic joint="j 1" multiplier="2" offset="0.1"/>', "")
    start = text.index('<joint name="slip"')
    text = (
        text[:start]
        + """<joint name="slip" type="floating">
      <parent link="base"/><child link="puck"/></joint></robot>"""
    )
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace('friction=".2"', ""))
    extension = (
        '<mujoco><compiler fusestatic="false" discardvisual="true" boundmass="1e-9"'
        ' boundinertia="1e-9"/></mujoco></robot>'
    )
    text = path.read_text().replace("</robot>", extension).replace('"base"', '"world"')
    for part in ("visual", "collision"):
        start, end = text.index(f"<{part}>"), text.index(f"</{part}>") + len(f"</{part}>")
        text = text[:start] + text[end:]
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.gravity[:] = 0, 0, -9.81
    system = read_urdf(path).assemble()
    assert INERTIAL in ARM
    assert_equal_motion(Twin(system, model))


def test_closed_configuration_satisfies_mujoco(xml):
    system = read_mjcf(xml(LOOP)).assemble()
    twin = Twin(system, mujoco.MjModel.from_xml_string(LOOP))
    assert isinstance(system.tree, Tree)
    twin.place(np.array(system.configuration))
    mujoco.mj_forward(twin.model, twin.data)
    rows = twin.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert rows.sum() == 3 + 6 + 1
    np.testing.assert_allclose(twin.data.efc_pos[rows], 0, atol=1e-8)


BODY = '<worldbody><body name="b"><joint name="j" {}/><geom size=".1"/>{}</body></worldbody>'
PLAIN = BODY.format("", "")
TENDON = '<tendon><fixed name="t" {}><joint joint="j" coef="1"/></fixed></tendon>'
BAD = {
    "spring of a ball": (
        BODY.format('type="ball" stiffness="3"', ""),
        "ball or free joint 'j' has a spring (stiffness)",
    ),
    "tendon armature": (PLAIN + TENDON.format('armature="1"'), "tendon 't' has armature"),
    "path that pulls": (
        BODY.format("", '<site name="s"/><site name="p" pos="1 0 0"/>').replace(
            "<worldbody>", '<worldbody><site name="o"/>'
        )
        + '<tendon><spatial name="t" stiffness="2"><site site="o"/><site site="s"/>'
        '<site site="p"/></spatial></tendon>',
        "spatial tendon 't' pulls (stiffness, damping or frictionloss), and is more than a line",
    ),
    "spatial equality": (
        BODY.format("", '<site name="s"/><site name="p" pos="1 0 0"/>').replace(
            "<worldbody>", '<worldbody><site name="o"/>'
        )
        + '<tendon><spatial name="t"><site site="o"/><site site="s"/><site site="p"/></spatial>'
        '</tendon><equality><tendon name="e" tendon1="t"/></equality>',
        "equality 'e' is not linear, or ties spatial tendons",
    ),
    "unmet": (
        '<worldbody><body><joint name="j"/><geom size=".1"/><body><joint name="k"/>'
        '<geom size=".1"/></body></body></worldbody><equality><joint joint1="j" polycoef="-1"/>'
        '<joint name="e" joint1="j" joint2="k" polycoef="0 0 1 0 0"/></equality>',
        "equality 'e' is met at no position of 'k'",
    ),
    "fluid": ('<option density="1.2"/>' + PLAIN, "the medium has a density or viscosity"),
    "no mass": ("<worldbody><body><joint/></body></worldbody>", "mujoco refuses the file: "),
    "mesh": (
        '<asset><mesh name="m" file="none.stl"/></asset><worldbody><body><joint/>'
        '<geom type="mesh" mesh="m"/></body></worldbody>',
        "mujoco refuses the file: ",
    ),
    "same joint": (
        PLAIN.replace("</worldbody>", '<body><joint name="j"/><geom size="1"/></body></worldbody>'),
        "mujoco refuses the file: ",
    ),
    "unknown": ("<wordbody/>", "mujoco refuses the file: "),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_not_supported_is_refused(xml, case):
    content, message = BAD[case]
    with pytest.raises(DescriptionError) as error:
        read_mjcf(xml(f"<mujoco>{content}</mujoco>"))
    assert message in str(error.value)
    assert str(error.value).startswith(str(xml("")))
    assert "\n" not in str(error.value)


def test_bad_file_is_refused(xml, tmp_path):
    with pytest.raises(DescriptionError, match=r"model.xml: the file is not XML"):
        read_mjcf(xml("<mujoco>"))
    with pytest.raises(DescriptionError, match="read a URDF file with read_urdf"):
        read_mjcf(xml("<robot/>"))
    with pytest.raises(DescriptionError, match=r"none.xml: the file cannot be read"):
        read_mjcf(tmp_path / "none.xml")


def test_missing_mujoco_is_said(xml, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(DescriptionError, match=r'install "casadi-mbs\[import\]"'):
        read_mjcf(xml(TREE))


def test_of_a_servo_only_the_driven_joint_is_read(xml):
    text = """<mujoco><worldbody><body><joint name="a" armature=".1"/><geom size=".1"/>
      <body><joint name="b" damping="2"/><geom size=".1"/></body></body></worldbody>
    <actuator><position joint="a" kp="50" kv="3" gear="7" ctrlrange="-1 1"/></actuator></mujoco>"""
    joints = {joint.name: joint for joint in read_mjcf(xml(text)).joints()}
    assert [joint.actuated for joint in joints.values()] == [True, False]
    assert to_float(joints["a"].Ia) == 0.1
    assert to_float(joints["a"].Fv) == 0
    assert to_float(joints["b"].Fv) == 2


SPRINGS = """<mujoco><worldbody><body pos="0 0 1">
  <joint name="a" axis="1 2 0" stiffness="3" springref="40" ref="25" damping="0.2"/>
  <geom size=".1" pos=".2 0 0"/>
  <body pos=".3 0 0"><joint name="b" type="slide" axis="0 1 1" stiffness="20" springref="-.1"/>
    <geom size=".1" pos="0 .1 0"/></body>
</body></worldbody></mujoco>"""


def test_springs_of_joints(xml):
    system = read_mjcf(xml(SPRINGS)).assemble()
    assert_equal_motion(Twin(system, mujoco.MjModel.from_xml_string(SPRINGS)))
    stretched = mbs.models.gravity_effort(system)([0.9, 0.2])
    relaxed = mbs.models.gravity_effort(system)([np.deg2rad(40), -0.1])
    assert abs(float(stretched[1] - relaxed[1])) > 1
