"""Events inside FMUs: jumps, indicators, event mode, states saved between them."""

import ctypes
import dataclasses
import functools
import shutil
import subprocess
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu
from fmu_instances import Fmu, Fmu3
from fmu_models import ball, block, clapper, slider_crank, stopped_crank

from mbs.export.fmu.pack import write_fmu
from mbs.native import find_compiler

MODELS = {make.__name__: make for make in (ball, block, clapper, stopped_crank)}
SOLVERS = pytest.mark.parametrize("solver", ["dopri5", "rodas", "rk4"])
TIGHT = 1e-11


@pytest.fixture(scope="module")
def fmu_of(tmp_path_factory):
    @functools.cache
    def make(name, fmi="2.0", solver="dopri5"):
        folder = tmp_path_factory.mktemp(name)
        model = dataclasses.replace(MODELS[name](), solver=solver)
        path = write_fmu(model, folder / f"{name}.fmu", fmi=fmi)
        return (Fmu if fmi == "2.0" else Fmu3)(path, folder / "unpacked")

    return make


def fall(times, e=0.8, g=10.0, slow=1e-3):
    """Height of a ball that falls from 1 m, and its energy; at rest once it is slow."""
    rows, begin, speed = [], -np.sqrt(2 / g), np.sqrt(2 * g)
    for t in times:
        while speed and t > begin + 2 * speed / g:
            begin, speed = begin + 2 * speed / g, e * speed if e * speed > slow else 0.0
        flight = t - begin if speed else 0.0
        rows.append([speed * flight - g / 2 * flight**2, speed**2 / 2])
    return np.array(rows)


def impact_times(count, e=0.8, g=10.0):
    flights = 2 * np.sqrt(2 / g) * e ** np.arange(count)
    return np.sqrt(2 / g) + np.concatenate(([0], np.cumsum(flights[1:])))


def refused(call, *arguments):
    with pytest.raises(FMICallException):
        call(*arguments)


# ---- co-simulation ----


@SOLVERS
def test_a_ball_bounces_as_the_formula_says(fmu_of, solver):
    fmu = fmu_of("ball", solver=solver)
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    rows = fmu.step(instance, 30, 0.1)
    expected = fall(0.1 * np.arange(1, 31))
    assert np.allclose(rows[:, 0], expected[:, 0], rtol=0, atol=1e-9)
    assert np.allclose(rows[:, 2], expected[:, 1], rtol=0, atol=1e-9)
    assert expected[-1, 1] < 10 * 0.8**10
    instance.freeInstance()


def test_a_ball_comes_to_rest_and_stays_there(fmu_of):
    fmu = fmu_of("ball")
    instance = fmu.open(FMU2Slave)
    fmu.step(instance, 1, 4.5)
    assert fmu.get(instance, "rests", "h", "v").tolist() == [1, 0, 0]
    fmu.step(instance, 1, 5.0, begin=4.5)
    assert fmu.get(instance, "rests", "h", "v").tolist() == [1, 0, 0]
    instance.freeInstance()


@pytest.mark.parametrize("solver", ["dopri5", "rk4"])
def test_the_energy_of_a_bouncing_pendulum_falls_by_the_restitution(fmu_of, solver):
    fmu = fmu_of("clapper", solver=solver)
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    gravity, e = 9.81 / 0.5, 0.9
    energy, hits = -gravity * np.cos(1.0), 0
    floor = -gravity * np.cos(0.5)
    for row in fmu.step(instance, 60, 0.05):
        while hits < row[-1]:
            energy, hits = floor + e**2 * (energy - floor), hits + 1
        assert fmu.description.outputs[2].variable.name == "energy"
        assert row[2] == pytest.approx(energy, abs=1e-8 if solver != "rk4" else 1e-7)
    assert hits >= 3
    instance.freeInstance()


