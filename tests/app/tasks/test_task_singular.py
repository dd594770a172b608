"""Determinants in factors, their words, and configurations where they vanish."""

import pickle

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.app.tasks.singular import condition, singular
from mbs.errors import ModelError
from mbs.models import jacobian, jacobian_determinant

NEAR = [0.2, 0.4, -0.5, 0.3, 0.7, 0.1]


def test_the_rx90_is_singular_in_three_ways():
    rx90 = catalogue_system("rx90")
    found = singular(rx90, near=NEAR)
    assert found.determinant == "det J = (-0.091125) * (S23 - C2) * (C3) * (S5)"
    words = [one.condition for one in found.factors]
    assert words == [
        "S23 - C2 = 0",
        "q3 is -pi/2 or pi/2 (C3 = 0)",
        "q5 is 0 or pi (S5 = 0)",
    ]
    assert found.verdict == "Singular where " + ", or where ".join(words) + "."
    assert pickle.loads(pickle.dumps(found)) == found


def test_the_configurations_shown_are_singular_and_near():
    rx90 = catalogue_system("rx90")
    for one in singular(rx90, near=NEAR).factors:
        J = np.array(jacobian(rx90, 6)(one.configuration))
        assert np.linalg.svd(J)[1][-1] < 1e-9
        assert abs(one.determinant) < 1e-12
        assert np.abs(np.array(one.configuration) - NEAR).max() < 1.3
    wrist = singular(rx90, near=NEAR).factors[2].configuration
    assert wrist == pytest.approx([*NEAR[:4], 0.0, NEAR[5]])


def test_loops_are_closed_where_a_closed_robot_is_singular():
    five_bar = catalogue_system("five_bar")
    found = singular(five_bar)
    assert (found.rows, found.columns) == (("Vx", "Vy"), ("q1", "q3"))
    for one in found.factors:
        assert mbs.loops.configuration_report(five_bar, one.configuration).residual < 1e-9
        assert abs(one.determinant) < 1e-9


def test_no_configuration_or_every_configuration_is_singular():
    planar = catalogue_system("planar_2r")
    flat = singular(planar, {"frame": 1, "rows": ("wz",), "columns": ("q1",)})
    assert (flat.factors, flat.constant) == ((), "1")
    assert flat.verdict == "The determinant is 1 in every configuration; none is singular."
    never = singular(planar, {"rows": ("Vz",), "columns": ("q1",)})
    assert never.verdict.startswith("The determinant is zero in every configuration")


def test_symbols_stay_in_the_constant():
    arm = mbs.load(
        {
            "name": "arm",
            "parameters": {"L1": 0.4, "L2": 0.3},
            "frame": [
                {"antecedent": 0},
                {"antecedent": 1, "d": "L1"},
                {"antecedent": 2, "d": "L2", "joint": "fixed"},
            ],
        }
    ).assemble()
    found = singular(arm, {"frame": 2, "rows": ("Vx", "wz")})
    det = jacobian_determinant(arm, 2, ("Vx", "wz"))
    assert found.constant == "-L1"
    assert float(det(found.factors[0].configuration)) == pytest.approx(0, abs=1e-12)


def test_conditions_in_words():
    names = [("q2", True), ("q3", True), ("q4", False), ("j1", True)]
    assert condition("C23", names) == "q2 + q3 is -pi/2 or pi/2 (C23 = 0)"
    assert condition("sin(j1 - q3)", names) == "j1 - q3 is 0 or pi (sin(j1 - q3) = 0)"
    assert condition("q4", names) == "q4 is 0"
    assert condition("L2 + C3", names) == "L2 + C3 = 0"
    block = "determinant of the 2 x 2 block of q2, q7"
    assert condition(block, names) == "the 2 x 2 block of q2, q7 is singular"


def test_wrong_options_are_refused():
    rx90 = catalogue_system("rx90")
    with pytest.raises(ModelError, match="there is no option 'row'"):
        singular(rx90, {"row": ("Vx",)})
    with pytest.raises(ModelError, match="3 rows and 2 columns"):
        singular(rx90, {"rows": ("Vx", "Vy", "Vz"), "columns": ("q1", "q2")})
