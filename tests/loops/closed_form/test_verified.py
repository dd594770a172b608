"""Plans are held against configurations: what does not close is refused or left out."""

from dataclasses import replace

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

from mbs.errors import NoClosedForm
from mbs.loops import assembly_modes
from mbs.loops.plan import plan, started_at, verify


def changed(stage, labels, change):
    """The stage whose ways are what `change` makes of the (k, 2) values."""
    sizes = [stage.values.size1_in(k) for k in range(2)]
    q, p = (casadi.SX.sym(name, size) for name, size in zip("qp", sizes, strict=True))
    values = casadi.Function("ways", [q, p], [change(stage.values(q, p))])
    return replace(stage, labels=labels, values=values)


def test_a_way_that_never_closes_is_left_out():
    system = catalogue_system("four_bar")
    (stage,) = plan(system)
    more = changed(
        stage, ("x", *stage.labels), lambda v: casadi.horzcat(v[:, 0] + 0.3, v[:, 0], v[:, 1])
    )
    (kept,) = verify(system, [more])
    assert kept.labels == stage.labels
    assert kept.chosen == stage.chosen
    q = started_at(system, np.array(assembly_modes(system, {"j1": 0.3})[0].q))
    np.testing.assert_array_equal(np.array(kept.values(q, [])), np.array(stage.values(q, [])))


def test_a_plan_that_does_not_give_the_assembled_configuration_is_refused():
    system = catalogue_system("four_bar")
    (stage,) = plan(system)
    wrong = changed(stage, stage.labels, lambda v: v + 0.3)
    with pytest.raises(NoClosedForm, match="the loop of j3 does not close as the directions"):
        verify(system, [wrong])


def test_a_way_out_of_reach_is_kept():
    system = catalogue_system("four_bar")
    (stage,) = plan(system)
    lost = changed(
        stage, (*stage.labels, "x"), lambda v: casadi.horzcat(v, casadi.sqrt(-1 - v[:, 0] ** 2))
    )
    (kept,) = verify(system, [lost])
    assert kept.labels == (*stage.labels, "x")