def test_a_block_slides_sticks_and_slides_again(fmu_of):
    fmu = fmu_of("block")
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    stop = 1.0 / (3 / 2)  # deceleration 1.5 m/s2 from 1 m/s
    fmu.step(instance, 1, 1.0)
    assert fmu.get(instance, "v", "mode").tolist() == [0, 0]
    assert fmu.get(instance, "s")[0] == pytest.approx(stop / 2, abs=1e-12)
    fmu.set(instance, {"force": 2.9})
    fmu.step(instance, 1, 1.0, begin=1.0)
    assert fmu.get(instance, "v", "mode").tolist() == [0, 0]
    fmu.set(instance, {"force": -5.0})
    fmu.step(instance, 1, 1.0, begin=2.0)
    assert fmu.get(instance, "mode", "v") == pytest.approx([-1, -1.0], abs=1e-12)
    assert fmu.get(instance, "s")[0] == pytest.approx(stop / 2 - 0.5, abs=1e-12)
    instance.freeInstance()


@SOLVERS
def test_a_slider_meets_a_stop_through_its_loop(fmu_of, solver):
    fmu = fmu_of("stopped_crank", solver=solver)
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    fmu.set(instance, {"torque": 0.0})
    angle = speed = ratio = None
    before = []
    for k in range(200):
        instance.doStep(k * 1e-3, 1e-3)
        angle, speed, hits = fmu.get(instance, "crank.q", "crank.v", "hits")
        if hits:
            ratio = speed / before[-1]
            break
        before.append(speed)
    # the slider is at 0.35 m where the cosine rule has the crank
    meets = np.arccos((0.1**2 + 0.35**2 - 0.3**2) / (2 * 0.1 * 0.35))
    assert angle == pytest.approx(meets, abs=6e-3)
    assert -0.72 < ratio < -0.68
    instance.freeInstance()


def test_communication_steps_do_not_change_where_events_are(fmu_of):
    ends = []
    for steps in (3, 100):
        instance = fmu_of("clapper").open(FMU2Slave, tolerance=TIGHT)
        ends.append(fmu_of("clapper").step(instance, steps, 3.0 / steps)[-1])
        instance.freeInstance()
    assert np.allclose(ends[0], ends[1], rtol=0, atol=1e-7)


# ---- model exchange ----


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", MODELS)
def test_model_exchange_equals_co_simulation(fmu_of, name, fmi):
    path = str(fmu_of(name, fmi).path)
    assert validate_fmu(path) == []
    options = {"stop_time": 2.0, "relative_tolerance": 1e-11, "output_interval": 0.25}
    me, cs = (
        fmpy.simulate_fmu(path, fmi_type=kind, record_events=False, **options)
        for kind in ("ModelExchange", "CoSimulation")
    )
    for column in cs.dtype.names:
        assert np.allclose(me[column], cs[column], rtol=0, atol=1e-6), column


def test_an_integrator_outside_finds_the_impacts(fmu_of):
    rows = fmpy.simulate_fmu(
        str(fmu_of("ball").path),
        fmi_type="ModelExchange",
        relative_tolerance=1e-12,
        output_interval=0.5,
        stop_time=2.2,
        record_events=True,
    )
    turned = np.flatnonzero(np.diff(rows["v"]) > 1) + 1
    times = rows["time"][turned]
    assert np.array_equal(times, rows["time"][turned - 1])
    assert np.allclose(times, impact_times(len(times)), rtol=0, atol=1e-9)
    assert len(times) == 4


def test_a_crude_integrator_outside_gets_through_the_bounces(fmu_of):
    rows = fmpy.simulate_fmu(
        str(fmu_of("ball").path),
        fmi_type="ModelExchange",
        solver="Euler",
        step_size=1e-3,
        output_interval=1e-3,
        stop_time=6.0,
        record_events=False,
    )
    assert np.abs(rows["h"] - fall(rows["time"])[:, 0]).max() < 0.05
    assert abs(rows["h"][-1]) < 1e-3


