"""Batches of Functions: every operation and number, in every layout."""

import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.batches import bits, example

from mbs.native import batch, compiled, find_compiler
from mbs.native.batch_source import batch_source
from mbs.native.c_code import BINARY, ELEMENTWISE
from mbs.native.kernel import FAST_FLAGS

MODULE = sys.modules["mbs.native._batch"]
INF = float("inf")
VALUES = np.array(
    [
        *(float("nan"), INF, -INF, 0.0, -0.0, 5e-324, 1e-310, -1e-30, 0.3, -0.49, 0.5, 0.66, -0.7),
        *(1.0, -1.0, 2.4, 2.5, -3.0, 20.0, 36.0, 700.0, 709.7, -709.7, 710.3, -745.0, 8e4, -1.1e5),
        *(1e15, 1e300, -1e300, 1e-300),
    ]
)


def interpreted(function, *arrays):
    """What CasADi gives for every state: arrays whose first length is that of the states."""
    rows = len(arrays[0])
    answers = [function.call([ca.DM(x[k]) for x in arrays]) for k in range(rows)]
    results = [np.array([a[k].full() for a in answers]) for k in range(function.n_out())]
    return [x[:, :, 0] if x.shape[2] == 1 else x for x in results]


def every_operation():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    results, names = [], []
    for op in sorted(ELEMENTWISE):
        results.append(ca.SX.binary(op, x, y) if op in BINARY else ca.SX.unary(op, x))
        names.append(op)
    return ca.Function("f", [x, y], [ca.vertcat(*results)]), names


FLAGS = ((), ("-mno-avx512f",), ("-mno-avx",))


@pytest.fixture(params=FLAGS, ids=" ".join)
def processors(request, monkeypatch):
    """Code as other processors of this family get it."""
    machine = [*find_compiler().command, "-dumpmachine"]
    answer = subprocess.run(machine, capture_output=True, text=True).stdout
    if any(flag.startswith("-m") for flag in request.param) and "x86_64" not in answer:
        pytest.skip("not an x86 compiler")
    monkeypatch.setattr(MODULE, "FAST_FLAGS", (*FAST_FLAGS, *request.param))


@pytest.mark.usefixtures("processors")
def test_every_operation_of_every_kind_of_number():
    f, names = every_operation()
    x, y = (a.reshape(-1, 1) for a in np.meshgrid(VALUES, VALUES))
    b = batch(f)
    assert b.lanes > 0
    (exact,) = interpreted(f, x, y)
    found = b(x, y)
    for k, op in enumerate(names):
        with np.errstate(all="ignore"):
            np.testing.assert_allclose(
                found[:, k], exact[:, k], rtol=2e-15, atol=1e-320, err_msg=f"operation {op}"
            )


def test_scalar_code_and_maps_give_the_same():
    """Of every kind of number too; columns of maps are computed in the same lanes."""
    f, _ = every_operation()
    one = compiled(f, fast=True, derivatives=0)
    x, y = VALUES[:27], VALUES[::-1][:27]
    every = compiled(f.map(27), fast=True, derivatives=0)(x.reshape(1, -1), y.reshape(1, -1))
    (exact,) = interpreted(f, x, y)
    np.testing.assert_allclose(every.T, exact, rtol=2e-15, atol=1e-320)
    scalar = [np.array(one(np.array(a), np.array(b))) for a, b in zip(x, y, strict=True)]
    np.testing.assert_allclose(scalar, exact, rtol=2e-15, atol=1e-320)


@pytest.mark.usefixtures("processors")
def test_functions_in_lanes_are_accurate():
    x, size = ca.SX.sym("x", 2), ca.SX.sym("size")
    every = [ca.exp, ca.expm1, ca.tanh, ca.sinh, ca.cosh, ca.atan, ca.sin, ca.cos, ca.tan, ca.sqrt]
    some = [ca.asin(x[0] / size), ca.acos(x[0] / size), ca.log(x[1]), ca.atan2(x[0], x[1])]
    f = ca.Function("f", [x, size], [ca.vertcat(*(g(x[0]) for g in every), *some)])
    rng = np.random.default_rng(0)
    scale = np.repeat([3e-9, 1.0, 30.0, 800.0], 500).reshape(-1, 1)
    states = scale * rng.uniform(-1, 1, (2000, 2))
    states[:, 1] = np.abs(states[:, 1]) + 1e-3
    states[::2, 0] = np.abs(states[::2, 0])
    (exact,) = interpreted(f, states, scale)
    np.testing.assert_allclose(batch(f)(states, scale), exact, rtol=2e-15, atol=1e-320)


SMOOTH = (
    lambda x, y: x + y,
    lambda x, y: x - y,
    lambda x, y: x * y,
    lambda x, y: x / (2 + y * y),
    lambda x, y: ca.sin(x) * ca.cos(y),
    lambda x, y: ca.sqrt(x * x + 0.25),
    lambda x, y: ca.tanh(3 * x) - y,
    lambda x, y: ca.atan2(x, 1 + abs(y)),
    lambda x, y: ca.exp(-x * x),
    lambda x, y: (x * x + 1) ** 1.5,
    lambda x, y: ca.log(1 + y * y),
    ca.fmin,
    ca.fmax,
    lambda x, y: abs(x) - y,
)
CHOICES = (lambda x, y: x < y, lambda x, y: x >= 0, lambda x, y: ca.logic_and(x > 0, y > 0))


