"""Differential-algebraic equations against the constrained equations of motion in plain numpy."""

import casadi
import numpy as np
import pytest
from support.dae_mechanisms import CLOSED, OPEN, four_bar, slider_crank
from support.messages import refused

import mbs
from mbs.errors import LoopError, ModelError, Unclosable
from mbs.loops import closure_jacobian, closure_residual, reduction_matrix
from mbs.models import dae

IMPLICIT = ("index1", "index2", "index3", "ggl")
INDEX = {"index1": 1, "index2": 2, "index3": 3, "ggl": 2}
SYSTEMS = {}


def numbers(value):
    return np.array(value).ravel()


def built(name):
    if name not in SYSTEMS:
        SYSTEMS[name] = {**CLOSED, **OPEN}[name]()
    return SYSTEMS[name]


def state(system, seed=0):
    """A closed configuration beside the assembled one, velocities that keep it closed, efforts."""
    rng = np.random.default_rng(seed)
    if system.is_closed:
        moved = {
            system.velocity_coordinates[k].name: rng.uniform(-0.2, 0.2) for k in system.independent
        }
        names = [c.name for c in system.coordinates]
        there = {
            n: system.configuration[names.index(n)] + x for n, x in moved.items() if n in names
        }
        q = mbs.loops.solve(system, there)
        v = np.array(reduction_matrix(system)(q)) @ rng.uniform(-1, 1, len(system.independent))
    else:
        q = np.array(system.configuration) + rng.uniform(-0.5, 0.5, system.nq)
        for part in quaternions(system):
            q[part] /= np.linalg.norm(q[part])
        v = rng.uniform(-1, 1, system.nv)
    u = rng.uniform(-2, 2, sum(speed.actuated for speed in system.velocity_coordinates))
    return q, v.ravel(), u


def quaternions(system):
    kinds = [c.kind for c in system.coordinates]
    firsts = [k for k, c in enumerate(system.coordinates) if c.name.endswith(".qw")]
    assert 4 * len(firsts) == kinds.count("quaternion")
    return [slice(k, k + 4) for k in firsts]


def reference(system, q, v, u):
    """Accelerations and row efforts from [A -J'; J 0], dJ/dt by differences."""
    A = np.array(mbs.models.inertia_matrix(system, "tree")(q))
    H = numbers(mbs.models.bias(system, "tree")(q, v))
    tau = np.zeros(system.nv)
    tau[[k for k, speed in enumerate(system.velocity_coordinates) if speed.actuated]] = u
    if not system.is_closed:
        return np.linalg.solve(A, tau - H)
    positions = closure_residual(system).numel_out(0)
    kept = [*system.closure.rows, *(positions + k for k in system.closure.slips)]
    rate, h = numbers(system.qdot(q, v)), 1e-6
    J, J_after, J_before = (
        np.array(closure_jacobian(system)(q + s * rate))[kept] for s in (0.0, h, -h)
    )
    K = np.block([[A, -J.T], [J, np.zeros((len(J), len(J)))]])
    return np.linalg.solve(K, np.concatenate([tau - H, -(J_after - J_before) / (2 * h) @ v]))


def algebraic(d, z):
    return np.concatenate([z, np.zeros(d.z.numel() - len(z))])


