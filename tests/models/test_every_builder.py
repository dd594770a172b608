"""Every model is a Function like any other: on symbols, mapped, expanded, as C, built once."""

import casadi
import numpy as np
import pytest
from support.dae_mechanisms import CLOSED, OPEN

import mbs
import mbs.models
from mbs.native import compiled
from mbs.native.compiled import generated, unwritten

SYSTEMS = {**{n: OPEN[n] for n in OPEN}, **{n: CLOSED[n] for n in ("four_bar", "rssr", "rolling")}}
BUILT = {}

BUILDERS = {
    "inverse_dynamics": mbs.models.inverse_dynamics,
    "inverse_dynamics, tree": lambda s: mbs.models.inverse_dynamics(s, "tree"),
    "wrenches": lambda s: mbs.models.inverse_dynamics(s, f_ext=True, moving_base=True),
    "bias": mbs.models.bias,
    "gravity_effort": mbs.models.gravity_effort,
    "inertia_matrix": mbs.models.inertia_matrix,
    "direct_dynamics": mbs.models.direct_dynamics,
    "direct_dynamics, tree": lambda s: mbs.models.direct_dynamics(s, coordinates="tree"),
    "inverse_dynamics_derivatives": mbs.models.inverse_dynamics_derivatives,
    "direct_dynamics_derivatives": mbs.models.direct_dynamics_derivatives,
    "energy": mbs.models.energy,
    "lagrange": mbs.models.lagrange,
    "transform": lambda s: mbs.models.transform(s, len(s.links)),
    "jacobian": lambda s: mbs.models.jacobian(s, len(s.links)),
    "jacobian_dot_velocity": lambda s: mbs.models.jacobian_dot_velocity(s, len(s.links)),
    "link_velocities": mbs.models.link_velocities,
    "link_accelerations": mbs.models.link_accelerations,
    "joint_wrenches": mbs.models.joint_wrenches,
    "phase": lambda s: phases(s).accelerations("tip"),
    "phase_residuals": lambda s: phases(s).residuals("tip"),
    "touchdown": lambda s: phases(s).impact({"tip": "sliding"}),
    "points": lambda s: phases(s).motion(),
}


def phases(system):
    return mbs.models.contact_phases(system, [mbs.models.ContactPoint("tip", len(system.links))])


def built(name):
    if name not in BUILT:
        BUILT[name] = SYSTEMS[name]()
    return BUILT[name]


def point(system, f):
    """Arguments at which the model is finite: a closed posture, small numbers elsewhere."""
    rng = np.random.default_rng(7)
    values = {name: rng.uniform(-1, 1, f.size_in(name)) for name in f.name_in()}
    values["q"] = np.array(system.posture).reshape(-1, 1)
    if "p" in values:
        values["p"] = np.array(system.p_default).reshape(-1, 1)
    if "R_0" in values:
        values["R_0"] = np.eye(3)
    return [values[name] for name in f.name_in()]


def numbers(results):
    every = results if isinstance(results, (tuple, list)) else (results,)
    return [np.array(casadi.DM(result)) for result in every]


def same(found, expected, tolerance=1e-12):
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * max(1, np.abs(b).max(initial=0)))


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("name", SYSTEMS)
def test_symbols_maps_expansion_and_c(name, builder):
    system = built(name)
    f = BUILDERS[builder](system)
    assert BUILDERS[builder](system) is f
    at = point(system, f)
    expected = numbers(f(*at))
    assert all(np.isfinite(value).all() for value in expected)
    for kind in (casadi.SX, casadi.MX):
        symbols = [kind.sym(n, *f.size_in(n)) for n in f.name_in()]
        again = casadi.Function("again", symbols, f.call(symbols))
        same(numbers(again.call(at)), expected)
    same(numbers(f.expand().call(at)), expected)
    twice = f.map(2).call([np.hstack([x, x]) for x in at])
    for value, one in zip(numbers(twice), expected, strict=True):
        same([value], [np.hstack([one, one])])
    assert unwritten(generated([casadi.Function(f)])) == ""


@pytest.mark.parametrize("name", ["floating", "four_bar"])
def test_machine_code_with_two_derivatives(name):
    """First and second derivatives of a compiled model are those of the interpreted one."""
    system = built(name)
    f = mbs.models.energy(system)
    at = point(system, f)
    k = f.name_in().index("q")
    x = casadi.MX.sym("q", f.size1_in(k))
    values = []
    for model in (f, compiled(f, derivatives=2)):
        total = casadi.sum1(casadi.vertcat(*model(*at[:k], x, *at[k + 1 :])))
        second = casadi.hessian(total, x)
        values.append(numbers(casadi.Function("d", [x], [total, *second])(at[k])))
    same(values[1], values[0], 1e-13)


def test_casadi_compiles_it_itself():
    f = mbs.models.inverse_dynamics(mbs.load("planar_2r").assemble())
    x = [casadi.MX.sym(n, *f.size_in(n)) for n in f.name_in()]
    options = {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O1"]}}
    g = casadi.Function("g", x, f.call(x), options)
    at = [[0.3, -0.4], [1.0, 2.0], [0.5, 0.1]]
    same(numbers(g(*at)), numbers(f(*at)))


@pytest.mark.parametrize("name", ["four_bar", "sr400"])
def test_closed_forms_differentiate_twice(name):
    """q(q_a) on a branch: first and second derivatives in an MX graph against differences."""
    system = CLOSED[name]()
    loops = mbs.loops.function(system)
    q_a = np.array(system.posture)[list(system.active)]
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
    from mbs.loops.numeric import follow_active

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
