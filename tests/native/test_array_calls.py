import array
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
from mbs.errors import ModelError, Unclosable
from mbs.native import array_calls, compiled


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


LAYOUTS = {
    "order C": np.ascontiguousarray,
    "order F": np.asfortranarray,
    "transposed": lambda y: np.array(y.T).T,
    "part of a larger array": lambda y: np.pad(y, 2)[2:-2, 2:-2],
    "every third": lambda y: np.repeat(np.repeat(y, 3, 0), 3, 1)[::3, ::3],
    "backwards": lambda y: np.array(y[::-1, ::-1])[::-1, ::-1],
    "Python lists": np.ndarray.tolist,
    "tuples": lambda y: tuple(map(tuple, y)),
    "a list of rows": list,
    "not aligned": lambda y: np.frombuffer(b" " + y.tobytes(), offset=1).reshape(y.shape),
}
KINDS = ("?", "b", "B", "h", "H", "i", "I", "l", "L", "q", "Q", "e", "f", "d", "g")
SWAPPED = (">i2", ">u4", ">i8", ">f2", ">f4", ">f8")


@pytest.fixture
def quick(monkeypatch):
    """No call goes CasADi's way."""

    def slow(self, args, kwargs, out):
        raise AssertionError(f"{self.name()} went CasADi's way with {args}")

    monkeypatch.setattr(array_calls.ArrayCalls, "_slow", slow)


@pytest.fixture(params=[False, True], ids=["exact", "fast"])
def machine_code(request):
    return compiled(example(), fast=request.param, derivatives=0)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_is_read_at_once(machine_code, quick, layout):
    x, y = arguments()
    y = np.ascontiguousarray(y)
    assert equal(machine_code(x, LAYOUTS[layout](y)), x, y)


@pytest.mark.parametrize("kind", [*KINDS, *SWAPPED])
def test_every_kind_of_number_is_read_at_once(machine_code, quick, kind):
    x, y = np.array([3, 0, 1]), np.array([[1, 0, 100], [7, 2, 1]])
    if np.dtype(kind).kind == "f":
        x, y = x / 4, -y / 8  # exact in every kind
    elif np.dtype(kind).kind == "i":
        y = -y
    x, y = x.astype(kind), y.astype(kind)
    assert equal(machine_code(x, y), x.astype(float), y.astype(float))
    assert equal(machine_code(list(x), list(y)), x.astype(float), y.astype(float))


def test_the_ends_of_short_floats():
    f = compiled(ca.Function("f", [x := ca.SX.sym("x")], [x + 0]), derivatives=0)
    ends = [0.0, 6e-8, -6.1e-5, 65504, np.inf, -np.inf, 2**-14, 0.1]
    for value in np.array(ends, dtype=np.float16):
        assert f(np.array([value]))[0] == float(value)
    assert np.isnan(f(np.array([np.nan], dtype=np.float16))[0])
    assert f(np.array([2**63 - 1]))[0] == 2.0**63
    assert f(np.array([2**64 - 1], dtype=np.uint64))[0] == 2.0**64


@pytest.mark.parametrize(
    "x",
    [
        [1.0, -2, True],
        (np.float64(1), np.int8(-2), np.True_),
        [np.array(1.0), np.float32(-2), 1],
        [[1.0], [-2.0], [1.0]],
        [[1.0, -2.0, 1.0]],
        [np.array([1.0]), np.array([-2]), [1]],
        range(1, 4),
        array.array("d", [1.0, -2.0, 1.0]),
        memoryview(np.array([1.0, -2.0, 1.0])),
    ],
)
def test_lists_and_what_is_like_them(machine_code, x):
    _, y = arguments()
    given = np.array(list(x) if isinstance(x, range) else x, dtype=float).ravel()
    assert equal(machine_code(x, y), given, y)


@pytest.mark.parametrize("one", [2, 2.0, True, np.float64(2), np.float32(2), np.int64(2)])
@pytest.mark.parametrize("wrap", [lambda x: x, np.array, lambda x: [x], lambda x: np.array([[x]])])
def test_numbers_are_read_at_once(quick, one, wrap):
    f = compiled(ca.Function("f", [x := ca.SX.sym("x")], [3 * x]), derivatives=0)
    assert f(wrap(one)).tolist() == [3.0 * float(one)]


