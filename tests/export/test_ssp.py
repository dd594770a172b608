"""Systems of connected FMUs: their description, what is refused, and their motion in importers."""

import re
import zipfile
from importlib import resources
from xml.etree import ElementTree

import casadi as ca
import fmpy
import numpy as np
import pytest
from lxml import etree

import mbs
from mbs.errors import ExportError
from mbs.export.fmu.description import FmuModel, FmuState, FmuVariable
from mbs.export.fmu.pack import write_fmu

SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
LINKS = [
    *((f"controller.tau{k}", f"robot.q{k}.tau") for k in (1, 2)),
    *((f"robot.q{k}.{what}", f"controller.{what}{k}") for k in (1, 2) for what in "qv"),
]
START = {"robot.q1.q": 0.2, "controller.goal": 0.7}


def controller():
    """Two springs and dampers towards a goal, as a block without states."""
    t, z, x = ca.SX.sym("t"), ca.SX.sym("z", 0), ca.SX.sym("x", 0)
    u, p = ca.SX.sym("u", 4), ca.SX.sym("p", 3)
    (q1, q2, v1, v2), (stiffness, damping, goal) = ca.vertsplit(u), ca.vertsplit(p)
    y = ca.vertcat(*(stiffness * (goal - q) - damping * v for q, v in ((q1, v1), (q2, v2))))
    units = (("q1", "rad"), ("q2", "rad"), ("v1", "rad/s"), ("v2", "rad/s"))
    return FmuModel(
        name="controller",
        rhs=ca.Function("control", [t, x, z, u, p], [ca.SX(0, 1), y]),
        inputs=tuple(FmuVariable(name=name, unit=unit) for name, unit in units),
        outputs=tuple(FmuVariable(name=name, unit="N.m") for name in ("tau1", "tau2")),
        parameters=(
            FmuVariable(name="stiffness", unit="N.m/rad", start=20.0),
            FmuVariable(name="damping", unit="N.m.s/rad", start=6.0),
            FmuVariable(name="goal", unit="rad", start=0.5),
        ),
    )


@pytest.fixture(scope="module")
def robot():
    return mbs.load("planar_2r").assemble()


