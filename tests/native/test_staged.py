import ctypes
import subprocess

import casadi as ca
import numpy as np
import pytest

from mbs.native import compile_library, compiled, find_compiler
from mbs.native.c_code import LANES
from mbs.native.kernel import FAST_FLAGS, kernel_library, kernel_source
from mbs.native.staged import staged
from mbs.operations.graph import graph_of

LOWER = ca.Sparsity.lower(2)


def column():
    """Shared and mapped, sparse and dense inputs; operations that are vectors and that are not."""
    k, x, z = ca.SX.sym("k", 2), ca.SX.sym("x", 3), ca.SX.sym("z", LOWER)
    y = x * k[0] + ca.sin(x[::-1]) * z[1, 0] - ca.cos(x) / k[1]
    s = ca.sum1(x) ** 3.5 * k[1] + z[1, 1] ** k[0] + ca.sin(k[0]) * 2
    t = ca.if_else(x[0] < x[1], z, 2 * z) @ z
    return ca.Function("column", [k, x, z], [y, s, t, k + 1], ["k", "x", "z"], ["y", "s", "t", "u"])


def mapped(n):
    return column().map("mapped", "serial", n, [0, 2], [])


def symbols(n):
    return ca.MX.sym("K", 2), ca.MX.sym("X", 3, n), ca.MX.sym("Z", LOWER)


def values(function, seed=0):
    """Random positive inputs."""
    rng, result = np.random.default_rng(seed), []
    for k in range(function.n_in()):
        pattern = function.sparsity_in(k)
        result.append(ca.DM(pattern, rng.uniform(0.5, 1.5, pattern.nnz())).full())
    return result


def assert_equal(function, *inputs, tolerance=1e-13):
    inputs = inputs or values(function)
    found = compiled(function, fast=True, derivatives=0)(*inputs)
    exact = ca.Function(function)(*inputs)
    if function.n_out() == 1:
        found, exact = (found,), (exact,)
    for a, b in zip(found, exact, strict=True):
        b = b.full()
        assert isinstance(a, np.ndarray)
        scale = np.abs(b).max(initial=1e-300)
        np.testing.assert_allclose(a.reshape(b.shape), b, rtol=0, atol=tolerance * scale)


@pytest.mark.parametrize("n", [1, 2, 7, 8, 9, 20])
def test_columns_of_any_number(n):
    K, X, Z = symbols(n)
    f = ca.Function("f", [K, X, Z], mapped(n)(K, X, Z))
    assert (staged(f) is not None) == (n > 1)
    assert_equal(f)


def test_a_map_is_printed_once():
    lines = []
    for n in (16, 64):
        K, X, Z = symbols(n)
        text = kernel_source([ca.Function("f", [K, X, Z], mapped(n)(K, X, Z)[:1])])["f.c"]
        lines.append(text[text.index("f_map0_part0") : text.index("static NOINLINE")].count("\n"))
        assert f"c < {n}; c += MBS_LANES" in text
    assert lines[0] == lines[1]


def moved_results():
    """Everything that may happen to matrices between two maps."""
    n = 9
    K, X, Z = symbols(n)
    y, s, t, u = mapped(n)(K, ca.horzcat(X[:, 4:], X[:, :4]) * 2, Z)
    again = column().map("again", "serial", n, [0], [])
    y2, s2, _, _ = again(K + 1 / ca.sum2(s), ca.fabs(ca.cos(y))[[2, 0, 1], :], t / 9)
    a, b = ca.horzsplit(y2, [0, 2, n])
    top, bottom = ca.vertsplit(y2, [0, 1, 3])
    outputs = {
        "both": ca.horzcat(y, y2),
        "first": a,
        "rest": b.T,
        "stacked": ca.vertcat(bottom, s2, top),
        "long": ca.reshape(y2, -1, 1),
        "upper": ca.triu(y2[:, :3]),
        "full": ca.densify(ca.triu(y2[:, :3])),
        "part": u[::2, 1:3],
        "between": ca.sin(K[0]) + s[3],
        "constant": ca.DM([1, 2]),
        "input": X[:, 0],
        "twice": s,
    }
    return ca.Function("f", [K, X, Z], list(outputs.values()), ["K", "X", "Z"], list(outputs))


