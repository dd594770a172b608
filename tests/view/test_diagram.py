"""Connection graphs: every body and joint is there, nothing lies on another thing."""

import itertools
import xml.etree.ElementTree as ET

import pytest

import mbs
from mbs.assembly.diagram import PILL, connections, layout
from mbs.components import Body, Box, Free, Revolute
from mbs.errors import ExportError

SVG = "{http://www.w3.org/2000/svg}"
CATALOGUE = mbs.robots.catalogue()


def chain(count):
    m = mbs.Mechanism("chain")
    end = m.world.frame
    for k in range(1, count + 1):
        bar = m.add(Box(f"bar{k}", length=0.2, width=0.02, density=1000))
        m.connect(end, Revolute(f"j{k}", axis="y"), bar.left)
        end = bar.right
    return m.assemble()


def quadruped():
    m = mbs.Mechanism("quadruped")
    trunk = m.add(Body("trunk", mass=6, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Free("root"), trunk)
    for leg, x in {
        "front_left": 0.2,
        "front_right": 0.2,
        "hind_left": -0.2,
        "hind_right": -0.2,
    }.items():
        hip, shank = (
            m.add(Body(f"{leg}_{part}", mass=1, com=(0, 0, -0.1))) for part in ("hip", "shank")
        )
        m.connect(trunk.at(x), Revolute(f"{leg}_pitch", axis="y"), hip)
        m.connect(hip.at(0, 0, -0.2), Revolute(f"{leg}_knee", axis="y"), shank)
    return m.assemble()


def rectangles(placed):
    """Left, right, top and bottom of every box and pill."""
    for node in placed.nodes.values():
        yield node.x, node.y, node.width, node.height
    for edge in (*placed.tree, *placed.cuts):
        yield edge.x, edge.y, edge.width, PILL


def require_apart(placed):
    for (x, y, w, h), (X, Y, W, H) in itertools.combinations(rectangles(placed), 2):
        assert abs(x - X) >= (w + W) / 2 or abs(y - Y) >= (h + H) / 2


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_mechanism_has_a_diagram(name, assembled):
    system = assembled(name)
    diagram = system.draw()
    root = ET.fromstring(diagram.svg)
    words = ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]
    joined = [row for row in system.joints if row.part is None]
    for row in joined:
        assert any(word.startswith(f"{row.name} ") for word in words)
    graph = connections(system)
    for number, node in graph.nodes.items():
        bodies = [body.name for body in system.bodies if body.link == number]
        assert number == 0 or len(bodies) > 3 or set(bodies) <= set(node.lines)
    tree = [edge for edges in graph.children.values() for edge in edges]
    assert len(tree) == len(graph.nodes) - 1
    assert len(tree) + len(graph.cuts) == len(joined)
    assert sorted(edge.name for edge in graph.cuts) == sorted(
        cut.edge.joint.name for cut in system.cuts
    )
    require_apart(layout(graph))
    assert diagram._repr_svg_() == diagram.svg


def test_everything_lies_in_the_picture(assembled):
    for system in (assembled("whipple_bicycle"), quadruped(), chain(20)):
        placed = layout(connections(system))
        require_apart(placed)
        assert min(x - w / 2 for x, _, w, _ in rectangles(placed)) > -1e-9
        assert max(x + w / 2 for x, _, w, _ in rectangles(placed)) <= placed.width
        assert max(y + h / 2 for _, y, _, h in rectangles(placed)) <= placed.height


def test_driven_joints_and_cuts_are_marked(assembled):
    graph = connections(assembled("four_bar"))
    tree = [edge for edges in graph.children.values() for edge in edges]
    assert {edge.name: edge.driven for edge in tree} == {"j1": True, "j2": False, "j4": False}
    assert [(edge.name, edge.kind) for edge in graph.cuts] == [("j3", "revolute")]
    root = ET.fromstring(assembled("four_bar").draw().svg)
    looks = [rect.get("class") for rect in root.iter(f"{SVG}rect")]
    assert looks.count("pill active") == 2  # j1 and the key
    assert looks.count("pill loop") == 2  # j3 and the key
    dashed = [path for path in root.iter(f"{SVG}path") if "open" in path.get("class", "")]
    assert len(dashed) == 2


def test_the_title_counts_bodies_loops_and_mobility(assembled):
    titles = {
        "stewart_platform": "stewart_platform: 13 moving bodies, 5 loops, mobility 6",
        "simple_pendulum": "simple_pendulum: 1 moving body, no loop, mobility 1",
    }
    for name, title in titles.items():
        assert f">{title}<" in assembled(name).draw().svg


def test_a_long_chain_is_wrapped():
    placed = layout(connections(chain(20)))
    assert placed.height < 800
    columns = sorted({round(node.x) for node in placed.nodes.values()})
    assert len(columns) == 3
    short = layout(connections(chain(8)))
    assert len({round(node.x) for node in short.nodes.values()}) == 1


def test_couplings_are_told_in_words(assembled):
    assert ">teeth1: roll follows mesh1<" in assembled("differential_wrist").draw().svg


def test_a_diagram_is_written_as_svg(assembled, tmp_path):
    system = assembled("four_bar")
    path = tmp_path / "graph.svg"
    diagram = system.draw(path)
    assert path.read_text() == diagram.svg
    with pytest.raises(ExportError, match=r"a diagram is saved as \.svg"):
        system.draw(tmp_path / "graph.png")
