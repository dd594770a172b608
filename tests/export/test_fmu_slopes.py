"""Inputs and outputs of an FMU as functions of time."""

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmu_instances import TIGHT, refused, slave, slopes


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
    references = [fmu.references[n] for n in ("a", "s", "v")]
    found = instance.getRealOutputDerivatives(references, [1] * 3)
    v, a = fmu.get(instance, "v", "a")
    assert found == pytest.approx([(2 + 3 * h + 3 * h**2) / 2, v, a], rel=1e-14)
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