@pytest.mark.sweep
@pytest.mark.parametrize("form", IMPLICIT)
@pytest.mark.parametrize("name", [*CLOSED, *OPEN])
def test_algebraic_equations_hold_where_the_equations_of_motion_do(name, form):
    system = built(name)
    d = dae(system, form)
    q, v, u = state(system)
    z = reference(system, q, v, u)
    x = np.concatenate([q, v])
    ode, alg, invariants, q_of, v_of = d.function()(x, algebraic(d, z), u, d.p0)
    np.testing.assert_allclose(numbers(alg), 0, atol=2e-7 * max(1, np.abs(z).max()))
    np.testing.assert_allclose(numbers(invariants), 0, atol=1e-11)
    expected = np.concatenate([numbers(system.qdot(q, v)), z[: system.nv]])
    np.testing.assert_allclose(numbers(ode), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(np.concatenate([numbers(q_of), numbers(v_of)]), x)


@pytest.mark.sweep
@pytest.mark.parametrize("name", [*CLOSED, *OPEN])
def test_reduced_equations_give_the_same_motion(name):
    system = built(name)
    d = dae(system)
    q, v, u = state(system)
    a = reference(system, q, v, u)[: system.nv]
    names = [c.name + ".q" for c in system.coordinates] + [
        s.name + ".v" for s in system.velocity_coordinates
    ]
    values = dict(zip(names, [*q, *v], strict=True))
    rates = dict(zip(names, [*numbers(system.qdot(q, v)), *a], strict=True))
    x = [values[element] for element, _ in d.elements["x"]]
    ode, _, invariants, q_of, v_of = d.function()(x, [], u, d.p0)
    expected = [rates[element] for element, _ in d.elements["x"]]
    np.testing.assert_allclose(numbers(ode), expected, atol=2e-7 * max(1, np.abs(a).max()))
    np.testing.assert_allclose(numbers(invariants), 0, atol=1e-11)
    np.testing.assert_allclose(numbers(v_of), v, atol=1e-10)
    turns = [c.unit == "rad" for c in system.coordinates]
    gap = numbers(q_of) - q
    gap[turns] = np.remainder(gap[turns] + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_allclose(gap, 0, atol=1e-10)


@pytest.mark.sweep
@pytest.mark.parametrize("form", IMPLICIT)
@pytest.mark.parametrize("name", CLOSED)
def test_index_is_the_number_of_differentiations_to_a_regular_jacobian(name, form):
    system = built(name)
    d = dae(system, form)
    q, v, u = state(system)
    point = np.concatenate([q, v]), algebraic(d, reference(system, q, v, u)), u, d.p0
    rows, index = [d.alg[k] for k in range(d.alg.numel())], 1
    while np.linalg.cond(jacobian_at(d, rows, point)) > 1e8:
        rows = [
            row if casadi.which_depends(row, d.z, 1, True)[0] else casadi.jtimes(row, d.x, d.ode)
            for row in rows
        ]
        index += 1
        assert index < 4
    assert index == INDEX[form]


def jacobian_at(d, rows, point):
    J = casadi.jacobian(casadi.vertcat(*rows), d.z)
    J = np.array(casadi.Function("J", [d.x, d.z, d.u, d.p], [J])(*point))
    lines = np.abs(J).max(axis=1)
    return J / np.where(lines > 0, lines, 1)[:, None]


@pytest.mark.sweep
@pytest.mark.parametrize("form", ["reduced", *IMPLICIT])
@pytest.mark.parametrize("name", [*CLOSED, *OPEN])
def test_invariants_do_not_change_along_a_motion(name, form):
    system = built(name)
    q, v, _ = state(system, seed=1)
    d = dae(system, form, q0=q, v0=v)
    rate = casadi.jtimes(d.invariants, d.x, d.ode)
    f = casadi.Function("f", [d.x, d.z, d.u, d.p], [d.invariants, rate, d.alg])
    found = f(d.x0, d.z0, d.u0, d.p0)
    scale = max(1, np.abs(d.z0).max(initial=0))
    for value in found:
        np.testing.assert_allclose(numbers(value), 0, atol=1e-11 * scale)


@pytest.mark.sweep
@pytest.mark.parametrize("form", ["reduced", *IMPLICIT])
@pytest.mark.parametrize("name", [*CLOSED, *OPEN])
def test_every_element_has_a_name_of_its_own(name, form):
    d = dae(built(name), form)
    for vector in ("x", "z", "u", "p", "alg", "invariants"):
        names = [element for element, _ in d.elements[vector]]
        assert len(names) == len(set(names)) == getattr(d, vector).numel()
    assert [len(v) for v in (d.x0, d.z0, d.u0, d.p0)] == [s.numel() for s in (d.x, d.z, d.u, d.p)]
    assert d.alg.numel() == d.z.numel()
    assert d.ode.numel() == d.x.numel()


def test_names_and_units_of_a_four_bar():
    d = dae(built("four_bar"), "ggl")
    assert d.elements["z"][2:5] == (
        ("j4.a", "rad/s2"),
        ("lam(j3: force x)", "N"),
        ("lam(j3: force y)", "N"),
    )
    assert d.elements["alg"][-1] == ("der(j3: force y)", "m/s")
    assert [name for name, _ in d.elements["u"]] == ["j1.tau"]
    assert [name for name, _ in d.elements["p"]] == ["L", "k"]
    rolls = dae(built("rolling"), "index3").elements
    assert [unit for _, unit in rolls["alg"][-3:]] == ["m", "m/s", "m/s"]
    assert [name for name, _ in dae(built("sr400")).elements["x"]][:6] == [
        f"q{k}.q" for k in (1, 2, 4, 5, 6, 7)
    ]
    assert dae(built("rssr")).elements["invariants"][-1] == ("s1: unit quaternion", "1")


def test_start_is_that_of_a_simulation():
    system = four_bar()
    given = dict(q0={"j1": 0.3}, v0={"j1": 2.0}, parameters={"L": 1.05})
    d = dae(system, "index2", tau0={"j1": 3.0}, **given)
    first = mbs.simulate.run(system, 0.1, tau={"j1": 3.0}, step=0.1, quiet=True, **given)
    for vector, values in (("x", d.x0), ("z", d.z0[:3]), ("u", d.u0)):
        names = [name for name, _ in d.elements[vector]][: len(values)]
        np.testing.assert_allclose(values, [first[n][0] for n in names], atol=1e-9)
    np.testing.assert_array_equal(d.p0, [1.05, 30.0])


def test_closed_form_takes_the_branch_of_the_start():
    system = slider_crank()
    other = mbs.loops.solve(system, {"j1": 0.4}, guess={"s": -0.5, "j2": 2.8})
    assert np.abs(other - mbs.loops.solve(system, {"j1": 0.4})).max() > 0.5
    d = dae(system, q0=other)
    q = numbers(d.function()(d.x0, [], d.u0, [])[3])
    assert np.abs(np.array(closure_residual(system)(q))).max() < 1e-12
    behind = 0.4 * np.cos(0.4) - np.sqrt(0.9**2 - (0.4 * np.sin(0.4)) ** 2)
    assert q[[c.name for c in system.coordinates].index("s")] == pytest.approx(behind, abs=1e-12)


def test_same_symbols_for_every_start():
    system = built("slider_crank")
    one, two = dae(system, "index1"), dae(system, "index1", q0={"j1": 0.1})
    assert casadi.is_equal(one.x, two.x)
    assert casadi.is_equal(one.ode, two.ode)
    assert not np.array_equal(one.x0, two.x0)


def test_function_takes_mx_and_maps():
    d = dae(built("slider_crank"), "index2")
    x, z, u = (casadi.MX.sym(n, s.numel()) for n, s in (("x", d.x), ("z", d.z), ("u", d.u)))
    f = casadi.Function("f", [x, z, u], d.function()(x, z, u, d.p0)[:2])
    ode, alg = f.map(3)(*(np.tile(v, (3, 1)).T for v in (d.x0, d.z0, d.u0)))
    assert ode.shape == (d.x.numel(), 3)
    assert np.abs(np.array(alg)).max() < 1e-11


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        (dict(form="index4"), ModelError, "form is 'index4'; use one of reduced, index1"),
        (dict(form=["ggl"]), ModelError, "form is ['ggl']; use one of"),
        (dict(q0={"jj": 1.0}), ModelError, "there is no coordinate 'jj'"),
        (dict(q0=[0.1, 0.2, 0.3]), LoopError, "leaves the loops open"),
        (dict(q0={"j1": 0.0, "s": 3.0}), Unclosable, "slider_crank"),
        (dict(v0={"j1": 1.0, "s": 9.0}), ModelError, "the loops allow no motion with"),
        (dict(tau0={"j2": 1.0}), ModelError, "tau0 gives 1 to 'j2', which has no motor"),
        (dict(tau0={"jj": 1.0}), ModelError, "there is no coordinate 'jj'"),
        (dict(parameters={"L": 1.0}), ModelError, "there is no parameter 'L'"),
    ],
)
def test_wrong_arguments_are_refused(given, error, message):
    refused(error, message, by=lambda: dae(built("slider_crank"), **given))


def test_systems_that_cannot_start_are_refused():
    m = mbs.Mechanism("symbolic")
    m.connect(m.world, mbs.components.Revolute("j"), m.add(mbs.components.PointMass("b", mass="M")))
    refused(ModelError, "call assemble() first", by=lambda: dae(m))
    refused(ModelError, "parameter 'M' has no value", by=lambda: dae(m.assemble()))


def test_loops_solved_for_where_passive_angles_need_not_be_counted():
    closed = ["j1.q", "j1.v"]
    assert [name for name, _ in dae(built("slider_crank")).elements["x"]] == closed
    sprung = slider_crank(stiffness=2.0)
    everything = ["j1.q", "j2.q", "s.q", "j1.v"]
    assert [name for name, _ in dae(sprung).elements["x"]] == everything
    assert [name for name, _ in dae(built("rssr")).elements["x"]][-2:] == ["j1.v", "s1.wx.v"]
