"""The page in process: what a visitor does, without a browser."""

import asyncio
import math
import time
from contextlib import asynccontextmanager

import pytest

pytest.importorskip("nicegui", reason="the desk is shown by nicegui")

import httpx
from nicegui import app, core, ui
from nicegui.testing.user import User
from nicegui.testing.user_simulation import user_simulation
from support import desk_tasks
from support.panel_pages import run_visit
from support.processes import IN_PROC, is_alive

from mbs.app.desk.desk import Desk
from mbs.app.desk.document.document import Document
from mbs.app.desk.document.tables import Cell
from mbs.app.desk.menus import FilesMenu
from mbs.app.desk.page import page_of

PATIENCE = 20.0


@asynccontextmanager
async def visits(monkeypatch, name, count=1):
    """So many visitors of a server, and their desks."""
    desks, menus = [], []
    init, menu = Desk.__init__, FilesMenu.__init__

    def noted(self, *args):
        init(self, *args)
        desks.append(self)

    def noted_menu(self, *args):
        menu(self, *args)
        menus.append(self)

    monkeypatch.setattr(Desk, "__init__", noted)
    monkeypatch.setattr(FilesMenu, "__init__", noted_menu)
    async with user_simulation(root=page_of(Document.of_name(name))) as user:
        for k in range(count):
            visitor = user if k == 0 else another_user()
            await visitor.open("/")
            await until(lambda k=k: len(desks) > k and desks[k].session.system is not None)
        yield user, desks, menus


def another_user():
    return User(httpx.AsyncClient(transport=httpx.ASGITransport(core.app), base_url="http://test"))


async def until(condition):
    stop = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < stop, "this did not happen"
        await asyncio.sleep(0.02)


def visit(monkeypatch, name, story, count=1):
    async def told():
        async with visits(monkeypatch, name, count) as (user, desks, menus):
            await story(user, desks, menus)

    run_visit(told)


def spied(desk):
    """What is sent to the picture from now on."""
    sent, send = [], desk._send

    def noted(method, *args):
        sent.append((method, args))
        send(method, *args)

    desk._send = noted
    return sent


def test_an_edit_moves_the_picture_a_mistake_keeps_it_and_undo_takes_it_back(monkeypatch):
    async def story(user, desks, menus):
        (desk,) = desks
        sent = spied(desk)
        await desk.edit(Cell("geometry", 4, "r"), "0.5")
        (scene,) = [args[1] for method, args in sent if method == "mount"]
        assert scene["name"] == "panda"
        good = desk.system()
        await desk.edit(Cell("geometry", 2, "d"), "abc+")
        await user.should_see("frame 3, d: cannot read 'abc+'", retries=200)
        await user.should_see("The picture is of the last robot without a mistake.", retries=200)
        assert len(sent) == 1
        assert desk.session.system is good
        await desk.undo()
        await user.should_not_see("frame 3, d: cannot read 'abc+'", retries=200)
        assert desk.system() is good
        await desk.undo()
        assert desk.document == Document.of_name("panda")
        await desk.redo()
        assert desk.system() is good

    visit(monkeypatch, "panda", story)


def test_of_many_edits_the_last_one_is_shown(monkeypatch):
    async def story(user, desks, menus):
        (desk,) = desks
        sent = spied(desk)
        texts = [f"0.{k}" for k in range(40, 48)]
        await asyncio.gather(*(desk.edit(Cell("geometry", 1, "d"), text) for text in texts))
        assert desk.session.good.tables.text(Cell("geometry", 1, "d")) == "0.47"
        assert 1 <= len([1 for method, _ in sent if method == "mount"]) < len(texts)

    visit(monkeypatch, "planar_2r", story)


def test_joints_move_the_picture_and_loops_follow(monkeypatch):
    async def story(user, desks, menus):
        (desk,) = desks
        sent = spied(desk)
        await desk.move(1, -1.2)
        assert desk.q[1] == pytest.approx(-1.2)
        assert desk.q[7] == pytest.approx(-1.2)
        method, (poses,) = sent[-1]
        assert method == "poses"
        assert len(poses) == 12 * 9
        await user.should_see("q8 = -1.2000", retries=200)
        await user.should_see("2 with these joints", retries=200)
        (mode,) = [s for s in user.find(ui.select).elements if set(s.options) == {0, 1}]
        assert mode.options[mode.value] == "q9:parallel"
        mode.set_value(1 - mode.value)
        await until(lambda: abs(desk.q[2] - (math.pi / 2 - desk.q[1] + desk.q[6])) > 0.1)
        assert desk.q[1] == pytest.approx(-1.2)
        await user.should_see("2 with these joints", retries=200)
        await desk.edit(Cell("geometry", 3, "d"), "-0.25")
        assert desk.q[1] == pytest.approx(-1.2)

    visit(monkeypatch, "sr400", story)


def test_what_cannot_be_closed_is_said_and_the_picture_stays(monkeypatch):
    async def story(user, desks, menus):
        (desk,) = desks
        before = desk.q
        await desk.move(2, 9.0)
        await user.should_see("the loop cannot be closed with leg1 = 9", retries=200)
        assert desk.q == before
        await desk.move(2, 0.05)
        await user.should_not_see("the loop cannot be closed", retries=200)
        assert desk.q[2] == pytest.approx(0.05)

    visit(monkeypatch, "stewart_platform", story)


def test_two_visitors_have_robots_of_their_own(monkeypatch):
    async def story(user, desks, menus):
        one, other = desks
        assert one.session is not other.session
        await one.edit(Cell("geometry", 1, "d"), "0.9")
        await other.open_robot(Document.of_name, "scara")
        assert one.document.name == "planar_2r"
        assert other.document.name == "scara"
        assert other.session.past == [Document.of_name("planar_2r")]

    visit(monkeypatch, "planar_2r", story, count=2)