class Outside:
    """An integrator outside: puts states, reads indicators."""

    def __init__(self, fmu, **start):
        self.fmu = fmu
        self.instance = fmu.open(FMU2Model, start=start, tolerance=1e-8)

    def shown(self, *x):
        self.instance.setContinuousStates((ctypes.c_double * 2)(*x), 2)
        values = (ctypes.c_double * 1)()
        self.instance.getEventIndicators(values, 1)
        assert self.fmu.get(self.instance, "indicator.floor") == values[0]
        return values[0]

    def event(self):
        self.instance.enterEventMode()
        info = self.instance.newDiscreteStates()
        self.instance.enterContinuousTimeMode()
        x = (ctypes.c_double * 2)()
        self.instance.getContinuousStates(x, 2)
        assert info[0] is False or not info[0]
        return bool(info[3]), list(x)


def test_indicators_have_hysteresis_and_are_never_zero(fmu_of):
    outside = Outside(fmu_of("ball"))
    step = outside.instance.completedIntegratorStep
    assert outside.shown(0.5, -3.0) == 0.5
    assert outside.shown(0.0, -4.0) < 0
    assert outside.shown(-1e-3, -4.0) == -1e-3  # an overshoot
    assert outside.event() == (True, [-1e-3, 3.2])
    for height in (-1e-3, -5e-4, 0.0, 5e-9):
        assert outside.shown(height, 3.0) > 1e-4
        assert step()[0] in (False, 0)
    assert outside.shown(-1.9e-3, -1.0) > 0
    assert outside.shown(-2.1e-3, -1.0) < 0  # it never left, and falls again
    assert outside.shown(0.1, 3.0) > 0.1
    step()
    assert outside.shown(0.1, 3.0) == 0.1
    assert outside.shown(-1e-12, -3.0) == -1e-12
    assert outside.event()[1][1] == pytest.approx(2.4)
    assert outside.event() == (False, [-1e-12, outside.event()[1][1]])
    outside.instance.freeInstance()


def test_indicators_have_derivatives(fmu_of):
    fmu = fmu_of("stopped_crank", "3.0")
    instance = fmu.running(FMU3Model)
    watched, angle = (fmu.references[n] for n in ("indicator.slider stop", "crank.q"))
    place = fmu.references["place"]
    slope = instance.getDirectionalDerivative([watched], [angle, place], [1.0, 0.0], 1)[0]
    q, rod = 0.3, np.arcsin(0.1 / 0.3 * np.sin(0.3))
    assert slope == pytest.approx(-0.1 * np.sin(q) - 0.1 * np.cos(q) * np.tan(rod), rel=1e-12)
    back = instance.getAdjointDerivative([watched], [angle, place], [2.0], 2)
    assert back == pytest.approx([2 * slope, -2.0], rel=1e-12)
    assert instance.getNumberOfEventIndicators() == 1
    instance.freeInstance()


# ---- event mode, early return and intermediate update of FMI 3 ----


def slave(fmu, events=True, early=True, update=None):
    instance = fmu.unborn(FMU3Slave)
    instance.instantiate(eventModeUsed=events, earlyReturnAllowed=early, intermediateUpdate=update)
    instance.enterInitializationMode(tolerance=TIGHT)
    instance.exitInitializationMode()
    if events:
        instance.updateDiscreteStates()
        instance.enterStepMode()
    return instance


def test_a_step_ends_at_each_event_which_the_host_handles(fmu_of):
    fmu = fmu_of("ball", "3.0")
    instance = slave(fmu)
    time, found = 0.0, []
    while time < 2.0:
        event, terminate, early, last = instance.doStep(time, 2.0 - time)
        assert not terminate
        assert early == (last < 2.0)
        time = last
        if event:
            before = fmu.get(instance, ["v", "time"])
            instance.enterEventMode()
            needed, _, nominals, changed, *_ = instance.updateDiscreteStates()
            assert (needed, nominals, changed) == (False, False, True)
            assert not instance.updateDiscreteStates()[3]
            after = fmu.get(instance, ["v", "time"])
            assert after == pytest.approx([-0.8 * before[0], before[1]], rel=1e-15)
            found.append(last)
            instance.enterStepMode()
    assert np.allclose(found, impact_times(len(found)), rtol=0, atol=1e-12)
    assert len(found) == 3
    instance.freeInstance()


