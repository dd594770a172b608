"""Accelerations and forces of the motion on wires: filters of them, in every path."""

import numpy as np
import pytest
from support.messages import refused

import mbs
import mbs.simulate
from mbs import Mechanism
from mbs.components import (
    AbsoluteSensor,
    Body,
    FirstOrder,
    Gain,
    JointSensor,
    Prismatic,
    Revolute,
    WrenchSensor,
)
from mbs.errors import ModelError

TIME = 0.05
WIRES = {"of_joint": "joint.a", "of_force": "force.f.x", "of_tip": "tip.a.x"}


def mechanism(*, closed):
    """A driven bar, or a four-bar, with filters of an acceleration, a force and a tip."""
    m = Mechanism("m", gravity=(0, -9.81, 0))
    names = "bcd" if closed else "b"
    bars = [m.add(Body(n, mass=1, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1))) for n in names]
    b = bars[0]
    m.connect(m.world, Revolute("j", actuated=True), b)
    if closed:
        c, d = bars[1:]
        m.connect(b.at(1.0), Revolute("k"), c)
        m.connect(m.world.at(1.5), Revolute("l"), d)
        m.connect(c.at(1.6), Revolute("n"), d.at(1.2))
    m.add(JointSensor("joint", "j"))
    m.add(WrenchSensor("force", "j", axes="world"))
    m.add(AbsoluteSensor("tip", b.at(1.0)))
    for name, source in WIRES.items():
        m.connect_signal(source, m.add(FirstOrder(name, time=TIME)).u)
    return m


def filtered(time, u):
    """The exact answer of the filter to straight lines between the rows."""
    x = np.zeros(len(u))
    for k in range(len(u) - 1):
        h = time[k + 1] - time[k]
        lag = TIME * (u[k + 1] - u[k]) / h
        x[k + 1] = (x[k] - u[k] + lag) * np.exp(-h / TIME) + u[k + 1] - lag
    return x


@pytest.fixture(scope="module", params=[False, True], ids=["open", "closed"])
def system(request):
    return mechanism(closed=request.param).assemble()


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_filters_of_readings_in_run(system, method):
    result = mbs.simulate.run(system, 0.5, step=1e-3, tau={"j": 1.0}, method=method, quiet=True)
    for name, source in WIRES.items():
        wanted = filtered(result.time, result[source])
        assert np.ptp(wanted) > 0.02
        np.testing.assert_allclose(result[f"{name}.x"], wanted, atol=1e-4 * np.abs(wanted).max())


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_filters_of_readings_in_fmus(system, version, tmp_path):
    path = mbs.export.fmu(system, tmp_path / "m.fmu", version=version)
    wanted = mbs.simulate.run(system, 0.5, tau={"j": 1.0}, quiet=True)
    for kind in ("CoSimulation", "ModelExchange"):
        found = mbs.simulate.fmu(path, 0.5, inputs={"j.tau": 1.0}, kind=kind, quiet=True)
        for name in WIRES:
            assert found[f"{name}.x"][-1] == pytest.approx(wanted[f"{name}.x"][-1], rel=1e-5)


def test_rates_of_filters_in_dae_and_linearise(system):
    dae = mbs.models.dae(system)
    A = np.array(mbs.models.linearise(system).at().A)
    np.testing.assert_allclose(A[-3:, -3:], -np.eye(3) / TIME, atol=1e-9)
    assert dae.ode.numel() == len(dae.x0)
    refused(ModelError, "follows from joint.a", by=lambda: mbs.models.devices(system))


def test_a_falling_mass():
    """A constant acceleration: the filter follows 1 - exp(-t / T) exactly."""
    m = Mechanism("m", gravity=(0, 0, -9.81))
    m.connect(m.world, Prismatic("z", axis="z"), m.add(Body("w", mass=2.0)))
    m.add(JointSensor("s", "z"))
    gain, lag = m.add(Gain("g", 2.0)), m.add(FirstOrder("lag", time=TIME))
    m.connect_signal("s.a", gain.u)
    m.connect_signal(gain.y, lag.u)
    result = mbs.simulate.run(m.assemble(), 0.3, tolerance=1e-10, quiet=True)
    wanted = -2 * 9.81 * (1 - np.exp(-result.time / TIME))
    np.testing.assert_allclose(result["lag.x"], wanted, atol=1e-7)
    np.testing.assert_allclose(result["g.y"], -2 * 9.81, rtol=1e-12)
