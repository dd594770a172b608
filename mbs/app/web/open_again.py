"""Reopening of tabs after the page is reloaded."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import cast

from mbs.app.tasks.equations import entries
from mbs.app.web.app import App
from mbs.app.web.panels import base as base_panel
from mbs.app.web.panels import configurations as configurations_panel
from mbs.app.web.panels import singular as singular_panel
from mbs.app.web.panels.equations import open_equations
from mbs.app.web.panels.export import open_export
from mbs.app.web.panels.identification import open_identification
from mbs.app.web.panels.optimizer import open_optimizer
from mbs.app.web.panels.simulation import open_simulation

_NOTE = "tabs"
_EQUATIONS = "equations "

Opener = Callable[[App], Awaitable[None] | None]

_OPENERS: Mapping[str, Opener] = {
    "simulate": open_simulation,
    "identify": open_identification,
    "export": open_export,
    "optimizer": open_optimizer,
    base_panel.KEY: base_panel.open_base,
    singular_panel.KEY: singular_panel.open_singular,
    configurations_panel.KEY: configurations_panel.open_configurations,
}


async def open_again(app: App) -> None:
    """Reopen the tabs that were open before a reload, and record later changes of tabs.

    The tab that was visible is opened last.

    Args:
        app: app of the page, with its robot assembled.
    """
    before = cast(tuple[str, ...], app.session.notes.get(_NOTE, ()))
    app.drawer.on_tabs(partial(app.session.notes.__setitem__, _NOTE))
    if app.session.refusal:
        return
    known = {one.key for one in entries()}
    for name in before:
        if name in _OPENERS:
            opening = _OPENERS[name](app)
            if opening is not None:
                await opening
        elif name.removeprefix(_EQUATIONS) in known:
            await open_equations(app, name.removeprefix(_EQUATIONS))
