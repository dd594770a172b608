"""Scenes: shapes on links, of every mechanism of the catalogue."""

import json

import numpy as np
import pytest
from support.configurations import near_assembled
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    Box,
    BoxPlaneContact,
    CapsuleCapsuleContact,
    CapsulePlaneContact,
    Custom,
    Cylinder,
    Free,
    PointMass,
    Prismatic,
    Revolute,
    Shape,
    SphereCapsuleContact,
    SpherePlaneContact,
    Spring,
    WheelPlaneContact,
    custom,
)
from mbs.errors import AssemblyError, ModelError
from mbs.models.geometry import terminal_frame
from mbs.models.skeleton import skeleton
from mbs.view.primitives import BallShape, BarShape, LabelShape, RingShape
from mbs.view.primitives import BoxShape as BoxShape
from mbs.view.primitives import CylinderShape as CylinderShape
from mbs.view.primitives import SpringShape as SpringShape

SEED = 20261122
CATALOGUE = mbs.robots.catalogue()


def numbers(value):
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, (list, tuple)):
        return [number for inner in value for number in numbers(inner)]
    return [value] if isinstance(value, (int, float)) else []


@pytest.mark.sweep
@pytest.mark.parametrize("name", CATALOGUE)
def test_every_mechanism_has_a_scene(name, assembled):
    system = assembled(name)
    scene = mbs.view.scene(system)
    plain = scene.as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == json.loads(json.dumps(plain))
    assert np.isfinite(numbers(plain)).all()
    links = len(system.links) + 1
    assert len(plain["links"]) == links
    assert len(plain["poses"]) == 12 * links
    for item in plain["primitives"]:
        ends = item["links"] if "links" in item else [item["link"]]
        assert all(0 <= link < links for link in ends)
    roles = {item["role"] for item in plain["primitives"]}
    known = {"link", "joint", "axis", "frame", "loop", "force", "base", "label", "link frame"}
    assert {"link", "frame", "link frame"} <= roles <= known
    assert ("loop" in roles) == bool(system.cuts)
    named = {item["text"] for item in plain["primitives"] if item["kind"] == "label"}
    assert named == {joint.name for joint in system.joints if joint.kind not in ("free", "fixed")}


@pytest.mark.sweep
@pytest.mark.parametrize("name", CATALOGUE)
def test_links_stand_where_the_models_say(name, assembled):
    system = assembled(name)
    scene = mbs.view.scene(system)
    q = near_assembled(system, 0.7, SEED)
    poses = np.array(scene.poses(q.tolist())).reshape(-1, 3, 4)
    assert np.array_equal(poses[0], np.eye(3, 4))
    for number in range(1, len(poses)):
        expected = np.array(mbs.models.transform(system, number)(q))[:3]
        assert np.abs(poses[number] - expected).max() < 1e-12
    rows = scene.motion(np.vstack([system.configuration, q]))
    assert np.array_equal(rows[1], poses.ravel())
    assert np.array_equal(rows[0], scene.poses())


@pytest.mark.parametrize("name", ["puma560", "four_bar", "stewart_platform"])
def test_shapes_stay_on_the_skeleton(name, assembled):
    system = assembled(name)
    scene = mbs.view.scene(system)
    q = near_assembled(system, 0.7, SEED)
    poses = np.array(scene.poses(q.tolist())).reshape(-1, 3, 4)
    parts = skeleton(system)
    points = np.array(parts.function(q)[0]).T
    wanted = [points[[a, b]] for link in parts.links for a, b in link.segments]
    bars = [bar for bar in scene.primitives if isinstance(bar, BarShape) and bar.role == "link"]
    placed = [
        np.array([bar.a, bar.b]) @ poses[bar.link, :, :3].T + poses[bar.link, :, 3] for bar in bars
    ]
    held = [any(np.abs(ends - line).max() < 1e-12 for ends in placed) for line in wanted]
    solids = sum(body.solid is not None for body in system.bodies)
    assert held.count(False) == (3 if name == "four_bar" else 0) == solids


@pytest.mark.parametrize("scale", [1e-3, 1.0, 100.0])
def test_sizes_follow_from_the_mechanism(scale):
    m = mbs.Mechanism("arm")
    upper, lower = (
        m.add(Body("upper", mass=1)),
        m.add(Body("lower", mass=1, com=(0.5 * scale, 0, 0))),
    )
    m.connect(m.world, Revolute("j1"), upper)
    m.connect(upper.at(scale), Revolute("j2"), lower)
    m.add_frame("tool", lower.at(scale))
    scene = mbs.view.scene(m.assemble())
    assert scene.size == pytest.approx(2 * scale, rel=1e-12)
    assert 1.0 * scale < scene.bounds.radius < 1.3 * scale
    cell = scene.floor.step / 10.0 ** np.floor(np.log10(scene.floor.step))
    assert min(abs(cell - nice) for nice in (1, 2, 5, 10)) < 1e-9
    radii = {item.radius / scale for item in scene.primitives if isinstance(item, BarShape)}
    assert max(radii) == pytest.approx(0.62 * 0.028 * 2, rel=1e-9)


