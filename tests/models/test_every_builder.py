"""Every model is a Function like any other: on symbols, mapped, expanded, as C, built once."""

import shutil

import casadi
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.builders import (
    AGAIN,
    ALONE,
    BUILDERS,
    CLOSED_ALONE,
    OPEN_ALONE,
    PAIRS,
    SYSTEMS,
    built,
    numbers,
    point,
    public_builders,
    same,
    system_of,
)
from support.dae_mechanisms import CLOSED
from support.random_trees import ALL_KINDS, random_tree

import mbs
import mbs.models
from mbs.native import compile_library, compiled, compiler_found
from mbs.native._compiled import generated, unwritten

COMPILER = pytest.mark.skipif(not compiler_found(), reason="there is no compiler")


def test_every_public_builder_is_here():
    everywhere = (BUILDERS, CLOSED_ALONE, OPEN_ALONE, *ALONE.values())
    known = {name.split(",")[0] for table in everywhere for name in table}
    assert public_builders() <= known


def on_symbols(f, at, expected):
    """The same values on SX and MX, expanded, and for two columns at once."""
    for kind in (casadi.SX, casadi.MX):
        symbols = [kind.sym(n, *f.size_in(n)) for n in f.name_in()]
        again = casadi.Function("again", symbols, f.call(symbols))
        same(numbers(again.call(at)), expected)
    same(numbers(f.expand().call(at)), expected)
    twice = f.map(2).call([np.hstack([x, x]) for x in at])
    for value, one in zip(numbers(twice), expected, strict=True):
        same([value], [np.hstack([one, one])])


@pytest.mark.sweep
@pytest.mark.parametrize(("name", "builder"), PAIRS)
def test_symbols_maps_and_expansion(name, builder):
    f = built(name, builder)
    assert builder in AGAIN or built(name, builder) is f
    at = point(system_of(name), f)
    expected = numbers(f(*at))
    assert all(np.isfinite(value).all() for value in expected)
    on_symbols(f, at, expected)


@pytest.mark.sweep
@COMPILER
@pytest.mark.parametrize("name", SYSTEMS)
def test_the_c_code_of_all_models(name, tmp_path):
    """One file of C with every model of a system gives the same values."""
    models = [built(name, builder) for where, builder in PAIRS if where == name]
    written = [casadi.Function.expand(f, f"m{k}") for k, f in enumerate(models)]
    source = generated(written)
    assert unwritten(source) == ""
    (tmp_path / "models.c").write_text(source)
    flags = ("-O0", "-ffp-contract=off", "-fPIC", "-shared")
    output = tmp_path / "models.so"
    library = compile_library([tmp_path / "models.c"], [tmp_path], flags, output)
    for k, f in enumerate(models):
        at = point(system_of(name), f)
        code = casadi.external(f"m{k}", str(library))
        same(numbers(code.call(at)), numbers(f(*at)), 1e-13)


@settings(max_examples=2, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 10**6), st.integers(1, 2), st.booleans())
def test_models_of_any_tree(seed, size, aligned):
    """What holds for the systems by name holds for trees that were not chosen."""
    system = random_tree(seed, n=size, kinds=ALL_KINDS, aligned=aligned).mechanism.assemble()
    for build in BUILDERS.values():
        f = build(system)
        at = point(system, f, seed)
        expected = numbers(f(*at))
        assert all(np.isfinite(value).all() for value in expected)
        on_symbols(f, at, expected)


def with_hessian(model, at, k):
    """The sum of the outputs, its gradient and its Hessian by input k."""
    x = casadi.MX.sym("x", model.size1_in(k))
    every = model.call([*map(casadi.MX, map(casadi.DM, at[:k])), x, *at[k + 1 :]])
    total = casadi.sum1(casadi.vertcat(*map(casadi.vec, every)))
    return numbers(casadi.Function("d", [x], [total, *casadi.hessian(total, x)])(at[k]))


