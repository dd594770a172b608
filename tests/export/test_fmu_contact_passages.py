"""Co-simulation of rigid stops and Coulomb friction through singular configurations of the
loops."""

import itertools

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmu_instances import Fmu, Fmu3

import mbs
from mbs.components import CoulombFriction, RigidStop
from mbs.simulate import fmu

START = {"a0": -3.0}
"""The parallelogram lies flat after about 0.3 s."""
CONTACTS = {
    "stop": (RigidStop("stop", joint="a0", lower=-3.0, upper=5.0, restitution=1.0), "2.0"),
    "dry": (CoulombFriction("dry", joint="b0", sliding=3.0, sticking=4.5), "3.0"),
}


def parallelogram(element):
    mechanism = mbs.robots.n_four_bar()
    mechanism.add(element)
    return mechanism.assemble(active=["a0"])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("contacts")
    return {
        name: mbs.export.fmu(
            parallelogram(element), folder / f"{name}.fmu", fmi=fmi, outputs=["energy", "closure"]
        )
        for name, (element, fmi) in CONTACTS.items()
    }


def moved(path, tolerance, step=0.02):
    start = {f"{name}.v": value for name, value in START.items()}
    return fmu(path, 3.0, start=start, tolerance=tolerance, step=step)


def last_rows(result, times):
    """Rows at these times, after their events."""
    return [int(np.flatnonzero(np.abs(result.time - t) < 1e-9)[-1]) for t in times]


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
def test_an_elastic_stop_keeps_the_energy(made, tolerance):
    result = moved(made["stop"], tolerance)
    total = result["energy.kinetic"] + result["energy.potential"]
    assert np.ptp(total) / result["energy.kinetic"].max() < 100 * tolerance
    assert result["closure"].max() < 1e-9
    assert result["a0.q"].min() > -3.0 - 1e-9
    assert result["a0.v"].min() < -1
    assert result["a0.v"].max() > 1


@pytest.mark.parametrize("name", CONTACTS)
def test_events_and_motion_are_those_of_a_simulation(made, name):
    system = parallelogram(CONTACTS[name][0])
    shown = mbs.simulate.run(system, 3.0, v0=START, tolerance=1e-10, step=0.02, quiet=True)
    assert shown.events
    result = moved(made[name], 1e-10)
    rows = last_rows(result, shown.time)
    for speed in system.velocity_coordinates:
        assert result[f"{speed.name}.q"][rows] == pytest.approx(shown[f"{speed.name}.q"], abs=1e-6)
        assert result[f"{speed.name}.v"][rows] == pytest.approx(shown[f"{speed.name}.v"], abs=1e-4)
    assert result[f"{name}.mode"][rows] == pytest.approx(shown[f"{name}.mode"])


def test_a_host_of_fmi_3_is_told_the_times_of_events(made):
    """It handles them: there are rows before and after."""
    system = parallelogram(CONTACTS["dry"][0])
    shown = mbs.simulate.run(system, 3.0, v0=START, tolerance=1e-10, step=0.02, quiet=True)
    result = moved(made["dry"], 1e-10)
    twice = result.time[1:][np.diff(result.time) == 0]
    told = sorted({time for time, *_ in shown.events if time > 0})
    assert twice == pytest.approx(told, abs=1e-7)


def test_states_saved_before_events_and_flat_configurations_go_on_bit_for_bit(made, tmp_path):
    model = Fmu(made["stop"], tmp_path)
    instance = model.open(FMU2Slave, start={"a0.v": START["a0"]}, tolerance=1e-7)
    times = [*np.arange(0.0, 3.0, 0.05), 3.0]
    blobs = []
    for begin, end in itertools.pairwise(times):
        state = instance.getFMUstate()
        blobs.append(instance.serializeFMUstate(state))
        instance.freeFMUstate(state)
        instance.doStep(begin, end - begin)
    names = ["a0.q", "a0.v", "a1.q", "b0.q"]
    expected = model.get(instance, *names)
    for k in range(0, len(blobs), 7):
        other = model.open(FMU2Slave, upto="instantiated")
        other.setFMUstate(other.deSerializeFMUstate(blobs[k]))
        for begin, end in zip(times[k:], times[k + 1 :], strict=False):
            other.doStep(begin, end - begin)
        assert np.array_equal(model.get(other, *names), expected)
        other.freeInstance()
    instance.freeInstance()


