"""Panel that simulates the robot, plots its motion and plays it in the picture."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from functools import partial
from typing import cast

import numpy as np
from nicegui import events, ui
from numpy.typing import NDArray

from mbs.app.tasks.exporting import file_stem
from mbs.app.tasks.simulation import Movie, SimulationSettings, csv_bytes, film
from mbs.app.web.app import App
from mbs.app.web.panels.layout import new_answer, warn_of_changes
from mbs.app.web.panels.options_form import first_values, form_texts, option_row
from mbs.app.web.panels.plots import (
    FieldLook,
    add_look,
    choice_field,
    come_into_view,
    line_chart,
    text_field,
)
from mbs.assembly import System
from mbs.result import Result
from mbs.simulate.options import MotionOptions

# Texts of the form of a simulation, and the settings that they specify.


Texts = dict[str, str]
"""Texts of the form by field: "duration", "start", names of options, and fields of joints such as
"q0.j1", "law.j1" and "kind.j1"."""

Row = tuple[str, str, str, bool]
"""Name of a joint, unit of its position ("" for several), unit of its rate, whether actuated."""

KINDS = {"tau": "effort", "q": "position", "v": "velocity", "a": "acceleration"}
"""Quantities that a law of a joint can prescribe."""

PICTURE = "the configuration of the picture"
TYPED = "typed positions"


def first_texts(texts: Mapping[str, str]) -> Texts:
    """Return the texts of all fields of the form: as typed before, else by default.

    Args:
        texts: texts that were typed before, by field.
    """
    return {"duration": "2", "start": PICTURE, **first_values(MotionOptions), **texts}


def chosen_rows(system: System) -> list[Row]:
    """Return the joints of the form, which have start values and laws.

    They are the independent joints of a closed system, and all joints of an open one.

    Args:
        system: system to simulate.
    """
    units = {c.name: c.unit for c in system.coordinates}
    speeds = [system.velocity_coordinates[k] for k in system.independent]
    return [(s.name, units.get(s.name, ""), s.unit, s.actuated) for s in speeds]


def settings_of(system: System, texts: Mapping[str, str], q: Sequence[float]) -> SimulationSettings:
    """Return the settings of a form.

    Args:
        system: system to simulate; fields of other joints are ignored.
        texts: texts of the form; empty texts are ignored.
        q: (nq,) configuration of the picture [rad or m].
    """
    rows = chosen_rows(system)
    typed = texts["start"] == TYPED
    laws = {name: texts.get(f"law.{name}", "").strip() for name, *_ in rows}
    kinds = {name: texts.get(f"kind.{name}", "") for name in laws}
    return SimulationSettings(
        duration=texts["duration"],
        options=form_texts(MotionOptions, texts),
        q0=_given(texts, "q0", [name for name, unit, *_ in rows if unit]) if typed else {},
        configuration=() if typed else tuple(q),
        v0=_given(texts, "v0", [name for name, *_ in rows]),
        tau={n: law for n, law in laws.items() if law and kinds[n] in ("", "tau")},
        motion={f"{n}.{kinds[n]}": x for n, x in laws.items() if x and kinds[n] in ("q", "v", "a")},
        inputs=_given(texts, "u", [name for name, _ in system.inputs]),
    )


def _given(texts: Mapping[str, str], what: str, names: Sequence[str]) -> dict[str, str]:
    """Return the nonempty texts of the fields "what.name", by name."""
    found = {name: texts.get(f"{what}.{name}", "").strip() for name in names}
    return {name: text for name, text in found.items() if text}


# Form of a simulation: times, start, and drives of the joints.


_LAWS = (
    "Laws are numbers, or texts of t, of positions and velocities such as {0}.q and {0}.v, and of"
    " symbols: 5*sin(2*t) - 0.3*{0}.v"
)


def build_form(system: System, texts: Texts) -> ui.button:
    """Create the fields of the form, which write into `texts`, and the button Run.

    Args:
        system: system to simulate.
        texts: texts of the form; they are updated while the user types.

    Returns:
        the button Run.
    """
    with ui.element("div").classes("app-form"):
        _text(texts, "duration", "Duration [s]", "96px")
        option_row(MotionOptions, texts)
    with ui.element("div").classes("app-form").style("align-items: center"):
        start = _choice(texts, "start", {x: x for x in (PICTURE, TYPED)}, "Starts at", "240px")
        button = ui.button("Run").props("unelevated no-caps dense").mark("simulate")
        button.style("padding: 3px 26px")
    rows = chosen_rows(system)
    kind = "Independent joints" if system.is_closed else "Joints"
    ui.label(f"{kind}: start and drive; empty fields are zero").classes("app-note")
    with ui.element("div").classes("app-laws app-small"):
        for title in ("", "q at start", "v at start", "driven by", "law of time"):
            ui.label(title).classes("app-note")
        for row in rows:
            _joint(texts, start, row)
    for name, unit in system.inputs:
        _text(texts, f"u.{name}", f"{name} [{unit}]", "220px")
    if rows:
        ui.label(_LAWS.format(rows[0][0])).classes("app-note")
    return button


def _joint(texts: Texts, start: ui.select, row: Row) -> None:
    """Create the fields of a joint: start values, prescribed quantity and law.

    They write into `texts`. The field of the position is enabled if `start` selects typed
    positions.
    """
    name, unit, rate, actuated = row
    ui.label(name).style("font-weight: 600").tooltip(f"position [{unit or 'none'}], rate [{rate}]")
    position = _text(texts, f"q0.{name}")
    if unit:
        position.bind_enabled_from(start, "value", lambda chosen: chosen == TYPED)
    else:
        position.disable()
    _text(texts, f"v0.{name}")
    kinds = {key: word for key, word in KINDS.items() if actuated or key != "tau"}
    if texts.get(f"kind.{name}") not in kinds:
        texts[f"kind.{name}"] = next(iter(kinds))
    _choice(texts, f"kind.{name}", kinds)
    _text(texts, f"law.{name}")


def _text(texts: Texts, key: str, label: str = "", width: str = "100%") -> ui.input:
    """Create a text field that writes into `texts[key]`."""
    look = FieldLook(label, width, key)
    return text_field(look, texts.get(key, ""), partial(texts.__setitem__, key))


def _choice(
    texts: Texts, key: str, options: Mapping[str, str], label: str = "", width: str = "100%"
) -> ui.select:
    """Create a field for a choice that writes into `texts[key]`."""
    look = FieldLook(label, width, key)
    return choice_field(look, options, texts[key], partial(texts.__setitem__, key))


# Signals of a result in the groups that the plots show.


Array = NDArray[np.float64]
Charts = dict[str, dict[str, Array]]
"""Unit of a chart to its signals by name."""

_ENERGIES = ("kinetic_energy", "potential_energy")
_CLOSURE = "closure_residual"
_KINDS = {"q": "Positions", "v": "Velocities", "a": "Accelerations", "tau": "Efforts"}


def groups_of(system: System, result: Result) -> dict[str, Charts]:
    """Return the charts of every group, such as positions and velocities; a chart per unit.

    Args:
        system: system that was simulated.
        result: result of the simulation.

    Returns:
        title of a group to its charts; groups without signals are omitted.
    """
    joints = {
        f"{c.name}.{kind}"
        for c in (*system.coordinates, *system.velocity_coordinates)
        for kind in _KINDS
    }
    groups: dict[str, Charts] = {title: {} for title in _KINDS.values()}
    groups |= {"Energy": {}, "Closure": {}, "Others": {}}
    for name, unit in result.units.items():
        title, label = _group_and_label(name, joints)
        groups[title].setdefault(unit, {})[label] = result[name]
    total = sum((result[name] for name in _ENERGIES), np.zeros(len(result)))
    groups["Energy"].setdefault("J", {})["total"] = total
    if not system.is_closed:
        del groups["Closure"]
    return {title: charts for title, charts in groups.items() if charts}


def _group_and_label(name: str, joints: set[str]) -> tuple[str, str]:
    """Return the group of a signal, such as "Positions", and the label of its line.

    `joints` are the names of all joint signals.
    """
    if name in joints:
        stem, _, kind = name.rpartition(".")
        return _KINDS[kind], stem
    if name in _ENERGIES:
        return "Energy", name.removesuffix("_energy")
    return ("Closure", "largest row") if name == _CLOSURE else ("Others", name)


# Buttons and a slider that play a motion in the picture.


_SPEEDS = {
    0.25: "1/4 speed",
    0.5: "1/2 speed",
    1.0: "real time",
    2.0: "2 x speed",
    5.0: "5 x speed",
}
"""Playback speeds: simulated seconds per second, and their labels."""


class Player:
    """Controls that play a movie in the picture: play, pause, speed, and a slider over time."""

    def __init__(self, app: App, film: Movie) -> None:
        self._app, self._film = app, film
        self._robot = app.session.robot
        self._playing = False
        first, last = float(film.times[0]), float(film.times[-1])
        with ui.element("div").classes("app-player app-small"):
            self._button = ui.button(icon="play_arrow", on_click=self._toggle)
            self._button.props('round dense unelevated size=sm aria-label="Play or pause"').mark(
                "play"
            )
            self._slider = ui.slider(min=first, max=last, step=(last - first) / 1000, value=first)
            self._slider.style("flex: 1").mark("scrub")
            self._slider.on("update:model-value", self._scrub, throttle=0.05)  # [s] 20 pictures
            self._label = ui.label(_time_text(first)).classes("app-note")
            self._label.style("width: 62px; text-align: right; font-variant-numeric: tabular-nums")
            self._speed = ui.select(_SPEEDS, value=1.0, on_change=self._restart)
            self._speed.props("dense options-dense borderless").style("width: 118px")
        app.on_time(self._reached)
        app.on_robot(self.stop)
        app.on_clear(self.stop)

    async def play(self) -> None:
        """Play the movie repeatedly from the beginning."""
        if not self._is_of_robot():
            return
        self._playing = True
        self._button.props("icon=pause")
        times, speed = self._film.times.tolist(), float(self._speed.value)
        await self._app.play(times, self._film.configurations, speed)

    def stop(self) -> None:
        """Stop; the picture remains as it is."""
        if self._playing:
            self._playing = False
            self._app.pause()
            if not self._button.is_deleted:
                self._button.props("icon=play_arrow")

    async def _toggle(self) -> None:
        """Play, or stop at the present time."""
        if self._playing:
            self.stop()
            await self._keep(float(self._slider.value))
        else:
            await self.play()

    async def _restart(self) -> None:
        """Play from the beginning if the movie is playing, with the new speed."""
        if self._playing:
            await self.play()

    async def _scrub(self, event: events.GenericEventArguments) -> None:
        """Show the time to which the slider was moved."""
        self.stop()
        instant = float(event.args)
        self._label.text = _time_text(instant)
        await self._keep(instant)

    async def _keep(self, instant: float) -> None:
        """Set the configuration of the app, including its sliders, to that of this time [s]."""
        if not self._is_of_robot():
            return
        row = int(np.abs(self._film.times - instant).argmin())
        await self._app.set_configuration(self._film.configurations[row].tolist())

    def _is_of_robot(self) -> bool:
        """Return whether the robot of the movie is still open; if not, show an error."""
        if self._robot == self._app.session.robot:
            return True
        self._app.complain("the motion is of another robot; simulate this one")
        return False

    def _reached(self, instant: float) -> None:
        """Show the time [s] that the picture shows; stop if the panel was closed."""
        if self._slider.is_deleted:
            self.stop()
        elif self._playing:
            self._slider.set_value(instant)
            self._label.text = _time_text(instant)


def _time_text(instant: float) -> str:
    """Return a time [s] as text."""
    return f"{instant:.2f} s"


_NOTE = "simulation"
_FILM = "simulated"
"""Name of the session note with the document and the last result, for a reload of the page."""


def open_simulation(app: App) -> None:
    """Open the panel that simulates the present robot.

    Args:
        app: app of the page.
    """
    system = app.checked_system()
    if system is None:
        return
    texts = first_texts(cast(Texts, app.session.notes.get(_NOTE, {})))
    app.session.notes[_NOTE] = texts
    add_look()
    with app.open("Simulate", key="simulate"), ui.element("div").classes("app-halves"):
        with ui.element("div").classes("app-half").style("flex: 0 0 562px"):
            button = build_form(system, texts)
        shown = ui.element("div").classes("app-half app-stays")
        with shown:
            kept = app.session.notes.get(_FILM)
            if isinstance(kept, tuple) and kept[0] == app.document:
                _show(app, system, kept[1])
            else:
                ui.label("Plots of the motion appear here; the picture moves.").classes("app-note")

    async def run() -> None:
        button.disable()
        try:
            await _run(app, texts, shown)
        finally:
            button.enable()

    warn_of_changes(app, shown)
    button.on_click(run)


async def _run(app: App, texts: Texts, shown: ui.element) -> None:
    """Simulate the robot with the texts of the form, and show plots in `shown` and the motion."""
    system = app.checked_system()
    if system is None:
        return
    settings, document = settings_of(system, texts, app.q), app.document
    made = await app.run(f"Simulating {system.name}", film, settings)
    if made is None or shown.is_deleted:
        return
    app.session.notes[_FILM] = (document, made)
    with new_answer(app, shown, document):
        player = _show(app, system, made)
        if document == app.document:
            await player.play()
    come_into_view(shown)


def _show(app: App, system: System, made: Movie) -> Player:
    """Show plots of a motion and return its player."""
    result = made.result

    async def download() -> None:
        content = await asyncio.to_thread(csv_bytes, result)
        app.download(content, f"{file_stem(system)}_motion.csv")

    groups = groups_of(system, result)
    with ui.element("div").classes("app-result-head"):
        choice = ui.toggle(list(groups), value=next(iter(groups)))
        choice.props("dense flat no-caps size=12.5px padding='3px 10px'").mark("plots")
        ui.space()
        table = ui.button("CSV", icon="download").props("flat dense no-caps")
        table.tooltip("All signals as comma-separated values").mark("csv")
        table.on_click(download)
    player = Player(app, made)
    charts = ui.element("div").style("width: 100%")
    _facts(system, made)

    def draw() -> None:
        charts.clear()
        with charts:
            _draw(made, groups[str(choice.value)])

    choice.on_value_change(draw)
    draw()
    return player


def _draw(made: Movie, charts: Charts) -> None:
    """Show the charts of a group of signals."""
    height = 225 if len(charts) == 1 else 170
    for unit, series in charts.items():
        ui.echart(line_chart(made.result.time, series, unit)).style(
            f"width: 100%; height: {height}px"
        ).mark("chart")


def _facts(system: System, made: Movie) -> None:
    """Show numbers that indicate the accuracy of the motion: energies and closure residual."""
    result = made.result
    energy = result["kinetic_energy"] + result["potential_energy"]
    facts = [
        f"{len(result)} rows",
        f"energy goes from {energy[0]:.6g} to {energy[-1]:.6g} J",
    ]
    if system.is_closed:
        facts.append(f"loops open by {result['closure_residual'].max():.1e} at most")
    facts += [f"{name}: {words} at {instant:.4g} s" for instant, name, words in result.events[:4]]
    ui.label("; ".join(facts)).classes("app-note").mark("facts")
