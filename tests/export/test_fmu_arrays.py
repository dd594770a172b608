"""FMUs 3.0 whose positions, velocities, accelerations and efforts are arrays."""

import ctypes
import xml.etree.ElementTree as ET
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu
from fmu_instances import Fmu3, refused
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ExportError, ModelError
from mbs.export.fmu.options import FmuOptions
from mbs.export.fmu.system_fmu import fmu_model

NAMES = ("puma560", "four_bar", "scara")
OPTIONS = {"stop_time": 0.4, "output_interval": 0.1, "relative_tolerance": 1e-8}
INTERFACES = pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    """The FMU with arrays and that without, of each mechanism."""
    folder, found = tmp_path_factory.mktemp("arrays"), {}
    for name in NAMES:
        system = catalogue_system(name)
        found[name] = tuple(
            Fmu3(
                mbs.export.fmu(system, folder / f"{name}{k}.fmu", fmi="3.0", arrays=bool(k)),
                folder / f"{name}{k}",
            )
            for k in (1, 0)
        )
    return found


@pytest.fixture(params=NAMES)
def pair(pairs, request):
    return pairs[request.param]


def scalars(fmu):
    """Names of the scalar variables behind each array, in its order."""
    suffixes = {"q": ".q", "v": ".v", "a": ".a", "tau": ".tau"}
    described = {v.name: v.description for v in fmu.description.modelVariables if v.shape}
    found = {}
    for name, text in described.items():
        suffix = suffixes.get(name.partition("_")[0])
        if suffix and not name.endswith("_solved"):
            found[name] = [f"{joint}{suffix}" for joint in text.split(" of ")[-1].split(", ")]
    return found


def test_the_description_is_valid_and_lists_arrays(pair):
    fmu, plain = pair
    assert validate_fmu(str(fmu.path)) == []
    d = fmu.description
    shapes = {v.name: v.shape for v in d.modelVariables if v.shape}
    n = plain.description.numberOfContinuousStates // 2
    assert {k: shapes[k] for k in ("q", "v", "der(q)", "der(v)", "a")} == dict.fromkeys(
        ("q", "v", "der(q)", "der(v)", "a"), (n,)
    )
    assert d.numberOfContinuousStates == 2 * n
    wanted = ["der(state)"] if "state" in shapes else ["der(q)", "der(v)"]  # where loops are closed
    assert [u.variable.name for u in d.derivatives] == wanted
    assert [v.name for v in d.modelVariables if v.derivative is not None] == wanted
    assert "q" in [u.variable.name for u in d.outputs]


@INTERFACES
def test_fmpy_gets_what_it_gets_without_arrays(pair, kind):
    fmu, _ = pair
    found, expected = (fmpy.simulate_fmu(str(f.path), fmi_type=kind, **OPTIONS) for f in pair)
    for name, columns in scalars(fmu).items():
        if name in found.dtype.names:
            table = np.column_stack([expected[column] for column in columns])
            assert np.array_equal(found[name], table), name


@INTERFACES
def test_fmpy_sets_an_array_of_inputs_and_of_starts(pairs, kind):
    fmu, plain = pairs["puma560"]
    push, start = np.linspace(1.0, 2.0, 6), np.linspace(0.1, 0.6, 6)
    given = np.array([(0.0, push), (1.0, push)], dtype=[("time", float), ("tau", float, (6,))])
    found = fmpy.simulate_fmu(
        str(fmu.path), fmi_type=kind, input=given, start_values={"q": start}, **OPTIONS
    )
    values = {
        **dict(zip(scalars(fmu)["q"], start, strict=True)),
        **dict(zip(scalars(fmu)["tau"], push, strict=True)),
    }
    expected = fmpy.simulate_fmu(str(plain.path), fmi_type=kind, start_values=values, **OPTIONS)
    table = np.column_stack([expected[column] for column in scalars(fmu)["q"]])
    assert np.abs(found["q"] - table).max() < 1e-8  # fmpy interpolates, with rounding
    assert np.abs(table[-1] - start).max() > 0.1


def test_derivatives_take_arrays_as_they_take_scalars(pair):
    fmu, plain = pair
    one, other = fmu.running(FMU3Model), plain.running(FMU3Model)
    rng = np.random.default_rng(5)
    of, by = [n for n in scalars(fmu) if n.startswith("a")], ["q", "v", "tau"]
    n_of, n_by = (sum(len(scalars(fmu)[n]) for n in names) for names in (of, by))
    refs = [[f.references[n] for n in names] for f, names in ((fmu, of), (fmu, by))]
    plainly = [
        [plain.references[s] for name in names for s in scalars(fmu)[name]] for names in (of, by)
    ]
    seed = list(rng.normal(size=n_by))
    assert one.getDirectionalDerivative(*refs, seed, n_of) == other.getDirectionalDerivative(
        *plainly, seed, n_of
    )
    seed = list(rng.normal(size=n_of))
    assert one.getAdjointDerivative(*refs, seed, n_by) == other.getAdjointDerivative(
        *plainly, seed, n_by
    )
    refused(one.getDirectionalDerivative, *refs, [1.0], n_of)
    for each in (one, other):
        each.freeInstance()


def output_rates(instance, references, count):
    """First derivatives of outputs; fmpy's own call takes scalars alone."""
    values, n = (ctypes.c_double * count)(), len(references)
    given, orders = (ctypes.c_uint32 * n)(*references), (ctypes.c_int32 * n)(*[1] * n)
    instance.fmi3GetOutputDerivatives(instance.component, given, n, orders, values, count)
    return list(values)


