"""Derivatives of the direct dynamic model, of closed systems, and of second order."""

import casadi
import numpy as np
import pytest
from casadi import MX, SX
from support.catalogue_systems import catalogue_system
from support.driven_trees import driven_tree
from support.random_trees import random_state, random_tree
from test_derivatives import TREES, arm_with_parameters, assert_close, differences, tree_of

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import Body, Revolute
from mbs.errors import ModelError
from mbs.models import direct_dynamics_derivatives, inverse_dynamics_derivatives
from mbs.operations import count


@pytest.fixture(params=[*TREES, "driven"], ids=str)
def system(request):
    if request.param == "driven":
        return driven_tree(3, n=5).assemble()
    return tree_of(request.param)


@pytest.mark.sweep
def test_accelerations_against_differences(system):
    q, v, tau = random_state(system, np.random.default_rng(4))
    ddm = mbs.models.direct_dynamics(system)
    *slopes, a = direct_dynamics_derivatives(system, "implicit")(q, v, tau)
    assert_close(slopes, differences(system, ddm, q, v, tau, 1e-6), 1e-6)
    assert_close([a], [ddm(q, v, tau)], 1e-10)


@pytest.mark.sweep
def test_implicit_formula_equals_differentiation(system):
    q, v, tau = random_state(system, np.random.default_rng(5))
    implicit, ad = (
        direct_dynamics_derivatives(system, method)(q, v, tau) for method in ("implicit", "ad")
    )
    assert_close(implicit, ad, 1e-9)
    assert_close([implicit[2]], [np.array(implicit[2]).T], 1e-15)


@pytest.mark.parametrize("name", ["planar_2r", "stanford"])
def test_auto_takes_fewer_operations(name):
    system = catalogue_system(name)
    totals = []
    for method in ("auto", "ad", "implicit"):
        taken = count(direct_dynamics_derivatives(system, method))
        totals.append(taken.mul + taken.add + taken.div)
    assert totals[0] == min(totals[1:])


@pytest.mark.parametrize("method", ["ad", "implicit"])
def test_accelerations_with_respect_to_parameters(method):
    arm = arm_with_parameters()
    q, v, tau = random_state(arm, np.random.default_rng(0))
    f = direct_dynamics_derivatives(arm, method, with_respect_to=("q", "p"))
    assert f.name_out() == ["da_dq", "da_dp", "a"]
    ddm, p, h = mbs.models.direct_dynamics(arm), np.array(arm.p_default), 1e-6
    columns = [(ddm(q, v, tau, p + h * e) - ddm(q, v, tau, p - h * e)) / (2 * h) for e in np.eye(6)]
    assert_close([f(q, v, tau)[1]], [casadi.horzcat(*columns)], 1e-7)


@pytest.mark.parametrize("name", ["four_bar", "five_bar", "sr400"])
def test_closed_systems_along_their_motion(name):
    system = catalogue_system(name)
    m, rng = len(system.independent), np.random.default_rng(0)
    start = np.array(system.configuration)[list(system.independent)]
    q = np.array(mbs.loops.solve(system, start + 0.1))
    v, a = rng.uniform(-1, 1, (2, m))

    def moved_by(e):
        active = dict(
            zip(
                [system.velocity_coordinates[k].name for k in system.independent],
                start + 0.1 + e,
                strict=True,
            )
        )
        return np.array(mbs.loops.solve(system, active, guess=names_of(system, q)))

    h = 1e-5
    for builder, model in (
        (inverse_dynamics_derivatives, mbs.models.inverse_dynamics(system)),
        (direct_dynamics_derivatives, mbs.models.direct_dynamics(system)),
    ):
        dq, dv, dx, value = builder(system)(q, v, a)
        along = [
            (model(moved_by(h * e), v, a) - model(moved_by(-h * e), v, a)) / (2 * h)
            for e in np.eye(m)
        ]
        speed = [(model(q, v + h * e, a) - model(q, v - h * e, a)) / (2 * h) for e in np.eye(m)]
        other = [(model(q, v, a + e) - model(q, v, a - e)) / 2 for e in np.eye(m)]
        expected = [casadi.horzcat(*columns) for columns in (along, speed, other)]
        assert_close((dq, dv, dx), expected, 1e-6)
        assert_close([value], [model(q, v, a)], 1e-12)