def test_bodies_with_dimensions_are_drawn_as_they_are():
    m = mbs.Mechanism("pair", parameters={"L": 0.4})
    box = m.add(Box("box", length="L", width=0.05, height=0.02, density=1000))
    tube = m.add(Cylinder("tube", length=0.3, radius=0.04, inner_radius=0.03, density=1000))
    m.connect(m.world, Revolute("j1"), box.left)
    m.connect(box.right, Revolute("j2"), tube.left)
    system = m.assemble()
    (shape,) = (
        item
        for item in mbs.view.scene(system, parameters={"L": 0.7}).primitives
        if isinstance(item, BoxShape)
    )
    assert shape.size == (0.7, 0.05, 0.02)
    scene = mbs.view.scene(system)
    (round_,) = (i for i in scene.primitives if isinstance(i, CylinderShape) and i.role == "link")
    assert (round_.radius, round_.bore) == (0.04, 0.03)
    assert np.linalg.norm(np.subtract(round_.b, round_.a)) == pytest.approx(0.3, abs=1e-15)
    assert not [i for i in scene.primitives if isinstance(i, BarShape) and i.role == "link"]
    centre = np.array(scene.poses({"j1": 0.0})).reshape(-1, 3, 4)[1]
    pose = np.array(next(i for i in scene.primitives if isinstance(i, BoxShape)).pose)
    middle = centre[:, :3] @ pose.reshape(3, 4)[:, 3] + centre[:, 3]
    expected = np.array(mbs.models.transform(system, "box")(system.configuration, [0.4]))
    assert np.abs(middle - (expected @ [0.2, 0, 0, 1])[:3]).max() < 1e-12


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (0, -9.81, 0), (0, 0, 9.81), (0, 0, 0)])
def test_up_is_against_gravity_and_the_ground_below(gravity):
    m = mbs.Mechanism("pendulum", gravity=gravity)
    rod = m.add(Body("rod", mass=1, com=(0, 0, -1)))
    m.connect(m.world, Revolute("j1", axis="x"), rod)
    scene = mbs.view.scene(m.assemble())
    up = np.array(scene.up)
    expected = -np.array(gravity) / 9.81 if any(gravity) else np.array([0, 0, 1])
    assert np.array_equal(up, expected)
    lowest = min(0.0, float(up @ [0, 0, -1]))
    assert float(np.array(scene.floor.center) @ up) < lowest
    for view in scene.views.values():
        assert np.linalg.norm(view) == pytest.approx(1, abs=1e-12)
    assert np.array(scene.views["top"]) @ up > 0.99
    assert abs(np.array(scene.views["side"]) @ up) < 1e-12


def test_a_planar_mechanism_is_seen_from_the_front(assembled):
    views = mbs.view.scene(assembled("four_bar")).views
    assert np.allclose(views["front"], (0, 0, 1), atol=1e-12)
    assert np.array(views["iso"]) @ np.array(views["front"]) > 0.8


def test_wheels_springs_and_motors_are_told_apart(assembled):
    rings = [
        i
        for i in mbs.view.scene(assembled("whipple_bicycle")).primitives
        if isinstance(i, RingShape)
    ]
    assert sorted(round(ring.radius + ring.tube, 12) for ring in rings) == [0.3, 0.35]
    m = mbs.Mechanism("cart")
    cart, mass = m.add(Body("cart", mass=1)), m.add(PointMass("mass", mass=1))
    m.connect(m.world, Prismatic("x", axis="x"), cart)
    m.connect(cart, Prismatic("z", axis="z", actuated=False), mass)
    m.add(Spring("k", cart.frame, mass.at(0, 0, 1), stiffness=1.0))
    items = mbs.view.scene(m.assemble()).primitives
    (spring,) = (item for item in items if isinstance(item, SpringShape))
    assert (spring.role, spring.links) == ("force", (1, 2))
    boxes = {item.colour for item in items if isinstance(item, BoxShape)}
    assert boxes == {"active", "joint"}
    labels = [(item.text, item.row) for item in items if isinstance(item, LabelShape)]
    assert labels == [("x", 0), ("z", 1)]


