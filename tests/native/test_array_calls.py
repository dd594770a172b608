import copy
import gc
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

import mbs
import mbs.models
from mbs.errors import ModelError
from mbs.native import compiled


def example():
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2, 3)
    sparse = ca.SX(2, 3)
    sparse[1, 0], sparse[0, 2] = x[0], x[1] * y[1, 2]
    return ca.Function(
        "f", [x, y], [ca.mtimes(y, x), y * x[0], sparse], ["x", "y"], ["a", "b", "c"]
    )


def arguments(seed=0):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(3), np.asfortranarray(rng.standard_normal((2, 3)))


def expected(x, y):
    return y @ x, y * x[0], np.array([[0, 0, x[1] * y[1, 2]], [x[0], 0, 0]])


def equal(results, x, y):
    return all(
        isinstance(a, np.ndarray) and a.shape == b.shape and np.allclose(a, b, rtol=0, atol=1e-15)
        for a, b in zip(results, expected(x, y), strict=True)
    )


@pytest.fixture(params=["exact", "fast", "interpreted"])
def f(request, monkeypatch):
    if request.param == "interpreted":
        monkeypatch.setitem(compiled.__globals__, "compiler_found", lambda: False)
    return compiled(example(), fast=request.param == "fast")


@pytest.fixture(params=[False, True], ids=["exact", "fast"])
def idm(request):
    model = mbs.models.inverse_dynamics(mbs.load("puma560").assemble())
    return compiled(model, fast=request.param)


def test_arrays_in_arrays_out(f):
    x, y = arguments()
    assert equal(f(x, y), x, y)


def test_arrays_of_other_layouts_are_converted(f):
    x, y = arguments()
    twice = np.zeros(6)
    twice[::2] = x
    assert equal(f(twice[::2], y), x, y)
    assert equal(f(x.reshape(3, 1), y), x, y)
    assert equal(f(x, np.ascontiguousarray(y)), x, y)
    x32, y32 = x.astype(np.float32), y.astype(np.float32)
    assert equal(f(x32, y32), x32.astype(float), y32.astype(float))
    swapped = x.astype(">f8")
    assert equal(f(swapped, y), x, y)
    assert equal(f(np.array([1, 2, 3]), y), np.array([1.0, 2, 3]), y)


def test_arrays_that_cannot_be_written_are_read(f):
    x, y = arguments()
    x.setflags(write=False)
    assert equal(f(x, y), x, y)


def test_other_arguments_go_the_way_of_casadi(f):
    x, y = arguments()
    for args in ((list(x), ca.DM(y)), (x, ca.DM(y)), (ca.DM(x), y)):
        results = f(*args)
        assert all(isinstance(r, ca.DM) for r in results)
        assert np.allclose(results[0].full().ravel(), y @ x)
    symbolic = f(ca.MX.sym("x", 3), y)
    assert isinstance(symbolic[0], ca.MX)
    assert isinstance(f(x=x, y=y)["a"], ca.DM)


def test_sx_passes_where_it_passed_before(monkeypatch):
    monkeypatch.setitem(compiled.__globals__, "compiler_found", lambda: False)
    assert isinstance(compiled(example())(ca.SX.sym("x", 3), ca.SX.sym("y", 2, 3))[0], ca.SX)


def test_out_is_filled(f):
    x, y = arguments()
    out = np.empty(2), np.empty((2, 3), order="F"), np.empty((2, 3))
    assert f(x, y, out=out) is out
    assert equal(out, x, y)
    f(list(x), y, out=out)
    assert equal(out, x, y)
    f(x=x, y=y, out=out)
    assert equal(out, x, y)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda a, b, c: (a, b), "f: out has 2 arrays, there are 3 outputs"),
        (lambda a, b, c: (a[:1], b, c), r"f: out for a must be a writable array .* shape \(2,\)"),
        (lambda a, b, c: (a, b.T, c), r"f: out for b must be .* shape \(2, 3\)"),
        (lambda a, b, c: (np.empty(2, np.float32), b, c), "f: out for a must be"),
        (lambda a, b, c: (a.tolist(), b, c), "f: out for a must be"),
    ],
)
def test_out_that_does_not_fit(f, change, message):
    x, y = arguments()
    out = np.empty(2), np.empty((2, 3), order="F"), np.empty((2, 3), order="F")
    with pytest.raises(ModelError, match=message):
        f(x, y, out=change(*out))


def test_out_that_cannot_be_written(f):
    x, y = arguments()
    out = np.empty(2), np.empty((2, 3), order="F"), np.empty((2, 3), order="F")
    out[0].setflags(write=False)
    with pytest.raises(ModelError, match="out for a must be a writable array"):
        f(x, y, out=out)


def test_out_may_be_an_input(idm):
    q, v, a = np.random.default_rng(0).standard_normal((3, 6))
    tau = idm(q, v, a)
    assert idm(q, v, a, out=a) is a
    assert np.array_equal(a, tau) or np.allclose(a, tau, rtol=1e-14)


