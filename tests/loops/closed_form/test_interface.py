"""Branches by label, what is refused and how, and what a Function of a closed form can do."""

import pickle
import re

import casadi
import numpy as np
import pytest
from support.closed_mechanisms import closed_chain, planar_loop
from support.configurations import active, same
from support.flat_loops import flat_loop
from support.random_trees import random_body

import mbs
from mbs import Mechanism
from mbs.components import Revolute
from mbs.errors import LoopError, ModelError, NoClosedForm, Unclosable
from mbs.loops import assembly_modes, function, solve


def double_rocker():
    """A four-bar whose driven bar cannot turn fully."""
    m = Mechanism("rocker", guess={"j1": 1.1, "j2": -1.0, "j4": 2.0})
    a, b, c = (m.add(random_body(np.random.default_rng(k), f"b{k}")) for k in range(3))
    m.connect(m.world, Revolute("j1", actuated=True), a)
    m.connect(a.at(1.0), Revolute("j2"), b)
    m.connect(b.at(0.5), closing := Revolute("j3"), c.at(1.0))
    m.connect(m.world.at(1.2), Revolute("j4"), c)
    m.cut(closing)
    return m.assemble()


def test_out_of_reach_the_range_is_named():
    system = double_rocker()
    limit = np.arccos((1.0 + 1.44 - 1.5**2) / 2.4)  # coupler and follower in line
    with pytest.raises(Unclosable) as error:
        solve(system, {"j1": 3.0}, branch="j3:+")
    text = str(error.value)
    assert text.startswith("rocker: no configuration on this branch has j1 = 3; j1 can be ")
    numbers = [float(x) for x in re.findall(r"-?\d\.\d+", text.split("can be")[1])]
    near = np.arccos((1.0 + 1.44 - 0.5**2) / 2.4)  # in line, one over the other
    np.testing.assert_allclose(numbers, [-limit, -near, near, limit], atol=1e-3)
    assert text.endswith(" rad")
    assert assembly_modes(system, {"j1": 3.0}) == []
    with pytest.raises(Unclosable, match="j1 can be -1"):
        function(system)(3.0)


def test_the_range_of_a_slide_is_named():
    system = flat_loop(1, "RRRP", (3,)).assemble()
    with pytest.raises(Unclosable, match=r"has j3 = 100; j3 can be -?\d\.\d+ to -?\d\.\d+ m$"):
        solve(system, {"j3": 100.0}, branch=[])


def test_several_motors_keep_the_others():
    m = Mechanism("five", guess={"j0": 1.5, "j1": -1.0, "j4": 1.5})
    bars = [m.add(random_body(np.random.default_rng(k), f"b{k}")) for k in range(4)]
    m.connect(m.world, Revolute("j0", actuated=True), bars[0])
    m.connect(bars[0].at(0.5), Revolute("j1"), bars[1])
    m.connect(m.world.at(1.0), Revolute("j4", actuated=True), bars[3])
    m.connect(bars[3].at(0.5), Revolute("j3"), bars[2])
    m.connect(bars[1].at(0.6), Revolute("j2"), bars[2].at(0.6))
    system = m.assemble()
    with pytest.raises(Unclosable, match=r"has j0 = 3, j4 = 0; j0 can be .*; j4 can be .* as they"):
        solve(system, {"j0": 3.0, "j4": 0.0}, branch=[])


def test_a_function_keeps_nan_within_maps():
    f = function(double_rocker())
    q = f.map(2).call([casadi.DM([[1.1, 3.0]])])[0]
    assert np.isfinite(np.array(q[:, 0])).all()
    assert np.isnan(np.array(q[1:, 1])).all()


def test_values_that_are_no_numbers_are_refused_as_in_any_model():
    f = function(double_rocker())
    with pytest.raises(ModelError, match="q_a is not finite"):
        f(np.nan)
    with pytest.raises(ModelError, match=r"loops\(rocker\): q_a has 2 values, it needs 1: j1"):
        f([1.0, 2.0])


def test_a_function_is_a_casadi_function():
    system = double_rocker()
    f = function(system)
    assert f is function(system)
    assert f.name_in() == ["q_a"]
    assert f.name_out() == ["q"]
    x = casadi.MX.sym("x")
    wrapped = casadi.Function("wrapped", [x], [f(x), casadi.jacobian(f(x), x)])
    np.testing.assert_array_equal(np.array(wrapped(1.1)[0]), np.array(f(1.1)))
    np.testing.assert_array_equal(np.array(pickle.loads(pickle.dumps(f))(1.1)), np.array(f(1.1)))


def test_branches_that_there_are_not():
    system = double_rocker()
    with pytest.raises(ModelError, match=r"rocker: there is no branch 'j3:x'; .*j3:\+"):
        function(system, "j3:x")
    with pytest.raises(ModelError, match=r"j3:\+ and j3:- are two ways to close the loop of j3"):
        solve(system, branch="j3:+, j3:-")
    with pytest.raises(ModelError, match="branch is 3; give labels such as"):
        solve(system, branch=3)
    with pytest.raises(ModelError, match="guess and branch both choose the branch"):
        solve(system, guess={"j2": 1.0}, branch="j3:+")
    with pytest.raises(ModelError, match="j4 follows from the loops once a branch is named"):
        solve(system, {"j4": 1.0}, branch="j3:+")


def test_the_closed_form_agrees_with_following():
    system = double_rocker()
    q = solve(system, {"j1": 1.2}, branch=[])
    assert same(system, q, solve(system, {"j1": 1.2}), 1e-9)
    listed = [mode for mode in assembly_modes(system, {"j1": 1.2}) if same(system, mode.q, q)]
    assert len(listed) == 1


@pytest.mark.parametrize("seed", range(3))
def test_loops_of_the_other_tests(seed):
    mechanism, guess = planar_loop(seed, 3 + seed)
    system = mechanism.assemble(guess=guess)
    assert any(same(system, mode.q, system.configuration, 1e-6) for mode in assembly_modes(system))
    q = np.array(function(system)(active(system))).ravel()
    assert same(system, q, system.configuration, 1e-8)


def test_loops_without_closed_form_say_why():
    mechanism, guess = closed_chain(2, "revolute")
    system = mechanism.assemble(guess=guess)
    with pytest.raises(NoClosedForm, match=r"closing has no closed form known here, 6 positions"):
        function(system)
    assert (
        assembly_modes(system).proof
        == "the general inverse geometric model, certified: 16 of 16 roots"
    )
    with pytest.raises(LoopError, match=r"use mbs\.loops\.solve without branch"):
        function(system)
    with pytest.raises(NoClosedForm):
        solve(system, branch="j1:+")
    solve(system)


def test_what_is_no_system():
    with pytest.raises(ModelError, match="is not a System"):
        assembly_modes(mbs.load("four_bar"))
    with pytest.raises(ModelError, match="is not a System"):
        function(mbs.load("four_bar"))
