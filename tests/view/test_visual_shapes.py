"""Links that are drawn as they look: boxes, balls, meshes and their colours, in all pictures."""

import struct
import sys

import numpy as np
import pytest

import mbs
from mbs import Mechanism
from mbs.components import Body, Revolute, Shape
from mbs.errors import ModelError
from mbs.view.drawing import drawing
from mbs.view.mesh_files import MOST_TRIANGLES, read_mesh, thin
from mbs.view.primitives import BallShape, BarShape, BoxShape, CylinderShape, MeshShape, rgb

TURN = [("z", 0.3), ("x", 0.4)]
OBJ = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
DAE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"
version="1.4.1"><asset><unit name="inch" meter="0.0254"/><up_axis>Y_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><newparam sid="s"><sampler2D>
<source>nowhere</source></sampler2D></newparam><technique sid="c"><phong/></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="9">
0 0 0 1 0 0 0 2 0</float_array><technique_common><accessor source="#a" count="3" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/>
</vertices><triangles count="1" material="m"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 1 2</p></triangles></mesh></geometry></library_geometries><library_visual_scenes>
<visual_scene id="w"><node id="n"><translate>0 0 5</translate><instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="m" target="#m"/></technique_common>
</bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


def ball(count):
    """Points and triangles of a sphere of radius 1."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, count), np.linspace(0, np.pi, count))
    points = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], -1).reshape(-1, 3)
    k = np.arange(count * count).reshape(count, count)
    a, b, c, d = (x.ravel() for x in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    return points, np.vstack([np.stack([a, d, c], 1), np.stack([a, c, b], 1)])


def arm(*shapes):
    """A link with shapes at a point that is turned, and a hand without any."""
    m = Mechanism("arm")
    upper, hand = (m.add(Body(name, mass=1, inertia=(1, 1, 1))) for name in ("upper", "hand"))
    m.connect(m.world, Revolute("j1", axis="y"), upper)
    m.connect(upper.at(0, 0, 1), Revolute("j2", axis="y"), hand)
    m.add_frame("tip", hand.at(0, 0, 0.5))
    for shape in shapes:
        m.add_shape(upper.at(0.1, 0.2, 0.3, rotation=TURN), shape)
    return m.assemble()


def placed(system, item, points):
    """Points of a primitive in the base frame."""
    pose = np.array(mbs.view.scene(system).poses({"j1": 0.7})).reshape(-1, 3, 4)[item.link]
    return np.array(points) @ pose[:, :3].T + pose[:, 3]


def expected(points):
    """Points in the frame of the shapes of `arm`, in the base frame at j1 = 0.7."""
    c, s = np.cos([0.3, 0.4, 0.7]), np.sin([0.3, 0.4, 0.7])
    Z = np.array([[c[0], -s[0], 0], [s[0], c[0], 0], [0, 0, 1]])
    X = np.array([[1, 0, 0], [0, c[1], -s[1]], [0, s[1], c[1]]])
    Y = np.array([[c[2], 0, s[2]], [0, 1, 0], [-s[2], 0, c[2]]])
    return (np.array(points) @ (Z @ X).T + [0.1, 0.2, 0.3]) @ Y.T


def test_every_kind_is_drawn_where_it_is():
    red = (1.0, 0.0, 0.2)
    system = arm(
        Shape("box", (0.1, 0.2, 0.3), red),
        Shape("cylinder", (0.05, 0.4)),
        Shape("capsule", (0.06, 0.5)),
        Shape("sphere", (0.07,)),
        Shape("ellipsoid", (0.1, 0.2, 0.3)),
    )
    scene = mbs.view.scene(system)
    box, cylinder, capsule, sphere, ellipsoid = (
        item for item in scene.primitives if item.role == "visual"
    )
    assert [type(item) for item in (box, cylinder, capsule, sphere, ellipsoid)] == [
        BoxShape,
        CylinderShape,
        BarShape,
        BallShape,
        MeshShape,
    ]
    assert box.colour == "#ff0033"
    assert np.abs(rgb(box.colour, "dark") - red).max() < 1e-12
    assert cylinder.colour == "link0"
    for item, length in ((cylinder, 0.4), (capsule, 0.5)):
        ends = placed(system, item, [item.a, item.b])
        assert np.abs(ends - expected([[0, 0, -length / 2], [0, 0, length / 2]])).max() < 1e-12
    assert np.abs(placed(system, sphere, sphere.at) - expected([0, 0, 0])).max() < 1e-12
    pose = np.array(box.pose).reshape(3, 4)
    assert np.abs(placed(system, box, pose[:, 3] + pose[:, 0]) - expected([1, 0, 0])).max() < 1e-12
    assert box.size == (0.1, 0.2, 0.3)
    points = np.reshape(ellipsoid.points, (-1, 3))
    assert np.abs(np.linalg.norm(points / [0.1, 0.2, 0.3], axis=1) - 1).max() < 1e-5
    assert scene.notes == ()
    center, radius = np.array(scene.bounds.center), scene.bounds.radius
    assert np.linalg.norm(np.array([0.1, 0.2, 0.3]) - center) < radius


def test_bars_are_below_the_shapes_of_a_link_alone():
    system = arm(Shape("sphere", (0.2,)))
    scene = mbs.view.scene(system)
    bars = {item.link: item.role for item in scene.primitives if isinstance(item, BarShape)}
    assert bars == {1: "skeleton", 2: "link"}
    plain = mbs.view.scene(arm())
    assert not {item.role for item in plain.primitives} & {"visual", "skeleton"}
    assert plain.hidden() == ("link frame", "label")
    assert scene.hidden() == ("link frame", "label", "skeleton", "joint", "axis", "frame")
    assert scene.hidden(["visual"]) == ("link frame", "label", "visual")
    assert scene.as_dict()["hidden"] == list(scene.hidden())
    # schematic drawings stay bars
    roles, without = ([s.role for s in drawing(each).strokes] for each in (system, arm()))
    assert roles == without


def test_shapes_are_painted_and_can_be_left_out(tmp_path):
    images = pytest.importorskip("PIL.Image", reason="pictures need matplotlib")
    system = arm(Shape("box", (0.4, 0.4, 0.4), (0.0, 1.0, 0.0)))

    def green(**look):
        mbs.view.show(system, path=tmp_path / "p.png", **look)
        pixels = np.asarray(images.open(tmp_path / "p.png").convert("RGB"), dtype=float)
        return float((pixels[..., 1] > 60 + pixels[..., [0, 2]].max(axis=-1)).mean())

    # the axes of frames are green, too
    assert green() > 0.01 > 20 * green(hidden=["visual"])
    page = mbs.view.show(system, hidden="visual", shown="label").html
    assert '"hidden": ["link frame", "visual"]' in page
    assert "#00ff00" in page
    with pytest.raises(ModelError, match="role"):
        mbs.view.show(system, hidden=["visuals"])


def test_many_triangles_are_thinned_out():
    points, triangles = ball(120)
    mesh = thin(points, triangles)
    assert mesh.of == len(triangles) > 10 * MOST_TRIANGLES
    assert MOST_TRIANGLES / 3 < len(mesh.triangles) <= MOST_TRIANGLES
    radii = np.linalg.norm(mesh.points[np.unique(mesh.triangles)], axis=1)
    assert np.abs(radii - 1).max() < 0.02  # a cell is about a twelfth of the radius wide
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    outwards = np.sum(np.cross(b - a, c - a) * (a + b + c), axis=1)
    assert (outwards > 0).mean() > 0.99
    few = thin(points[:4], np.array([[0, 1, 2], [0, 2, 3]]))
    assert len(few.triangles) == few.of == 2


def test_a_mesh_that_cannot_be_read_leaves_the_bars(tmp_path, monkeypatch):
    path = tmp_path / "a.obj"
    path.write_text(OBJ)
    monkeypatch.setitem(sys.modules, "trimesh", None)
    scene = mbs.view.scene(arm(Shape("mesh", (1, 1, 1), None, path)))
    (note,) = scene.notes
    assert "trimesh" in note
    assert "[meshes]" in note
    bars = {item.link: item.role for item in scene.primitives if isinstance(item, BarShape)}
    assert bars == {1: "link", 2: "link"}
    assert scene.hidden() == ("link frame", "label")


def test_meshes_are_read_as_their_files_have_them(tmp_path):
    pytest.importorskip("trimesh", reason="meshes are read by trimesh")
    obj, stl = tmp_path / "a.obj", tmp_path / "a.stl"
    obj.write_text("mtllib /etc/passwd\n" + OBJ)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=float)
    faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
    rows = [struct.pack("<12fH", 0, 0, 0, *corners[list(f)].ravel(), 0) for f in faces]
    stl.write_bytes(bytes(80) + struct.pack("<I", 4) + b"".join(rows))
    for path in (obj, stl):
        mesh = read_mesh(path)
        assert mesh.of == len(mesh.triangles) == 4
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        assert abs(np.sum(np.cross(a, b) * c) / 6 - 1.0) < 1e-12  # its volume, from outside
    system = arm(Shape("mesh", (0.1, -0.2, 0.3), None, obj))
    (item,) = (i for i in mbs.view.scene(system).primitives if isinstance(i, MeshShape))
    pose, points = np.array(item.pose).reshape(3, 4), np.reshape(item.points, (-1, 3))
    found = placed(system, item, points @ pose[:, :3].T + pose[:, 3])
    for corner in expected(corners * [0.1, -0.2, 0.3]):
        assert np.linalg.norm(found - corner, axis=1).min() < 1e-6  # six digits are kept
    (tmp_path / "broken.stl").write_bytes(b"solid nothing\nendsolid")
    (tmp_path / "broken.obj").write_bytes(b"\xff\x00 f 1 2 999\n" * 3)
    for name in ("broken.stl", "broken.obj", "missing.stl"):
        with pytest.raises(ModelError, match=r"read|triangles"):
            read_mesh(tmp_path / name)


def test_a_collada_file_has_a_unit_and_no_materials(tmp_path):
    """Axes are as written: tools of robots do not turn a file that says Y_UP."""
    pytest.importorskip("trimesh", reason="meshes are read by trimesh")
    pytest.importorskip("collada", reason="COLLADA files are read by pycollada")
    path = tmp_path / "a.dae"
    path.write_text(DAE)
    mesh = read_mesh(path)
    corners = 0.0254 * np.array([[0, 0, 5], [1, 0, 5], [0, 2, 5]])
    assert np.abs(mesh.points[mesh.triangles[0]] - corners).max() < 1e-9
