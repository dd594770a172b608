"""`compiled` takes the tree core for models of big trees; the equations have what that lacks."""

import copy
import os
import pickle
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
from casadi import MX, Function
from support.driven_trees import driven_tree
from support.random_trees import random_state, random_tree

import mbs
from mbs import Mechanism, models
from mbs.components import Body, Revolute, Spring
from mbs.errors import ModelError
from mbs.models import tree_table
from mbs.native import compiled, compiler_found

pytestmark = pytest.mark.skipif(not compiler_found(), reason="there is no compiler")

BUILDERS = {
    "idm": models.inverse_dynamics,
    "ddm": models.direct_dynamics,
    "inertia": models.inertia_matrix,
    "idm_derivatives": models.inverse_dynamics_derivatives,
    "ddm_derivatives": models.direct_dynamics_derivatives,
}
# Rounding of a few hundred operations, some divided by inertias that differ.
TOLERANCE = 1e-12


def chain(n):
    kinds = ("revolute", "revolute", "prismatic")
    return random_tree(2, n=n, kinds=kinds, serial=True).mechanism.assemble()


def parametric():
    """Lengths, masses and friction as symbols, one of them bounded, in two branches."""
    p = {"g": 9.81, "L": 0.4, "m": 1.3, "fs": 0.3}
    m = Mechanism("parametric", gravity=(1, 0, "-g"), parameters=p)
    bodies = [
        m.add(Body(name, mass=mass, com=("L/2", 0.1, 0), inertia=(0.1, 0.2, 0.15)))
        for name, mass in (("a", "m"), ("b", "2*m"), ("c", 0.7))
    ]
    m.connect(m.world, Revolute("j1", axis=(0.6, 0.8, 0), Fs="fs", Fs_width=0.1), bodies[0])
    m.connect(bodies[0].at("L", 0, 0.2), Revolute("j2", axis="y", Fv=0.3), bodies[1])
    m.connect(bodies[0].at(0, "L", 0.1), Revolute("j3", axis="x", Ia=0.1), bodies[2])
    return m.assemble()


def driven():
    return driven_tree(1, n=5, kinds=("revolute", "prismatic")).assemble()


TREES = {"chain": lambda: chain(6), "driven": driven}
TREES |= {"parametric": parametric}


@pytest.fixture
def always(monkeypatch):
    """Loops are taken for trees of any size."""
    monkeypatch.setattr(tree_table, "_LONGEST", dict.fromkeys(BUILDERS, 0))


@pytest.fixture
def jacobians_alone(monkeypatch):
    """Loops are taken for Jacobians of trees of any size, not for the models themselves."""
    monkeypatch.setattr(tree_table, "_LONGEST", {})
    monkeypatch.setattr(tree_table, "_LONGEST_OF_JACOBIAN", {"idm": 0, "ddm": 0})


def close(ours, theirs, tolerance=TOLERANCE):
    ours, theirs = (np.squeeze(np.array(x, dtype=float)) for x in (ours, theirs))
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max(initial=0) <= tolerance * max(np.abs(theirs).max(), 1e-3)


def arguments(system, name, seed=0):
    """A state, and parameters off their defaults."""
    rng = np.random.default_rng(seed)
    state = random_state(system, rng)[: 1 if name == "inertia" else 3]
    if not system.parameters:
        return list(state)
    return [*state, np.array(system.p_default) * rng.uniform(0.8, 1.2, len(system.parameters))]


def taken(function, derivatives=0):
    """Whether the model itself, and its Jacobian, are computed by loops."""
    code = function.loops.code(function, derivatives)
    return None if code is None else (code.value, code.jacobian)


def test_loops_are_taken_where_they_are_faster():
    small, middle, big = chain(6), chain(15), chain(32)
    for build in BUILDERS.values():
        assert taken(build(small), 1) is None
    for build in (models.inverse_dynamics, models.direct_dynamics):
        assert taken(build(middle)) is None
        assert taken(build(middle), 1) == taken(build(middle), 2) == (False, True)
    assert taken(models.inverse_dynamics_derivatives(middle)) == (True, False)
    assert taken(models.direct_dynamics_derivatives(middle)) is None
    assert taken(models.inertia_matrix(middle)) is None
    assert taken(models.inertia_matrix(big)) == (True, False)
    assert taken(models.direct_dynamics_derivatives(big)) == (True, False)


def test_many_operations_are_never_written_out(monkeypatch):
    system = chain(6)
    monkeypatch.setattr(tree_table, "_MANY", 100)
    for build in BUILDERS.values():
        assert taken(build(system))[0]


