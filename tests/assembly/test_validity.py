"""What makes a call meaningful is asked on every call path, or its answer is flagged."""

import pickle

import casadi
import numpy as np
import pytest

import mbs
from mbs import MbsError
from mbs.components import Body, Box, Revolute, Spherical
from mbs.errors import ModelError, Unclosable


@pytest.fixture(scope="module")
def loop():
    return mbs.load("four_bar").assemble()


@pytest.fixture(scope="module")
def ball():
    m = mbs.Mechanism("ball", gravity=(0, 0, -9.81))
    body = m.add(Body("b", mass=mbs.Parameter("M", 2.0), com=(0.1, 0.2, 0.3), inertia=(1, 2, 3)))
    m.connect(m.world, Spherical("s"), body)
    return m.assemble()


def bad(case, loop, ball):
    """A model, inputs that it takes, and inputs of which one is bad."""
    if case == "open loop":
        q = np.array(loop.configuration)
        return mbs.models.direct_dynamics(loop), (q, [0.1], [0.2]), (q + 0.1, [0.1], [0.2])
    ddm = mbs.models.direct_dynamics(ball)
    q, v, tau, p = np.array([1.0, 0, 0, 0]), np.ones(3), np.ones(3), np.array([2.0])
    wrong = {
        "long quaternion": (2 * q, v, tau, p),
        "zero quaternion": (0 * q, v, tau, p),
        "negative mass": (q, v, tau, -p),
        "NaN": (q, v, np.array([np.nan, 0, 0]), p),
        "infinity": (q, v, np.array([np.inf, 0, 0]), p),
    }
    return ddm, (q, v, tau, p), wrong[case]


CASES = [
    "open loop",
    "long quaternion",
    "zero quaternion",
    "negative mass",
    "NaN",
    "infinity",
]
PATHS = {
    "call": lambda f: f,
    "by name": lambda f: lambda *x: f(**dict(zip(f.name_in(), x, strict=True))),
    "expand": lambda f: f.expand(),
    "map": lambda f: lambda *x: f.map(2)(*(np.column_stack((a, a)) for a in x)),
    "compiled": mbs.native.compiled,
    "compiled, fast": lambda f: mbs.native.compiled(f, fast=True),
    "compiled, lists": lambda f: lambda *x: mbs.native.compiled(f)(*(list(a) for a in x)),
    "pickled": lambda f: pickle.loads(pickle.dumps(f)),
    "compiled and pickled": lambda f: pickle.loads(pickle.dumps(mbs.native.compiled(f))),
    "pickled and compiled": lambda f: mbs.native.compiled(pickle.loads(pickle.dumps(f))),
}


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("case", CASES)
def test_bad_numbers_are_refused(case, path, loop, ball):
    f, good, wrong = bad(case, loop, ball)
    call = PATHS[path](f)
    good, wrong = ([np.array(x, dtype=float) for x in values] for values in (good, wrong))
    wanted = np.array(f(*good)).ravel()
    found = call(*good)
    found = np.array(next(iter(found.values())) if isinstance(found, dict) else found)
    assert found.reshape(len(wanted), -1)[:, 0] == pytest.approx(wanted, rel=1e-9)
    with pytest.raises(MbsError):
        call(*wrong)


@pytest.mark.parametrize("case", [case for case in CASES if case not in ("NaN", "infinity")])
@pytest.mark.parametrize("again", [False, True])
def test_rows_of_a_batch_are_flagged(case, again, loop, ball):
    f, good, wrong = bad(case, loop, ball)
    many = mbs.native.batch(f)
    if again:
        many = pickle.loads(pickle.dumps(many))
    good, wrong = ([np.array(x, dtype=float) for x in values] for values in (good, wrong))
    rows = [np.array([a, b, a]) for a, b in zip(good, wrong, strict=True)]
    found = many(*rows)
    assert np.isnan(found[1]).all()
    assert found[[0, 2]] == pytest.approx(np.array([np.array(f(*good)).ravel()] * 2), rel=1e-9)
    unchecked = mbs.native.batch(f, checked=False)(*rows)
    assert np.isfinite(unchecked[[0, 2]]).all()


def test_an_input_that_has_no_effect_is_asked_too():
    idm = mbs.models.inverse_dynamics(mbs.load("puma560").assemble())
    q = np.zeros(6)
    q[0] = np.nan
    for f in (idm, mbs.native.compiled(idm), pickle.loads(pickle.dumps(idm))):
        with pytest.raises(ModelError, match="q is not finite"):
            f(q, np.zeros(6), np.zeros(6))


def test_an_input_given_twice_is_refused():
    idm = mbs.models.inverse_dynamics(mbs.load("puma560").assemble())
    with pytest.raises(ModelError, match="q is given by its place and by its name"):
        idm(np.zeros(6), np.zeros(6), np.zeros(6), q=np.ones(6))


def test_sentences_say_what_to_do(loop, ball):
    ddm = mbs.models.direct_dynamics(ball)
    with pytest.raises(ModelError, match="the quaternion of s has the length 2; divide it by"):
        ddm([2, 0, 0, 0], [0] * 3, [0] * 3)
    with pytest.raises(ModelError, match="b: mass is -2 kg; give zero or more"):
        ddm([1, 0, 0, 0], [0] * 3, [0] * 3, [-2])
    with pytest.raises(Unclosable, match="leaves the loops open"):
        mbs.native.compiled(mbs.models.direct_dynamics(loop))(
            np.array(loop.configuration) + 0.1, np.zeros(1), np.zeros(1)
        )


