"""Identification from the bytes of a record: numbers against the system that made it."""

from __future__ import annotations

import csv
import io
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.messages import refused

import mbs
from mbs.app.tasks.identification import (
    LARGEST,
    IdentificationSettings,
    identify,
    record_columns,
    record_of,
)
from mbs.app.tasks.simulation import SimulationSettings, csv_bytes, simulate
from mbs.errors import ExpressionError, ModelError

NOISE = 0.02


@cache
def _arm():
    return catalogue_system("planar_2r")


@pytest.fixture(scope="module")
def arm():
    return _arm()


@pytest.fixture(scope="module")
def motion(arm):
    laws = {"q1.q": "0.5*sin(2*t) + 0.3*cos(5*t)", "q2.q": "0.7*sin(3*t) + 0.2*cos(7*t)"}
    return simulate(
        arm, SimulationSettings(duration=10, options={"step": 0.005}, motion=laws), quiet=True
    )


@pytest.fixture(scope="module")
def record(motion):
    """The motion with noise on the efforts, seeded."""
    rng = np.random.default_rng(3)
    values = motion.values.copy()
    for name in ("q1.tau", "q2.tau"):
        values[:, motion.names.index(name)] += rng.normal(0, NOISE, len(motion))
    return csv_bytes(mbs.Result(motion.time, values, motion.units))


@pytest.fixture(scope="module")
def found(arm, record):
    return identify(arm, record, IdentificationSettings(bandwidth="20"), quiet=True)


def test_base_parameters_are_those_of_the_arm(arm, found):
    base = mbs.identification.base_parameters(arm)
    true = dict(zip(base.names, base.matrix @ _values(arm, base.columns), strict=True))
    assert {row.name for row in found.rows} == set(true)
    for row in found.rows:
        assert abs(row.value - true[row.name]) < 5 * row.deviation + 1e-3
    needed = {row.name for row in found.rows if row.essential}
    assert {"ZZ1R", "MX1R", "ZZ2", "MX2"} <= needed < set(true)
    (row,) = (row for row in found.rows if row.name == "MX1R")
    assert (row.unit, row.grouping) == ("kg.m", "MX1R = MX1 + M2")


def _values(system, columns):
    from mbs.identification import symbolic_parameters

    return np.array([float(x) for x in symbolic_parameters(system, columns).elements()])


def test_errors_of_prediction_are_the_noise(found):
    assert [effort.name for effort in found.efforts] == ["q1", "q2"]
    for effort, error in zip(found.efforts, (found.measured - found.predicted).T, strict=True):
        assert effort.unit == "N.m"
        assert effort.rms == pytest.approx(np.sqrt(np.mean(error**2)))
        assert 0 < effort.rms < NOISE
        assert 0 < effort.held_out_rms < 2 * NOISE
    assert 0 < found.total_percent < 0.5
    assert 0 < found.held_out_percent < 1
    assert "Errors" in found.text
    assert "link2" in found.bodies


def test_tables_hold_the_same_numbers(found):
    rows = list(csv.DictReader(io.StringIO(found.csv())))
    assert [row["name"] for row in rows] == [row.name for row in found.rows]
    assert [float(row["value"]) for row in rows] == [row.value for row in found.rows]
    lines = list(csv.reader(io.StringIO(found.residuals_csv())))
    assert lines[0] == ["time", "q1.measured", "q1.predicted", "q2.measured", "q2.predicted"]
    numbers = np.array(lines[1:], dtype=float)
    np.testing.assert_array_equal(numbers[:, 0], found.time)
    np.testing.assert_array_equal(numbers[:, 1::2], found.measured)
    np.testing.assert_array_equal(numbers[:, 2::2], found.predicted)


def test_settings_reach_the_estimation(arm, record):
    options = {"method": "least_squares", "equations": "energy", "rotors": False, "offsets": True}
    chosen = IdentificationSettings(20, "measured", options)
    found = identify(arm, record, chosen, quiet=True)
    names = {row.name for row in found.rows}
    assert not any(name.startswith("Ia") for name in names)
    assert any("least squares" in line for line in found.text.splitlines())
    assert found.measured.shape[1] == 1


