"""Steps, events and ends as FMUs of other tools may have them, played by objects in Python."""

from types import SimpleNamespace

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.model_description import CoSimulation, ModelDescription, ModelVariable

from mbs.errors import SolverError
from mbs.simulate._fmu import Intermediate, simulate
from mbs.simulate.fmu_plan import Plan, recording_of, row_times, with_points
from mbs.simulate.fmu_variables import columns_of, elements_of, reader, tracks_of, writer


def variable(name, kind, reference, **others):
    return ModelVariable(name=name, type=kind, valueReference=reference, **others)


class Values:
    """Variables of any type, by reference."""

    def __init__(self, values):
        self.values = dict(values)
        self.calls = []

    def __getattr__(self, name):
        if name[:3] == "get":
            return lambda vr, nValues=None: [x for r in vr for x in np.ravel(self.values[r])]
        if name[:3] == "set" and name != "setupExperiment":
            return lambda references, values: self.values.update(
                zip(references, values, strict=True)
            )
        return lambda *arguments, **named: self.calls.append(name)


def test_numbers_of_every_type_are_read_and_written():
    variables = [
        variable("x", "Float64", 1, unit="m"),
        variable("on", "Boolean", 2),
        variable("M", "Float64", 3, shape=(2, 2)),
        variable("n", "Int32", 4),
        variable("choice", "Enumeration", 5),
        variable("v", "Float64", 6, shape=(3,), unit="rad"),
    ]
    unit = Values({1: 0.5, 2: True, 3: np.arange(4.0), 4: 7, 5: 2, 6: [8.0, 9.0, 10.0]})
    unit.getFloat64 = unit.__getattr__("getFloat64")
    assert columns_of(variables) == {
        **{"x": "m", "on": "1", "M[1,1]": "1", "M[1,2]": "1", "M[2,1]": "1", "M[2,2]": "1"},
        **{"n": "1", "choice": "1", "v[1]": "rad", "v[2]": "rad", "v[3]": "rad"},
    }
    description = SimpleNamespace(fmiVersion="3.0", modelVariables=variables)
    assert reader(unit, description, variables)() == [0.5, 1, 0, 1, 2, 3, 7, 2, 8, 9, 10]
    scalars = [e for v in variables if not v.shape for e in elements_of(v)]
    writer(unit, scalars)([1.5, 0.0, 3.0, 1.0])
    assert [unit.values[k] for k in (1, 2, 4, 5)] == [1.5, False, 3, 1]
    assert isinstance(unit.values[2], bool)
    assert isinstance(unit.values[4], int)


class Ramp(Values):
    """x grows with the rate u; every 0.3 s an event adds one to n; it ends where x is 10."""

    def __init__(self, newer):
        super().__init__({1: 0.0, 2: 1.0, 3: 0})
        self.newer, self.time, self.due = newer, 0.0, 0.3
        if newer:
            self.getFloat64 = self.__getattr__("getFloat64")

    def doStep(self, currentCommunicationPoint, communicationStepSize):
        assert currentCommunicationPoint == pytest.approx(self.time, abs=1e-12)
        end = currentCommunicationPoint + communicationStepSize
        stop = min(end, self.due) if self.newer else end
        full = self.time + (10 - self.values[1]) / self.values[2]
        reached = min(stop, full)
        self.values[1] += (reached - self.time) * self.values[2]
        self.time = reached
        ended = full <= stop
        if self.newer:
            return abs(reached - self.due) < 1e-12, ended, reached < end, reached
        if ended:
            raise FMICallException("fmi2DoStep", 2)
        return None

    def getBooleanStatus(self, kind):
        return True

    def getRealStatus(self, kind):
        return self.time

    def updateDiscreteStates(self):
        if abs(self.time - self.due) < 1e-12:
            self.values[3] += 1
            self.due += 0.3
            return True, False, False, False, False, 0.0
        return False, False, False, False, False, 0.0


def described(fmi, **offered):
    return ModelDescription(
        fmiVersion=fmi,
        modelName="ramp",
        coSimulation=CoSimulation(canHandleVariableCommunicationStepSize=True, **offered),
        modelVariables=[
            variable("x", "Float64", 1, causality="output", variability="continuous"),
            variable("u", "Float64", 2, causality="input", variability="continuous"),
            variable("n", "Int32", 3, causality="output", variability="discrete"),
        ],
    )


