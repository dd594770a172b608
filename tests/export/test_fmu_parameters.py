"""Numbers of a mechanism that are parameters of its FMU, and what its variables tell."""

from importlib import import_module

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import mbs
from mbs.components import Body, Box, CoulombFriction, Revolute, RigidStop
from mbs.errors import ExportError, ModelError, SolverError
from mbs.export.fmu.options import FmuOptions
from mbs.export.fmu.system_fmu import fmu_model
from mbs.expressions import MORE_THAN_ZERO

TENSOR = ((0.02, 0.001, 0), (0.001, 0.03, 0.002), (0, 0.002, 0.04))


def arm(d=0.4, M=2.0, Fv=0.2):
    """Two links whose numbers are given."""
    rows = [
        {"antecedent": 0, "joint": "revolute", "limits": [-3, 2]},
        {"antecedent": 1, "joint": "revolute", "alpha": "pi/2", "d": d},
    ]
    bodies = [
        {"frame": 1, "ZZ": 0.5, "Ia": 0.05},
        {"frame": 2, "XX": 0.3, "YY": 0.2, "ZZ": 0.4, "MX": 0.3, "M": M, "Fv": Fv},
    ]
    table = {"name": "arm", "gravity": [0, -9.81, 0], "frame": rows, "body": bodies}
    return mbs.load(table).assemble()


def four_bar(length=1.0):
    """A four-bar whose coupler has this length, its centre of mass where it is."""
    m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
    a, b, c = (m.add(Body(n, mass=1.0, com=(0.3, 0, 0), inertia=TENSOR)) for n in "abc")
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), a)
    m.connect(a.at(0.4), Revolute("j2", axis="z"), b)
    m.connect(b.at(length), Revolute("j3", axis="z"), c.at(0.9))
    m.connect(m.world.at(0.8), Revolute("j4", axis="z"), c)
    return m.assemble(guess={"j1": 0.4, "j2": 0.7, "j4": 1.3})


def test_other_parameters_give_the_equations_of_another_system() -> None:
    wished = FmuOptions(parameters=["masses", "lengths", "Fv2"], outputs=["energy", "cut_forces"])
    model = fmu_model(arm(), wished)
    plain = fmu_model(arm(0.6, 3.5, 0.9), FmuOptions(outputs=["energy", "cut_forces"]))
    other = {"d2": 0.6, "M2": 3.5, "Fv2": 0.9}
    assert [v.name for v in model.parameters] == ["M2", "d2", "Fv2"]
    rng = np.random.default_rng(2)
    for _ in range(4):
        x, u = rng.normal(size=4), rng.normal(size=2)
        one = model.rhs(0, x, [], u, [other[v.name] for v in model.parameters])
        for a, b in zip(one, plain.rhs(0, x, [], u, []), strict=True):
            assert np.abs(np.array(a - b)).max() < 1e-11


def test_the_fmu_of_a_loop_takes_a_longer_coupler(tmp_path) -> None:
    path = mbs.export.fmu(
        four_bar(), tmp_path / "bar.fmu", fmi="3.0", parameters=["lengths"], outputs=["closure"]
    )
    longer = four_bar(1.1)
    fmu = mbs.simulate.fmu(
        path,
        0.4,
        step=0.05,
        start={"j1.q": longer.configuration[0]},
        parameters={"j3.frame_a.x": 1.1},
        tolerance=1e-10,
        quiet=True,
    )
    own = mbs.simulate.run(longer, 0.4, step=0.05, tolerance=1e-10, quiet=True)
    assert np.abs(fmu["closure"]).max() < 1e-11
    for name in ("j1.q", "j2.q", "j4.q", "j4.v", "j1.a"):
        assert np.abs(fmu[name] - own[name]).max() < 1e-7 * (1 + np.abs(own[name]).max()), name
    assert abs(own["j2.q"][0] - four_bar().configuration[1]) > 0.05


def test_what_variables_tell() -> None:
    model = fmu_model(arm(), FmuOptions(parameters=["masses", "inertias", "friction", "lengths"]))
    by_name = {entry.variable.name: entry.variable for entry in model.entries}
    assert (by_name["M2"].min, by_name["M2"].nominal, by_name["M2"].unit) == (0.0, 2.0, "kg")
    assert (by_name["Fv2"].min, by_name["d2"].min) == (0.0, None)
    assert by_name["q1.q"].nominal == by_name["q1.v"].nominal == 3.0
    assert by_name["q2.q"].nominal == 1.0
    for entry in model.entries:
        assert entry.variable.nominal > 0
        assert entry.variable.description


def test_bounds_of_contacts() -> None:
    m = mbs.Mechanism("hit", gravity=(0, -9.81, 0))
    e, mu = mbs.Parameter("e", 0.8), mbs.Parameter("mu", 0.1, unit="N.m")
    rod = m.add(Body("rod", mass=1.0, com=(0.3, 0, 0), inertia=TENSOR))
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), rod)
    m.add(RigidStop("stop", "j1", lower=-1.0, restitution=e))
    m.add(CoulombFriction("dry", "j1", sliding=mu))
    model = fmu_model(m.assemble(), FmuOptions(parameters=["masses"]))
    by_name = {variable.name: variable for variable in model.parameters}
    assert (by_name["e"].min, by_name["e"].max) == (0.0, 1.0)
    assert (by_name["mu"].min, by_name["mu"].max) == (MORE_THAN_ZERO, None)
    assert by_name["M1"].min == 0.0
    assert {"stop.effort", "dry.effort"} <= {y.name for y in model.outputs}


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (["M7"], "nothing called 'M7' that may become a symbol"),
        (["masses", "masses"], "'masses' is to be a symbol twice"),
    ],
)
def test_unknown_numbers_are_refused(parameters, message) -> None:
    with pytest.raises(ModelError, match=f"arm: .*{message}|arm: {message}"):
        fmu_model(arm(), FmuOptions(parameters=parameters))


