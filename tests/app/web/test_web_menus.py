"""The menus of models and their panels, as a visitor uses them without a browser."""

import asyncio

import numpy as np
import pytest
from nicegui import ui
from support.panel_pages import PATIENT, visited

import mbs
from mbs.app.tasks.configurations import pose_of
from mbs.app.tasks.equations import EVERY_PASS, MENUS, entries, equations
from mbs.app.web.menus import build_menus
from mbs.app.web.panels.form import frame_label
from mbs.app.web.panels.optimizer import optimizer_settings, passes_of
from mbs.app.web.session import Session


@pytest.fixture(scope="module")
def rx90():
    return mbs.load("rx90").assemble()


def element(user, marker):
    (found,) = user.find(marker=marker).elements
    return found


async def text_of(user, marker="code"):
    await user.should_see(marker=marker, retries=PATIENT)
    return element(user, marker).text


async def until(condition):
    for _ in range(PATIENT):
        if condition():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it did not come true")


def choose(user, marker, value):
    with user:
        element(user, marker).value = value


def test_every_entry_stands_in_its_menu_and_is_greyed_with_a_reason(monkeypatch):
    async def visit(user, app):
        for menu in (*MENUS, "Optimizer", "Simulate", "Export"):
            await user.should_see(menu)
        system = app.system()
        for one in entries():
            item = element(user, f"menu {one.key}")
            refusal = one.refusal(system)
            (tip,) = [child for child in item.descendants() if isinstance(child, ui.tooltip)]
            assert item.enabled == (not refusal)
            assert tip.text == refusal
        assert not element(user, "menu closure").enabled
        await app.open_robot(type(app.document).of_name, "four_bar")
        assert element(user, "menu closure").enabled
        assert not element(user, "menu igm-pieper").enabled

    visited(build_menus, "planar_2r", visit, monkeypatch)


def test_equations_are_those_of_the_task(monkeypatch, rx90):
    async def visit(user, app):
        user.find(marker="menu idm").click()
        shown = await text_of(user)
        made = equations(rx90, "idm", {}, "c")
        assert shown == made.text
        counts = {row["kind"]: row for row in element(user, "counts").rows}
        assert counts["multiplications"]["after"] == made.after.mul
        assert counts["together"]["before"] == made.before.total
        user.find(marker="download").click()
        response = await user.download.next()
        assert response.text == made.text

    visited(build_menus, "rx90", visit, monkeypatch)


def test_language_options_and_optimizer_are_kept(monkeypatch):
    planar = mbs.load("planar_2r").assemble()

    async def visit(user, app):
        user.find(marker="menu jacobian").click()
        assert "void jacobian(" in await text_of(user)
        choose(user, "option.frame", 1)
        choose(user, "optimizer", False)
        choose(user, "language", "fortran")
        await user.should_see("subroutine jacobian", retries=PATIENT)
        made = equations(planar, "jacobian", {"frame": 1}, "fortran", ())
        assert element(user, "code").text == made.text
        assert app.session.notes["options jacobian"] == {"frame": 1}
        user.find(marker="menu gravity").click()
        await user.should_see("subroutine gravity", retries=PATIENT)

    visited(build_menus, "planar_2r", visit, monkeypatch)


def test_rows_of_a_jacobian_follow_its_frame(monkeypatch, rx90):
    async def visit(user, app):
        user.find(marker="menu inverse-jacobian").click()
        await text_of(user)
        assert element(user, "option.rows").value == ["Vx", "Vy", "Vz", "wx", "wy", "wz"]
        choose(user, "option.frame", 3)
        await until(lambda: element(user, "option.rows").value == ["Vx", "Vy", "wx"])
        assert element(user, "option.columns").value == ["q1", "q2", "q3"]

    visited(build_menus, "rx90", visit, monkeypatch)


def test_every_configuration_is_listed_and_a_click_moves_the_picture(monkeypatch, rx90):
    start = (0.3, -0.5, 0.7, 0.4, -0.9, 0.2)

    async def visit(user, app):
        await app.set_configuration(start)
        user.find(marker="menu igm-pieper").click()
        await user.should_see(marker="solve", retries=PATIENT)
        T = pose_of(rx90, start)
        await until(lambda: element(user, "x").value)
        assert float(element(user, "x").value) == T[0, 3]
        user.find(marker="solve").click()
        await user.should_see("8 configurations by pieper", retries=PATIENT)
        table = element(user, "configurations")
        assert len(table.rows) == 8
        assert {row["limits"] for row in table.rows} == {"within"}
        user.find(marker="configurations").trigger("rowClick", [{}, {"number": 5}, 4])
        await until(lambda: app.q != start)
        assert np.allclose(pose_of(rx90, app.q), T, atol=1e-12)
        assert not np.allclose(app.q, start, atol=0.1)
        assert [row["number"] for row in table.rows if row["shown"]] == [5]

    visited(build_menus, "rx90", visit, monkeypatch)