def test_matrices_between_maps():
    f = moved_results()
    stages = staged(f)
    assert [m.columns for m in stages.maps] == [9, 9]
    assert [m.shared for m in stages.maps] == [(True, False, True), (True, False, False)]
    assert stages.scalar.n_in() == f.n_in() + 8
    assert_equal(f)


def test_columns_that_are_outputs_are_not_copied():
    K, X, Z = symbols(12)
    y, s, _, _ = mapped(12)(K, X, Z)
    a, b = ca.horzsplit(y, [0, 5, 12])
    text = kernel_source([ca.Function("f", [K, X, Z], [a, b])])["f.c"]
    part = text[text.index("void f_part1") : text.index("f_map0_part0")]
    assert "] = " not in part.replace("= in[", "").replace("= out[", "")
    assert_equal(ca.Function("f", [K, X, Z], [a, b, ca.horzcat(s, s)]))


def test_maps_in_functions_in_functions():
    K, X, Z = symbols(8)
    inner = ca.Function("inner", [X, K, Z], [mapped(8)(K, X, Z)[0]], {"never_inline": True})
    f = ca.Function("f", [K, X, Z], [inner(X, K, Z) + inner(2 * X, K, Z)])
    assert len(staged(f).maps) == 2
    assert_equal(f)


def test_maps_of_maps():
    """What `map` makes for threads that share the columns."""
    f = column().map(12, "thread", 3)
    (m,) = staged(f).maps
    assert (m.columns, m.column.name()) == (12, "column")
    assert_equal(f)


def test_inputs_that_are_parts_of_a_vector():
    K, X, Z = symbols(8)
    y = mapped(8)(K, X, Z)[0]
    f = ca.Function("f", [ca.veccat(K, X), Z], [ca.veccat(y[:, 2], y[:, 4])])
    assert staged(f) is not None
    assert_equal(f)


def test_scalar_stages_keep_their_vector_sines():
    K, X, Z = symbols(8)
    y, s, _, _ = mapped(8)(ca.sin(K) + 1, ca.cos(X), Z)
    f = ca.Function("f", [K, X, Z], [ca.sin(y), s])
    text = kernel_source([f])["f.c"]
    assert text.count("mbs_sincos8(") == 4 + 3
    assert_equal(f)


@pytest.mark.parametrize("size", [1e3, 1e6, 1e300])
def test_sines_of_any_angle_in_lanes(size):
    x = ca.SX.sym("x", 2)
    f = ca.Function("g", [x], [ca.sin(x), ca.cos(x)]).map(11)
    assert f.class_name() == "Map"
    assert "mbs_sincos_wide(" in kernel_source([f])[f"{f.name()}.c"]
    angles = np.random.default_rng(0).uniform(-size, size, (2, 11))
    s, c = compiled(f, fast=True, derivatives=0)(angles)
    np.testing.assert_allclose(s, np.sin(angles), rtol=0, atol=2.3e-16)
    np.testing.assert_allclose(c, np.cos(angles), rtol=0, atol=2.3e-16)


def test_long_columns_are_cut_into_blocks():
    x, p = ca.SX.sym("x", 40), ca.SX.sym("p", 40)
    y = x
    for k in range(40):
        y = ca.vertcat(y[3:], y[:3]) * p[k] + ca.sin(x[k]) * y
    f = ca.Function("f", [p, x], [y, p * p[0]]).map("f", "serial", 13, [0], [])
    text = kernel_source([f])["f.c"]
    assert text.count("NOINLINE void f_map0_part") > 3
    assert_equal(f)