def test_a_body_that_floats_has_a_size_from_its_inertia():
    m = mbs.Mechanism("stone")
    stone = m.add(Body("stone", mass=2, inertia=(0.02, 0.02, 0.02)))
    m.connect(m.world, Free("root"), stone)
    scene = mbs.view.scene(m.assemble())
    assert scene.size == pytest.approx(4 * np.sqrt(0.06 / 4), rel=1e-12)
    assert any(isinstance(item, BallShape) and item.role == "link" for item in scene.primitives)


def test_mistakes_are_told_in_a_sentence(assembled):
    with pytest.raises(ModelError, match="is not a System"):
        mbs.view.scene("four_bar")
    with pytest.raises(ModelError, match="there is no coordinate 'j9'"):
        mbs.view.scene(assembled("four_bar"), {"j9": 1.0})
    m = mbs.Mechanism("open")
    rod = m.add(Body("rod", mass=1, com=(0, 0, -1)))
    m.connect(m.world.at("L"), Revolute("j1", axis="x"), rod)
    with pytest.raises(ModelError, match="parameter 'L' has no value"):
        mbs.view.scene(m.assemble())


def test_two_roots_a_slide_and_massless_links():
    frames = [
        {"antecedent": 0, "joint": "revolute"},
        {"antecedent": 0, "joint": "prismatic", "d": 1},
        {"antecedent": 1, "joint": "revolute", "d": 0.5},
    ]
    body = {"frame": 1, "XX": 1, "YY": 1, "ZZ": 1, "M": 1}
    system = mbs.load({"name": "two_roots", "frame": frames, "body": [body]}).assemble()
    q = [0.3, 0.2, 0.1]
    poses = np.reshape(mbs.view.scene(system).poses(q), (-1, 3, 4))
    for link in (1, 2, 3):
        T = np.array(mbs.models.transform(system, link)(q))
        np.testing.assert_allclose(poses[link], T[:3], atol=1e-12)
    assert system.draw().svg.count("prismatic") == 1


def test_contacts_and_components_of_ones_own_are_drawn_at_their_frames():
    class Buoy(Custom):
        """A float as large as its parameter says."""

        point = custom.frame()
        r = custom.parameter("m", positive=True)

        def loads(self, at):
            """Up."""
            return {"point": custom.force((0, 0, 1))}

        def figures(self, at):
            """A red sphere."""
            return {"point": Shape("sphere", (at.r,), (1, 0, 0))}

    m = mbs.Mechanism("yard", gravity=(0, 0, -9.81), parameters={"r": 0.2})
    bodies = [m.add(Body(f"b{k}", mass=1.0, inertia=(0.1, 0.1, 0.1))) for k in range(5)]
    for k, body in enumerate(bodies):
        m.connect(m.world.at(k, 0, 1), Free(f"f{k}"), body)
    given = {"stiffness": 1e4}
    m.add(SpherePlaneContact("ball", bodies[0].at(0, 0, 0.3), m.world, radius="r", **given))
    m.add(BoxPlaneContact("box", bodies[1], m.world, size=("r", 0.3, 0.4), **given))
    m.add(CapsulePlaneContact("pill", bodies[2], m.world, radius=0.1, length=0.5, **given))
    m.add(WheelPlaneContact("wheel", bodies[3], m.world, radius=0.3, rim=0.05, **given))
    m.add(SpherePlaneContact("point", bodies[3], m.world, **given))
    m.add(Buoy("buoy", bodies[4], r="2*r"))
    system = m.assemble()
    scene = mbs.view.scene(system, parameters={"r": 0.25})
    drawn = [one for one in scene.primitives if one.role == "force" and one.link]
    ball, box, pill, wheel, buoy = drawn
    assert isinstance(ball, BallShape)
    assert ball.radius == 0.25
    assert ball.at == pytest.approx((0, 0, 0.3))
    assert isinstance(box, BoxShape)
    assert box.size == (0.25, 0.3, 0.4)
    assert isinstance(pill, BarShape)
    assert [*pill.a, *pill.b, pill.radius] == pytest.approx([0, 0, -0.25, 0, 0, 0.25, 0.1])
    assert np.ptp(np.reshape(wheel.points, (-1, 3)), axis=0) == pytest.approx(
        [0.7, 0.1, 0.7], rel=0.05
    )
    assert (buoy.radius, buoy.colour) == (0.5, "#ff0000")
    assert "visual" not in {one.role for one in scene.primitives}


