"""Base parameters of mechanisms with closed loops."""

import numpy as np
import pytest
from support.base_counts import ALONG_Y, LEVEL, parallelogram

import mbs
from mbs.identification.base.samples import default_parameters
from mbs.identification.base.states import closed_positions
from mbs.identification.base_parameters import base_parameters
from mbs.identification.columns import columns_of

CHOICES = ({"rotors": False, "friction": False}, {"friction": False}, {})
COUNTS = {"sr400": (39, 42, 56), "four_bar": (8, 8, 14), "five_bar": (11, 11, 19)}


def counts(system):
    found = [base_parameters(system, columns=columns_of(system, **only)) for only in CHOICES]
    assert all(base.check.agrees for base in found), [base.check.text for base in found]
    return tuple(base.count for base in found)


@pytest.mark.parametrize("name", COUNTS)
def test_counts(name):
    assert counts(mbs.load(name).assemble()) == COUNTS[name]


@pytest.mark.parametrize(("gravity", "expected"), [(ALONG_Y, (3, 3, 5)), (LEVEL, (1, 1, 3))])
def test_parallelogram_on_the_base(gravity, expected):
    assert counts(parallelogram(gravity)) == expected


def test_parallelogram_on_a_base_that_moves():
    base = base_parameters(parallelogram(LEVEL), moving_base=True)
    assert base.count == base.check.rank == 13
    assert base.check.error < 1e-9


@pytest.mark.parametrize("name", ["sr400", "four_bar", "delta"])
def test_efforts_in_base_parameters_are_the_same(name):
    system = mbs.load(name).assemble()
    base = base_parameters(system)
    full = mbs.models.inverse_dynamics(system)
    fewer = mbs.models.inverse_dynamics(base.apply())
    rng = np.random.default_rng(5)
    for q in closed_positions(system, default_parameters(system), 5, rng).T:
        v, a = rng.uniform(-2, 2, (2, len(system.active)))
        expected = np.array(full(q, v, a))
        scale = 1 + np.abs(expected).max()
        assert np.array(fewer(q, v, a)) == pytest.approx(expected, abs=1e-10 * scale)


def test_links_of_a_parallelogram_share_their_tensors():
    base = base_parameters(mbs.load("sr400").assemble())
    gone = {column.name for column in base.eliminated}
    assert {f"{kind}{link}" for kind in ("XX", "XY", "XZ", "YZ", "ZZ") for link in (7, 8)} <= gone
    equation = next(text for text in base.equations if text.startswith("ZZ2R"))
    assert "+ ZZ8" in equation


def test_what_the_rules_miss_is_told_and_applied():
    base = base_parameters(mbs.load("differential_wrist").assemble())
    assert not base.check.agrees
    assert base.check.applied
    assert base.count == base.check.rank == 20
    assert len(base.check.relations) == 4
    assert "D(ZZ4) = " in base.check.text
    assert base.check.text in base.text()
