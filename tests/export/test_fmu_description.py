"""modelDescription.xml: what depends on what and how, events, units and names."""

import dataclasses
import xml.etree.ElementTree as ET
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_models import clapper, pendulum, slider_crank
from fmu_structures import ball, two_cranks

import mbs
from mbs.components import Body, Revolute, RigidStop
from mbs.errors import ExportError
from mbs.export.fmu.description import FmuModel, FmuVariable, Member, Terminal
from mbs.export.fmu.system_fmu import fmu_model
from mbs.export.fmu.xml import model_description, terminals_and_icons


def texts(model):
    return {
        "2": model_description(model, "2.0", "{guid}", ["model.c"]),
        "3": model_description(model, "3.0", "{guid}"),
    }


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize(
    "make", [pendulum, slider_crank, ball, lambda: two_cranks(True)], ids=["p", "s", "b", "t"]
)
def test_the_description_is_valid(fmi, make, tmp_path):
    (tmp_path / "modelDescription.xml").write_text(texts(make())[fmi])
    description = fmpy.read_model_description(
        str(tmp_path),
        validate=True,
        validate_variable_names=True,
        validate_model_structure=True,
    )
    assert len(description.derivatives) == 2


def elements(text, path):
    return [element.attrib for element in ET.fromstring(text).findall(path)]


def test_events_in_fmi_2():
    text = texts(ball())["2"]
    root = ET.fromstring(text)
    assert root.get("numberOfEventIndicators") == "1"
    exchange = root.find("ModelExchange")
    assert exchange.get("completedIntegratorStepNotNeeded") == "false"
    variables = {v.get("name"): v for v in root.find("ModelVariables")}
    assert variables["v"].find("Real").get("reinit") == "true"
    assert variables["h"].find("Real").get("reinit") is None
    assert variables["count"].get("variability") == "discrete"
    assert variables["count"].get("causality") == "output"
    assert variables["e"].get("variability") == "fixed"
    order = list(variables)
    mode = str(order.index("count") + 1)
    unknowns = {u["index"]: u for u in elements(text, "ModelStructure/Outputs/Unknown")}
    assert unknowns[mode]["dependencies"] == ""
    initial = {u["index"]: u for u in elements(text, "ModelStructure/InitialUnknowns/Unknown")}
    assert initial[mode]["dependencies"] == str(order.index("h") + 1)
    known = [
        order[int(k) - 1] for k in initial[str(order.index("der(v)") + 1)]["dependencies"].split()
    ]
    assert known == ["h", "v", "push", "g", "drag"]


def test_events_in_fmi_3():
    text, model = texts(ball())["3"], ball()
    (indicator,) = elements(text, "ModelStructure/EventIndicator")
    assert int(indicator["valueReference"]) == model.first("indicator")
    assert indicator["dependencies"] == "0"
    initial = {u["valueReference"] for u in elements(text, "ModelStructure/InitialUnknown")}
    assert indicator["valueReference"] not in initial
    assert str(model.first("mode")) in initial
    outputs = {u["valueReference"]: u for u in elements(text, "ModelStructure/Output")}
    names = {entry.variable.name: str(k) for k, entry in enumerate(model.entries)}
    assert outputs[names["weighted"]]["dependenciesKind"].split() == ["fixed", "constant"]
    assert outputs[names["plain"]]["dependencies"] == names["g"]
    seen = [
        v["name"] for v in elements(text, "ModelVariables/Float64") if "intermediateUpdate" in v
    ]
    assert seen == ["h", "v", "der(h)", "der(v)", "scaled", "weighted", "plain"]
    (scheduled,) = elements(text, "CoSimulation")
    assert scheduled["hasEventMode"] == "true"
    (exchange,) = elements(text, "ModelExchange")
    assert exchange["needsCompletedIntegratorStep"] == "true"


@pytest.mark.parametrize("path", ["Outputs", "Derivatives", "InitialUnknowns"])
@pytest.mark.parametrize("make", [pendulum, slider_crank, ball])
def test_references_of_fmi_2_are_sorted_and_from_one(path, make):
    model = make()
    unknowns = elements(texts(model)["2"], f"ModelStructure/{path}/Unknown")
    places = [int(u["index"]) for u in unknowns]
    assert places == sorted(set(places))
    assert 1 <= min(places) <= max(places) <= len(model.entries)
    fixed = range(model.first("parameter") + 1, model.first("mode") + 1)
    for unknown in unknowns:
        known = [int(k) for k in unknown["dependencies"].split()]
        kinds = unknown["dependenciesKind"].split()
        assert known == sorted(known)
        assert len(kinds) == len(known)
        if path == "InitialUnknowns":
            assert set(kinds) <= {"constant", "dependent"}
        else:
            assert not set(known) & set(fixed)


def test_derivatives_point_at_their_states():
    model = pendulum()
    variables = ET.fromstring(texts(model)["2"]).find("ModelVariables")
    names = [v.get("name") for v in variables]
    for v in variables:
        place = v.find("Real").get("derivative")
        if place is not None:
            assert v.get("name") == f"der({names[int(place) - 1]})"
    names = [entry.variable.name for entry in model.entries]
    for v in ET.fromstring(texts(model)["3"]).find("ModelVariables"):
        if v.get("derivative") is not None:
            assert v.get("name") == f"der({names[int(v.get('derivative'))]})"


