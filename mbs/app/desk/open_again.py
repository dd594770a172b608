"""After a reload: the tabs that were open, opened again."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Any, cast

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels import base as base_panel
from mbs.app.desk.panels import configurations as configurations_panel
from mbs.app.desk.panels import singular as singular_panel
from mbs.app.desk.panels.equations import open_equations
from mbs.app.desk.panels.export import open_export
from mbs.app.desk.panels.identification import open_identification
from mbs.app.desk.panels.optimizer import open_optimizer
from mbs.app.desk.panels.simulation import open_simulation
from mbs.app.tasks.equations import entries

_NOTE = "tabs"
_EQUATIONS = "equations "

Opener = Callable[[Desk], Awaitable[None] | None]

_OPENERS: Mapping[str, Opener] = {
    "simulate": open_simulation,
    "identify": open_identification,
    "export": open_export,
    "optimizer": open_optimizer,
    base_panel.KEY: base_panel.open_base,
    singular_panel.KEY: singular_panel.open_singular,
    configurations_panel.KEY: configurations_panel.open_configurations,
}


async def open_again(desk: Desk) -> None:
    """Open what the session had open, the tab that was shown last; from now on it keeps track.

    Args:
        desk: of the page, its robot assembled.
    """
    before = cast(tuple[str, ...], desk.session.notes.get(_NOTE, ()))
    desk.drawer.on_tabs(lambda names: _note(desk, names))
    if desk.session.refusal:
        return
    known = {one.key for one in entries()}
    for name in before:
        if name in _OPENERS:
            await _finished(_OPENERS[name](desk))
        elif name.removeprefix(_EQUATIONS) in known:
            await open_equations(desk, name.removeprefix(_EQUATIONS))


async def _finished(opening: Any) -> None:
    if opening is not None:
        await opening


def _note(desk: Desk, names: tuple[str, ...]) -> None:
    desk.session.notes[_NOTE] = names
