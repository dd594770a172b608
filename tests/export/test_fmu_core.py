import ctypes
import dataclasses
import struct
import subprocess
import threading
import zipfile
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.validation import validate_fmu
from fmu_instances import Fmu
from fmu_models import clapper, pendulum, slider_crank

from mbs.errors import CompilerError, ExportError
from mbs.export.fmu import fmi2_xml
from mbs.export.fmu.description import State, Variable
from mbs.export.fmu.faces import FACES
from mbs.export.fmu.pack import write_fmu
from mbs.native import find_compiler
from mbs.solvers import integrate

SOURCES = FACES["2.0"].compiled("dopri5")
MODELS = {"pendulum": pendulum, "slider_crank": slider_crank, "clapper": clapper}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    return {
        name: Fmu(write_fmu(make(), folder / f"{name}.fmu"), folder / name)
        for name, make in MODELS.items()
    }


@pytest.fixture(params=MODELS)
def fmu(fmus, request):
    return fmus[request.param]


@pytest.fixture
def crank(fmus):
    return fmus["slider_crank"]


@pytest.fixture
def swing(fmus):
    return fmus["pendulum"]


def crank_reference(times, torque=0.1, **parameters):
    """The slider-crank without a closure to solve: the rod angle is an arc sine."""
    model = slider_crank()
    t, x = ca.SX.sym("t"), ca.SX.sym("x", 2)
    values = [parameters.get(v.name, v.start) for v in model.parameters]
    angle = ca.asin(values[0] / values[1] * ca.sin(x[0]))
    z = ca.vertcat(angle, values[0] * ca.cos(x[0]) + values[1] * ca.cos(angle))
    xdot, _ = model.rhs(t, x, z, torque, values)
    return integrate(ca.Function("f", [t, x], [xdot]), [0.3, 6.0], times, rtol=1e-12, atol=1e-12)


# ---- the file ----


def test_fmpy_finds_nothing_to_complain_about(fmu):
    assert validate_fmu(str(fmu.path)) == []


def test_equal_models_give_equal_files(fmu, tmp_path):
    name = fmu.path.stem
    assert write_fmu(MODELS[name](), tmp_path / "again.fmu").read_bytes() == fmu.path.read_bytes()


def test_code_and_description_are_generated_once(tmp_path, monkeypatch):
    calls = []
    for home, name in ((write_fmu.__globals__, "source"), (vars(fmi2_xml), "model_description")):
        original = home[name]

        def counted(*arguments, name=name, original=original):
            calls.append(name)
            return original(*arguments)

        monkeypatch.setitem(home, name, counted)
    write_fmu(pendulum(), tmp_path / "once.fmu")
    assert sorted(calls) == ["model_description", "source"]


def test_what_is_inside(swing):
    names = zipfile.ZipFile(swing.path).namelist()
    assert "documentation/index.html" in names
    assert any(name.startswith("binaries/") for name in names)
    assert all(f"sources/{name}" in names for name in SOURCES)
    page = Path(swing.folder, "documentation", "index.html").read_text()
    assert "the vertical &lt;down&gt;." in page
    assert swing.description.coSimulation.modelIdentifier == "damped_pendulum"
    assert swing.description.defaultExperiment.stopTime == "3.0"


def test_units_and_bounds(swing):
    variables = {v.name: v for v in swing.description.modelVariables}
    angle, mass = variables["j1.q"], variables["mass"]
    assert (angle.unit, angle.displayUnit, angle.causality) == ("rad", "deg", "output")
    assert (float(mass.min), float(mass.max), mass.variability) == (1e-6, 1e6, "tunable")
    units = {u.name: u for u in swing.description.unitDefinitions}
    torque = units["N.m"].baseUnit
    assert (torque.kg, torque.m, torque.s) == (1, 2, -2)
    assert variables["der(j1.q)"].derivative is angle


def test_dependencies_pass_through_the_loop(crank):
    depends = {
        u.variable.name: {v.name for v in u.dependencies}
        for u in [*crank.description.outputs, *crank.description.derivatives]
    }
    assert depends["der(crank.q)"] == {"crank.v"}
    assert depends["der(crank.v)"] == {"crank.q", "crank.v", "torque"}
    assert depends["crank.q"] == {"crank.q"}
    initial = {u.variable.name: u for u in crank.description.initialUnknowns}
    assert set(initial) == {"der(crank.q)", "der(crank.v)", "slider.v", "force"}
    assert "rod.length" in {v.name for v in initial["force"].dependencies}


