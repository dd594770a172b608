"""Laws in place of the inputs of motors and devices in the state equation."""

import casadi
import numpy as np
import pytest
from support.contact_mechanisms import stopped_rocker
from support.minimal_runs import moved, start_of

import mbs
from mbs import Mechanism
from mbs.components import (
    Box,
    CoulombFriction,
    DCMotor,
    Force,
    Revolute,
    RigidStop,
    Torque,
)
from mbs.errors import ModelError
from mbs.models.state.independent import DriveInputs, minimal_state


def controller(system, kind, index=0):
    """A PD law of one joint, whose goal is the further input."""
    names = ("t", 1), ("q", system.nq), ("v", system.nv), ("w", 1), ("p", len(system.parameters))
    t, q, v, w, p = (kind.sym(name, size) for name, size in names)
    tau = kind.zeros(system.nv)
    tau[index] = 40 * (w - q[index]) - 6 * v[index]
    return casadi.Function("pd", [t, q, v, w, p], [tau])


def test_a_controller_drives_a_loop_with_a_stop_as_in_a_simulation():
    system = stopped_rocker()
    state = minimal_state(system, drive=DriveInputs(effort=controller(system, casadi.SX)))
    assert (state.inputs, state.extra, state.efforts) == ((), 1, (0,))
    own = moved(system, state, np.linspace(0, 2, 41), lambda t: [1.6 + casadi.sin(2 * t)])

    def law(t, q, v):
        return casadi.vertcat(40 * (1.6 + casadi.sin(2 * t) - q[0]) - 6 * v[0], 0, 0)

    full = mbs.simulate.run(system, 2.0, tau=law, step=0.05, tolerance=1e-11, quiet=True, q0={})
    assert [e.time for e in own.events] == pytest.approx([e[0] for e in full.events], abs=1e-9)
    assert own.events
    np.testing.assert_allclose(own.x[:, 0], full["a1.q"], atol=1e-9)
    np.testing.assert_allclose(own.y[:, -2], full["a1.tau"], atol=1e-7)
    np.testing.assert_allclose(own.y[:, -1], full["end.effort"], atol=1e-7)


def test_a_controller_that_is_no_expression_of_scalars_stays_a_call():
    system = stopped_rocker()
    both = [
        minimal_state(system, drive=DriveInputs(effort=controller(system, kind)))
        for kind in (casadi.SX, casadi.MX)
    ]
    assert [state.rhs.is_a("MXFunction") for state in both] == [False, True]
    assert [state.events.jump.is_a("MXFunction") for state in both] == [False, True]
    assert all(state.events.first.is_a("SXFunction") for state in both)
    x, z = start_of(system, both[0], v0={"a1": 0.7})
    for function in ("rhs", "indicators"):
        values = [
            getattr(state if function == "rhs" else state.events, function).call(
                [0.2, x, z, 0.3, 1.0]
            )
            for state in both
        ]
        for own, other in zip(*values, strict=True):
            np.testing.assert_allclose(np.array(own), np.array(other), rtol=1e-12, atol=1e-12)


def loaded_arm(*acts):
    """Four turns with a stop and Coulomb friction; what acts on a point of the last link."""
    m = mbs.Mechanism("arm", gravity=(0, 0, -9.81))
    end = m.world
    for k, axis in enumerate("zyyx", start=1):
        bar = m.add(Box(f"bar{k}", length=0.3, width=0.06, density=1500))
        m.connect(end, Revolute(f"q{k}", axis=axis, actuated=True), bar.left)
        end = bar.right
    m.add(RigidStop("end", joint="q3", lower=-0.2, upper=0.3, restitution=0.5))
    m.add(CoulombFriction("dry", joint="q2", sliding=2.0, sticking=3.0))
    point = m.add_frame("grip", bar.at(0.1, 0.05, 0.2))
    for act in acts:
        m.add(act(point))
    return m.assemble()


def arm_law(t, q, v, goal):
    """Efforts of the arm: one joint is controlled, one is shaken."""
    return casadi.vertcat(0, 40 * (goal - q[1]) - 5 * v[1], 8 * casadi.sin(5 * t), 0)


