"""Contacts in FMUs: steps of Co-Simulation pass over none, Model Exchange has them as events."""

import fmpy
import numpy as np
import pytest

import mbs
from mbs.components import (
    Body,
    Box,
    Cartesian,
    PointMass,
    Prismatic,
    Revolute,
    SphereSphereContact,
)


def bullet():
    """A ball of 1 cm that flies 5 m to another one."""
    m = mbs.Mechanism("bullet", gravity=(0, 0, 0))
    ball = m.add(PointMass("b", mass=1.0))
    m.connect(m.world, Prismatic("j", axis="x"), ball)
    m.add(
        SphereSphereContact("c", m.world.at(5), ball, radius_a=0.01, radius_b=0.01, stiffness=1e9)
    )
    return m.assemble(), 10.0


def rotor():
    """The tip of an arm and a ball of 5 mm on its circle."""
    m = mbs.Mechanism("rotor", gravity=(0, 0, 0))
    arm = m.add(Body("b", mass=1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("j", axis="z"), arm)
    at, law = m.world.at(np.cos(3), np.sin(3), 0), {"stiffness": 1e9}
    m.add(SphereSphereContact("c", at, arm.at(1), radius_a=0.005, radius_b=0.005, **law))
    return m.assemble(), 3.5


@pytest.mark.parametrize("solver", ["dopri5", "rodas"])
@pytest.mark.parametrize("made", [bullet, rotor])
def test_one_long_step_of_co_simulation_meets_the_obstacle(made, solver, tmp_path):
    system, way = made()
    path = mbs.export.fmu(system, tmp_path / "hit.fmu", solver=solver)
    for speed in (1.0, 10.0, 30.0):
        found = fmpy.simulate_fmu(
            str(path),
            fmi_type="CoSimulation",
            stop_time=way / speed,
            output_interval=way / speed,
            start_values={"j.v": speed},
            output=["j.v"],
        )
        assert found["j.v"][-1] == pytest.approx(-speed, rel=1e-5)


def four_bar():
    """A four-bar without gravity whose crank hits a body at rest."""
    m = mbs.Mechanism("four_bar", gravity=(0, 0, 0))
    lengths = {"crank": 0.3, "coupler": 1.0, "rocker": 0.8}
    crank, coupler, rocker = (m.add(Box(n, length=x, mass=1.0)) for n, x in lengths.items())
    m.connect(m.world, Revolute("j1", actuated=True), crank.left)
    m.connect(crank.right, Revolute("j2"), coupler.left)
    m.connect(m.world.at(0.9), Revolute("j4"), rocker.left)
    m.connect(coupler.right, Revolute("j3"), rocker.right)
    body = m.add(PointMass("t", mass=0.2))
    place = m.world.at(0.3 * np.cos(2), 0.3 * np.sin(2), 0)
    m.connect(place, Cartesian("o"), body)
    m.add(SphereSphereContact("c", body, crank.right, radius_a=0.01, radius_b=0.01, stiffness=1e8))
    return m.assemble(guess={"j1": 0.5, "j4": 1.0})


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_closed_mechanism_hits_a_body(kind, tmp_path):
    system = four_bar()
    path = mbs.export.fmu(system, tmp_path / "four_bar.fmu")
    result = mbs.simulate.run(system, 0.2, v0={"j1": 30.0}, step=0.02, quiet=True)
    assert result["o.x.v"][-1] < -5
    found = fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=0.2,
        output_interval=0.2 if kind == "CoSimulation" else 1e-4,
        start_values={"j1.v": 30.0},
        output=["o.x.q", "o.y.q"],
        relative_tolerance=1e-9,
    )
    for name in ("o.x.q", "o.y.q"):
        assert found[name][-1] == pytest.approx(result[name][-1], abs=1e-5)


def test_model_exchange_passes_singular_configurations_beside_contacts(tmp_path):
    """A parallelogram that lies flat after 0.3 s, and a contact far from it."""
    m = mbs.robots.n_four_bar()
    body, bar = m.add(PointMass("t", mass=0.2)), m.components["upright0"]
    m.connect(m.world.at(30, 0, 0), Cartesian("o"), body)
    m.add(SphereSphereContact("c", body, bar, radius_a=0.01, radius_b=0.01, stiffness=1e6))
    system = m.assemble(active=["a0"])
    result = mbs.simulate.run(system, 1.0, v0={"a0": -3.0}, step=0.1, quiet=True)
    path = mbs.export.fmu(system, tmp_path / "flat.fmu")
    found = fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=1.0,
        output_interval=2e-3,
        start_values={"a0.v": -3.0},
        output=["a0.q"],
        relative_tolerance=1e-8,
    )
    assert result["a0.q"][-1] < -3
    assert found["a0.q"][-1] == pytest.approx(result["a0.q"][-1], abs=1e-4)


def test_a_saved_state_hits_again(tmp_path):
    """Looks at an earlier state are not kept where an importer goes back."""
    system, _ = rotor()
    path = mbs.export.fmu(system, tmp_path / "again.fmu")
    folder, described = fmpy.extract(str(path)), fmpy.read_model_description(str(path))
    speed = next(v for v in described.modelVariables if v.name == "j.v").valueReference
    fmu = fmpy.instantiate_fmu(folder, described, "CoSimulation")
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.setReal([speed], [10.0])
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 0.25)
    saved, ends = fmu.getFMUState(), []
    for _ in range(2):
        fmu.doStep(0.25, 0.1)
        ends.append(fmu.getReal([speed])[0])
        fmu.setFMUState(saved)
    fmu.terminate()
    fmu.freeInstance()
    assert ends[0] == ends[1] == pytest.approx(-10.0, rel=1e-5)


def test_model_exchange_has_contacts_as_events(tmp_path):
    system, _ = bullet()
    path = mbs.export.fmu(system, tmp_path / "exchange.fmu")
    described = fmpy.read_model_description(str(path))
    assert described.numberOfEventIndicators == 1
    found = fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=1.0,
        output_interval=5e-4,  # the importer limits its steps: 5 mm of way
        start_values={"j.v": 10.0},
        output=["j.v"],
        relative_tolerance=1e-8,
    )
    assert found["j.v"][-1] == pytest.approx(-10.0, rel=1e-5)
    assert len(found["time"]) > 2001  # rows at events too