def test_without_early_return_events_are_handled_inside(fmu_of):
    fmu = fmu_of("ball", "3.0")
    for events, early in ((True, False), (False, True), (False, False)):
        instance = slave(fmu, events, early)
        assert instance.doStep(0.0, 2.0) == (False, False, False, 2.0)
        assert fmu.get(instance, ["h"])[0] == pytest.approx(fall([2.0])[0, 0], abs=1e-10)
        if events:
            instance.enterEventMode()
            assert not instance.updateDiscreteStates()[3]
            instance.enterStepMode()
        else:
            refused(instance.enterEventMode)
        instance.freeInstance()


def test_inputs_jump_in_event_mode(fmu_of):
    fmu = fmu_of("block", "3.0")
    instance = slave(fmu)
    force = [fmu.references["force"]]
    event, _, early, last = instance.doStep(0.0, 1.0)
    assert (event, early, last) == (True, True, pytest.approx(2 / 3, abs=1e-12))
    instance.enterEventMode()
    instance.setFloat64(force, [4.0])
    assert not instance.updateDiscreteStates()[0]
    assert fmu.get(instance, ["mode", "a"]).tolist() == [1, 0.5]
    instance.setFloat64(force, [1.0])  # a loop of signals settles: now it holds
    instance.updateDiscreteStates()
    instance.enterStepMode()
    assert instance.doStep(last, 1.0)[3] == pytest.approx(last + 1, abs=1e-12)
    assert fmu.get(instance, ["v", "mode"]) == pytest.approx([0, 0], abs=1e-12)
    instance.freeInstance()


def test_the_host_looks_at_every_internal_step_and_may_end_it(fmu_of):
    fmu = fmu_of("clapper", "3.0")
    seen, within = [], []

    def update(environment, time, set_, get, finished, may_return, early, end):
        assert (set_, get, finished, may_return) == (False, True, True, True)
        within.append(fmu.get(instance, ["time", "q", "energy"]))
        refused(instance.setFloat64, [fmu.references["push"]], [1.0])
        refused(instance.doStep, time, 0.1)
        refused(instance.getFMUState)
        seen.append(time)
        if 0.2 < time < 0.31:
            early[0] = True
            end[0] = 0.31

    instance = slave(fmu, events=False, update=update)
    event, _, early, last = instance.doStep(0.0, 1.0)
    assert (event, early, last) == (False, True, 0.31)
    assert seen[-1] == 0.31
    assert seen == sorted(seen)
    assert len(seen) > 5
    rows = np.array(within)
    assert np.array_equal(rows[:, 0], seen)
    assert np.allclose(rows[:, 2], rows[0, 2], rtol=0, atol=1e-9)
    assert instance.doStep(0.31, 0.05)[2:] == (False, pytest.approx(0.36))
    instance.freeInstance()


# ---- inputs and outputs as functions of time ----


def slopes(instance, fmu, **orders):
    """Derivatives of one input: order to value."""
    name, values = next(iter(orders.items()))
    instance.setRealInputDerivatives(
        [fmu.references[name]] * len(values), list(values), list(values.values())
    )


