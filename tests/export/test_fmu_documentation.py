"""What people read and see of an FMU: its page, its drawing, its icon."""

import math
import struct
import xml.etree.ElementTree as ET
import zlib

import numpy as np
import pytest
from fmu_models import pendulum

import mbs
from mbs.components import Body, Box, Free, Revolute, Spring
from mbs.export.fmu.documentation import documentation
from mbs.export.fmu.drawing import figure
from mbs.export.fmu.figure import Figure, Stroke, bounds
from mbs.export.fmu.icon import SIZE, icon, png
from mbs.export.fmu.labels import placed
from mbs.export.fmu.projection import projection
from mbs.export.fmu.svg import standalone, svg
from mbs.export.fmu.system_fmu import fmu_model

CLOSED = ("four_bar", "stewart_platform")


@pytest.fixture(scope="module")
def page():
    return documentation(fmu_model(mbs.load("four_bar").assemble()))


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


def test_the_page_is_well_formed_and_needs_no_other_file(page):
    body = page[page.index("<main>") : page.index("</main>") + len("</main>")]
    root = ET.fromstring(body)
    titles = [h.text for h in root.iter("h2")]
    assert titles[:5] == [
        "Joints",
        "Placement of the links",
        "Inertial parameters of the links",
        "Bodies",
        "Loops",
    ]
    assert "Operations of the equations" in titles
    assert "src=" not in page
    assert "href=" not in page
    assert 'name="viewport"' in page
    assert "prefers-color-scheme: dark" in page


def test_the_page_tells_names_units_and_starts(page):
    root = ET.fromstring(page[page.index("<main>") : page.index("</main>") + len("</main>")])
    cells = [["".join(c.itertext()) for c in row] for row in root.iter("tr")]
    model = fmu_model(mbs.load("four_bar").assemble())
    for entry in model.entries:
        row = next(row for row in cells if row[0] == entry.variable.name)
        assert row[1] == entry.variable.unit
    guess = next(v for v in model.dependents if v.name == "j2.solved")
    row = next(row for row in cells if row[0] == "j2.solved")
    assert row[2] == f"{guess.start:.6g} ({math.degrees(guess.start):.6g} deg)"


def test_the_page_counts_operations(page):
    from mbs.operations import count

    model = fmu_model(mbs.load("four_bar").assemble())
    counted = count(model.rhs)
    assert f"<td>{counted.mul}</td><td>{counted.add}</td>" in page


def test_a_page_without_a_mechanism_escapes_its_text():
    text = documentation(pendulum())
    assert "vertical &lt;down&gt;" in text
    assert "<svg" not in text


@pytest.mark.parametrize("name", CLOSED)
def test_joints_that_close_loops_stand_out(name):
    system = mbs.load(name).assemble()
    drawn = figure(system)
    closing = {label.text for label in drawn.labels if label.style == "closing"}
    assert set(", ".join(closing).split(", ")) == {j.name for j in system.joints if j.cut}
    assert any(stroke.style == "closing" for stroke in drawn.strokes)


def test_a_planar_mechanism_is_seen_in_its_plane():
    """Lengths on the drawing are those of the four-bar, in one scale."""
    drawn = figure(mbs.load("four_bar").assemble())
    links = [s.points for s in drawn.strokes if s.style == "link"]
    lengths = sorted(math.dist(a, b) for a, b in links)
    assert np.allclose(np.array(lengths) / lengths[0], [1, 0.9 / 0.4, 2.5], atol=1e-9)
    assert drawn.caption == "in the plane of the motion"


@pytest.mark.parametrize(
    ("axis", "gravity", "q"),
    [("z", (0, -9.81, 0), -math.pi / 2), ("y", (0, 0, -9.81), math.pi / 2)],
)
def test_down_is_down(axis, gravity, q):
    """A bar that hangs is drawn below its joint, whatever axis it turns about."""
    m = mbs.Mechanism("bar", gravity=gravity)
    bar = m.add(Box("bar", length=1.0, mass=1.0))
    m.connect(m.world, Revolute("j1", axis=axis), bar.left)
    (line,) = (s for s in figure(m.assemble(), [q]).strokes if s.style == "link")
    (x0, y0), (x1, y1) = line.points
    assert abs(x1 - x0) < 1e-9
    assert y0 - y1 == pytest.approx(100, abs=1e-9)


