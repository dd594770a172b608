"""Picture of the mechanism in three dimensions: visibility, cameras, and sliders of joints."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from nicegui import events, ui

from mbs.app.web.app import App
from mbs.app.web.document.tables import number
from mbs.app.web.session import Handle, handles, listed_modes, mode_of
from mbs.app.web.style import VIEW
from mbs.errors import MbsError
from mbs.loops import Mode
from mbs.view._scene import COVERED

# Sliders of the coordinates that can be moved, dependent coordinates, and assembly modes.


_PART = 1000
_THROTTLE = 0.03
"""Time [s] between two messages of a moving slider: about thirty pictures per second."""
_PAUSE = 0.2
"""Time [s] that a configuration must remain unchanged before its assembly modes are computed."""


@dataclass(slots=True)
class _Slider:
    """Slider of a coordinate with its text field."""

    handle: Handle
    slider: ui.slider
    field: ui.input


class JointSliders:
    """Sliders of the joints, dependent joints and assembly modes, below the picture."""

    def __init__(self, app: App) -> None:
        self._app = app
        self._sliders: list[_Slider] = []
        self._follow: dict[int, ui.label] = {}
        self._modes: tuple[Mode, ...] = ()
        self._shape: tuple[object, ...] = ()
        self._held: Handle | None = None
        self._typed: Handle | None = None
        self._turn = 0
        self._shown_mode: int | None = None
        with ui.element("div").classes("app-joints"):
            with ui.element("div").classes("app-joints-head"):
                ui.label("Joints").classes("app-joint-name")
                self._kind = ui.label().classes("app-note")
                ui.element("div").classes("app-space")
                button = ui.button("Start configuration", on_click=self._home)
                button.props("flat dense no-caps size=12px")
                button.tooltip("Back to the configuration of assembly")
            self._grid = ui.element("div").classes("app-joint-grid")
            self._others = ui.element("div").classes("app-follow")
            with ui.element("div").classes("app-modes") as self._mode_row:
                ui.label("Assembly mode").classes("app-note")
                self._mode = ui.select({}, on_change=self._choose_mode)
                self._mode.props("dense options-dense borderless")
                self._mode_note = ui.label().classes("app-note")
        app.on_robot(self.rebuild)
        app.on_clear(self.clear)
        app.on_configuration(self.refresh)
        self.rebuild()

    def clear(self) -> None:
        """Remove all joints."""
        self._sliders, self._follow, self._modes, self._shape = [], {}, (), ()
        self._held = self._typed = None
        self._grid.clear()
        self._others.clear()
        self._mode_row.set_visibility(False)
        self._kind.set_text("")

    def rebuild(self) -> None:
        """Create the sliders of the present mechanism, unless they already exist."""
        system = self._app.session.system
        found = () if system is None else handles(system)
        names = () if system is None else tuple(c.name for c in system.coordinates)
        if (found, names) == self._shape or system is None:
            return
        self.clear()
        self._shape = (found, names)
        with self._grid:
            for handle in found:
                self._sliders.append(self._slider(handle))
        held = {handle.index for handle in found}
        with self._others:
            for index, coordinate in enumerate(system.coordinates):
                if index not in held:
                    label = ui.label().tooltip(f"{coordinate.name} follows from the loops")
                    self._follow[index] = label
        self._kind.set_text(
            "the active ones; the others follow from the loops" if system.is_closed else ""
        )

    async def refresh(self) -> None:
        """Show the present configuration, except in the slider or field that the user edits."""
        system, q = self._app.session.system, self._app.q
        if system is None or len(q) != system.nq:
            return
        for item in self._sliders:
            value = q[item.handle.index]
            if not (self._app.is_moving and item.handle == self._held):
                item.slider.set_value(value)
            if item.handle != self._typed:
                item.field.set_value(f"{value:.4f}")
        for index, label in self._follow.items():
            label.set_text(f"{system.coordinates[index].name} = {q[index]:.4f}")
        self._turn += 1
        turn = self._turn
        await asyncio.sleep(_PAUSE)
        if turn == self._turn:
            await self._refresh_modes()

    async def _refresh_modes(self) -> None:
        """Show the assembly modes of the present configuration, or why they are not known."""
        system, q = self._app.session.system, self._app.q
        closed = system is not None and system.is_closed
        self._mode_row.set_visibility(closed)
        if system is None or not closed:
            return
        found = await self._app.aside(listed_modes, system, q)
        if (system, q) != (self._app.session.system, self._app.q):
            return  # the configuration changed meanwhile; the next refresh is pending
        if isinstance(found, str):
            self._modes = ()
            self._mode.set_visibility(False)
            self._mode_note.set_text(f"— {found}")
            return
        self._modes = found
        now = self._shown_mode = mode_of(found, q)
        # modes of loops that are solved together do not have labels
        others = [
            f"number {k + 1}" if len(found) > 1 else "the only one" for k in range(len(found))
        ]
        options = {k: ", ".join(mode.branch) or others[k] for k, mode in enumerate(found)}
        self._mode.set_visibility(bool(found))
        self._mode.set_options(options, value=now)
        self._mode_note.set_text(f"{len(found)} with these joints" if found else "")

    def _slider(self, handle: Handle) -> _Slider:
        """Create the slider and the text field of a coordinate."""
        with ui.element("div").classes("app-joint"):
            ui.label(handle.name).classes("app-joint-name").tooltip(_range(handle))
            step = (handle.high - handle.low) / _PART
            slider = ui.slider(min=handle.low, max=handle.high, step=step, value=0.0)
            slider.props('dense thumb-size="14px" track-size="3px"')
            field = ui.input().props("dense borderless")
            ui.label(handle.unit if handle.unit != "1" else "").classes("app-note")
        made = _Slider(handle, slider, field)
        slider.on(
            "update:model-value",
            lambda event: self._slid(handle, event),
            throttle=_THROTTLE,
            leading_events=True,
        )
        field.on("update:model-value", lambda: self._type(handle), args=[])
        field.on("blur", lambda: self._type(None), args=[])
        field.on("change", lambda: self._write(made))
        return made

    def _type(self, handle: Handle | None) -> None:
        """Record the field in which the user types, so that it is not overwritten."""
        self._typed = handle

    async def _slid(self, handle: Handle, event: events.GenericEventArguments) -> None:
        """Move a coordinate to the value of its slider, which the event contains."""
        self._held = handle
        await self._app.move(handle.index, float(event.args))

    async def _write(self, item: _Slider) -> None:
        """Move a coordinate to the position in its text field; show an error if it is no number."""
        self._typed = None
        try:
            value = number(str(item.field.value or ""), item.handle.name)
        except MbsError as error:
            self._app.complain(error)
            return
        await self._app.move(item.handle.index, value)

    async def _choose_mode(self, event: events.ValueChangeEventArguments[Any]) -> None:
        """Show the mechanism in the selected assembly mode."""
        k = event.value
        if isinstance(k, int) and k < len(self._modes) and k != self._shown_mode:
            await self._app.set_configuration(self._modes[k].q)

    async def _home(self) -> None:
        """Show the assembled configuration."""
        system = self._app.session.system
        if system is not None:
            await self._app.set_configuration(system.configuration)


def _range(handle: Handle) -> str:
    """Return the text of the limits of a slider."""
    kind = "limits" if handle.limited else "no limits; the slider goes"
    return f"{handle.name}: {kind} {handle.low:.4g} to {handle.high:.4g} {handle.unit}"


_ROLES: Mapping[str, tuple[str, bool]] = MappingProxyType(
    {
        "link": ("Links", True),
        "visual": ("Shapes", True),
        "skeleton": ("Bars", False),
        "joint": ("Joints", True),
        "axis": ("Axes", True),
        "frame": ("Frames", True),
        "link frame": ("All frames", False),
        "loop": ("Loops", True),
        "label": ("Names", False),
        "grid": ("Ground", True),
    }
)
_CAMERAS: Mapping[str, str] = MappingProxyType(
    {"iso": "3-D", "front": "Front", "side": "Side", "top": "Top", "fit": "Fit"}
)


class PicturePanel:
    """Right half of the app: the picture and the joints."""

    def __init__(self, app: App) -> None:
        self._app = app
        self._paints: list[Callable[[], None]] = []
        with ui.element("div").classes("app-right"):
            with ui.element("div").classes("app-view") as self._view:
                ui.element("div").classes("app-canvas").props(f"id={VIEW}")
                with ui.element("div").classes("app-over"):
                    self._view_buttons()
                self._veil = ui.label().classes("app-veil")
            JointSliders(app)
        app.on_document(self.refresh)
        app.on_configuration(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Show a note if the picture does not correspond to the tables."""
        session = self._app.session
        for paint in self._paints:
            paint()
        stale = session.good is not None and session.good != session.document
        why = session.refusal
        if stale:
            why = "The picture is of the last robot without a mistake."
        self._veil.set_text(why)
        self._veil.set_visibility(bool(why))
        if stale:
            self._view.classes(add="app-stale")
        else:
            self._view.classes(remove="app-stale")

    def _view_buttons(self) -> None:
        """Create the buttons of visible kinds of elements, view directions and screenshot."""
        with ui.element("div").classes("app-chips"):
            for role, (title, usual) in _ROLES.items():
                self._toggle(role, title, usual)
        with ui.element("div").classes("app-chips"):
            for camera, title in _CAMERAS.items():
                with ui.element("button").classes("app-chip") as chip:
                    ui.label(title)
                chip.on("click", lambda camera=camera: self._app.look(camera))
            with ui.element("button").classes("app-chip") as chip:
                ui.label("PNG").tooltip("Download the picture as it is")
            chip.on("click", self._app.screenshot)

    def _is_shown(self, role: str, usual: bool) -> bool:
        """Whether a kind of elements is visible: as the user set it, else by default (`usual`)."""
        session = self._app.session
        covered = session.system is not None and bool(session.system.shapes) and role in COVERED
        return session.shown.get(role, usual and not covered)

    def _toggle(self, role: str, title: str, usual: bool) -> None:
        """Create the button that shows or hides elements of a role; `usual` is their default."""
        with ui.element("button").classes("app-chip") as chip:
            ui.label(title)

        def paint() -> None:
            if self._is_shown(role, usual):
                chip.classes(add="app-chip-on")
            else:
                chip.classes(remove="app-chip-on")

        def turn() -> None:
            self._app.show(role, not self._is_shown(role, usual))
            paint()

        chip.on("click", turn)
        paint()
        self._paints.append(paint)
        if role in self._app.session.shown:
            self._app.show(role, self._app.session.shown[role])
