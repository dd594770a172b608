"""The tree core against the models as equations, and against itself where trees are big."""

import copy
import functools
import pickle
import sys

import casadi
import numpy as np
import pytest
from casadi import MX, Function
from support.driven_trees import driven_tree
from support.random_trees import ALL_KINDS, random_state, random_tree

import mbs
from mbs import Mechanism, models
from mbs.components import (
    Body,
    Box,
    Free,
    Prismatic,
    Revolute,
    Spherical,
    Spring,
)
from mbs.errors import ModelError
from mbs.models import tree_core


def rubbing():
    """Coulomb friction, smooth and as a step, springs, rotors, angles and lengths as symbols."""
    p = {"g": 9.81, "L": 0.4, "m": 1.3, "fv": 0.2, "fs": 0.3, "w": 0.1, "th": 0.3, "k": 20.0}
    m = Mechanism("rubbing", gravity=(1, 0, "-g"), parameters=p)
    a = m.add(Body("a", mass="m", com=("L/2", 0.1, 0), inertia=(0.1, 0.2, 0.15)))
    b = m.add(Body("b", mass="2*m", com=(0.1, 0.1, "L"), inertia=(0.1, 0.2, 0.15)))
    c = m.add(Body("c", mass=0.7, com=(0.1, 0, 0), inertia=(0.01, 0.02, 0.015)))
    spring = dict(stiffness="k", rest=0.2)
    rotor = mbs.components.Rotor(inertia=0.01, ratio=-8, axis=(0.6, 0, 0.8))
    base = m.world.at(0, 0, "L", rotation=("x", "th"))
    first = Revolute("j1", axis=(0.6, 0.8, 0), Fv="fv", Fs="fs", Fs_width="w", rotor=rotor)
    m.connect(base, first, a)
    m.connect(a.at("L", 0, 0.2), Spherical("s", Fs=0.2, Fs_width=0.05, Fv=0.3, Ia=0.1), b)
    m.connect(b.at(0, 0.1, 0.2), Prismatic("p", axis=(1, 1, 0), Fs=0.4, Fs_width=0, **spring), c)
    return m.assemble()


def unordered():
    """Two branches whose links take turns in the numbering, as a table may have them."""
    rng = np.random.default_rng(3)
    frames, bodies = [], []
    for j, antecedent in enumerate((0, 0, 1, 2, 1, 2, 3, 5, 0)):
        alpha, d, theta, r = map(float, rng.uniform(-1, 1, 4))
        kind = "prismatic" if j % 4 == 3 else "revolute"
        placed = dict(alpha=alpha, d=d, theta=theta, r=r)
        frames.append({"antecedent": antecedent, "joint": kind, **placed})
        body = dict(XX=0.3, YY=0.4, ZZ=0.5, XY=0.02, MX=0.1, MY=0.2, MZ=-0.1, M=1.0 + j, Ia=0.1)
        bodies.append({"frame": j + 1, **body})
    table = {"name": "unordered", "gravity": [0, 1, -9.81], "frame": frames, "body": bodies}
    return mbs.load(table).assemble()


def floating():
    """A free body with rotor inertia, an arm on it from which another body moves freely, and
    a body of its own."""
    m = Mechanism("floating", gravity=(0, 0, -9.81))
    bodies = [
        m.add(Body(n, mass=1.5, com=(0.1, 0.2, 0.3), inertia=(0.2, 0.25, 0.3))) for n in "abcd"
    ]
    m.connect(m.world.at(0.3, 0.1, 0.2), Free("base", Ia=0.3, Fv=0.1), bodies[0])
    m.connect(bodies[0].at(0.2, 0, 0.1), Revolute("j", axis=(1, 2, 3)), bodies[1])
    m.connect(bodies[1].at(0.1, 0.3, 0), Free("inner", Ia=0.2), bodies[3])
    m.connect(m.world, Free("other"), bodies[2])
    return m.assemble()


ONE_AXIS = ("revolute", "prismatic")
"""Kinds of joints that the core knows when they connect their frame_b to the side of the base."""


def kinds_of(seed):
    return random_tree(seed, n=6, kinds=ALL_KINDS).mechanism.assemble()


TREES = {
    **{f"tree{k}": functools.partial(kinds_of, k) for k in range(4)},
    **{
        f"driven{k}": lambda k=k: driven_tree(k, n=5, backward=ONE_AXIS).assemble()
        for k in (1, 2, 3, 11)
    },
    "rubbing": rubbing,
    "unordered": unordered,
    "floating": floating,
    "one": lambda: random_tree(2, n=1, kinds=("prismatic",)).mechanism.assemble(),
}


