"""Operations of many models, before and after the optimizer."""

import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.app.tasks.equations import counts
from mbs.errors import ModelError
from mbs.operations import count, simplify


def test_counts_are_those_of_the_functions():
    four_bar = catalogue_system("four_bar")
    idm, pieper, closure = counts(four_bar, ("idm", "igm-pieper", "closure"))
    model = mbs.models.inverse_dynamics(four_bar)
    assert (idm.before, idm.after) == (count(model), count(simplify(model)))
    assert idm.after.total < idm.before.total
    assert (pieper.before, pieper.after) == (None, None)
    assert "four_bar has 2 at most" in pieper.reason
    assert closure.reason == ""


def test_without_passes_nothing_changes():
    rows = counts(catalogue_system("planar_2r"), (), ())
    assert len(rows) > 15
    assert all(row.before == row.after for row in rows)
    reasons = {row.key: row.reason for row in rows if row.reason}
    assert "for mechanisms with closed loops" in reasons["closure"]
    with pytest.raises(ModelError, match="there is no model 'idn'"):
        counts(catalogue_system("planar_2r"), ("idn",))
