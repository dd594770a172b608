"""What a person does in the app, in a real browser; skipped where there is none."""

from __future__ import annotations

import re

import numpy as np
import pytest
from support.browser_app import Visitor, browser, served
from support.catalogue_systems import catalogue_system

import mbs
from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import Cell
from mbs.operations import simplify

CONFIGURATION = [0.3, -0.6, 0.8, 0.4, 0.9, -0.5]
LARGEST_PAGE = 1_500_000


@pytest.fixture(scope="module")
def launched():
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def address(launched, tmp_path_factory):
    with served(tmp_path_factory.mktemp("app") / "log.txt") as one:
        yield one


@pytest.fixture
def visitor(launched, address):
    one = Visitor(launched, address)
    yield one
    one.leave()


def test_a_cell_moves_the_picture_and_changes_the_equations(visitor):
    visitor.arrive()
    before = visitor.picture
    visitor.write(2, "d", "0.9")
    visitor.until_other_picture(before)
    visitor.choose("Dynamic", "Inverse dynamic model, Newton and Euler")
    text = visitor.page.locator(".app-code")
    text.wait_for()
    system = Document.of_name("rx90").changed(Cell("geometry", 2, "d"), "0.9").system()
    expected = mbs.export.code(simplify(mbs.models.inverse_dynamics(system)), "c")
    assert text.text_content().split() == expected.split()
    assert "0.9*" in expected


def test_the_first_page_is_light_and_a_mistake_is_a_sentence(visitor):
    sizes = []
    wire = visitor.context.new_cdp_session(visitor.page)
    wire.on("Network.loadingFinished", lambda event: sizes.append(event["encodedDataLength"]))
    wire.send("Network.enable")
    visitor.arrive()
    visitor.cell(0, "joint").wait_for()
    visitor.page.wait_for_load_state("networkidle")
    assert 200_000 < sum(sizes) < LARGEST_PAGE
    before = visitor.picture
    visitor.write(2, "d", "0.45 +")
    sentence = visitor.page.locator(".app-sentence.app-bad").locator("visible=true")
    sentence.wait_for()
    assert "'0.45 +'" in sentence.inner_text()
    assert "Traceback" not in visitor.page.content()
    assert visitor.picture == before
    visitor.write(2, "d", "0.45")
    sentence.wait_for(state="hidden")


def test_every_configuration_of_a_pose_can_be_shown(visitor):
    visitor.arrive()
    visitor.move(CONFIGURATION)
    before = visitor.picture
    visitor.choose("Geometric", "Inverse geometric model, Pieper")
    visitor.button("Solve").click()
    rows = visitor.page.locator(".app-panels table tbody tr").locator("visible=true")
    rows.first.wait_for()
    assert rows.count() == 8
    found = [[float(x) for x in row.locator("td").all_inner_texts()[2:8]] for row in rows.all()]
    here = [np.allclose(q, CONFIGURATION, atol=6e-5) for q in found]
    assert here.count(True) == 1
    other = 0 if here.index(True) else 1
    rows.nth(other).click()
    visitor.until_joint(5, found[other][5])
    np.testing.assert_allclose(visitor.joints, found[other], atol=1.1e-4)
    visitor.until_other_picture(before)
    # of seven joints the last one stays where the visitor says
    _open(visitor, "panda")
    visitor.button("Present pose").click()
    for field, choice in (("joint", "q7"), ("redundant joint q7", "stays at a position")):
        visitor.page.get_by_label(field, exact=True).click()
        visitor.page.get_by_role("option", name=choice).click()
    visitor.page.get_by_label("q7 [rad]", exact=True).fill("pi/6")
    visitor.button("Solve").click()
    visitor.page.get_by_text("locked: q7 = 0.5236").wait_for()
    assert rows.count() == 4
    last = [float(row.locator("td").all_inner_texts()[8]) for row in rows.all()]
    np.testing.assert_allclose(last, np.pi / 6, atol=6e-5)


def test_a_four_bar_is_simulated_and_leaves_as_an_fmu(visitor, tmp_path):
    direct = mbs.simulate.run(catalogue_system("four_bar"), 0.5, tau={"j1": 1.0}, quiet=True)
    visitor.arrive()
    _open(visitor, "four_bar")
    visitor.choose("Simulate", "Motion")
    _begin_and_cancel(visitor)
    visitor.page.get_by_label("Duration [s]").fill("0.5")
    visitor.page.get_by_label("Row every [s]").fill("0.01")
    visitor.page.get_by_label("law.j1").fill("2*sin(pi/6)")
    before = visitor.picture
    visitor.button("Run").click()
    visitor.page.locator("canvas[data-zr-dom-id]").first.wait_for()
    visitor.until_other_picture(before)
    visitor.button("Play or pause").click()
    table = visitor.downloaded(visitor.button("CSV").click, tmp_path)
    signals = np.genfromtxt(table, delimiter=",", names=True, deletechars="")
    assert 0 < signals["closure_residual"].max() < 1e-8
    np.testing.assert_allclose(signals["j1.q"], direct["j1.q"], atol=1e-7)
    told = visitor.page.get_by_text("loops open by").inner_text()
    assert float(re.search(r"loops open by (\S+)", told)[1]) < 1e-8
    visitor.choose("Export", "Files")
    visitor.page.get_by_label("Stop time [s]").fill("0.5")
    path = visitor.downloaded(visitor.button("Download FMU").click, tmp_path)
    assert path.name == "four_bar.fmu"
    moved = mbs.simulate.fmu(path, inputs={"j1.tau": 1.0}, quiet=True)
    np.testing.assert_allclose(moved.time, direct.time, atol=1e-12)
    np.testing.assert_allclose(moved["j1.q"], direct["j1.q"], atol=1e-6)


