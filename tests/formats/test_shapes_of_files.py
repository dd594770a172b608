"""Shapes of URDF and MJCF files stand where pinocchio and MuJoCo put them."""

import pickle
import struct

import casadi as ca
import numpy as np
import pytest

import mbs
from mbs import Mechanism
from mbs.app.web.document.document import Document
from mbs.components import Fixed, Revolute, Shape
from mbs.errors import DescriptionError
from mbs.formats import read_urdf

URDF = """<robot name="seen">
<material name="steel"><color rgba="0.2 0.4 0.6 1"/></material>
<link name="base"><visual><origin xyz="0 0 .05"/><geometry><box size=".3 .2 .1"/></geometry>
<material name="steel"/></visual></link>
<link name="upper"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"
ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz=".1 .2 .3" rpy=".4 .5 .6"/><geometry><cylinder radius=".04" length=".5"/>
</geometry><material name="own"><color rgba="1 0 0 1"/></material></visual>
<visual><geometry><mesh filename="missing.stl"/></geometry></visual>
<collision><geometry><sphere radius="9"/></geometry></collision></link>
<link name="lower"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"
ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin rpy="0 1 0" xyz=".2 0 0"/><geometry><capsule radius=".03" length=".3"/></geometry>
</visual><visual><origin xyz="0 0 -.3"/><geometry><sphere radius=".06"/></geometry>
<material name="own"/></visual></link>
<link name="hand"><visual><origin xyz="0 .01 0" rpy="1 0 0"/><geometry><box size=".1 .2 .3"/>
</geometry></visual></link>
<link name="bumper"><collision><geometry><sphere radius="9"/></geometry></collision></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="1 2 3"/>
<origin xyz="0 0 .1" rpy=".1 .2 .3"/><limit lower="-2" upper="2" effort="9"
velocity="9"/></joint>
<joint name="j2" type="prismatic"><parent link="upper"/><child link="lower"/><axis xyz="0 1 1"/>
<origin xyz="0 .1 .4" rpy="0 .2 0"/><limit lower="-2" upper="2" effort="9"
velocity="9"/></joint>
<joint name="f" type="fixed"><parent link="lower"/><child link="hand"/>
<origin xyz=".1 0 -.3" rpy="0 0 2"/></joint>
<joint name="g" type="fixed"><parent link="lower"/><child link="bumper"/></joint></robot>"""
MJCF = """<mujoco><compiler angle="radian"/><asset><mesh name="m" file="block.stl" scale="1 2 .5"/>
<material name="red" rgba="1 0 0 1"/></asset><worldbody><geom type="plane" size="1 1 1"/>
<geom name="table" type="box" size=".1 .2 .3" pos="0 0 -.3" group="1"/>
<body name="a" pos="0 0 1"><joint name="j1" axis="1 2 3" pos=".1 0 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<frame pos=".1 .2 .3" euler=".1 .2 .3"><geom name="c" type="cylinder" size=".1 .2" pos="1 0 0"
material="red"/><geom name="mesh" type="mesh" mesh="m" pos=".1 .2 .3" euler=".3 .2 .1"/></frame>
<geom name="touch" type="sphere" size="9" group="3"/><geom name="no" size="9" rgba="1 1 1 0"/>
<body name="b" pos=".3 0 0"><joint name="j2" type="slide" axis="0 1 1"/>
<geom name="k" type="capsule" fromto="0 0 0 .1 .2 .3" size=".04" rgba="0 1 0 1"/>
<geom name="s" type="sphere" size=".07" pos="0 .1 0"/><geom name="e" type="ellipsoid"
size=".1 .2 .3" euler="0 .4 0"/><geom name="heavy" type="mesh" mesh="m" pos="0 0 .4"/>
</body></body></worldbody></mujoco>"""
Q = {"j1": 0.7, "j2": -0.3}
BLOCK = np.array([[0.0, 0, 0], [0.2, 0, 0], [0, 0.3, 0], [0, 0, 0.5]])


def write_stl(path):
    """A tetrahedron, as a binary STL file."""
    faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
    rows = [struct.pack("<12fH", 0, 0, 0, *BLOCK[list(face)].ravel(), 0) for face in faces]
    path.write_bytes(bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows))


def poses(system, q):
    """(4, 4) pose of every shape in the base frame."""
    links = np.array(mbs.view.scene(system).poses(q)).reshape(-1, 3, 4)
    found = []
    for row in system.shapes:
        X = np.array(ca.evalf(ca.densify(ca.horzcat(row.pose.R, row.pose.p))))
        T = np.vstack([links[row.link + 1], [0, 0, 0, 1]])
        found.append(T @ np.vstack([X, [0, 0, 0, 1]]))
    return found


