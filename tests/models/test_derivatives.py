"""Derivatives of the inverse dynamic model against differences and differentiation."""

import casadi
import numpy as np
import pytest
from casadi import SX
from support.driven_trees import driven_tree
from support.random_trees import ALL_KINDS, random_state, random_tree

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import Body, Revolute
from mbs.errors import ModelError
from mbs.models import inverse_dynamics_derivatives
from mbs.operations import count
from mbs.recursions import newton_euler_derivatives as recursion
from mbs.recursions.link_motions import link_poses, moving_base, resting_base
from mbs.recursions.newton_euler import newton_euler

TREES = [
    *((seed, False, False) for seed in range(4)),
    *((seed, True, False) for seed in range(10, 13)),
    *((seed, True, True) for seed in range(20, 23)),
]


def tree_of(parameters):
    seed, aligned, serial = parameters
    twin = random_tree(seed, n=5, kinds=ALL_KINDS, aligned=aligned, serial=serial)
    return twin.mechanism.assemble()


@pytest.fixture(params=TREES, ids=lambda p: f"tree{p[0]}")
def system(request):
    return tree_of(request.param)


def moved(system, q, velocity, step):
    """The positions after a small step along velocities, quaternions kept at unit length."""
    q = np.asarray(q) + step * np.array(system.qdot(q, velocity)).ravel()
    for link in system.tree.links:
        if link.motion.nq != link.motion.nv:
            part = slice(link.q.stop - 4, link.q.stop)
            q[part] /= np.linalg.norm(q[part])
    return q


def differences(system, value, q, v, x, h=1e-5):
    """Central differences of value(q, v, x) along q, and with respect to v and x."""

    def slope(change):
        columns = [
            (np.array(value(*change(h * e))) - np.array(value(*change(-h * e)))) / (2 * h)
            for e in np.eye(len(v))
        ]
        return np.hstack([column.reshape(-1, 1) for column in columns])

    return (
        slope(lambda e: (moved(system, q, e, 1.0), v, x)),
        slope(lambda e: (q, v + e, x)),
        slope(lambda e: (q, v, x + e)),
    )


def assert_close(found, expected, tolerance):
    for a, b in zip(found, expected, strict=True):
        a, b = np.array(a), np.array(b)
        np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * max(1.0, np.abs(b).max()))


@pytest.mark.sweep
def test_efforts_against_differences(system):
    q, v, a = random_state(system, np.random.default_rng(0))
    idm = mbs.models.inverse_dynamics(system)
    *slopes, tau = inverse_dynamics_derivatives(system, "analytical")(q, v, a)
    assert_close(slopes, differences(system, idm, q, v, a), 1e-7)
    assert_close([tau], [idm(q, v, a)], 1e-12)


@pytest.mark.sweep
def test_recursions_equal_differentiation(system):
    q, v, a = random_state(system, np.random.default_rng(1))
    analytical, ad = (
        inverse_dynamics_derivatives(system, method)(q, v, a) for method in ("analytical", "ad")
    )
    assert_close(analytical, ad, 1e-12)


@pytest.mark.sweep
def test_slope_along_accelerations_is_the_inertia_matrix(system):
    q, v, a = random_state(system, np.random.default_rng(2))
    A = np.array(inverse_dynamics_derivatives(system)(q, v, a)[2])
    assert_close([A], [mbs.models.inertia_matrix(system)(q)], 1e-12)
    assert_close([A], [A.T], 1e-15)


@pytest.fixture(params=range(6), ids=lambda seed: f"driven{seed}")
def driven(request):
    return driven_tree(request.param, n=5).assemble()


def test_drives_springs_and_rotors(driven):
    q, v, a = random_state(driven, np.random.default_rng(0))
    idm = mbs.models.inverse_dynamics(driven)
    *slopes, tau = inverse_dynamics_derivatives(driven, "analytical")(q, v, a)
    assert_close(slopes, differences(driven, idm, q, v, a), 1e-7)
    assert_close([tau], [idm(q, v, a)], 1e-12)


def test_driven_trees_have_rotors_on_both_sides():
    sides = {
        link.rotor.carrier == j
        for seed in range(6)
        for j, link in enumerate(driven_tree(seed, n=5).assemble().tree.links)
        if link.rotor is not None
    }
    assert sides == {False, True}


