"""The page in process: what a visitor does, without a browser."""

import asyncio
import math
import time
from contextlib import asynccontextmanager

import pytest

pytest.importorskip("nicegui", reason="the app is shown by nicegui")

import httpx
from nicegui import app as server
from nicegui import core, ui
from nicegui.testing.user import User
from support import web_tasks
from support.panel_pages import run_visit, simulated
from support.processes import IN_PROC, is_alive

from mbs.app.web.app import App
from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import Cell
from mbs.app.web.menus import FilesMenu
from mbs.app.web.page import page_of

PATIENCE = 20.0


@asynccontextmanager
async def visits(monkeypatch, name, count=1):
    """So many visitors of a server, and their apps."""
    apps, menus = [], []
    init, menu = App.__init__, FilesMenu.__init__

    def noted(self, *args):
        init(self, *args)
        apps.append(self)

    def noted_menu(self, *args):
        menu(self, *args)
        menus.append(self)

    monkeypatch.setattr(App, "__init__", noted)
    monkeypatch.setattr(FilesMenu, "__init__", noted_menu)
    async with simulated(page_of(Document.of_name(name))) as user:
        for k in range(count):
            visitor = user if k == 0 else another_user()
            await visitor.open("/")
            await until(lambda k=k: len(apps) > k and apps[k].session.system is not None)
        yield user, apps, menus


def another_user():
    return User(httpx.AsyncClient(transport=httpx.ASGITransport(core.app), base_url="http://test"))


async def until(condition):
    stop = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < stop, "this did not happen"
        await asyncio.sleep(0.02)


def visit(monkeypatch, name, story, count=1):
    async def told():
        async with visits(monkeypatch, name, count) as (user, apps, menus):
            await story(user, apps, menus)

    run_visit(told)


def spied(app):
    """What is sent to the picture from now on."""
    sent, send = [], app._send

    def noted(method, *args):
        sent.append((method, args))
        send(method, *args)

    app._send = noted
    return sent