def test_wrong_sizes_name_the_input(idm):
    q = np.zeros(6)
    with pytest.raises(ModelError, match="v has 5 values, it needs 6"):
        idm(q, np.zeros(5), q)
    with pytest.raises(ModelError, match=r"v has the shape \(2, 3\), it needs 6"):
        idm(q, np.zeros((2, 3)), q)
    with pytest.raises(ModelError, match="a missing"):
        idm(q, q)
    with pytest.raises(ModelError, match="4 arguments were given"):
        idm(q, q, q, np.ones(6))


def test_a_model_refuses_what_is_no_number(idm):
    q = np.zeros(6)
    with pytest.raises(ModelError, match="is not finite"):
        idm(q, np.full(6, np.nan), q)
    with pytest.raises(ModelError, match="is not finite"):
        idm(np.full(6, np.inf), q, q)


def test_a_function_that_is_no_model_may_give_no_number():
    x = ca.SX.sym("x")
    f = compiled(ca.Function("f", [x], [ca.sqrt(x)]))
    assert np.isnan(f(np.array([-1.0])))


@pytest.mark.parametrize("fast", [False, True])
def test_parameters_may_be_left_out(fast):
    m = mbs.Mechanism("m", gravity=(0, 0, -9.81))
    body = m.add(mbs.components.Body("b", mass=mbs.Parameter("mass", 2.0)))
    m.connect(m.world, mbs.components.Prismatic("j", axis="z"), body)
    lift = compiled(mbs.models.inverse_dynamics(m.assemble()), fast=fast)
    zero = np.zeros(1)
    assert lift(zero, zero, zero) == pytest.approx(19.62)
    assert lift(zero, zero, zero, np.ones(1)) == pytest.approx(9.81)
    assert float(lift(0, 0, 0)) == pytest.approx(19.62)


def test_a_parameter_without_value_must_be_given():
    m = mbs.Mechanism("m", gravity=(0, 0, -9.81))
    body = m.add(mbs.components.Body("b", mass=mbs.Parameter("mass", None)))
    m.connect(m.world, mbs.components.Prismatic("j", axis="z"), body)
    lift = compiled(mbs.models.inverse_dynamics(m.assemble()))
    zero = np.zeros(1)
    with pytest.raises(ModelError, match="mass"):
        lift(zero, zero, zero)
    assert lift(zero, zero, zero, np.ones(1)) == pytest.approx(9.81)


def test_a_model_stays_a_model(idm):
    assert idm.elements("q")[0] == ("q1", "rad")
    assert idm.name_in() == ["q", "v", "a"]
    q = np.random.default_rng(0).standard_normal((6, 4))
    assert idm.map(4)(q, q, q).shape == (6, 4)
    assert idm(q, q, q).shape == (6, 4)
    x = ca.MX.sym("x", 6)
    J = ca.Function("J", [x], [ca.jacobian(idm(x, x, x), x)])(q[:, 0]).full()
    step = 1e-6 * np.eye(6)
    rows = [(idm(*[q[:, 0] + s] * 3) - idm(*[q[:, 0] - s] * 3)) / 2e-6 for s in step]
    assert pytest.approx(np.array(rows).T, abs=1e-6) == J


def test_copies_and_pickles(idm):
    q = np.linspace(0.1, 0.6, 6)
    assert copy.deepcopy(idm) is idm
    assert np.array_equal(pickle.loads(pickle.dumps(idm))(q, q, q), idm(q, q, q))


def test_threads_do_not_disturb_each_other(idm):
    states = np.random.default_rng(0).standard_normal((64, 3, 6))
    alone = [idm(*state) for state in states]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda state: idm(*state), states))
    assert np.array_equal(alone, together)


def test_more_work_space_than_fits_on_the_stack():
    x = ca.SX.sym("x", 80)
    f = ca.Function("f", [x], [ca.tril(ca.mtimes(x, x.T))])
    assert f.nnz_out(0) == 3240
    value = np.random.default_rng(0).standard_normal(80)
    g = compiled(f, derivatives=0, fast=True)
    assert g._arrays(value) is not None
    assert np.array_equal(g(value), np.tril(np.outer(value, value)))


def test_nothing_leaks(f):
    x, y = arguments()
    f(x, y)
    gc.collect()
    before = sys.getrefcount(x), sys.getrefcount(y), sys.getrefcount(None)
    for _ in range(1000):
        f(x, y)
        f(x, np.ascontiguousarray(y))
    gc.collect()
    assert (sys.getrefcount(x), sys.getrefcount(y)) == before[:2]
    assert abs(sys.getrefcount(None) - before[2]) < 500


def test_a_function_can_be_forgotten():
    f = compiled(example())
    x, y = arguments()
    results = f(x, y)
    del f
    gc.collect()
    assert equal(results, x, y)