def recursion_of(system, base=None):
    """The recursions alone as they are now, on a base at rest or with the given motion."""
    q, v, a = (SX.sym(n, k) for n, k in (("q", system.nq), ("v", system.nv), ("a", system.nv)))
    tree = system.tree
    poses, base = link_poses(tree, q), base or resting_base(tree.gravity)
    found = recursion.newton_euler_derivatives(tree, poses, v, a, base)
    tau = newton_euler(tree, poses, v, a, base).efforts
    matrices = [found.dq, found.dv, found.A, found.efforts]
    return casadi.Function("f", [q, v, a], matrices), casadi.Function("tau", [q, v, a], [tau])


@pytest.mark.sweep
def test_every_way_to_the_base_gives_the_same(driven, monkeypatch):
    state, numbers = random_state(driven, np.random.default_rng(3)), range(len(driven.tree.links))
    results = []
    for links in (set(), set(numbers[1::2]), set(numbers)):
        monkeypatch.setattr(recursion, "links_by_base", lambda *_, links=links: links)
        results.append(recursion_of(driven)[0](*state))
    assert_close(results[1], results[0], 1e-12)
    assert_close(results[2], results[0], 1e-12)


@pytest.mark.sweep
@pytest.mark.parametrize("by_base", [False, True])
def test_moving_base(driven, monkeypatch, by_base):
    links = set(range(len(driven.tree.links))) if by_base else set()
    monkeypatch.setattr(recursion, "links_by_base", lambda *_: links)
    base = moving_base(SX([0.3, -0.5, 0.7]), SX([0.2, 0.4, -0.6]), SX([1.0, -2.0, 9.0]))
    f, idm = recursion_of(driven, base)
    q, v, a = random_state(driven, np.random.default_rng(4))
    *slopes, tau = f(q, v, a)
    assert_close(slopes, differences(driven, idm, q, v, a), 1e-7)
    assert_close([tau], [idm(q, v, a)], 1e-12)


def test_long_chain():
    rows = np.random.default_rng(0).uniform(0.3, 0.9, (20, 3))
    frames = [
        {"antecedent": j, "joint": "revolute", "alpha": x, "d": y, "r": z}
        for j, (x, y, z) in enumerate(rows)
    ]
    numbers = dict(XX=2, YY=2.5, ZZ=3, XY=0.1, XZ=0.2, YZ=0.3, MX=0.1, MY=0.2, MZ=0.3, M=1)
    bodies = [{"frame": j + 1, **numbers} for j in range(20)]
    description = {"name": "long", "gravity": [0, 0, -9.81], "frame": frames, "body": bodies}
    system = mbs.load(description).assemble()
    q, v, a = random_state(system, np.random.default_rng(0))
    *slopes, _ = inverse_dynamics_derivatives(system)(q, v, a)
    u = np.random.default_rng(1).standard_normal(20)
    idm, h = mbs.models.inverse_dynamics(system), 1e-6
    along = [
        (idm(q + h * u, v, a) - idm(q - h * u, v, a)) / (2 * h),
        (idm(q, v + h * u, a) - idm(q, v - h * u, a)) / (2 * h),
        idm(q, v, a + u) - idm(q, v, a),
    ]
    assert_close([casadi.mtimes(slope, u) for slope in slopes], along, 1e-8)


def fingers():
    """Eight velocities, but no more than two behind each other."""
    m = Mechanism("fingers", gravity=(0, -9.81, 0))
    for number in range(4):
        before = m.world.at(0, 0, 0.1 * number)
        for k in (1, 2):
            body = Body(f"b{number}_{k}", mass=1, com=(0.3, 0.05, 0), inertia=(0.01, 0.02, 0.03))
            m.connect(before, Revolute(f"j{number}_{k}"), m.add(body))
            before = body.at(0.7)
    return m.assemble()


