"""The skeleton of a mechanism: points on joints, lines of links, axes."""

import casadi as ca
import numpy as np
import pytest
from support.configurations import near_assembled

import mbs
from mbs.components import Body, Box, Free, PointMass, Revolute, Spring
from mbs.errors import ModelError
from mbs.models.skeleton import link_outline, skeleton

SEED = 20261122
CATALOGUE = ("puma560", "four_bar", "sr400", "stewart_platform", "andrews_squeezer", "cart_pole")


@pytest.fixture(scope="module", params=CATALOGUE)
def robot(request):
    return mbs.load(request.param).assemble()


def placed(system, q):
    points, directions = skeleton(system).function(list(q))
    return np.array(points).T, np.array(directions).T


def test_joints_hold_links_together(robot):
    parts = skeleton(robot)
    assembled, _ = placed(robot, robot.configuration)
    opened, _ = placed(robot, near_assembled(robot, 0.5, SEED))
    for joint in parts.joints:
        a, b = joint.points
        if joint.kind in ("revolute", "universal", "spherical"):
            assert np.linalg.norm(assembled[a] - assembled[b]) < 1e-9
            if not joint.cut:
                assert np.linalg.norm(opened[a] - opened[b]) < 1e-12
    gaps = [
        np.linalg.norm(opened[j.points[0]] - opened[j.points[1]]) for j in parts.joints if j.cut
    ]
    assert bool(gaps) == robot.is_closed
    assert all(gap > 1e-3 for gap in gaps)


def test_lines_keep_their_length(robot):
    first, _ = placed(robot, robot.configuration)
    second, _ = placed(robot, near_assembled(robot, 0.5, SEED))
    lines = [line for link in skeleton(robot).links for line in link.segments]
    assert lines
    for a, b in lines:
        length = np.linalg.norm(first[a] - first[b])
        assert length > 0
        assert abs(np.linalg.norm(second[a] - second[b]) - length) < 1e-12


def test_points_of_a_link_move_with_it(robot):
    q = near_assembled(robot, 0.5, SEED)
    points, _ = placed(robot, q)
    for joint in skeleton(robot).joints:
        row = next(row for row in robot.joints if row.name == joint.name)
        for number, column, frame in zip(
            joint.links, joint.points, (row.frame_a, row.frame_b), strict=True
        ):
            T = np.array(mbs.models.transform(robot, number)(q))
            place = T @ [*np.array(ca.DM(frame[1].p)).ravel(), 1]
            assert np.abs(place[:3] - points[column]).max() < 1e-12


def test_axes_turn_and_slide_what_comes_after(robot):
    """Moving one coordinate turns the link about the axis, or shifts it along the axis."""
    parts, h = skeleton(robot), 1e-6
    q = near_assembled(robot, 0.5, SEED)
    points, directions = placed(robot, q)
    for joint in parts.joints:
        if joint.cut or len(joint.axes) != 1:
            continue
        (axis,) = joint.axes
        k = [c.joint for c in robot.coordinates].index(joint.name)
        n, origin = directions[axis.direction], points[joint.points[0]]
        assert abs(np.linalg.norm(n) - 1) < 1e-12
        after, _ = placed(robot, q + h * np.eye(robot.nq)[k])
        before, _ = placed(robot, q - h * np.eye(robot.nq)[k])
        link = next(link for link in parts.links if link.number == max(joint.links))
        for column in {column for segment in link.segments for column in segment}:
            rate = (after[column] - before[column]) / (2 * h)
            turned = np.cross(n, points[column] - origin) if axis.motion == "revolute" else n
            assert np.abs(rate - turned).max() < 1e-8


def test_a_pendulum_is_a_line_to_its_mass():
    m = mbs.Mechanism("pendulum", gravity=(0, 0, -9.81))
    bob = m.add(PointMass("bob", 2.0))
    m.connect(m.world, Revolute("j1", axis="y"), bob.at(0, 0, 0.7))
    system = m.assemble()
    parts = skeleton(system)
    (line,) = parts.links[1].segments
    points, _ = placed(system, [0.5])
    ends = points[list(line)]
    assert parts.links[1].mass_centre in line
    assert np.abs(np.ptp(ends, axis=0) - [0.7 * np.sin(0.5), 0, 0.7 * np.cos(0.5)]).max() < 1e-12
    assert parts.links[0].segments == ()


