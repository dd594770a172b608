"""FMUs whose laws jump or pulse between communication points."""

import casadi
import fmpy
import numpy as np
import pytest

import mbs
from mbs.components import Body, Custom, Revolute, ShaftInertia, Step, Sum, TorqueSource, custom

KINDS = [
    ("CoSimulation", "dopri5"),
    ("CoSimulation", "rodas"),
    ("ModelExchange", "dopri5"),
]


def shaft(*parts):
    """A shaft of 1 kg m^2 that a torque source turns."""
    m = mbs.Mechanism("shaft")
    inertia, torque = ShaftInertia("i", 1.0), TorqueSource("t")
    m.connect(torque.flange, inertia.flange_a)
    for part in parts:
        m.connect(inertia.flange_b, part.flange)
    return m.assemble()


def arm():
    """A body of 0.35 kg m^2 that turns freely, at rest."""
    m = mbs.Mechanism("arm", gravity=(0, 0, 0))
    body = m.add(Body("body", mass=1, com=(0.5, 0, 0), inertia=0.1 * np.eye(3)))
    m.connect(m.world, Revolute("j", axis="z", actuated=True), body)
    return m.assemble()


def last(path, end, name, kind, start=None):
    """The last value of a variable in one communication step."""
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=end,
        output_interval=end,
        start_values=start or {},
        output=[name],
        fmi_type=kind,
        relative_tolerance=1e-8,
    )
    return found[name][-1]


class Side(Custom):
    """A torque that always points to one side of a shaft's angle."""

    flange = custom.flange()

    def loads(self, at):
        """Load that changes its sign at the angle zero."""
        return {"flange": -3 * casadi.sign(at.flange.angle)}


class Gate(Custom):
    """A braking torque in a narrow region of angles."""

    flange = custom.flange()

    def loads(self, at):
        """Load near one angle."""
        inside = casadi.fabs(at.flange.angle - 5.003) < 0.002
        return {"flange": casadi.if_else(inside, -20.0, 0.0)}


class Detent(Custom):
    """A torque with a jump at each tenth of a radian."""

    flange = custom.flange()

    def loads(self, at):
        """Load that counts tenths."""
        return {"flange": -casadi.floor(10 * at.flange.angle) / 10}


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(("kind", "solver"), KINDS)
def test_loads_of_components_jump_between_communication_points(tmp_path, fmi, kind, solver):
    def reached(part, end, name, start):
        path = tmp_path / f"{type(part).__name__}.fmu"
        mbs.export.fmu(shaft(part), path, fmi=fmi, solver=solver)
        return last(path, end, name, kind, start)

    quarter = np.sqrt(2 * 0.5 / 3)
    there = np.mod(10.0, 4 * quarter)
    fall = 4 * quarter - there if there > 2 * quarter else there
    exact = 0.5 - 1.5 * fall**2 if fall < quarter else 1.5 * (2 * quarter - fall) ** 2 - 0.5
    # an importer locates events less exactly than the solver inside
    near = 1e-5 if kind == "ModelExchange" else 1e-10
    assert reached(Side("side"), 10.0, "i.q", {"i.q": 0.5}) == pytest.approx(exact, abs=near)
    lost = np.sqrt(100 - 2 * 20 * 0.004)
    assert reached(Gate("gate"), 2.0, "i.v", {"i.v": 10.0}) == pytest.approx(lost, abs=near)
    run = mbs.simulate.run(shaft(Detent("d")), 2.0, v0={"i": 5.0}, tolerance=1e-10, quiet=True)
    found = reached(Detent("detent"), 2.0, "i.q", {"i.v": 5.0})
    assert found == pytest.approx(run["i.q"][-1], abs=max(near, 1e-7))


def kick(t, q, v):
    """Torque of 30 N m for a millisecond."""
    return casadi.if_else(casadi.logic_and(t > 0.4003, t < 0.4013), 30.0, 0.0)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(("kind", "solver"), KINDS)
