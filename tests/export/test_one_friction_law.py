"""Simulation, FMU, identification and optimal control have one law of friction and of stops."""

import ctypes

import casadi
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model
from fmu_instances import Fmu

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    JointFriction,
    JointStop,
    Prismatic,
)
from mbs.identification import known_efforts, regressor, symbolic_parameters
from mbs.models import ContactPoint, contact_phases, dae
from mbs.models.state.tree import full_state

MASS, DRY, WIDTH, VISCOUS = 2.0, 3.0, 0.05, 0.7
SLIDING, MORE, FALL, NARROW = 1.1, 0.5, 0.3, 0.02
UPPER, STIFFNESS, DAMPING, DEPTH = 0.4, 500.0, 20.0, 0.01
STATES = [(0.0, v) for v in (0.0, 1e-3, -0.02, 0.3, -2.0)] + [(0.405, 0.1), (0.43, -0.2), (-0.3, 1)]


def by_hand(q, v):
    """The effort that the slide needs besides its inertia."""
    joint = DRY * np.tanh(v / WIDTH) + VISCOUS * v
    element = (SLIDING + MORE * np.exp(-((v / FALL) ** 2))) * np.tanh(v / NARROW)
    u = np.clip((q - UPPER) / DEPTH, 0, 1)
    inside = DEPTH * u**3 * (1 - u / 2) + max(q - UPPER - DEPTH, 0)
    spring = STIFFNESS * inside
    return joint + element + spring + np.clip(DAMPING * u**2 * (3 - 2 * u) * v, -spring, spring)


@pytest.fixture(scope="module")
def system():
    m = Mechanism("slide", gravity=(0, 0, 0))
    body = m.add(Body("body", mass=MASS, inertia=(1, 1, 1)))
    joint = Prismatic("s", axis="x", actuated=True, Fs=DRY, Fs_width=WIDTH, Fv=VISCOUS)
    m.connect(m.world, joint, body)
    rough = dict(coulomb=SLIDING, stribeck=MORE, velocity=FALL, width=NARROW)
    m.add(JointFriction("rough", "s", **rough))
    stop = dict(upper=UPPER, stiffness=STIFFNESS, damping=DAMPING, width=DEPTH)
    m.add(JointStop("stop", "s", **stop))
    return m.assemble()


@pytest.fixture(scope="module")
def exported(system, tmp_path_factory):
    folder = tmp_path_factory.mktemp("slide")
    instance = Fmu(mbs.export.fmu(system, folder / "slide.fmu"), folder / "unpacked").open(
        FMU2Model
    )

    def effort(q, v):
        instance.setContinuousStates((ctypes.c_double * 2)(q, v), 2)
        rates = (ctypes.c_double * 2)()
        instance.getDerivatives(rates, 2)
        return -MASS * rates[1]

    yield effort
    instance.freeInstance()


def functions(system):
    """effort(q, v) of every other place, as a casadi.Function."""
    q, v = casadi.SX.sym("q"), casadi.SX.sym("v")
    x = casadi.vertcat(q, v)
    made = {"simulation": -MASS * full_state(system).rhs(0, x, casadi.DM(0, 1))[1]}
    columns = regressor(system)
    known = known_efforts(system, "independent")(q, v)
    values = symbolic_parameters(system, columns.columns)
    made["identification"] = casadi.mtimes(columns(q, v, 0), values) + known
    for form in ("reduced", "index1"):
        d = dae(system, form)
        rate, alg, *_ = d.function()(x, casadi.SX(d.z.numel(), 1), 0, casadi.SX(0, 1))
        made[form] = -MASS * rate[1] if form == "reduced" else alg[0]
    phases = contact_phases(system, [ContactPoint("tip", "body")])
    nothing = casadi.SX(3, 1)
    made["contact phases"] = phases.residuals()(q, v, 0, 0, nothing)[0]
    made["inverse dynamics"] = mbs.models.inverse_dynamics(system)(q, v, 0)
    return {name: casadi.Function("effort", [q, v], [value]) for name, value in made.items()}


def test_every_place_has_the_same_effort(system, exported):
    places = {**functions(system), "fmu": exported}
    assert len(places) == 7
    for q, v in STATES:
        expected = by_hand(q, v)
        for name, effort in places.items():
            found = float(effort(q, v))
            assert found == pytest.approx(expected, rel=1e-13, abs=1e-14), (name, q, v)


def test_every_place_has_the_same_slope_at_rest(system, exported):
    """At v = 0 the slope is that of the widths: dry / width + viscous."""
    expected = DRY / WIDTH + VISCOUS + (SLIDING + MORE) / NARROW
    h = 1e-7
    for q in (0.0, UPPER):
        for name, effort in functions(system).items():
            x, y = casadi.MX.sym("q"), casadi.MX.sym("v")
            slope = casadi.Function("slope", [x, y], [casadi.jacobian(effort(x, y), y)])
            assert float(slope(q, 0)) == pytest.approx(expected, rel=1e-13), name
        difference = (exported(q, h) - exported(q, -h)) / (2 * h)
        assert difference == pytest.approx(expected, rel=1e-8)


def test_a_width_of_zero_is_a_step_in_every_place():
    """The sign at rest is zero, and so is its slope: nothing becomes NaN."""
    for width in (0.0, "w"):
        m = Mechanism("slide", gravity=(0, 0, 0), parameters={"w": 0.0} if width else {})
        body = m.add(Body("body", mass=MASS, inertia=(1, 1, 1)))
        joint = Prismatic("s", axis="x", actuated=True, Fs=DRY, Fs_width=width)
        m.connect(m.world, joint, body)
        system = m.assemble()
        q, v = casadi.SX.sym("q"), casadi.SX.sym("v")
        p = [system.p_default] if width else []
        idm = mbs.models.inverse_dynamics(system)(q, v, 0, *p)
        d = dae(system, "index1")
        alg = d.function()(casadi.vertcat(q, v), 0, 0, d.p0)[1]
        estimated = casadi.mtimes(
            regressor(system)(q, v, 0, *p), symbolic_parameters(system, regressor(system).columns)
        )
        for effort in (idm, alg, estimated):
            f = casadi.Function("f", [q, v], [effort, casadi.jacobian(effort, v)])
            assert [float(x) for x in f(0, 0)] == [0, 0]
            assert [float(x) for x in f(0, 1e-6)] == [DRY, 0]