def test_a_view_has_orthogonal_unit_sides_and_up_is_up():
    rng = np.random.default_rng(7)
    points = rng.normal(size=(9, 3))
    for gravity in ([0, 0, -9.81], [0, 9.81, 0], [1, 2, 3], [0, 0, 0]):
        view = projection(points, np.eye(3), np.zeros((0, 3)), np.array(gravity, float))
        sides = np.array([view.right, view.up, view.towards])
        assert np.abs(sides @ sides.T - np.eye(3)).max() < 1e-12
        assert view.up @ (gravity if any(gravity) else [0, 0, -1]) < 0


def test_a_floating_body_on_a_spring_is_drawn():
    m = mbs.Mechanism("hanging", gravity=(0, 0, -9.81))
    box = m.add(Body("box", mass=2.0, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Free("free"), box)
    m.add(Spring("rope", m.world.at(0, 0, 2), box, stiffness=100, length=1))
    drawn = figure(m.assemble())
    styles = [stroke.style for stroke in drawn.strokes]
    assert styles.count("force") == 1
    assert any(s.style == "link" and s.closed for s in drawn.strokes)
    assert {label.text for label in drawn.labels} == {"box", "rope"}
    left, lower, right, upper = bounds(drawn)
    assert max(right - left, upper - lower) < 200


def test_names_at_one_point_share_a_label_and_others_do_not_cover_it():
    labels = placed([("joint", "a", (0, 0)), ("joint", "b", (0, 0.01)), ("link", "long", (1, 0))])
    assert [label.text for label in labels] == ["a, b", "long"]
    (x0, y0), (x1, y1) = (label.point for label in labels)
    assert abs(y0 - y1) >= 3.2 or abs(x0 - x1) > 0.58 * 3.2 * 4


@pytest.mark.parametrize("name", CLOSED)
def test_all_that_is_drawn_lies_in_the_picture(name):
    root = ET.fromstring(svg(figure(mbs.load(name).assemble()), name))
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
    root = ET.fromstring(standalone(figure(mbs.load("four_bar").assemble()), "<four>").encode())
    assert not [e for e in root.iter() if e.tag.endswith("text")]
    assert [e.text for e in root.iter() if e.tag.endswith("title")] == ["<four>"]


def test_the_icon_is_a_picture_with_smooth_edges():
    across = Figure((Stroke("link", ((-50.0, 0.0), (50.0, 0.0))),))
    image = pixels(icon(across))
    assert image.shape == (SIZE, SIZE, 4)
    middle = SIZE // 2
    assert image[middle, middle].tolist() == [109, 136, 163, 255]
    assert image[middle - 20, middle, 3] == 0
    column = image[:, middle, 3] / 255
    assert column.sum() == pytest.approx(7.0, abs=0.02)
    assert np.any((column > 0) & (column < 1))


def test_areas_of_the_icon_are_filled():
    corners = ((-40.0, -40.0), (40.0, -40.0), (40.0, 40.0), (-40.0, 40.0))
    image = pixels(icon(Figure((Stroke("joint", corners, closed=True),))))
    assert image[SIZE // 2, SIZE // 2].tolist() == [251, 251, 248, 255]
    assert image[2, 2, 3] == 0


def test_png_keeps_every_pixel():
    given = np.random.default_rng(3).integers(0, 256, (5, 9, 4)).astype(np.uint8)
    assert np.array_equal(pixels(png(given)), given)


def test_the_icon_of_a_robot_is_drawn_quickly_and_twice_the_same():
    system = mbs.load("puma560").assemble()
    first = icon(figure(system))
    assert first == icon(figure(system))
    share = np.mean(pixels(first)[..., 3] > 0)
    assert 0.02 < share < 0.5