def names_of(system, q):
    return {c.name: float(x) for c, x in zip(system.coordinates, q, strict=True)}


def test_names_of_closed_systems():
    system = catalogue_system("four_bar")
    f = inverse_dynamics_derivatives(system)
    assert f.name_in() == ["q", "v_a", "a_a"]
    assert f.name_out() == ["dtau_a_dq_a", "dtau_a_dv_a", "dtau_a_da_a", "tau_a"]
    g = direct_dynamics_derivatives(system)
    assert g.name_out() == ["da_a_dq_a", "da_a_dv_a", "da_a_dtau_a", "a_a"]


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda s: inverse_dynamics_derivatives(s, "analytical"), "has loops; use 'ad'"),
        (lambda s: direct_dynamics_derivatives(s, coordinates="tree"), "independent coordinates"),
        (lambda s: direct_dynamics_derivatives(s, "best"), "use one of 'auto', 'ad', 'implicit'"),
        (lambda s: direct_dynamics_derivatives(s, with_respect_to="x"), "use q, v, tau, z, u, p"),
        (lambda s: mbs.models.with_implicit_jacobian(s, None), "for open chains"),
    ],
)
def test_what_there_is_not_is_refused(call, says):
    with pytest.raises(ModelError, match=says):
        call(catalogue_system("four_bar"))


def test_joint_without_inertia_is_refused():
    mechanism = Mechanism("empty", gravity=(0.0, 0.0, -9.81))
    body = mechanism.add(Body("b", mass=0.0, inertia=np.zeros((3, 3))))
    mechanism.connect(mechanism.world, Revolute("j", axis="z"), body)
    with pytest.raises(ModelError, match="without moving any inertia"):
        direct_dynamics_derivatives(mechanism.assemble())


@pytest.mark.parametrize("name", ["stanford", "puma560"])
def test_implicit_jacobian_is_used_and_right(name):
    system = catalogue_system(name)
    ddm = mbs.models.direct_dynamics(system)
    ours = mbs.models.with_implicit_jacobian(system, ddm)
    assert ours.name_in() == ddm.name_in()
    state = random_state(system, np.random.default_rng(0))
    q, v, tau = (MX.sym(n, 6) for n in ("q", "v", "tau"))

    def derived(f):
        a = f(q, v, tau)
        J = casadi.jacobian(a, q)
        square = casadi.dot(a, a)
        H, _ = casadi.hessian(square, q)
        mixed = casadi.jacobian(casadi.gradient(square, v), tau)
        seeds = casadi.jtimes(a, v, casadi.DM.ones(6)), casadi.jtimes(a, tau, a, True)
        return casadi.Function("d", [q, v, tau], [J, H, mixed, *seeds])

    found = derived(ours)
    assert_close(found(*state), derived(ddm)(*state), 1e-10)
    used = "".join(str(found.instruction_MX(k)) for k in range(found.n_instructions()))
    assert "jac_ddm" in used
    assert_close(ours.jacobian()(*state, 0), ddm.jacobian()(*state, 0), 1e-10)
    seeds = np.eye(6)[:3]
    forward = [f.forward(1)(*state, 0, *seeds) for f in (ours, ddm)]
    assert_close(forward[:1], forward[1:], 1e-10)


def test_implicit_jacobian_holds_parameters():
    arm = arm_with_parameters()
    ddm = mbs.models.direct_dynamics(arm)
    ours = mbs.models.with_implicit_jacobian(arm, ddm)
    state = [*random_state(arm, np.random.default_rng(0)), arm.p_default]
    assert_close(ours.jacobian()(*state, 0), ddm.jacobian()(*state, 0), 1e-10)
    assert_close([ours(*state[:3])], [ddm(*state[:3])], 1e-15)