def test_the_film_of_a_robot_ends_when_another_is_opened(visitor, tmp_path):
    visitor.arrive()
    _open(visitor, "planar_2r")
    visitor.choose("Simulate", "Motion")
    before = visitor.picture
    visitor.button("Run").click()
    visitor.until_other_picture(before)
    visitor.page.wait_for_function("() => appView.viewer.playing")
    _open(visitor, "kr6")
    visitor.page.wait_for_function("() => appView.viewer && appView.viewer.scene.name === 'kr6'")
    assert visitor.page.evaluate("() => appView.viewer.playing") is False
    first = visitor.picture
    visitor.page.wait_for_timeout(500)
    assert visitor.picture == first
    visitor.button("Play or pause").click()
    visitor.page.get_by_text("the motion is of another robot; simulate this one").wait_for()
    assert visitor.picture == first
    visitor.page.evaluate("() => appView.poses([1, 2, 3])")
    assert visitor.picture == first
    visitor.page.evaluate("() => appView.camera('iso')")
    assert visitor.picture == first  # the camera was put in front of the new robot


def test_a_robot_without_lengths_takes_the_former_picture_away(visitor, tmp_path):
    visitor.arrive()
    _open(visitor, "panda")
    robot = tmp_path / "long.toml"
    robot.write_text(
        'name = "long"\n[[frame]]\nantecedent = 0\n[[frame]]\nantecedent = 1\nd = "L"\n'
    )
    visitor.choose("Robot", "Open a file")
    visitor.page.locator("input[type=file]").set_input_files(robot)
    visitor.page.locator(".app-veil", has_text="needs values of L").wait_for()
    assert visitor.page.evaluate("() => appView.viewer === null")
    visitor.page.get_by_text("Symbols", exact=True).click()
    visitor.write(0, "value", "0.4")
    visitor.page.wait_for_function("() => appView.viewer && appView.viewer.scene.name === 'long'")
    visitor.move([0.3, -0.7])
    assert visitor.joints == [0.3, -0.7]


def test_a_reload_loses_nothing_and_visitors_are_apart(visitor, launched, address):
    visitor.arrive()
    before = visitor.picture
    visitor.write(0, "r", "0.12")
    visitor.until_other_picture(before)
    visitor.move(CONFIGURATION)
    visitor.choose("Simulate", "Motion")
    visitor.page.get_by_label("law.q2").fill("30*sin(t)")
    visitor.come_back()
    visitor.until_joint(5, CONFIGURATION[5])
    np.testing.assert_allclose(visitor.joints, CONFIGURATION, atol=1e-9)
    law = visitor.page.get_by_label("law.q2")
    law.wait_for()
    assert law.input_value() == "30*sin(t)"
    assert visitor.cell(0, "r").inner_text() == "0.12"
    other = Visitor(launched, address)
    other.arrive()
    other.cell(0, "r").wait_for()
    assert other.cell(0, "r").inner_text() == "0"
    assert other.joints == [0.0] * 6
    other.write(0, "r", "0.5")
    other.button("↶").and_(other.page.locator(":enabled")).wait_for()
    other.leave()
    assert visitor.cell(0, "r").inner_text() == "0.12"
    visitor.button("↶").click()
    visitor.page.wait_for_function(
        '() => document.querySelector(\'.ag-row[row-index="0"] .ag-cell[col-id="r"]\')'
        ".innerText === '0'"
    )


def _begin_and_cancel(visitor):
    """Start a simulation that takes minutes, and stop it."""
    visitor.page.get_by_label("Duration [s]").fill("5000")
    visitor.page.get_by_label("Row every [s]").fill("0.1")
    visitor.button("Run").click()
    visitor.button("Cancel").click()
    visitor.page.get_by_text("Simulating four_bar: stopped").wait_for()
    visitor.page.locator(".app-job").wait_for(state="detached")


def _open(visitor, name):
    """Take a mechanism of the catalogue."""
    visitor.choose("Robot", "From the catalogue")
    visitor.page.locator(".app-list-row").filter(
        has=visitor.page.get_by_text(name, exact=True)
    ).click()
    visitor.page.locator(".app-robot", has_text=re.compile(f"^{name}$")).first.wait_for()