def test_a_reload_loses_nothing_and_a_doubled_tab_goes_its_own_way(monkeypatch):
    async def story(user, desks, menus):
        (desk,) = desks
        await desk.edit(Cell("geometry", 1, "d"), "0.9")
        await desk.set_configuration([0.3, -0.4])
        tab = user.client.tab_id
        kept = app.storage._tabs[tab]["desk"]
        assert kept == (tab, desk.session)

        class SameTab:
            tab_id = tab

        from mbs.app.desk import page

        class Context:
            client = SameTab

        class Storage:
            tab = {"desk": kept}  # noqa: RUF012

        monkeypatch.setattr(page, "ui", type("UI", (), {"context": Context}))
        monkeypatch.setattr(page, "app", type("App", (), {"storage": Storage}))
        assert page.session_of(Document.of_name("rx90")) is desk.session
        SameTab.tab_id = "another"
        double = page.session_of(Document.of_name("rx90"))
        assert (double.document, double.q) == (desk.document, (0.3, -0.4))
        double.change(Document.of_name("scara"))
        assert desk.document.name == "planar_2r"
        assert len(desk.session.past) == 1

    visit(monkeypatch, "planar_2r", story)


def test_files_are_opened_by_their_suffix_alone_and_saved(monkeypatch):
    async def story(user, desks, menus):
        (desk,), (menu,) = desks, menus
        content = Document.of_name("rx90").par().encode()
        await menu.open_upload("../../etc/robot.PAR", content)
        assert desk.document.name == "rx90"
        await menu.open_upload("C:\\robots\\arm.par", b"NL = 2\nnonsense")
        await until(lambda: "'nonsense' is not an assignment" in str(user.notify.messages))
        await menu.open_upload("robot.exe", b"")
        await until(lambda: "files '.exe' are not read" in str(user.notify.messages))
        assert desk.document.name == "rx90"
        user.find(marker="robot-toml").click()
        answer = await asyncio.wait_for(user.download.next(), PATIENCE)
        assert answer.content.decode() == desk.document.toml()

    visit(monkeypatch, "planar_2r", story)


def test_the_catalogue_and_the_report(monkeypatch):
    async def story(user, desks, menus):
        (desk,) = desks
        user.find(marker="robot-catalogue").click()
        await user.should_see("Franka Emika Panda", retries=200)
        user.find(marker="catalogue-panda").click()
        await until(lambda: desk.document.name == "panda" and desk.document == desk.session.good)
        user.find(marker="robot-report").click()
        await user.should_see("panda: 7 moving links", retries=200)

    visit(monkeypatch, "planar_2r", story)


def test_long_work_can_be_stopped_and_refusals_are_sentences(monkeypatch, tmp_path):
    async def story(user, desks, menus):
        (desk,) = desks
        assert (await desk.run("Counting", desk_tasks.counted, 10))[:2] == ("planar_2r", 2)
        assert await desk.run("Asking", desk_tasks.refused, "no configuration; change it") is None
        await until(lambda: "no configuration; change it" in user.notify.messages)
        told = tmp_path / "told"
        work = asyncio.ensure_future(desk.run("Waiting", desk_tasks.endless, str(told)))
        await until(told.exists)
        await user.should_see("waiting: 50 %", retries=200)
        user.find("Cancel").click()
        assert await work is None
        await user.should_not_see("Cancel", retries=200)
        await desk.edit(Cell("geometry", 1, "d"), "*")
        assert await desk.run("Counting", desk_tasks.counted, 10) is None
        await until(lambda: "cannot read '*'" in str(user.notify.messages))

    visit(monkeypatch, "planar_2r", story)


@IN_PROC
def test_work_for_a_page_that_was_closed_is_stopped_without_a_word(monkeypatch, tmp_path, caplog):
    async def story(user, desks, menus):
        (desk,) = desks
        told = tmp_path / "told"
        work = asyncio.ensure_future(desk.run("Waiting", desk_tasks.endless, str(told)))
        await until(told.exists)
        _, *pids = told.read_text().split()
        user.client.delete()
        assert await asyncio.wait_for(work, PATIENCE) is None
        await until(lambda: not any(map(is_alive, pids)))
        await desk.edit(Cell("geometry", 1, "d"), "0.9")
        assert caplog.text == ""

    visit(monkeypatch, "planar_2r", story)


def test_a_configuration_of_another_robot_is_refused(monkeypatch):
    async def story(user, desks, menus):
        (desk,) = desks
        sent, before = spied(desk), desk.q
        await desk.set_configuration([0.1, 0.2, 0.3])
        await desk.play([0.0, 1.0], [[0.1] * 3] * 2)
        assert [m.partition(" is of")[0] for m in user.notify.messages] == [
            "the configuration",
            "the motion",
        ]
        assert (desk.q, sent) == (before, [])
        await desk.play([0.0, 1.0], [[0.1] * 2] * 2)
        ((method, (film,)),) = sent
        assert method == "play"
        assert [len(flat) for flat in film["poses"]] == [36, 36]

    visit(monkeypatch, "planar_2r", story)


def test_a_composed_mechanism_can_be_looked_at_and_made_a_table(monkeypatch):
    async def story(user, desks, menus):
        (desk,) = desks
        await user.should_see("a table of frames cannot say Box 'a'", retries=200)
        await desk.edit(Cell("geometry", 0, "d"), "2")
        await until(lambda: "this cell cannot be changed" in str(user.notify.messages))
        user.find(marker="robot-table").click()
        await until(lambda: desk.document.is_table and desk.document == desk.session.good)
        assert desk.document.system().nq == 3
        assert user.find(ui.aggrid).elements

    visit(monkeypatch, "four_bar", story)
