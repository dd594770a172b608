"""Contact phases: forces, accelerations and impulses against balances in plain numpy."""

import casadi
import numpy as np
import pytest
from support.dae_mechanisms import four_bar
from support.legged import FEET
from support.legged import quadruped as walker
from support.random_trees import random_state

import mbs
from mbs import Mechanism
from mbs.components import Body, Free
from mbs.errors import ModelError
from mbs.models import ContactPoint, contact_phases

PHASES = [(), ("fl",), ("fl", "hr"), {"fl": "sliding", "hr": "fixed"}, tuple(FEET)]


def numbers(value):
    return np.array(value, dtype=float)


@pytest.fixture(scope="module")
def quadruped():
    return walker()


@pytest.fixture(scope="module")
def phases(quadruped):
    points = [ContactPoint(name, name, plane="slope", friction=0.7) for name in FEET]
    return contact_phases(quadruped, points)


def after(system, phases, state, a, h):
    """Velocities of the points a short time later."""
    q, v = state
    rate = numbers(system.qdot(q, v)).ravel()
    return numbers(phases.motion()(q + h * rate, v + h * a)[1])


@pytest.mark.sweep
@pytest.mark.parametrize("touching", PHASES, ids=str)
def test_what_is_held_does_not_accelerate_and_the_rest_has_no_force(quadruped, phases, touching):
    q, v, tau = random_state(quadruped, np.random.default_rng(1), 0.3)
    a, f = map(numbers, phases.accelerations(touching)(q, v, tau))
    rates = [after(quadruped, phases, (q, v), a.ravel(), h) for h in (1e-6, -1e-6)]
    slope = (rates[0] - rates[1]) / 2e-6
    ways = dict(touching) if isinstance(touching, dict) else dict.fromkeys(touching, "fixed")
    for k, name in enumerate(phases.names):
        held = {"fixed": [0, 1, 2], "sliding": [2], "": []}[ways.get(name, "")]
        free = [row for row in range(3) if row not in held]
        assert np.all(f[free, k] == 0)
        np.testing.assert_allclose(slope[held, k], 0, atol=1e-6)
    motion, contact = phases.residuals(touching)(q, v, a, tau, f)
    np.testing.assert_allclose(numbers(motion), 0, atol=1e-10 * max(1, np.abs(f).max()))
    np.testing.assert_allclose(numbers(contact), 0, atol=1e-10 * max(1, np.abs(a).max()))


def test_every_phase_has_the_same_signature(phases):
    for build in (phases.accelerations, phases.residuals, phases.impact):
        kinds = {
            (f.name(), *f.name_in(), *f.name_out(), *(f.size_in(k) for k in range(f.n_in())))
            for f in map(build, PHASES)
        }
        assert len(kinds) == 1
    assert phases.accelerations(["fl"]) is phases.accelerations("fl")


def test_flight_is_the_direct_dynamic_model(quadruped, phases):
    state = random_state(quadruped, np.random.default_rng(2))
    a, f = phases.accelerations()(*state)
    np.testing.assert_allclose(
        numbers(a), numbers(mbs.models.direct_dynamics(quadruped)(*state)), rtol=1e-8, atol=1e-8
    )
    assert not numbers(f).any()


def test_a_force_in_a_phase_is_an_external_wrench(quadruped, phases):
    """The momentum that the ground gives: total force = mass (acceleration of the centre - g)."""
    q, v = np.array(quadruped.configuration), np.zeros(quadruped.nv)
    a, f = phases.accelerations(tuple(FEET))(q, v, 0)
    turn = numbers(mbs.models.transform(quadruped, "slope")(q))[:3, :3]
    ddm = mbs.models.direct_dynamics(quadruped, f_ext=True)
    wrenches = np.zeros((6, len(quadruped.bodies)))
    for k, name in enumerate(FEET):
        column = [row.name for row in quadruped.bodies].index(f"{name}_lower")
        T = numbers(mbs.models.transform(quadruped, f"{name}_lower")(q))
        force = T[:3, :3].T @ turn @ numbers(f)[:, k]
        wrenches[:, column] = -np.r_[force, np.cross([0, 0, -0.25], force)]
    np.testing.assert_allclose(numbers(ddm(q, v, 0, wrenches)), numbers(a), atol=1e-8)


@pytest.mark.parametrize("touching", PHASES[1:], ids=str)
def test_touchdown_stops_the_points_and_takes_the_energy_of_the_change(quadruped, phases, touching):
    q, v, _ = random_state(quadruped, np.random.default_rng(3), 0.3)
    v_plus, P = phases.impact(touching)(q, v)
    held = numbers(phases.accelerations(touching)(q, v, 0)[1]) != 0
    V = numbers(phases.motion()(q, v_plus)[1])
    np.testing.assert_allclose(V[held], 0, atol=1e-9)
    A = numbers(mbs.models.inertia_matrix(quadruped)(q))
    dv = numbers(v_plus).ravel() - v
    lost = (v @ A @ v - numbers(v_plus).ravel() @ A @ numbers(v_plus).ravel()) / 2
    assert lost == pytest.approx(dv @ A @ dv / 2, rel=1e-9)
    assert lost > 0
    before = numbers(phases.motion()(q, v)[1])
    assert -np.sum(numbers(P) * before) / 2 == pytest.approx(lost, rel=1e-9)


