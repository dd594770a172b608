"""States saved around events, events that are refused, and memory."""

import dataclasses
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmu_instances import SOLVERS, Fmu, refused, signed, slave, slopes
from fmu_models import block

from mbs.export.fmu.pack import write_fmu
from mbs.native import find_compiler

# ---- saved states ----


@pytest.mark.sweep
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
    events = len(blob) - 8 * (4 + 6)  # the detection of one indicator is last, its offset before
    for place in (events, events + 16, events + 32, events - 8):
        torn = bytearray(blob)
        torn[place : place + 8] = np.float64(np.nan).tobytes()
        signed(torn)
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


def test_events_do_not_lengthen_what_one_step_may_take(fmu_of):
    instance = fmu_of("clapper", solver="rodas").open(FMU2Slave)
    refused(instance.doStep, 0.0, 1e9)  # it grazes a stop again and again
    instance.freeInstance()
