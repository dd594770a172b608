"""Buttons and a slider that play a motion in the picture."""

from __future__ import annotations

import numpy as np
from nicegui import events, ui

from mbs.app.desk.desk import Desk
from mbs.app.tasks.simulation_film import Film

_SPEEDS = {
    0.25: "1/4 speed",
    0.5: "1/2 speed",
    1.0: "real time",
    2.0: "2 x speed",
    5.0: "5 x speed",
}


class Player:
    """Plays a film in the picture of the desk: play, pause, and a slider over time."""

    def __init__(self, desk: Desk, film: Film) -> None:
        self._desk, self._film = desk, film
        self._playing = False
        first, last = float(film.times[0]), float(film.times[-1])
        with ui.element("div").classes("desk-player desk-small"):
            self._button = ui.button(icon="play_arrow", on_click=self._toggle)
            self._button.props('round dense unelevated size=sm aria-label="Play or pause"').mark(
                "play"
            )
            self._slider = ui.slider(min=first, max=last, step=(last - first) / 1000, value=first)
            self._slider.style("flex: 1").mark("scrub")
            self._slider.on("update:model-value", self._scrub, throttle=0.05)
            self._label = ui.label(_told(first)).classes("desk-note")
            self._label.style("width: 62px; text-align: right; font-variant-numeric: tabular-nums")
            self._speed = ui.select(_SPEEDS, value=1.0, on_change=self._restart)
            self._speed.props("dense options-dense borderless").style("width: 118px")
        desk.on_time(self._reached)

    async def play(self) -> None:
        """Play again and again, from the beginning."""
        self._playing = True
        self._button.props("icon=pause")
        times, speed = self._film.times.tolist(), float(self._speed.value)
        await self._desk.play(times, self._film.postures, speed)

    def stop(self) -> None:
        """Leave the picture where it is."""
        if self._playing:
            self._playing = False
            self._desk.pause()
            self._button.props("icon=play_arrow")

    async def _toggle(self) -> None:
        if self._playing:
            self.stop()
            await self._keep(float(self._slider.value))
        else:
            await self.play()

    async def _restart(self) -> None:
        if self._playing:
            await self.play()

    async def _scrub(self, event: events.GenericEventArguments) -> None:
        self.stop()
        instant = float(event.args)
        self._label.text = _told(instant)
        await self._keep(instant)

    async def _keep(self, instant: float) -> None:
        """Make the posture of this instant that of the desk, its sliders included."""
        row = int(np.abs(self._film.times - instant).argmin())
        await self._desk.set_posture(self._film.postures[row].tolist())

    def _reached(self, instant: float) -> None:
        """What the picture shows now, where it plays this film; a closed panel ends it."""
        if self._slider.is_deleted:
            self.stop()
        elif self._playing:
            self._slider.set_value(instant)
            self._label.text = _told(instant)


def _told(instant: float) -> str:
    return f"{instant:.2f} s"
