"""Where an FMU finds events and what they do, in co-simulation and model exchange."""

import ctypes
import dataclasses

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu
from fmu_instances import SOLVERS, TIGHT, Fmu, refused
from fmu_models import block, fall, impact_times

import mbs
from mbs.components import Body, CoulombFriction, Revolute, RigidStop
from mbs.export.fmu.pack import write_fmu

MODELS = ("ball", "block", "clapper", "stopped_crank")


# ---- co-simulation ----


@SOLVERS
def test_a_ball_bounces_as_the_formula_says(fmu_of, solver):
    fmu = fmu_of("ball", solver=solver)
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    rows = fmu.step(instance, 30, 0.1)
    expected = fall(0.1 * np.arange(1, 31))
    assert np.allclose(rows[:, 0], expected[:, 0], rtol=0, atol=1e-9)
    assert np.allclose(rows[:, 2], expected[:, 1], rtol=0, atol=1e-9)
    assert expected[-1, 1] < 10 * 0.8**10
    instance.freeInstance()


def test_a_ball_comes_to_rest_and_stays_there(fmu_of):
    fmu = fmu_of("ball")
    instance = fmu.open(FMU2Slave)
    fmu.step(instance, 1, 4.5)
    assert fmu.get(instance, "rests", "h", "v").tolist() == [1, 0, 0]
    fmu.step(instance, 1, 5.0, begin=4.5)
    assert fmu.get(instance, "rests", "h", "v").tolist() == [1, 0, 0]
    instance.freeInstance()


@pytest.mark.parametrize("solver", ["dopri5", "rk4"])
def test_the_energy_of_a_bouncing_pendulum_falls_by_the_restitution(fmu_of, solver):
    fmu = fmu_of("clapper", solver=solver)
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    gravity, e = 9.81 / 0.5, 0.9
    energy, hits = -gravity * np.cos(1.0), 0
    floor = -gravity * np.cos(0.5)
    for row in fmu.step(instance, 60, 0.05):
        while hits < row[-1]:
            energy, hits = floor + e**2 * (energy - floor), hits + 1
        assert fmu.description.outputs[2].variable.name == "energy"
        assert row[2] == pytest.approx(energy, abs=1e-8 if solver != "rk4" else 1e-7)
    assert hits >= 3
    instance.freeInstance()


def test_a_block_slides_sticks_and_slides_again(fmu_of):
    fmu = fmu_of("block")
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    stop = 1.0 / (3 / 2)  # deceleration 1.5 m/s2 from 1 m/s
    fmu.step(instance, 1, 1.0)
    assert fmu.get(instance, "v", "mode").tolist() == [0, 0]
    assert fmu.get(instance, "s")[0] == pytest.approx(stop / 2, abs=1e-12)
    fmu.set(instance, {"force": 2.9})
    fmu.step(instance, 1, 1.0, begin=1.0)
    assert fmu.get(instance, "v", "mode").tolist() == [0, 0]
    fmu.set(instance, {"force": -5.0})
    fmu.step(instance, 1, 1.0, begin=2.0)
    assert fmu.get(instance, "mode", "v") == pytest.approx([-1, -1.0], abs=1e-12)
    assert fmu.get(instance, "s")[0] == pytest.approx(stop / 2 - 0.5, abs=1e-12)
    instance.freeInstance()


@SOLVERS
def test_a_slider_meets_a_stop_through_its_loop(fmu_of, solver):
    fmu = fmu_of("stopped_crank", solver=solver)
    instance = fmu.open(FMU2Slave, tolerance=TIGHT)
    fmu.set(instance, {"torque": 0.0})
    angle = speed = ratio = None
    before = []
    for k in range(200):
        instance.doStep(k * 1e-3, 1e-3)
        angle, speed, hits = fmu.get(instance, "crank.q", "crank.v", "hits")
        if hits:
            ratio = speed / before[-1]
            break
        before.append(speed)
    # the slider is at 0.35 m where the cosine rule has the crank
    meets = np.arccos((0.1**2 + 0.35**2 - 0.3**2) / (2 * 0.1 * 0.35))
    assert angle == pytest.approx(meets, abs=6e-3)
    assert -0.72 < ratio < -0.68
    instance.freeInstance()


def test_communication_steps_do_not_change_where_events_are(fmu_of):
    ends = []
    for steps in (3, 100):
        instance = fmu_of("clapper").open(FMU2Slave, tolerance=TIGHT)
        ends.append(fmu_of("clapper").step(instance, steps, 3.0 / steps)[-1])
        instance.freeInstance()
    assert np.allclose(ends[0], ends[1], rtol=0, atol=1e-7)