@pytest.mark.parametrize("solver", ["dopri5", "rodas"])
def test_an_input_follows_its_derivatives_within_a_step(fmu_of, solver):
    fmu = fmu_of("block", solver=solver)
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    fmu.set(instance, {"force": 1.0})
    slopes(instance, fmu, force={1: 2.0, 2: 3.0, 3: 6.0})
    assert fmu.get(instance, "force") == [1.0]
    h = 0.4
    instance.doStep(0.0, h)
    assert fmu.get(instance, "force") == pytest.approx([1 + 2 * h + 1.5 * h**2 + h**3], rel=1e-14)
    push = h + h**2 + h**3 / 2 + h**4 / 4
    assert fmu.get(instance, "v") == pytest.approx([1 + (push - 3 * h) / 2], rel=1e-9)
    references = [fmu.references[n] for n in ("a", "s", "v", "mode")]
    found = instance.getRealOutputDerivatives(references, [1] * 4)
    v, a = fmu.get(instance, "v", "a")
    assert found == pytest.approx([(2 + 3 * h + 3 * h**2) / 2, v, a, 0], rel=1e-14)
    instance.doStep(h, h)  # nothing was said: it is held
    assert fmu.get(instance, "a") == [a]
    assert instance.getRealOutputDerivatives(references[:1], [1]) == [0.0]
    instance.freeInstance()


def test_an_event_is_where_an_interpolated_input_asks_for_it(fmu_of):
    fmu = fmu_of("block")
    instance = fmu.open(FMU2Slave, start={"v": 0.0}, tolerance=TIGHT)
    slopes(instance, fmu, force={1: 2.0})
    instance.doStep(0.0, 2.0)  # the force passes 3 N at 1.5 s
    assert fmu.get(instance, "v", "s") == pytest.approx([0.5**2 / 2, 0.5**3 / 6], rel=1e-8)
    instance.freeInstance()


def test_derivatives_that_are_not_followed(fmu_of):
    fmu = fmu_of("block")
    instance = fmu.open(FMU2Slave)
    for name, order, value in (
        ("force", 0, 1.0),
        ("force", 4, 1.0),
        ("force", 1, np.nan),
        ("mass", 1, 1.0),
    ):
        refused(instance.setRealInputDerivatives, [fmu.references[name]], [order], [value])
    refused(instance.getRealOutputDerivatives, [fmu.references["a"]], [2])
    refused(instance.getRealOutputDerivatives, [fmu.references["force"]], [1])
    instance.freeInstance()


def test_output_derivatives_follow_time_and_loops(fmu_of):
    fmu = fmu_of("stopped_crank", "3.0")
    instance = slave(fmu, events=False)
    names = ["slider.v", "slider.s", "crank.v", "force"]
    ends = []
    for h in (1e-6, 1e-6):
        instance.doStep(fmu.get(instance, ["time"])[0], h)
        ends.append(fmu.get(instance, names))
        if len(ends) == 1:
            found = instance.getOutputDerivatives([fmu.references[n] for n in names], [1] * 4)
    assert np.allclose(found, (ends[1] - ends[0]) / 1e-6, rtol=1e-4, atol=1e-4)
    assert found[1] == pytest.approx(ends[0][0], rel=1e-12)
    instance.freeInstance()


# ---- saved states ----


@SOLVERS
@pytest.mark.parametrize("name", ["ball", "stopped_crank"])
def test_states_saved_around_events_continue_bit_for_bit(fmu_of, name, solver):
    fmu = fmu_of(name, solver=solver)
    first = {"ball": np.sqrt(0.2)}.get(name, 0.41)
    times = [0.0, 0.4, first, first + 1e-9, first + 1e-4, 0.6, 0.9, 1.3]
    instance = fmu.open(FMU2Slave)
    blobs, ends = [], []
    for begin, end in zip(times, [*times[1:], 1.5], strict=True):
        state = instance.getFMUstate()
        blobs.append(instance.serializeFMUstate(state))
        instance.freeFMUstate(state)
        instance.doStep(begin, end - begin)
    names = [u.variable.name for u in fmu.description.outputs]
    expected = fmu.get(instance, *names)
    for k, blob in enumerate(blobs):
        other = fmu.open(FMU2Slave, upto="instantiated")
        state = other.deSerializeFMUstate(blob)
        other.setFMUstate(state)
        other.freeFMUstate(state)
        for begin, end in zip(times[k:], [*times[k + 1 :], 1.5], strict=True):
            other.doStep(begin, end - begin)
        ends.append(fmu.get(other, *names))
        other.freeInstance()
    assert all(np.array_equal(end, expected) for end in ends)
    instance.freeInstance()


