"""The panel of simulations: its settings, plots, and what a visitor does with it."""

from __future__ import annotations

import numpy as np
import pytest
from nicegui import ui
from support.panel_pages import PATIENT, visited

import mbs
from mbs.app.tasks.simulation import SimulationSettings, run_arguments, simulate
from mbs.app.web.app import App
from mbs.app.web.panels.plots import kept_rows, line_chart
from mbs.app.web.panels.simulation import (
    TYPED,
    first_texts,
    groups_of,
    open_simulation,
    settings_of,
)


@pytest.fixture(scope="module")
def four_bar():
    return mbs.load("four_bar").assemble()


def test_an_untouched_form_starts_at_the_configuration_of_the_picture(four_bar):
    settings = settings_of(four_bar, first_texts({}), four_bar.configuration)
    arguments = run_arguments(four_bar, settings)
    assert arguments["q0"] == list(four_bar.configuration)
    assert arguments["tau"] is None
    assert (arguments["duration"], arguments["step"]) == (2.0, 0.01)


def test_typed_fields_become_settings(four_bar):
    texts = {"start": TYPED, "q0.j1": " 0.3 ", "v0.j1": "1", "law.j1": "5*t", "law.j9": "7"}
    settings = settings_of(four_bar, first_texts(texts), four_bar.configuration)
    assert settings.q0 == {"j1": "0.3"}
    assert settings.v0 == {"j1": "1"}
    assert (settings.tau, settings.motion) == ({"j1": "5*t"}, {})
    driven = settings_of(four_bar, first_texts({**texts, "kind.j1": "q"}), four_bar.configuration)
    assert (driven.tau, driven.motion) == ({}, {"j1.q": "5*t"})


def test_a_drive_leaves_its_own_joint_out_of_the_configuration():
    arm = mbs.load("planar_2r").assemble()
    texts = first_texts({"law.q1": "0.2 + t", "kind.q1": "q", "duration": "0.1"})
    settings = settings_of(arm, texts, (0.0, 0.7))
    assert run_arguments(arm, settings)["q0"] == {"q2": 0.7}
    result = simulate(arm, settings, quiet=True)
    assert result["q1.q"][0] == pytest.approx(0.2)
    assert result["q2.q"][0] == pytest.approx(0.7)


def test_signals_stand_in_their_groups(four_bar):
    result = mbs.simulate.run(four_bar, 0.1, quiet=True)
    groups = groups_of(four_bar, result)
    assert list(groups) == [
        "Positions",
        "Velocities",
        "Accelerations",
        "Efforts",
        "Energy",
        "Closure",
    ]
    assert set(groups["Positions"]["rad"]) == {"j1", "j2", "j4"}
    energy = groups["Energy"]["J"]
    np.testing.assert_array_equal(energy["total"], energy["kinetic"] + energy["potential"])
    assert list(groups["Closure"]["1"]) == ["largest row"]
    arm = mbs.load("cart_pole").assemble()
    groups = groups_of(arm, mbs.simulate.run(arm, 0.1, quiet=True))
    assert set(groups["Positions"]) == {"m", "rad"}
    assert "Closure" not in groups


def test_a_long_signal_keeps_its_ends_and_extremes():
    time = np.linspace(0, 1, 50_001)
    spike = np.where(np.arange(50_001) == 31_234, 5.0, np.sin(time))
    rows = kept_rows([spike, -spike], 500)
    assert 100 < len(rows) <= 1000
    assert {0, 31_234, 50_000} <= set(rows.tolist())
    assert (np.diff(rows) > 0).all()
    np.testing.assert_array_equal(kept_rows([spike[:200]], 500), np.arange(200))
    chart = line_chart(time, {"a": spike}, "rad")
    assert max(y for _, y in chart["series"][0]["data"]) == 5.0
    assert chart["yAxis"]["name"] == "[rad]"


def test_a_chart_leaves_out_what_is_no_number():
    chart = line_chart(np.arange(3.0), {"a": np.array([1.0, np.nan, 2.0])}, "1")
    assert chart["series"][0]["data"] == [[0.0, 1.0], [1.0, None], [2.0, 2.0]]


def test_a_visitor_simulates_and_reads_a_mistake(monkeypatch):
    async def visit(user, app):
        user.find(marker="law.q1").type("5*sin(2*x)")
        user.find(marker="duration").clear().type("0.2")
        user.find(marker="simulate").click()
        await user.should_see("there is no symbol 'x' here", retries=PATIENT)
        user.find(marker="law.q1").clear().type("5*sin(2*t)")
        user.find(marker="simulate").click()
        await user.should_see(marker="facts", retries=PATIENT)
        (chart,) = user.find(ui.echart).elements
        assert [line["name"] for line in chart.options["series"]] == [f"q{k}" for k in range(1, 7)]
        assert len(chart.options["series"][0]["data"]) == 21
        user.find(marker="csv").click()
        response = await user.download.next()
        lines = response.text.splitlines()
        assert lines[0].startswith("time,q1.q,")
        assert len(lines) == 22
        assert app.session.notes["simulation"]["law.q1"] == "5*sin(2*t)"

    visited(open_simulation, "rx90", visit, monkeypatch)


def test_the_slider_moves_the_picture(monkeypatch):
    seen = []

    async def set_configuration(app, q):
        seen.append(tuple(q))

    monkeypatch.setattr(App, "set_configuration", set_configuration)

    async def visit(user, app):
        user.find(marker="simulate").click()
        await user.should_see(marker="facts", retries=PATIENT)
        user.find(marker="scrub").trigger("update:modelValue", 1.0)
        await user.should_see("1.00 s", retries=PATIENT)

    visited(open_simulation, "planar_2r", visit, monkeypatch)
    result = simulate(mbs.load("planar_2r").assemble(), SimulationSettings(), quiet=True)
    q = np.column_stack([result["q1.q"], result["q2.q"]])
    row = int(np.abs(q - seen[-1]).sum(axis=1).argmin())
    np.testing.assert_allclose(q[row], seen[-1], atol=1e-9)
    assert abs(result.time[row] - 1.0) < 0.03
