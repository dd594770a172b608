"""What a configuration is worth: closed or open, singular, led by its independent joints."""

import math

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.messages import refused

import mbs
from mbs.components import Body, Revolute
from mbs.errors import AssemblyError, DescriptionError, ModelError, SingularPosture, Unclosable
from mbs.loops import configuration_report
from mbs.loops.examination import require_determined, row_independence
from mbs.loops.velocity import constraint_jacobian, scales

GUESS = {"j1": 1.0, "j2": -0.5, "j4": 1.5}


def four_bar(crank=0.3, **driven):
    """A crank-rocker: the crank j1 runs round, the rocker j4 turns back."""
    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    a, b, c = (m.add(Body(name, mass=1, inertia=(0, 0.1, 0.1))) for name in "abc")
    m.connect(m.world, Revolute("j1", **driven), a)
    m.connect(a.at(crank), Revolute("j2"), b)
    m.connect(b.at(0.7), closing := Revolute("j3"), c.at(0.8))
    m.connect(m.world.at(0.9), Revolute("j4"), c)
    m.cut(closing)
    return m


def test_a_regular_configuration_is_closed_and_led():
    system = four_bar(actuated=True).assemble(GUESS)
    state = configuration_report(system, system.configuration)
    assert state.is_closed
    assert state.is_led
    assert not state.is_singular
    assert (state.mobility, state.generic) == (1, 1)


def test_an_open_configuration_says_by_how_much():
    system = four_bar(actuated=True).assemble(GUESS)
    q = np.array(system.configuration)
    q[0] += 0.1
    state = configuration_report(system, q)
    assert not state.is_closed
    assert 1e-3 < state.residual < 0.1
    refused(
        Unclosable,
        "q leaves the loops open by",
        by=lambda: require_determined(system, q, np.empty(0)),
    )


def test_a_dead_point_is_not_led_and_not_singular():
    """Led by the rocker, the mechanism cannot go on where crank and coupler are in line."""
    system = four_bar().assemble(GUESS, active=["j4"])
    reach, ground, rocker = 0.3 + 0.7, 0.9, 0.8
    cosine = (reach**2 + ground**2 - rocker**2) / (2 * reach * ground)
    crank = math.acos(cosine)
    top = reach * np.array([math.cos(crank), math.sin(crank)])
    q = [crank, 0.0, math.atan2(top[1], top[0] - ground)]
    state = configuration_report(system, q)
    assert state.is_closed
    assert not state.is_singular
    assert not state.is_led
    refused(
        SingularPosture,
        "the configuration is singular, j4 cannot lead the other joints there",
        'coordinates="tree"',
        by=lambda: require_determined(system, q, np.empty(0)),
    )
    assert configuration_report(four_bar().assemble(GUESS, active=["j1"]), q).is_led


@pytest.mark.parametrize("loops", [1, 2, 3])
def test_a_row_of_four_bars_in_line_gains_a_motion_for_every_loop(loops):
    system = mbs.robots.n_four_bar(loops).assemble(active=["a0"])
    flat = configuration_report(system, [0.0] * system.nq)
    assert flat.is_closed
    assert flat.is_singular
    assert (flat.mobility, flat.generic) == (loops + 1, 1)
    assert not flat.is_led


def test_the_parameters_count():
    system = four_bar(mbs.Parameter("L", 0.3)).assemble(GUESS)
    assert configuration_report(system, system.configuration).is_closed
    assert not configuration_report(system, system.configuration, parameters={"L": 0.35}).is_closed


def test_an_open_chain_has_nothing_to_examine():
    system = catalogue_system("planar_2r")
    refused(
        ModelError, "an open chain has no loops", by=lambda: configuration_report(system, [0, 0])
    )


def test_the_user_chooses_the_independent_joints():
    for name in ("a0", "b0", "a1"):
        system = mbs.robots.n_four_bar(1).assemble(active=[name])
        assert [system.velocity_coordinates[k].name for k in system.independent] == [name]


@pytest.mark.parametrize(
    ("active", "error", "told"),
    [
        (["zz"], AssemblyError, "active names 'zz', which is no velocity"),
        (["c0"], AssemblyError, "c0 cannot be independent, since its joint is cut"),
        ("a0", DescriptionError, "give a list of names, such as ['a0']"),
    ],
)
def test_a_wrong_choice_is_refused(active, error, told):
    refused(error, told, by=lambda: mbs.robots.n_four_bar(1).assemble(active=active))


def test_of_velocities_that_depend_on_each_other_one_is_independent():
    m = mbs.robots.n_four_bar(1)
    extra = m.add(Body("extra", mass=1, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world.at(5), Revolute("free", actuated=False), extra)
    system = m.assemble(active=["a0", "a1"])
    names = [speed.name for speed in system.velocity_coordinates]
    assert {names[k] for k in system.independent} in ({"a0", "free"}, {"a1", "free"})
    assert {names[k] for k in system.motors} == {"a0", "a1", "free"}
    assert math.isclose(m.assemble(active=["a0", "free"]).closure.mobility, 2)


def test_a_row_alone_is_as_independent_as_it_is_long():
    system = mbs.load("modelica_rod_four_bar").assemble()
    units = [speed.unit for speed in system.velocity_coordinates]
    found, p = scales(system), system.p_default
    draws = np.random.default_rng(0).uniform(-4, 4, (100, system.nq))
    rows = [np.array(constraint_jacobian(system)(q, p)) for q in draws]
    squares = [float(np.sum((found.rows * J * found.columns(units)) ** 2)) for J in rows]
    told = [float(row_independence(system)(q, p)) for q in draws]
    assert min(squares) < 0.5 < 1.5 < max(squares)
    np.testing.assert_allclose(told, np.minimum(squares, 1), rtol=1e-12)