# ---- model exchange ----


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", MODELS)
def test_model_exchange_equals_co_simulation(fmu_of, name, fmi):
    path = str(fmu_of(name, fmi).path)
    assert validate_fmu(path) == []
    options = {"stop_time": 2.0, "relative_tolerance": 1e-11, "output_interval": 0.25}
    me, cs = (
        fmpy.simulate_fmu(path, fmi_type=kind, record_events=False, **options)
        for kind in ("ModelExchange", "CoSimulation")
    )
    for column in cs.dtype.names:
        assert np.allclose(me[column], cs[column], rtol=0, atol=1e-6), column


def test_an_integrator_outside_finds_the_impacts(fmu_of):
    rows = fmpy.simulate_fmu(
        str(fmu_of("ball").path),
        fmi_type="ModelExchange",
        relative_tolerance=1e-12,
        output_interval=0.5,
        stop_time=2.2,
        record_events=True,
    )
    turned = np.flatnonzero(np.diff(rows["v"]) > 1) + 1
    times = rows["time"][turned]
    assert np.array_equal(times, rows["time"][turned - 1])
    assert np.allclose(times, impact_times(len(times)), rtol=0, atol=1e-9)
    assert len(times) == 4


def test_a_crude_integrator_outside_gets_through_the_bounces(fmu_of):
    rows = fmpy.simulate_fmu(
        str(fmu_of("ball").path),
        fmi_type="ModelExchange",
        solver="Euler",
        step_size=1e-3,
        output_interval=1e-3,
        stop_time=6.0,
        record_events=False,
    )
    assert np.abs(rows["h"] - fall(rows["time"])[:, 0]).max() < 0.05
    assert abs(rows["h"][-1]) < 1e-3


class Outside:
    """An integrator outside: puts states, reads indicators."""

    def __init__(self, fmu, **start):
        self.fmu = fmu
        self.instance = fmu.open(FMU2Model, start=start, tolerance=1e-8)

    def shown(self, *x):
        self.instance.setContinuousStates((ctypes.c_double * 2)(*x), 2)
        values = (ctypes.c_double * 1)()
        self.instance.getEventIndicators(values, 1)
        assert self.fmu.get(self.instance, "indicator.floor") == values[0]
        return values[0]

    def event(self):
        self.instance.enterEventMode()
        info = self.instance.newDiscreteStates()
        self.instance.enterContinuousTimeMode()
        x = (ctypes.c_double * 2)()
        self.instance.getContinuousStates(x, 2)
        assert info[0] is False or not info[0]
        return bool(info[3]), list(x)


def test_indicators_have_hysteresis_and_are_never_zero(fmu_of):
    outside = Outside(fmu_of("ball"))
    step = outside.instance.completedIntegratorStep
    assert outside.shown(0.5, -3.0) == 0.5
    assert outside.shown(0.0, -4.0) < 0
    assert outside.shown(-1e-3, -4.0) == -1e-3  # an overshoot
    assert outside.event() == (True, [-1e-3, 3.2])
    for height in (-1e-3, -5e-4, 0.0, 5e-9):
        assert outside.shown(height, 3.0) > 1e-4
        assert step()[0] in (False, 0)
    assert outside.shown(-1.9e-3, -1.0) > 0
    assert outside.shown(-2.1e-3, -1.0) < 0  # it never left, and falls again
    assert outside.shown(0.1, 3.0) > 0.1
    step()
    assert outside.shown(0.1, 3.0) == 0.1
    assert outside.shown(-1e-12, -3.0) == -1e-12
    assert outside.event()[1][1] == pytest.approx(2.4)
    assert outside.event() == (False, [-1e-12, outside.event()[1][1]])
    outside.instance.freeInstance()


def test_indicators_have_derivatives(fmu_of):
    fmu = fmu_of("stopped_crank", "3.0")
    instance = fmu.running(FMU3Model)
    watched, angle = (fmu.references[n] for n in ("indicator.slider_stop", "crank.q"))
    place = fmu.references["place"]
    slope = instance.getDirectionalDerivative([watched], [angle, place], [1.0, 0.0], 1)[0]
    q, rod = 0.3, np.arcsin(0.1 / 0.3 * np.sin(0.3))
    assert slope == pytest.approx(-0.1 * np.sin(q) - 0.1 * np.cos(q) * np.tan(rod), rel=1e-12)
    back = instance.getAdjointDerivative([watched], [angle, place], [2.0], 2)
    assert back == pytest.approx([2 * slope, -2.0], rel=1e-12)
    assert instance.getNumberOfEventIndicators() == 1
    instance.freeInstance()


