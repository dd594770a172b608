"""What instances of an FMU do from their start to their end, and the calls that they refuse."""

import ctypes
import re
import struct
import threading
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave
from fmu_instances import refused, signed

TOLERANCE = 3e-9
"""No other number of the instances is equal to it."""


def test_saved_states_continue_bit_for_bit(fmu):
    instance = fmu.open(FMU2Slave)
    fmu.step(instance, 20)
    state = instance.getFMUstate()
    blob = instance.serializeFMUstate(state)
    expected = fmu.step(instance, 30, begin=0.2)
    instance.setFMUstate(state)
    assert np.array_equal(fmu.step(instance, 30, begin=0.2), expected)
    other = fmu.open(FMU2Slave)
    copy = other.deSerializeFMUstate(blob)
    other.setFMUstate(copy)
    assert np.array_equal(fmu.step(other, 30, begin=0.2), expected)
    with pytest.raises(FMICallException):
        other.deSerializeFMUstate(bytes(len(blob)))
    exchange = fmu.open(FMU2Model)
    with pytest.raises(FMICallException):
        exchange.setFMUstate(exchange.deSerializeFMUstate(blob))
    instance.freeFMUstate(state)
    other.freeFMUstate(copy)
    for each in (instance, other, exchange):
        each.freeInstance()


NAMES = ("NU", "NY", "NP", "NM", "NZ", "NK", "NCUT")
"""Numbers of variables in model.h, besides states and derivatives."""


def test_bytes_that_are_no_state_are_refused(fmu):
    """Offsets are those of `core_memory`: run, variables, inputs, configuration, solver."""
    instance = fmu.open(FMU2Slave, tolerance=TOLERANCE)
    fmu.step(instance, 3)
    state = instance.getFMUstate()
    blob = instance.serializeFMUstate(state)
    values = fmu.get(instance, *[v.name for v in fmu.description.modelVariables][:2])
    at = len(blob.split(values.tobytes())[0])  # the values of the variables
    header = Path(fmu.folder, "sources", "model.h").read_text()
    size = {name: int(n) for name, n in re.findall(r"#define (N\w+) (\d+)", header)}
    count = 2 * size["NX"] + sum(size[name] for name in NAMES)
    mode, time, stale = at - 32, at - 24, at - 8
    inputs = at + 8 * (count + 1 + size["NZ"] + 1 + size["NCUT"] + 1)
    known = inputs + 8 * (2 + 3 * size["NU"] + 1)
    tolerance = len(blob.split(np.float64(TOLERANCE).tobytes())[0])
    assert struct.unpack_from("=2i", blob, mode) == (16, 1)
    assert [struct.unpack_from("=i", blob, flag)[0] for flag in (stale, inputs, known)] == [0, 0, 1]
    assert struct.unpack_from("=d", blob, time)[0] == pytest.approx(0.03)
    parameter = at + 8 * next(
        v.valueReference for v in fmu.description.modelVariables if v.causality == "parameter"
    )
    wrong = [(mode, "=i", x) for x in (0, 3, 4, 8, 64, -1)]
    wrong += [(stale, "=i", 2), (known, "=i", 2), (inputs, "=i", 3)]
    wrong += [(time, "=d", np.nan), (tolerance, "=d", np.inf), (tolerance, "=d", 0.0)]
    wrong += [(at, "=d", np.nan), (parameter, "=d", -1.0)]
    wrong += [(tolerance + 8 * (k + 1), "=d", np.nan) for k in range(6)]  # step size and times
    for place, form, value in wrong:
        torn = bytearray(blob)
        struct.pack_into(form, torn, place, value)
        signed(torn)
        with pytest.raises(FMICallException):
            instance.deSerializeFMUstate(bytes(torn))
    instance.freeFMUstate(instance.deSerializeFMUstate(blob))
    instance.freeFMUstate(state)
    instance.freeInstance()


def test_a_changed_byte_of_a_state_is_refused_and_changes_nothing(fmu):
    instance = fmu.open(FMU2Slave)
    fmu.step(instance, 3)
    state = instance.getFMUstate()
    blob = instance.serializeFMUstate(state)
    assert signed(bytearray(blob)) == blob
    rng = np.random.default_rng(8)
    for place in (*range(120), len(blob) - 1, *rng.integers(120, len(blob), 80)):
        torn = bytearray(blob)
        torn[place] ^= 1 << int(rng.integers(8))
        with pytest.raises(FMICallException):
            instance.deSerializeFMUstate(bytes(torn))
    for wrong in (blob[:-1], blob + b"x", b""):
        with pytest.raises(FMICallException):
            instance.deSerializeFMUstate(wrong)
    expected = fmu.step(instance, 5, begin=0.03)
    instance.setFMUstate(state)
    assert np.array_equal(fmu.step(instance, 5, begin=0.03), expected)
    instance.freeFMUstate(state)
    instance.freeInstance()


