"""The panel of inverse geometry: a pose, and every posture that takes a frame there."""

from __future__ import annotations

from functools import partial
from typing import Any, cast

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels.equations import open_equations
from mbs.app.desk.panels.form import FIELD, frame_label
from mbs.app.desk.panels.layout import (
    Asking,
    in_a_row,
    main_button,
    side_button,
    tell_of_changes,
    two_sides,
    waiting_note,
)
from mbs.app.desk.panels.pose_fields import PoseFields
from mbs.app.desk.panels.postures_table import show_postures
from mbs.app.tasks.equations import entry
from mbs.app.tasks.postures import pose_of, postures
from mbs.assembly import System
from mbs.errors import MbsError
from mbs.models.geometry import terminal_frame

KEY = "postures"

_MEANINGS = {
    "auto": "the cheapest that fits",
    "pieper": "Pieper",
    "paul": "Paul",
    "general": "general (Raghavan and Roth)",
    "search": "search from random starts",
}


async def open_postures(desk: Desk, key: str = "igm-general") -> None:
    """Open the panel, with the pose that the frame has now.

    Args:
        desk: of the page.
        key: of the model whose method is chosen at first.
    """
    try:
        panel = _PosturesPanel(desk, key)
        await panel.take_present()
    except MbsError as error:
        desk.complain(error)


class _PosturesPanel:
    """Frame, method and pose above, the postures below."""

    def __init__(self, desk: Desk, key: str) -> None:
        self._desk = desk
        system = desk.system()
        kept = cast(dict[str, Any], desk.session.notes.setdefault(KEY, {}))
        names = _frames(system)
        frame = kept.get("frame")
        with desk.open("Inverse geometry", key=KEY):
            left, self._shown = two_sides()
        with left, ui.element("div").classes("desk-form"):
            self._frame = ui.select(
                names,
                label="frame",
                value=frame if frame in names else terminal_frame(system),
                on_change=self._framed,
            )
            self._frame.props(FIELD).style("flex: 1 1 90px").mark("frame")
            self._method = ui.select(_MEANINGS, label="method", value=entry(key).solver or "auto")
            self._method.props(FIELD).style("flex: 2 1 190px").mark("method")
        with left:
            self._pose = PoseFields()
            with in_a_row():
                self._button = main_button("Solve", self.solve)
                side_button(
                    "Present pose", self.take_present, "The pose of the frame in the picture"
                )
                side_button("Equations", partial(self._equations, key), "Of the method, as text")
        with self._shown:
            waiting_note("Every posture that takes the frame to the pose appears here.")
        tell_of_changes(desk, self._shown)
        desk.on_robot(self._robot_changed)

    def _robot_changed(self) -> None:
        """Offer the frames of the new robot."""
        if self._frame.is_deleted:
            return
        system = self._desk.system()
        names = _frames(system)
        value = self._frame.value if self._frame.value in names else terminal_frame(system)
        self._frame.set_options(names, value=value)

    async def take_present(self) -> None:
        """Write the pose that the frame has in the picture into the fields."""
        try:
            T = await self._desk.aside(
                pose_of, self._desk.system(), self._desk.q, self._frame.value
            )
        except MbsError as error:
            self._desk.complain(error)
            return
        self._pose.show(T)

    async def solve(self) -> None:
        """List every posture that takes the frame to the pose."""
        try:
            T = self._pose.T
        except MbsError as error:
            self._desk.complain(error)
            return
        task = partial(
            postures, frame=self._frame.value, method=self._method.value, seed=self._desk.q
        )
        show = partial(show_postures, self._desk)
        asking = Asking(self._desk, self._button, self._shown, show)
        await asking.run("Solving the inverse geometry", task, T)

    async def _framed(self) -> None:
        notes = cast(dict[str, Any], self._desk.session.notes[KEY])
        notes["frame"] = self._frame.value
        await self.take_present()

    async def _equations(self, key: str) -> None:
        named = {"pieper": "igm-pieper", "paul": "igm-paul", "general": "igm-general"}
        await open_equations(self._desk, named.get(str(self._method.value), key))


def _frames(system: System) -> dict[str | int, str]:
    """The frames that can be asked for, with what the list calls them."""
    frames = (*range(1, len(system.tree.links) + 1), *system.named_frames, terminal_frame(system))
    return {frame: frame_label(system, frame) for frame in frames}
