"""FMUs of loops with rods between ball joints, whose spin is an independent motion of its own."""

import zipfile

import numpy as np
import pytest
from fmu_instances import Fmu

import mbs
from mbs.components import Body, Free, Revolute, RigidStop, Rod, Spherical

INERTIA = (0.02, 0.05, 0.06)


def arm(name, length):
    return Body(name, mass=2.0, com=(length / 2, 0.01, 0), inertia=(0.01, 0.06, 0.06))


def leg(*elements, base=None):
    """Thigh, shank and foot; a rod with a ball at each end holds the foot to the thigh.

    The rod's centre of mass is beside its axis, so that its spin is felt by the joints.
    """
    m = mbs.Mechanism("leg", gravity=(0, -9.81, 0.7))
    hip = m.world
    if base is not None:
        hip = m.add(Body("pelvis", mass=6.0, inertia=(0.2, 0.3, 0.25)))
        m.connect(m.world, base, hip)
    thigh, shank, foot = arm("thigh", 0.5), arm("shank", 0.4), arm("foot", 0.2)
    rod = Body("rod", mass=1.5, com=(0.2, 0.03, 0), inertia=INERTIA)
    for body in (thigh, shank, foot, rod):
        m.add(body)
    m.connect(hip, Revolute("hip", actuated=True), thigh)
    m.connect(thigh.at(0.5), Revolute("knee", actuated=True), shank)
    m.connect(shank.at(0.4), Revolute("ankle", axis=(0, 0.1, 1)), foot)
    m.connect(thigh.at(0.45, 0.1, 0.05), Spherical("ball"), rod)
    m.connect(rod.at(0.42), end := Spherical("end"), foot.at(0.1, 0.08, 0.02))
    m.cut(end)
    for element in elements:
        m.add(element)
    return m.assemble(guess={"hip": -1.0, "knee": -0.4, "ankle": 0.5})


@pytest.fixture(scope="module")
def system():
    return leg()


def started(system, speeds, end=1.0):
    """A motion of the tree, and the same start as variables of the FMU."""
    names = [c.name for c in system.coordinates]
    ran = mbs.simulate.run(system, end, v0=speeds, tolerance=1e-10, quiet=True)
    start = {f"{name}.q": x for name, x in zip(names, ran.values[0], strict=False)}
    start |= {f"{s.name}.v": ran[f"{s.name}.v"][0] for s in system.velocity_coordinates}
    return ran, start


def joints_of(description):
    """The outputs that are set at the start, in the order of the states."""
    variables = description.modelVariables
    return [v.name for v in variables if v.causality == "output" and v.initial == "exact"]


def of_states(path, start):
    import fmpy

    description = fmpy.read_model_description(str(path))
    states = joints_of(description)
    return {name: value for name, value in start.items() if name in states}


def same_motion(system, ran, got, tolerance):
    for c in system.coordinates:
        np.testing.assert_allclose(got[f"{c.name}.q"], ran[f"{c.name}.q"], atol=tolerance)
    for s in system.velocity_coordinates:
        np.testing.assert_allclose(got[f"{s.name}.v"], ran[f"{s.name}.v"], atol=20 * tolerance)
    joints = {c.joint for c in system.coordinates if c.kind == "quaternion"}
    for joint in joints:
        norm = sum(got[f"{joint}.{k}.q"] ** 2 for k in ("qw", "qx", "qy", "qz"))
        np.testing.assert_allclose(norm, 1, atol=tolerance)
    energy = got["energy.kinetic"] + got["energy.potential"]
    assert np.ptp(got["energy.kinetic"]) > 0.5
    assert np.ptp(energy) < 100 * tolerance
    assert np.max(np.abs(got["closure"])) < 1e-9


