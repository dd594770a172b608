"""Arrays that batches take and give, threads, processes, and what is refused."""

import multiprocessing
import os
import re
import sys

import casadi as ca
import numpy as np
import pytest
from support.batches import bits, example

import mbs.native
from mbs.errors import ModelError
from mbs.native import batch

MODULE = sys.modules["mbs.native._batch"]


def test_what_stands_beside_an_output_is_not_touched():
    f = batch(example())
    x, m = np.ones((21, 5)), np.ones((21, 5, 3))
    y, z = np.full((25, 9), 7.0), np.full((25, 5, 3), 7.0)
    f(x, m, out=(y[2:23, 2:7], z[2:23]))
    y[2:23, 2:7] = z[2:23] = 7.0
    assert (y == 7).all()
    assert (z == 7).all()


@pytest.mark.parametrize("order", ["C", "F"])
def test_results_stored_past_the_caches(order, monkeypatch):
    f = batch(example())
    rng = np.random.default_rng(3)
    x, m = rng.uniform(-2, 2, (1003, 5)), rng.uniform(-2, 2, (1003, 5, 3))
    exact = f(x, m)
    monkeypatch.setattr(MODULE, "_PAST_CACHES", 0)
    for array, found in zip(exact, f(x, m), strict=True):
        np.testing.assert_array_equal(array, found)
    out = tuple(np.zeros(a.shape[::-1]).T if order == "F" else np.zeros(a.shape) for a in exact)
    if order == "F":
        out = (out[0], np.zeros_like(exact[1]))
    for array, found in zip(exact, f(x, m, out=out), strict=True):
        np.testing.assert_array_equal(array, found)


def test_inputs_that_are_the_same_for_all_states():
    f = batch(example())
    rng = np.random.default_rng(4)
    x, m = rng.uniform(-2, 2, (19, 5)), rng.uniform(-2, 2, (5, 3))
    every = f(x, np.repeat(m[None], 19, axis=0))
    for same in (m, np.broadcast_to(m, (19, 5, 3))):
        for a, b in zip(f(x, same), every, strict=True):
            np.testing.assert_array_equal(a, b)
    one = f(x[3], m)
    assert [a.shape for a in one] == [(5,), (5, 3)]
    np.testing.assert_array_equal(one[0], every[0][3])


def test_outputs_and_inputs_in_one_memory():
    """An output may take the place of an input; what would be read after it is not written."""
    q = ca.SX.sym("q", 3)
    f = batch(ca.Function("f", [q], [ca.sin(q) + q[0]], ["q"], ["y"]))
    start = np.random.default_rng(2).uniform(-2, 2, (40, 3))
    exact, place = f(start), start.copy()
    assert f(place, out=place) is place
    np.testing.assert_array_equal(place, exact)
    wide = np.hstack([start, start])
    f(wide[:, :3], out=wide[:, 3:])
    np.testing.assert_array_equal(wide, np.hstack([start, exact]))
    for out in (wide[8:, :3], wide[:32, 1:4]):
        refused(lambda out=out: f(wide[:32, :3], out=out), "out for y shares memory")
    g = batch(example())
    y = np.zeros((4, 5))
    refused(lambda: g(np.ones((4, 5)), np.ones((5, 3)), out=(y, y)), "out for z")


def test_no_states_and_one():
    f = batch(example())
    y, z = f(np.zeros((0, 5)), np.zeros((5, 3)))
    assert (y.shape, z.shape) == ((0, 5), (0, 5, 3))
    y, _ = f(np.ones((1, 5)), np.ones((1, 5, 3)))
    np.testing.assert_allclose(y, np.full((1, 5), np.sin(1) + 1), rtol=1e-15)


@pytest.mark.parametrize("share", [8, 24, 8192])
def test_threads_change_no_bit(share, monkeypatch):
    monkeypatch.setattr(MODULE, "_SHARE", share)
    f = batch(example())
    rng = np.random.default_rng(6)
    x, m = rng.uniform(-2, 2, (1013, 5)), rng.uniform(-2, 2, (1013, 5, 3))
    one = f(x, m, threads=1)
    for threads in (2, 3, None):
        for a, b in zip(one, f(x, m, threads=threads), strict=True):
            np.testing.assert_array_equal(bits(a), bits(b))
    for k in (0, 500, 1012):
        np.testing.assert_array_equal(bits(f(x[k], m[k])[0]), bits(one[0][k]))


def test_sparse_inputs_and_outputs():
    m = ca.SX.sym("m", ca.Sparsity.lower(3))
    f = ca.Function("f", [m], [m.T * 2, ca.SX(2, 2)], ["m"], ["y", "zero"])
    y, zero = batch(f)(np.full((9, 3, 3), 1.5))
    np.testing.assert_array_equal(y, np.broadcast_to(np.triu(np.full((3, 3), 3.0)), (9, 3, 3)))
    np.testing.assert_array_equal(zero, np.zeros((9, 2, 2)))


def refused(call, *words):
    with pytest.raises(ModelError) as error:
        call()
    message = str(error.value)
    assert all(re.search(word, message) for word in words), message
    assert "\n" not in message


