"""The mechanism in three dimensions: what is shown, from where, and joints to move by hand."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.joint_sliders import JointSliders
from mbs.app.desk.style import VIEW

_ROLES: Mapping[str, tuple[str, bool]] = MappingProxyType(
    {
        "link": ("Links", True),
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
    """The right half of the desk."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        with ui.element("div").classes("desk-right"):
            with ui.element("div").classes("desk-view") as self._view:
                ui.element("div").classes("desk-canvas").props(f"id={VIEW}")
                with ui.element("div").classes("desk-over"):
                    self._chips()
                self._veil = ui.label().classes("desk-veil")
            JointSliders(desk)
        desk.on_document(self.refresh)
        desk.on_posture(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Say when the picture is not that of the table."""
        session = self._desk.session
        stale = session.good is not None and session.good != session.document
        why = session.refusal
        if stale:
            why = "The picture is of the last robot without a mistake."
        self._veil.set_text(why)
        self._veil.set_visibility(bool(why))
        if stale:
            self._view.classes(add="desk-stale")
        else:
            self._view.classes(remove="desk-stale")

    def _chips(self) -> None:
        with ui.element("div").classes("desk-chips"):
            for role, (title, usual) in _ROLES.items():
                self._toggle(role, title, self._desk.session.shown.get(role, usual))
        with ui.element("div").classes("desk-chips"):
            for camera, title in _CAMERAS.items():
                with ui.element("button").classes("desk-chip") as chip:
                    ui.label(title)
                chip.on("click", lambda camera=camera: self._desk.look(camera))
            with ui.element("button").classes("desk-chip") as chip:
                ui.label("PNG").tooltip("Download the picture as it is")
            chip.on("click", self._desk.screenshot)

    def _toggle(self, role: str, title: str, shown: bool) -> None:
        with ui.element("button").classes("desk-chip") as chip:
            ui.label(title)
        state = {"shown": shown}

        def paint() -> None:
            if state["shown"]:
                chip.classes(add="desk-chip-on")
            else:
                chip.classes(remove="desk-chip-on")

        def turn() -> None:
            state["shown"] = not state["shown"]
            self._desk.show(role, state["shown"])
            paint()

        chip.on("click", turn)
        paint()
        if role in self._desk.session.shown:
            self._desk.show(role, shown)