@COMPILER
@pytest.mark.parametrize(
    ("name", "builder"),
    [
        ("floating", "energy"),
        ("four_bar", "energy"),
        ("loop", "inverse_dynamics"),
        ("driven", "transform"),
        ("rolling", "closure_residual"),
    ],
)
def test_machine_code_with_two_derivatives(name, builder):
    """First and second derivatives of a compiled model are those of the interpreted one."""
    f = built(name, builder)
    at, k = point(system_of(name), f), f.name_in().index("q")
    same(with_hessian(compiled(f, derivatives=2), at, k), with_hessian(f, at, k), 1e-12)


@COMPILER
@pytest.mark.parametrize(
    ("name", "builder"),
    [
        ("loop", "direct_dynamics"),
        ("rx90", "inverse_dynamics"),
        ("loop", "phase"),
        *[
            ("four_bar", "function"),
            ("floating", "dae, ggl"),
        ],
    ],
)
def test_machine_code_with_one_derivative(name, builder):
    f = built(name, builder)
    at = point(system_of(name), f)
    code = compiled(f, derivatives=1)
    results = []
    for model in (f, code):
        inputs = [casadi.MX.sym(n, *f.size_in(n)) for n in f.name_in()]
        slope = casadi.jacobian(casadi.vertcat(*map(casadi.vec, model.call(inputs))), inputs[0])
        results.append(numbers(casadi.Function("J", inputs, [casadi.densify(slope)])(*at)))
    same(*results, 1e-12)


@pytest.mark.skipif(not shutil.which("gcc"), reason="CasADi calls gcc")
@pytest.mark.parametrize(
    ("name", "builder"),
    [("loop", "inverse_dynamics"), ("four_bar", "energy"), ("floating", "link_velocities")],
)
def test_casadi_compiles_it_itself(name, builder):
    f = built(name, builder)
    x = [casadi.MX.sym(n, *f.size_in(n)) for n in f.name_in()]
    options = {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O1"]}}
    g = casadi.Function("g", x, f.call(x), options)
    at = point(system_of(name), f)
    same(numbers(g(*at)), numbers(f(*at)))


@pytest.mark.parametrize("name", ["four_bar", "sr400"])
def test_closed_forms_differentiate_twice(name):
    """q(q_a) on a branch: first and second derivatives in an MX graph against differences."""
    system = CLOSED[name]()
    loops = mbs.loops.function(system)
    q_a = np.array(system.configuration)[list(system.independent)]
    q_a = q_a + np.linspace(0.1, 0.3, len(q_a))  # away from half a turn
    y = np.random.default_rng(0).uniform(-1, 1, system.nq)
    x = casadi.MX.sym("q_a", len(q_a))
    total = casadi.dot(y, loops(x))
    slope = casadi.Function("slope", [x], [casadi.gradient(total, x)])
    curvature = casadi.Function("curvature", [x], [casadi.hessian(total, x)[0]])
    h = 1e-5
    value = casadi.Function("value", [x], [total])
    steps = h * np.eye(len(q_a))
    first = [float(value(q_a + e) - value(q_a - e)) / (2 * h) for e in steps]
    second = [np.array(slope(q_a + e) - slope(q_a - e)).ravel() / (2 * h) for e in steps]
    same([np.array(slope(q_a)).ravel()], [np.array(first)], 1e-8)
    same([np.array(curvature(q_a))], [np.array(second)], 1e-8)


def test_loops_solved_by_iteration_differentiate_by_the_implicit_function_theorem():
    """Newton's method is one node: its derivatives are those of the equations, twice."""
    from mbs.loops._function import follow_active

    system = CLOSED["slider_crank"]()
    follow = follow_active(system)
    x = casadi.MX.sym("q_a", 1)
    y = np.random.default_rng(0).uniform(-1, 1, system.nq)
    value, exact = (
        casadi.dot(y, f(*arguments))
        for f, arguments in ((follow, (x, casadi.DM(0, 1))), (mbs.loops.function(system), (x,)))
    )
    results = [
        casadi.Function("d", [x], [v, casadi.gradient(v, x), casadi.hessian(v, x)[0]])(0.7)
        for v in (value, exact)
    ]
    same(numbers(results[0]), numbers(results[1]), 1e-8)