def test_a_state_holds_the_interpolation_of_inputs_and_a_parameter_that_jumped(fmu_of):
    fmu = fmu_of("block")
    instance = fmu.open(FMU2Slave)
    instance.doStep(0.0, 0.9)
    fmu.set(instance, {"force": 2.0, "most": 3.5})
    slopes(instance, fmu, force={1: 3.0, 2: -1.0})
    blob = instance.serializeFMUstate(instance.getFMUstate())
    ends = []
    for each in (instance, fmu.open(FMU2Slave, upto="instantiated")):
        each.setFMUstate(each.deSerializeFMUstate(blob))
        each.doStep(0.9, 1.3)
        slope = each.getRealOutputDerivatives([fmu.references["a"]], [1])
        ends.append([*fmu.get(each, "s", "v", "a", "mode"), *slope])
        each.freeInstance()
    assert ends[0] == ends[1]
    assert ends[0][3] == 1


def test_a_state_saved_while_an_event_waits(fmu_of):
    fmu = fmu_of("ball", "3.0")
    instance = slave(fmu)
    last = instance.doStep(0.0, 1.0)[3]
    blobs = [instance.serializeFMUState(instance.getFMUState())]
    instance.enterEventMode()
    blobs.append(instance.serializeFMUState(instance.getFMUState()))
    ends = []
    for blob in (*blobs, *blobs):
        instance.setFMUState(instance.deserializeFMUState(blob))
        if blob is blobs[0]:
            instance.enterEventMode()
        assert instance.updateDiscreteStates()[3]
        instance.enterStepMode()
        instance.doStep(last, 0.5)
        ends.append(fmu.get(instance, ["h", "v"]).tolist())
    assert ends == [ends[0]] * 4
    plain = slave(fmu, events=False)
    refused(lambda: plain.setFMUState(plain.deserializeFMUState(blobs[1])))
    for each in (instance, plain):
        each.freeInstance()


def test_bytes_with_impossible_events_are_refused(fmu_of):
    fmu = fmu_of("ball")
    instance = fmu.open(FMU2Slave)
    instance.doStep(0.0, 0.7)
    blob = instance.serializeFMUstate(instance.getFMUstate())
    solver = 8 * (8 + 3 * 2)
    events = len(blob) - solver - 8 * (4 + 6)
    for place in (events, events + 16, events + 32, events - 16):
        torn = bytearray(blob)
        torn[place : place + 8] = np.float64(np.nan).tobytes()
        refused(instance.deSerializeFMUstate, bytes(torn))
    instance.freeInstance()


# ---- refusals ----


def told(fmu, **start):
    """A co-simulation that is being initialized, and what it says."""
    said = []
    instance = fmu.unborn(FMU3Slave)
    instance.instantiate(logMessage=lambda *words: said.append(words[3].decode()))
    instance.setFloat64([fmu.references[name] for name in start], list(start.values()))
    instance.enterInitializationMode(tolerance=1e-9)
    return instance, said


def test_a_start_beyond_a_stop_is_refused_by_name(fmu_of):
    fmu = fmu_of("clapper", "3.0")
    instance, said = told(fmu, q=1.5)
    refused(instance.exitInitializationMode)
    assert "the start values lie beyond high stop by 0.3; start inside" in said[-1]
    instance.setFloat64([fmu.references["q"]], [1.1])
    instance.exitInitializationMode()
    instance.freeInstance()


