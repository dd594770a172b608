"""The panel that simulates the robot, plots its motion and plays it in the picture."""

from __future__ import annotations

import asyncio
from typing import cast

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels.layout import new_answer, tell_of_changes
from mbs.app.desk.panels.plots import line_chart
from mbs.app.desk.panels.plots_look import add_look, come_into_view
from mbs.app.desk.panels.simulation_form import build_form
from mbs.app.desk.panels.simulation_groups import Charts, groups_of
from mbs.app.desk.panels.simulation_player import Player
from mbs.app.desk.panels.simulation_settings import Texts, first_texts, settings_of
from mbs.app.tasks.exporting import file_stem
from mbs.app.tasks.simulation import csv_bytes
from mbs.app.tasks.simulation_film import Film, film
from mbs.assembly import System

_NOTE = "simulation"
_FILM = "simulated"
"""Note of the document and what was simulated last, for a reload."""


def open_simulation(desk: Desk) -> None:
    """Open the panel for the present robot.

    Args:
        desk: of the page.
    """
    system = desk.checked_system()
    if system is None:
        return
    texts = first_texts(cast(Texts, desk.session.notes.get(_NOTE, {})))
    desk.session.notes[_NOTE] = texts
    add_look()
    with desk.open("Simulate", key="simulate"), ui.element("div").classes("desk-halves"):
        with ui.element("div").classes("desk-half").style("flex: 0 0 562px"):
            button = build_form(system, texts)
        shown = ui.element("div").classes("desk-half desk-stays")
        with shown:
            kept = desk.session.notes.get(_FILM)
            if isinstance(kept, tuple) and kept[0] == desk.document:
                _show(desk, system, kept[1])
            else:
                ui.label("Plots of the motion appear here; the picture moves.").classes("desk-note")

    async def run() -> None:
        button.disable()
        try:
            await _run(desk, texts, shown)
        finally:
            button.enable()

    tell_of_changes(desk, shown)
    button.on_click(run)


async def _run(desk: Desk, texts: Texts, shown: ui.element) -> None:
    system = desk.checked_system()
    if system is None:
        return
    settings, document = settings_of(system, texts, desk.q), desk.document
    made = await desk.run(f"Simulating {system.name}", film, settings)
    if made is None or shown.is_deleted:
        return
    desk.session.notes[_FILM] = (document, made)
    with new_answer(desk, shown, document):
        player = _show(desk, system, made)
        if document == desk.document:
            await player.play()
    come_into_view(shown)


def _show(desk: Desk, system: System, made: Film) -> Player:
    """Plots of a motion, and what plays it."""
    result = made.result

    async def download() -> None:
        content = await asyncio.to_thread(csv_bytes, result)
        desk.download(content, f"{file_stem(system)}_motion.csv")

    groups = groups_of(system, result)
    with ui.element("div").classes("desk-result-head"):
        choice = ui.toggle(list(groups), value=next(iter(groups)))
        choice.props("dense flat no-caps size=12.5px padding='3px 10px'").mark("plots")
        ui.space()
        table = ui.button("CSV", icon="download").props("flat dense no-caps")
        table.tooltip("All signals as comma-separated values").mark("csv")
        table.on_click(download)
    player = Player(desk, made)
    charts = ui.element("div").style("width: 100%")
    _facts(system, made)

    def draw() -> None:
        charts.clear()
        with charts:
            _draw(made, groups[str(choice.value)])

    choice.on_value_change(draw)
    draw()
    return player


def _draw(made: Film, charts: Charts) -> None:
    height = 225 if len(charts) == 1 else 170
    for unit, series in charts.items():
        ui.echart(line_chart(made.result.time, series, unit)).style(
            f"width: 100%; height: {height}px"
        ).mark("chart")


def _facts(system: System, made: Film) -> None:
    """What the numbers say about the quality of the motion."""
    result = made.result
    energy = result["kinetic_energy"] + result["potential_energy"]
    told = [
        f"{len(result)} rows",
        f"energy goes from {energy[0]:.6g} to {energy[-1]:.6g} J",
    ]
    if system.is_closed:
        told.append(f"loops open by {result['closure_residual'].max():.1e} at most")
    told += [f"{name}: {words} at {instant:.4g} s" for instant, name, words in result.events[:4]]
    ui.label("; ".join(told)).classes("desk-note").mark("facts")