def test_a_controller_pulses_between_communication_points(tmp_path, fmi, kind, solver):
    path = tmp_path / "arm.fmu"
    mbs.export.fmu(arm(), path, fmi=fmi, solver=solver, controller=kick)
    assert last(path, 10.0, "j.v", kind) == pytest.approx(0.03 / 0.35, abs=1e-5)


@pytest.mark.parametrize("solver", ["dopri5", "rodas"])
def test_a_controller_of_a_closed_mechanism_pulses(tmp_path, solver):
    four_bar = mbs.load("four_bar").assemble()
    run = mbs.simulate.run(four_bar, 1.0, tau=lambda t, q, v: {"j1": kick(t, q, v)}, quiet=True)
    path = tmp_path / "four_bar.fmu"
    law = lambda t, q, v: casadi.vertcat(kick(t, q, v), *[0] * (four_bar.nv - 1))  # noqa: E731
    mbs.export.fmu(four_bar, path, solver=solver, controller=law)
    assert last(path, 1.0, "j1.q", "CoSimulation") == pytest.approx(run["j1.q"][-1], abs=1e-5)


@pytest.mark.parametrize(("kind", "solver"), KINDS)
def test_a_step_source_ends_a_step(tmp_path, kind, solver):
    m = mbs.Mechanism("shaft")
    inertia, torque = ShaftInertia("i", 1.0), TorqueSource("t")
    up, down = m.add(Step("up", 2.0, 5.003)), m.add(Step("down", 2.0, 5.013))
    total = m.add(Sum("total"))
    m.connect(torque.flange, inertia.flange_a)
    m.connect_signal(up.y, total.u1)
    m.connect_signal(down.y, total.u2)
    m.connect_signal(total.y, torque.tau)
    path = tmp_path / "shaft.fmu"
    mbs.export.fmu(m.assemble(), path, solver=solver)
    assert last(path, 10.0, "i.v", kind) == pytest.approx(0.02, abs=1e-6)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_inputs_jump_at_communication_points(tmp_path, fmi):
    path = tmp_path / "shaft.fmu"
    mbs.export.fmu(shaft(), path, fmi=fmi)
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=10.0,
        output_interval=0.5,
        input=np.array(
            [(0.0, 0.0), (5.0, 0.0), (5.0, 2.0), (5.5, 2.0), (5.5, 0.0), (10.0, 0.0)],
            dtype=[("time", float), ("t.tau", float)],
        ),
        output=["i.v"],
        fmi_type="CoSimulation",
        relative_tolerance=1e-8,
    )
    assert found["i.v"][-1] == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize("solver", ["dopri5", "rodas"])
def test_max_step_shows_a_short_smooth_law(tmp_path, solver):
    path = tmp_path / "arm.fmu"
    law = lambda t, q, v: casadi.exp(-(((t - 5) / 0.01) ** 2))  # noqa: E731
    mbs.export.fmu(arm(), path, solver=solver, controller=law, max_step=0.01)
    exact = 0.01 * np.sqrt(np.pi) / 0.35
    assert last(path, 10.0, "j.v", "CoSimulation") == pytest.approx(exact, abs=1e-6)


def test_laws_that_do_not_jump_add_no_events(tmp_path):
    system = mbs.load("four_bar").assemble()
    law = lambda t, q, v: casadi.vertcat(  # noqa: E731
        casadi.fmin(5, casadi.sin(t) - v[0]), *[0] * (system.nv - 1)
    )
    path = mbs.export.fmu(system, tmp_path / "smooth.fmu", controller=law)
    assert fmpy.read_model_description(str(path)).numberOfEventIndicators <= 1
    switched = mbs.export.fmu(arm(), tmp_path / "switched.fmu", controller=kick)
    description = fmpy.read_model_description(str(switched))
    assert description.numberOfEventIndicators == 2
    names = [variable.name for variable in description.modelVariables]
    assert "controller.side1.place" in names
