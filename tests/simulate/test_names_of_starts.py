"""Starts, efforts and guesses by the names of variables of FMUs, and FMU starts by those of run."""

import numpy as np
import pytest

import mbs
from mbs import MbsError
from mbs.components import Box, Revolute


@pytest.fixture(scope="module")
def arm():
    return mbs.robots.planar_2r().assemble()


@pytest.fixture(scope="module")
def four_bar():
    return mbs.robots.four_bar().assemble()


@pytest.fixture(scope="module")
def packed(four_bar, tmp_path_factory):
    return mbs.export.fmu(four_bar, tmp_path_factory.mktemp("fmu") / "four_bar.fmu")


def same(one, other):
    np.testing.assert_array_equal(one.values, other.values)


def test_run_accepts_names_of_variables(arm):
    plain = {"q0": {"q1": 0.1}, "v0": {"q2": 0.4}, "tau": {"q1": 2.0}}
    names = {"q0": {"q1.q": 0.1}, "v0": {"q2.v": 0.4}, "tau": {"q1.tau": 2.0}}
    same(mbs.simulate.run(arm, 0.1, **plain), mbs.simulate.run(arm, 0.1, **names))
    law = mbs.simulate.run(arm, 0.1, tau=lambda t, q, v: {"q1.tau": 2.0}, q0={"q1.q": 0.1})
    same(law, mbs.simulate.run(arm, 0.1, tau={"q1": 2.0}, q0={"q1": 0.1}))


def test_run_accepts_names_of_variables_beside_a_motion(arm):
    motion = {"q1.q": 0.1}
    names = mbs.simulate.run(arm, 0.1, motion=motion, q0={"q1.q": 0.1, "q2.q": 0.2})
    same(names, mbs.simulate.run(arm, 0.1, motion=motion, q0={"q1": 0.1, "q2": 0.2}))


def test_loops_accept_names_of_variables(four_bar):
    expected = mbs.loops.solve(four_bar, {"j1": 0.3}, guess={"j2": -1.0})
    for guess in ({"j2.q": -1.0}, {"j2.solved": -1.0}):
        found = mbs.loops.solve(four_bar, {"j1.q": 0.3}, guess=guess)
        np.testing.assert_array_equal(found, expected)
        run = mbs.simulate.run(four_bar, 0.01, q0={"j1.q": 0.3}, v0={"j2.v": 1.0}, guess=guess)
        assert run["j2.q"][0] == pytest.approx(expected[1], abs=1e-12)
        assert run["j2.v"][0] == pytest.approx(1.0, abs=1e-12)
    every = {f"{c.name}.q": x for c, x in zip(four_bar.coordinates, expected, strict=True)}
    np.testing.assert_array_equal(mbs.loops.solve(four_bar, every), expected)


def rocker(guess=None):
    m = mbs.Mechanism("rocker", guess=guess)
    a, b, c = (
        m.add(Box(n, length=x, width=0.03, mass=1)) for n, x in (("a", 0.3), ("b", 0.6), ("c", 0.5))
    )
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.7), Revolute("j4"), c.left)
    return m


def test_assemble_accepts_names_of_variables():
    expected = rocker().assemble(guess={"j1": 0.5, "j2": -1.0}).configuration
    for own in (None, {"j2": 2.0}, {"j2.q": 2.0}):
        found = rocker(own).assemble(guess={"j1.q": 0.5, "j2.solved": -1.0})
        assert found.configuration == expected
    assert rocker({"j1.q": 0.5, "j2": -1.0}).assemble().configuration == expected


def test_one_variable_by_two_names_raises(arm):
    with pytest.raises(MbsError, match=r"q1 and q1.q are the same variable; give it once"):
        mbs.simulate.run(arm, 0.1, q0={"q1": 0.1, "q1.q": 0.2})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"q0": {"j1.v": 1.0}}, r"j1.v is a velocity, .* give it in v0"),
        ({"q0": {"j2.solved": 1.0}}, r"j2.solved is a guess, .* give it in guess"),
        ({"v0": {"j1.q": 1.0}}, r"j1.q is a position, .* give it in q0"),
        ({"tau": {"j1.q": 1.0}}, r"j1.q is a position, .* give it in q0"),
        ({"q0": {"j9.q": 1.0}}, r"no coordinate 'j9.q'; .*j1, j2, j4"),
    ],
    ids=str,
)
def test_another_quantity_raises_and_names_the_argument(four_bar, given, message):
    with pytest.raises(MbsError, match=message):
        mbs.simulate.run(four_bar, 0.1, **given)


def test_fmu_accepts_the_names_of_run(packed, four_bar):
    expected = mbs.simulate.fmu(packed, 0.1, start={"j1.q": 0.3, "j1.v": 0.5}, quiet=True)
    same(mbs.simulate.fmu(packed, 0.1, start={"j1": 0.3, "j1.v": 0.5}, quiet=True), expected)
    ran = mbs.simulate.run(four_bar, 0.1, q0={"j1.q": 0.3}, v0={"j1.v": 0.5}, tolerance=1e-9)
    assert ran["j2.q"][-1] == pytest.approx(expected["j2.q"][-1], abs=1e-6)


@pytest.mark.parametrize("name", ["j2", "j2.q"])
def test_fmu_names_what_it_accepts_for_a_joint_of_a_loop(packed, name):
    with pytest.raises(MbsError, match=r"follows from the loops; give j1.q, and j2.solved"):
        mbs.simulate.fmu(packed, 0.1, start={name: 0.3}, quiet=True)