def test_states_saved_while_an_event_waits_go_on_bit_for_bit(made, tmp_path):
    """In FMI 3.0: before event mode, in it, and after it."""
    model = Fmu3(made["dry"], tmp_path)
    instance = model.unborn(FMU3Slave)
    instance.instantiate(eventModeUsed=True, earlyReturnAllowed=True)
    instance.enterInitializationMode(tolerance=1e-7)
    instance.setFloat64([model.references["a0.v"]], [START["a0"]])
    instance.exitInitializationMode()
    instance.updateDiscreteStates()
    instance.enterStepMode()
    saved = []

    def keep(time, stage):
        saved.append((time, stage, instance.serializeFMUState(instance.getFMUState())))

    def go_on(time, stage, note):
        while time < 3.0 or stage:
            if stage == 0:
                event, _, _, time = instance.doStep(time, min(0.05, 3.0 - time))
                stage = 1 if event else 0
            elif stage == 1:
                instance.enterEventMode()
                stage = 2
            else:
                instance.updateDiscreteStates()
                instance.enterStepMode()
                stage = 0
            note(time, stage)
        return model.get(instance, ["a0.q", "a0.v", "a1.q", "b0.q"])

    expected = go_on(0.0, 0, keep)
    assert {stage for _, stage, _ in saved} == {0, 1, 2}
    for time, stage, blob in saved[::5] + [each for each in saved if each[1]]:
        instance.setFMUState(instance.deserializeFMUState(blob))
        assert np.array_equal(go_on(time, stage, lambda *_: None), expected)
    instance.freeInstance()


@pytest.mark.parametrize("name", CONTACTS)
@pytest.mark.parametrize(("tolerance", "step"), [(1e-6, 0.25), (1e-9, 0.02)])
def test_model_exchange_passes(made, name, tolerance, step):
    """Near singular configurations the states are coordinates along the motion."""
    start = {f"{joint}.v": value for joint, value in START.items()}
    result = fmu(
        made[name],
        3.0,
        start=start,
        kind="ModelExchange",
        tolerance=tolerance,
        step=step,
        quiet=True,
    )
    system = parallelogram(CONTACTS[name][0])
    shown = mbs.simulate.run(system, 3.0, v0=START, tolerance=1e-10, step=step, quiet=True)
    rows = last_rows(result, shown.time)
    error = max(
        np.abs(result[f"{c.name}.q"][rows] - shown[f"{c.name}.q"]).max() for c in system.coordinates
    )
    assert error < 1e3 * tolerance
    assert result["closure"].max() < 1e-9
    if step < 0.1:
        assert result[f"{name}.mode"][rows] == pytest.approx(shown[f"{name}.mode"])


@pytest.mark.parametrize("limit", [0.02, -0.05])
@pytest.mark.parametrize("restitution", [0.0, 0.4, 1.0])
def test_model_exchange_bounces_next_to_a_singular_configuration(limit, restitution, tmp_path):
    """It comes to rest where the states are no joints, a little beyond or before that place."""
    stop = RigidStop("end", joint="a0", lower=limit, upper=5.0, restitution=restitution)
    system = parallelogram(stop)
    path = mbs.export.fmu(system, tmp_path / "end.fmu", fmi="3.0")
    start = {f"{joint}.v": value for joint, value in START.items()}
    options = {"kind": "ModelExchange", "tolerance": 1e-8, "step": 0.02, "quiet": True}
    result = fmu(path, 2.0, start=start, **options)
    shown = mbs.simulate.run(system, 2.0, v0=START, tolerance=1e-10, step=0.02, quiet=True)
    rows = last_rows(result, shown.time)
    for c in system.coordinates:
        error = np.abs(result[f"{c.name}.q"][rows] - shown[f"{c.name}.q"])
        assert error.max() < 1e-5, c.name
    assert result["a0.q"].min() > limit - 1e-6
    assert result["end.mode"][-1] == shown["end.mode"][-1]
