"""What an FMU holds, and the numbers that it gives."""

import ctypes
import dataclasses
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.validation import validate_fmu
from fmu_instances import Fmu
from fmu_models import MODELS, crank_reference, pendulum, slider_crank
from support.sweeps import slow

from mbs.errors import CompilerError, ExportError
from mbs.export.fmu.description import FmuState, FmuVariable
from mbs.export.fmu.pack import FACES, write_fmu
from mbs.native import find_compiler

SOURCES = FACES["2.0"].compiled("dopri5")


# ---- the file ----


def test_fmpy_finds_nothing_to_complain_about(fmu):
    assert validate_fmu(str(fmu.path)) == []


def test_equal_models_give_equal_files(fmu, tmp_path):
    name = fmu.path.stem
    assert write_fmu(MODELS[name](), tmp_path / "again.fmu").read_bytes() == fmu.path.read_bytes()


def test_code_and_description_are_generated_once(tmp_path, monkeypatch):
    calls = []
    home = write_fmu.__globals__
    for name in ("source", "model_description"):
        original = home[name]

        def counted(*arguments, name=name, original=original, **options):
            calls.append(name)
            return original(*arguments, **options)

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


@pytest.mark.parametrize(
    "name", ["stopped_crank", *map(slow, ("pendulum", "slider_crank", "clapper"))]
)
def test_the_sources_are_clean_c(fmu_of, name):
    """Those of a loop with events contain most of what the preprocessor selects."""
    fmu = fmu_of(name)
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

    def refuse(*_, **__):
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
        ({"inputs": (FmuVariable(name="j1.q"),)}, "two variables are called 'j1.q'"),
        ({"inputs": (FmuVariable(name="time"),)}, "'time' is the name of time itself; use another"),
        ({"inputs": (FmuVariable(name="u", unit="lb"),)}, "unit 'lb'; use one of"),
        ({"inputs": (FmuVariable(name="u", start=float("nan")),)}, "u starts at nan"),
        ({"states": (FmuState(name="a", nominal=0.0), FmuState(name="b"))}, "nominal 0.0"),
        ({"dependents": (FmuVariable(name="z"),)}, "rhs has inputs"),
        ({"closure": slider_crank().closure}, "0 dependent coordinates need no closure"),
        ({"tolerance": 0.0}, "tolerance 0.0 must be positive"),
    ],
)
def test_a_description_that_contradicts_itself(change, message):
    with pytest.raises(ExportError, match=message):
        dataclasses.replace(pendulum(), **change)


def test_names_that_c_would_trip_over(tmp_path):
    model = pendulum()
    odd = FmuVariable(name='ä "quoted" \\ ??/ <é>', unit="N.m", description='"a" < b & c')
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
    modes = [v.name for v in variables if v.type == "Integer"]
    unknown = [n for n in unknown if n not in (*known, *modes)]
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