def test_one_number_stands_for_all_elements(machine_code, quick):
    x, y = arguments()
    assert equal(machine_code(x, 2.0), x, np.full((2, 3), 2.0))
    assert equal(machine_code(np.array(3), y), np.full(3, 3.0), y)


def test_only_zero_stands_for_all_elements_of_a_model(idm):
    q = np.linspace(0.1, 0.6, 6)
    zero = np.zeros(6)
    for none in (0, 0.0, False, np.float64(0)):
        assert np.array_equal(idm(q, none, 0), idm(q, zero, zero))
    for value in (1.0, np.float64(1), np.array(1.0), np.array([1.0])):
        with pytest.raises(ModelError, match=r"v has .* it needs 6"):
            idm(q, value, 0)


def test_a_sparse_input_takes_the_elements_of_its_pattern(quick):
    x = ca.SX.sym("x", ca.Sparsity.lower(3))
    f = compiled(ca.Function("f", [x], [2 * x]), derivatives=0)
    given = np.arange(1.0, 10).reshape(3, 3)
    for layout in (np.ascontiguousarray, np.asfortranarray, np.float32):
        assert np.array_equal(f(layout(given)), 2 * np.tril(given))
    assert np.array_equal(f(1.0), 2 * np.tril(np.ones((3, 3))))


def test_as_many_inputs_as_a_call_may_have(quick):
    symbols = [ca.SX.sym(f"x{k}", 2) for k in range(64)]
    f = compiled(ca.Function("f", symbols, [sum(symbols, ca.SX(2, 1))]), derivatives=0)
    rows = np.arange(128.0).reshape(64, 2)
    assert np.array_equal(f(*rows), rows.sum(axis=0))


@pytest.mark.parametrize(
    "wrong",
    [
        b"abc",
        "abc",
        ["a", "b", "c"],
        [1.0, 2.0],
        [[1.0, 2.0], 3.0],
        [1.0, None, 2.0],
        np.array([1j, 2, 3]),
        np.array([1, 2, 10**400], dtype=object),
        [1, 2, 10**400],
        np.zeros((3, 1, 1)),
        np.array(["2020"] * 3, dtype="M8[Y]"),
    ],
)
def test_what_holds_no_numbers_is_refused(machine_code, wrong, capfd):
    _, y = arguments()
    with pytest.raises((RuntimeError, NotImplementedError, TypeError, ModelError, ValueError)):
        machine_code(wrong, y)
    capfd.readouterr()


def test_masks_are_not_passed_over(f):
    x, y = arguments()
    for masked in (np.ma.array(y, mask=y > 0), [np.ma.array(row) for row in y]):
        with pytest.raises(ModelError, match="f: an input has a mask"):
            f(x, masked)


def test_out_of_any_layout_is_filled_at_once(machine_code, quick):
    x, y = arguments()
    space = np.full((9, 12), 7.0)
    out = space[0, :8:4], space[2:4, 9:0:-4], space[4:9:4, ::5]
    assert machine_code(x, y, out=out) is out
    assert equal(out, x, y)
    assert (space == 7).sum() == space.size - 14


def test_out_may_share_memory_with_inputs(quick):
    f = compiled(ca.Function("f", [x := ca.SX.sym("x", 3)], [x[::-1], x**2]), derivatives=0)
    x = np.array([1.0, 2, 3])
    squares = np.empty(3)
    f(x, out=(x, squares))
    assert (x.tolist(), squares.tolist()) == ([3, 2, 1], [1, 4, 9])


def test_a_model_whose_inputs_are_checked_is_called_at_once(monkeypatch):
    system = mbs.load("four_bar").assemble()
    ddm = compiled(mbs.models.direct_dynamics(system), derivatives=0)
    q = np.array(system.configuration)
    ddm(q, 0, 0)
    with monkeypatch.context() as patch:
        patch.setattr(array_calls.ArrayCalls, "_slow", None)
        first = ddm(q, np.zeros(1), 0.5)
        assert np.array_equal(ddm(list(q), [0.0], [0.5]), first)
    assert first == pytest.approx(np.array(mbs.models.direct_dynamics(system)(q, 0, 0.5)).ravel())
    for off in (q + 1e-3, list(q + 1e-3)):
        with pytest.raises(Unclosable, match="leaves the loops open"):
            ddm(off, 0, 0)


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
    assert lift(0, 0, 0)[0] == pytest.approx(19.62)


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