def test_pointers_that_the_caller_leaves_out():
    K, X, Z = symbols(9)
    f = ca.Function("f", [K, X, Z], mapped(9)(K, X, Z)[:2])
    library = ctypes.CDLL(str(kernel_library([f])))
    sizes = [ctypes.c_longlong() for _ in range(4)]
    library.f_work(*map(ctypes.byref, sizes))
    work, out = (ctypes.c_double * sizes[3].value)(), (ctypes.c_double * 27)()
    k = (ctypes.c_double * 2)(1.0, 2.0)
    arg = (ctypes.c_void_p * 3)(ctypes.addressof(k), None, None)
    res = (ctypes.c_void_p * 2)(ctypes.addressof(out), None)
    assert library.f(arg, res, None, work, 0) == 0
    assert list(out) == [-0.5] * 27


@pytest.mark.parametrize("flags", ["-O0", "-O3", "-mno-avx512f", "-mno-avx"])
def test_other_processors(flags, tmp_path):
    machine = [*find_compiler().command, "-dumpmachine"]
    answer = subprocess.run(machine, capture_output=True, text=True).stdout
    if flags.startswith("-m") and "x86_64" not in answer:
        pytest.skip("not an x86 compiler")
    f = moved_results()
    for name, text in kernel_source([f]).items():
        (tmp_path / name).write_text(text)
    library = tmp_path / "kernel.so"
    compile_library([tmp_path / "f.c"], [tmp_path], (*FAST_FLAGS, flags), library)
    for a, b in zip(ca.external("f", str(library))(*values(f)), f(*values(f)), strict=True):
        assert ca.norm_inf((a - b)[:]) <= 1e-13 * max(1.0, float(ca.norm_inf(b[:])))


def test_what_is_not_known_between_maps_is_expanded():
    K, X, Z = symbols(4)
    y = mapped(4)(K, X, Z)[0]
    f = ca.Function("f", [K, X, Z], [y @ y.T, ca.norm_2(y[:])])
    assert staged(f) is None
    assert_equal(f)


def test_what_has_no_scalar_operations_is_left_to_casadi():
    A, b = ca.MX.sym("A", 3, 3), ca.MX.sym("b", 3)
    solve = ca.Function("solve", [A, b], [ca.solve(A, b, "qr")])
    f = solve.map("f", "serial", 5, [0], [])
    assert staged(f) is None or kernel_library([f]) is None
    matrix = np.array([[4.0, 1, 0], [1, 3, 1], [0, 1, 2]])
    right = np.arange(15.0).reshape(3, 5)
    found = compiled(f, fast=True, derivatives=0)(np.asfortranarray(matrix), right)
    assert found == pytest.approx(np.linalg.solve(matrix, right))


def test_derivatives_of_maps():
    K, X, Z = symbols(9)
    f = ca.Function("f", [K, X, Z], mapped(9)(K, X, Z)[:2])
    g = compiled(f, fast=True)
    total = [ca.sumsqr(h(K, X, Z)[0]) + ca.sum2(h(K, X, Z)[1]) for h in (f, g)]
    slopes = [ca.Function("s", [K, X, Z], [ca.gradient(x, X), ca.gradient(x, K)]) for x in total]
    exact, found = (slope(*values(f)) for slope in slopes)
    for a, b in zip(exact, found, strict=True):
        assert a.full() == pytest.approx(b.full(), rel=1e-12)


def test_lanes_are_completed_by_zeros():
    K, X, Z = symbols(9)
    stages = staged(ca.Function("f", [K, X, Z], mapped(9)(K, X, Z)[:1]))
    (m,) = stages.maps
    graph = graph_of(stages.scalar)
    lanes = graph.results[m.inputs[1]]
    assert len(lanes) == 2 * LANES * 3
    args = [graph.nodes[n].args for n in lanes]
    assert [row[1] for row in args[:LANES]] == list(range(0, 24, 3))
    assert [graph.nodes[n].value for n in lanes[3 * LANES + 1 : 4 * LANES]] == [0.0] * 7