def test_implicit_jacobian_of_quaternions():
    """Off the unit sphere too it is the derivative of the Function."""
    system = random_tree(0, n=3, kinds=("spherical", "free", "prismatic")).mechanism.assemble()
    assert system.nq > system.nv
    ddm = mbs.models.direct_dynamics(system)
    ours = mbs.models.with_implicit_jacobian(system, ddm)
    q, v, tau = random_state(system, np.random.default_rng(0))
    assert_close([ours(q, v, tau)], [ddm(q, v, tau)], 1e-10)
    far = q * np.random.default_rng(1).uniform(0.5, 1.5, system.nq)
    plain = casadi.Function(ours)  # which refuses no quaternion
    columns = [
        (plain(far + e, v, tau) - plain(far - e, v, tau)) / 2e-6 for e in 1e-6 * np.eye(system.nq)
    ]
    assert_close(ours.jacobian()(far, v, tau, 0)[:1], [casadi.horzcat(*columns)], 1e-7)
    x = MX.sym("q", system.nq)
    by_graph = casadi.Function("J", [x], [casadi.jacobian(ours(x, v, tau), x)])
    assert_close([by_graph(far)], [casadi.horzcat(*columns)], 1e-7)


@pytest.mark.parametrize(
    "wrong", [None, lambda s: s, mbs.models.inverse_dynamics], ids=["none", "function", "idm"]
)
def test_implicit_jacobian_wants_the_direct_model(wrong):
    system = catalogue_system("planar_2r")
    model = wrong(system) if wrong else None
    with pytest.raises(ModelError, match="takes the direct model"):
        mbs.models.with_implicit_jacobian(system, model)


@pytest.mark.parametrize("width", [0.0, 1e-3, mbs.Parameter("W", 0.0)], ids=str)
@pytest.mark.parametrize("method", ["ad", "analytical"])
def test_second_derivatives_at_rest_are_numbers(width, method):
    mechanism = Mechanism("rest", gravity=(0.0, 0.0, -9.81))
    before = mechanism.world
    for k in range(3):
        body = mechanism.add(Body(f"b{k}", mass=1.0, com=(0.1, 0, 0), inertia=np.eye(3)))
        joint = Revolute(f"j{k}", axis="xyz"[k], Fs=0.5, Fs_width=width, Fv=0.1)
        mechanism.connect(before.at(0.2, 0, 0), joint, body)
        before = body
    system = mechanism.assemble()
    assert_finite_hessians(system, method)


def test_second_derivatives_of_free_bodies_are_numbers():
    system = random_tree(3, n=3, kinds=("free", "spherical", "prismatic")).mechanism.assemble()
    assert_finite_hessians(system, "analytical")


def assert_finite_hessians(system, method):
    q = SX.sym("q", system.nq)
    v, a, x = (SX.sym(name, system.nv) for name in ("v", "a", "x"))
    p = [SX(system.p_default)] if system.parameters else []
    f = inverse_dynamics_derivatives(system, method)
    g = direct_dynamics_derivatives(system, "implicit")
    values = []
    for model in (f, g, mbs.models.inverse_dynamics(system), mbs.models.direct_dynamics(system)):
        outputs = model(q, v, a, *p)
        for output in outputs if isinstance(outputs, tuple) else (outputs,):
            total = casadi.sum1(casadi.mtimes(SX(output).T if output.is_column() else output, x))
            values.append(casadi.hessian(total, casadi.vertcat(q, v, a))[0])
    hessians = casadi.Function("h", [q, v, a, x], values)
    rest = np.zeros(system.nv)
    found = hessians(list(system.configuration), rest, rest, np.ones(system.nv))
    assert all(casadi.DM(h).is_regular() for h in found)