@pytest.mark.parametrize(
    ("make", "best"),
    [
        (lambda: mbs.load("planar_2r").assemble(), "ad"),
        (lambda: mbs.load("stanford").assemble(), "analytical"),
        (lambda: mbs.load("panda").assemble(), "analytical"),
        (lambda: random_tree(31, n=3, kinds=("free", "revolute")).mechanism.assemble(), None),
        (fingers, "ad"),
    ],
)
def test_auto_takes_fewer_operations(make, best):
    system = make()
    prices = {
        method: count(inverse_dynamics_derivatives(system, method)).price
        for method in ("auto", "ad", "analytical")
    }
    taken = prices.pop("auto")
    assert taken == min(prices.values())
    assert best is None or prices[best] == taken < max(prices.values())


def arm_with_parameters():
    """Three joints whose lengths, masses and frictions are parameters."""
    frames = [
        {"antecedent": 0, "joint": "revolute"},
        {"antecedent": 1, "joint": "revolute", "alpha": "A2", "d": "D2"},
        {"antecedent": 2, "joint": "prismatic", "alpha": 0.5, "d": 0.1},
    ]
    body = dict(XX=0.2, YY=0.3, ZZ="ZZ", MX="MX", MY=0.01, MZ=0.02, M="M", Fv="Fv")
    description = {
        "name": "arm",
        "gravity": [1.0, 2.0, -9.81],
        "parameters": {"A2": 0.4, "D2": 0.3, "ZZ": 0.4, "MX": 0.05, "M": 1.5, "Fv": 0.3},
        "frame": frames,
        "body": [{"frame": j, **body} for j in (1, 2, 3)],
    }
    return mbs.load(description).assemble()


@pytest.mark.parametrize("method", ["ad", "analytical"])
def test_efforts_with_respect_to_parameters(method):
    arm = arm_with_parameters()
    q, v, a = random_state(arm, np.random.default_rng(0))
    f = inverse_dynamics_derivatives(arm, method, with_respect_to=("p", "v"))
    assert f.name_out() == ["dtau_dp", "dtau_dv", "tau"]
    idm, p, h = mbs.models.inverse_dynamics(arm), np.array(arm.p_default), 1e-6
    columns = [(idm(q, v, a, p + h * e) - idm(q, v, a, p - h * e)) / (2 * h) for e in np.eye(6)]
    assert_close([f(q, v, a)[0]], [casadi.horzcat(*columns)], 1e-8)


def test_tree_coordinates_of_a_closed_system():
    system = mbs.load("sr400").assemble()
    q, v, a = random_state(system, np.random.default_rng(0))
    idm = mbs.models.inverse_dynamics(system, coordinates="tree")
    *slopes, tau = inverse_dynamics_derivatives(system, "analytical", "tree")(q, v, a)
    assert_close(slopes, differences(system, idm, q, v, a), 1e-7)
    assert_close([tau], [idm(q, v, a)], 1e-12)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (
            lambda s: inverse_dynamics_derivatives(s, "best"),
            "use one of 'auto', 'ad', 'analytical'",
        ),
        (
            lambda s: inverse_dynamics_derivatives(s, with_respect_to=("q", "w")),
            "use q, v, a, z, u, p",
        ),
        (lambda s: inverse_dynamics_derivatives(s, with_respect_to=()), "name each input once"),
        (lambda s: inverse_dynamics_derivatives(s, with_respect_to="qv"), "use q, v, a, z, u, p"),
        (lambda s: inverse_dynamics_derivatives(s, with_respect_to=("q", "q")), "once"),
        (lambda s: inverse_dynamics_derivatives(s, with_respect_to="p"), "has no parameters"),
        (lambda s: inverse_dynamics_derivatives(s, coordinates="all"), "coordinates"),
        (lambda s: inverse_dynamics_derivatives("puma"), "is not a System, of which models are"),
    ],
)
def test_wrong_words_are_refused(call, says):
    with pytest.raises(ModelError, match=says):
        call(mbs.load("planar_2r").assemble())


def test_one_name_is_enough():
    f = inverse_dynamics_derivatives(mbs.load("planar_2r").assemble(), with_respect_to="v")
    assert f.name_out() == ["dtau_dv", "tau"]


@pytest.mark.parametrize(("name", "most"), [("stanford", 990), ("rx90", 1340), ("puma560", 1390)])
def test_operations_of_the_recursions(name, most):
    taken = count(inverse_dynamics_derivatives(mbs.load(name).assemble(), "analytical"))
    assert taken.mul + taken.add + taken.div <= most
