"""Direct dynamics by articulated bodies against composite bodies, MuJoCo and its own inverse."""

import casadi
import numpy as np
import pytest
from casadi import SX
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import planar_loop
from support.messages import refused
from support.mujoco_rounding import as_exact_as
from support.random_trees import ALL_KINDS, random_state, random_tree

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    PointMass,
    Prismatic,
    Revolute,
    Rotor,
    Spherical,
)
from mbs.errors import ModelError
from mbs.operations import count
from mbs.recursions.articulated_body import solve_inertia
from mbs.recursions.link_motions import link_poses

ROBOTS = ("puma560", "stanford", "rx90", "scara", "planar_2r", "cart_pole", "two_branch_tree")
TREES = [
    *(pytest.param(s, dict(n=4), id=f"tree{s}") for s in range(4)),
    *(pytest.param(s, dict(n=4, aligned=True), id=f"aligned{s}") for s in range(10, 13)),
    *(pytest.param(s, dict(n=4, serial=True), id=f"serial{s}") for s in range(20, 23)),
    *(pytest.param(s, dict(n=4, kinds=ALL_KINDS), id=f"floating{s}") for s in range(30, 34)),
]


def accelerations(system, method, q, v, tau):
    return np.array(mbs.models.direct_dynamics(system, method)(q, v, tau)).ravel()


def assert_methods_agree(system, seed):
    q, v, tau = random_state(system, np.random.default_rng(seed))
    composite = accelerations(system, "composite", q, v, tau)
    articulated = accelerations(system, "articulated", q, v, tau)
    tolerance = 1e-11 * np.abs(composite).max()
    np.testing.assert_allclose(articulated, composite, rtol=0, atol=tolerance)


@pytest.mark.parametrize("name", ROBOTS)
def test_methods_agree_on_catalogue_robots(name):
    assert_methods_agree(catalogue_system(name), 0)


@pytest.mark.sweep
@pytest.mark.parametrize(("seed", "options"), TREES)
def test_methods_agree_on_random_trees(seed, options):
    assert_methods_agree(random_tree(seed, **options).mechanism.assemble(), seed)


@pytest.mark.parametrize(("seed", "options"), TREES[::3])
def test_solve_inertia_is_the_inverse_of_the_inertia_matrix(seed, options):
    system = random_tree(seed, **options).mechanism.assemble()
    q, _, _ = random_state(system, np.random.default_rng(seed))
    q_s = SX.sym("q", system.nq)
    right = SX.sym("right", system.nv, 3)
    x = solve_inertia(system.tree, link_poses(system.tree, q_s), right)
    values = np.random.default_rng(1).standard_normal((system.nv, 3))
    solution = np.array(casadi.Function("x", [q_s, right], [x])(q, values))
    A = np.array(mbs.models.inertia_matrix(system)(q))
    expected = np.linalg.solve(A, values)
    np.testing.assert_allclose(solution, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_solve_inertia_of_no_columns():
    system = catalogue_system("planar_2r")
    poses = link_poses(system.tree, SX.sym("q", 2))
    assert solve_inertia(system.tree, poses, SX(2, 0)).shape == (2, 0)


@pytest.mark.parametrize(("seed", "options"), TREES[::2])
def test_articulated_bodies_against_mujoco(seed, options):
    mujoco = pytest.importorskip("mujoco")
    tree = random_tree(seed, **{**options, "kinds": ("revolute", "prismatic", "spherical")})
    system = tree.mechanism.assemble()
    model = mujoco.MjModel.from_xml_string(tree.mjcf)
    data = mujoco.MjData(model)
    q, v, tau = random_state(system, np.random.default_rng(seed))
    for link in system.tree.links:
        joint = model.joint(f"{link.name}_0")
        at_q, at_v = int(joint.qposadr[0]), int(joint.dofadr[0])
        data.qpos[at_q : at_q + link.motion.nq] = q[link.q]
        data.qvel[at_v : at_v + link.motion.nv] = v[link.v]
        data.qfrc_applied[at_v : at_v + link.motion.nv] = tau[link.v]
    mujoco.mj_forward(model, data)
    theirs = np.concatenate(
        [
            data.qacc[int(model.joint(f"{link.name}_0").dofadr[0]) :][: link.motion.nv]
            for link in system.tree.links
        ]
    )
    ours = accelerations(system, "articulated", q, v, tau)
    tolerance = as_exact_as(mujoco, 1e-9)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * np.abs(theirs).max())


@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(1, 4),
    aligned=st.booleans(),
    serial=st.booleans(),
    kinds=st.lists(st.sampled_from(ALL_KINDS), min_size=1, max_size=4, unique=True),
)
def test_articulated_bodies_invert_inverse_dynamics(seed, n, aligned, serial, kinds):
    tree = random_tree(seed, n=n, kinds=tuple(kinds), aligned=aligned, serial=serial)
    system = tree.mechanism.assemble()
    q, v, a = random_state(system, np.random.default_rng(seed))
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    A = np.array(mbs.models.inertia_matrix(system)(q))
    error = np.abs(accelerations(system, "articulated", q, v, tau) - a).max()
    assert error < 1e-14 * np.linalg.cond(A) * max(1.0, np.abs(tau).max()) + 1e-10


