"""Poses into an FMU, joint positions out of it: the branch where the joints were."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ExportError, NoClosedForm
from mbs.export import inverse_geometry_fmu
from mbs.export.fmu.inverse_geometry_fmu import _model
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.functions import steps_or_all

NAMES = [*"xyz", *(f"R{r}{c}" for r in (1, 2, 3) for c in (1, 2, 3))]
START = np.array([0.3, -0.8, -0.4, 0.2, 0.6, 0.1])


def inputs_of(time, T):
    columns = [*T[:, :3, 3].T, *T[:, :3, :3].reshape(-1, 9).T]
    return {f"tool.{name}": (time, x) for name, x in zip(NAMES, columns, strict=True)}


@pytest.fixture(scope="module")
def puma():
    return catalogue_system("puma560")


@pytest.fixture(scope="module")
def path(puma, tmp_path_factory):
    return inverse_geometry_fmu(puma, tmp_path_factory.mktemp("fmu") / "puma.fmu", start=START)


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_joints_are_found_again(puma, path, kind):
    """Joint 6 goes beyond half a turn."""
    time = np.linspace(0, 1, 101)
    q = START + np.outer(np.sin(2 * time), [0.5, 0.3, -0.4, 0.6, 0.2, 7])
    dgm = mbs.models.direct_geometry(puma)
    T = np.array([np.array(dgm(x)) for x in q])
    found = mbs.simulate.fmu(path, 1.0, inputs=inputs_of(time, T), kind=kind, quiet=True)
    at = np.searchsorted(found.time, time - 1e-9)
    for k in range(6):
        np.testing.assert_allclose(found[f"q{k + 1}.q"][at], q[:, k], atol=1e-9)
    assert np.all(found["valid"][at] == 1)


def test_the_start_chooses_the_branch(puma, path):
    T = np.array(mbs.models.direct_geometry(puma)(START))
    time = np.array([0.0, 0.1])
    for other in mbs.models.inverse_geometry.solve(puma, T):
        start = {f"q{k + 1}.last": x + 0.05 for k, x in enumerate(other.q)}
        given = inputs_of(time, np.array([T, T]))
        found = mbs.simulate.fmu(path, 0.1, start=start, inputs=given, quiet=True)
        last = [found[f"q{k + 1}.q"][-1] for k in range(6)]
        np.testing.assert_allclose(last, other.q, atol=1e-9)


def test_out_of_reach_the_joints_stay(puma, path):
    T = np.array(mbs.models.direct_geometry(puma)(START))
    far = T.copy()
    far[0, 3] = 3.0
    time = np.array([0.0, 0.1])
    found = mbs.simulate.fmu(path, 0.1, inputs=inputs_of(time, np.array([far, far])), quiet=True)
    assert np.all(found["valid"] == 0)
    last = [found[f"q{k + 1}.q"][-1] for k in range(6)]
    np.testing.assert_allclose(last, START, atol=1e-12)


def test_lengths_are_parameters(tmp_path):
    m = mbs.Mechanism("arm", gravity=(0, 0, 0))
    body = m.add(mbs.components.Body("upper", mass=0))
    hand = m.add(mbs.components.Body("hand", mass=0))
    m.connect(m.world, mbs.components.Revolute("q1", axis="z"), body)
    length = mbs.Parameter("L", 0.6)
    m.connect(body.at(length, 0, 0), mbs.components.Revolute("q2", axis="z"), hand)
    m.add_frame("tool", hand.at(0.5, 0, 0))
    system = m.assemble()
    path = inverse_geometry_fmu(system, tmp_path / "arm.fmu", start=[0.2, 0.5])
    T = np.array(mbs.models.direct_geometry(system)([0.3, 0.8], [0.7]))
    given = inputs_of(np.array([0.0, 0.1]), np.array([T, T]))
    found = mbs.simulate.fmu(path, 0.1, inputs=given, parameters={"L": 0.7}, quiet=True)
    assert found["valid"][-1] == 1
    assert found["q1.q"][-1] == pytest.approx(0.3, abs=1e-9)
    assert found["q2.q"][-1] == pytest.approx(0.8, abs=1e-9)


@pytest.fixture(scope="module")
def general():
    """An arm without closed form, and its FMU."""
    system = catalogue_system("crx10")
    return system, steps_or_all(frame_chain(system, terminal_frame(system), None), "auto")


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_general_arm_follows_its_pose(general, fmi, tmp_path):
    system, _ = general
    path = inverse_geometry_fmu(system, tmp_path / "crx.fmu", start=START, fmi=fmi)
    time = np.linspace(0, 0.2, 21)
    q = START + np.outer(np.sin(2 * time), [0.5, 0.3, -0.4, 0.6, 0.2, 7])
    dgm = mbs.models.direct_geometry(system)
    T = np.array([np.array(dgm(x)) for x in q])
    found = mbs.simulate.fmu(path, 0.2, inputs=inputs_of(time, T), quiet=True)
    at = np.searchsorted(found.time, time - 1e-9)
    for k in range(6):
        np.testing.assert_allclose(found[f"q{k + 1}.q"][at], q[:, k], atol=1e-9)
    assert np.all(found["valid"][at] == 1)
    assert np.all(found["certain"][at] == 1)
    T[:, 0, 3] = 9.0
    lost = mbs.simulate.fmu(path, 0.02, inputs=inputs_of(time, T), quiet=True)
    assert not np.any(lost["valid"])
    np.testing.assert_allclose([lost[f"q{k + 1}.q"][-1] for k in range(6)], START, atol=1e-12)


def test_derivatives_of_a_general_arm_are_those_of_its_velocities(general):
    """Forward and, for FMI 3.0, reverse: a column that is NaN spoils neither."""
    system, every = general
    chain = frame_chain(system, terminal_frame(system), None)
    rhs = _model(chain, every, START).rhs
    dgm, step = mbs.models.direct_geometry(system), 1e-6 * np.arange(1.0, 7.0)
    T, before, after = (np.array(dgm(START + s * step)) for s in (0, -1, 1))
    point = [0, START, [], np.append(T[:3, 3], T[:3, :3].ravel()), [0.01]]
    change = (after - before) / 2
    along = [0, 0 * START, [], np.append(change[:3, 3], change[:3, :3].ravel()), [0.0]]
    values = rhs.call(point)
    moved = np.array(rhs.forward(1).call([*point, *values, *along])[1]).ravel()
    np.testing.assert_allclose(moved[:6], step, rtol=1e-7)
    weights = np.append(np.arange(6.0) + 1, [0, 0])
    back = np.array(rhs.reverse(1).call([*point, *values, 0 * START, weights])[3]).ravel()
    assert back @ np.array(along[3]) == pytest.approx(weights @ moved, rel=1e-9)


def test_refusals(tmp_path):
    with pytest.raises(ExportError, match="its loops must be closed too"):
        inverse_geometry_fmu(catalogue_system("sr400"), tmp_path / "x.fmu")
    with pytest.raises(NoClosedForm):
        inverse_geometry_fmu(catalogue_system("crx10"), tmp_path / "x.fmu", method="pieper")
    with pytest.raises(ExportError, match="fmi"):
        inverse_geometry_fmu(catalogue_system("scara"), tmp_path / "x.fmu", fmi="1.0")
