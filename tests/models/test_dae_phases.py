"""Differential-algebraic equations of contact phases: points that stand are rows like loops."""

import casadi
import numpy as np
import pytest
from support.dae_mechanisms import four_bar
from support.legged import FEET, hopping_leg, quadruped

import mbs
from mbs import Mechanism
from mbs.bridges import Grid, collocation, multiple_shooting
from mbs.components import (
    Body,
    Free,
    Prismatic,
    Revolute,
)
from mbs.errors import ModelError, Unclosable
from mbs.models import ContactPoint, contact_phases, dae

FORMS = ("reduced", "index1", "index2", "index3", "ggl")
SOME = ("reduced", "index1", "ggl")
SETS = [(), {"fl": "sliding", "hr": "fixed"}, tuple(FEET)]
SPEEDS = {"base.vx": 0.4, "base.wy": -0.3}


def numbers(value):
    return np.array(value, dtype=float)


@pytest.fixture(scope="module")
def feet():
    points = [ContactPoint(name, name, plane="slope", friction=0.7) for name in FEET]
    return contact_phases(quadruped(), points)


@pytest.fixture(scope="module")
def hopper():
    return contact_phases(hopping_leg(), [ContactPoint("foot", "foot", friction=0.8)])


@pytest.fixture(scope="module")
def closed():
    """The hopping leg whose foot is pinned by a ball joint."""
    return hopping_leg(pinned=True)


def at_start(d):
    return d.function()(d.x0, d.z0, d.u0, d.p0)


def motors(system):
    names = [speed.name for speed in system.velocity_coordinates if speed.actuated]
    return dict(zip(names, np.linspace(-4, 6, len(names)), strict=True))