def test_events_that_crowd_are_refused_by_name(fmu_of):
    fmu = fmu_of("ball", "3.0")
    instance, said = told(fmu, e=0.5, slow=-1.0)
    instance.exitInitializationMode()
    refused(instance.doStep, 0.0, 3.0)
    reason = "chattering, events follow each other and time stands still; it concerns floor"
    assert reason in said[-1]
    h, v, time = fmu.get(instance, ["h", "v", "time"])
    assert np.isfinite([h, v]).all()
    assert time == pytest.approx(3 * np.sqrt(0.2), abs=1e-9)
    instance.freeInstance()


def test_jumps_without_end_are_refused_by_name(fmu_of):
    fmu = fmu_of("clapper", "3.0")
    instance, said = told(fmu)
    instance.exitInitializationMode()
    instance.doStep(0.0, 0.01)
    # far behind the stop: no jump of the velocity leads back
    instance.setFloat64([fmu.references["high"]], [0.2])
    refused(instance.doStep, 0.01, 0.1)
    assert "its jumps do not come to an end; it concerns high stop" in said[-1]
    instance.freeInstance()


def test_a_fixed_parameter_keeps_its_value(tmp_path):
    model = block()
    fixed = dataclasses.replace(model.parameters[0], fixed=True)
    model = dataclasses.replace(model, parameters=(fixed, *model.parameters[1:]))
    fmu = Fmu(write_fmu(model, tmp_path / "x.fmu"), tmp_path / "x")
    instance = fmu.open(FMU2Slave, start={"mass": 4.0})
    refused(fmu.set, instance, {"mass": 5.0})
    fmu.set(instance, {"most": 5.0})
    assert fmu.get(instance, "mass", "most", "a").tolist() == [4.0, 5.0, -1.25]
    instance.freeInstance()


def test_calls_that_belong_to_another_kind_of_host(fmu_of):
    fmu = fmu_of("ball", "3.0")
    instance = slave(fmu)
    enter = instance.dll.fmi3EnterContinuousTimeMode
    assert enter(instance.component) == 3  # fmi3Error
    refused(instance.updateDiscreteStates)
    refused(instance.enterStepMode)
    instance.freeInstance()
    outside = fmu.running(FMU3Model)
    refused(outside.getEventIndicators, (ctypes.c_double * 2)(), 2)
    outside.freeInstance()


# ---- from C ----


def host(fmu, folder):
    program = folder / "event_host"
    command = [*find_compiler().command, "-O1", "-g", "-Wall", "-Wextra", "-Werror"]
    headers = f"-I{Path(fmu.folder, 'sources')}"
    source = Path(__file__).with_name("event_host.c")
    subprocess.run([*command, headers, str(source), "-o", str(program), "-ldl"], check=True)
    library = next(Path(fmu.folder, "binaries").glob("*/*.*"))
    return [str(program), str(library), fmu.description.guid]


@pytest.mark.parametrize("name", ["ball", "stopped_crank"])
def test_a_thousand_instances_leave_nothing_behind(fmu_of, name, tmp_path):
    command = host(fmu_of(name), tmp_path)
    answer = subprocess.run([*command, "1000"], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    *_, early, late = answer.stdout.split()
    assert int(late) == int(early)


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_memory_is_clean_over_events(fmu_of, tmp_path):
    check = ["valgrind", "-q", "--leak-check=full", "--error-exitcode=9"]
    command = host(fmu_of("stopped_crank"), tmp_path)
    answer = subprocess.run([*check, *command, "2"], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr


def test_a_model_without_events_has_event_mode_too(tmp_path):
    fmu = Fmu3(write_fmu(slider_crank(), tmp_path / "x.fmu", fmi="3.0"), tmp_path / "x")
    instance = slave(fmu)
    assert instance.doStep(0.0, 0.2) == (False, False, False, 0.2)
    instance.enterEventMode()
    assert not instance.updateDiscreteStates()[3]
    instance.enterStepMode()
    assert instance.doStep(0.2, 0.2)[3] == 0.4
    instance.freeInstance()
