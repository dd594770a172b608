"""The drawing of a mechanism in a plane, as SVG text and as an icon."""

import math
import struct
import xml.etree.ElementTree as ET
import zlib

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import Body, Box, Cylinder, Free, Revolute, Spring
from mbs.view.drawing import Drawing, Name, Stroke, drawing, hull, placed
from mbs.view.drawing_files import SIZE, icon, png, standalone, svg
from mbs.view.primitives import rgb

CLOSED = ("four_bar", "stewart_platform")


def pixels(data):
    """(rows, columns, 4) of a PNG file whose rows have no filter."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, content, parts = 8, b"", []
    while at < len(data):
        (size,) = struct.unpack(">I", data[at : at + 4])
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        (check,) = struct.unpack(">I", data[at + 8 + size : at + 12 + size])
        assert check == zlib.crc32(kind + body)
        parts.append(kind)
        if kind == b"IHDR":
            columns, rows, depth, colour = struct.unpack(">IIBB", body[:10])
            assert (depth, colour) == (8, 6)
        content += body if kind == b"IDAT" else b""
        at += 12 + size
    assert (parts[0], parts[-1]) == (b"IHDR", b"IEND")
    lines = np.frombuffer(zlib.decompress(content), np.uint8).reshape(rows, 1 + 4 * columns)
    assert np.all(lines[:, 0] == 0)
    return lines[:, 1:].reshape(rows, columns, 4)


@pytest.mark.parametrize("name", CLOSED)
def test_all_that_is_drawn_lies_in_the_picture(name):
    root = ET.fromstring(svg(drawing(catalogue_system(name)), name))
    width, height = (float(x) for x in root.get("viewBox").split()[2:])
    names = 0
    for element in root:
        if element.tag.endswith("text"):
            names += 1
            assert 0 <= float(element.get("x")) <= width
            assert 0 <= float(element.get("y")) <= height
        elif element.tag.endswith("path"):
            numbers = element.get("d").translate(str.maketrans("MLZ", "   ")).split()
            points = np.array(numbers, float).reshape(-1, 2)
            assert np.all((points >= 0) & (points <= [width, height]))
    assert names > 5


def test_an_icon_of_its_own_has_no_names():
    root = ET.fromstring(standalone(drawing(catalogue_system("four_bar")), "<four>").encode())
    assert not [e for e in root.iter() if e.tag.endswith("text")]
    assert [e.text for e in root.iter() if e.tag.endswith("title")] == ["<four>"]


def test_png_keeps_every_pixel():
    given = np.random.default_rng(3).integers(0, 256, (5, 9, 4)).astype(np.uint8)
    assert np.array_equal(pixels(png(given)), given)


def test_the_icon_of_a_robot_is_drawn_quickly_and_twice_the_same():
    system = catalogue_system("puma560")
    first = icon(drawing(system))
    assert first == icon(drawing(system))
    share = np.mean(pixels(first)[..., 3] > 0)
    assert 0.02 < share < 0.5


def middle_of(stroke):
    return np.mean(stroke.points, axis=0)


@pytest.mark.parametrize("name", CLOSED)
def test_joints_that_close_loops_stand_out(name):
    system = catalogue_system(name)
    drawn = drawing(system)
    closing = {label.text for label in drawn.names if label.colour == "loop"}
    assert set(", ".join(closing).split(", ")) == {j.name for j in system.joints if j.cut}
    assert any(s.role == "loop" and s.colour == "loop" for s in drawn.strokes)


def test_a_planar_mechanism_is_seen_in_its_plane():
    """Bars are as much longer than others as in the four-bar: 0.4, 0.9 and 1 m."""
    drawn = drawing(catalogue_system("four_bar"))
    bars = [np.array(s.points) for s in drawn.strokes if s.role == "link"]
    short, middle, long = sorted(np.linalg.norm(b[:, None] - b, axis=2).max() for b in bars)
    # round ends are 32-sided, 0.5 % off a circle of 1/30 of the length
    assert (long - short) / (middle - short) == pytest.approx(0.6 / 0.5, rel=2e-3)
    assert drawn.caption == "in the plane of the motion"
    assert drawing(catalogue_system("scara")).caption == "seen from above at an angle"


@pytest.mark.parametrize(
    ("axis", "gravity", "q"),
    [("z", (0, -9.81, 0), -math.pi / 2), ("y", (0, 0, -9.81), math.pi / 2)],
)
def test_down_is_down(axis, gravity, q):
    """A bar that hangs is drawn below its joint, whatever axis it turns about."""
    m = mbs.Mechanism("bar", gravity=gravity)
    bar = m.add(Body("bar", mass=1.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j1", axis=axis), bar)
    drawn = drawing(m.assemble(), [q])
    (joint,) = (s for s in drawn.strokes if s.role == "joint" and s.bright == 1.0)
    (mass,) = (s for s in drawn.strokes if s.role == "mass")
    (x0, y0), (x1, y1) = middle_of(joint), middle_of(mass)
    assert abs(x1 - x0) < 1e-9
    assert y0 - y1 > 50


def test_up_is_up_in_a_view_at_an_angle():
    drawn = drawing(catalogue_system("puma560"))
    up = next(s for s in drawn.strokes if s.colour == "axes.2")
    (x0, y0), (x1, y1) = up.points
    assert abs(x1 - x0) < 1e-9
    assert y1 > y0


def test_solids_have_their_sides_and_cylinders_their_bore():
    m = mbs.Mechanism("solids", gravity=(0, 0, -9.81))
    box = m.add(Box("box", length=1.0, width=0.2, height=0.3, mass=1.0))
    tube = m.add(Cylinder("tube", length=1.0, radius=0.2, inner_radius=0.1, mass=1.0))
    m.connect(m.world, Revolute("j1", axis="z"), box.left)
    m.connect(box.right, Revolute("j2", axis="y"), tube.left)
    links = [s for s in drawing(m.assemble()).strokes if s.role == "link"]
    sides = [s for s in links if s.colour == "link0"]
    assert [len(s.points) for s in sides] == [4, 4, 4]
    assert len({s.bright for s in sides}) == 3
    ends = {s.bright: np.ptp(s.points, axis=0).max() for s in links if s.colour == "link1"}
    assert sorted(ends) == [0.5, 1.0, 1.12]
    assert ends[0.5] == pytest.approx(ends[1.12] / 2, rel=1e-9)


def test_a_floating_body_on_a_spring_is_drawn():
    m = mbs.Mechanism("hanging", gravity=(0, 0, -9.81))
    box = m.add(Body("box", mass=2.0, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Free("free"), box)
    m.add(Spring("rope", m.world.at(0, 0, 2), box, stiffness=100, length=1))
    drawn = drawing(m.assemble())
    assert [s.role for s in drawn.strokes].count("force") == 1
    assert [s.role for s in drawn.strokes].count("base") == 5  # hatches where the spring ends
    assert any(s.role == "link" and s.closed for s in drawn.strokes)
    assert {label.text for label in drawn.names} == {"box", "rope"}
    left, lower, right, upper = drawn.bounds()
    assert 95 < max(right - left, upper - lower) < 115


def test_names_at_one_point_share_a_label_and_others_do_not_cover_it():
    names = placed(
        [Name("text", "a", (0, 0)), Name("text", "b", (0, 0.01)), Name("axis", "long", (1, 0))]
    )
    assert [name.text for name in names] == ["a, b", "long"]
    (x0, y0), (x1, y1) = (name.point for name in names)
    assert abs(y0 - y1) >= 3.2 or abs(x0 - x1) > 0.58 * 3.2 * 4


def test_the_hull_leaves_inner_points_and_points_on_sides_out():
    found = hull(np.array([[0, 0], [2, 0], [2, 2], [0, 2], [1, 1], [1, 0]], float))
    assert found.tolist() == [[0, 0], [2, 0], [2, 2], [0, 2]]


def test_the_page_of_a_drawing_follows_the_choice_of_its_reader():
    drawn = drawing(catalogue_system("four_bar"))
    both, light = svg(drawn, "four_bar"), svg(drawn, "four_bar", "light")
    assert "prefers-color-scheme: dark" in both
    assert "prefers-color-scheme" not in light
    assert "path.link0-100 { stroke: #335478; fill: #5288c1; }" in light


def test_the_icon_is_a_picture_with_smooth_edges():
    across = Drawing((Stroke("link", "link0", ((-50.0, 0.0), (50.0, 0.0)), width=4.0),))
    image = pixels(icon(across))
    assert image.shape == (SIZE, SIZE, 4)
    middle = SIZE // 2
    assert image[middle, middle].tolist() == [*(255 * rgb("link0", "light")).astype(int), 255]
    assert image[middle - 20, middle, 3] == 0
    column = image[:, middle, 3] / 255
    assert column.sum() == pytest.approx(4.0 * 176 / 100, abs=0.02)
    assert np.any((column > 0) & (column < 1))


def test_areas_of_the_icon_are_filled_and_others_are_not():
    corners = ((-40.0, -40.0), (40.0, -40.0), (40.0, 40.0), (-40.0, 40.0))
    middle = SIZE // 2
    for opacity, seen in ((1.0, 255), (0.35, 89), (0.0, 0)):
        area = Stroke("joint", "joint", corners, closed=True, opacity=opacity)
        image = pixels(icon(Drawing((area,))))
        assert image[middle, middle, 3] == seen
        assert image[2, 2, 3] == 0