def test_what_does_not_fit_is_refused():
    f = batch(example())
    x, m = np.ones((4, 5)), np.ones((4, 5, 3))
    y, z = np.ones((4, 5)), np.ones((4, 5, 3))
    refused(lambda: f(x.astype(complex), m), "input x", "complex128", "give numbers")
    refused(lambda: f("x", m), "input x is 'x'; give numbers")
    refused(lambda: f(x, m, out=(y.astype(np.float32), z)), "out for y", "float32", "float64")
    refused(lambda: f(np.ones((4, 6)), m), "input x", r"\(4, 6\)", r"\(N, 5\)")
    refused(lambda: f(x, np.ones((5, 4, 3))), "input m", r"\(N, 5, 3\)")
    refused(lambda: f(x, np.ones((3, 5, 3))), "x has 4 states", "m has 3 states")
    refused(lambda: f(x), "input m is missing")
    refused(lambda: f(x, m, x), "3 inputs")
    refused(lambda: f(x, m, w=x), "'w'", "x, m")
    refused(lambda: f(x, m, x=x), "'x'")
    uneven = np.asfortranarray(np.ones((5, 4, 3))).swapaxes(0, 1)
    refused(lambda: f(x, m, out=(y, uneven.swapaxes(0, 1)[:4, :, ::2])), "out for z")
    refused(lambda: f(x, m, out=y), "1 arrays", "2 outputs")
    refused(lambda: f(x, m, out=(y, z[:3])), "out for z", r"\(4, 5, 3\)")
    refused(lambda: f(x, m, out=(np.broadcast_to(y[0], (4, 5)), z)), "out for y", "writable")
    refused(lambda: f(np.ma.array(x, mask=x > 0), m), "input x has a mask", "filled")
    y.flags.writeable = False
    refused(lambda: f(x, m, out=(y, z)), "out for y", "writable")
    refused(lambda: f(x, m, threads=0), "threads is 0")
    refused(lambda: f(x, m, threads=True), "threads is True")
    given = [np.zeros((4, 5)), z]
    np.testing.assert_array_equal(f(x, m, out=given, threads=np.int64(2))[0], f(x, m)[0])
    refused(lambda: batch([]), "no Function")
    refused(lambda: batch("idm"), "'idm' is not a Function")
    refused(lambda: batch(None), "None is not a Function")
    refused(lambda: batch([example(), 3]), "3 is not a Function")
    refused(lambda: batch([example(5), example(4)]), r"x\[4\]", r"x\[5\]")


def test_numbers_of_every_kind_are_taken():
    f = batch(example())
    x, m = np.arange(20.0).reshape(4, 5) / 32, np.arange(15.0).reshape(5, 3) / 8
    wanted = f(x, m)
    many = np.broadcast_to(m, (4, 5, 3))
    for given in (
        (x.astype(np.float32), m),
        (x.tolist(), m.tolist()),
        (x, np.asfortranarray(many.swapaxes(0, 1)).swapaxes(0, 1)),
        (np.frombuffer(b"0" + x.tobytes(), offset=1).reshape(4, 5), m),
    ):
        for a, b in zip(f(*given), wanted, strict=True):
            np.testing.assert_array_equal(a, b)
    ones = np.ones((2, 5), dtype=int)
    np.testing.assert_array_equal(f(ones, m)[0], f(ones.astype(float), m)[0])


def test_without_a_compiler_casadi_interprets(monkeypatch):
    rng = np.random.default_rng(9)
    x, m = rng.uniform(-2, 2, (23, 5)), rng.uniform(-2, 2, (5, 3))
    exact = batch(example())(x, m)
    monkeypatch.setattr(MODULE, "compiler_found", lambda: False)
    f = batch(example())
    assert f.lanes == 0
    assert "no C compiler" in repr(f)
    for a, b in zip(exact, f(x, m), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-14)
    assert [a.shape for a in f(x[0], m)] == [(5,), (5, 3)]
    assert f(x[:0], m)[1].shape == (0, 5, 3)


def test_what_has_no_scalar_operations_is_interpreted():
    A, b = ca.MX.sym("A", 2, 2), ca.MX.sym("b", 2)
    f = batch(ca.Function("f", [A, b], [ca.solve(A, b, "qr")], ["A", "b"], ["x"]))
    assert f.lanes == 0
    assert "scalar operations" in f.note
    matrix = np.array([[4.0, 1], [2, 3]])
    right = np.arange(10.0).reshape(5, 2)
    np.testing.assert_allclose(f(matrix, right), np.linalg.solve(matrix, right.T).T, rtol=1e-14)


def built(folder):
    os.environ["MBS_CACHE_DIR"] = folder
    return mbs.native.batch(example())(np.ones(5), np.ones((5, 3)))[0].sum()


def test_two_processes_build_at_once(tmp_path):
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.map(built, [str(tmp_path)] * 2)
    assert found == pytest.approx([5 * (np.sin(1) + 1)] * 2)
    assert len(list(tmp_path.iterdir())) == 1
