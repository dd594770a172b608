"""Parameter studies as tables, against single simulations."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.messages import refused

import mbs
from mbs.app.tasks.simulation import SimulationSettings
from mbs.app.tasks.sweeping import grid_of, sweep
from mbs.errors import ExpressionError, ModelError


def test_the_rows_are_the_ends_of_single_simulations():
    arm = catalogue_system("planar_2r")
    grid = grid_of({"q1.q": "0:1:0.5", "q2.v": "0, pi/2"})
    table = sweep(arm, grid, SimulationSettings(duration=0.1, tau={"q1": "t"}), quiet=True)
    assert table.columns[:2] == ("q1.q", "q2.v")
    assert table.units[:3] == ("rad", "rad/s", "rad")
    np.testing.assert_allclose(table.rows[:, 0], [0, 0, 0.5, 0.5, 1, 1])
    last = mbs.simulate.run(
        arm, 0.1, q0={"q1": 1.0}, v0={"q2": np.pi / 2}, tau=lambda t, q, v: [t, 0], quiet=True
    )
    k = table.columns.index("q2.q.end")
    assert table.rows[-1, k] == pytest.approx(last["q2.q"][-1], abs=1e-10)
    lines = list(csv.reader(io.StringIO(table.csv())))
    assert lines[0] == list(table.columns)
    np.testing.assert_array_equal(np.array(lines[1:], dtype=float), table.rows)


def test_a_case_that_fails_leaves_its_fields_empty():
    system = catalogue_system("four_bar")
    table = sweep(system, {"j4.q": [0.0, 1.2]}, SimulationSettings(duration=0.02), quiet=True)
    assert set(table.failures) == {0, 1}
    assert all("j4" in sentence for sentence in table.failures.values())
    assert table.csv().splitlines() == ["j4.q", "0.0", "1.2"]


@pytest.mark.parametrize(
    ("text", "values"),
    [("1", [1.0]), ("0:0.3:0.1", [0, 0.1, 0.2, 0.3]), ("1:0:-0.4", [1, 0.6, 0.2]), ("2:2:1", [2])],
)
def test_a_range_holds_both_ends_where_the_step_divides_it(text, values):
    np.testing.assert_allclose(grid_of({"a": text})["a"], values)


@pytest.mark.parametrize("text", ["0:1", "0:1:0", "0:1:-1", "0:1:1e-9", "0:1:2:3"])
def test_a_range_without_end_is_refused(text):
    refused(ModelError, "grid of a", text, by=lambda: grid_of({"a": text}))


def test_values_are_of_the_grammar():
    refused(ExpressionError, "grid of a", by=lambda: grid_of({"a": "0, one thing"}))
