"""Linear equations of small motions: published eigenvalues, slopes of the motion itself."""

import pickle

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.contact_mechanisms import four_bar
from support.messages import refused

import mbs
from mbs.components import (
    AbsoluteSensor,
    Body,
    Box,
    CoulombFriction,
    Custom,
    DCMotor,
    ElasticShaft,
    FixedFlange,
    Free,
    IdealGear,
    JointSensor,
    PointMass,
    Prismatic,
    Revolute,
    RigidClutch,
    RigidStop,
    SampleHold,
    ShaftInertia,
    Spherical,
    Spring,
    custom,
)
from mbs.errors import ModelError, SingularPosture
from mbs.models import dae, linearise


class Integral(Custom):
    """A controller with an integral of its error."""

    gain = custom.parameter("V/rad")
    error = custom.state("rad.s")
    reference = custom.input("rad")
    measured = custom.input("rad")
    u = custom.output("V")

    def rates(self, at):
        return {"error": at.reference - at.measured}

    def outputs(self, at):
        return {"u": at.gain * (at.reference - at.measured + 0.5 * at.error)}


@pytest.mark.parametrize(
    ("speed", "weave", "capsize", "caster"),
    [
        (0.0, 3.13164324790656, -3.13164324790656, -5.53094371765393),
        (1.0, 3.52696170990070 + 0.80774027519930j, -3.13423125066578, -7.11008014637442),
        (5.0, -0.77534188219585 + 4.46486771378823j, -0.32286642900409, -14.07838969279822),
        (10.0, -3.72016840372880 + 10.90681139476287j, 0.16105338653172, -24.62459635017404),
    ],
)
def test_bicycle(speed, weave, capsize, caster):
    """Eigenvalues of the benchmark bicycle: Meijaard et al. 2007, table 2."""
    system = mbs.load("whipple_bicycle").assemble()
    v0 = {"x": speed, "rear_spin": -speed / 0.3, "front_spin": -speed / 0.35}
    model = linearise(system).at(v0=v0)
    own = model.eigenvalues[np.abs(model.eigenvalues) > 1e-6]
    assert len(own) == 4
    for value in (weave, np.conj(weave), capsize, caster):
        assert np.abs(own - value).min() < 1e-10 * max(1, abs(value))
    assert [name for name, _ in model.x][-3:] == ["lean.v", "steer.v", "rear_spin.v"]


def driven_arm():
    m = mbs.Mechanism("driven_arm", gravity=(0, -9.81, 0))
    first = m.add(Box("first", length=0.6, mass=2.0))
    second = m.add(Box("second", length=0.5, mass=1.0))
    j1 = Revolute("j1", axis="z", Fv=0.1)
    m.connect(m.world, j1, first.left)
    m.connect(first.right, Revolute("j2", axis="z", actuated=True), second.left)
    m.add(Spring("spring", m.world.at(0.3, 0.9, 0), second.right, "k", 0.4, 2.0))
    m.values["k"] = mbs.Parameter("k", 30.0)
    motor = m.add(DCMotor("motor", 1.2, 0.02, 0.05, 1e-5))
    gear = m.add(IdealGear("gear", 40.0))
    m.connect(motor.flange, gear.flange_a)
    m.connect(gear.flange_b, j1.flange)
    control = m.add(Integral("control", gain=20.0))
    m.add(JointSensor("encoder", "j1"))
    m.connect_signal("encoder.q", control.measured)
    m.connect_signal(control.u, motor.voltage)
    return m.assemble()


@pytest.mark.parametrize("name", ["driven_arm", "four_bar", "slider_crank", "rx90"])
def test_slopes_are_those_of_the_equations_of_motion(name):
    """A and B are the Jacobians of the explicit equations, whose states are the same."""
    system = driven_arm() if name == "driven_arm" else mbs.load(name).assemble()
    rng = np.random.default_rng(3)
    free = [system.velocity_coordinates[k].name for k in system.chosen_coordinates]
    q0 = dict(zip(free, system.configuration + 0.2 * rng.uniform(size=system.nq), strict=False))
    q0 = {
        n: system.configuration[[c.name for c in system.coordinates].index(n)] + 0.1 for n in free
    }
    v0 = dict(zip(free, rng.uniform(-1, 1, len(free)), strict=True))
    tau0 = {
        s.name: 1.3
        for k, s in enumerate(system.velocity_coordinates)
        if s.actuated and s.name != "j1"
    }
    model = linearise(system).at(q0=q0, v0=v0, tau0=tau0)
    d = dae(system, q0=q0, v0=v0, tau0=tau0)
    assert [n for n, _ in d.elements["x"]] == [n for n, _ in model.x]
    assert [n for n, _ in d.elements["u"]] == [n for n, _ in model.u]
    slopes = casadi.Function(
        "slopes", [d.x, d.u, d.p], [casadi.jacobian(d.ode, d.x), casadi.jacobian(d.ode, d.u)]
    )
    A, B = (np.array(x) for x in slopes(d.x0, d.u0, d.p0))
    np.testing.assert_allclose(model.A, A, rtol=0, atol=1e-9 * np.abs(A).max())
    np.testing.assert_allclose(model.B, B, rtol=0, atol=1e-9 * np.abs(B).max())


