"""The posture of the mechanism, and the picture that shows it in the browser."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from mbs.app.desk.desk_base import DeskBase
from mbs.app.desk.session import Session
from mbs.app.desk.session_posture import Vector, moved
from mbs.app.desk.style import VIEW
from mbs.view import Scene


class DeskPicture(DeskBase):
    """A desk whose picture can be moved."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self._scene: Scene | None = None
        self._camera: str | None = "iso"
        self._wanted: dict[int, float] = {}
        self._is_moving = False

    @property
    def is_moving(self) -> bool:
        """Whether somebody moves a joint at this moment."""
        return self._is_moving

    def _draw(self, drawn: Scene) -> None:
        """Put another scene in the place of the present one."""
        self._scene = drawn
        self._send("mount", VIEW, drawn.as_dict(), self._camera)
        self._camera = None

    async def set_posture(self, q: Sequence[float]) -> None:
        """Show the mechanism at another posture.

        Args:
            q: (nq,) positions that close the loops [rad or m].
        """
        system = self.session.system
        if system is None or len(q) != system.nq:
            self.complain("the posture is of a robot with other joints; make it anew for this one")
            return
        self.session.q = tuple(float(x) for x in q)
        await self._pose(self.session.q)
        self._tell(self._on_posture)

    async def move(self, place: int, value: float) -> None:
        """Move one coordinate by hand; of many moves of it in a row the last one counts.

        Args:
            place: of the coordinate in q.
            value: where it is to be [rad or m].
        """
        self._wanted[place] = value
        if self._is_moving:
            return
        self._is_moving = True
        try:
            while self._wanted:
                await self._move_once()
        finally:
            self._is_moving = False

    async def _move_once(self) -> None:
        place = next(iter(self._wanted))
        value = self._wanted.pop(place)
        system, q = self.session.system, self.session.q
        if system is None or not 0 <= place < len(q):
            return
        try:
            q = await self.aside(moved, system, q, place, value)
        except Exception as error:
            self.session.refusal = self._sentence(error)
            self._tell(self._on_posture)
            return
        if self.session.system is system:
            self.session.refusal = ""
            await self.set_posture(q)

    async def _pose(self, q: Vector) -> None:
        drawn = self._scene
        if drawn is not None and len(q) == drawn.system.nq:
            flat = await self.aside(drawn.poses, q)
            self._send("poses", flat)

    async def play(self, times: Sequence[float], postures: Any, speed: float = 1.0) -> None:
        """Show a motion again and again until `pause`.

        Args:
            times: (n,) [s].
            postures: (n, nq) [rad or m].
            speed: of the film; 1 is as in reality.
        """
        drawn = self._scene
        film_of = np.asarray(postures, dtype=float)
        if drawn is None or film_of.shape[1:] != (drawn.system.nq,):
            self.complain("the motion is of a robot with other joints; simulate this one")
            return
        poses = await self.aside(drawn.motion, film_of)
        film = {"times": [float(t) for t in times], "poses": poses.tolist(), "speed": speed}
        self._send("play", film)

    def pause(self) -> None:
        """Stop the film where it is."""
        self._send("pause")

    def look(self, camera: str) -> None:
        """Look from "iso", "front", "top", "side", or "fit"."""
        self._send("camera", camera)

    def show(self, role: str, shown: bool) -> None:
        """Show a role of the picture, such as "frame", or hide it."""
        self.session.shown[role] = shown
        self._send("visible", role, shown)

    def screenshot(self) -> None:
        """Download the picture as a PNG file."""
        self._send("screenshot", f"{self.document.name}.png")

    def _send(self, method: str, *args: Any) -> None:
        """Call a method of the picture in the browser."""
        if self.is_left:
            return
        values = ", ".join(json.dumps(value) for value in args)
        self._client.run_javascript(f"deskView.{method}({values})")