def test_out_of_reach_offers_the_nearest_configuration(monkeypatch, rx90):
    async def visit(user, app):
        user.find(marker="menu igm-general").click()
        await user.should_see(marker="solve", retries=PATIENT)
        await until(lambda: element(user, "x").value)
        choose(user, "x", "oops")
        user.find(marker="solve").click()
        await user.should_see("'oops' is not a number", retries=PATIENT)
        choose(user, "pose form", "matrix")
        choose(user, "matrix", "1 0 0 3  0 1 0 0  0 0 1 1/2")
        user.find(marker="solve").click()
        await user.should_see("rx90: no configuration takes frame 6 there", retries=PATIENT)
        assert element(user, "reason").text.startswith("Out of reach")
        user.find(marker="nearest").click()
        await until(lambda: any(app.q))
        assert pose_of(rx90, app.q)[0, 3] > 0.8

    visited(build_menus, "rx90", visit, monkeypatch)


def test_singular_configurations_are_shown(monkeypatch, rx90):
    async def visit(user, app):
        await app.set_configuration((0.2, 0.4, -0.5, 0.3, 0.7, 0.1))
        user.find(marker="menu determinant").click()
        await user.should_see("q5 is 0 or pi (S5 = 0)", retries=PATIENT)
        assert await text_of(user) == "det J = (-0.091125) * (S23 - C2) * (C3) * (S5)\n"
        user.find(marker="show 2").click()
        await until(lambda: abs(np.cos(app.q[2])) < 1e-9)

    visited(build_menus, "rx90", visit, monkeypatch)


def test_base_parameters_are_a_table(monkeypatch):
    async def visit(user, app):
        user.find(marker="menu base-parameters").click()
        await user.should_see("four_bar: 14 base parameters of 37, symbolic", retries=PATIENT)
        rows = {row["name"]: row for row in element(user, "base").rows}
        assert rows["ZZ1R"]["expression"].startswith("ZZ1 + Ia1 + 0.16*M2")
        choose(user, "option.method", "numeric")
        user.find(marker="find").click()
        await user.should_see("four_bar: 14 base parameters of 37, numeric", retries=PATIENT)
        user.find(marker="download").click()
        response = await user.download.next()
        assert response.text.splitlines()[0] == "name,unit,expression,value"
        assert len(response.text.splitlines()) == 15

    visited(build_menus, "four_bar", visit, monkeypatch)


def test_passes_that_were_taken_out_are_not_made(monkeypatch):
    async def visit(user, app):
        user.find(marker="passes").click()
        await user.should_see(marker="count", retries=PATIENT)
        for name in EVERY_PASS[2:]:
            choose(user, f"pass {name}", False)
        assert passes_of(app.session) == EVERY_PASS[:2]
        user.find(marker="count").click()
        await user.should_see(marker="counts", retries=PATIENT)
        rows = {row["title"]: row for row in element(user, "counts").rows}
        planar = app.system()
        made = equations(planar, "idm", {}, "c", EVERY_PASS[:2])
        row = rows["Inverse dynamic model, Newton and Euler"]
        assert (row["before"], row["after"]) == (str(made.before), str(made.after))
        choose(user, "on", False)
        assert passes_of(app.session) == ()

    visited(build_menus, "planar_2r", visit, monkeypatch)


def test_a_changed_robot_is_told_above_old_results(monkeypatch):
    async def visit(user, app):
        user.find(marker="menu inertia").click()
        await text_of(user)
        await user.should_not_see("The robot has changed")
        await app.open_robot(type(app.document).of_name, "four_bar")
        await user.should_see("The robot has changed since this was made.", retries=PATIENT)
        user.find(marker="write").click()
        await user.should_see("inertia(q) -> A_a of four_bar", retries=PATIENT)
        await user.should_not_see("The robot has changed")

    visited(build_menus, "planar_2r", visit, monkeypatch)


def test_names_of_frames():
    four_bar = mbs.load("four_bar").assemble()
    names = [frame_label(four_bar, frame) for frame in (0, 3, "a")]
    assert names == ["0 (base)", "3 (j4)", "a"]
    assert frame_label(mbs.load("planar_2r").assemble(), 2) == "2"


def test_the_optimizer_is_on_with_every_pass_at_first():
    session = Session(None)
    assert passes_of(session) == EVERY_PASS
    optimizer_settings(session)["passes"] = ["fold", "drop"]
    assert passes_of(session) == ("drop", "fold")