def geared(reverse):
    """Three links whose joints have gyroscopic rotors, springs and drives."""
    m = Mechanism("geared", gravity=(1, 2, -9.81))
    rng = np.random.default_rng(0)
    before = m.world
    for k, (axis, kind) in enumerate((("z", Revolute), ("x", Prismatic), ("y", Revolute))):
        body = m.add(Body(f"b{k}", mass=1 + k, com=(0.1, 0.2, 0.1 * k), inertia=(0.1, 0.2, 0.25)))
        rotor = Rotor(inertia=0.01, ratio=7.0 - 2 * k, axis=tuple(rng.standard_normal(3)))
        joint = kind(f"j{k}", axis=axis, Ia=0.1 * k, stiffness=5.0, rest=0.2, rotor=rotor)
        ends = (before.at(0.3, 0.1, 0.2), body.at(0.05, 0, 0))
        first, last = reversed(ends) if reverse else ends
        m.connect(first, joint, last)
        before = body
    return m.assemble()


@pytest.mark.parametrize("reverse", [False, True], ids=["on antecedents", "on links"])
def test_rotors_springs_and_drives(reverse):
    system = geared(reverse)
    assert {link.rotor.carrier == j for j, link in enumerate(system.tree.links)} == {reverse}
    assert_methods_agree(system, 0)
    q, v, a = random_state(system, np.random.default_rng(1))
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    np.testing.assert_allclose(
        accelerations(system, "articulated", q, v, tau), a, rtol=0, atol=1e-11
    )


@pytest.mark.parametrize("method", ["articulated", "composite"])
@pytest.mark.parametrize("name", ["rx90", "two_branch_tree"])
def test_moving_base(method, name):
    system = catalogue_system(name)
    rng = np.random.default_rng(2)
    q, v, a = random_state(system, rng)
    motion = (*rng.uniform(-1, 1, (2, 6)), np.linalg.qr(rng.standard_normal((3, 3)))[0])
    tau = mbs.models.inverse_dynamics(system, moving_base=True)(q, v, a, *motion)
    ddm = mbs.models.direct_dynamics(system, method, moving_base=True)
    back = np.array(ddm(q, v, tau, *motion)).ravel()
    np.testing.assert_allclose(back, a, rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["articulated", "composite"])
@pytest.mark.parametrize("name", ["puma560", "two_branch_tree", "four_bar"])
def test_external_wrenches(method, name):
    system = catalogue_system(name)
    method = "composite" if system.is_closed else method
    rng = np.random.default_rng(3)
    m = len(system.independent)
    q = list(system.configuration)
    v, a = rng.uniform(-1, 1, (2, m))
    wrenches = rng.uniform(-1, 1, (6, len(system.bodies)))
    loaded = mbs.models.inverse_dynamics(system, f_ext=True)(q, v, a, wrenches)
    free = mbs.models.inverse_dynamics(system)(q, v, a)
    assert float(casadi.norm_inf(loaded - free)) > 0.1
    ddm = mbs.models.direct_dynamics(system, method, f_ext=True)
    back = np.array(ddm(q, v, loaded, wrenches)).ravel()
    np.testing.assert_allclose(back, a, rtol=0, atol=1e-9)


def test_symbols_stay_symbols():
    m = Mechanism("pendulum", gravity=(0, -9.81, 0))
    bob, rod = m.add(PointMass("bob", mass=mbs.Parameter("m", 2.0))), m.add(Body("rod", mass=0))
    m.connect(m.world, Revolute("j"), rod)
    m.connect(rod.at(mbs.Parameter("L", 0.5)), bob)
    ddm = mbs.models.direct_dynamics(m.assemble(), "articulated")
    q, v, tau = 0.3, 0.7, 1.1
    for mass, length in ((2.0, 0.5), (3.0, 0.8)):
        expected = (tau - mass * 9.81 * length * np.cos(q)) / (mass * length**2)
        assert float(ddm(q, v, tau, [mass, length])) == pytest.approx(expected, rel=1e-13)


def test_auto_is_the_cheaper_of_the_two():
    def cost(function):
        taken = count(function)
        return taken.mul + taken.add + 2 * taken.div

    chosen = set()
    for system in (
        catalogue_system("rx90"),
        random_tree(3, n=5, kinds=("universal",), serial=True).mechanism.assemble(),
        random_tree(5, n=3, kinds=("free",)).mechanism.assemble(),
    ):
        both = {m: mbs.models.direct_dynamics(system, m) for m in ("articulated", "composite")}
        auto = mbs.models.direct_dynamics(system)
        assert cost(auto) == min(map(cost, both.values()))
        chosen |= {name for name, function in both.items() if function is auto}
        assert mbs.models.direct_dynamics(system) is auto
    assert chosen == {"articulated", "composite"}


