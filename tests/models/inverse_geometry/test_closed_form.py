"""Which closed form is taken, and what is said where there is none."""

import numpy as np
import pytest
from support.arms import general_6r
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.closed_form import sequence_of


def equations(sequence):
    return [one.equation for one in sequence.steps]


def test_pieper_is_taken_for_a_wrist_and_kept():
    way = frame_chain(catalogue_system("puma560"))
    auto = sequence_of(way)
    assert equations(auto) == equations(sequence_of(way, "pieper"))
    assert sequence_of(frame_chain(way.system)) is auto
    assert sequence_of(way, "pieper", np.zeros(0)) is not sequence_of(way, "pieper")
    assert auto.branches == sequence_of(way, "paul").branches == 8


def test_paul_is_taken_where_no_axes_meet():
    way = frame_chain(catalogue_system("ur5"))
    assert equations(sequence_of(way)) == equations(sequence_of(way, "paul"))
    with pytest.raises(NoClosedForm, match=r"^ur5: no closed form gives q1, .*\(pieper: "):
        sequence_of(way, "pieper")


def test_numbers_take_the_place_of_parameters():
    rows = [{"antecedent": 0, "joint": "revolute"}, {"antecedent": 1, "joint": "revolute"}]
    rows[1]["d"] = 0.3
    rows += [{"antecedent": 2, "joint": "revolute", "d": "L"}]
    rows += [{"antecedent": 3, "joint": "prismatic", "d": 0.5}]
    way = frame_chain(mbs.load({"name": "l", "parameters": {"L": 0.4}, "frame": rows}).assemble())
    symbolic, numeric = sequence_of(way), sequence_of(way, p=np.array([0.4]))
    assert symbolic.steps[0].function.size_in(1) == (13, 1)
    assert numeric.steps[0].function.size_in(1) == (12, 1)


def test_refusals_name_the_reasons():
    way = frame_chain(general_6r(1))
    for _ in range(2):
        with pytest.raises(NoClosedForm, match=r"pieper: .*; paul: .*inverse_geometry\.solve"):
            sequence_of(way)
    with pytest.raises(ModelError, match=r"method is 'peiper'.*did you mean 'pieper'"):
        sequence_of(way, "peiper")
