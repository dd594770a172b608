"""Simulators: inputs and outputs of a motion, refusals, pickles, threads."""

import pickle
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context

import casadi
import numpy as np
import pytest
from support.bennett import bennett
from support.catalogue_systems import catalogue_system
from support.messages import refused

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    DCMotor,
    Prismatic,
    Revolute,
    RigidStop,
)
from mbs.errors import ModelError
from mbs.simulate import Simulator, run


def driven():
    """A pendulum with a motor, and a slide beside it."""
    m = Mechanism("driven", gravity=(0, -9.81, 0), parameters={"L": 0.5})
    arm = m.add(Body("arm", mass=1.0, com=("L", 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j", axis="z"), arm)
    slide = m.add(Body("slide", mass=2.0))
    m.connect(m.world, Prismatic("s", axis="x"), slide)
    motor = DCMotor("motor", resistance=1.0, inductance=1e-2, constant=0.2)
    m.connect(motor.flange, next(j for j in m.joints() if j.name == "j").flange)
    return m.assemble()


@pytest.fixture(scope="module")
def system():
    return driven()


def test_inputs_are_what_laws_say(system):
    simulator = Simulator(system, inputs=["motor", "s.tau"])
    assert simulator.inputs == ("motor.voltage", "s.tau")
    start = {"q0": {"j": 0.3}, "z0": {"motor.i": 0.2}, "parameters": {"L": 0.4}}
    for volts, push in ((3.0, 1.0), (-2.0, 0.0)):
        found = simulator(1.0, inputs={"motor.voltage": volts, "s.tau": push}, **start)
        wanted = run(system, 1.0, u={"motor": volts}, tau={"s": push}, quiet=True, **start)
        assert found.units == wanted.units
        assert np.abs(found.values - wanted.values).max() < 1e-12
    assert np.all(simulator(0.1)["motor.voltage"] == 0)


def test_inputs_take_the_place_of_laws(system):
    law = {"tau": lambda t, q, v: {"s": casadi.sin(t), "j": 0.5}, "u": {"motor": 7.0}}
    simulator = Simulator(system, inputs=["motor.voltage", "j.tau"], **law)
    found = simulator(1.0, inputs={"motor": 3.0, "j.tau": 0.25})
    wanted = run(
        system,
        1.0,
        tau=lambda t, q, v: {"s": casadi.sin(t), "j": 0.25},
        u={"motor": 3.0},
        quiet=True,
    )
    assert np.abs(found.values - wanted.values).max() < 1e-12


@pytest.mark.parametrize(
    "outputs", [["j.q"], ["s.v", "motor.i", "j.q"], ["kinetic_energy"], ["motor.w", "j.a"], []]
)
def test_outputs_are_columns_of_the_whole_result(outputs, system):
    whole = run(system, 0.5, u={"motor": 2.0}, quiet=True)
    found = Simulator(system, outputs=outputs, u={"motor": 2.0})(0.5)
    assert list(found.units) == outputs
    for name in outputs:
        assert np.array_equal(found[name], whole[name])
    assert np.array_equal(found.time, whole.time)


@pytest.mark.parametrize("name", ["four_bar", "whipple_bicycle", "stewart_platform"])
def test_outputs_of_loops(name):
    system = mbs.load(name).assemble()
    whole = run(system, 0.2, quiet=True)
    some = list(whole.units)[:: max(1, len(whole.units) // 7)]
    found = Simulator(system, outputs=some)(0.2)
    assert np.array_equal(found.values, np.column_stack([whole[n] for n in some]))


def test_modes_and_events_of_contacts():
    m = Mechanism("hatch", gravity=(0, 0, -9.81))
    m.connect(m.world, Prismatic("z", axis="z"), m.add(Body("hatch", mass=2.0)))
    m.add(RigidStop("seal", "z", lower=-0.2, restitution=0.3))
    system = m.assemble()
    whole = run(system, 1.0, quiet=True)
    found = Simulator(system, inputs=["z.tau"], outputs=["seal.effort", "seal.mode", "z.q"])(1.0)
    assert [e[1:] for e in found.events] == [e[1:] for e in whole.events]
    for name in found.units:
        assert np.abs(found[name] - whole[name]).max() < 1e-9
    lifted = Simulator(system, inputs=["z.tau"])(1.0, inputs={"z.tau": 25.0})
    assert not lifted.events
    assert lifted["z.a"] == pytest.approx(25 / 2 - 9.81)


def test_over_constrained_loops_whose_rows_change_take_inputs():
    system = bennett()
    (name,) = (system.velocity_coordinates[k].name for k in system.independent)
    found = Simulator(system, inputs=[f"{name}.tau"])(1.0, inputs={f"{name}.tau": 0.8})
    wanted = run(system, 1.0, tau={name: 0.8}, quiet=True)
    assert np.abs(found.values - wanted.values).max() < 1e-7


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda s: Simulator("four_bar"), ["System"]),
        (lambda s: Simulator(s, inputs=["motor.volt"]), ["inputs names 'motor.volt'", "voltage"]),
        (lambda s: Simulator(s, inputs="j.tau"), ["inputs is 'j.tau'", "list"]),
        (lambda s: Simulator(s, inputs=["motor", "motor.voltage"]), ["motor.voltage twice"]),
        (lambda s: Simulator(s, outputs=["j.p"]), ["outputs names 'j.p'", "did you mean"]),
        (lambda s: Simulator(s, outputs="j.q"), ["outputs is 'j.q'", "list"]),
        (lambda s: Simulator(s, outputs=["j.q", "j.q"]), ["outputs names j.q twice"]),
        (lambda s: Simulator(s)(1.0, inputs={"j.tau": 1.0}), ["the simulator has none"]),
        (
            lambda s: Simulator(s, inputs=["j.tau"])(1.0, inputs={"s.tau": 1.0}),
            ["inputs names 's.tau'", "j.tau"],
        ),
        (
            lambda s: Simulator(s, inputs=["j.tau"])(1.0, inputs={"j.tau": np.nan}),
            ["j.tau", "finite"],
        ),
        (lambda s: Simulator(s)(-1.0), ["duration", "-1"]),
    ],
)
def test_mistakes_are_told_in_a_sentence(make, parts, system):
    refused(ModelError, *parts, by=lambda: make(system))


def law(t, q, v):
    """A torque that only Python knows."""
    return {"j": 0.3 * casadi.cos(t)}


def swing(simulator, volts):
    return simulator(0.5, inputs={"motor": volts}).values


def test_simulators_travel_to_other_processes(system):
    simulator = Simulator(system, inputs=["motor"], outputs=["j.q", "motor.i"], tau=law)
    copy = pickle.loads(pickle.dumps(simulator))
    assert (copy.inputs, copy.outputs) == (simulator.inputs, simulator.outputs)
    volts = [0.5, 1.0, 2.0]
    wanted = [swing(simulator, one) for one in volts]
    for one, values in zip(volts, wanted, strict=True):
        assert np.array_equal(swing(copy, one), values)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(partial(swing, simulator), volts))
    for one, values in zip(found, wanted, strict=True):
        assert np.array_equal(one, values)


def test_prescribed_motions_travel(system):
    simulator = Simulator(system, motion={"s.q": lambda t: 0.1 * casadi.sin(3 * t)})
    copy = pickle.loads(pickle.dumps(simulator))
    assert np.array_equal(copy(0.5).values, simulator(0.5).values)


def test_threads_may_share_a_simulator():
    simulator = Simulator(driven(), inputs=["motor"])
    volts = np.linspace(-3, 3, 24)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda one: swing(simulator, one), volts))
    alone = Simulator(driven(), inputs=["motor"])
    for one, values in zip(volts, found, strict=True):
        assert np.array_equal(values, swing(alone, one))


def test_a_stop_has_the_outputs_that_were_asked_for():
    m = Mechanism("burst", gravity=(0, 0, 0))
    m.connect(m.world, Prismatic("x", axis="x"), m.add(Body("b", mass=1.0)))
    simulator = Simulator(m.assemble(), outputs=["x.q"], tau=lambda t, q, v: q**3 * 100)
    with pytest.raises(mbs.errors.SolverError) as stopped:
        simulator(10.0, q0={"x": 1.0})
    result = stopped.value.result
    assert list(result.units) == ["x.q"]
    assert result.stopped[0] < 1.0


def test_attributes_that_would_have_no_effect_are_refused():
    system = catalogue_system("planar_2r")
    simulator = Simulator(system)
    for name in ("tau", "system", "max_stpe"):
        with pytest.raises(ModelError, match=f"Simulator: attribute '{name}' cannot be set"):
            setattr(simulator, name, 1.0)
    solver = mbs.models.inverse_geometry.solver(system)
    with pytest.raises(ModelError, match="PoseSolver: attribute 'locked' cannot be set"):
        solver.locked = {"q1": 0.0}