def test_validity_is_a_function_beside_the_models(loop, ball):
    asked = mbs.models.validity(loop)
    residual, bound = asked(loop.configuration)
    assert np.all(np.array(residual) <= np.array(bound))
    residual, bound = asked(np.array(loop.configuration) + 0.1)
    rows = mbs.models.validity_rows(loop)
    late = [name for name, a, b in zip(rows, residual.nz, bound.nz, strict=True) if not a <= b]
    assert late == ["opening of the loops"]
    many = asked.map(2)(np.column_stack((loop.configuration, np.array(loop.configuration) + 0.1)))
    assert [bool(np.all(np.array(many[0][:, k]) <= np.array(many[1][:, k]))) for k in range(2)] == [
        True,
        False,
    ]
    assert mbs.models.validity_rows(ball) == ("quaternion of s", "least value of M")
    assert mbs.models.validity(mbs.load("puma560").assemble()).numel_out(0) == 0


@pytest.mark.sweep
@pytest.mark.parametrize("name", ["puma560", "sr400", "delta", "five_bar", "stewart_platform"])
def test_systems_travel_whole(name):
    system = mbs.load(name).assemble()
    again = pickle.loads(pickle.dumps(system))
    assert again.report() == system.report()
    assert again.parameters == system.parameters
    q, v = np.array(system.configuration), np.full(len(system.independent), 0.3)
    one, other = (mbs.models.direct_dynamics(s) for s in (system, again))
    assert np.array_equal(np.array(one(q, v, v)), np.array(other(q, v, v)))
    assert other.name_in() == one.name_in()
    assert other.elements("q") == one.elements("q")


def test_a_mechanism_with_symbols_and_its_equations_travel():
    m = mbs.Mechanism("arm", gravity=(0, -9.81, 0))
    box = m.add(Box("b", length=mbs.Parameter("L", 0.5), width=0.05, density=2700))
    m.connect(m.world, Revolute("j", actuated=True), box.left)
    system = m.assemble()
    idm = pickle.loads(pickle.dumps(mbs.models.inverse_dynamics(system)))
    assert float(idm(0.3, 0, 1)) == float(mbs.models.inverse_dynamics(system)(0.3, 0, 1))
    assert idm.system.parameters[0].name == "L"
    d = mbs.models.dae(system, "index3")
    e = pickle.loads(pickle.dumps(d))
    assert e.elements == d.elements
    point = [d.x0, d.z0, d.u0, d.p0]
    for a, b in zip(d.function()(*point), e.function()(*point), strict=True):
        assert np.array_equal(np.array(a), np.array(b))
    assert isinstance(e.x, casadi.SX)


@pytest.mark.parametrize("make", [mbs.native.compiled, mbs.native.batch])
def test_parameters_may_be_left_out_where_zeros_would_be_refused(ball, make):
    ddm = mbs.models.direct_dynamics(ball)
    q, v, tau = np.array([1.0, 0, 0, 0]), np.ones(3), np.array([0.1, 0.2, 0.3])
    assert make(ddm)(q, v, tau) == pytest.approx(np.array(ddm(q, v, tau)).ravel(), rel=1e-12)


def test_a_mass_that_parameters_make_together_is_asked_for_where_nothing_else_is():
    m = mbs.Mechanism("m", gravity=(0, -9.81, 0))
    mass = mbs.Parameter("M", 2.0) - mbs.Parameter("cut", 0.5)
    arm = m.add(Body("arm", mass=mass, com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j"), arm)
    system = m.assemble()
    assert not system.bounds
    idm = mbs.models.inverse_dynamics(system)
    one, p = np.array([0.1]), np.array([1.0, 3.0])
    for call in (idm, idm.expand(), mbs.native.compiled(idm), pickle.loads(pickle.dumps(idm))):
        found = np.array(call(one, one, one)).item()
        assert found == pytest.approx(float(idm(one, one, one)), rel=1e-14)
        with pytest.raises(ModelError, match="arm: mass is -2 kg; give zero or more"):
            call(one, one, one, p)
    assert np.isnan(mbs.native.batch(idm)(one, one, one, p)).all()


@pytest.mark.parametrize("case", ["open loop", "long quaternion", "negative mass"])
def test_compiled_maps_ask_every_column(case, loop, ball):
    f, good, wrong = bad(case, loop, ball)
    many = mbs.native.compiled(f.map(2))
    one = np.array(f(*good)).ravel()
    good, wrong = ([np.array(x, dtype=float).ravel() for x in values] for values in (good, wrong))
    columns = [np.asfortranarray(np.column_stack((a, a))) for a in good]
    assert np.array(many(*columns))[:, 1] == pytest.approx(one, rel=1e-12)
    columns = [np.asfortranarray(np.column_stack((a, b))) for a, b in zip(good, wrong, strict=True)]
    with pytest.raises(MbsError):
        many(*columns)


def test_parameters_are_asked_for_where_positions_are_not():
    m = mbs.Mechanism("bars", gravity=(0, -9.81, 0))
    lengths = {"a": mbs.Parameter("L", 0.4), "b": 1.0, "c": 0.9}
    a, b, c = (m.add(Box(k, length=x, width=0.05, density=2700)) for k, x in lengths.items())
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    closed = mbs.loops.function(m.assemble(guess={"j2": 1.0}))
    q_a, p = np.array([0.3]), np.array([-0.4])
    assert "q" not in closed.name_in()
    for call in (closed, mbs.native.compiled(closed)):
        with pytest.raises(ModelError, match=r"a: length is -0\.4; give a length above zero"):
            call(q_a, p)
    assert np.isnan(mbs.native.batch(closed)(q_a, p)).all()