def close(ours, theirs, tolerance=1e-12):
    """Equal, compared with the largest element."""
    ours, theirs = (np.squeeze(np.array(x, dtype=float)) for x in (ours, theirs))
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max() <= tolerance * max(np.abs(theirs).max(), 1e-3)


def values_of_parameters(system, rng):
    if not system.parameters:
        return []
    return [np.array(system.p_default) * rng.uniform(0.7, 1.4, len(system.parameters))]


# Rounding of a few hundred operations; the direct models also divide by inertias that differ.
TOLERANCE, TOLERANCE_OF_SOLUTIONS = 1e-13, 1e-12


@pytest.mark.parametrize("name", TREES)
def test_models_are_those_of_the_equations(name):
    system = TREES[name]()
    core, rng = tree_core(system), np.random.default_rng(1)
    for _ in range(2):
        q, v, a = random_state(system, rng)
        p = values_of_parameters(system, rng)
        tau = np.array(models.inverse_dynamics(system)(q, v, a, *p)).ravel()
        close(core.idm(q, v, a, *p), tau, TOLERANCE)
        close(core.inertia_matrix(q, *p), models.inertia_matrix(system)(q, *p), TOLERANCE)
        close(core.ddm(q, v, tau, *p), a, TOLERANCE_OF_SOLUTIONS)
        slopes = models.inverse_dynamics_derivatives(system, "ad")(q, v, a, *p)
        for ours, theirs in zip(core.idm_derivatives(q, v, a, *p), slopes, strict=True):
            close(ours, theirs, TOLERANCE)
        slopes = models.direct_dynamics_derivatives(system, "ad")(q, v, tau, *p)
        for ours, theirs in zip(core.ddm_derivatives(q, v, tau, *p), slopes, strict=True):
            close(ours, theirs, TOLERANCE_OF_SOLUTIONS)


@pytest.mark.parametrize("name", ["tree0", "driven3", "unordered", "floating"])
def test_inertia_matrix_is_symmetric_to_the_last_bit(name):
    system = TREES[name]()
    q, v, a = random_state(system, np.random.default_rng(2))
    core = tree_core(system)
    for matrix in (core.inertia_matrix(q), core.idm_derivatives(q, v, a)[2]):
        assert np.array_equal(matrix, matrix.T)