def test_an_indicator_that_had_no_value_has_one_again(fmu_of):
    instance = fmu_of("logarithm").open(FMU2Model)
    found = (ctypes.c_double * 1)()
    at = {x: (ctypes.c_double * 1)(x) for x in (0.5, -0.5)}
    for x in (0.5, -0.5, 0.5):
        instance.setContinuousStates(at[x], 1)
        if x < 0:
            refused(instance.getEventIndicators, found, 1)
        else:
            instance.getEventIndicators(found, 1)
            assert found[0] == pytest.approx(5 + np.log(x), rel=1e-15)
        instance.getDerivatives(found, 1)
        assert found[0] == -1.0
    instance.freeInstance()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_modes_are_integers(fmu_of, fmi):
    fmu = fmu_of("block", fmi)
    (mode,) = (v for v in fmu.description.modelVariables if v.name == "mode")
    assert (mode.type, mode.variability) == ("Integer" if fmi == "2.0" else "Int32", "discrete")
    assert validate_fmu(str(fmu.path)) == []
    instance = fmu.open(FMU2Slave) if fmi == "2.0" else fmu.running(FMU3Slave)
    get = instance.getInteger if fmi == "2.0" else instance.getInt32
    put = instance.setInteger if fmi == "2.0" else instance.setInt32
    real = instance.getReal if fmi == "2.0" else instance.getFloat64
    reference = [mode.valueReference]
    assert get(reference) == [1]
    instance.doStep(0.0, 1.0)
    assert get(reference) == [0]
    refused(instance.getBoolean, reference)
    refused(get, [fmu.references["v"]])
    refused(put, reference, [1])
    assert real(reference) == [0.0]  # to hosts that know real numbers alone, as CasADi
    instance.freeInstance()


def test_modes_that_are_no_integers_are_refused(tmp_path):
    model = block()
    point = [ca.SX.sym(n, model.rhs.size1_in(k)) for k, n in enumerate("txzup")]
    half = ca.Function("first", point, [0.5, ca.SX(2, 1)])
    model = dataclasses.replace(model, jumps=dataclasses.replace(model.jumps, first=half))
    fmu = Fmu(write_fmu(model, tmp_path / "half.fmu"), tmp_path / "half")
    instance = fmu.open(FMU2Slave, upto="initialization")
    refused(instance.getInteger, [fmu.references["mode"]])
    instance.freeInstance()


@pytest.mark.parametrize(
    ("kind", "words"), [("2.0", "ModelExchange"), ("3.0", "CoSimulation")], ids=["2", "3"]
)
def test_the_modes_of_stops_and_friction_have_bounds(kind, words, tmp_path):
    m = mbs.Mechanism("hit", gravity=(0, -9.81, 0))
    rod = m.add(Body("rod", mass=1.0, com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), rod)
    m.add(RigidStop("stop", "j1", lower=-1.0))
    m.add(CoulombFriction("dry", "j1", sliding=0.1))
    path = mbs.export.fmu(m.assemble(), tmp_path / "hit.fmu", fmi=kind)
    assert validate_fmu(str(path)) == []
    variables = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    for name in ("stop.mode", "dry.mode"):
        v = variables[name]
        assert (v.type[:3], v.min, v.max) == ("Int", "-1", "1")
    found = mbs.simulate.fmu(path, 2.0, kind=words, quiet=True)
    assert set(found["stop.mode"]) <= {-1.0, 0.0}
    assert -1.0 in found["stop.mode"]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_casadi_reads_modes_as_real_numbers_and_their_slopes_as_zero(fmu_of, fmi):
    """Its importer asks for all outputs as such."""
    fmu = fmu_of("block", fmi)
    built = ca.DaeBuilder("block", str(fmu.folder))
    f = built.create("f", ["x", "u"], ["ode", "y"])
    names, y = list(built.y()), f([0.0, 1.0], [0.0])[1].full().ravel()
    assert y[names.index("mode")] == 1.0
    J = f.jacobian()([0.0, 1.0], [0.0], [], [])
    rows = [ca.DM(block).full() for block in J[2:]]  # of y by x and by u
    assert not np.any([row[names.index("mode")] for row in rows[:1]])
    assert rows[1][names.index("a")] == pytest.approx(0.5)
