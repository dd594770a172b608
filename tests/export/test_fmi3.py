"""FMUs of FMI 3.0: the same model and the same core behind another face."""

import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu
from fmu_instances import Fmu3 as Fmu
from fmu_models import pendulum, slider_crank
from support.sweeps import slow

from mbs.errors import ExportError
from mbs.export.fmu.pack import FACES, write_fmu
from mbs.native import find_compiler

MODELS = {"pendulum": pendulum, "slider_crank": slider_crank}
SEED = 20260106


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmi3")
    return {
        name: Fmu(write_fmu(make(), folder / f"{name}.fmu", fmi="3.0"), folder / name)
        for name, make in MODELS.items()
    }


@pytest.fixture(params=MODELS)
def fmu(fmus, request):
    return fmus[request.param]


def test_fmpy_finds_nothing_to_complain_about(fmu):
    assert validate_fmu(str(fmu.path)) == []
    assert fmu.description.fmiVersion == "3.0"


@pytest.mark.parametrize("fmu", ["slider_crank", slow("pendulum")], indirect=True)
def test_the_sources_are_clean_c_and_all_listed(fmu):
    build = Path(fmu.folder, "sources", "buildDescription.xml").read_text()
    names = FACES["3.0"].compiled("dopri5")
    assert all(f'name="{name}"' in build for name in names)
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-I."]
    files = [name for name in names if name != "model.c"]
    command = [*find_compiler().command, *strict, "-c", *files]
    folder = Path(fmu.folder, "sources")
    answer = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr


def test_co_simulation_gives_the_bits_of_fmi_2(fmu, tmp_path):
    path = write_fmu(MODELS[fmu.path.stem](), tmp_path / "two.fmu")
    folder = fmpy.extract(str(path), str(tmp_path / "two"))
    two = fmpy.read_model_description(folder)
    names = [v.name for v in two.modelVariables if v.causality == "output"]
    other = FMU2Slave(
        guid=two.guid,
        unzipDirectory=folder,
        modelIdentifier=two.coSimulation.modelIdentifier,
        instanceName="two",
    )
    other.instantiate()
    other.setupExperiment(startTime=0.0, tolerance=1e-9)
    other.enterInitializationMode()
    other.exitInitializationMode()
    instance = fmu.running(FMU3Slave)
    references = {v.name: v.valueReference for v in two.modelVariables}
    for k in range(50):
        instance.doStep(k * 0.02, 0.02)
        other.doStep(k * 0.02, 0.02)
    there = np.array(other.getReal([references[name] for name in names]))
    assert np.array_equal(fmu.get(instance, names), there)
    assert fmu.get(instance, ["time", names[0], "time"]).tolist() == [1.0, there[0], 1.0]


def test_model_exchange_equals_co_simulation(fmu):
    options = {"stop_time": 1.0, "output_interval": 0.05, "relative_tolerance": 1e-10}
    me, cs = (
        fmpy.simulate_fmu(str(fmu.path), fmi_type=kind, **options)
        for kind in ("ModelExchange", "CoSimulation")
    )
    for name in me.dtype.names[1:]:
        assert np.allclose(me[name], cs[name], rtol=1e-6, atol=1e-6), name


def put(fmu, instance, name, value):
    if name == "time":
        instance.setTime(value)
    else:
        instance.setFloat64([fmu.references[name]], [value])


def test_derivatives_along_and_against_agree_with_differences(fmu):
    rng = np.random.default_rng(SEED)
    instance = fmu.running(FMU3Model)
    d = fmu.description
    states = [v.derivative.name for v in d.modelVariables if v.derivative is not None]
    inputs = [v.name for v in d.modelVariables if v.causality == "input"]
    known = [*states, *inputs, "time"]
    unknown = fmu.names([*d.derivatives, *d.outputs])
    rows, columns = ([fmu.references[name] for name in names] for names in (unknown, known))
    J = np.array(
        [instance.getDirectionalDerivative(rows, [c], [1.0], len(rows)) for c in columns]
    ).T
    h = 1e-6
    for k, name in enumerate(known):
        value = fmu.get(instance, [name])[0]
        ends = []
        for side in (h, -h):
            put(fmu, instance, name, value + side)
            ends.append(fmu.get(instance, unknown))
        put(fmu, instance, name, value)
        moved = np.array([n != name or n not in states for n in unknown])
        slope = (ends[0] - ends[1]) / (2 * h)
        assert np.allclose(slope[moved], J[moved, k], rtol=1e-5, atol=1e-6), name
    assert np.any(J[:, -1]) == (fmu.path.stem == "pendulum")  # a push that depends on time
    w = rng.standard_normal(len(rows))
    against = instance.getAdjointDerivative(rows, columns, list(w), len(columns))
    assert np.allclose(against, w @ J, rtol=1e-12, atol=1e-12)
    parameters = [v.valueReference for v in d.modelVariables if v.causality == "parameter"]
    P = [instance.getDirectionalDerivative(rows, [c], [1.0], len(rows)) for c in parameters]
    against = instance.getAdjointDerivative(rows, parameters, list(w), len(parameters))
    assert np.allclose(against, np.array(P) @ w, rtol=1e-11, atol=1e-12)


