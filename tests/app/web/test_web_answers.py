"""Answers that come after the robot has changed."""

import asyncio
import html

from support.panel_pages import PATIENT, visited

import mbs.app.web.jobs as jobs
from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import Cell
from mbs.app.web.menus import build_menus
from mbs.app.web.panels.export import open_export

CHANGED = "The robot has changed since this was made."


class Slow:
    """Jobs that begin at once and are done when they are let go."""

    def __init__(self, monkeypatch):
        self.begun, self.go = asyncio.Event(), asyncio.Event()
        monkeypatch.setattr(jobs, "run", self._run)

    async def _run(self, task, document, *args, progress=None):
        self.begun.set()
        await self.go.wait()
        return task(document.system(), *args)


def test_an_answer_of_the_robot_before_says_so(monkeypatch):
    async def visit(user, app):
        slow = Slow(monkeypatch)
        user.find(marker="menu base-parameters").click()
        await slow.begun.wait()
        await app.edit(Cell("inertia", 1, "Fv"), "0.3")
        await user.should_not_see(CHANGED)
        slow.go.set()
        await user.should_see(marker="base", retries=PATIENT)
        await user.should_see(CHANGED)
        await app.edit(Cell("inertia", 0, "Fv"), "0.2")
        assert len(user.find(CHANGED).elements) == 1
        user.find(marker="find").click()
        await user.should_not_see(CHANGED, retries=PATIENT)

    visited(build_menus, "planar_2r", visit, monkeypatch)


def test_a_download_has_the_name_of_the_robot_that_was_asked_for(monkeypatch):
    async def visit(user, app):
        slow, names = Slow(monkeypatch), []
        monkeypatch.setattr(app, "download", lambda data, name: names.append((name, data)))
        user.find(marker="html").click()
        await slow.begun.wait()
        name = app.document.name
        await app.edit(Cell("general", 0, "value"), "a/b <i>")
        await app.edit(Cell("geometry", 1, "d"), "*")
        slow.go.set()
        await asyncio.sleep(0)
        await user.should_not_see("Drawing", retries=PATIENT)
        ((file, data),) = names
        assert (name, file) == ("planar_2r", "planar_2r.html")
        assert f"<title>{html.escape(name)}</title>".encode() in data

    visited(open_export, "planar_2r", visit, monkeypatch)


def test_names_that_are_markup_stay_text():
    evil = "<img/src=x/onerror=alert(1)>"
    document = Document.of_name("planar_2r")
    for cell in (Cell("general", 0, "value"), Cell("geometry", 0, "name")):
        document = document.changed(cell, evil)
    assert document.problems == ()
    system = document.system()
    assert evil not in system.draw().svg
    assert html.escape(evil) in system.draw().svg
    assert document.file_name == "img_src_x_onerror_alert_1"