def test_branches_count_by_themselves():
    """Many short arms, whose runs do not fill the lanes of the core."""
    m = Mechanism("hedgehog", gravity=(0, 0, -9.81))
    for k in range(20):
        before = m.world.at(0.1 * k, 0, 0)
        for h in range(2):
            body = m.add(Body(f"b{k}{h}", mass=1, com=(0.1, 0, 0), inertia=(0.1, 0.1, 0.1)))
            m.connect(before, Revolute(f"j{k}_{h}", axis="zy"[h]), body)
            before = body.at(0.2, 0, 0)
    assert taken(models.inertia_matrix(m.assemble())) is None


@pytest.mark.usefixtures("always")
def test_what_the_core_does_not_know_stays_as_it_is():
    closed = mbs.load("four_bar").assemble()
    free = random_tree(1, n=4, kinds=("spherical", "revolute")).mechanism.assemble()
    m = Mechanism("sprung")
    body = m.add(Body("b", mass=1, com=(0.1, 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j"), body)
    m.add(Spring("s", m.world.at(0, 1), body.at(0.5, 0, 0), stiffness=10, length=0.2))
    for system in (closed, free, m.assemble()):
        for build in BUILDERS.values():
            assert taken(build(system), 1) is None
    system = chain(4)
    for build in (models.inverse_dynamics, models.direct_dynamics):
        for options in ({"f_ext": True}, {"moving_base": True}):
            assert build(system, **options).loops is None
    assert models.direct_dynamics(system).map(2).loops is None


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("tree", TREES)
@pytest.mark.parametrize("name", BUILDERS)
def test_values_names_and_checks_are_those_of_the_equations(tree, name):
    system = TREES[tree]()
    model = BUILDERS[name](system)
    assert taken(model) is not None
    f = compiled(model, fast=True, derivatives=0)
    lines = compiled(model, fast=True, derivatives=0, loops=False)
    assert (f.name_in(), f.name_out()) == (model.name_in(), model.name_out())
    assert [f.size_in(k) for k in range(f.n_in())] == [
        model.size_in(k) for k in range(model.n_in())
    ]
    x = arguments(system, name)
    for ours, theirs, written in zip(*(as_tuple(g(*x)) for g in (f, model, lines)), strict=True):
        close(ours, theirs)
        close(written, theirs)
    if system.parameters:
        close(as_tuple(f(*x[:-1]))[0], as_tuple(model(*x[:-1]))[0])  # at their defaults
    for wrong in (np.full(system.nq, np.nan), np.zeros(system.nq + 1)):
        with pytest.raises(ModelError):
            f(wrong, *x[1:])
    other = pickle.loads(pickle.dumps(f))
    assert pickle.loads(pickle.dumps(model)).loops.name == name
    for again in (other, copy.deepcopy(f)):
        close(as_tuple(again(*x))[0], as_tuple(f(*x))[0], 0)


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("derivatives", [1, 2])
@pytest.mark.parametrize("tree", TREES)
@pytest.mark.parametrize("name", ["idm", "ddm", "inertia", "idm_derivatives"])
def test_first_derivatives_are_those_of_the_equations(tree, name, derivatives):
    compare_first_derivatives(TREES[tree](), name, derivatives)


@pytest.mark.usefixtures("jacobians_alone")
@pytest.mark.parametrize("derivatives", [1, 2])
@pytest.mark.parametrize("tree", TREES)
@pytest.mark.parametrize("name", ["idm", "ddm"])
def test_jacobians_by_loops_beside_straight_lines(tree, name, derivatives):
    system = TREES[tree]()
    assert taken(BUILDERS[name](system), derivatives) == (False, True)
    compare_first_derivatives(system, name, derivatives)


def compare_first_derivatives(system, name, derivatives):
    """Jacobians, products in both directions, in graphs and as Functions; by parameters too."""
    model = BUILDERS[name](system)
    f = compiled(model, fast=True, derivatives=derivatives)
    x = arguments(system, name)
    zeros = [ca.DM(*model.size_out(k)) for k in range(model.n_out())]
    for ours, theirs in zip(*(as_tuple(g.jacobian()(*x, *zeros)) for g in (f, model)), strict=True):
        close(ours, theirs)
    rng = np.random.default_rng(1)
    seeds = [rng.standard_normal((model.numel_in(k), 2)) for k in range(model.n_in())]
    forward = [as_tuple(g.forward(2)(*x, *g.call(list(map(ca.DM, x))), *seeds)) for g in (f, model)]
    wide = [rng.standard_normal((z.shape[0], 2 * z.shape[1])) for z in zeros]
    reverse = [as_tuple(g.reverse(2)(*x, *g.call(list(map(ca.DM, x))), *wide)) for g in (f, model)]
    for pair in (forward, reverse):
        for ours, theirs in zip(*pair, strict=True):
            close(ours, theirs)
    # in a graph, where CasADi chooses the way
    symbols = [MX.sym(f"s{k}", model.size_in(k)) for k in range(model.n_in())]
    for symbol in symbols:
        both = (Function("J", symbols, [slope_of(g, symbols, symbol)]) for g in (f, model))
        close(*(J(*x) for J in both))


@pytest.mark.parametrize("way", ["always", "jacobians_alone"])
@pytest.mark.parametrize("seed", [1, 3])
def test_quaternions_are_loops_where_the_equations_normalise_them(seed, way, request):
    request.getfixturevalue(way)
    system = driven_tree(seed, n=4, backward=("revolute", "prismatic")).assemble()
    model = models.with_implicit_jacobian(system, models.direct_dynamics(system))
    assert taken(model, 1) == (way == "always", True)
    assert taken(models.direct_dynamics(system), 1) is None
    f = compiled(model, fast=True)
    q, v, tau = random_state(system, np.random.default_rng(seed))
    close(f(q, v, tau), model(q, v, tau))
    x = [MX.sym(f"s{k}", model.size_in(k)) for k in range(3)]
    for part in range(3):
        both = [Function("J", x, [ca.jacobian(g(*x), x[part])]) for g in (f, model)]
        for scale in (1.0, 1.3):  # off unit length too
            close(*(J(scale * q, v, tau) for J in both))


def as_tuple(value):
    return value if isinstance(value, tuple) else (value,)


def slope_of(function, symbols, symbol):
    first = function.call([ca.sin(s) for s in symbols])[0]
    return ca.jacobian(ca.vec(first), symbol)


@pytest.mark.parametrize("way", ["always", "jacobians_alone"])
@pytest.mark.parametrize("name", ["idm", "ddm"])
def test_second_derivatives_are_those_of_the_equations(name, way, request):
    request.getfixturevalue(way)
    system = parametric()
    model = BUILDERS[name](system)
    f = compiled(model, fast=True, derivatives=2)
    x = arguments(system, name)
    symbols = [MX.sym(f"s{k}", model.size_in(k)) for k in range(model.n_in())]
    every = ca.vertcat(*symbols)
    both = [
        Function("H", symbols, [ca.hessian(ca.sumsqr(g.call(symbols)[0]), every)[0]])(*x)
        for g in (f, model)
    ]
    close(*both)


@pytest.mark.usefixtures("always")
def test_second_derivatives_must_be_asked_for():
    system = parametric()
    f = compiled(models.inverse_dynamics(system), fast=True)
    symbols = [MX.sym(f"s{k}", f.size_in(k)) for k in range(f.n_in())]
    with pytest.raises((RuntimeError, ModelError), match="cannot be calculated"):
        ca.hessian(ca.sumsqr(f.call(symbols)[0]), symbols[0])


PROGRAM = """
import sys, casadi as ca
g = ca.Function.load(sys.argv[1])
print(*g([0.1, 0.2, 0.3], 1.1).full().ravel().tolist())
"""


@pytest.mark.usefixtures("always")
def test_a_graph_finds_derivatives_by_parameters_in_another_process(tmp_path, monkeypatch):
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path / "cache"))
    system = parametric()
    q, factor = MX.sym("q", 3), MX.sym("factor")
    graphs = []
    for f in (compiled(models.direct_dynamics(system), fast=True), models.direct_dynamics(system)):
        a = f(q, q, q, factor * ca.DM(system.p_default))
        graphs.append(Function("g", [q, factor], [ca.jacobian(a, factor)]))
    file = tmp_path / "g.casadi"
    graphs[0].save(str(file))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    answer = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(file)], env=environment, capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    close([float(x) for x in answer.stdout.split()], graphs[1]([0.1, 0.2, 0.3], 1.1))


@pytest.mark.usefixtures("always")
def test_derivatives_by_parameters_whose_record_has_gone_are_an_error(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path / "cache"))
    system = parametric()
    f = compiled(models.inverse_dynamics(system), fast=True)
    (record,) = (tmp_path / "cache").glob("*.function")
    record.unlink()
    with pytest.raises(RuntimeError):
        Function(f.jacobian())(*arguments(system, "idm"), 0)
    assert "has gone or is damaged" in capfd.readouterr().err


def test_the_jacobian_of_a_long_chain_compiles_a_table_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path / "cache"))
    system = chain(24)
    f = compiled(models.direct_dynamics(system), fast=True)
    written = [path.name for path in (tmp_path / "cache").glob("*.library")]
    assert not list((tmp_path / "cache").glob("*.o"))
    J = f.jacobian()
    assert list((tmp_path / "cache").glob("*.o"))  # the core
    x = arguments(system, "ddm")
    slopes = as_tuple(J(*x, 0))
    assert [path.name for path in (tmp_path / "cache").glob("*.library")] == written
    exact = models.direct_dynamics_derivatives(system)(*x)
    for ours, theirs in zip(slopes, exact, strict=False):
        close(ours, theirs)
