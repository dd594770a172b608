"""A stop time that the importer gives is the end: FMI 2.0.4 and 3.0.2 ask for an error past it."""

import ctypes

import fmpy
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmu_instances import refused

KINDS = {
    ("2.0", "me"): FMU2Model,
    ("2.0", "cs"): FMU2Slave,
    ("3.0", "me"): FMU3Model,
    ("3.0", "cs"): FMU3Slave,
}
PAST = "lies past the stop time 1 of the experiment; end there or set up a later one"


def started(fmu, kind, **experiment):
    """An instance after its initialization, what it says, and what keeps its logger alive."""
    said = []
    instance = kind(
        guid=fmu.description.guid,
        unzipDirectory=fmu.folder,
        modelIdentifier=fmu.description.coSimulation.modelIdentifier,
        instanceName="instance",
    )
    if kind in (FMU2Model, FMU2Slave):
        logger = fmi2CallbackLoggerTYPE(lambda *a: said.append(a[4].decode()))
        instance.instantiate(callbacks=fmi2CallbackFunctions(logger=logger))
        # without fmpy's proxy, which fills in the text, that text is the first argument behind "%s"
        instance.setupExperiment(startTime=0.0, **experiment)
        instance.enterInitializationMode()
    else:
        logger = None
        instance.instantiate(logMessage=lambda *a: said.append(a[3].decode()))
        instance.enterInitializationMode(startTime=0.0, **experiment)
    instance.exitInitializationMode()
    if kind is FMU2Model:
        instance.newDiscreteStates()
    elif kind is FMU3Model:
        instance.updateDiscreteStates()
    return instance, said, logger


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_communication_step_past_it_is_refused(fmu_of, fmi):
    instance, said, _ = started(fmu_of("pendulum", fmi), KINDS[fmi, "cs"], stopTime=1.0)
    for k in range(9):
        instance.doStep(k * 0.1, 0.1)
    refused(instance.doStep, 0.9, 0.2)
    if fmi == "3.0":
        assert said[-1].endswith(f"time 1.1 {PAST}")
    instance.doStep(0.9, 0.1 + 1e-15)  # the rounding of a host that adds up its steps
    refused(instance.doStep, 1.0, 1e-3)
    instance.freeInstance()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_integrator_outside_may_try_beyond_it_and_may_not_arrive_there(fmu_of, fmi):
    instance, said, _ = started(fmu_of("pendulum", fmi), KINDS[fmi, "me"], stopTime=1.0)
    refused(instance.setTime, 1.1)  # in event mode a time is one that was reached
    instance.enterContinuousTimeMode()
    rates = (ctypes.c_double * 2)()
    instance.setTime(1.1)
    if fmi == "2.0":
        instance.getDerivatives(rates, 2)
    else:
        instance.getContinuousStateDerivatives(rates, 2)
    refused(instance.completedIntegratorStep)
    refused(instance.enterEventMode)
    if fmi == "3.0":
        assert len(said) == 3
        assert all(text.endswith(f"time 1.1 {PAST}") for text in said)
    instance.setTime(1.0)
    instance.completedIntegratorStep()
    instance.freeInstance()


@pytest.mark.parametrize(("fmi", "kind"), KINDS)
def test_without_a_stop_time_there_is_none(fmu_of, fmi, kind):
    fmu = fmu_of("pendulum", fmi)
    assert fmu.description.modelExchange.needsCompletedIntegratorStep
    instance, _, _ = started(fmu, KINDS[fmi, kind])
    if kind == "cs":
        instance.doStep(0.0, 20.0)
    else:
        instance.enterContinuousTimeMode()
        instance.setTime(20.0)
        instance.completedIntegratorStep()
    instance.freeInstance()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_stop_time_before_the_start_is_refused(fmu_of, fmi):
    refused(lambda: started(fmu_of("pendulum", fmi), KINDS[fmi, "cs"], stopTime=-1.0))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_importer_whose_integrator_steps_over_the_end_gets_there(fmu_of, fmi):
    """CVODE, as fmpy calls it, evaluates past the stop time and interpolates back."""
    path = str(fmu_of("pendulum", fmi).path)
    options = {"stop_time": 1.0, "output_interval": 0.1, "relative_tolerance": 1e-8}
    ends = [
        fmpy.simulate_fmu(path, fmi_type="ModelExchange", set_stop_time=told, **options)
        for told in (True, False)
    ]
    assert ends[0].tolist() == ends[1].tolist()
    assert ends[0]["time"][-1] == 1.0
