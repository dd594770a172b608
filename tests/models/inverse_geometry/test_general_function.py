"""All configurations of a general arm as one Function: called, mapped, compiled, pickled."""

import pickle

import casadi
import numpy as np
import pytest
from casadi import MX, Function
from support.arm_search import plain_arm
from support.arms import general_6r
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import CompilerError, ModelError, NoClosedForm
from mbs.models.inverse_geometry import function, solver
from mbs.native import c_source, cached_library, compiled

Q = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2])


@pytest.fixture(scope="module")
def arm():
    return general_6r(0)


@pytest.fixture(scope="module")
def igm(arm):
    return function(arm, branches="all")


def columns(igm, T):
    q, valid, count, certain = (np.array(x) for x in igm(T))
    m = int(count[0, 0])
    assert np.array_equal(valid.ravel(), np.arange(16) < m)
    assert np.all(np.isnan(q[:, m:]))
    assert not np.any(np.isnan(q[:, :m]))
    return q[:, :m].T, bool(certain[0, 0])


@pytest.mark.parametrize("name", ["general", "crx10", "manseur_doty"])
def test_they_are_those_of_the_solver(name):
    system = general_6r(0) if name == "general" else catalogue_system(name)
    every, solved, plain = function(system, branches="all"), solver(system), plain_arm(system)
    for q in np.random.default_rng(5).uniform(-2, 2, (10, 6)):
        T = plain.pose(q)
        found, certain = columns(every, T)
        answer = solved(T)
        assert certain != answer.singular
        if certain:
            assert np.array_equal(found, answer.q)
        assert np.max(plain.residual(T, found)) < 1e-12
        assert np.min(np.max(np.abs(found - q), axis=1)) < 1e-9


def test_none_out_of_reach_and_doubt_next_to_a_singular_configuration():
    system = catalogue_system("crx10")
    every, plain = function(system, branches="all"), plain_arm(system)
    far = plain.pose(Q)
    far[:3, 3] += 9.0
    assert len(columns(every, far)[0]) == 0
    assert columns(every, far)[1]
    stretched = plain.pose([0.3, -0.5, np.pi / 2, 0.4, 0.0, 0.2])
    assert not columns(every, stretched)[1]
    skewed = MX(np.diag([1.0, 1.1, 1.0, 1.0]))  # as symbols no call refuses it
    none = Function("none", [], every.call([skewed]))()
    assert none["o2"] == 0
    assert none["o3"] == 0


def test_a_pose_that_is_none_is_refused(igm):
    with pytest.raises(ModelError, match="T"):
        igm(np.diag([1.0, 1.1, 1.0, 1.0]))


def test_locked_joints_and_the_general_method_where_a_closed_form_holds():
    panda, puma = catalogue_system("panda"), catalogue_system("puma560")
    q = np.array([0.1, -0.4, 0.2, -1.9, 0.3, 1.6, 0.5])
    igm = function(panda, "general", locked={"q3": 0.2}, branches="all")
    T = np.array(mbs.models.direct_geometry(panda)(q))
    found, _ = columns(igm, T)
    assert np.all(found[:, 2] == 0.2)
    assert np.min(np.max(np.abs(found - q), axis=1)) < 1e-9
    T = plain_arm(puma).pose(Q)
    assert len(columns(function(puma, "general", branches="all"), T)[0]) == len(solver(puma)(T))
    assert function(puma, branches="all").n_out() == 2


def test_the_jacobian_is_the_inverse_model_of_velocities(arm, igm):
    plain, step = plain_arm(arm), 1e-6 * np.array([1.0, -0.5, 0.7, 0.3, -0.2, 0.4])
    T = plain.pose(Q)
    outputs = igm.call([T])
    J = np.array(igm.jacobian().call([T, *outputs])[0]).reshape(16, 6, 16)
    found = np.array(outputs[0]).T
    for k in range(int(outputs[2])):
        before, after = plain.pose(found[k] - step), plain.pose(found[k] + step)
        change = (after - before).ravel(order="F") / 2
        np.testing.assert_allclose(J[k] @ change, step, atol=1e-15 + 1e-9 * 1e-6)
    assert not np.any(J[int(outputs[2]) :])


def test_mapped_compiled_and_pickled(arm, igm):
    plain = plain_arm(arm)
    poses = [plain.pose(q) for q in np.random.default_rng(1).uniform(-2, 2, (3, 6))]
    one_by_one = np.hstack([np.array(igm(T)[0]) for T in poses])
    mapped = np.array(igm.map(3)(np.hstack(poses))[0])
    assert np.array_equal(mapped, one_by_one, equal_nan=True)
    again = np.array(pickle.loads(pickle.dumps(igm))(poses[0])[0])
    assert np.array_equal(again, one_by_one[:, :16], equal_nan=True)
    fast = compiled(igm)
    q, valid, count, _ = fast(poses[1])
    assert isinstance(q, np.ndarray)
    assert valid.sum() == count
    assert np.array_equal(q, one_by_one[:, 16:32], equal_nan=True)


def test_its_c_text_stands_alone(arm, igm):
    """As an external Function with its Jacobian, and within another one."""
    T = plain_arm(arm).pose(Q)
    library = cached_library({"all.c": c_source(igm, derivatives=1)})
    alone, outputs = casadi.external("igm_all", str(library)), igm.call([T])
    for one, other in zip(alone.call([T]), outputs, strict=True):
        assert np.array_equal(np.array(one), np.array(other), equal_nan=True)
    slopes = (np.array(f.jacobian().call([T, *outputs])[0]) for f in (alone, igm))
    assert np.array_equal(*slopes)
    x = MX.sym("x")
    within = Function("within", [x], igm.call([MX(T) + (x - x) * T])[2:])
    library = cached_library({"within.c": c_source(within)})
    assert casadi.external("within", str(library))(0.5)[0] == outputs[2]


def test_refusals(monkeypatch):
    m = mbs.Mechanism("symbolic")
    below = m.world
    for k, axis in enumerate("zxyzxy"):
        body = m.add(mbs.components.Body(f"b{k}", mass=0))
        m.connect(below, mbs.components.Revolute(f"q{k + 1}", axis=axis), body)
        below = body.at(mbs.Parameter("L", 0.3) if k == 2 else 0.2, 0.1, 0.1 * k)
    m.add_frame("tool", below)
    with pytest.raises(ModelError, match="L are symbols"):
        function(m.assemble(), "general", branches="all")
    with pytest.raises(NoClosedForm, match="general method does not hold"):
        function(catalogue_system("scara"), "general", branches="all")
    with pytest.raises(ModelError, match="branches is 'both'"):
        function(catalogue_system("crx10"), branches="both")
    monkeypatch.setattr("mbs.native.compiler.COMPILERS", ())
    monkeypatch.setenv("CC", "no_such_compiler")
    with pytest.raises(CompilerError):
        function(mbs.load("crx10").assemble(), branches="all")