def test_a_free_body_has_no_line_and_a_spring_has_two_ends():
    m = mbs.Mechanism("hanging", gravity=(0, 0, -9.81))
    box = m.add(Box("box", length=1.0, mass=2.0))
    m.connect(m.world, Free("free"), box)
    m.add(Spring("rope", m.world.at(0, 0, 2), box.left, stiffness=100, length=1))
    system = m.assemble()
    parts = skeleton(system)
    (force,) = parts.forces
    assert (force.name, force.kind, force.links) == ("rope", "spring", (0, 1))
    q = list(system.configuration)
    q[:3] = [1, 2, 3]
    points, _ = placed(system, q)
    T = np.array(mbs.models.transform(system, "box")(q))
    assert np.abs(points[force.points[0]] - [0, 0, 2]).max() < 1e-12
    left = T[:3, :3] @ np.array(ca.DM(box.left.placement.pose({}).p)).ravel() + T[:3, 3]
    assert np.abs(points[force.points[1]] - left).max() < 1e-12


def test_symbols_in_the_geometry_are_inputs():
    m = mbs.Mechanism("arm", gravity=(0, 0, -9.81))
    a, b = (m.add(Box(n, length=0.5, mass=1.0)) for n in "ab")
    m.connect(m.world, Revolute("j1", axis="y"), a.left)
    m.connect(a.at(mbs.Parameter("L", 0.8), 0, 0), Revolute("j2", axis="y"), b.left)
    system = m.assemble()
    parts = skeleton(system)
    a = parts.joints[1].points[0]
    near = np.array(parts.function([0, 0], [0.8])[0])[:, a]
    far = np.array(parts.function([0, 0], [1.8])[0])[:, a]
    assert abs(np.linalg.norm(far - near) - 1) < 1e-12


def test_three_joints_make_a_polygon_and_others_hang_on_the_nearest():
    square = np.array([[0, 0, 1], [1, 1, 1], [1, 0, 1], [0, 1, 1], [3, 1, 1], [0.5, 0.5, 1]], float)
    lines = {frozenset(line) for line in link_outline(square, 4)}
    sides = {frozenset(s) for s in ((0, 2), (2, 1), (1, 3), (3, 0))}
    assert lines == sides | {frozenset((1, 4))}


def test_joints_in_line_make_a_line_and_equal_points_are_one():
    points = np.array([[2, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]], float)
    assert {frozenset(line) for line in link_outline(points, 4)} == {
        frozenset((1, 2)),
        frozenset((0, 2)),
    }
    assert link_outline(points[:1], 1) == []


def test_what_is_no_system_is_refused():
    with pytest.raises(ModelError, match="is not a System"):
        skeleton(mbs.Mechanism("none"))


def test_a_link_reaches_its_farthest_frame():
    """As a leg does its foot, which is welded to it; not its centre of mass."""
    m = mbs.Mechanism("leg", gravity=(0, 0, -9.81))
    calf = m.add(Body("calf", mass=1.0, com=(0.1, 0, 0), inertia=(1, 1, 1)))
    sensor, foot = (m.add(Body(name, mass=0.1)) for name in ("sensor", "foot"))
    m.connect(m.world, Revolute("j1", axis="y"), calf)
    m.connect(calf.at(0, 0, -0.1), sensor)
    m.connect(calf.at(0, 0, -0.5), foot)
    system = m.assemble()
    (line,) = skeleton(system).links[1].segments
    points, _ = placed(system, [0.3])
    T = np.array(mbs.models.transform(system, "foot")([0.3]))
    ends = sorted(points[list(line)].tolist(), key=np.linalg.norm)
    assert np.abs(ends[0]).max() < 1e-12
    assert np.abs(ends[1] - T[:3, 3]).max() < 1e-12
    assert abs(np.linalg.norm(ends[1]) - 0.5) < 1e-12
