import ctypes
import platform
import subprocess

import casadi as ca
import numpy as np
import pytest
from support.random_trees import random_state, random_tree

import mbs
import mbs.models
from mbs.native import compile_library, compiled, find_compiler
from mbs.native.c_code import LANES, SinCosGroup, blocks, gives, needs, schedule, slots
from mbs.native.kernel import FAST_FLAGS, kernel_library, kernel_source, processor
from mbs.operations.graph import graph_of

OPERATIONS = {
    "arithmetic": lambda x, y: [x + y, x - y, x * y, x / y, -x, x * x, x + x, 1 / x],
    "powers": lambda x, y: [ca.sqrt(x * x + 1), abs(x) ** y, (2 + x) ** 3.5, ca.exp(x)],
    "angles": lambda x, y: [ca.sin(x), ca.cos(y), ca.tan(x), ca.atan2(y, x), ca.hypot(x, y)],
    "inverse": lambda x, y: [ca.asin(x / 9), ca.acos(x / 9), ca.atan(x), ca.atanh(x / 9)],
    "hyperbolic": lambda x, y: [ca.sinh(x), ca.cosh(x), ca.tanh(x), ca.asinh(x), ca.acosh(9 + x)],
    "logarithms": lambda x, y: [ca.log(9 + x), ca.log1p(x / 9), ca.expm1(x), ca.erf(x)],
    "comparisons": lambda x, y: [x < y, x <= y, x == y, x != y, ca.if_else(x < y, x, y)],
    "logic": lambda x, y: [ca.logic_and(x > 0, y > 0), ca.logic_or(x > 0, y > 0), ca.logic_not(x)],
    "rounding": lambda x, y: [ca.floor(x), ca.ceil(x), ca.fmod(x, y), ca.remainder(x, y)],
    "signs": lambda x, y: [ca.sign(x), abs(x), ca.copysign(x, y), ca.fmin(x, y), ca.fmax(x, y)],
    "constants": lambda x, y: [x * -0.1, x + 1e300, x - 1e-300, x * ca.pi, y - ca.inf, 0 * x + 7],
}


def fast(function, **options):
    return compiled(function, derivatives=0, fast=True, **options)


def worst(function, *states):
    """The largest difference to the interpreted Function, relative to its largest element."""
    g, f = fast(function), ca.Function(function)
    result = 0.0
    for inputs in states:
        outputs, exact = g(*inputs), f(*inputs)
        if function.n_out() == 1:
            outputs, exact = (outputs,), (exact,)
        for a, b in zip(outputs, exact, strict=True):
            values = b.full().ravel()
            error = np.abs(np.ravel(a) - values).max()
            result = max(result, error / max(np.abs(values).max(), 1e-300))
    return result


@pytest.mark.sweep
@pytest.mark.parametrize("kind", OPERATIONS)
def test_every_operation(kind):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    f = ca.Function("f", [x, y], [ca.vertcat(*OPERATIONS[kind](x, y))])
    g = fast(f)
    values = (-2.5, -1.0, 0.0, 0.3, 1.0, 2.0)
    for a, b in ((a, b) for a in values for b in values):
        exact = f(a, b).full().ravel()
        np.testing.assert_allclose(g(np.array(a), np.array(b)), exact, rtol=1e-14, atol=1e-15)


@pytest.mark.sweep
@pytest.mark.parametrize("name", ["puma560", "rx90", "stanford", "two_branch_tree"])
@pytest.mark.parametrize("builder", ["inverse_dynamics", "inertia_matrix", "direct_dynamics"])
def test_models(name, builder):
    model = getattr(mbs.models, builder)(mbs.load(name).assemble())
    rng = np.random.default_rng(0)
    sizes = [model.size1_in(k) for k in range(model.n_in())]
    states = [[rng.uniform(-2, 2, size) for size in sizes] for _ in range(5)]
    assert worst(model, *states) < 1e-13


@pytest.mark.parametrize("builder", ["inverse_dynamics", "direct_dynamics"])
def test_a_floating_tree_with_quaternions(builder):
    system = random_tree(3, 4, ("free", "spherical", "revolute")).mechanism.assemble()
    rng = np.random.default_rng(1)
    states = [random_state(system, rng) for _ in range(5)]
    assert worst(getattr(mbs.models, builder)(system), *states) < 1e-13


def test_a_closed_chain():
    system = mbs.load("five_bar").assemble()
    model = mbs.models.inverse_dynamics(system)
    q = np.array(system.configuration)
    inputs = [q, *(np.full(model.size1_in(k), 0.3) for k in (1, 2))]
    assert worst(model, inputs) < 1e-13


