"""FMUs of mechanisms in an importer, against the simulation of the same system."""

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from support.catalogue_systems import catalogue_system

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    Free,
    Prismatic,
    Revolute,
    Spherical,
)
from mbs.errors import ExportError, ModelError

KINDS = ("CoSimulation", "ModelExchange")
TOLERANCE = 1e-12


def puma():
    return catalogue_system("puma560")


def four_bar():
    return catalogue_system("four_bar")


def floating():
    m = Mechanism("floating", gravity=(0.0, 0.0, -9.81))
    body = m.add(Body("body", mass=2, inertia=(1, 2, 2.5), com=(0.1, 0, 0)))
    bob = m.add(Body("bob", mass=1, inertia=(0.1, 0.1, 0.1), com=(0, 0, -0.5)))
    m.connect(m.world, Free("f"), body)
    m.connect(body.at(0.2), Spherical("s"), bob)
    return m.assemble()


def slider_crank():
    m = Mechanism("slider_crank", gravity=(0.0, -9.81, 0.0), parameters={"rod": 0.6})
    crank = m.add(Box("crank", length=0.2, width=0.03, mass=1))
    rod = m.add(Box("rod", length="rod", width=0.03, mass=1))
    piston = m.add(Body("piston", mass=0.5))
    m.connect(m.world, Revolute("j1", actuated=True), crank.left)
    m.connect(crank.right, Revolute("j2"), rod.left)
    m.connect(rod.right, Revolute("j3"), piston)
    m.connect(m.world, Prismatic("s", axis="x"), piston)
    return m.assemble(guess={"j1": 0.0, "s": 0.7})


CASES = {
    "puma560": (puma, {"q2": 0.3, "q3": -0.5}, {}, 10.0),
    "four_bar": (four_bar, {"j1": 0.3}, {}, 10.0),
    "slider_crank": (slider_crank, {"j1": 0.5}, {"j1": 1.0}, 2.0),
    "floating": (floating, {}, {"f.wy": 3.0, "f.wz": 0.1, "s.wx": 2.0}, 3.0),
}


@pytest.fixture(scope="module", params=CASES)
def case(request, tmp_path_factory):
    build, q0, v0, duration = CASES[request.param]
    system = build()
    path = tmp_path_factory.mktemp("fmu") / f"{request.param}.fmu"
    mbs.export.fmu(system, path)
    result = mbs.simulate.run(system, duration, q0=q0, v0=v0, tolerance=TOLERANCE)
    return system, path, q0, v0, duration, result


def test_validation_reports_nothing(case):
    assert validate_fmu(str(case[1])) == []


@pytest.mark.parametrize("kind", KINDS)
def test_importer_agrees_with_simulation(case, kind):
    system, path, q0, v0, duration, result = case
    start = {f"{k}.q": x for k, x in q0.items()} | {f"{k}.v": x for k, x in v0.items()}
    fmu = mbs.simulate.fmu(
        path, duration, start=start, kind=kind, tolerance=TOLERANCE, step=0.01, quiet=True
    )
    names = [f"{c.name}.q" for c in system.coordinates] + [
        f"{s.name}.v" for s in system.velocity_coordinates
    ]
    worst = max(np.abs(fmu[name] - result[name]).max() for name in names)
    assert worst < 1e-6


def test_tool_pose_is_the_terminal_frame(case):
    system, path, *_ = case
    fmu = mbs.simulate.fmu(path, 0.1, step=0.05, quiet=True)
    q = [fmu[f"{c.name}.q"][-1] for c in system.coordinates]
    from mbs.models.geometry import terminal_frame

    T = np.array(mbs.models.transform(system, terminal_frame(system))(q))
    np.testing.assert_allclose([fmu[f"tool.{a}"][-1] for a in "xyz"], T[:3, 3], atol=1e-10)
    R = [[fmu[f"tool.R{i}{k}"][-1] for k in (1, 2, 3)] for i in (1, 2, 3)]
    np.testing.assert_allclose(R, T[:3, :3], atol=1e-10)


def test_variables_have_units_and_descriptions(case):
    _, path, *_ = case
    description = read_model_description(str(path))
    floats = [v for v in description.modelVariables if v.causality != "independent"]
    assert all(v.description for v in floats)
    assert all(v.unit for v in floats)


def test_parameter_is_tunable(tmp_path):
    system = slider_crank()
    mbs.export.fmu(system, tmp_path / "slider.fmu")
    for rod in (0.6, 0.8):
        result = mbs.simulate.run(system, 1.0, parameters={"rod": rod}, tolerance=1e-10)
        fmu = mbs.simulate.fmu(
            tmp_path / "slider.fmu", 1.0, parameters={"rod": rod}, tolerance=1e-10, quiet=True
        )
        assert fmu["s.q"][0] == pytest.approx(0.2 + rod, abs=1e-10)
        np.testing.assert_allclose(fmu["j1.q"], result["j1.q"], atol=1e-7)


def test_parameter_without_value_is_refused(tmp_path):
    m = Mechanism("m")
    m.connect(m.world, Revolute("j"), m.add(Body("b", mass="heavy", inertia=(1, 1, 1))))
    with pytest.raises(ModelError, match="parameter 'heavy' has no value; give it a default"):
        mbs.export.fmu(m.assemble(), tmp_path / "m.fmu")
    assert list(tmp_path.iterdir()) == []


def test_version_that_is_not_written(tmp_path):
    with pytest.raises(ExportError, match=r"FMI version '4.0' is not written; use fmi='2.0' or"):
        mbs.export.fmu(four_bar(), tmp_path / "m.fmu", fmi="4.0")


def test_folder_that_cannot_be_written(tmp_path):
    with pytest.raises(ExportError, match="nowhere"):
        mbs.export.fmu(four_bar(), tmp_path / "nowhere" / "m.fmu")
    assert list(tmp_path.iterdir()) == []


def test_a_rod_between_ball_joints_turns_crank_and_rocker(tmp_path):
    m = Mechanism("rssr")
    crank, rod, rocker = (
        m.add(Box(n, length=x, width=0.02, mass=1)) for n, x in (("a", 0.2), ("b", 0.6), ("c", 0.4))
    )
    m.connect(m.world, Revolute("j1", actuated=True), crank.left)
    m.connect(crank.right, Spherical("s1"), rod.left)
    m.connect(rod.right, Spherical("s2"), rocker.right)
    across = m.world.at(0.3, 0.3, rotation=("x", "pi/2"))
    m.connect(across, Revolute("j2"), rocker.left)
    system = m.assemble(guess={"j2": 1.0})
    assert system.closure.mobility == 2
    path = mbs.export.fmu(system, tmp_path / "rssr.fmu")
    got = mbs.simulate.fmu(path, 0.5, inputs={"j1.tau": 0.3}, tolerance=1e-10, quiet=True)
    ran = mbs.simulate.run(system, 0.5, tau={"j1": 0.3}, tolerance=1e-10, quiet=True)
    for name in ("j1.q", "j2.q"):
        np.testing.assert_allclose(got[name][-1], ran[name][-1], atol=1e-6)