def test_the_sources_are_clean_c(fmu, tmp_path):
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-I."]
    names = [name for name in SOURCES if name != "model.c"]
    command = [*find_compiler().command, *strict, "-c", *names]
    answer = subprocess.run(
        command, cwd=Path(fmu.folder, "sources"), capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr


@pytest.mark.parametrize(
    ("target", "message"),
    [("no/such/x.fmu", "does not exist"), ("", "is a folder; give the name of a file")],
)
def test_a_target_that_cannot_be_written_is_refused_before_compiling(
    tmp_path, monkeypatch, target, message
):
    monkeypatch.setitem(
        write_fmu.__globals__, "cached_library", lambda *_, **__: pytest.fail("compiled")
    )
    with pytest.raises(ExportError, match=message):
        write_fmu(pendulum(), tmp_path / target)


def test_a_failing_compiler_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "x.fmu"
    path.write_text("old")

    def refuse(*_):
        raise CompilerError("no C compiler was found")

    monkeypatch.setitem(write_fmu.__globals__, "cached_library", refuse)
    with pytest.raises(CompilerError):
        write_fmu(pendulum(), path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": ""}, "no name"),
        ({"inputs": ()}, "rhs has inputs of sizes"),
        ({"inputs": (Variable(name="j1.q"),)}, "two variables are called 'j1.q'"),
        ({"inputs": (Variable(name="u", unit="lb"),)}, "unit 'lb'; use one of"),
        ({"inputs": (Variable(name="u", start=float("nan")),)}, "u starts at nan"),
        ({"states": (State(name="a", nominal=0.0), State(name="b"))}, "nominal 0.0"),
        ({"dependents": (Variable(name="z"),)}, "rhs has inputs"),
        ({"closure": slider_crank().closure}, "0 dependent coordinates need no closure"),
        ({"tolerance": 0.0}, "tolerance 0.0 must be positive"),
    ],
)
def test_a_description_that_contradicts_itself(change, message):
    with pytest.raises(ExportError, match=message):
        dataclasses.replace(pendulum(), **change)


def test_names_that_c_would_trip_over(tmp_path):
    model = pendulum()
    odd = Variable(name='ä "quoted" \\ ??/ <é>', unit="N.m", description='"a" < b & c')
    path = write_fmu(
        dataclasses.replace(model, name="1 möbius/arm", inputs=(odd,)), tmp_path / "odd.fmu"
    )
    assert validate_fmu(str(path)) == []
    odd_fmu = Fmu(path, tmp_path / "odd")
    instance = odd_fmu.open(FMU2Slave)
    odd_fmu.set(instance, {odd.name: 1.0})
    assert odd_fmu.get(instance, odd.name) == [1.0]
    instance.freeInstance()


# ---- numbers ----


def test_co_simulation_equals_the_reference(crank):
    instance = crank.open(FMU2Slave, tolerance=1e-11)
    times = np.linspace(0, 2, 201)
    rows = crank.step(instance, 200)
    assert np.max(np.abs(rows[:, 0] - crank_reference(times)[1:, 0])) < 1e-7
    angle, place = crank.get(instance, "rod.angle", "slider.s")
    q = rows[-1, 0]
    assert 0.1 * np.sin(q) - 0.3 * np.sin(angle) == pytest.approx(0, abs=1e-12)
    assert 0.1 * np.cos(q) + 0.3 * np.cos(angle) == pytest.approx(place, abs=1e-12)
    instance.freeInstance()


def test_model_exchange_equals_co_simulation(fmu):
    options = {"stop_time": 1.0, "relative_tolerance": 1e-10, "output_interval": 0.1}
    me, cs = (
        fmpy.simulate_fmu(str(fmu.path), fmi_type=kind, record_events=False, **options)
        for kind in ("ModelExchange", "CoSimulation")
    )
    for name in cs.dtype.names[1:]:
        assert me[name][-1] == pytest.approx(cs[name][-1], rel=1e-5, abs=1e-6)