@pytest.mark.parametrize(
    ("place", "count", "reason"),
    [
        (300, None, "do not fit their checksum: they were changed after they were written"),
        (None, -1, "bytes are no state of this model, which has"),
    ],
)
def test_the_sentence_that_refuses_a_state(fmu_of, place, count, reason):
    fmu, said = fmu_of("pendulum", "3.0"), []
    instance = fmu.unborn(FMU3Slave)
    instance.instantiate(logMessage=lambda *words: said.append(words[3].decode()))
    torn = bytearray(instance.serializeFMUState(instance.getFMUState()))[:count]
    if place:
        torn[place] ^= 1
    refused(instance.deserializeFMUState, bytes(torn))
    assert reason in said[-1]
    instance.freeInstance()


@pytest.mark.parametrize(
    ("on", "categories", "discards"),
    [
        (False, [], 0),
        (True, [], 1),
        (True, ["logStatusDiscard"], 1),
        (True, ["logAll"], 1),
        (True, ["logStatusError"], 0),
        (False, ["logAll"], 0),
    ],
)
def test_messages_follow_debug_logging(crank, on, categories, discards):
    said = []
    own = fmi2CallbackFunctions(logger=fmi2CallbackLoggerTYPE(lambda *a: said.append(a[3])))
    instance = crank.open(FMU2Model, start={"rod.length": 0.05}, callbacks=own)
    slopes = (ctypes.c_double * 2)()

    def silent(expected):
        said.clear()
        instance.setContinuousStates((ctypes.c_double * 2)(np.pi / 2, 0.0), 2)
        refused(instance.getDerivatives, slopes, 2)
        refused(instance.getReal, [10**6])
        assert said.count(b"logStatusDiscard") == expected
        assert said.count(b"logStatusError") == 1

    silent(0)
    texts = (ctypes.c_char_p * len(categories))(*[c.encode() for c in categories])
    instance.fmi2SetDebugLogging(instance.component, int(on), len(categories), texts)
    silent(discards)
    refused(instance.fmi2SetDebugLogging, instance.component, 1, 1, (ctypes.c_char_p * 1)(b"x"))
    silent(discards)
    instance.freeInstance()


def test_reset_repeats_bit_for_bit(fmu):
    instance = fmu.open(FMU2Slave)
    first = fmu.step(instance, 20)
    fmu.set(instance, {fmu.description.modelVariables[4].name: 0.3})
    instance.reset()
    fmu.prepare(instance)
    assert np.array_equal(fmu.step(instance, 20), first)
    instance.freeInstance()