def test_articulated_bodies_take_fewer_operations_than_the_literature():
    """Brandl, Johanni & Otter 1988 give 250 n - 222 multiplications, 220 n - 198 additions."""
    rng = np.random.default_rng(0)
    frames = [
        {"antecedent": j, "joint": "revolute", "alpha": 0.4 + 0.1 * j, "d": 0.3, "r": 0.2}
        for j in range(6)
    ]
    bodies = [
        dict(zip(("XX", "XY", "XZ", "YY", "YZ", "ZZ"), (1, 0.1, 0.1, 1, 0.1, 1), strict=True))
        | dict(zip(("MX", "MY", "MZ"), rng.uniform(0.1, 0.3, 3), strict=True))
        | {"frame": j + 1, "M": 2.0}
        for j in range(6)
    ]
    system = mbs.load({"name": "general", "frame": frames, "body": bodies}).assemble()
    taken = count(mbs.models.direct_dynamics(system, "articulated"))
    assert taken.mul + taken.div <= 865 < 250 * 6 - 222
    assert taken.add <= 761 < 220 * 6 - 198


def test_unknown_method_is_refused():
    system = catalogue_system("planar_2r")
    refused(
        ModelError,
        "method is 'aba'; use one of auto, articulated, composite",
        by=lambda: mbs.models.direct_dynamics(system, "aba"),
    )


def test_articulated_bodies_refuse_loops():
    mechanism, guess = planar_loop(0, 4)
    system = mechanism.assemble(guess=guess)
    refused(
        ModelError,
        "method 'articulated' is for open chains and this system has loops",
        by=lambda: mbs.models.direct_dynamics(system, "articulated"),
    )


def coaxial(m):
    """Two joints about one axis, with nothing between them."""
    first, box = m.add(Body("first", mass=0)), m.add(Box("box", length=1, mass=2))
    m.connect(m.world, Revolute("a", axis="z"), first)
    m.connect(first, Revolute("b", axis="z"), box.left)


def rod_about_itself(m):
    """A point mass on the axis of its joint, behind an oblique shoulder."""
    rod, bob = m.add(Body("rod", mass=1, inertia=(1, 1, 1))), m.add(PointMass("bob", mass=2))
    hand = m.add(Body("hand", mass=0))
    m.connect(m.world, Revolute("a", axis=(0.36, 0.48, 0.8)), rod)
    m.connect(rod.at(0.3, 0.1, 0.2), Revolute("b", axis=(0.6, 0, 0.8)), hand)
    m.connect(hand.at(0.6, 0, 0.8), bob)


def point_on_a_ball(m):
    """A point mass away from the centre of a spherical joint spins freely about its arm."""
    hand, bob = m.add(Body("hand", mass=0)), m.add(PointMass("bob", mass=2))
    m.connect(m.world, Spherical("b"), hand)
    m.connect(hand.at(0.1, 0.2, 0.3), bob)


@pytest.mark.parametrize(
    ("build", "name"), [(coaxial, "a"), (rod_about_itself, "b"), (point_on_a_ball, "b.w")]
)
def test_a_joint_that_moves_no_inertia_is_named(build, name):
    m = Mechanism("loose")
    build(m)
    refused(
        ModelError,
        f"loose: {name}",
        "can move without moving any inertia",
        by=lambda: mbs.models.direct_dynamics(m.assemble()),
    )


@pytest.mark.parametrize("size", [1e-3, 1e-2])
def test_light_bodies_are_not_taken_for_massless(size):
    m = Mechanism("light")
    boom = m.add(Box("boom", length=10, mass=1e6))
    needle = m.add(Box("needle", length=size, width=size / 20, mass=1e-6))
    m.connect(m.world, Revolute("a", axis="z"), boom.left)
    m.connect(boom.right, Revolute("b", axis="z"), needle.left)
    system = m.assemble()
    inertia = 1e-6 * size**2 * (1 / 3 + 1 / 12 / 20**2)
    A = np.array(mbs.models.inertia_matrix(system)([0.1, 0.2]))
    assert A[1, 1] == pytest.approx(inertia, rel=1e-12)
    idm = mbs.models.inverse_dynamics(system)
    rest = np.zeros(2)
    still, moved = (float(idm([0.1, 0.2], rest, [0, a])[1]) for a in (0.0, 1.0))
    assert moved - still == pytest.approx(inertia, rel=1e-9)
    for method in ("articulated", "composite"):
        found = accelerations(system, method, [0.1, 0.2], rest, [0, moved])[1]
        assert found == pytest.approx(1.0, rel=1e-6)


def test_articulated_bodies_can_be_differentiated_twice():
    system = catalogue_system("rx90")
    q, v, tau = random_state(system, np.random.default_rng(3))
    found = {}
    for method in ("articulated", "composite"):
        x = SX.sym("x", system.nq)
        a = casadi.sumsqr(mbs.models.direct_dynamics(system, method)(x, v, tau))
        found[method] = np.array(casadi.Function("h", [x], [casadi.hessian(a, x)[0]])(q))
    scale = np.abs(found["composite"]).max()
    np.testing.assert_allclose(found["articulated"], found["composite"], rtol=0, atol=1e-10 * scale)