def test_points_that_hold_each_other_share_their_forces():
    m = Mechanism("block", gravity=(0, 0, -9.81))
    block = m.add(Body("block", mass=2.0, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Free("base"), block)
    corners = []
    for k, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        m.add_frame(f"corner{k}", block.at(0.2 * x, 0.1 * y, -0.1))
        corners.append(ContactPoint(f"corner{k}", f"corner{k}", friction=0.5))
    system = m.assemble()
    phases = contact_phases(system, corners)
    a, f = phases.accelerations(phases.names)(system.configuration, 0, 0)
    np.testing.assert_allclose(numbers(a), 0, atol=1e-7)
    np.testing.assert_allclose(numbers(f)[2], 2 * 9.81 / 4, rtol=1e-6)
    np.testing.assert_allclose(numbers(f)[:2], 0, atol=1e-5)


def test_loops_stay_closed_when_a_link_touches():
    system = four_bar()
    phases = contact_phases(system, [ContactPoint("tip", "b")])
    q, tau = np.array(system.configuration), np.array([3.0, 0, 0])
    v = numbers(mbs.loops.reduction_matrix(system)(q)).ravel() * 2.0
    p = system.p_default
    a, f, lam = phases.accelerations({"tip": "sliding"})(q, v, tau, p)
    motion, contact, loops = phases.residuals({"tip": "sliding"})(q, v, a, tau, f, lam, p)
    for value in (motion, contact, loops):
        np.testing.assert_allclose(numbers(value), 0, atol=1e-9)
    free = phases.accelerations()(q, v, tau, p)[0]
    expected = mbs.models.direct_dynamics(system, coordinates="tree")(q, v, tau, p)[0]
    np.testing.assert_allclose(numbers(free), numbers(expected), rtol=1e-7, atol=1e-8)


def test_derivatives_are_those_of_differences(quadruped, phases):
    phase = phases.accelerations(("fl", "hr"))
    q, v, tau = random_state(quadruped, np.random.default_rng(4), 0.3)
    x = casadi.MX.sym("v", quadruped.nv)
    slope = casadi.Function("J", [x], [casadi.jacobian(phase(q, x, tau)[0], x)])
    h = 1e-6 * np.eye(quadruped.nv)
    columns = [(phase(q, v + e, tau)[0] - phase(q, v - e, tau)[0]) / 2e-6 for e in h]
    expected = numbers(casadi.horzcat(*columns))
    np.testing.assert_allclose(numbers(slope(v)), expected, atol=1e-6 * np.abs(expected).max())


def test_margins_of_friction(phases):
    inside, outside = np.array([[0.3], [0.4], [1.0]]), np.array([[0.6], [0.4], [1.0]])
    f = np.tile(inside, (1, 4))
    f[:, 1:2], f[:, 2] = outside, 0
    cone = numbers(phases.friction()(f)).reshape(4, 2)
    np.testing.assert_allclose(cone[0], [1, 0.49 - 0.25])
    np.testing.assert_allclose(cone[1], [1, 0.49 - 0.52])
    np.testing.assert_array_equal(cone[2], 0)
    pyramid = numbers(phases.friction(sides=4)(f)).reshape(4, 5)
    assert pyramid[0, 1:].min() == pytest.approx(0.7 * np.sqrt(0.5) - 0.4)
    assert pyramid[1].min() < 0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (lambda s: contact_phases(s, []), "the contact points are none"),
        (lambda s: contact_phases(s, ["fl"]), "'fl' is no contact point; give ContactPoint"),
        (
            lambda s: contact_phases(s, [ContactPoint("a", "fl"), ContactPoint("a", "fr")]),
            "the contact points are a, a; give one or more, each a name of its own",
        ),
        (
            lambda s: contact_phases(s, [ContactPoint("a", "fl")]).accelerations(5),
            "there is no contact point '5'",
        ),
        (lambda s: contact_phases(s, [ContactPoint("a", "toe")]), "there is no frame 'toe'"),
        (lambda s: contact_phases(s, [ContactPoint("a", 0)]), "on the same link"),
        (
            lambda s: contact_phases(s, [ContactPoint("a", "fl")]).impact("b"),
            "there is no contact point 'b'",
        ),
        (
            lambda s: contact_phases(s, [ContactPoint("a", "fl")]).accelerations({"a": "stuck"}),
            "point 'a' touches 'stuck'; use 'fixed' or 'sliding'",
        ),
        (
            lambda s: contact_phases(s, [ContactPoint("a", "fl")]).friction(2),
            "sides is 2; give a number of sides from 3",
        ),
        (
            lambda s: contact_phases(s, [ContactPoint("a", "fl")]).accelerations(["a", "a"]),
            "the points that touch are a, a; name each once",
        ),
        (lambda s: ContactPoint("a", "fl", friction=-1), "friction is -1; give a coefficient"),
        (lambda s: ContactPoint("a", "fl", friction=np.nan), "friction is nan; give a coefficient"),
        (lambda s: ContactPoint("a", "fl", friction=np.inf), "friction is inf; give a coefficient"),
        (lambda s: ContactPoint("", "fl"), "contact point '': the name is not a text"),
    ],
)
def test_what_is_refused(quadruped, given, message):
    with pytest.raises(ModelError, match=message):
        given(quadruped)