def test_wrench_motions_law_and_contacts_together_move_an_arm_as_in_a_simulation():
    system = loaded_arm()
    t, q, v, w, p = (casadi.SX.sym(n, k) for n, k in zip("tqvwp", (1, 4, 4, 1, 0), strict=True))
    law = casadi.Function("law", [t, q, v, w, p], [arm_law(t, q, v, w)])
    drive = DriveInputs(wrenches=("grip",), motions=(("q1", "q"), ("q4", "a")), effort=law)
    state = minimal_state(system, drive=drive)

    def inputs(t):
        place = 0.4 * casadi.sin(3 * t)
        speed = casadi.jacobian(place, t)
        rates = [place, speed, casadi.jacobian(speed, t), casadi.cos(4 * t)]
        return [3.0, -2.0, 4.0, 0.5, 0.2, -0.3, *rates, -0.4]

    own = moved(system, state, np.linspace(0, 1, 21), inputs)
    full = mbs.simulate.run(
        loaded_arm(
            lambda point: Force("force", point, force=(3.0, -2.0, 4.0)),
            lambda point: Torque("torque", point, torque=(0.5, 0.2, -0.3)),
        ),
        1.0,
        q0={},
        tau=lambda t, q, v: arm_law(t, q, v, -0.4),
        motion={"q1.q": lambda t: 0.4 * casadi.sin(3 * t), "q4.a": lambda t: casadi.cos(4 * t)},
        step=0.05,
        tolerance=1e-11,
        quiet=True,
    )
    times = sorted({time for time, *_ in full.events})
    assert len(times) > 5
    assert [event.time for event in own.events] == pytest.approx(times, abs=1e-9)
    for column, number in enumerate(state.positions):
        name = f"{system.coordinates[number].name}.q"
        np.testing.assert_allclose(own.x[:, column], full[name], atol=1e-8)
    names = [f"{system.velocity_coordinates[k].name}.tau" for k in state.efforts]
    names += [effort.name for effort in state.contacts]
    for column, name in zip(own.y[:, -len(names) :].T, names, strict=True):
        np.testing.assert_allclose(column, full[name], atol=1e-6)


def driven():
    """A pendulum behind a motor with a current."""
    m = Mechanism("driven", gravity=(0, 0, -9.81))
    arm = m.add(Box("arm", length=0.4, width=0.05, density=2700))
    joint = Revolute("j", axis="y")
    m.connect(m.world, joint, arm.left)
    motor = DCMotor("motor", resistance=1.5, inductance=2e-3, constant=0.4, inertia=1e-3)
    m.connect(motor.flange, joint.flange)
    return m.assemble()


def test_a_law_of_devices_is_that_of_a_simulation():
    system = driven()
    t, q, v, w, p = (casadi.SX.sym(n, k) for n, k in zip("tqvwp", (1, 1, 1, 2, 0), strict=True))
    law = casadi.Function("law", [t, q, v, w, p], [w[0] * (w[1] - q) - 0.3 * v])
    state = minimal_state(system, drive=DriveInputs(device=law))
    assert (state.inputs, state.devices, state.extra) == ((), (), 2)
    own = moved(system, state, np.linspace(0, 0.5, 11), lambda t: [20.0, 0.4], method="rodas")
    full = mbs.simulate.run(
        system,
        0.5,
        u=lambda t, q, v: 20 * (0.4 - q) - 0.3 * v,
        step=0.05,
        tolerance=1e-11,
        quiet=True,
        method="rodas",
    )
    expected = np.stack([full["j.q"], full["j.v"], full["motor.i"]], axis=1)
    np.testing.assert_allclose(own.x, expected, atol=1e-7)


def law_of(inputs, outputs):
    symbols = [casadi.SX.sym(f"i{k}", size) for k, size in enumerate(inputs)]
    return casadi.Function("law", symbols, [casadi.SX.zeros(size) for size in outputs])


@pytest.mark.parametrize(
    ("build", "drive", "message"),
    [
        (stopped_rocker, {"effort": lambda t: t}, "effort is .*give a casadi.Function"),
        (stopped_rocker, {"effort": law_of([1, 3, 3, 0], [3])}, r"inputs of sizes \[1, 3, 3"),
        (stopped_rocker, {"effort": law_of([1, 3, 3, 2, 0], [2])}, "returns 2 values; return 3"),
        (
            driven,
            {"effort": law_of([1, 1, 1, 2, 0], [1]), "device": law_of([1, 1, 1, 3, 0], [1])},
            "effort takes 2 further inputs w and device 3",
        ),
    ],
)
def test_a_law_that_does_not_fit_is_refused(build, drive, message):
    with pytest.raises(ModelError, match=message):
        minimal_state(build(), drive=DriveInputs(**drive))