def test_a_closed_system_needs_its_independent_joints_alone():
    system = catalogue_system("four_bar")
    columns = record_columns(system)
    assert columns["tau"] == ("j1.tau",)
    assert set(columns["q"]) == {"j1.q", "j2.q", "j4.q"}
    time = np.linspace(0, 1, 60)
    rows = "".join(f"{t!r},{0.1 * t!r},{t!r}\n" for t in time.tolist())
    record = record_of(system, f"time,j1.tau,j1.q\n{rows}".encode())
    assert record.names == ("j1",)
    np.testing.assert_array_equal(record.q[:, 0], time)


def test_columns_may_stand_in_any_order(arm, motion):
    names = ["q2.tau", "q1.q", "time", "kinetic_energy", "q2.q", "q1.tau"]
    columns = [motion.time if name == "time" else motion[name] for name in names]
    rows = "\n".join(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())
    record = record_of(arm, f"{','.join(names)}\n{rows}\n".encode())
    np.testing.assert_array_equal(record.tau, np.column_stack([motion["q1.tau"], motion["q2.tau"]]))
    assert record.v is None


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        (b"", ("no rows",)),
        (b"\xff\xfe\x00", ("cannot be read",)),
        (b"time;q1.q;q2.q\n0;0;0\n", ("';'", "commas")),
        (b"0,1,2\n3,4,5\n", ("names of the columns",)),
        (b"time,q1.q,q2.q,q1.tau\n0,0,0,0\n", ("'q2.tau'", "did you mean")),
        (b"time,q1.q,q1.tau,q2.tau\n0,0,0,0\n", ("'q2.q'",)),
        (b"q1.q,q2.q,q1.tau,q2.tau\n0,0,0,0\n", ("'time'",)),
        (b"time,q1.q,q2.q,q1.tau,q2.tau\n0,0,0,0,0\n", ("1 rows", "too short")),
        (b"time,q1.q,q2.q,q1.tau,q2.tau\n0,0,0,zero,0\n", ("row 2", "zero")),
        (b"time,q1.q,q2.q,q1.tau,q2.tau\n0,0,0\n", ("row 2", "3 fields")),
        (b"0" * (LARGEST + 1), ("20.0 MB",)),
    ],
)
def test_malformed_files_are_refused_with_a_sentence(arm, content, parts):
    message = refused(ModelError, *parts, by=lambda: record_of(arm, content))
    assert "/" not in message.replace("FROM/TO", "")


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ({"options": {"method": "magic"}}, ("'magic'", "weighted")),
        ({"options": {"equations": "static"}}, ("'static'", "dynamic")),
        ({"velocities": "guessed"}, ("'guessed'", "measured")),
        ({"bandwidth": "high"}, ("bandwidth", "'high'")),
        ({"bandwidth": 5000}, ("bandwidth", "100 Hz")),
    ],
)
def test_settings_are_refused_with_a_sentence(arm, record, given, parts):
    refused(
        (ModelError, ExpressionError),
        *parts,
        by=lambda: identify(arm, record, IdentificationSettings(**given), quiet=True),
    )


_FIELDS = st.one_of(
    st.sampled_from(
        ["time", "q1.q", "q2.q", "q1.v", "q1.tau", "q2.tau", "0", "1e999", "nan", "-3.5", '"', ""]
    ),
    st.text(max_size=6),
)
_TABLES = st.lists(st.lists(_FIELDS, max_size=7).map(",".join), max_size=8).map("\n".join)


@settings(max_examples=150, deadline=None)
@given(st.one_of(_TABLES.map(lambda text: text.encode("utf-8", "replace")), st.binary(max_size=80)))
def test_any_file_is_a_record_or_a_sentence(content):
    with pytest.raises(mbs.MbsError, match="record"):
        record_of(_arm(), content)