def test_calls_count_elements(pairs):
    fmu, _ = pairs["puma560"]
    instance = fmu.open(FMU3Slave)
    tau, q = [fmu.references["tau"]], [fmu.references["q"]]
    instance.setFloat64(tau, list(range(6)))
    refused(instance.setFloat64, tau, [1.0])
    refused(instance.setFloat64, tau, [1.0] * 7)
    refused(instance.setFloat64, [tau[0] + 1], [1.0])  # an element has no reference of its own
    refused(instance.setFloat64, [*tau, *q], [0.0] * 11 + [np.nan])  # all of it or nothing
    instance.enterInitializationMode(tolerance=1e-9)
    instance.exitInitializationMode()
    assert instance.getFloat64(tau, nValues=6) == [0, 1, 2, 3, 4, 5]
    time = [fmu.references["time"]]
    assert instance.getFloat64([*time, *tau, *time], nValues=8) == [0, 0, 1, 2, 3, 4, 5, 0]
    refused(instance.getFloat64, tau)
    instance.doStep(0.0, 0.01)
    v, a = (instance.getFloat64([fmu.references[n]], nValues=6) for n in ("v", "a"))
    assert output_rates(instance, [q[0], fmu.references["v"]], 12) == [*v, *a]
    instance.freeInstance()


def test_dependencies_are_those_of_the_elements(pairs):
    fmu, _ = pairs["puma560"]
    d = fmu.description
    (rate,) = (u for u in d.derivatives if u.variable.name == "der(v)")
    assert [v.name for v in rate.dependencies] == ["q", "v", "tau"]
    (rate,) = (u for u in d.derivatives if u.variable.name == "der(q)")
    assert [v.name for v in rate.dependencies] == ["v"]
    assert rate.dependenciesKind == ["constant"]


def test_joints_that_turn_and_slide_share_no_unit(pairs):
    units = {
        name: {v.name: v.unit for v in pairs[name][0].description.modelVariables}
        for name in ("puma560", "scara")
    }
    assert (units["puma560"]["q"], units["puma560"]["tau"]) == ("rad", "N.m")
    assert (units["scara"]["q"], units["scara"]["tau"]) == (None, None)


def test_elements_are_named_in_the_pages_and_results(tmp_path):
    system = catalogue_system("four_bar")
    path = mbs.export.fmu(
        system, tmp_path / "x.fmu", fmi="3.0", arrays=True, reference=True, stop_time=0.1
    )
    with zipfile.ZipFile(path) as archive:
        page = archive.read("documentation/index.html").decode()
        assert ">q[1]<" in page.replace("</td>", "<")
        (results,) = (n for n in archive.namelist() if n.endswith("results.csv"))
        assert '"q[1]"' in archive.read(results).decode().splitlines()[0]
        root = ET.fromstring(archive.read("modelDescription.xml"))
    assert root.get("variableNamingConvention") == "structured"
    assert fmu_model(system).terminals
    model = fmu_model(system, FmuOptions(arrays=True))
    assert not model.terminals  # they name variables of single joints


def test_fmi_2_has_no_arrays(tmp_path):
    system = catalogue_system("four_bar")
    with pytest.raises(ExportError, match=r"four_bar: arrays are variables of FMI 3\.0, and fmi"):
        mbs.export.fmu(system, tmp_path / "x.fmu", arrays=True)


def test_a_parameter_that_is_called_as_an_array_is_refused(tmp_path):
    m = mbs.Mechanism("m", gravity=(0, -9.81, 0))
    box = m.add(mbs.components.Box("b", length=mbs.Parameter("a", 1.0), width=0.1, mass=1.0))
    m.connect(m.world, mbs.components.Revolute("j", axis="z", actuated=True), box)
    with pytest.raises(ExportError, match="FMU m: two variables are called 'a'; rename one"):
        mbs.export.fmu(m.assemble(), tmp_path / "x.fmu", fmi="3.0", arrays=True)


@INTERFACES
def test_our_own_reader_names_elements(pairs, kind):
    """What is not given of an array keeps its start value, of the description or of `start`."""
    fmu, plain = pairs["puma560"]
    q, tau = scalars(fmu)["q"], scalars(fmu)["tau"]
    wave = (np.linspace(0, 0.5, 6), np.sin(np.arange(6.0)))
    options = {"kind": kind, "step": 0.1, "tolerance": 1e-9, "quiet": True}
    found = mbs.simulate.fmu(
        fmu.path,
        0.5,
        start={"q[2]": 0.3, "tau[3]": 1.5},
        inputs={"tau[1]": 2.0, "tau[6]": wave},
        **options,
    )
    expected = mbs.simulate.fmu(
        plain.path,
        0.5,
        start={q[1]: 0.3, tau[2]: 1.5},
        inputs={tau[0]: 2.0, tau[5]: wave},
        **options,
    )
    for k in range(6):
        assert np.allclose(found[f"q[{k + 1}]"], expected[q[k]], rtol=0, atol=1e-8)
        assert np.array_equal(found[f"tau[{k + 1}]"], expected[tau[k]])
    assert found["tau[3]"][-1] == 1.5


def test_our_own_reader_refuses_a_whole_array(pairs):
    fmu, _ = pairs["puma560"]
    for arguments in ({"start": {"q": 0.3}}, {"inputs": {"tau": 1.0}}):
        with pytest.raises(ModelError, match=r"variable '(q|tau)' cannot be set here; .*\[1\]"):
            mbs.simulate.fmu(fmu.path, 0.1, quiet=True, **arguments)