def test_an_edit_moves_the_picture_a_mistake_keeps_it_and_undo_takes_it_back(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        sent = spied(app)
        await app.edit(Cell("geometry", 4, "r"), "0.5")
        (scene,) = [args[1] for method, args in sent if method == "mount"]
        assert scene["name"] == "panda"
        good = app.system()
        await app.edit(Cell("geometry", 2, "d"), "abc+")
        await user.should_see("frame 3, d: cannot read 'abc+'", retries=200)
        await user.should_see("The picture is of the last robot without a mistake.", retries=200)
        assert len(sent) == 1
        assert app.session.system is good
        await app.undo()
        await user.should_not_see("frame 3, d: cannot read 'abc+'", retries=200)
        assert app.system() is good
        await app.undo()
        assert app.document == Document.of_name("panda")
        await app.redo()
        assert app.system() is good

    visit(monkeypatch, "panda", story)


def test_of_many_edits_the_last_one_is_shown(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        sent = spied(app)
        texts = [f"0.{k}" for k in range(40, 48)]
        await asyncio.gather(*(app.edit(Cell("geometry", 1, "d"), text) for text in texts))
        assert app.session.good.tables.text(Cell("geometry", 1, "d")) == "0.47"
        assert 1 <= len([1 for method, _ in sent if method == "mount"]) < len(texts)

    visit(monkeypatch, "planar_2r", story)


def test_joints_move_the_picture_and_loops_follow(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        sent = spied(app)
        await app.move(1, -1.2)
        assert app.q[1] == pytest.approx(-1.2)
        assert app.q[7] == pytest.approx(-1.2)
        method, (poses,) = sent[-1]
        assert method == "poses"
        assert len(poses) == 12 * 9
        await user.should_see("q8 = -1.2000", retries=200)
        await user.should_see("2 with these joints", retries=200)
        (mode,) = [s for s in user.find(ui.select).elements if set(s.options) == {0, 1}]
        assert mode.options[mode.value] == "q9:parallel"
        mode.set_value(1 - mode.value)
        await until(lambda: abs(app.q[2] - (math.pi / 2 - app.q[1] + app.q[6])) > 0.1)
        assert app.q[1] == pytest.approx(-1.2)
        await user.should_see("2 with these joints", retries=200)
        await app.edit(Cell("geometry", 3, "d"), "-0.25")
        assert app.q[1] == pytest.approx(-1.2)

    visit(monkeypatch, "sr400", story)


def test_what_cannot_be_closed_is_said_and_the_picture_stays(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        before = app.q
        await app.move(2, 9.0)
        await user.should_see("the loop cannot be closed with leg1 = 9", retries=200)
        assert app.q == before
        await app.move(2, 0.05)
        await user.should_not_see("the loop cannot be closed", retries=200)
        assert app.q[2] == pytest.approx(0.05)

    visit(monkeypatch, "stewart_platform", story)


def test_two_visitors_have_robots_of_their_own(monkeypatch):
    async def story(user, apps, menus):
        one, other = apps
        assert one.session is not other.session
        await one.edit(Cell("geometry", 1, "d"), "0.9")
        await other.open_robot(Document.of_name, "scara")
        assert one.document.name == "planar_2r"
        assert other.document.name == "scara"
        assert other.session.past == [(Document.of_name("planar_2r"), 0)]

    visit(monkeypatch, "planar_2r", story, count=2)


def test_a_robot_that_is_opened_starts_in_its_own_configuration(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        own = Document.of_name("kr6").system().configuration
        await app.set_configuration([0.3, -0.4, 0.5, 0.2, -0.7, 0.1])
        await app.open_robot(Document.of_name, "kr6")
        assert app.q == own
        await app.set_configuration([0.1] * 6)
        await app.edit(Cell("geometry", 1, "d"), "0.9")
        assert app.q == (0.1,) * 6
        await app.undo()
        assert app.q == (0.1,) * 6
        await app.undo()
        assert (app.document.name, app.q) == (
            "rx90",
            Document.of_name("rx90").system().configuration,
        )

    visit(monkeypatch, "rx90", story)


SYMBOLIC = b"""
name = "long"
gravity = [0, 0, "G"]
[[frame]]
antecedent = 0
[[frame]]
antecedent = 1
d = "L"
[[body]]
frame = 2
M = "m"
"""


def test_a_robot_without_lengths_has_no_picture_and_not_that_of_the_former_one(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        sent = []
        monkeypatch.setattr(app, "_send", lambda method, *args: sent.append(method))
        await app.open_robot(Document.of_upload, SYMBOLIC, ".toml")
        await user.should_see("The picture needs values of L; write them in the table Symbols")
        assert app.document.name == "long"
        assert sent[0] == "clear"
        assert "mount" not in sent
        await app.move(0, 0.2)
        assert app.session.refusal.startswith("The picture needs values of L")
        await app.move(0, 0.0)
        await app.edit(Cell("symbols", app.document.symbols.index("L"), "value"), "0.4")
        assert sent[-1] == "mount"
        await app.move(1, 0.3)
        assert (sent[-1], app.q) == ("poses", (0.0, 0.3))

    visit(monkeypatch, "panda", story)


def test_a_reload_loses_nothing_and_a_doubled_tab_goes_its_own_way(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        await app.edit(Cell("geometry", 1, "d"), "0.9")
        await app.set_configuration([0.3, -0.4])
        tab = user.client.tab_id
        kept = server.storage._tabs[tab]["app"]
        assert kept == (tab, app.session)

        class SameTab:
            tab_id = tab

        from mbs.app.web import page

        class Context:
            client = SameTab

        class Storage:
            tab = {"app": kept}  # noqa: RUF012

        monkeypatch.setattr(page, "ui", type("UI", (), {"context": Context}))
        monkeypatch.setattr(page, "server", type("Server", (), {"storage": Storage}))
        assert page.session_of(Document.of_name("rx90")) is app.session
        SameTab.tab_id = "another"
        double = page.session_of(Document.of_name("rx90"))
        assert (double.document, double.q) == (app.document, (0.3, -0.4))
        double.change(Document.of_name("scara"))
        assert app.document.name == "planar_2r"
        assert len(app.session.past) == 1

    visit(monkeypatch, "planar_2r", story)


def test_files_are_opened_by_their_suffix_alone_and_saved(monkeypatch):
    async def story(user, apps, menus):
        (app,), (menu,) = apps, menus
        content = Document.of_name("rx90").par().encode()
        await menu.open_upload("../../etc/robot.PAR", content)
        assert app.document.name == "rx90"
        await menu.open_upload("C:\\robots\\arm.par", b"NL = 2\nnonsense")
        await until(lambda: "'nonsense' is not an assignment" in str(user.notify.messages))
        await menu.open_upload("robot.exe", b"")
        await until(lambda: "files '.exe' are not read" in str(user.notify.messages))
        assert app.document.name == "rx90"
        user.find(marker="robot-toml").click()
        answer = await asyncio.wait_for(user.download.next(), PATIENCE)
        assert answer.content.decode() == app.document.toml()

    visit(monkeypatch, "planar_2r", story)


def test_the_catalogue_and_the_report(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        user.find(marker="robot-catalogue").click()
        await user.should_see("Franka Emika Panda", retries=200)
        user.find(marker="catalogue-panda").click()
        await until(lambda: app.document.name == "panda" and app.document == app.session.good)
        user.find(marker="robot-report").click()
        await user.should_see("panda: 7 moving links", retries=200)

    visit(monkeypatch, "planar_2r", story)


def test_long_work_can_be_stopped_and_refusals_are_sentences(monkeypatch, tmp_path):
    async def story(user, apps, menus):
        (app,) = apps
        assert (await app.run("Counting", web_tasks.counted, 10))[:2] == ("planar_2r", 2)
        assert await app.run("Asking", web_tasks.refused, "no configuration; change it") is None
        await until(lambda: "no configuration; change it" in user.notify.messages)
        told = tmp_path / "told"
        work = asyncio.ensure_future(app.run("Waiting", web_tasks.endless, str(told)))
        await until(told.exists)
        await user.should_see("waiting: 50 %", retries=200)
        user.find("Cancel").click()
        assert await work is None
        await user.should_not_see("Cancel", retries=200)
        await app.edit(Cell("geometry", 1, "d"), "*")
        assert await app.run("Counting", web_tasks.counted, 10) is None
        await until(lambda: "cannot read '*'" in str(user.notify.messages))

    visit(monkeypatch, "planar_2r", story)


@IN_PROC
def test_work_for_a_page_that_was_closed_is_stopped_without_a_word(monkeypatch, tmp_path, caplog):
    async def story(user, apps, menus):
        (app,) = apps
        told = tmp_path / "told"
        work = asyncio.ensure_future(app.run("Waiting", web_tasks.endless, str(told)))
        await until(told.exists)
        _, *pids = told.read_text().split()
        user.client.delete()
        assert await asyncio.wait_for(work, PATIENCE) is None
        await until(lambda: not any(map(is_alive, pids)))
        await app.edit(Cell("geometry", 1, "d"), "0.9")
        assert caplog.text == ""

    visit(monkeypatch, "planar_2r", story)


def test_a_configuration_of_another_robot_is_refused(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        sent, before = spied(app), app.q
        await app.set_configuration([0.1, 0.2, 0.3])
        await app.play([0.0, 1.0], [[0.1] * 3] * 2)
        assert [m.partition(" is of")[0] for m in user.notify.messages] == [
            "the configuration",
            "the motion",
        ]
        assert (app.q, sent) == (before, [])
        await app.play([0.0, 1.0], [[0.1] * 2] * 2)
        ((method, (film,)),) = sent
        assert method == "play"
        assert [len(flat) for flat in film["poses"]] == [36, 36]

    visit(monkeypatch, "planar_2r", story)


def test_a_composed_mechanism_can_be_looked_at_and_made_a_table(monkeypatch):
    async def story(user, apps, menus):
        (app,) = apps
        await user.should_see("a table of frames cannot say Box 'a'", retries=200)
        await app.edit(Cell("geometry", 0, "d"), "2")
        await until(lambda: "this cell cannot be changed" in str(user.notify.messages))
        user.find(marker="robot-table").click()
        await until(lambda: app.document.is_table and app.document == app.session.good)
        assert app.document.system().nq == 3
        assert user.find(ui.aggrid).elements

    visit(monkeypatch, "four_bar", story)
