import ctypes
import subprocess
from functools import cache

import casadi as ca
import numpy as np
import pytest

from mbs.errors import ModelError
from mbs.native import find_compiler
from mbs.native.compiler import FLAGS
from mbs.native.scalar_source import is_scalar, plain_flags, plain_source

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror")


@cache
def long_function(steps):
    """Every value depends on those before, so that pieces hand values to each other."""
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    values = [*ca.vertsplit(x), *ca.vertsplit(p)]
    rng = np.random.default_rng(7)
    for k in range(steps):
        a, b = (values[n] for n in rng.integers(max(0, len(values) - 40), len(values), 2))
        forms = (ca.sin(a) * b, a - 0.5 * b, ca.sqrt(1 + a * a), ca.if_else(a < b, a, -b), a / 3)
        values.append(forms[k % len(forms)])
    return ca.Function("long_one", [x, p], [ca.vertcat(*values[-40:]), values[5]])


def library_of(source, folder):
    (folder / "f.c").write_text(source)
    command = [*find_compiler().command, *STRICT, *FLAGS, "f.c", "-o", "f.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "f.so"))


def called(library, function, work, *arguments):
    f, w = library[function.name()], np.zeros(work.w + 1)
    assert (work.arg, work.res, work.iw) == (function.n_in(), function.n_out(), 0)
    inputs = [np.ascontiguousarray(a, dtype=float) for a in arguments]
    outputs = [np.full(function.nnz_out(k), np.nan) for k in range(function.n_out())]
    pointer = ctypes.POINTER(ctypes.c_double)
    arg = (pointer * len(inputs))(*(a.ctypes.data_as(pointer) for a in inputs))
    res = (pointer * len(outputs))(*(a.ctypes.data_as(pointer) for a in outputs))
    assert f(arg, res, None, w.ctypes.data_as(pointer), 0) == 0
    return outputs


@pytest.mark.parametrize("block", [10_000, 50])
def test_pieces_give_the_bits_of_the_interpreted_function(block, tmp_path):
    function = long_function(2000)
    source, work = plain_source([function], block)
    library = library_of(source, tmp_path)
    rng = np.random.default_rng(1)
    for _ in range(5):
        x, p = rng.standard_normal(3), rng.standard_normal(2)
        outputs = called(library, function, work, x, p)
        for found, wanted in zip(outputs, function(x, p), strict=True):
            np.testing.assert_array_equal(found, wanted.full().ravel())


def test_a_function_is_split_where_it_is_long():
    function = long_function(4000)
    pieces = plain_source([function], 100)[0].count("static NOINLINE void long_one_part")
    assert 5 <= pieces <= function.n_instructions() / 80
    assert "NOINLINE void" not in plain_source([long_function(20)])[0]


def test_what_has_no_scalar_operations_is_refused():
    x = ca.MX.sym("x", 3)
    A = ca.MX.sym("A", 3, 3)
    with pytest.raises(ModelError):
        plain_source([ca.Function("f", [A, x], [ca.solve(A, x, "lsqr")])])


def test_only_scalar_operations_are_written_without_an_expansion():
    x, y = ca.SX.sym("x"), ca.MX.sym("y")
    assert is_scalar(ca.Function("f", [x], [ca.if_else(x > 0, ca.sin(x), x)]))
    assert not is_scalar(ca.Function("f", [x], [ca.erfinv(x)]))
    assert not is_scalar(ca.Function("f", [y], [ca.sin(y)]))


def test_very_long_text_is_optimized_less():
    assert plain_flags("\n" * 1000) == FLAGS
    assert plain_flags("\n" * 200_000) == ("-O1", *FLAGS[1:])