def angles(sines):
    x = ca.SX.sym("x", 11)
    return ca.Function("f", [x], [ca.sin(x), ca.cos(x)] if sines else [ca.cos(x)])


@pytest.mark.parametrize("size", [0.1, 3.0, 1e3, 1e5, 1e7, 1e15, 1e300])
def test_sines_and_cosines_of_any_angle(size):
    f, rng = fast(angles(True)), np.random.default_rng(0)
    for _ in range(200):
        x = rng.uniform(-size, size, 11)
        s, c = f(x)
        np.testing.assert_allclose(s, np.sin(x), rtol=0, atol=2.3e-16)
        np.testing.assert_allclose(c, np.cos(x), rtol=0, atol=2.3e-16)


def test_sines_and_cosines_near_their_zeros():
    k = np.arange(1, 12) * 5000
    for near in (k * np.pi, (k + 0.5) * np.pi, k * 1e-12):
        s, c = fast(angles(True))(near)
        np.testing.assert_allclose(s, np.sin(near), rtol=1e-15, atol=0)
        np.testing.assert_allclose(c, np.cos(near), rtol=1e-15, atol=0)


def test_sines_and_cosines_of_no_number():
    x = np.array([0.5, np.nan, np.inf, -np.inf, *range(7)])
    s, c = fast(angles(True))(x)
    assert np.isnan(s).tolist() == np.isnan(c).tolist() == [False] + [True] * 3 + [False] * 7
    assert s[0] == pytest.approx(np.sin(0.5), rel=1e-15)


def nested():
    x = ca.SX.sym("x", 3)
    inner = ca.sin(x[0] + x[1]) * x[2]
    outer = ca.cos(inner) + ca.sin(x[2])
    return ca.Function("f", [x], [ca.vertcat(outer, ca.sin(inner), inner, x[0], 4)])


def test_angles_are_computed_together_and_in_order():
    graph = graph_of(nested())
    steps = schedule(graph)
    batches = [step for step in steps if isinstance(step, SinCosGroup)]
    assert [len(batch.angles) for batch in batches] == [2, 1]
    assert [len(batch.results) for batch in batches] == [2, 2]
    assert worst(nested(), [np.array([0.3, 2.0, -1.0])]) < 1e-15


def test_steps_come_after_what_they_need():
    model = mbs.models.direct_dynamics(mbs.load("puma560").assemble())
    graph = graph_of(model)
    computed = {n for n, node in enumerate(graph.nodes) if node.op in (ca.OP_INPUT, ca.OP_CONST)}
    steps = schedule(graph)
    assert sum(isinstance(step, SinCosGroup) for step in steps) == 1
    for step in steps:
        assert computed.issuperset(needs(graph, step))
        assert computed.isdisjoint(gives(step))
        computed.update(gives(step))
    assert computed.issuperset(n for result in graph.results for n in result)


def test_values_that_wait_do_not_meet():
    graph = graph_of(mbs.models.direct_dynamics(mbs.load("puma560").assemble()))
    pieces = blocks(graph, schedule(graph), 50)
    pieces = [piece[k : k + 60] for piece in pieces for k in range(0, len(piece), 60)]
    where = slots(graph, pieces)
    assert len(pieces) > 5
    assert 0 < where.count < len(where.of)
    work: dict[int, int] = {}
    for piece in pieces:
        loaded = {n for step in piece for n in needs(graph, step)}
        inside = {n for step in piece for n in gives(step)}
        for n in (loaded - inside) & where.of.keys():
            assert work[where.of[n]] == n
        work.update({where.of[n]: n for n in inside & where.of.keys()})


def long_function():
    x = ca.SX.sym("x", 40)
    y, z = x, ca.SX(0)
    for k in range(60):
        y = ca.vertcat(y[3:], y[:3]) * ca.DM(np.linspace(0.1, 0.9, 40)) + ca.sin(x[k % 40]) * y
        z = z + y[k % 40] ** 2
    return ca.Function("f", [x], [y, z])


def test_long_functions_are_cut_into_blocks():
    f = long_function()
    text = kernel_source([f])["f.c"]
    assert text.count("NOINLINE void f_part") > 5
    assert worst(f, [np.random.default_rng(0).standard_normal(40)]) < 1e-13


def test_many_angles_are_called_not_repeated():
    x = ca.SX.sym("x", 200)
    f = ca.Function("f", [x], [ca.sin(x) + ca.cos(2 * x)])
    assert kernel_source([f])["f.c"].count("mbs_sincos8_call(") == 400 / LANES
    assert worst(f, [np.linspace(-9, 9, 200)]) < 1e-15