def test_outputs_are_slopes_of_what_a_motion_shows():
    """C and D by differences of sensors, forces and accelerations."""
    system = driven_arm()
    names = ["spring.force", "encoder.a", "j2.a", "motor.tau", "control.u"]
    model = linearise(system, names).at(q0={"j1": 0.4, "j2": 0.7}, v0={"j1": 0.5})
    assert [unit for _, unit in model.y] == ["N", "rad/s2", "rad/s2", "N.m", "V"]

    def shown(change, tau=0.0, reference=0.0):
        q0, v0 = {"j1": 0.4 + change[0], "j2": 0.7 + change[1]}, {"j1": 0.5 + change[2]}
        z0 = dict(zip((n for n, _ in system.states), change[4:], strict=True))
        result = mbs.simulate.run(
            system, 1e-6, step=1e-6, q0=q0, v0={**v0, "j2": change[3]}, tau={"j2": tau},
            z0=z0, u={"control.reference": reference}, quiet=True,
        )  # fmt: skip
        return np.array([result[name][0] for name in names])

    h, n = 1e-5, len(model.x)
    for k, row in enumerate(np.eye(n)):
        slope = (shown(h * row) - shown(-h * row)) / (2 * h)
        np.testing.assert_allclose(model.C[:, k], slope, rtol=1e-6, atol=1e-6 * np.abs(slope).max())
    slope = (shown(np.zeros(n), tau=h) - shown(np.zeros(n), tau=-h)) / (2 * h)
    np.testing.assert_allclose(model.D[:, 0], slope, rtol=1e-6, atol=1e-8)
    slope = (shown(np.zeros(n), reference=h) - shown(np.zeros(n), reference=-h)) / (2 * h)
    np.testing.assert_allclose(model.D[:, 1], slope, rtol=1e-6, atol=1e-8)


def test_spherical_pendulum():
    """Hanging at rest it swings in two directions at one frequency, and turns freely."""
    m = mbs.Mechanism("pendulum")
    bob = m.add(Body("bob", mass=2.0, com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.02)))
    m.connect(m.world, Spherical("ball"), bob)
    model = linearise(m.assemble()).at()
    omega = np.sqrt(2.0 * 9.81 * 0.5 / (0.1 + 2.0 * 0.25))
    values = model.eigenvalues
    assert sorted(np.abs(values.imag))[-4:] == pytest.approx([omega] * 4, rel=1e-12)
    assert np.abs(values.real).max() < 1e-7


def test_small_turns_of_a_body_that_spins():
    """Two attitudes that differ by a small turn turn with the body: xi' = -w x xi + dw."""
    m = mbs.Mechanism("top", gravity=(0, 0, 0))
    top = m.add(Body("top", mass=1.0, inertia=(0.2, 0.3, 0.4)))
    m.connect(m.world, Free("free"), top)
    m.add(AbsoluteSensor("pose", top, quantities=("w",)))
    w = np.array([0.3, -0.2, 0.9])
    v0 = {f"free.w{axis}": value for axis, value in zip("xyz", w, strict=True)}
    model = linearise(m.assemble()).at(v0=v0)
    turns = [
        k for k, (name, _) in enumerate(model.x) if name.startswith("free.w") and name[-1] == "q"
    ]
    skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    np.testing.assert_allclose(model.A[np.ix_(turns, turns)], -skew, atol=1e-14)


def test_what_is_refused():
    system = driven_arm()
    refused(ModelError, "no output 'j3.q'", by=lambda: linearise(system, ["j3.q"]))
    refused(
        ModelError, "states names 'motor.j'", by=lambda: linearise(system).at(states={"motor.j": 1})
    )
    m = mbs.load("planar_2r")
    name = next(m.joints()).name
    m.add(CoulombFriction("friction", name, sliding=1.0))
    refused(ModelError, "linearise", by=lambda: linearise(m.assemble()))


