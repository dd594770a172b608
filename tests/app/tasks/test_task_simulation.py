"""The simulations of forms and commands, against direct calls of `mbs.simulate.run`."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.messages import refused

import mbs
from mbs.app.tasks.laws import assignments, law_of_time, number
from mbs.app.tasks.simulation import (
    SimulationSettings,
    csv_bytes,
    film,
    known_values,
    run_arguments,
    simulate,
)
from mbs.errors import DescriptionError, ExpressionError, ModelError


@pytest.fixture(scope="module")
def arm():
    return catalogue_system("planar_2r")


@pytest.fixture(scope="module")
def symbolic_arm():
    frames = [{"antecedent": 0}, {"antecedent": 1, "d": "L1"}]
    bodies = [{"frame": j, "YY": 0.5, "ZZ": 0.5, "MX": "m*L1/2", "M": "m"} for j in (1, 2)]
    table = {"name": "symbolic", "gravity": [0, -9.81, 0], "frame": frames, "body": bodies}
    return mbs.load(table | {"parameters": {"L1": 0.8, "m": 2.0}}).assemble()


def test_texts_simulate_what_functions_do(arm):
    texts = SimulationSettings(
        duration="1/2",
        options={"step": 0.05},
        q0={"q1": "pi/4"},
        v0={"q2": "-0.5"},
        tau={"q1": "5*sin(2*t) - 0.3*q1.v", "q2": "2*(q1.q - q2.q)"},
    )
    direct = mbs.simulate.run(
        arm,
        0.5,
        step=0.05,
        q0={"q1": np.pi / 4},
        v0={"q2": -0.5},
        tau=lambda t, q, v: casadi.vertcat(5 * casadi.sin(2 * t) - 0.3 * v[0], 2 * (q[0] - q[1])),
    )
    result = simulate(arm, texts, quiet=True)
    assert result.names == direct.names
    np.testing.assert_allclose(result.values, direct.values, rtol=1e-9, atol=1e-10)
    assert np.ptp(result["q1.tau"]) > 1


def test_a_law_drives_a_coordinate(arm):
    result = simulate(
        arm, SimulationSettings(duration=1, motion={"q1.q": "0.5*sin(3*t)"}), quiet=True
    )
    np.testing.assert_allclose(result["q1.q"], 0.5 * np.sin(3 * result.time), atol=1e-9)
    np.testing.assert_allclose(result["q1.a"], -4.5 * np.sin(3 * result.time), atol=1e-7)


def test_symbols_of_the_system_stand_in_laws_and_numbers(symbolic_arm):
    given = SimulationSettings(
        duration=0.2, q0={"q1": "L1"}, tau={"q1": "m*t"}, parameters={"L1": "0.3 + 0.1"}
    )
    result = simulate(symbolic_arm, given, quiet=True)
    assert result["q1.q"][0] == pytest.approx(0.4)
    np.testing.assert_allclose(result["q1.tau"], 2.0 * result.time, atol=1e-12)
    assert known_values(symbolic_arm, {"L1": 0.4}) == {"L1": 0.4, "m": 2.0}


def test_a_four_bar_stays_closed_and_keeps_its_energy():
    system = catalogue_system("four_bar")
    result = simulate(system, SimulationSettings(duration=1, q0={"j1": 0.5}), quiet=True)
    assert result["closure_residual"].max() < 1e-8
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(energy) < 1e-6 < np.ptp(result["kinetic_energy"])


def test_a_film_keeps_the_rows_that_a_picture_needs(arm):
    shown = film(arm, SimulationSettings(duration=10, options={"step": 0.005}))
    assert len(shown.result) == 2001
    assert (len(shown.times), shown.configurations.shape) == (300, (300, 2))
    assert (shown.times[0], shown.times[-1]) == (0.0, 10.0)
    rows = np.searchsorted(shown.result.time, shown.times)
    np.testing.assert_array_equal(shown.configurations[:, 1], shown.result["q2.q"][rows])
    many = SimulationSettings(options={"step": 1e-6})
    refused(ModelError, "100000 rows", by=lambda: film(arm, many))


def test_the_table_of_a_result_reads_back_bit_for_bit(arm, tmp_path):
    result = simulate(arm, SimulationSettings(duration=0.1), quiet=True)
    lines = csv_bytes(result).decode().splitlines()
    assert lines[0].split(",") == ["time", *result.names]
    rows = np.array([line.split(",") for line in lines[1:]], dtype=float)
    np.testing.assert_array_equal(rows, np.column_stack([result.time, result.values]))


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ({"tau": {"q1": "5*sin(w*t)"}}, ("tau of q1", "'w'", "q1.q")),
        ({"tau": {"q1": "1/(t-t)"}}, ("tau of q1", "no finite value")),
        ({"tau": {"q1": "__import__('os')"}}, ("tau of q1", "unexpected")),
        ({"tau": {"q1": "t" * 2000}}, ("2000 characters",)),
        ({"tau": {"elbow": "1"}}, ("'elbow'", "q1, q2")),
        ({"q0": {"q1": "x"}}, ("q0 of q1", "'x'", "write numbers")),
        ({"q0": {"q1": "t"}}, ("q0 of q1", "'t'")),
        ({"duration": "1/0"}, ("duration", "not a finite number")),
        ({"duration": "-1"}, ("duration", "finite positive")),
        ({"options": {"step": "0"}}, ("step", "finite positive")),
        ({"options": {"tolerance": "tight"}}, ("tolerance", "'tight'")),
        ({"options": {"method": "euler"}}, ("'euler'", "dopri5, rodas")),
        ({"motion": {"q1": "t"}}, ("'q1'", "'q1.q'")),
        ({"motion": {"q1.q": "q2.q"}}, ("motion of q1.q", "'q2.q'")),
        ({"inputs": {"motor": "1"}}, ("no motor",)),
        ({"parameters": {"L": "1"}}, ("'L'",)),
    ],
)
def test_mistakes_are_refused_with_a_sentence(arm, given, parts):
    refused(
        (ModelError, ExpressionError),
        *parts,
        by=lambda: simulate(arm, SimulationSettings(**given), quiet=True),
    )


def test_a_joint_without_motor_has_no_effort():
    system = catalogue_system("four_bar")
    refused(
        ModelError,
        "'j2'",
        "no motor",
        by=lambda: run_arguments(system, SimulationSettings(tau={"j2": "t"})),
    )


def test_assignments_of_a_command():
    assert assignments(["j1 = 0.3", "j2=pi/4"], "q0") == {"j1": "0.3", "j2": "pi/4"}
    refused(DescriptionError, "'j1'", "NAME=VALUE", by=lambda: assignments(["j1"], "q0"))
    refused(DescriptionError, "given twice", by=lambda: assignments(["a=1", "a=2"], "q0"))


def test_a_constant_law_is_a_number():
    assert law_of_time("2*A", {"A": 1.5}, "law") == 3.0


@settings(max_examples=200, deadline=None)
@given(st.text("0123456789.+-*/^()tsincoqrp ", max_size=30))
def test_any_text_is_a_number_or_a_sentence(text):
    sentence, value = "", 0.0
    try:
        value = number(text, "field", {"t": 0.5})
    except mbs.MbsError as error:
        sentence = str(error)
    assert sentence.startswith("field: ") if sentence else np.isfinite(value)
