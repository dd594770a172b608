"""Base parameters of mechanisms with closed loops."""

import numpy as np
import pytest
from casadi import Function, jacobian
from support.base_counts import ALONG_Y, LEVEL, PARALLELOGRAM, parallelogram, under
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import Body, Prismatic, Revolute
from mbs.identification import base_parameters, columns_of
from mbs.identification.grouping.grouping import default_parameters
from mbs.identification.grouping.numeric import closed_positions, random_states, sampled_regressor

CHOICES = ({"rotors": False, "friction": False}, {"friction": False}, {})
COUNTS = {
    ("sr400", None): (39, 42, 56),
    ("akr3000", None): (54, 59, 79),
    ("four_bar", None): (8, 8, 14),
    ("four_bar", LEVEL): (4, 4, 10),
    ("five_bar", None): (11, 11, 19),
    ("slider_crank", ALONG_Y): (6, 6, 12),
}


def counts(system):
    """By rules, and by the rank of random states, which has others in the numeric method."""
    choices = [columns_of(system, **only) for only in CHOICES]
    found = [base_parameters(system, columns=columns) for columns in choices]
    assert all(base.check.agrees for base in found), [base.check.text for base in found]
    ranked = base_parameters(system, "numeric", columns=choices[-1])
    assert ranked.count == found[-1].count == found[-1].check.rank
    return tuple(base.count for base in found)


@pytest.mark.sweep
@pytest.mark.parametrize(("name", "gravity"), COUNTS)
def test_counts(name, gravity):
    system = catalogue_system(name)
    system = system if gravity is None else under(system, gravity)
    assert counts(system) == COUNTS[name, gravity]


@pytest.mark.parametrize(("gravity", "expected"), [(ALONG_Y, (3, 3, 5)), (LEVEL, (1, 1, 3))])
def test_parallelogram_on_the_base(gravity, expected):
    assert counts(parallelogram(gravity)) == expected


def test_a_parallelogram_with_symbols_of_its_sides():
    rows = [dict(frame) for frame in PARALLELOGRAM]
    for number, side in ((1, "A"), (2, "B"), (3, "B"), (4, "A")):
        rows[number]["d"] = side
    system = parallelogram(ALONG_Y, rows, parameters={"A": 0.5, "B": 0.8})
    base = base_parameters(system, columns=columns_of(system, rotors=False, friction=False))
    assert base.equations == (
        "ZZ1R = ZZ1 + A^2*M2 + ZZ3",
        "MX1R = MX1 + A*M2 + MX3",
        "MY1R = MY1 + MY3",
    )
    assert base.check.agrees


def test_parallelogram_on_a_base_that_moves():
    base = base_parameters(parallelogram(LEVEL), moving_base=True)
    assert base.count == base.check.rank == 13
    assert base.check.error < 1e-9


@pytest.mark.parametrize("name", ["sr400", "four_bar", "delta"])
def test_efforts_in_base_parameters_are_the_same(name):
    system = catalogue_system(name)
    base = base_parameters(system)
    full = mbs.models.inverse_dynamics(system)
    fewer = mbs.models.inverse_dynamics(base.apply())
    rng = np.random.default_rng(5)
    for q in closed_positions(system, default_parameters(system), 5, 5).T:
        v, a = rng.uniform(-2, 2, (2, len(system.independent)))
        expected = np.array(full(q, v, a))
        scale = 1 + np.abs(expected).max()
        assert np.array(fewer(q, v, a)) == pytest.approx(expected, abs=1e-10 * scale)


def test_links_of_a_parallelogram_share_their_tensors():
    base = base_parameters(catalogue_system("sr400"))
    gone = {column.name for column in base.eliminated}
    assert {f"{kind}{link}" for kind in ("XX", "XY", "XZ", "YZ", "ZZ") for link in (7, 8)} <= gone
    equation = next(text for text in base.equations if text.startswith("ZZ2R"))
    assert "+ ZZ8" in equation


def test_what_the_rules_miss_is_told_and_applied():
    """The gears turn by sums and differences of the angles of the tool."""
    base = base_parameters(catalogue_system("differential_wrist"))
    assert not base.check.agrees
    assert base.check.applied
    assert base.count == base.check.rank == 20
    assert base.check.relations == (
        "D(MX4) = 2*D(MY2) - D(MX3)",
        "D(MY4) = 2*D(MX2) + D(MY3)",
    )
    assert base.check.text in base.text()


def test_squares_of_rates_are_dependent():
    """Pitch is half the sum of the motors' angles, roll half the difference."""
    base = base_parameters(catalogue_system("differential_wrist"))
    equations = {
        name.removesuffix("R"): text for name, text in zip(base.names, base.equations, strict=True)
    }
    assert {"Fv6", "ZZ4"} <= {column.name for column in base.eliminated}
    assert equations["Fv1"] == "Fv1R = Fv1 + 2*Fv6"
    assert equations["Fv5"] == "Fv5R = Fv5 - Fv6"


def test_a_link_on_a_cut_joint_of_the_base_turns_about_one_direction():
    base = base_parameters(mbs.robots.bricard().assemble())
    without = {column.name for column in base.without_effect}
    assert {"XZ5", "YZ5"} <= without
    assert base.count == base.check.rank == 23
    assert len(base.check.relations) == 1


def test_a_length_that_is_zero_by_default_stays_in_the_equations():
    offset = mbs.Parameter("e", 0.0)
    m = mbs.Mechanism("crank", gravity=(0, -9.81, 0), guess={"crank": 0.4})
    crank, rod, slider = (m.add(Body(name, mass=0.3)) for name in ("A", "B", "C"))
    pin = Revolute("pin")
    m.connect(m.world, Revolute("crank", actuated=True), crank)
    m.connect(crank.at(0.15), Revolute("rod"), rod)
    m.connect(m.world, Prismatic("slide", axis="x"), slider)
    m.connect(rod.at(0.3, offset, 0), pin, slider)
    m.cut(pin)
    system = m.assemble()
    columns = columns_of(system, rotors=False, friction=False)
    base = base_parameters(system, columns=columns)
    assert "MY2R = MY2 + e*M3" in base.equations
    p = np.array([0.05])
    W = sampled_regressor(system, columns, random_states(system, p, 40, 5), p)
    B = Function("B", [base.symbols, system.p], [jacobian(base.grouping, base.symbols)])(0, p)
    assert np.abs(W - W[:, base.indices] @ np.array(B)).max() < 1e-9 * np.abs(W).max()