def big_tree(n=70):
    """Revolute joints in branches of any length, a free base, a spherical and prismatic joints."""
    kinds = ("revolute",) * 6 + ("prismatic", "spherical")
    mechanism = random_tree(8, n=n, kinds=kinds).mechanism
    base = mechanism.add(Body("trunk", mass=5.0, com=(0.1, 0, 0), inertia=(0.3, 0.4, 0.5)))
    arm = mechanism.add(Body("arm", mass=1.0, com=(0, 0.3, 0), inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(mechanism.world, Free("free"), base)
    mechanism.connect(base.at(0.1, 0.2, 0.3), Revolute("shoulder", axis="y"), arm)
    return mechanism.assemble()


def positions_after(system, q, w, h):
    """Where the velocities w lead in the time h: a step of Runge and Kutta's fourth order."""

    def rate(x):
        return np.array(system.qdot(x, w)).ravel()

    a = rate(q)
    b = rate(q + h / 2 * a)
    c = rate(q + h / 2 * b)
    return q + h / 6 * (a + 2 * b + 2 * c + rate(q + h * c))


def test_big_trees_agree_with_themselves():
    system = big_tree()
    core, rng = tree_core(system), np.random.default_rng(4)
    q, v, a = random_state(system, rng)
    tau = core.idm(q, v, a)
    A = core.inertia_matrix(q)
    close(core.idm(q, v, 0 * a) + A @ a, tau)
    # the solution's error in efforts, not in accelerations, is what rounding bounds
    close(core.idm(q, v, core.ddm(q, v, tau)), tau)
    dq, dv, da, same = core.idm_derivatives(q, v, a)
    close(da, A)
    close(same, tau)
    x_q, x_v, x_tau, back = core.ddm_derivatives(q, v, tau)
    slopes = core.idm_derivatives(q, v, back)
    for x, slope in ((x_q, slopes[0]), (x_v, slopes[1]), (x_tau, -np.eye(system.nv))):
        scale = np.abs(A).max() * np.abs(x).max() + np.abs(slope).max()
        assert np.abs(A @ x + slope).max() < 1e-13 * scale
    # differences: with steps of 1e-5 their error is 1e-10, rounding 1e-11 of the efforts
    w, h = rng.standard_normal(system.nv), 1e-5
    ahead, behind = (core.idm(positions_after(system, q, w, s), v, a) for s in (h, -h))
    close(dq @ w, (ahead - behind) / (2 * h), 1e-8)
    close(dv @ w, (core.idm(q, v + h * w, a) - core.idm(q, v - h * w, a)) / (2 * h), 1e-8)


def test_far_from_the_base_no_digit_is_lost():
    system = floating()
    core, rng = tree_core(system), np.random.default_rng(5)
    q, v, a = random_state(system, rng)
    far = q.copy()
    far[:3] += [1e7, -2e7, 3e6]
    tau = core.idm(q, v, a)
    close(core.idm(far, v, a), tau, 1e-15)
    for model, last in (("idm_derivatives", a), ("ddm_derivatives", tau)):
        both = (getattr(core, model)(place, v, last) for place in (q, far))
        for near, there in zip(*both, strict=True):
            close(there, near, 1e-15)


@pytest.mark.parametrize("model", ["idm", "ddm"])
@pytest.mark.parametrize("name", ["driven2", "unordered", "floating", "rubbing"])
def test_casadi_differentiates_once_by_the_core(name, model):
    system = TREES[name]()
    rng = np.random.default_rng(6)
    q, v, a = random_state(system, rng)
    core = getattr(tree_core(system), model)
    equations = models.inverse_dynamics(system)
    if model == "ddm":  # where quaternions are brought to unit length too
        equations = models.with_implicit_jacobian(system, models.direct_dynamics(system))
    x = [MX.sym(key, size) for key, size in (("q", system.nq), ("v", system.nv), ("a", system.nv))]
    p = [casadi.DM(system.p_default)] if system.parameters else []
    motions = np.column_stack([np.array(system.qdot(q, e)).ravel() for e in np.eye(system.nv)])
    for symbol in x:
        ours, theirs = (
            np.array(Function("J", x, [casadi.jacobian(f(*x, *p), symbol)])(q, v, a))
            for f in (core, equations)
        )
        if symbol is x[0] and model == "idm":
            ours, theirs = ours @ motions, theirs @ motions
        close(ours, theirs, TOLERANCE_OF_SOLUTIONS)
    # products with vectors, from the Jacobian by the velocities, the second one
    J = np.array(Function("J", x, [casadi.jacobian(core(*x, *p), x[1])])(q, v, a))
    w = rng.standard_normal(system.nv)
    for transposed, expected in ((True, J.T @ w), (False, J @ w)):
        product = casadi.jtimes(core(*x, *p), x[1], casadi.DM(w), transposed)
        close(Function("product", x, [product])(q, v, a), expected)


def test_jacobians_have_the_zeros_of_the_tree():
    system = TREES["driven3"]()
    core = tree_core(system)
    q, v, a = random_state(system, np.random.default_rng(6))
    assert core.idm.jacobian().nnz_out(1) < system.nv**2
    for model in ("idm", "ddm"):
        J = getattr(core, model).jacobian()(q, v, a, 0)
        full = getattr(core, f"{model}_derivatives")(q, v, a)
        close(J[1], full[1], 1e-15)
        close(J[2], full[2], 1e-15)
        # what is left out is zero, and what is kept is not
        kept = np.array(casadi.DM(J[2].sparsity(), 1)) > 0
        assert (full[2][~kept] == 0).all()
        assert (full[2] != 0).sum() > 0.8 * kept.sum()
    assert core.idm.jacobian().nnz_out(1) < core.ddm.jacobian().nnz_out(1) < system.nv**2
    chain = random_tree(2, n=9, kinds=("revolute",), serial=True).mechanism.assemble()
    assert tree_core(chain).idm.jacobian().nnz_out(0) == 81


@pytest.mark.parametrize("model", ["idm", "ddm"])
def test_derivatives_by_parameters_are_those_of_the_equations(model):
    system = rubbing()
    rng = np.random.default_rng(0)
    q, v, a = random_state(system, rng)
    (p,) = values_of_parameters(system, rng)
    core = getattr(tree_core(system), model)
    equations = (models.inverse_dynamics if model == "idm" else models.direct_dynamics)(system)
    x = [MX.sym(core.name_in(k), *core.size_in(k)) for k in range(4)]
    ours, theirs = (
        Function("J", x, [casadi.jacobian(f(*x), x[3])])(q, v, a, p) for f in (core, equations)
    )
    close(ours, theirs, TOLERANCE_OF_SOLUTIONS)
    # products in all directions at once: those of parameters beside the others
    seeds = [rng.standard_normal(core.size_in(k)) for k in (1, 2, 3)]
    still = np.zeros(system.nq)
    tau = casadi.DM(core(q, v, a, p))
    ours, theirs = (f.forward(1)(q, v, a, p, tau, still, *seeds) for f in (core, equations))
    close(ours, theirs, TOLERANCE_OF_SOLUTIONS)


def test_derivatives_that_the_core_does_not_have_are_refused():
    system = rubbing()
    core = tree_core(system)
    x = [MX.sym(core.idm.name_in(k), *core.idm.size_in(k)) for k in range(4)]
    with pytest.raises((RuntimeError, ModelError), match="cannot be calculated"):
        casadi.jacobian(core.inertia_matrix(x[0], x[3]), x[0])
    slope = casadi.jacobian(core.idm(*x), x[1])
    with pytest.raises((RuntimeError, ModelError), match="cannot be calculated"):
        casadi.jacobian(slope, x[1])


def test_calls_are_those_of_any_model():
    system = rubbing()
    core = tree_core(system)
    assert core.idm is tree_core(system).idm
    q, v, a = random_state(system, np.random.default_rng(0))
    tau = core.idm(q, v, a)
    assert isinstance(tau, np.ndarray)
    assert tau.shape == (system.nv,)
    out = np.zeros(system.nv)
    assert core.idm(q, v, a, out=out) is out
    assert np.array_equal(out, tau)
    close(core.idm(q, v, a, system.p_default), tau, 0)
    assert core.idm.name_in() == models.inverse_dynamics(system).name_in()
    assert core.idm.name_out() == ["tau"]
    for other in (pickle.loads(pickle.dumps(core.idm)), copy.deepcopy(core.idm)):
        assert np.array_equal(other(q, v, a), tau)
    many = core.idm.map(2)(*(np.column_stack([x, x]) for x in (q, v, a)))
    close(many, np.column_stack([tau, tau]), 1e-15)
    with pytest.raises(ModelError, match="not finite"):
        core.idm(q, v * np.nan, a)
    with pytest.raises(ModelError, match="length"):
        core.idm(q * 1.1, v, a)


@pytest.mark.parametrize("flags", [("-mno-avx512f",), ("-mno-avx", "-mno-fma")])
def test_narrower_lanes_give_the_same(flags, monkeypatch, compiler_for_lanes):
    system = TREES["driven3"]()
    q, v, a = random_state(system, np.random.default_rng(0))
    wide = tree_core(system)
    module = sys.modules["mbs.models._tree_core"]  # the function of this name hides it
    monkeypatch.setattr(module, "FAST_FLAGS", (*compiler_for_lanes, *flags))
    narrow = tree_core(TREES["driven3"]())
    close(narrow.idm(q, v, a), wide.idm(q, v, a), 1e-14)
    for model in ("idm_derivatives", "ddm_derivatives"):
        both = (getattr(core, model)(q, v, a) for core in (narrow, wide))
        for x, y in zip(*both, strict=True):
            close(x, y, TOLERANCE_OF_SOLUTIONS)


@pytest.fixture
def compiler_for_lanes():
    """The flags of fast code, where lanes can be made narrower."""
    from mbs.native.kernel import FAST_FLAGS

    if "-march=native" not in FAST_FLAGS:
        pytest.skip("lanes of this processor have one width")
    return FAST_FLAGS


def test_what_the_core_does_not_know_is_refused():
    with pytest.raises(ModelError, match="tree_core is for open trees and this system has loops"):
        tree_core(mbs.load("four_bar").assemble())
    m = Mechanism("sprung")
    body = m.add(Box("box", length=1, width=0.1, mass=1))
    m.connect(m.world, Revolute("j"), body.left)
    m.add(Spring("spring", m.world.at(0, 1), body.right, stiffness=10, length=0.2))
    with pytest.raises(ModelError, match=r"component spring \(Spring\) has equations of its own"):
        tree_core(m.assemble())
    m = Mechanism("massless")
    bodies = [m.add(Body(name, mass=mass)) for name, mass in (("a", 1.0), ("b", 0.0))]
    m.connect(m.world, Prismatic("s"), bodies[0])
    m.connect(bodies[0].at(0.1), Revolute("j"), bodies[1])
    core = tree_core(m.assemble())
    assert np.abs(core.idm(np.zeros(2), np.zeros(2), np.ones(2))).max() > 0
    with pytest.raises(ModelError, match="massless: j can move without moving any inertia"):
        _ = core.ddm