def test_derivatives_of_fast_functions():
    model = mbs.models.inverse_dynamics(mbs.load("puma560").assemble())
    g = compiled(model, fast=True)
    x = ca.MX.sym("x", 6)
    seed = ca.MX.sym("s", 6)
    q, s = np.random.default_rng(0).standard_normal((2, 6))
    for derivative in (
        lambda h: ca.jacobian(h(x, x, x), x) @ seed,
        lambda h: ca.jtimes(h(x, x, x), x, seed),
        lambda h: ca.jtimes(h(x, x, x), x, seed, True),
    ):
        a, b = (ca.Function("d", [x, seed], [derivative(h)])(q, s).full() for h in (model, g))
        assert a == pytest.approx(b, rel=1e-12)


def test_pointers_that_the_caller_leaves_out():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    f = ca.Function("f", [x, y], [x * y + 1, y + x[0] + 3])
    library = ctypes.CDLL(str(kernel_library([f])))
    work, out, two = (ctypes.c_double * 16)(), (ctypes.c_double * 1)(), ctypes.c_double(2.0)
    arg = (ctypes.c_void_p * 2)(None, ctypes.addressof(two))
    res = (ctypes.c_void_p * 2)(None, ctypes.addressof(out))
    assert library.f(arg, res, None, work, 0) == 0
    assert out[0] == 5.0


@pytest.mark.parametrize("flags", ["-O0", "-O1", "-mno-avx", "-mno-fma"])
def test_other_processors(flags, tmp_path):
    """Narrower lanes, and reduction of angles without fused multiplications."""
    if (
        flags.startswith("-m")
        and "x86_64"
        not in subprocess.run(
            [*find_compiler().command, "-dumpmachine"], capture_output=True, text=True
        ).stdout
    ):
        pytest.skip("not an x86 compiler")
    f = angles(False)
    for name, text in kernel_source([f]).items():
        (tmp_path / name).write_text(text)
    library = compile_library(
        [tmp_path / "f.c"], [tmp_path], (*FAST_FLAGS, flags), tmp_path / "kernel.so"
    )
    x = np.linspace(-70, 70, 11)
    assert ca.external("f", str(library))(x).full().ravel() == pytest.approx(np.cos(x), abs=3e-16)


def test_what_has_no_scalar_operations_is_compiled_by_casadi():
    A, b = ca.MX.sym("A", 3, 3), ca.MX.sym("b", 3)
    f = ca.Function("f", [A, b], [ca.solve(A, b, "qr")])
    assert kernel_library([ca.Function("g", [A], [ca.MX(A)])]) is not None
    matrix = np.array([[4.0, 1, 0], [1, 3, 1], [0, 1, 2]])
    assert compiled(f, fast=True, derivatives=0)(np.asfortranarray(matrix), np.ones(3)) == (
        pytest.approx(np.linalg.solve(matrix, np.ones(3)))
    )


def test_names_and_defaults_are_kept():
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    f = ca.Function("f", [x, p], [x * p], ["x", "p"], ["y"], {"default_in": [0.5, -3.0]})
    g = fast(f)
    assert (g.name_in(), g.name_out()) == (["x", "p"], ["y"])
    assert [g.default_in(k) for k in range(2)] == [0.5, -3.0]
    assert g.size_out("y") == (2, 1)


def test_sparse_inputs_and_outputs():
    A = ca.SX.sym("A", ca.Sparsity.lower(3))
    f = ca.Function("f", [A], [A @ A, A.T])
    g = fast(f)
    assert g.sparsity_in(0) == f.sparsity_in(0)
    assert g.sparsity_out(1) == f.sparsity_out(1)
    value = np.tril(np.arange(1.0, 10.0).reshape(3, 3))
    assert g(ca.DM(value))[0].full() == pytest.approx(value @ value)
    assert g(value)[0] == pytest.approx(value @ value)


def test_another_processor_has_another_library(monkeypatch):
    here = kernel_library([nested()])
    assert kernel_library([nested()]) == here
    monkeypatch.setitem(kernel_library.__globals__, "processor", lambda: "another")
    assert kernel_library([nested()]) != here


def test_without_processor_information_the_computer_counts(monkeypatch):
    assert processor()
    monkeypatch.setattr(
        "mbs.native.kernel.Path.read_text", lambda *_: (_ for _ in ()).throw(OSError)
    )
    assert processor.__wrapped__().endswith(f"of {platform.node()}")