def clutched():
    """Two inertias with a clutch between them, one of them on an elastic shaft."""
    m = mbs.Mechanism("clutched", gravity=(0, 0, 0))
    a, b = ShaftInertia("a", 0.2), ShaftInertia("b", 0.5)
    clutch = RigidClutch("clutch", capacity=3.0)
    shaft = ElasticShaft("shaft", stiffness=20.0, damping=0.1)
    m.connect(shaft.flange_a, FixedFlange("wall").flange)
    m.connect(shaft.flange_b, a.flange_a)
    m.connect(a.flange_b, clutch.flange_a)
    m.connect(clutch.flange_b, b.flange_a)
    return m.assemble()


def test_a_clutch_that_sticks_and_one_that_slips():
    system = clutched()
    sticks = linearise(system, mode={}).at(inputs={"clutch": 1.0})
    w = np.sqrt(20 / 0.7 - (0.1 / 1.4) ** 2)
    expected = [-0.1 / 1.4 - 1j * w, -0.1 / 1.4 + 1j * w, 0, 0]
    np.testing.assert_allclose(sticks.eigenvalues, expected, atol=1e-7)
    slips = linearise(system, mode={"clutch": -1}).at(inputs={"clutch": 1.0}, v0={"a": 2.0})
    w = np.sqrt(20 / 0.2 - 0.25**2)
    np.testing.assert_allclose(slips.eigenvalues, [-0.25 - 1j * w, -0.25 + 1j * w, 0, 0], atol=1e-7)
    np.testing.assert_allclose(slips.B[:, 0], [0, 0, -3 / 0.2, 3 / 0.5], atol=1e-12)


def test_friction_that_slides_in_a_loop_is_an_effort():
    rubbed = four_bar(-9.81, CoulombFriction("dry", "a1", sliding=4.0))
    model = linearise(rubbed, ["b1.a"], mode={"dry": 1}).at(v0={"a1": 1.0})
    plain = linearise(four_bar(-9.81), ["b1.a"]).at(v0={"a1": 1.0}, tau0={"a1": -4.0})
    for one, other in ((model.A, plain.A), (model.B, plain.B), (model.C, plain.C)):
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_a_stop_that_holds_leaves_nothing_to_move():
    system = four_bar(-9.81, RigidStop("end", "b1", upper=1.4))
    model = linearise(system, mode={"end": 1}).at(q0={"b1": 1.4}, tau0={"a1": 30.0})
    np.testing.assert_allclose(model.A, [[0, 1], [0, 0]], atol=1e-9)


@pytest.mark.parametrize(
    ("mode", "state", "told"),
    [
        ({}, {"v0": {"a": 2.0}}, "the velocity on which clutch acts is -2 in this state"),
        ({"clutch": 1}, {"v0": {"a": 2.0}}, "at once that clutch slides the other way"),
        ({}, {"q0": {"a": 3.0}}, "clutch must pull, or hold more than it can"),
        ({"other": 1}, {}, "mode has 'other', which is no rigid stop or dry friction"),
        ({"clutch": 3}, {}, "the mode of clutch is 3; give -1, 0 or 1"),
    ],
)
def test_modes_that_do_not_hold_are_refused(mode, state, told):
    system = clutched()
    refused(
        ModelError,
        told,
        by=lambda: linearise(system, mode=mode).at(inputs={"clutch": 1.0}, **state),
    )


def test_a_system_with_modes_of_its_own_between_events():
    m = mbs.Mechanism("held", gravity=(0, 0, 0))
    m.connect(m.world, Prismatic("x", axis="x", actuated=False), m.add(PointMass("mass", 2.0)))
    hold = SampleHold("hold", period=0.1)
    m.add(hold)
    system = m.assemble()
    refused(ModelError, "linearise without mode= has no events", by=lambda: linearise(system))
    assert linearise(system, mode={}).at().A.shape[0] == 2 + len(system.states)


