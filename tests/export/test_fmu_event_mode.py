"""Event mode, early return and intermediate update of FMI 3.0."""

import ctypes

import numpy as np
import pytest
from fmpy.fmi3 import FMU3Model
from fmu_instances import Fmu3, refused, slave
from fmu_models import fall, impact_times, slider_crank

from mbs.export.fmu.pack import write_fmu


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
        refused(instance.reset)
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


def test_calls_that_belong_to_another_kind_of_host(fmu_of):
    fmu = fmu_of("ball", "3.0")
    instance = slave(fmu)
    enter = instance.dll.fmi3EnterContinuousTimeMode
    assert enter(instance.component) == 3  # fmi3Error
    refused(instance.updateDiscreteStates)
    refused(instance.enterStepMode)
    instance.enterEventMode()
    set_time = instance.dll.fmi3SetTime
    assert set_time(instance.component, ctypes.c_double(5.0)) == 3
    instance.enterStepMode()
    assert instance.doStep(0.0, 0.1)[3] == 0.1
    instance.freeInstance()
    outside = fmu.running(FMU3Model)
    refused(outside.getEventIndicators, (ctypes.c_double * 2)(), 2)
    outside.freeInstance()


def test_a_model_without_events_has_event_mode_too(tmp_path):
    fmu = Fmu3(write_fmu(slider_crank(), tmp_path / "x.fmu", fmi="3.0"), tmp_path / "x")
    instance = slave(fmu)
    assert instance.doStep(0.0, 0.2) == (False, False, False, 0.2)
    instance.enterEventMode()
    assert not instance.updateDiscreteStates()[3]
    instance.enterStepMode()
    assert instance.doStep(0.2, 0.2)[3] == 0.4
    instance.freeInstance()
