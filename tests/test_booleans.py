"""True and False are no positions, velocities, efforts, limits or parameters."""

import numpy as np
import pytest

import mbs
from mbs import MbsError
from mbs.components import PointMass, Revolute
from mbs.numbers import has_boolean, numbers_given

FORMS = [
    {"q1": True},
    {"q1": np.bool_(False)},
    [True, False],
    [0.1, True],
    np.array([True, False]),
]


@pytest.fixture(scope="module")
def arm():
    return mbs.robots.planar_2r().assemble()


@pytest.fixture(scope="module")
def four_bar():
    return mbs.robots.four_bar().assemble()


@pytest.mark.parametrize("argument", ["q0", "v0", "tau"])
@pytest.mark.parametrize("value", FORMS, ids=str)
def test_run_raises_for_a_start_or_an_effort(arm, argument, value):
    with pytest.raises(MbsError, match=r"give (finite )?numbers"):
        mbs.simulate.run(arm, 0.01, **{argument: value})


def test_the_message_names_the_coordinate_and_the_value(arm):
    text = "planar_2r: the position of q1 is True; give numbers instead of True or False"
    with pytest.raises(MbsError) as caught:
        mbs.simulate.run(arm, 0.01, q0={"q1": True})
    assert str(caught.value) == text


@pytest.mark.parametrize("given", [{"tau": lambda t, q, v: [True, 0]}, {"motion": {"q1.q": True}}])
def test_run_raises_for_laws(arm, given):
    with pytest.raises(MbsError, match="finite number"):
        mbs.simulate.run(arm, 0.01, **given)


@pytest.mark.parametrize("value", [{"j1": True}, [True]], ids=str)
@pytest.mark.parametrize("branch", [None, []])
def test_solve_raises_for_positions(four_bar, value, branch):
    with pytest.raises(MbsError, match="give numbers"):
        mbs.loops.solve(four_bar, value, branch=branch)


def test_guesses_raise(four_bar):
    other = {"j2": True}
    with pytest.raises(MbsError, match="position of j2 is True"):
        mbs.loops.solve(four_bar, {"j1": 0.3}, guess=other)
    with pytest.raises(MbsError, match="position of j2 is True"):
        mbs.simulate.run(four_bar, 0.01, q0={"j1": 0.3}, guess=other)
    with pytest.raises(MbsError, match="guess of j2 is True"):
        mbs.robots.four_bar().assemble(guess=other)
    with pytest.raises(MbsError, match="guess of q1 is True"):
        mbs.robots.planar_2r().assemble(guess={"q1": True})


@pytest.mark.parametrize(
    "given", [{"limits": (False, True)}, {"velocity": (False, True)}, {"effort": True}]
)
def test_joints_raise_for_limits(given):
    with pytest.raises(MbsError, match=r"give (two numbers|the largest)"):
        Revolute("j", **given)


def test_parameters_raise():
    m = mbs.Mechanism("m")
    mass = mbs.Parameter("mass", 1.0)
    m.connect(m.world, Revolute("j"), m.add(PointMass("body", mass=mass)).at(0.3, 0, 0))
    with pytest.raises(MbsError, match="parameter mass is True; give numbers"):
        mbs.simulate.run(m.assemble(), 0.01, parameters={"mass": True})


def test_has_boolean_finds_booleans_in_lists_and_arrays():
    assert all(map(has_boolean, [True, np.bool_(True), [[1, (False,)]], np.zeros(2, bool)]))
    assert not any(map(has_boolean, [1, 0.5, [1, 2], np.ones(2), "True", None]))
    np.testing.assert_array_equal(numbers_given([1, 2]), [1.0, 2.0])