@pytest.mark.parametrize("speed", [0.0, 1.0, 3.0])
def test_second_derivatives_near_a_singular_configuration(speed):
    """A parallelogram of unit lengths: A21 = 11.772 sin(a0), or an error."""
    system = catalogue_system("n_four_bar")
    linear = mbs.models.linearise(system)
    ddm = mbs.models.direct_dynamics_derivatives(system)
    assert isinstance(pickle.loads(pickle.dumps(ddm)), type(ddm))
    for e in (0.1, 0.03, 0.01):
        A = linear.at(q0={"a0": e}, v0={"a0": speed}).A
        assert A[1, 0] == pytest.approx(11.772 * np.sin(e), abs=1e-6)
        q = mbs.loops.solve(system, {"a0": e})
        assert float(ddm(q, speed, 0)[0]) == pytest.approx(11.772 * np.sin(e), abs=1e-6)
    for e in (3e-3, 1e-3, 1e-4, 1e-5, 1e-6):
        with pytest.raises(SingularPosture, match="second derivatives of the loops"):
            linear.at(q0={"a0": e}, v0={"a0": speed})
        q = mbs.loops.solve(system, {"a0": e})
        with pytest.raises(SingularPosture, match="second derivatives of the loops"):
            ddm(q, speed, 0)
        assert np.isfinite(float(mbs.models.direct_dynamics(system)(q, speed, 0)))


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_second_derivatives_at_any_size_and_speed(size):
    """A parallelogram of rods of this length under gravity in proportion: the same derivatives."""
    m = mbs.Mechanism("parallelogram", gravity=(0, -9.81 * size, 0))
    inertia = (0, size**2 / 12, size**2 / 12)
    rods = [m.add(Body(n, mass=1, com=(size / 2, 0, 0), inertia=inertia)) for n in "lrc"]
    hinges = [Revolute(n, axis="z", actuated=False) for n in ("a0", "a1", "b0", "c0")]
    m.connect(m.world, hinges[0], rods[0])
    m.connect(m.world.at(size), hinges[1], rods[1])
    m.connect(rods[0].at(size), hinges[2], rods[2])
    m.connect(rods[2].at(size), hinges[3], rods[1].at(size))
    m.cut(hinges[3])
    m.guess.update({"a0": np.pi / 2, "a1": np.pi / 2, "b0": -np.pi / 2})
    system = m.assemble(active=["a0"])
    linear = mbs.models.linearise(system)
    ddm = mbs.models.direct_dynamics_derivatives(system)
    answered = set()
    for e in (0.3, 0.1, 0.03, 0.012, 0.01, 0.008, 3e-3, 1e-4):
        q = mbs.loops.solve(system, {"a0": e})
        for speed in (0.1, 3.0, 100.0):
            bound = {"rel": 3e-5, "abs": 1e-9 * speed**2}
            try:
                found = linear.at(q0={"a0": e}, v0={"a0": speed}).A[1, 0]
            except SingularPosture:
                with pytest.raises(SingularPosture, match="second derivatives of the loops"):
                    ddm(q, speed, 0)
            else:
                answered.add((e, speed))
                assert found == pytest.approx(11.772 * np.sin(e), **bound)
                assert float(ddm(q, speed, 0)[0]) == pytest.approx(11.772 * np.sin(e), **bound)
    assert {e for e, _ in answered} == {0.3, 0.1, 0.03, 0.012, 0.01, 0.008}
    assert {(e, 0.1) for e in (0.3, 0.1, 0.03, 0.012, 0.01, 0.008)} < answered
    assert {(e, speed) for e in (0.3, 0.1) for speed in (3.0, 100.0)} < answered
    assert not answered & {(0.01, 100.0), (0.012, 100.0), (0.008, 100.0)}


def test_rounding_is_tested_near_singular_configurations_alone(monkeypatch):
    """One evaluation of the loops decides: at a sine of 0.05, one column or several."""
    system = catalogue_system("n_four_bar")
    ddm = mbs.models.direct_dynamics_derivatives(system)
    calls = []
    monkeypatch.setattr(type(ddm), "_verify", lambda *given: calls.append(given))
    near, far = (mbs.loops.solve(system, {"a0": e}) for e in (0.02, 0.5))
    for columns, expected in (([far], 0), ([near], 1), ([far, far], 0), ([far, near], 1)):
        calls.clear()
        count = len(columns)
        call = ddm if count == 1 else ddm.map(count)
        call(casadi.DM(np.transpose(columns)), casadi.DM.ones(1, count), casadi.DM.zeros(1, count))
        assert len(calls) == expected


def test_every_column_of_a_map_is_tested_for_rounding():
    system = catalogue_system("n_four_bar")
    ddm = mbs.models.direct_dynamics_derivatives(system)
    q = [mbs.loops.solve(system, {"a0": e}) for e in (0.5, 0.01)]
    columns, rest, many = casadi.DM(np.array(q).T), casadi.DM.zeros(1, 2), ddm.map(2)
    assert many(columns, casadi.DM([[100.0, 1.0]]), rest)[0].is_regular()
    with pytest.raises(SingularPosture, match="at these velocities"):
        many(columns, casadi.DM([[1.0, 100.0]]), rest)
