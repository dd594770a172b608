"""A page with one panel of the app, visited without a browser; its work is done at once."""

from __future__ import annotations

import asyncio
import gc
from contextlib import asynccontextmanager

from nicegui import ui
from nicegui.testing.user_simulation import user_simulation

import mbs.app.web.jobs as jobs
from mbs.app.web.app import App
from mbs.app.web.document.document import Document
from mbs.app.web.session import Session

PATIENT = 100
"""Attempts to see what takes a moment."""

_CANCELS = 60


def run_visit(visit):
    """Run a coroutine function that visits a page; whatever it left running is ended."""

    async def whole():
        try:
            await visit()
        finally:
            await _end_others()

    asyncio.run(whole())


async def _end_others():
    """Cancel the other tasks until none is left.

    Before Python 3.12 a task that waits with a time limit misses a cancel that comes together with
    what it waits for; asyncio.run cancels once, and would wait for it for ever.
    """
    for _ in range(_CANCELS):
        others = asyncio.all_tasks() - {asyncio.current_task()}
        if not others:
            return
        for task in others:
            task.cancel()
        await asyncio.wait(others, timeout=0.5)
    raise AssertionError(f"tasks do not end: {others}")


def visited(panel, robot, visit, monkeypatch):
    """Open a panel on a robot of the catalogue, and let `visit(user, app)` use it."""
    monkeypatch.setattr(jobs, "run", _at_once)

    async def whole():
        async with _page(panel, robot) as (user, app):
            await visit(user, app)

    run_visit(whole)


@asynccontextmanager
async def simulated(root):
    """A visitor of this page; what NiceGUI collects before and after is of this visit alone."""
    gc.freeze()
    async with user_simulation(root=root) as user:
        yield user


@asynccontextmanager
async def _page(panel, robot):
    apps = []

    async def page():
        await ui.context.client.connected(timeout=30)
        app = App(Session(Document.of_name(robot)))
        app.drawer.build(lambda filled: None)
        app.build_cards()
        await app.start()
        panel(app)
        apps.append(app)
        ui.label("the panel stands")

    async with simulated(page) as user:
        await user.open("/")
        await user.should_see("the panel stands", retries=PATIENT)
        yield user, apps[0]


async def _at_once(task, document, *args, progress=None):
    return task(document.system(), *args)
