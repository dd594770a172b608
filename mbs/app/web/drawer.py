"""Drawer of results: tabs that menus open and the user closes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from typing import Any

from nicegui import ui


@dataclass(slots=True)
class _Tab:
    """Elements of a tab in the page: its head, and the panel with its content."""

    head: ui.element
    panel: ui.element


class Drawer:
    """Tabs of results, of which a single tab is visible."""

    def __init__(self) -> None:
        self._tabs: dict[str, _Tab] = {}
        self._numbers = count(1)
        self._heads: ui.element | None = None
        self._panels: ui.element | None = None
        self._on_fill: Callable[[bool], Any] = lambda filled: None
        self._on_tabs: Callable[[tuple[str, ...]], Any] = lambda names: None

    def on_tabs(self, listener: Callable[[tuple[str, ...]], Any]) -> None:
        """Set a listener that is called at each change of the tabs.

        Args:
            listener: function of the keys of all tabs, the visible tab last.
        """
        self._on_tabs = listener

    def build(self, on_fill: Callable[[bool], Any]) -> None:
        """Create the empty drawer at the present position of the page.

        Args:
            on_fill: callable; called with True when a tab is opened, and with False when the last
                tab is closed.
        """
        self._on_fill = on_fill
        with ui.element("div").classes("app-drawer"):
            self._heads = ui.element("div").classes("app-tabs")
            self._panels = ui.element("div").classes("app-panels")

    @contextmanager
    def open(self, title: str, key: str | None = None) -> Iterator[ui.element]:
        """Open a tab and fill it within the block.

        Args:
            title: title of the tab.
            key: key of the tab; a tab with the same key is replaced. Default: a new tab.
        """
        name = key if key is not None else f"tab {next(self._numbers)}"
        old = self._tabs.get(name)
        if old is None:
            tab = _Tab(self._head(name, title), self._panel())
            self._tabs[name] = tab
        else:
            tab = old
            tab.panel.clear()
        self.select(name)
        self._on_fill(True)
        with tab.panel:
            yield tab.panel

    def select(self, name: str) -> None:
        """Show a tab and hide the others.

        Args:
            name: key of the tab.
        """
        for other, tab in self._tabs.items():
            tab.panel.set_visibility(other == name)
            if other == name:
                tab.head.classes(add="app-tab-on")
                _into_view(tab.head)
            else:
                tab.head.classes(remove="app-tab-on")
        self._on_tabs((*(other for other in self._tabs if other != name), name))

    def close(self, name: str) -> None:
        """Close a tab; if it was visible, the previous tab is shown. An unknown tab is ignored.

        Args:
            name: key of the tab.
        """
        names = list(self._tabs)
        tab = self._tabs.pop(name, None)
        if tab is None:
            return
        was_shown = tab.panel.visible
        tab.head.delete()
        tab.panel.delete()
        if not self._tabs:
            self._on_fill(False)
            self._on_tabs(())
        elif was_shown:
            self.select(names[max(names.index(name) - 1, 0)] if names[0] != name else names[1])
        else:
            self.select(next(other for other, tab in self._tabs.items() if tab.panel.visible))

    def _head(self, name: str, title: str) -> ui.element:
        """Create the head of a tab with a button that closes it."""
        assert self._heads is not None
        with self._heads, ui.element("button").classes("app-tab") as head:
            ui.label(title)
            close = ui.label("✕").classes("app-tab-close").tooltip("Close this result")
        head.on("click", lambda: self.select(name))
        close.on("click.stop", lambda: self.close(name))
        return head

    def _panel(self) -> ui.element:
        """Create the empty panel of a tab."""
        assert self._panels is not None
        with self._panels:
            return ui.element("div").classes("app-panel")


def _into_view(head: ui.element) -> None:
    """Scroll to the head of a tab as soon as the page has drawn it."""
    find = f"document.getElementById('{head.html_id}')"
    scroll = f"{find}?.scrollIntoView({{block: 'nearest', inline: 'nearest'}})"
    head.client.run_javascript(f"setTimeout(() => {scroll}, 100)")