def test_shapes_of_a_urdf_file_are_where_pinocchio_has_them(tmp_path):
    pin = pytest.importorskip("pinocchio")
    path = tmp_path / "seen.urdf"
    path.write_text(URDF)
    mechanism = mbs.load(path)
    system = mechanism.assemble()
    model = pin.buildModelFromUrdf(str(path))
    plain = tmp_path / "plain.urdf"  # pinocchio reads no file with a mesh that is missing
    mesh = '<visual><geometry><mesh filename="missing.stl"/></geometry></visual>'
    text = URDF.replace(mesh, "").replace("capsule", "cylinder")  # nor one with a capsule
    plain.write_text(text)
    geometry = pin.buildGeomFromUrdf(model, str(plain), pin.GeometryType.VISUAL)
    data, placed = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, placed, np.array(list(Q.values())))
    ours = poses(system, Q)
    theirs = {
        g.name: T.homogeneous for g, T in zip(geometry.geometryObjects, placed.oMg, strict=True)
    }
    names = ["base_0", "upper_0", "lower_0", "lower_1", "hand_0"]
    assert set(theirs) == set(names)
    for name, T in zip(names, ours, strict=True):
        assert np.abs(T - theirs[name]).max() < 1e-12  # rounding of lengths below 1 m
    assert [row.shape for row in system.shapes] == [
        Shape("box", (0.3, 0.2, 0.1), (0.2, 0.4, 0.6)),
        Shape("cylinder", (0.04, 0.5), (1, 0, 0)),
        Shape("capsule", (0.03, 0.3)),
        Shape("sphere", (0.06,), (1, 0, 0)),
        Shape("box", (0.1, 0.2, 0.3)),
    ]
    (note,) = [str(note) for note in mechanism.notes if "mesh" in note.element]
    assert "'missing.stl'" in note
    assert "not drawn" in note
    assert note.startswith("line 9: ")
    with pytest.raises(DescriptionError, match=r"missing\.stl"):
        mbs.load(path, strict=True)


def test_shapes_of_an_mjcf_file_are_where_mujoco_has_them(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "seen.xml"
    path.write_text(MJCF)
    write_stl(tmp_path / "block.stl")
    mechanism = mbs.load(path)
    assert not [note for note in mechanism.notes if "mesh" in note.element]
    system = mechanism.assemble()
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:] = list(Q.values())
    mujoco.mj_kinematics(model, data)
    names = ["table", "c", "mesh", "k", "s", "e", "heavy"]
    ours = dict(zip(names, zip(poses(system, Q), system.shapes, strict=True), strict=True))
    for name, (T, row) in ours.items():
        g = model.geom(name).id
        R, p = data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]
        if row.shape.kind == "mesh":
            # MuJoCo keeps single precision of the points, and moves them to their middle
            k = model.geom_dataid[g]
            first, count = model.mesh_vertadr[k], model.mesh_vertnum[k]
            theirs = model.mesh_vert[first : first + count] @ R.T + p
            points = BLOCK * row.shape.size @ T[:3, :3].T + T[:3, 3]
            assert row.shape.size == (1.0, 2.0, 0.5)
            assert max(np.linalg.norm(theirs - at, axis=1).min() for at in points) < 1e-6
        else:
            assert np.abs(T[:3, :3] - R).max() < 1e-9
            assert np.abs(T[:3, 3] - p).max() < 1e-9
    shapes = {name: row.shape for name, (_, row) in ours.items()}
    assert shapes["table"].size == (0.2, 0.4, 0.6)
    assert shapes["c"] == Shape("cylinder", (0.1, 0.4), (1, 0, 0))
    assert shapes["k"].kind == "capsule"
    assert np.allclose(shapes["k"].size, (0.04, np.sqrt(0.14)))
    assert shapes["k"].colour == (0, 1, 0)
    assert shapes["e"].size == (0.1, 0.2, 0.3)
    (tmp_path / "block.stl").unlink()
    light = MJCF.replace('<geom name="heavy" type="mesh" mesh="m" pos="0 0 .4"/>', "")
    path.write_text(light)
    mechanism = mbs.load(path)
    assert [shape.kind for _, shape in mechanism.shapes].count("mesh") == 0
    assert "'block.stl'" in str(mechanism.notes[-1])
    path.write_text(light.replace('scale="1 2 .5"', 'refpos="1 0 0"'))
    mechanism = mbs.load(path)
    assert [shape.kind for _, shape in mechanism.shapes].count("mesh") == 0
    assert "mesh 'm': not drawn" in str(mechanism.notes[-1])


def test_collisions_are_drawn_where_a_file_has_no_visuals(tmp_path):
    path = tmp_path / "touch.urdf"
    text = URDF.replace("<visual>", "<nothing>").replace("</visual>", "</nothing>")
    path.write_text(text)
    shapes = mbs.load(path).shapes
    assert [(point.owner.name, shape.kind) for point, shape in shapes] == [
        ("upper", "sphere"),
        ("bumper", "sphere"),
    ]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ('<sphere radius="-1"/>', "size is"),
        ('<sphere radius="x"/>', "radius"),
        ('<box size="1 2"/>', "size"),
        ("<cone/>", "no geometry"),
    ],
)
def test_a_visual_that_means_nothing_is_noted(tmp_path, wrong, says):
    path = tmp_path / "odd.urdf"
    path.write_text(URDF.replace('<sphere radius=".06"/>', wrong))
    mechanism = mbs.load(path)
    assert len(mechanism.shapes) == 4
    (note,) = [note for note in mechanism.notes if "visual" in note.element]
    assert note.element == "visual 2 of link 'lower'"
    assert says in note.text