@st.composite
def functions(draw):
    """Functions of three inputs; conditions look at inputs alone, where nothing is rounded."""
    q, v, k = ca.SX.sym("q", 2), ca.SX.sym("v", 2), ca.SX.sym("k")
    values = inputs = [q[0], q[1], v[0], v[1], k]
    pick = st.integers(0, 10_000)
    for _ in range(draw(st.integers(1, 12))):
        x, y = (values[draw(pick) % len(values)] for _ in range(2))
        form = draw(st.integers(0, len(SMOOTH)))
        if form < len(SMOOTH):
            made = SMOOTH[form](x, y)
        else:
            a, b = (inputs[draw(pick) % len(inputs)] for _ in range(2))
            made = ca.if_else(CHOICES[draw(pick) % len(CHOICES)](a, b), x, y)
        values = [*values, made]
    results = [ca.vertcat(*values[5:]), ca.horzcat(values[-1], values[-1] * k, q[0])]
    return ca.Function("f", [q, v, k], results)


@settings(max_examples=12, deadline=None, derandomize=True, database=None)
@given(functions(), st.integers(1, 21))
def test_any_function(f, states):
    rng = np.random.default_rng(states)
    q, v, k = (rng.uniform(-2, 2, (states, n)) for n in (2, 2, 1))
    q[0, 0], v[-1, 1] = np.nan, np.inf
    with np.errstate(all="ignore"):
        for found, exact in zip(batch(f)(q, v, k), interpreted(f, q, v, k), strict=True):
            np.testing.assert_allclose(found.reshape(exact.shape), exact, rtol=1e-12, atol=1e-13)


def layouts(array):
    """The same numbers, in memory in other ways."""
    yield np.asfortranarray(array) if array.ndim == 2 else array
    wide = np.zeros((len(array), 2, *array.shape[1:]))
    wide[:, 1] = array
    yield wide[:, 1]
    yield np.ascontiguousarray(array[::-1])[::-1]
    last = np.ascontiguousarray(np.moveaxis(array, 0, -1))
    yield np.moveaxis(last, -1, 0)


@pytest.mark.sweep
@pytest.mark.usefixtures("processors")
@pytest.mark.parametrize("rows", [1, 6, 13])
def test_layouts(rows):
    f = batch(example(rows))
    rng = np.random.default_rng(rows)
    x, m = rng.uniform(-2, 2, (43, rows)), rng.uniform(-2, 2, (43, rows, 3))
    y, z = f(x, m)
    assert (y.shape, z.shape) == ((43, rows), (43, rows, 3))
    np.testing.assert_allclose(y, np.sin(x) + m[:, :, 1], rtol=1e-15, atol=1e-15)
    np.testing.assert_array_equal(z, x[:, :, None] * m)
    for own, matrix in zip(layouts(x), layouts(m), strict=True):
        for a, b in zip(layouts(np.zeros_like(y)), layouts(np.zeros_like(z)), strict=True):
            assert f(own, matrix, out=(a, b))[0] is a
            np.testing.assert_array_equal(a, y)
            np.testing.assert_array_equal(b, z)


def test_a_state_does_not_depend_on_the_others():
    """Large angles, infinities and NaN of a neighbour change no bit."""
    x = ca.SX.sym("x", 3)
    results = [ca.sin(x), ca.cos(x), ca.atan2(x, 2), ca.tan(x), ca.exp(x), ca.log(x)]
    f = batch(ca.Function("f", [x], [ca.vertcat(*results)]))
    states = np.random.default_rng(5).uniform(-3, 3, (64, 3))
    disturbed = states.copy()
    disturbed[::5] = [1e9, np.nan, np.inf]
    kept = np.arange(64) % 5 != 0
    np.testing.assert_array_equal(bits(f(states)[kept]), bits(f(disturbed)[kept]))


def test_functions_share_inputs_and_operations():
    q, v = ca.SX.sym("q", 3), ca.SX.sym("v", 3)
    one = ca.Function("one", [q], [ca.exp(q) * 2], ["q"], ["a"])
    two = ca.Function("two", [v, q], [v / ca.exp(q), ca.tanh(v)], ["v", "q"], ["a", "b"])
    f = batch([one, two])
    assert [str(port) for port in f.inputs] == ["q[3]", "v[3]"]
    assert [port.name for port in f.outputs] == ["one.a", "two.a", "two.b"]
    assert batch_source(f.function).files["batch.c"].count("mbs_exp(") == 3
    states = np.random.default_rng(7).uniform(-1, 1, (11, 2, 3))
    a, b, c = f(v=states[:, 1], q=states[:, 0])
    np.testing.assert_allclose(a, 2 * np.exp(states[:, 0]), rtol=1e-15)
    np.testing.assert_allclose(b, states[:, 1] / np.exp(states[:, 0]), rtol=1e-15)
    np.testing.assert_allclose(c, np.tanh(states[:, 1]), rtol=1e-15)


def test_long_functions_are_cut_into_blocks():
    x = ca.SX.sym("x", 6)
    y = x
    for k in range(300):
        y = ca.vertcat(y[1:], 0.5 * ca.sin(y[0]) * y[1] + k / (2000 + y[2] ** 2))
    f = ca.Function("f", [x], [y, ca.jacobian(y, x)])
    b = batch(f)
    assert batch_source(b.function).files["batch.c"].count("NOINLINE void batch_part") > 2
    states = np.random.default_rng(8).uniform(-1, 1, (13, 6))
    for found, exact in zip(b(states), interpreted(f, states), strict=True):
        np.testing.assert_allclose(found, exact, rtol=0, atol=1e-13 * abs(exact).max())