def test_two_instances_in_two_threads(fmu):
    parameter = next(v.name for v in fmu.description.modelVariables if v.causality == "parameter")
    starts = [{}, {parameter: 0.11}]

    def run(start, rows):
        instance = fmu.open(FMU2Slave, start=start)
        rows.append(fmu.step(instance, 50))
        instance.freeInstance()

    alone, together = ([], []), ([], [])
    for start, rows in zip(starts, alone, strict=True):
        run(start, rows)
    threads = [
        threading.Thread(target=run, args=pair) for pair in zip(starts, together, strict=True)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not np.array_equal(alone[0], alone[1])
    for a, b in zip(alone, together, strict=True):
        assert np.array_equal(a, b)


def test_parameters_may_change_between_steps(crank):
    instance = crank.open(FMU2Slave)
    crank.step(instance, 3)
    before = crank.get(instance, "slider.s", "force")
    crank.set(instance, {"rod.length": 0.35, "torque": 2.0})
    q = crank.get(instance, "crank.q")[0]
    expected = 0.1 * np.cos(q) + np.sqrt(0.35**2 - (0.1 * np.sin(q)) ** 2)
    after = crank.get(instance, "slider.s", "force")
    assert after[0] == pytest.approx(expected, abs=1e-13)
    assert after[1] != before[1]
    instance.freeInstance()


def test_start_values_and_the_branch_of_the_loop(crank):
    for guess, sign in (({}, 1), ({"slider.s": -0.2, "rod.angle": 3.0}, -1)):
        instance = crank.open(FMU2Slave, upto="initialization", start={"crank.q": 1.2, **guess})
        q, place = crank.get(instance, "crank.q", "slider.s")
        reach = sign * np.sqrt(0.3**2 - (0.1 * np.sin(1.2)) ** 2)
        assert q == 1.2
        assert place == pytest.approx(0.1 * np.cos(1.2) + reach, abs=1e-13)
        instance.freeInstance()


def test_a_far_state_follows_the_branch(crank):
    instance = crank.open(FMU2Model)
    for q in (2.5, -1.0, 40.0):
        instance.setContinuousStates((ctypes.c_double * 2)(q, 1.0), 2)
        expected = 0.1 * np.cos(q) + np.sqrt(0.3**2 - (0.1 * np.sin(q)) ** 2)
        assert crank.get(instance, "slider.s")[0] == pytest.approx(expected, abs=1e-12)
    instance.freeInstance()


def test_start_values_written_again_do_not_choose_another_branch(crank):
    start = {"crank.q": 2.8, "rod.length": 0.11}
    plain = crank.open(FMU2Slave, upto="initialization", start=start)
    expected = crank.get(plain, "rod.angle", "slider.s")
    again = {"rod.angle": 0.0, "slider.s": 0.4}  # as modelDescription.xml has them
    for values in ({**start, **again}, {**start, "slider.s": -0.2, **again}):
        instance = crank.open(FMU2Slave, upto="initialization", start=values)
        assert np.array_equal(crank.get(instance, "rod.angle", "slider.s"), expected)
        instance.freeInstance()
    plain.freeInstance()


# ---- refusals ----


def test_a_wrong_guid_gives_no_instance(swing):
    with pytest.raises(Exception, match="instantiate"):
        swing.open(FMU2Slave, guid="{other}")


@pytest.mark.parametrize("kind", [FMU2Model, FMU2Slave])
def test_calls_in_the_wrong_mode(swing, kind):
    instance = swing.open(kind, upto="instantiated")
    refused(instance.exitInitializationMode)
    refused(instance.getReal, [0])
    refused(instance.terminate)
    instance.reset()
    swing.prepare(instance)
    refused(instance.enterInitializationMode)
    refused(instance.exitInitializationMode)
    refused(instance.setupExperiment)
    if kind is FMU2Slave:
        refused(swing.set, instance, {"j1.q": 0.5})
        refused(instance.doStep, 0.5, 0.1)
        refused(instance.doStep, 0.0, -0.1)
        refused(instance.doStep, 0.0, float("nan"))
        instance.doStep(0.0, 0.1)
    else:
        refused(instance.newDiscreteStates)
        refused(swing.set, instance, {"mass": 2.0})
        refused(instance.setTime, float("nan"))
        refused(instance.setContinuousStates, (ctypes.c_double * 2)(0.0, np.inf), 2)
        refused(instance.setContinuousStates, (ctypes.c_double * 1)(0.0), 1)
        refused(instance.getDerivatives, (ctypes.c_double * 3)(), 3)
    instance.terminate()
    refused(swing.set, instance, {"tau": 1.0})
    swing.get(instance, "tip.x")
    instance.freeInstance()


def test_unknown_references_and_calculated_variables(swing):
    instance = swing.open(FMU2Slave)
    before = swing.get(instance, "tau")
    refused(instance.getReal, [4_000_000_000])
    refused(instance.setReal, [4_000_000_000], [1.0])
    time = len(swing.references)  # in FMI 3.0
    refused(instance.getDirectionalDerivative, [swing.references["tip.x"]], [time], [1.0])
    refused(instance.getInteger, [0])
    refused(instance.setBoolean, [0], [True])
    refused(instance.getString, [0])
    refused(swing.set, instance, {"tip.x": 1.0})
    refused(swing.set, instance, {"der(j1.q)": 1.0})
    refused(swing.set, instance, {"tau": 5.0, "tip.x": 1.0})
    assert swing.get(instance, "tau") == before
    instance.freeInstance()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1.0, 0.0, 1e7])
def test_parameters_out_of_bounds(swing, value):
    instance = swing.open(FMU2Slave, upto="instantiated")
    refused(swing.set, instance, {"mass": value})
    refused(swing.set, instance, {"j1.q": value} if not np.isfinite(value) else {"mass": value})
    swing.prepare(instance)
    assert swing.get(instance, "mass") == [1.0]
    instance.freeInstance()


def test_a_loop_that_cannot_be_closed(crank):
    instance = crank.open(FMU2Slave, upto="initialization", start={"rod.length": 0.01})
    refused(instance.exitInitializationMode)
    refused(instance.getReal, [crank.references["slider.s"]])
    crank.set(instance, {"rod.length": 0.3})
    instance.exitInitializationMode()
    instance.freeInstance()


def test_a_start_in_a_singular_configuration(crank):
    start = {"rod.length": 0.1, "crank.q": np.pi / 2, "rod.angle": np.pi / 2, "slider.s": 0.0}
    instance = crank.open(FMU2Slave, upto="initialization", start=start)
    refused(instance.exitInitializationMode)
    instance.freeInstance()


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_a_dead_point_is_not_stepped_over(crank, tolerance):
    instance = crank.open(FMU2Slave, start={"rod.length": 0.05}, tolerance=tolerance)
    refused(crank.step, instance, 100)
    assert 0.05 < instance.getRealStatus(2) < 0.06
    instance.freeInstance()