def test_units_are_defined_by_base_units_and_angles_shown_in_degrees():
    text = texts(pendulum())["3"]
    units = {u.get("name"): u for u in ET.fromstring(text).find("UnitDefinitions")}
    used = [v["unit"] for v in elements(text, "ModelVariables/Float64")]
    assert set(used) <= set(units)
    assert units["N.m"].find("BaseUnit").attrib == {"kg": "1", "m": "2", "s": "-2"}
    shown = units["rad"].find("DisplayUnit")
    assert shown.get("name") == "deg"
    assert float(shown.get("factor")) * np.pi == pytest.approx(180, rel=1e-15)
    first = elements(text, "ModelVariables/Float64")[0]
    assert first["displayUnit"] == "deg"


def named(name):
    """A model of one parameter."""
    return FmuModel(
        name="odd",
        parameters=(FmuVariable(name=name),),
        rhs=ca.Function("rhs", [ca.SX.sym("a", k) for k in (1, 0, 0, 0, 1)], [ca.SX(0, 1)] * 2),
    )


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("j1.q", "j1.q"),
        ("q_ref[1]", "q_ref[1]"),
        ("M[2,3].x", "M[2,3].x"),
        ("left-arm.q", "'left-arm'.q"),
        ("ur5/joint_1.tau", "'ur5/joint_1'.tau"),
        ("1st.2nd.q", "'1st'.'2nd'.q"),
        ("q ref[3]", "'q ref'[3]"),
        ("'left arm'.q", "'left arm'.q"),
        ("it's", r"'it\'s'"),
        ('say "a"\\b', r"'say \"a\"\\b'"),
        ("a..b", "'a..b'"),
    ],
)
def test_names_are_paths_whose_odd_parts_are_quoted(given, written, tmp_path):
    for text in texts(named(given)).values():
        assert 'variableNamingConvention="structured"' in text
        (tmp_path / "modelDescription.xml").write_text(text)
        read = fmpy.read_model_description(str(tmp_path), validate_variable_names=True)
        assert read.modelVariables[0].name == written


def test_names_beyond_ascii_stay_and_are_announced_as_flat():
    for text in texts(named("größe.q")).values():
        assert 'variableNamingConvention="flat"' in text
        assert 'name="größe.q"' in text


def test_two_names_that_are_quoted_alike_are_refused():
    with pytest.raises(ExportError, match="two variables are called \"'a b'\"; rename one"):
        dataclasses.replace(named("a b"), inputs=(FmuVariable(name="'a b'"),))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_mechanism_with_odd_names(fmi, tmp_path):
    m = mbs.Mechanism("odd", gravity=(0, -9.81, 0))
    rod = m.add(
        Body("rod-1", mass=1.0, com=(0.3, 0, 0), inertia=((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)))
    )
    m.connect(m.world, Revolute("2nd/joint", axis="z", actuated=True), rod)
    m.add(RigidStop("stop-1", "2nd/joint", lower=-1.0))
    system = m.assemble()
    path = mbs.export.fmu(system, tmp_path / "odd.fmu", fmi=fmi, outputs=["pose:rod-1"])
    read = fmpy.read_model_description(str(path), validate_variable_names=True)
    names = {v.name for v in read.modelVariables}
    wanted = {"'2nd/joint'.q", "der('2nd/joint'.v)", "'2nd/joint'.tau", "'rod-1'.x"}
    assert wanted | {"'stop-1'.mode", "indicator.'stop-1_lower'"} <= names
    assert validate_fmu(str(path)) == []
    (drive,) = fmu_model(system).terminals
    assert drive.name == "'2nd/joint'"
    assert {member.variable for member in drive.members} <= names
    end = mbs.simulate.fmu(path, 0.1, inputs={"'2nd/joint'.tau": 1.0}, quiet=True)
    own = mbs.simulate.run(system, 0.1, tau=lambda t, q, v: [1.0], quiet=True)
    assert end["'2nd/joint'.q"][-1] == pytest.approx(own["2nd/joint.q"][-1], abs=1e-7)


def test_events_leave_the_description_structured():
    assert 'variableNamingConvention="structured"' in texts(clapper())["3"]
    names = [e.variable.name for e in clapper().entries if e.kind == "indicator"]
    assert names == ["indicator.low_stop", "indicator.high_stop"]


def test_time_is_a_dependency_where_it_is_a_variable():
    model = pendulum()
    time = str(len(model.entries))
    v = str([entry.variable.name for entry in model.entries].index("der(j1.v)"))
    for element in ("ContinuousStateDerivative", "InitialUnknown"):
        rows = elements(texts(model)["3"], f"ModelStructure/{element}")
        (row,) = (row for row in rows if row["valueReference"] == v)
        assert time in row["dependencies"].split()


def test_terminals_are_valid_and_name_variables(tmp_path):
    xmlschema = pytest.importorskip("lxml.etree")
    model = pendulum()
    flange = Terminal(
        name="j1",
        kind="mbs.revolute",
        members=(Member("angle", "j1.q"), Member("torque", "tau", "inflow")),
        description="drive",
    )
    model = FmuModel(
        name=model.name,
        states=model.states,
        inputs=model.inputs,
        outputs=model.outputs,
        parameters=model.parameters,
        rhs=model.rhs,
        terminals=(flange,),
    )
    text = terminals_and_icons(model)
    folder = Path(fmpy.__file__).parent / "schema" / "fmi3"
    schema = xmlschema.XMLSchema(xmlschema.parse(str(folder / "fmi3TerminalsAndIcons.xsd")))
    schema.assertValid(xmlschema.fromstring(text.encode()))
    members = elements(text, "Terminals/Terminal/TerminalMemberVariable")
    names = {entry.variable.name for entry in model.entries}
    assert [m["variableName"] for m in members] == ["j1.q", "tau"]
    assert {m["variableName"] for m in members} <= names
    assert members[1]["variableKind"] == "inflow"