@pytest.mark.sweep
@pytest.mark.parametrize("form", SOME)
@pytest.mark.parametrize("touching", SETS, ids=str)
def test_every_form_has_the_accelerations_and_the_forces_of_the_phase(feet, touching, form):
    system = feet.system
    bent = {f"{name}_knee": 0.6 for name in FEET}
    d = feet.dae(touching, form, q0=bent, v0=SPEEDS, tau0=motors(system))
    q, v, tau = d.x0[: system.nq], d.x0[system.nq :], np.array(system.effort(motors(system)))
    a, f = feet.accelerations(touching)(q, v, tau)
    ode, alg, invariants, q_of, v_of, force = at_start(d)
    expected = np.concatenate([numbers(system.qdot(q, v)).ravel(), numbers(a).ravel()])
    np.testing.assert_allclose(numbers(ode).ravel(), expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(
        numbers(force), numbers(f), atol=1e-8 * max(1, abs(numbers(f)).max())
    )
    np.testing.assert_allclose(numbers(alg), 0, atol=1e-9)
    np.testing.assert_allclose(numbers(invariants), 0, atol=1e-11)
    motion, contact = feet.residuals(touching)(q, v, ode[system.nq :], tau, force)
    np.testing.assert_allclose(numbers(motion), 0, atol=1e-9)
    np.testing.assert_allclose(numbers(contact), 0, atol=1e-9)
    named = [name for name, _ in d.elements["x"]]
    assert [d.x0[named.index(f"{name}.q")] for name in bent] == [0.6] * 4
    assert d.x0[named.index("base.vx.v")] == pytest.approx(0.4)
    r, V = feet.motion()(q, v)
    held = numbers(f) != 0
    np.testing.assert_allclose(numbers(r)[2][held[2]], 0, atol=1e-11)
    np.testing.assert_allclose(numbers(V)[held], 0, atol=1e-11)
    np.testing.assert_array_equal(numbers(q_of).ravel(), q)
    np.testing.assert_array_equal(numbers(v_of).ravel(), v)


@pytest.mark.parametrize("form", FORMS)
def test_every_element_has_a_name(feet, form):
    d = feet.dae(("fl", "hr"), form)
    sizes = {n: getattr(d, n).numel() for n in ("x", "z", "u", "p", "alg", "invariants")}
    assert {n: len(d.elements[n]) for n in sizes} == sizes
    if form != "reduced":
        z = dict(d.elements["z"])
        assert z["lam(fl: z)"] == z["lam(hr: x)"] == "N"
        assert "lam(fr: z)" not in z


@pytest.mark.parametrize("form", SOME)
def test_invariants_stay_zero(feet, form):
    d = feet.dae({"fl": "fixed", "fr": "sliding"}, form, v0=SPEEDS)
    rate = casadi.jtimes(d.invariants, d.x, d.ode)
    rates = casadi.Function("rates", [d.x, d.z, d.u, d.p], [rate])(d.x0, d.z0, d.u0, d.p0)
    np.testing.assert_allclose(numbers(rates), 0, atol=1e-9)
    assert ("base: unit quaternion", "1") in d.elements["invariants"]


@pytest.mark.parametrize("form", FORMS[1:])
def test_a_foot_that_stands_is_a_ball_joint(hopper, closed, form):
    """The rows of a contact are those of a cut joint, with the same forces."""
    tau, v0 = {"hip": 3.0, "slide": 30.0}, {"base.wy": 0.5, "base.wx": 0.2, "hip": -0.4}
    pinned = dae(closed, form, v0=v0, tau0=tau)
    names = [c.name for c in closed.coordinates]
    q0 = dict(zip(names, pinned.x0[: closed.nq], strict=True))
    free = hopper.dae(["foot"], form, q0=q0, v0=v0, tau0=tau)
    nv = closed.nv
    np.testing.assert_allclose(free.x0, pinned.x0, atol=1e-12)
    np.testing.assert_allclose(free.z0[:nv], pinned.z0[:nv], atol=1e-8)
    force, ball = np.linalg.norm(numbers(at_start(free)[5])), np.linalg.norm(pinned.z0[nv : nv + 3])
    assert force == pytest.approx(ball, rel=1e-9)
    assert len(free.elements["alg"]) == len(pinned.elements["alg"]) - (2 if form == "ggl" else 0)


def ends(d, duration, name, options):
    """States at the end, by an integrator of CasADi, and the largest invariant there."""
    motion = casadi.integrator("motion", name, d.casadi(), 0, duration, options)
    end = motion(x0=d.x0, z0=d.z0, u=d.u0, p=d.p0)
    kept = d.function()(end["xf"], end["zf"], d.u0, d.p0)[2]
    return numbers(end["xf"]).ravel(), np.abs(numbers(kept)).ravel()


def test_integrations_keep_the_contact_and_agree_with_a_simulated_ball_joint(hopper, closed):
    tau, v0 = {"hip": 3.0, "slide": 30.0}, {"base.wy": 0.5, "base.wx": 0.2, "hip": -0.4}
    result = mbs.simulate.run(closed, 0.2, v0=v0, tau=tau, step=0.1, tolerance=1e-10)
    q0 = {c.name: result[f"{c.name}.q"][0] for c in closed.coordinates}
    fine = {"reltol": 1e-10, "abstol": 1e-10}
    radau = {
        "collocation_scheme": "radau",
        "interpolation_order": 3,
        "number_of_finite_elements": 20,
        "rootfinder": "newton",
        "simplify": False,
    }
    for form, name, options, drift in (
        ("reduced", "cvodes", fine, 1e-7),
        ("index1", "idas", fine, 1e-7),
        ("index2", "collocation", radau, 1e-7),
        ("index3", "collocation", radau, 1e-4),
        ("ggl", "collocation", radau, 1e-12),
    ):
        d = hopper.dae(["foot"], form, q0=q0, v0=v0, tau0=tau)
        x, invariants = ends(d, 0.2, name, options)
        expected = [result[element][-1] for element, _ in d.elements["x"]]
        np.testing.assert_allclose(x, expected, atol=2e-6 if form != "index3" else 1e-4)
        assert invariants[:-1].max() < drift
        r = numbers(hopper.motion()(x[: closed.nq], x[closed.nq :])[0])
        np.testing.assert_allclose(r, 0, atol=max(drift, 1e-7))


def test_rows_that_depend_on_others_are_left_out():
    m = Mechanism("block", gravity=(0, 0, -9.81))
    block = m.add(Body("block", mass=2.0, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Free("base"), block)
    names = []
    for k, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        names.append(f"corner{k}")
        m.add_frame(names[-1], block.at(0.2 * x, 0.1 * y, -0.1))
    phases = contact_phases(m.assemble({"base.z": 0.1}), [ContactPoint(n, n) for n in names])
    for form in ("index1", "index2", "ggl"):
        d = phases.dae(names, form)
        assert sum(name.startswith("lam") for name, _ in d.elements["z"]) == 6
        ode, alg, *_, f = at_start(d)
        np.testing.assert_allclose(numbers(alg), 0, atol=1e-10)
        np.testing.assert_allclose(numbers(ode), 0, atol=1e-10)
        np.testing.assert_allclose(numbers(f).sum(axis=1), [0, 0, 2 * 9.81], atol=1e-9)


def test_the_rows_do_not_depend_on_the_start(hopper):
    straight, turned = (hopper.dae(["foot"], "ggl", q0={"base.qx": x}) for x in (0.0, 0.2))
    assert straight.z is turned.z
    assert not np.allclose(straight.x0, turned.x0)


@pytest.mark.parametrize("form", FORMS)
def test_loops_and_points_together(form):
    system = four_bar()
    phases = contact_phases(system, [ContactPoint("tip", "c")])
    begin = {"v0": {"j1": 0.0}, "tau0": {"j1": 3.0}}
    d = phases.dae({"tip": "sliding"}, form, **begin)
    q, v = d.x0[: system.nq], d.x0[system.nq :]
    a, f, _ = phases.accelerations({"tip": "sliding"})(q, v, [3.0, 0, 0], d.p0)
    ode, alg, invariants, *_, force = at_start(d)
    np.testing.assert_allclose(numbers(ode)[system.nq :], numbers(a), atol=1e-7)
    np.testing.assert_allclose(numbers(force), numbers(f), atol=1e-6)
    np.testing.assert_allclose(numbers(alg), 0, atol=1e-9)
    np.testing.assert_allclose(numbers(invariants), 0, atol=1e-10)


@pytest.mark.parametrize(
    ("error", "given", "message"),
    [
        (ModelError, {"form": "index4"}, "form is 'index4'; use one of reduced, index1"),
        (
            Unclosable,
            {"q0": {"base.z": 3.0, "slide": 0.1}},
            "no configuration near the start lets foot",
        ),
        (ModelError, {"v0": [1.0] * 8}, "foot allow no motion with the velocities base.vx = 1"),
        (ModelError, {"tau0": {"base.vx": 1.0}}, "which has no motor"),
        (ModelError, {"touching": ["toe"]}, "there is no contact point 'toe'"),
    ],
)
def test_what_is_refused(hopper, error, given, message):
    with pytest.raises(error, match=message):
        hopper.dae(**{"touching": ["foot"], **given})


def lift():
    """A trunk above a leg: m (z'' + g) = u while the foot stands."""
    m = Mechanism("lift", gravity=(0, 0, -9.81))
    trunk, leg = m.add(Body("trunk", mass=3)), m.add(Body("leg", mass=0.5))
    m.connect(m.world, Prismatic("z", axis="z", actuated=False), trunk)
    m.connect(trunk, Prismatic("leg_slide", axis="-z", actuated=True), leg)
    m.add_frame("foot", leg.at(0, 0, -0.2))
    return contact_phases(m.assemble({"z": 0.3}), [ContactPoint("foot", "foot")])


@pytest.mark.parametrize("form", ["reduced", "index1", "index2", "ggl"])
def test_the_least_effort_to_rise_is_the_one_by_hand(form):
    """Accelerations are proportional to the time from the middle; efforts are stepwise constant."""
    stages, seconds, rise = 12, 0.6, 0.1
    d = lift().dae({"foot": "sliding"}, form, q0={"z": 0.3}, tau0={"leg_slide": 3 * 9.81})
    opti, grid = casadi.Opti(), Grid(stages=stages, duration=seconds, code="interpreted")
    way = (multiple_shooting if form == "reduced" else collocation)(opti, d, grid)
    names = [name for name, _ in d.elements["x"]]
    z, v = names.index("z.q"), names.index("z.v")
    opti.subject_to(way.x[:, 0] == d.x0)
    opti.subject_to(way.x[z, -1] == 0.3 + rise)
    opti.subject_to(way.x[v, -1] == 0)
    opti.minimize(way.integral(way.u**2))
    way.guess(np.tile(d.x0[:, None], stages + 1))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-10})
    h = seconds / stages
    moving = 12 * rise**2 / (h**3 * stages * (stages**2 - 1))
    expected = 9 * (moving + 9.81**2 * seconds)
    assert opti.solve().value(opti.f) == pytest.approx(expected, rel=1e-7)


def test_a_straight_leg_that_swings_cannot_stand():
    """At full reach no effort keeps the foot from rising."""
    m = Mechanism("leg", gravity=(0, 0, -9.81))
    upper, lower = (m.add(Body(n, mass=1, com=(0, 0, -0.1), inertia=(1, 1, 1))) for n in "ab")
    m.connect(m.world.at(0, 0, 0.8), Revolute("hip", axis="y"), upper)
    m.connect(upper.at(0, 0, -0.4), Revolute("knee", axis="y"), lower)
    m.add_frame("foot", lower.at(0, 0, -0.4))
    phases = contact_phases(m.assemble(), [ContactPoint("foot", "foot")])
    straight = {"q0": {"hip": 0.0, "knee": 0.0}}
    d = phases.dae({"foot": "sliding"}, "index1", **straight)
    assert [name for name, _ in d.elements["z"]] == ["hip.a", "knee.a", "lam(foot: z)"]
    with pytest.raises(ModelError, match="the forces on foot are not determined at the start"):
        phases.dae({"foot": "sliding"}, "index1", v0={"hip": 1.0}, **straight)