def test_meshes_are_found_in_packages_and_nowhere_above_them(tmp_path):
    package, other = tmp_path / "arm_description", tmp_path / "far" / "hands"
    for folder in (package / "urdf", package / "meshes", other):
        folder.mkdir(parents=True)
    for file in (package / "meshes" / "a.stl", other / "b.stl", tmp_path / "secret.stl"):
        write_stl(file)
    names = {
        "package://arm_description/meshes/a.stl": package / "meshes" / "a.stl",
        "../meshes/a.stl": package / "meshes" / "a.stl",
        f"file://{other}/b.stl": other / "b.stl",
        "package://hands/b.stl": other / "b.stl",
        "package://arm_description/../secret.stl": None,
        "package://../secret.stl": None,
        "http://host/a.stl": None,
        "package://arm_description/meshes/a.png": None,
    }
    path = package / "urdf" / "arm.urdf"
    for name, file in names.items():
        path.write_text(URDF.replace("missing.stl", name))
        found = [s.mesh for _, s in mbs.load(path, packages={"hands": other}).shapes]
        kept = [mesh for mesh in found if mesh is not None]
        assert [mesh.resolve() for mesh in kept] == ([file.resolve()] if file else []), name


def test_an_upload_does_not_look_for_meshes(tmp_path):
    """It cannot even learn whether a file is there."""
    write_stl(tmp_path / "block.stl")
    for name in (str(tmp_path / "block.stl"), "package://tmp/block.stl"):
        text = URDF.replace("missing.stl", name)
        for other_files, count in ((True, 6), (False, 5)):
            path = tmp_path / "r.urdf"
            path.write_text(text)
            mechanism = read_urdf(path, other_files=other_files)
            if name.startswith("/") or not other_files:
                assert len(mechanism.shapes) == count
        system = Document.of_upload(text.encode(), ".urdf").system()
        assert [row.shape.kind for row in system.shapes].count("mesh") == 0
        assert len(system.shapes) == 5


def test_shapes_stay_on_their_bodies(tmp_path):
    """Through pickling, locked joints, and a mechanism in a mechanism."""
    path = tmp_path / "seen.urdf"
    path.write_text(URDF)
    system = mbs.load(path).assemble()
    expected = poses(system, Q)
    again = pickle.loads(pickle.dumps(system))
    for a, b in zip(poses(again, Q), expected, strict=True):
        assert np.abs(a - b).max() < 1e-14
    assert [row.shape for row in again.shapes] == [row.shape for row in system.shapes]
    locked = mbs.load(path, lock={"j1": Q["j1"]}).assemble()
    for a, b in zip(poses(locked, {"j2": Q["j2"]}), expected, strict=True):
        assert np.abs(a - b).max() < 1e-12
    outer = Mechanism("outer")
    inner = outer.add(mbs.load(path), name="arm")
    outer.connect(outer.world.at(1, 2, 3), inner.base)
    nested = outer.assemble()
    shift = np.array([1, 2, 3])
    for a, b in zip(poses(nested, {f"arm.{k}": v for k, v in Q.items()}), expected, strict=True):
        assert np.abs(a[:3, 3] - b[:3, 3] - shift).max() < 1e-12


def test_shapes_on_joints_move_when_these_are_locked():
    m = Mechanism("m")
    body = m.add(mbs.components.Body("b", mass=1, inertia=(1, 1, 1)))
    turn, other = Revolute("j1", axis="z"), Revolute("j2", axis="z")
    tip = m.add(mbs.components.Body("tip", mass=1, inertia=(1, 1, 1)))
    m.connect(m.world, turn, body)
    m.connect(body.at(1, 0, 0), other, tip)
    m.add_shape(turn.frame_b.at(0.5, 0, 0), Shape("sphere", (0.1,)))
    m.lock({"j1": np.pi / 2})
    assert isinstance(m.components["j1"], Fixed)
    (at,) = poses(m.assemble(), None)
    assert np.abs(at[:3, 3] - [0, 0.5, 0]).max() < 1e-12


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("cone", (1.0,)), "kind"),
        (("box", (1.0, 2.0)), "three sides|its sides"),
        (("sphere", (0.0,)), "above zero"),
        (("sphere", (float("nan"),)), "above zero"),
        (("mesh", (1, 1, 1), None, None), "give a file"),
        (("box", (1, 1, 1), None, "a.stl"), "nothing else"),
        (("mesh", (1, 1, 1), None, "a.png"), "another kind"),
        (("mesh", (1, 0, 1), None, "a.stl"), "not zero"),
        (("sphere", (1.0,), (2.0, 0, 0)), "colour"),
    ],
)
def test_shapes_that_nothing_has_are_refused(given, says):
    with pytest.raises(DescriptionError, match=says):
        Shape(*given)
    assert Shape("capsule", (1, 0)).size == (1.0, 0.0)
    assert Shape("mesh", (1, -1, 1), None, "a.STL").size == (1.0, -1.0, 1.0)