@pytest.fixture(scope="module")
def fmus(robot, tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts")
    for fmi in ("2.0", "3.0"):
        mbs.export.fmu(robot, folder / f"robot{fmi[0]}.fmu", fmi=fmi, stop_time=2.0)
        write_fmu(controller(), folder / f"controller{fmi[0]}.fmu", fmi=fmi)
    return folder


@pytest.fixture(scope="module")
def parts(fmus):
    return {name: fmus / f"{name}2.fmu" for name in ("robot", "controller")}


def cell(fmus, path, fmi="2"):
    parts = {name: fmus / f"{name}{fmi}.fmu" for name in ("robot", "controller")}
    return mbs.export.ssp(path, parts, LINKS, start=START, stop_time=2.0)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_the_description_fits_the_schema_and_says_what_there_is(fmus, tmp_path, fmi):
    path = cell(fmus, tmp_path / "cell.ssp", fmi)
    with zipfile.ZipFile(path) as archive:
        text = archive.read("SystemStructure.ssd")
        names = set(archive.namelist())
        robot_fmu = archive.read(f"resources/robot{fmi}.fmu")
    folder = resources.files("fmpy") / "ssp" / "schema"
    schema = etree.XMLSchema(file=str(folder / "SystemStructureDescription.xsd"))
    schema.assertValid(etree.fromstring(text))
    root = ElementTree.fromstring(text)
    for values in root.iter(f"{SSV}ParameterSet"):
        schema = etree.XMLSchema(file=str(folder / "SystemStructureParameterValues.xsd"))
        schema.assertValid(etree.fromstring(ElementTree.tostring(values)))
    listed = {f"resources/{name}{fmi}.fmu" for name in ("robot", "controller")}
    assert names == {"SystemStructure.ssd", *listed}
    assert robot_fmu == (fmus / f"robot{fmi}.fmu").read_bytes()
    robot, control = root.iter(f"{SSD}Component")
    kinds = {
        c.get("name"): (c.get("kind"), c[0].get("unit")) for c in robot.iter(f"{SSD}Connector")
    }
    described = fmpy.read_model_description(str(fmus / f"robot{fmi}.fmu"))
    shown = [v for v in described.modelVariables if v.causality in ("input", "output")]
    assert kinds == {v.name: (v.causality, v.unit) for v in shown}
    assert kinds["q1.tau"] == ("input", "N.m")
    assert len(control.findall(f"{SSD}Connectors/{SSD}Connector")) == 6
    ends = [
        (
            f"{c.get('startElement')}.{c.get('startConnector')}",
            f"{c.get('endElement')}.{c.get('endConnector')}",
        )
        for c in root.iter(f"{SSD}Connection")
    ]
    assert ends == LINKS
    unit = next(u for u in root.iter(f"{SSC}Unit") if u.get("name") == "N.m")
    assert unit[0].attrib == {"kg": "1", "m": "2", "s": "-2"}
    experiment = root.find(f"{SSD}DefaultExperiment")
    assert experiment.attrib == {"startTime": "0.0", "stopTime": "2.0"}


def test_equal_systems_give_equal_files_and_equal_fmus_are_kept_once(fmus, tmp_path):
    contents = {cell(fmus, tmp_path / "cell.ssp").read_bytes() for _ in range(2)}
    assert len(contents) == 1
    twins = {"left": fmus / "robot2.fmu", "right": fmus / "robot2.fmu"}
    path = mbs.export.ssp(tmp_path / "twins.ssp", twins, start={"right.q1.q": 1.0})
    with zipfile.ZipFile(path) as archive:
        assert sorted(archive.namelist()) == ["SystemStructure.ssd", "resources/robot2.fmu"]
        root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    assert [c.get("name") for c in root.iter(f"{SSD}Component")] == ["left", "right"]
    assert root.find(f"{SSD}DefaultExperiment").get("stopTime") == "2.0"  # that of the robot


def without_experiment(path, target):
    """The same FMU without a default experiment."""
    with zipfile.ZipFile(path) as read, zipfile.ZipFile(target, "w") as written:
        for name in read.namelist():
            content = read.read(name)
            if name == "modelDescription.xml":
                content, count = re.subn(rb"<DefaultExperiment[^>]*/>", b"", content)
                assert count == 1
            written.writestr(name, content)
    return target


def test_the_stop_time_is_the_latest_of_the_fmus_or_one_second(fmus, tmp_path):
    robot, control = fmus / "robot2.fmu", fmus / "controller2.fmu"
    bare = [without_experiment(robot, tmp_path / f"{name}.fmu") for name in ("one", "two")]

    def times(parts, **options):
        path = mbs.export.ssp(tmp_path / "cell.ssp", parts, **options)
        with zipfile.ZipFile(path) as archive:
            root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
        return root.find(f"{SSD}DefaultExperiment").attrib

    described = [fmpy.read_model_description(str(path)) for path in (robot, control)]
    assert [d.defaultExperiment.stopTime for d in described] == ["2.0", "10.0"]
    for parts in ([robot, control], [control, robot]):
        assert times(parts) == {"startTime": "0.0", "stopTime": "10.0"}
    assert times([bare[0], robot]) == {"startTime": "0.0", "stopTime": "2.0"}
    assert times(bare) == {"startTime": "0.0", "stopTime": "1.0"}
    assert times([robot, control], stop_time=3) == {"startTime": "0.0", "stopTime": "3.0"}


def loop(robot):
    """The same loop without co-simulation."""

    def spring_and_damper(t, q, v):
        return 20 * (0.7 - q) - 6 * v

    options = {"step": 0.1, "tolerance": 1e-10, "quiet": True}
    return mbs.simulate.run(robot, 1.0, q0={"q1": 0.2}, tau=spring_and_damper, **options)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_ecos_comes_to_the_same_motion_the_closer_the_shorter_the_steps(robot, fmus, tmp_path, fmi):
    ecos = imported_ecos()
    path, end = cell(fmus, tmp_path / "cell.ssp", fmi), loop(robot).at(1.0)
    errors = []
    for steps in (250, 500, 1000):
        simulation = ecos.EcosSimulation(step_size=1 / steps, ssp_path=str(path))
        simulation.init(parameter_set="initialValues")
        assert simulation.get_real("robot::q1.q") == pytest.approx(0.2, abs=1e-15)
        simulation.step(steps)
        found = [simulation.get_real(f"robot::q{k}.q") for k in (1, 2)]
        simulation.terminate()
        simulation.free()
        errors.append(max(abs(x - end[f"q{k}.q"]) for k, x in enumerate(found, start=1)))
    assert errors[0] < 2 * 1 / 250
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)  # inputs are held: order one
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.1)


def imported_ecos():
    try:
        import ecospy
    except (ImportError, OSError) as error:
        pytest.skip(f"no ecospy: {error}")
    return ecospy


