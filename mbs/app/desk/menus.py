"""The menus of models, built from the catalogue, and those of the optimizer, runs and files."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels import base as base_panel
from mbs.app.desk.panels import singular as singular_panel
from mbs.app.desk.panels.equations import open_equations
from mbs.app.desk.panels.export import open_export
from mbs.app.desk.panels.identification import open_identification
from mbs.app.desk.panels.optimizer import open_optimizer
from mbs.app.desk.panels.optimizer_settings import optimizer_switch
from mbs.app.desk.panels.postures import open_postures
from mbs.app.desk.panels.simulation import open_simulation
from mbs.app.tasks.equations import MENUS, entries
from mbs.models.catalogue import Entry

Act = Callable[[], Awaitable[None] | None]


def build_menus(desk: Desk) -> None:
    """The menus, where the slot is; entries that the robot does not have are greyed.

    Args:
        desk: of the page.
    """
    items = dict[str, _Item]()
    for menu in MENUS:
        with _menu(menu):
            for one in entries():
                if one.menu == menu:
                    items[one.key] = _Item(one, _act(desk, one))
            if menu == "Identification":
                ui.separator()
                _plain("From a record…", partial(open_identification, desk))
    with _menu("Optimizer"):
        _plain("Passes and counts…", partial(open_optimizer, desk)).mark("passes")
        ui.separator()
        switch = optimizer_switch(desk.session, "Optimize the equations")
        switch.style("padding: 4px 14px").mark("switch")
    with _menu("Simulate"):
        _plain("Motion…", partial(open_simulation, desk))
    with _menu("Export"):
        _plain("Files…", partial(open_export, desk))

    def refresh() -> None:
        system = desk.session.system
        for item in items.values():
            item.refuse("" if system is None else item.entry.refusal(system))

    desk.on_robot(refresh)
    refresh()


class _Item:
    """An entry of a menu that is greyed, with the reason, where the robot does not have it."""

    def __init__(self, entry: Entry, act: Act) -> None:
        self.entry = entry
        self._item = _plain(entry.title, act).mark(f"menu {entry.key}")
        with self._item:
            self._why = ui.tooltip("")
        self._why.set_visibility(False)

    def refuse(self, reason: str) -> None:
        """Grey it with a reason, or not with none."""
        self._item.set_enabled(not reason)
        self._why.set_text(reason)
        self._why.set_visibility(bool(reason))


def _act(desk: Desk, one: Entry) -> Act:
    if one.solver is not None:
        return partial(open_postures, desk, one.key)
    if one.key == singular_panel.KEY:
        return partial(singular_panel.open_singular, desk)
    if one.key == base_panel.KEY:
        return partial(base_panel.open_base, desk)
    return partial(open_equations, desk, one.key)


def _menu(title: str) -> Any:
    with ui.button(title).props("flat no-caps dense").classes("desk-menu"):
        return ui.menu()


def _plain(title: str, act: Act) -> ui.menu_item:
    return ui.menu_item(title, on_click=act)