def test_a_symbol_without_value_is_refused() -> None:
    m = mbs.Mechanism("open")
    rod = m.add(Body("rod", mass="m", com=(0.3, 0, 0), inertia=TENSOR))
    m.connect(m.world, Revolute("j1", axis="z"), rod)
    with pytest.raises(ModelError, match="open: parameter 'm' has no value; give it a default"):
        fmu_model(m.assemble())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"stop_time": "x"}, "stop time"),
        ({"internal_step": "x"}, "internal step"),
        ({"step_size": -1.0}, "step size"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"solver": "euler"}, "solver is 'euler'; use dopri5"),
    ],
)
def test_settings_that_are_none_are_refused(settings, message) -> None:
    with pytest.raises(ExportError, match=f"FMU arm: {message}"):
        fmu_model(arm(), FmuOptions(**settings))


def test_paths_and_versions_are_refused(tmp_path) -> None:
    with pytest.raises(ExportError, match=r"arm: FMI version '4' is not written; use fmi='2.0'"):
        mbs.export.fmu(arm(), tmp_path / "x.fmu", fmi="4")
    with pytest.raises(ExportError, match="does not exist"):
        mbs.export.fmu(arm(), tmp_path / "none" / "x.fmu")
    with pytest.raises(ExportError, match="3 is not a path"):
        mbs.export.fmu(arm(), 3)


def test_a_fixed_parameter_keeps_its_value_once_the_motion_has_begun(tmp_path) -> None:
    model = fmu_model(arm(), FmuOptions(parameters=["M2", "d2"], fixed=["M2"]))
    assert [(v.name, v.fixed) for v in model.parameters] == [("M2", True), ("d2", False)]
    path = mbs.export.fmu(arm(), tmp_path / "arm.fmu", parameters=["M2", "d2"], fixed=["M2"])
    variables = fmpy.read_model_description(path).modelVariables
    found = {v.name: v.variability for v in variables if v.causality == "parameter"}
    assert found == {"M2": "fixed", "d2": "tunable"}


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        (["M3"], "fixed names 'M3', which is no parameter; use one of M2"),
        (["M2", "M2"], "fixed name 'M2' twice"),
        (3, "fixed is 3; give a list of texts"),
    ],
)
def test_what_is_no_parameter_cannot_be_fixed(fixed, message) -> None:
    with pytest.raises(ModelError, match=f"arm: {message}"):
        fmu_model(arm(), FmuOptions(parameters=["M2"], fixed=fixed))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_fmu_refuses_what_the_description_of_a_mechanism_refuses(fmi, tmp_path):
    """A mass below zero, a length of zero: by the FMU itself, which says which, what and why."""
    m = mbs.Mechanism("arm", gravity=(0, -9.81, 0))
    box = Box("box", length=mbs.Parameter("l", 0.4), width=0.1, mass=mbs.Parameter("m", 2.0))
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), m.add(box))
    path = mbs.export.fmu(m.assemble(), tmp_path / "arm.fmu", fmi=fmi, parameters=["friction"])
    assert validate_fmu(str(path)) == []
    read = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    assert (float(read["m"].min), float(read["l"].min)) == (0.0, MORE_THAN_ZERO)
    for name, value, rule in (
        ("m", -1.0, "parameter m is -1; give 0 or more"),
        ("l", 0.0, "parameter l is 0; give more than zero"),
        ("l", -0.4, "parameter l is -0.4; give more than zero"),
    ):
        with pytest.raises(SolverError, match=rule):
            mbs.simulate.fmu(path, 0.1, parameters={name: value}, quiet=True)
    with pytest.raises(SolverError, match="singular configuration or a zero mass"):
        mbs.simulate.fmu(path, 0.1, parameters={"m": 0.0}, quiet=True)  # here it moves nothing else


def test_mistakes_in_options_are_told_before_the_equations(tmp_path, monkeypatch) -> None:
    module = import_module("mbs.export.fmu.system_fmu")
    monkeypatch.setattr(module, "state_equations", lambda *_, **__: 1 / 0)
    for options, message in (
        ({"solver": "euler"}, "FMU arm: solver is 'euler'; use dopri5 or rodas or rk4"),
        ({"target": "bare"}, "FMU arm: solver is 'dopri5', and target='bare' takes steps"),
        ({"max_step": 0}, "FMU arm: longest step 0 must be positive"),
        ({"license": 3}, "FMU arm: license is 3; give a line of printable characters"),
    ):
        with pytest.raises(ExportError, match=message):
            mbs.export.fmu(arm(), tmp_path / "x.fmu", **options)
