"""Events of components: sampled controllers and switches, alone and beside rigid stops."""

import casadi
import fmpy
import numpy as np
import pytest
from support.messages import refused

import mbs
from mbs.components import Box, Custom, Prismatic, Revolute, RigidStop, custom
from mbs.errors import AssemblyError, ModelError

PERIOD, STIFFNESS, DAMPING = 0.1, 2.0, 1.0


class Sampled(Custom):
    """A controller that measures now and then, and holds its torque between."""

    joint = custom.coordinate()
    period = custom.parameter("s", positive=True)
    clock = custom.state("s")
    torque = custom.mode()

    def rates(self, at):
        return {"clock": 1.0}

    def loads(self, at):
        return {"joint": at.torque}

    def events(self, at):
        wanted = -STIFFNESS * at.joint.q - DAMPING * at.joint.v
        return {"samples": custom.Event(at.period - at.clock, {"clock": 0.0, "torque": wanted})}


class Thermostat(Custom):
    """A heater that switches between two temperatures."""

    T = custom.state("K", start=291.0, nominal=300.0)
    on = custom.mode(1)
    power = custom.output("K/s")

    def rates(self, at):
        return {"T": -0.5 * (at.T - 280.0) + 10.0 * at.on}

    def outputs(self, at):
        return {"power": 10.0 * at.on}

    def events(self, at):
        return {
            "switches off": custom.Event(casadi.if_else(at.on, 295.0 - at.T, 1.0), {"on": 0}),
            "switches on": custom.Event(casadi.if_else(at.on, 1.0, at.T - 290.0), {"on": 1}),
        }


def arm(*components, gravity=(0, 0, 0)):
    m = mbs.Mechanism("arm", gravity=gravity)
    bar = m.add(Box("bar", length=1.0, mass=1.0))
    m.connect(m.world, Revolute("j", axis="z"), bar.left)
    for component in components:
        m.add(component)
    return m.assemble()


def sampled_motion(inertia, count):
    """Position, velocity and torque of every instant, by exact steps."""
    q, v, torque, rows = 1.0, 0.0, 0.0, []
    for _ in range(count):
        rows.append((q, v, torque))
        a = torque / inertia
        q, v = q + v * PERIOD + a * PERIOD**2 / 2, v + a * PERIOD
        torque = -STIFFNESS * q - DAMPING * v
    return np.array(rows)


def test_a_sampled_controller_is_a_recursion():
    system = arm(Sampled("control", "j", PERIOD))
    inertia = float(mbs.models.inertia_matrix(system)([0.0]))
    result = mbs.simulate.run(system, 2.95, q0={"j": 1.0}, step=0.05, quiet=True)
    exact = sampled_motion(inertia, 30)
    np.testing.assert_allclose(result["j.q"][::2], exact[:, 0], atol=1e-9)
    np.testing.assert_allclose(result["j.v"][1::2][1:], 
                               exact[1:, 1] + exact[1:, 2] / inertia * 0.05, atol=1e-9)  # fmt: skip
    times = [time for time, name, what in result.events if (name, what) == ("control", "samples")]
    np.testing.assert_allclose(times, PERIOD * np.arange(1, 30), atol=1e-9)


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_fmu_samples_and_switches_as_run_does(tmp_path, kind, fmi):
    system = arm(Sampled("control", "j", PERIOD), Thermostat("heater"))
    path = tmp_path / "sampled.fmu"
    mbs.export.fmu(system, path, fmi=fmi)
    names = ["j.q", "heater.T", "heater.on", "heater.power", "control.torque"]
    found = fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=1.95, start_values={"j.q": 1.0}, output=names,
        output_interval=0.05, relative_tolerance=1e-10,
    )  # fmt: skip
    result = mbs.simulate.run(system, 1.95, q0={"j": 1.0}, step=0.05, quiet=True)
    # between samples, where both agree on which side of an event they are
    middle = 0.05 * np.arange(1, 40, 2)
    rows, own = (
        [int(np.argmin(np.abs(times - t))) for t in middle]
        for times in (found["time"], result.time)
    )
    for name in names:
        gap = np.abs(np.asarray(found[name])[rows] - result[name][own])
        assert gap.max() < 1e-7 * max(10.0, np.abs(result[name]).max()), name


def test_a_thermostat_switches_when_its_formula_says():
    system = arm(Thermostat("heater"))
    result = mbs.simulate.run(system, 8.0, quiet=True)
    # from 291 towards 300 up to 295, then from 295 towards 280 down to 290, and up again
    first = 2 * np.log(9 / 5)
    down, up = 2 * np.log(15 / 10), 2 * np.log(10 / 5)
    times = [first, first + down, first + down + up, first + 2 * down + up]
    times += [times[-1] + up, times[-1] + up + down, times[-1] + 2 * up + down]
    told = [(time, what) for time, name, what in result.events if name == "heater"]
    np.testing.assert_allclose([time for time, _ in told], times[: len(told)], atol=1e-7)
    assert [what for _, what in told][:3] == ["switches off", "switches on", "switches off"]
    assert len(told) >= 4
    assert result["heater.T"].max() == pytest.approx(295.0, abs=0.05)
    later = result["heater.T"][result.time > times[1]]
    assert later.min() > 290.0 - 1e-6


def test_events_stand_beside_rigid_stops():
    """A block that falls onto a stop while a controller samples: both kinds of events happen."""
    m = mbs.Mechanism("block", gravity=(0, 0, -9.81))
    block = m.add(Box("block", length=0.1, mass=2.0))
    m.connect(m.world, Prismatic("z", axis="z"), block)
    m.add(RigidStop("floor", "z", lower=0.0, restitution=0.5))
    m.add(Thermostat("heater"))
    result = mbs.simulate.run(m.assemble(), 1.5, q0={"z": 1.0}, quiet=True)
    told = [(name, what) for _, name, what in result.events]
    assert ("heater", "switches off") in told
    assert told.count(("floor", "bounces off lower")) >= 2
    time = next(time for time, name, _ in result.events if name == "floor")
    assert time == pytest.approx(np.sqrt(2 / 9.81), abs=1e-8)
    assert result["z.q"].min() > -1e-9
    heater = next(time for time, name, _ in result.events if name == "heater")
    assert heater == pytest.approx(2 * np.log(9 / 5), abs=1e-7)


def test_smooth_models_refuse_events():
    system = arm(Sampled("control", "j", PERIOD))
    refused(ModelError, "Sampled control needs", by=lambda: mbs.models.dae(system))
    refused(ModelError, "Sampled control needs", by=lambda: mbs.models.linearise(system))


class Silent(Custom):
    """A mode that nothing sets."""

    joint = custom.coordinate()
    on = custom.mode()

    def loads(self, at):
        return {"joint": at.on}


class Stray(Silent):
    """An event that sets what is no state."""

    def events(self, at):
        return {"jumps": custom.Event(at.joint.q, {"of": 1})}


class Plain(Silent):
    """No event but a number."""

    def events(self, at):
        return {"jumps": 1.0}


@pytest.mark.parametrize(
    ("kind", "part"),
    [
        (Silent, "no event sets the mode 'on'"),
        (Stray, "the event 'jumps' sets 'of', which is no state or mode"),
        (Plain, "events gives 1.0 for 'jumps'"),
    ],
)
def test_events_that_are_refused(kind, part):
    refused(AssemblyError, part, by=lambda: arm(kind("odd", "j")))