def played(unit, description, duration, step, inputs):
    plan = Plan(
        description=description,
        kind="CoSimulation",
        times=row_times(0.0, duration, step, "ramp"),
        tracks=tracks_of(description, inputs),
        starts={},
        tolerance=1e-6,
        solver="CVode",
        rows="step",
    )
    recording = recording_of(unit, description, description.modelVariables, lambda time: None)
    simulate(unit, plan, recording, Intermediate())
    return recording.result()


def test_event_mode_and_early_return():
    result = played(Ramp(True), described("3.0", hasEventMode=True), 1.0, 0.5, {"u": 2.0})
    assert result.time == pytest.approx([0, 0.3, 0.3, 0.5, 0.6, 0.6, 0.9, 0.9, 1.0])
    assert result["n"].tolist() == [0, 0, 1, 1, 1, 2, 2, 3, 3]
    assert result["x"] == pytest.approx(2 * result.time)
    assert [event[1:] for event in result.events] == [("n", f"{k} -> {k + 1}") for k in range(3)]


def test_jumps_of_inputs_between_rows_and_events():
    table = ([0.0, 0.4, 0.4, 1.0], [1.0, 1.0, 3.0, 3.0])
    result = played(Ramp(True), described("3.0", hasEventMode=True), 1.0, 0.5, {"u": table})
    assert result["x"][-1] == pytest.approx(0.4 + 3 * 0.6)
    assert result["u"][result.time == 0.4].tolist() == [1.0, 3.0]
    assert [event[1] for event in result.events] == ["n"] * 3


def test_an_fmu_that_asks_for_the_end_has_a_last_row_there():
    for unit, description in (
        (Ramp(True), described("3.0", hasEventMode=True)),
        (Ramp(False), described("2.0")),
    ):
        for name in ("x", "u"):
            next(v for v in description.modelVariables if v.name == name).type = (
                "Float64" if unit.newer else "Real"
            )
        description.modelVariables[2].type = "Int32" if unit.newer else "Integer"
        result = played(unit, description, 2.0, 0.5, {"u": 8.0})
        assert result.time[-1] == pytest.approx(1.25)
        assert result["x"][-1] == pytest.approx(10.0)
        assert result.events[-1][1:] == ("ramp", "ends the simulation")


def test_an_fmu_that_does_not_get_on():
    unit = Ramp(True)
    unit.doStep = lambda currentCommunicationPoint, communicationStepSize: (
        (True, False, True, currentCommunicationPoint)
    )
    with pytest.raises(SolverError, match="FMU ramp does not get beyond time 0 s"):
        played(unit, described("3.0", hasEventMode=True), 1.0, 0.5, {})


def test_an_event_that_does_not_come_to_an_end():
    unit = Ramp(True)
    unit.updateDiscreteStates = lambda: (True, False, False, False, False, 0.0)
    with pytest.raises(SolverError, match="FMU ramp: an event does not come to an end"):
        played(unit, described("3.0", hasEventMode=True), 1.0, 0.5, {})


def test_what_is_set_and_seen_between_communication_points():
    seen, given = [], []
    watch = Intermediate(lambda time, after: given.append((time, after)), seen.append)
    watch(None, 0.25, True, True, False, False)
    watch(None, 0.5, False, True, True, False)
    assert (given, seen) == ([(0.25, False)], [0.5])

    def broken(time):
        raise ValueError("no row")

    lost = Intermediate(look=broken)
    lost(None, 0.5, False, True, True)
    assert [str(error) for error in lost.lost] == ["no row"]


def test_a_discrete_input_is_held_from_point_to_point():
    description = SimpleNamespace(
        modelVariables=[
            variable("on", "Boolean", 1, causality="input", variability="discrete"),
        ]
    )
    tracks = tracks_of(description, {"on": ([0.0, 1.0, 2.0, 3.0], [0, 1, 1, 0])})
    values = [tracks.at(t, True)[0] for t in (0.0, 0.5, 1.0, 2.9, 3.0, 9.0)]
    assert values == [0, 0, 1, 1, 0, 0]
    assert tracks.at(1.0, False) == [0]
    assert tracks.jumps == {1.0, 3.0}


def test_rows_and_points_that_are_nearly_one():
    times = row_times(0.0, 1.0, 0.1, "x")
    assert len(times) == 11
    points = with_points(times, [0.1 * 3 + 1e-13, 0.55, 7.0])
    assert list(points) == sorted(points)
    assert len(points) == 12
    assert sum(points.values()) == 11
    assert points[0.55] is False
    assert points[0.1 * 3 + 1e-13] is True