def test_both_bodies_of_a_contact_are_drawn():
    m = mbs.Mechanism("pair", gravity=(0, 0, -9.81))
    bodies = [m.add(Body(f"b{k}", mass=1.0, inertia=(0.1, 0.1, 0.1))) for k in range(4)]
    for k, body in enumerate(bodies):
        m.connect(m.world.at(k, 0, 1), Free(f"f{k}"), body)
    pill = {"radius": 0.2, "capsule_radius": 0.1, "length": 0.5, "stiffness": 1e4}
    m.add(SphereCapsuleContact("one", *bodies[:2], **pill))
    pills = {"radius_a": 0.1, "length_a": 0.4, "radius_b": 0.2, "length_b": 0.6}
    m.add(CapsuleCapsuleContact("two", *bodies[2:], stiffness=1e4, **pills))
    scene = mbs.view.scene(m.assemble())
    ball, *capsules = [one for one in scene.primitives if one.role == "force" and one.link]
    assert ball.radius == 0.2
    assert [one.radius for one in capsules] == [0.1, 0.1, 0.2]
    assert [one.b[2] for one in capsules] == pytest.approx([0.25, 0.2, 0.3])


@pytest.mark.parametrize(
    ("figures", "parts"),
    [
        (lambda self, at: {"pint": Shape("sphere", (1,))}, ["'pint'", "is no frame", "point"]),
        (lambda self, at: {"point": 3}, ["'point'", "is 3", "give a Shape"]),
        (lambda self, at: {"point": Shape("sphere", (-1,))}, ["sphere: size is", "above zero"]),
        (lambda self, at: {"point": 1 / 0}, ["figures raises ZeroDivisionError"]),
    ],
)
def test_figures_are_refused_where_the_mechanism_is_assembled(figures, parts):
    class Thing(Custom):
        """A thing."""

        point = custom.frame()

        def loads(self, at):
            """Up."""
            return {"point": custom.force((0, 0, 1))}

    Thing.figures = figures
    m = mbs.Mechanism("m")
    body = m.add(Body("b", mass=1.0))
    m.connect(m.world, Prismatic("x"), body)
    m.add(Thing("thing", body))
    refused(AssemblyError, *parts, by=m.assemble)


def test_a_picture_needs_values_of_lengths_only():
    described = {
        "name": "symbolic",
        "gravity": [0, "G", 0],
        "frame": [{"antecedent": 0}, {"antecedent": 1, "d": "L"}],
        "body": [{"frame": 1, "M": "M1"}, {"frame": 2, "M": "M2", "MX": "MX2"}],
    }
    system = mbs.load(described).assemble()
    with pytest.raises(ModelError, match="'L' has no value"):
        mbs.view.scene(system)
    drawn = mbs.view.scene(system, [0.0, 0.0], parameters={"L": 0.4})
    assert drawn.parameters == {"L": 0.4}
    assert drawn.up == (0.0, 0.0, 1.0)
    rows = np.reshape(drawn.poses([np.pi / 2, 0.0]), (3, 3, 4))
    np.testing.assert_allclose(rows[2, :, 3], [0, 0.4, 0], atol=1e-12)
    assert np.isfinite(drawn.motion(np.zeros((3, 2)))).all()


HUNG = {"position": (0.3, 0.0, 2.2), "rotation": ("x", "pi")}


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (0, 0, 0)])
def test_a_mounted_robot_is_drawn_above_the_ground_of_the_world(gravity):
    """Up and the ground are those of the outer world; sizes are those of the robot alone."""
    system = mbs.load("puma560", gravity=gravity, mount=HUNG).assemble()
    found, alone = mbs.view.scene(system), mbs.view.scene(mbs.load("puma560").assemble())
    np.testing.assert_allclose(found.up, [0, 0, -1], atol=1e-15)
    below = np.array(found.floor.center) @ found.up  # height of the ground relative to the base
    joint = found.size * 0.028
    assert -2.2 - 4 * joint - 1e-12 < below <= -2.2
    assert found.size == pytest.approx(alone.size)
    columns = [sum(item.role == "base" for item in one.primitives) for one in (found, alone)]
    assert columns == [0, 2]
    frames = [np.reshape(i.pose, (3, 4)) for i in found.primitives if i.role == "frame"]
    assert any(np.allclose(T[:, 3], [-0.3, 0, 2.2], atol=1e-12) for T in frames)


def test_the_frame_of_a_mount_is_no_tool(tmp_path):
    """Robots in a cell, and robots in files that were written with a mount, keep their tool."""
    cell = mbs.Mechanism("cell")
    placed = cell.add(mbs.load("puma560", mount=HUNG), "arm")
    cell.connect(cell.world, placed.point("outer_world"))
    assert terminal_frame(cell.assemble()) == 6
    path = tmp_path / "arm.xml"
    mbs.export.mjcf(mbs.load("puma560", mount=HUNG), path)
    assert terminal_frame(mbs.load(path).assemble()) == 6