def test_saved_states_continue_bit_for_bit(fmu):
    instance = fmu.running(FMU3Slave)
    names = fmu.names(fmu.description.outputs)
    for k in range(10):
        instance.doStep(k * 0.01, 0.01)
    state = instance.getFMUState()
    bytes_ = instance.serializeFMUState(state)
    ends = []
    for _ in range(2):
        for k in range(10, 30):
            instance.doStep(k * 0.01, 0.01)
        ends.append(fmu.get(instance, names))
        instance.setFMUState(instance.deserializeFMUState(bytes_))
    assert np.array_equal(*ends)
    instance.freeFMUState(state)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_time_is_listed_where_it_is_a_variable_and_equations_need_it(tmp_path, version):
    path = write_fmu(pendulum(), tmp_path / "pendulum.fmu", fmi=version)
    listed = fmpy.read_model_description(path)
    needs = {
        part: {u.variable.name: [v.name for v in u.dependencies] for u in unknowns}
        for part, unknowns in [
            ("running", listed.derivatives),
            ("starting", listed.initialUnknowns),
        ]
    }
    time = ["time"] if version == "3.0" else []
    parameters = ["mass", "length", "damping", "g"]
    tuned = parameters if version == "3.0" else []  # FMI 2.0 knows inputs and states there
    assert needs["running"]["der(j1.v)"] == ["j1.q", "j1.v", "tau", *tuned, *time]
    assert needs["running"]["der(j1.q)"] == ["j1.v"]
    assert needs["starting"]["der(j1.v)"] == ["j1.q", "j1.v", "tau", *parameters, *time]
    assert needs["starting"]["tip.x"] == ["j1.q", "length"]


def test_wrong_calls_are_refused(fmu):
    with pytest.raises(Exception, match="instantiate"):
        fmu.open(FMU3Slave, token="{wrong}")
    instance = fmu.open(FMU3Slave)
    with pytest.raises(FMICallException):
        instance.doStep(0.0, 0.1)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    for refused in (
        lambda: instance.getFloat64([10**6]),
        lambda: instance.getInt32([0]),
        lambda: instance.doStep(5.0, 0.1),
        lambda: instance.doStep(0.0, float("nan")),
        lambda: instance.setFloat64([fmu.references["time"]], [1.0]),
        lambda: instance.enterEventMode(),
    ):
        with pytest.raises(FMICallException):
            refused()
    instance.doStep(0.0, 0.1)
    assert fmu.get(instance, ["time"])[0] == pytest.approx(0.1)


def test_a_version_that_is_not_written(tmp_path):
    with pytest.raises(ExportError, match=r"FMI version '1.0' is not written; use fmi='2.0' or"):
        write_fmu(pendulum(), tmp_path / "x.fmu", fmi="1.0")


def test_the_library_of_each_platform_lands_in_its_folder(tmp_path, monkeypatch):
    library = tmp_path / "library"
    library.write_bytes(b"machine code")
    wanted = []

    def built(files, flags, *, compiler, suffix, **ways):
        wanted.append((compiler, suffix))
        return library

    home = write_fmu.__globals__
    monkeypatch.setitem(home, "cross_compiler", lambda goal: goal.target)
    monkeypatch.setitem(home, "cached_library", built)
    names = ["x86_64-windows", "aarch64-linux"]
    for fmi, folders in (("2.0", ["win64", "aarch64-linux"]), ("3.0", names)):
        path = write_fmu(pendulum(), tmp_path / "x.fmu", fmi=fmi, platforms=names)
        inside = zipfile.ZipFile(path).namelist()
        assert f"binaries/{folders[0]}/damped_pendulum.dll" in inside
        assert f"binaries/{folders[1]}/damped_pendulum.so" in inside
    assert wanted[:2] == [
        ("x86_64-windows-gnu", ".dll"),
        ("aarch64-linux-gnu.2.17", ".so"),
    ]


def test_platforms_must_be_named(tmp_path):
    with pytest.raises(ExportError, match="no platform was named"):
        write_fmu(pendulum(), tmp_path / "x.fmu", platforms=[])
