"""Rigid stops and Coulomb friction in the FMU of a mechanism, against simulations of the system."""

import fmpy
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.contact_mechanisms import block, pendulum, stick_slip, stopped_rocker

import mbs
from mbs.components import CoulombFriction, RigidStop
from mbs.export.fmu.options import FmuOptions
from mbs.export.fmu.system_fmu import fmu_model
from mbs.export.fmu.variables import jumps
from mbs.models.state.independent import minimal_state


def stopped_pendulum():
    stop = RigidStop("end", joint="q", lower=-2.5, upper=0.2, restitution=0.8)
    return pendulum(stop, CoulombFriction("dry", joint="q", sliding=0.4, sticking=0.5))


def simulated(path, kind, duration, start):
    """The motion in an importer; rows of it at a hundred equal steps, after events there."""
    table = fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=duration,
        output_interval=duration / 100,
        start_values=start,
        relative_tolerance=1e-10,
    )
    times = np.linspace(0, duration, 101)
    rows = [np.flatnonzero(np.abs(table["time"] - t) < 1e-9)[-1] for t in times]
    return table[rows]


def test_the_description_has_modes_and_indicators():
    model = fmu_model(stopped_pendulum())
    assert [mode.name for mode in model.modes] == ["end.mode", "dry.mode"]
    assert model.jumps.names == (
        "end lower",
        "end upper",
        "end leaves lower or dry slides up",
        "end leaves upper or dry slides down",
        "dry stops",
    )
    assert [variable.name for variable in model.outputs][-2:] == ["end.effort", "dry.effort"]
    assert [variable.unit for variable in model.outputs][-2:] == ["N.m", "N.m"]
    assert all("-1 at the lower limit" in mode.description for mode in model.modes[:1])


def test_nothing_jumps_without_contacts():
    system = catalogue_system("four_bar")
    assert jumps(system, minimal_state(system)) is None
    assert fmu_model(system).jumps is None


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def pendulum_fmu(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("events") / "pendulum.fmu"
    return mbs.export.fmu(stopped_pendulum(), path, fmi=request.param)


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_pendulum_with_stops_and_friction_moves_as_in_a_simulation(pendulum_fmu, kind):
    fmu = simulated(pendulum_fmu, kind, 4.0, {"q.q": 0.1, "q.v": 1.0})
    own = mbs.simulate.run(
        stopped_pendulum(),
        4.0,
        q0={"q": 0.1},
        v0={"q": 1.0},
        step=0.04,
        tolerance=1e-11,
        quiet=True,
    )
    assert len(own.events) >= 4
    for name in ("q.q", "q.v", "end.effort", "dry.effort"):
        assert np.abs(fmu[name] - own[name]).max() < 2e-6, name
    for name in ("end.mode", "dry.mode"):
        assert np.array_equal(fmu[name], own[name])


def test_a_rocker_comes_to_rest_on_its_stop_and_leaves_no_trace_of_drift(tmp_path):
    system = stopped_rocker()
    path = mbs.export.fmu(system, tmp_path / "rocker.fmu", fmi="3.0")
    fmu, outside = (
        simulated(path, kind, 3.0, {"a1.tau": 8.0}) for kind in ("CoSimulation", "ModelExchange")
    )
    own = mbs.simulate.run(
        system, 3.0, q0={}, tau={"a1": 8.0}, step=0.03, tolerance=1e-11, quiet=True
    )
    assert own.events[-1][1:] == ("end", "rests at upper")
    for name in ("a1.q", "b1.q", "a1.v"):
        assert np.abs(fmu[name] - own[name]).max() < 1e-7, name
        assert np.abs(outside[name] - own[name]).max() < 1e-5, name
    assert np.array_equal(fmu["end.mode"], own["end.mode"])
    assert outside["end.mode"][-1] == 1
    rests = fmu["end.mode"] == 1
    assert rests.sum() > 20
    assert np.abs(fmu["b1.q"][rests] - 2.2).max() < 1e-9
    assert np.abs(fmu["end.effort"] - own["end.effort"]).max() < 1e-6


def test_a_carriage_with_a_prescribed_acceleration_pulls_a_block_that_sticks_and_slips(tmp_path):
    system = stick_slip()
    model = fmu_model(system, FmuOptions(inputs=("pull.a",)))
    assert [variable.name for variable in model.inputs] == ["x.tau", "pull.a"]
    path = mbs.export.fmu(system, tmp_path / "pulled.fmu", inputs=("pull.a",))
    fmu = simulated(path, "CoSimulation", 6.0, {"pull.v": 0.5})
    own = mbs.simulate.run(
        system,
        6.0,
        v0={"pull": 0.5},
        motion={"pull.a": 0.0},
        step=0.06,
        tolerance=1e-11,
        quiet=True,
    )
    assert len(own.events) == 3
    for name in ("x.q", "dry.effort", "pull.tau"):
        assert np.abs(fmu[name] - own[name]).max() < 1e-6, name


def test_a_start_beyond_a_limit_is_refused_by_the_name_of_the_stop(tmp_path):
    system = block(0.3, RigidStop("end", joint="x", upper=0.5))
    path = mbs.export.fmu(system, tmp_path / "beyond.fmu")
    messages = []
    with pytest.raises(Exception, match="fmi2"):
        fmpy.simulate_fmu(
            str(path),
            stop_time=0.1,
            start_values={"x.q": 0.6},
            logger=lambda *words: messages.append(words[-1].decode()),
        )
    assert any("end upper" in message for message in messages)