def test_derivatives_follow_every_change(swing):
    instance = swing.open(FMU2Model)
    model = pendulum()
    x, u, p = np.array([0.7, -0.4]), 0.3, np.array([2.0, 0.4, 0.1, 9.0])
    instance.enterEventMode()
    names = [v.name for v in model.parameters]
    swing.set(instance, dict(zip(names, p, strict=True)))
    instance.enterContinuousTimeMode()
    for t in (0.2, 0.9):
        instance.setTime(t)
        for angle in (0.7, 1.1):
            x[0] = angle
            instance.setContinuousStates((ctypes.c_double * 2)(*x), 2)
            for u in (0.3, -0.2):
                swing.set(instance, {"tau": u})
                expected = [v.full().ravel() for v in model.rhs(t, x, [], u, p)]
                found = (ctypes.c_double * 2)()
                instance.getDerivatives(found, 2)
                assert np.array_equal(found, expected[0])
                assert np.array_equal(swing.get(instance, "tip.x", "tip.y"), expected[1])
    instance.freeInstance()


def test_directional_derivatives_are_total(fmu):
    instance = fmu.open(FMU2Model, upto="event")
    variables = fmu.description.modelVariables
    known = [
        v.name for v in variables if v.causality in ("input", "parameter") or v.initial == "exact"
    ]
    unknown = [v.name for v in variables if v.initial in (None, "calculated", "approx")]
    unknown = [n for n in unknown if n not in known]
    for name in known:
        value = fmu.get(instance, name)[0]
        h = 1e-6 * (1 + abs(value))
        fmu.set(instance, {name: value + h})
        high = fmu.get(instance, *unknown)
        fmu.set(instance, {name: value - h})
        low = fmu.get(instance, *unknown)
        fmu.set(instance, {name: value})
        references = [fmu.references[n] for n in unknown]
        exact = instance.getDirectionalDerivative(references, [fmu.references[name]], [1.0])
        assert exact == pytest.approx((high - low) / (2 * h), rel=1e-5, abs=1e-6), name
    with pytest.raises(FMICallException):
        instance.getDirectionalDerivative([fmu.references[known[-1]]], [0], [1.0])
    instance.freeInstance()


def test_communication_steps_do_not_matter(fmu):
    ends = []
    for steps in (1, 7, 500):
        instance = fmu.open(FMU2Slave, tolerance=1e-9)
        ends.append(fmu.step(instance, steps, 1.0 / steps)[-1])
        instance.freeInstance()
    assert ends[0] == pytest.approx(ends[2], rel=1e-5, abs=1e-6)
    assert ends[1] == pytest.approx(ends[2], rel=1e-5, abs=1e-6)


# ---- life ----


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


def test_bytes_that_are_no_state_are_refused(fmu):
    instance = fmu.open(FMU2Slave)
    fmu.step(instance, 3)
    state = instance.getFMUstate()
    blob = instance.serializeFMUstate(state)
    values = fmu.get(instance, *[v.name for v in fmu.description.modelVariables][:2])
    at = len(blob.split(values.tobytes())[0])  # after the flags, time and tolerance come the values
    flags, time, tolerance = at - 40, at - 16, at - 8
    assert struct.unpack_from("=5i", blob, flags) == (16, 1, 0, 1, 0)
    assert struct.unpack_from("=2d", blob, time)[0] == pytest.approx(0.03)
    parameter = at + 8 * next(
        v.valueReference for v in fmu.description.modelVariables if v.causality == "parameter"
    )
    wrong = [(flags, "=i", x) for x in (0, 3, 4, 8, 64, -1)]
    wrong += [(flags + 4 * k, "=i", 2) for k in (2, 3, 4)]
    wrong += [(time, "=d", np.nan), (tolerance, "=d", np.inf), (tolerance, "=d", 0.0)]
    wrong += [(at, "=d", np.nan), (parameter, "=d", -1.0)]
    wrong += [(len(blob) - 8 * k - 8, "=d", np.nan) for k in range(8, 12)]
    for place, form, value in wrong:
        torn = bytearray(blob)
        struct.pack_into(form, torn, place, value)
        with pytest.raises(FMICallException):
            instance.deSerializeFMUstate(bytes(torn))
    instance.freeFMUstate(instance.deSerializeFMUstate(blob))
    instance.freeFMUstate(state)
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


def refused(call, *arguments):
    with pytest.raises(FMICallException):
        call(*arguments)


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


def test_a_start_in_a_singular_posture(crank):
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