def test_fmpy_runs_it(robot, fmus, tmp_path):
    from fmpy.ssp.simulation import simulate_ssp

    path, end = cell(fmus, tmp_path / "cell.ssp"), loop(robot).at(1.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        answer = simulate_ssp(str(path), stop_time=1.0, step_size=1e-3)
    # it does not read start values in the description: the robot starts at zero
    assert {"robot.q1.q", "controller.tau1"} <= set(answer.dtype.names)
    assert np.all(np.isfinite(answer["robot.q1.q"]))
    assert end["q1.q"] != answer["robot.q1.q"][-1]


@pytest.mark.parametrize(
    ("links", "message"),
    [
        (
            [("controler.tau1", "robot.q1.tau")],
            "there is no component 'controler'; did you mean 'c",
        ),
        ([("controller.tau3", "robot.q1.tau")], "controller has no variable 'tau3'; did you mean"),
        ([("controller.tau1", "robot")], "connection: 'robot' is no variable; write component.var"),
        ([("controller.tau1", 3)], "connection: 3 is no variable"),
        (
            [("robot.q1.tau", "robot.q2.tau")],
            "robot.q1.tau is of causality input; a connection begi",
        ),
        (
            [("controller.tau1", "robot.q1.q")],
            "robot.q1.q is of causality output; a connection ends",
        ),
        ([("robot.q1.q", "controller.goal")], "controller.goal is of causality parameter; a conn"),
        (
            [("robot.der(q1.v)", "controller.q1")],
            "is no input or output; a connection begins at an",
        ),
        (
            [("robot.q1.v", "controller.q1")],
            "robot.q1.v is in rad/s and controller.q1 in rad; conn",
        ),
        (
            [("controller.tau1", "robot.q1.tau"), ("controller.tau2", "robot.q1.tau")],
            "input robot.q1.tau has two sources, controller.tau1 and controller.tau2; leave one",
        ),
        (["controller.tau1"], r"connection 'controller.tau1': give a pair \(output, input\)"),
        ([3], r"connection 3: give a pair \(output, input\)"),
    ],
)
def test_connections_that_do_not_fit(parts, tmp_path, links, message):
    with pytest.raises(ExportError, match=message):
        mbs.export.ssp(tmp_path / "cell.ssp", parts, links)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"robot.q9.q": 1.0}, "start: robot has no variable 'q9.q'; did you mean"),
        ({"robot.tool.x": 1.0}, "start: robot.tool.x is calculated and cannot be set"),
        ({"robot.q1.q": float("nan")}, "start: robot.q1.q is nan; give a finite number"),
        ({"robot.q1.q": "far"}, "start: robot.q1.q is 'far'; give a finite number"),
        ({"q1": 1.0}, "start: 'q1' is no variable; write component.variable"),
    ],
)
def test_start_values_that_do_not_fit(parts, tmp_path, start, message):
    with pytest.raises(ExportError, match=message):
        mbs.export.ssp(tmp_path / "cell.ssp", parts, start=start)


def test_components_that_are_none(parts, tmp_path):
    def refused(components, message, **options):
        with pytest.raises(ExportError, match=message):
            mbs.export.ssp(tmp_path / "cell.ssp", components, **options)

    (tmp_path / "plain.fmu").write_text("nothing")
    refused({}, "there is no component; give the path of one FMU at least")
    refused({"robot": tmp_path / "no.fmu"}, r"no.fmu of robot cannot be read \(No such file")
    refused({"robot": tmp_path / "plain.fmu"}, "plain.fmu of robot is not an FMU")
    refused({"a.b": parts["robot"]}, "'a.b' is no name of a component; give a dict of names witho")
    refused([parts["robot"], parts["robot"]], "two components are called 'robot2'; give a dict")
    refused({"robot": 3}, "3 is not a path")
    refused(3, "components is 3; give a dict of names to paths")
    refused(parts, "stop_time is -1.0; give a time after 0 s", stop_time=-1.0)
    with pytest.raises(ExportError, match="the file cannot be written"):
        mbs.export.ssp(tmp_path / "none" / "cell.ssp", parts)


def test_an_fmu_without_co_simulation(tmp_path):
    with zipfile.ZipFile(tmp_path / "me.fmu", "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="2.0" modelName="me" guid="1">'
            '<ModelExchange modelIdentifier="me"/><ModelVariables/><ModelStructure/>'
            "</fmiModelDescription>",
        )
    with pytest.raises(ExportError, match=r"me.fmu of me is an FMU without co-simulation"):
        mbs.export.ssp(tmp_path / "cell.ssp", [tmp_path / "me.fmu"])


def test_a_unit_of_another_size_is_another_unit(parts, tmp_path):
    x, p = ca.SX.sym("x"), ca.SX.sym("p", 0)
    inputs = [ca.SX.sym("t"), x, ca.SX.sym("z", 0), ca.SX.sym("u"), p]
    model = FmuModel(
        name="lag",
        rhs=ca.Function("lag", inputs, [inputs[3] - x, x]),
        states=(FmuState(name="x"),),
        inputs=(FmuVariable(name="u", unit="m"),),
        outputs=(FmuVariable(name="y", unit="m"),),
    )
    lag = write_fmu(model, tmp_path / "lag.fmu")
    millimetres = tmp_path / "mm.fmu"
    with zipfile.ZipFile(lag) as whole, zipfile.ZipFile(millimetres, "w") as other:
        for name in whole.namelist():
            content = whole.read(name)
            if name == "modelDescription.xml":
                content = content.replace(
                    b'<BaseUnit m="1" />', b'<BaseUnit m="1" factor="0.001" />'
                )
                assert b"0.001" in content
            other.writestr(name, content)
    both = {"a": lag, "b": millimetres}
    with pytest.raises(
        ExportError, match=r"a.y is in m and b.u in m; connect variables of one unit"
    ):
        mbs.export.ssp(tmp_path / "x.ssp", both, [("a.y", "b.u")])
    mbs.export.ssp(tmp_path / "x.ssp", {"a": lag, "b": lag}, [("a.y", "b.u"), ("b.y", "a.u")])