SPEEDS = {"hip": 1.0, "knee": -0.5, "ball.wx": 8.0}
KINDS = ["CoSimulation", "ModelExchange"]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_rod_that_spins_between_two_balls(system, tmp_path, fmi):
    assert "ball.wx" in [system.velocity_coordinates[k].name for k in system.independent]
    ran, start = started(system, SPEEDS)
    path = mbs.export.fmu(system, tmp_path / "leg.fmu", fmi=fmi, outputs=["energy", "closure"])
    chosen = of_states(path, start)
    assert {"ball.qw.q", "ball.qz.q", "ball.wx.v", "hip.q", "knee.v"} <= set(chosen)
    for kind in KINDS:
        got = mbs.simulate.fmu(
            path, 1.0, start=chosen, kind=kind, step=0.01, tolerance=1e-10, quiet=True
        )
        same_motion(system, ran, got, 1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_on_a_floating_base(tmp_path, kind):
    """All of the base is independent, of the ball its spin alone."""
    system = leg(base=Free("base"))
    active = {system.velocity_coordinates[k].name for k in system.independent}
    assert {"base.wx", "base.wy", "base.wz", "base.vx"} < active
    speeds = {"base.wx": 1.0, "base.vz": 0.3, **SPEEDS}
    ran, start = started(system, speeds)
    path = mbs.export.fmu(system, tmp_path / "leg.fmu", outputs=["energy", "closure"])
    got = mbs.simulate.fmu(
        path, 1.0, start=of_states(path, start), kind=kind, tolerance=1e-10, step=0.01, quiet=True
    )
    same_motion(system, ran, got, 1e-5)


@pytest.mark.parametrize(("kind", "end"), [("CoSimulation", 1.0), ("ModelExchange", 0.2)])
def test_a_free_body_on_a_rod_is_independent_in_part(tmp_path, kind, end):
    """At 0.23 s the rod is across the velocity that is no state, which Co-Simulation passes."""
    m = mbs.Mechanism("kite", gravity=(0, -9.81, 0))
    body = m.add(Body("body", mass=2.0, com=(0.1, 0, 0), inertia=INERTIA))
    m.connect(m.world, Free("body_free"), body)
    m.connect(m.world, Rod("string", length=1.0), body.at(0.2, 0.1, 0))
    system = m.assemble(guess={"body_free.y": -1.0})
    assert system.closure.mobility == 5
    speeds = {"body_free.wx": 2.0, "body_free.wz": 5.0, "body_free.vx": 1.0}
    ran, start = started(system, speeds, end)
    path = mbs.export.fmu(system, tmp_path / "kite.fmu", outputs=["energy", "closure"])
    got = mbs.simulate.fmu(
        path, end, start=of_states(path, start), kind=kind, tolerance=1e-10, step=0.01, quiet=True
    )
    same_motion(system, ran, got, 1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_a_start_whose_quaternion_is_off_the_loops(system, tmp_path, kind):
    """What is solved for moves with the velocities all the same, and the state comes to it."""
    path = mbs.export.fmu(system, tmp_path / "leg.fmu", outputs=["energy", "closure"])
    got = mbs.simulate.fmu(
        path,
        1.5,
        start={"hip.q": -0.7, "knee.q": -0.5, "ball.wx.v": 6.0},
        kind=kind,
        tolerance=1e-10,
        step=0.01,
        quiet=True,
    )
    energy = got["energy.kinetic"] + got["energy.potential"]
    assert np.ptp(energy) < 1e-5
    norm = sum(got[f"ball.{k}.q"] ** 2 for k in ("qw", "qx", "qy", "qz"))
    assert abs(norm[-1] - 1) < 1e-6
    assert np.max(np.abs(got["closure"])) < 1e-9


def test_a_rigid_stop_beside_a_rod_that_spins(tmp_path):
    system = leg(RigidStop("stop", "ankle", upper=1.6, restitution=0.5))
    ran, start = started(system, {"hip": 1.0, "knee": 3.0, "ball.wx": 8.0})
    assert ran.events
    path = mbs.export.fmu(system, tmp_path / "leg.fmu", fmi="3.0", outputs=["energy", "closure"])
    for kind in KINDS:
        got = mbs.simulate.fmu(
            path,
            1.0,
            start=of_states(path, start),
            kind=kind,
            step=0.01,
            tolerance=1e-10,
            quiet=True,
        )
        last = {name: np.interp(ran.time, got.time, got[name]) for name in ("ankle.q", "ball.wx.v")}
        np.testing.assert_allclose(last["ankle.q"], ran["ankle.q"], atol=1e-3)
        assert last["ball.wx.v"][-1] == pytest.approx(ran["ball.wx.v"][-1], abs=1e-2)


def test_reference_results_have_the_spin(system, tmp_path):
    path = mbs.export.fmu(
        system, tmp_path / "leg.fmu", stop_time=0.2, step_size=0.02, reference=True
    )
    with zipfile.ZipFile(path) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith("results.csv"))
        head, *rows = archive.read(name).decode().splitlines()
    columns = head.replace('"', "").split(",")
    last = dict(zip(columns, map(float, rows[-1].split(",")), strict=True))
    ran = mbs.simulate.run(system, 0.2, tolerance=1e-10, quiet=True)
    for name in ("knee.q", "ball.wx.v", "ball.qx.q"):
        assert last[name] == pytest.approx(ran[name][-1], abs=1e-5)


def test_directional_derivatives_are_those_of_the_whole_quaternion(system, tmp_path):
    from fmpy.fmi2 import FMU2Model

    path = mbs.export.fmu(system, tmp_path / "leg.fmu")
    fmu = Fmu(path, tmp_path / "leg")
    states = [v.derivative.name for v in fmu.description.modelVariables if v.derivative is not None]
    rates = [v.name for v in fmu.description.modelVariables if v.derivative is not None]
    _, start = started(system, SPEEDS, 0.01)
    instance = fmu.open(FMU2Model, start={n: start[n] for n in joints_of(fmu.description)})
    at = fmu.get(instance, *states)
    columns = [fmu.references[name] for name in states]
    rows = [fmu.references[name] for name in rates]
    h = 1e-6
    for k, name in enumerate(states):
        moved = []
        for sign in (1, -1):
            fmu.set(instance, {name: at[k] + sign * h})
            moved.append(np.array(fmu.get(instance, *rates)))
        fmu.set(instance, {name: at[k]})
        fmu.get(instance, *rates)
        found = instance.getDirectionalDerivative(rows, [columns[k]], [1.0])
        np.testing.assert_allclose(found, (moved[0] - moved[1]) / (2 * h), atol=1e-4, rtol=1e-5)
    instance.freeInstance()
