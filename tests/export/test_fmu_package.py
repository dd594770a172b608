"""An FMU as a file: what is in it, reference results, and that it is whole or not there."""

import csv
import dataclasses
import errno
import hashlib
import io
import re
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_models import pendulum, slider_crank
from fmu_structures import ball

import mbs
from mbs.errors import ExportError
from mbs.export.fmu.description import Documentation, FmuModel, FmuState, FmuVariable
from mbs.export.fmu.documentation import MBS
from mbs.export.fmu.pack import write_fmu
from mbs.export.fmu.reference import FOLDER, reference_files
from mbs.solvers import integrate
from mbs.view.drawing import Drawing, Stroke

DRAWN = Documentation(drawing=Drawing((Stroke("link", "link0", ((0.0, 0.0), (100.0, 0.0))),)))


def model():
    return dataclasses.replace(pendulum(), about=DRAWN)


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def written(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("package") / "pendulum.fmu"
    write_fmu(model(), path, fmi=request.param, reference=True)
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    return request.param, path, files


def table_of(files, name="results.csv"):
    rows = list(csv.reader(io.StringIO(files[f"{FOLDER}/{name}"].decode())))
    return rows[0], np.array(rows[1:], float)


def column(files, name):
    names, table = table_of(files)
    return table[:, names.index(name)]


def oscillator(**changes):
    """x'' = -4 x + u, from x = 1, with u = 2."""
    t, x, z, u, p = (ca.SX.sym(n, k) for n, k in zip("txzup", (1, 2, 0, 1, 1), strict=True))
    values = {
        "name": "oscillator",
        "states": (FmuState(name="x", start=1.0, output=True), FmuState(name="v")),
        "inputs": (FmuVariable(name="u", start=2.0),),
        "outputs": (FmuVariable(name="shifted"),),
        "parameters": (FmuVariable(name="k", start=4.0),),
        "rhs": ca.Function("rhs", [t, x, z, u, p], [ca.vertcat(x[1], u - p * x[0]), x[0] + t]),
        "stop_time": 3.0,
        "step_size": 0.25,
    }
    return FmuModel(**values | changes)


def test_reference_results_are_those_of_the_exact_solution():
    files = reference_files(oscillator())
    names, table = table_of(files)
    assert names == ["time", "x", "shifted"]
    time = table[:, 0]
    assert np.array_equal(time, 0.25 * np.arange(13))
    exact = 0.5 + 0.5 * np.cos(2 * time)
    assert np.abs(column(files, "x") - exact).max() < 1e-8
    assert np.abs(column(files, "shifted") - exact - time).max() < 1e-8
    names, inputs = table_of(files, "inputs.csv")
    assert names == ["time", "u"]
    assert inputs.tolist() == [[0, 2], [3, 2]]


@pytest.mark.parametrize("solver", ["rodas", "rk4"])
def test_stiff_and_fixed_step_models_have_references_too(solver):
    files = reference_files(oscillator(solver=solver))
    time = column(files, "time")
    assert np.abs(column(files, "x") - 0.5 - 0.5 * np.cos(2 * time)).max() < 1e-7


def test_reference_results_go_through_events():
    """Fall from 1 m, bounce to a quarter of the height, count the bounces."""
    parameters = (*ball().parameters[:2], FmuVariable(name="drag", unit="1/s", start=0.0))
    files = reference_files(dataclasses.replace(ball(), parameters=parameters))
    time, g = column(files, "time"), 9.81
    first = np.sqrt(2 / g)
    since = time - first
    exact = np.where(since < 0, 1 - g * time**2 / 2, g * first / 2 * since - g * since**2 / 2)
    before = time < 2 * first - 1e-6
    assert np.abs(column(files, "h") - exact)[before].max() < 1e-8
    assert np.array_equal(column(files, "count")[before], (since >= 0)[before])
    assert column(files, "count")[-1] >= 2


def test_reference_results_follow_closed_loops():
    """The rod angle is that of the triangle at every time."""
    model = dataclasses.replace(slider_crank(), stop_time=1.0)
    files = reference_files(model)
    p = [v.start for v in model.parameters]
    t, x = ca.SX.sym("t"), ca.SX.sym("x", 2)
    phi = ca.asin(p[0] * ca.sin(x[0]) / p[1])
    z = ca.vertcat(phi, p[0] * ca.cos(x[0]) + p[1] * ca.cos(phi))
    rate, y = model.rhs(t, x, z, model.inputs[0].start, ca.DM(p))
    rhs = ca.Function("rhs", [t, x, ca.SX.sym("p", 0)], [rate])
    time = column(files, "time")
    motion = integrate(rhs, [0.3, 6.0], time, rtol=1e-11, atol=1e-11)
    shown = ca.Function("y", [x], [y])
    assert np.abs(column(files, "crank.q") - motion[:, 0]).max() < 1e-8
    force = [float(shown(row)[1]) for row in motion]
    assert np.abs(column(files, "force") - force).max() < 1e-6


def test_a_motion_that_ends_early_has_no_reference():
    t, x, z, u, p = (ca.SX.sym(n, k) for n, k in zip("txzup", (1, 1, 0, 0, 0), strict=True))
    burst = FmuModel(
        name="burst",
        states=(FmuState(name="x", start=1.0, output=True),),
        rhs=ca.Function("rhs", [t, x, z, u, p], [x**2, ca.SX(0, 1)]),
        stop_time=3.0,
    )
    with pytest.raises(ExportError, match="FMU burst: the reference results do not reach 3 s"):
        reference_files(burst)


def test_a_start_beyond_a_stop_has_no_reference():
    states = (FmuState(name="h", unit="m", start=-1.0, output=True), ball().states[1])
    with pytest.raises(ExportError, match="start values are beyond floor"):
        reference_files(dataclasses.replace(ball(), states=states))


def test_the_manifest_names_every_file_with_its_checksum(written):
    _, _, files = written
    prefix = "{http://fmi-standard.org/fmi-ls-manifest}"
    root = ET.fromstring(files[f"{FOLDER}/fmi-ls-manifest.xml"])
    assert root.tag == "fmiReferences"
    assert root.get(f"{prefix}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    inside = {name.removeprefix(f"{FOLDER}/") for name in files if name.startswith(FOLDER)}
    assert {r.get("source") for r in root} == inside - {"fmi-ls-manifest.xml"}
    for related in root:
        content = files[f"{FOLDER}/{related.get('source')}"]
        assert related.get("checksum") == hashlib.sha3_256(content).hexdigest()
    experiment = ET.fromstring(files[f"{FOLDER}/default.exp"]).find("Experiment")
    assert float(experiment.find("TransientSimulation").get("stopTime")) == model().stop_time
    for part in ("Stimuli", "References"):
        assert experiment.find(part).get("source") in inside


def test_an_importer_gets_the_reference_results(written):
    _, path, files = written
    got = fmpy.simulate_fmu(str(path), fmi_type="CoSimulation", output_interval=0.01, stop_time=3.0)
    assert np.abs(got["tip.x"] - column(files, "tip.x")).max() < 1e-6
    assert np.abs(got["j1.q"] - column(files, "j1.q")).max() < 1e-6


def test_icon_and_terminals_are_where_the_standard_wants_them(written):
    fmi, _, files = written
    picture = "model.png" if fmi == "2.0" else "terminalsAndIcons/icon.png"
    assert files[picture].startswith(b"\x89PNG")
    own = {name for name in files if name.startswith("terminalsAndIcons/")}
    wanted = {"terminalsAndIcons.xml", "icon.png", "icon.svg"} if fmi == "3.0" else set()
    assert own == {f"terminalsAndIcons/{name}" for name in wanted}


def test_licences_lie_beside_the_documentation(written):
    _, _, files = written
    folder = "documentation/licenses"
    assert files[f"{folder}/mbs.txt"].decode() == MBS
    root = Path(__file__).parents[2]
    assert (root / "LICENSE").read_text() == MBS
    standard = files[f"{folder}/fmi-standard.txt"].decode()
    assert "2-Clause BSD" in standard
    assert "Redistributions of source code" in standard
    overview = files[f"{folder}/license.txt"].decode()
    assert "mbs.txt" in overview
    assert "fmi-standard.txt" in overview


def test_every_source_and_every_header_is_there(written):
    fmi, _, files = written
    sources = {n.removeprefix("sources/"): t for n, t in files.items() if n.startswith("sources/")}
    listed = ET.fromstring(files["modelDescription.xml"]).findall("ModelExchange/SourceFiles/File")
    if fmi == "3.0":
        build = ET.fromstring(sources["buildDescription.xml"])
        listed = build.findall("BuildConfiguration/SourceFileSet/SourceFile")
    names = {element.get("name") for element in listed}
    assert names == {name for name in sources if name.endswith(".c")}
    included = {
        name
        for text in sources.values()
        for name in re.findall(r'^\s*#\s*include\s+"([^"]+)"', text.decode(), re.MULTILINE)
    }
    others = {"rodas.h", "rk4.h"}  # of solvers that this one was not exported with
    assert "dopri5.h" in included
    assert included - others <= set(sources)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_the_description_says_whose_the_model_is(fmi, tmp_path):
    said = {
        "description": 'A <pendulum> & "more"',
        "author": "Ada Lovelace, 'Example' & Sons",
        "version": "1.2",
        "copyright": "(c) 2026 Müller",
        "license": "https://example.org/l?a=1&b=2",
    }
    system = mbs.load("simple_pendulum").assemble()
    path = mbs.export.fmu(system, tmp_path / "x.fmu", fmi=fmi, **said)
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    assert {name: root.get(name) for name in said} == said
    assert root.get("guid" if fmi == "2.0" else "instantiationToken").startswith("{")
    plain = mbs.export.fmu(system, tmp_path / "plain.fmu", fmi=fmi)
    with zipfile.ZipFile(plain) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    assert root.get("description") == system.report().splitlines()[0]
    assert not {"author", "version", "copyright", "license"} & set(root.attrib)


@pytest.mark.parametrize("wrong", ["two\nlines", "bell\a", 3, None, "\ud800"])
@pytest.mark.parametrize("what", ["author", "description"])
def test_texts_that_no_description_can_hold(what, wrong, tmp_path):
    system = mbs.load("four_bar").assemble()
    if what == "description" and not wrong:
        pytest.skip("then it is that of the report")
    with pytest.raises(ExportError, match=f"four_bar: {what} is .*; give a line of printable char"):
        mbs.export.fmu(system, tmp_path / "x.fmu", **{what: wrong})
    assert not list(tmp_path.iterdir())


def test_only_what_the_version_can_call_is_generated(written):
    fmi, _, files = written
    for name in ("sources/model.c", "sources/model.h"):
        assert (b"mbs_adjoint" in files[name]) == (fmi == "3.0")
        assert b"mbs_tangent" in files[name]


def test_other_descriptions_are_valid(written):
    """By the schemas of the standard, which fmpy has with it."""
    xml = pytest.importorskip("lxml.etree")
    fmi, _, files = written
    if fmi == "2.0":
        pytest.skip("FMI 2.0 has none")
    folder = Path(fmpy.__file__).parent / "schema" / "fmi3"
    for name, schema in (
        ("sources/buildDescription.xml", "fmi3BuildDescription.xsd"),
        ("terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons.xsd"),
    ):
        xml.XMLSchema(xml.parse(str(folder / schema))).assertValid(xml.fromstring(files[name]))


def test_equal_models_give_equal_files(written, tmp_path):
    fmi, path, _ = written
    again = write_fmu(model(), tmp_path / "again.fmu", fmi=fmi, reference=True)
    assert again.read_bytes() == path.read_bytes()


def test_other_documentation_keeps_the_identity_and_other_equations_change_it(tmp_path):
    def guid(given):
        path = write_fmu(given, tmp_path / "x.fmu")
        return fmpy.read_model_description(str(path)).guid

    first = guid(model())
    assert guid(dataclasses.replace(model(), documentation="other words")) == first
    assert guid(dataclasses.replace(model(), tolerance=1e-7)) != first


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EACCES])
def test_a_full_disk_leaves_what_was_there(code, tmp_path, monkeypatch):
    target = tmp_path / "pendulum.fmu"
    target.write_bytes(b"old")

    def fail(self, content):
        with open(self, "wb") as stream:
            stream.write(content[:100])
        raise OSError(code, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", fail)
    with pytest.raises(ExportError, match=r"pendulum\.fmu: the file cannot be written \(No space"):
        write_fmu(model(), target)
    monkeypatch.undo()
    assert target.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["pendulum.fmu"]


def test_nothing_is_written_where_the_reference_fails(tmp_path):
    states = (FmuState(name="h", unit="m", start=-1.0, output=True), ball().states[1])
    with pytest.raises(ExportError, match="beyond floor"):
        write_fmu(dataclasses.replace(ball(), states=states), tmp_path / "x.fmu", reference=True)
    assert not list(tmp_path.iterdir())


def test_sources_of_the_user_are_compiled_listed_and_named_in_the_licences(tmp_path):
    law, head = "double law(double x) { return 2 * x; }\n", "double law(double);\n"
    own = (("law.c", law), ("law.h", head))
    path = write_fmu(dataclasses.replace(model(), sources=own), tmp_path / "own.fmu", fmi="3.0")
    with zipfile.ZipFile(path) as archive:
        assert archive.read("sources/law.c").decode() == law
        build = archive.read("sources/buildDescription.xml").decode()
        assert "law.c: see there" in archive.read("documentation/licenses/license.txt").decode()
    assert 'name="law.c"' in build
    assert 'name="law.h"' not in build
