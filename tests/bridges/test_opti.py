"""Transcriptions into Opti: known optima, any scheme, what is refused."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.rod_mechanisms import acrobot, four_bar

import mbs
from mbs import Mechanism
from mbs.bridges import Grid, collocation, constraint_residuals, multiple_shooting, step
from mbs.components import Body, Prismatic
from mbs.errors import ModelError
from mbs.models import dae
from mbs.native import batch

QUIET = ({"print_time": False}, {"print_level": 0, "sb": "yes"})
PIVOTING = {**QUIET[1], "mumps_pivtol": 1e-2}
"""MUMPS takes pivots of 1e-6 of their column as they are, unless told. The signs of such pivots, by
which IPOPT judges the curvature, are rounding: 1e-16 in a guess made 8 steps 12 or 16."""


def slider():
    """2 kg on a rail: 2 dv/dt = u."""
    m = Mechanism("slider", gravity=(0, 0, -9.81), parameters={"m": 2.0})
    m.connect(m.world, Prismatic("s", axis="x", actuated=True), m.add(Body("b", mass="m")))
    return m.assemble()


def moved(way, goal):
    """The slider from 0 to the goal, at rest at both ends, with the least integral of u^2."""
    way.opti.subject_to(way.x[:, 0] == 0)
    way.opti.subject_to(way.x[:, -1] == [goal, 0])
    way.opti.minimize(way.integral(way.u_points**2))
    way.guess(np.zeros(2))
    way.opti.solver("ipopt", *QUIET)
    found = way.opti.solve()
    return found.value(way.opti.f)


def least(mass, goal, duration, stages):
    """The optimum for efforts that are constant on stages: u falls in a straight line."""
    h = duration / stages
    middle = duration - h * (np.arange(stages) + 0.5)
    rows = h / mass * np.array([middle, np.ones(stages)])
    u = np.linalg.lstsq(rows, np.array([goal, 0]), rcond=None)[0]
    return h * u @ u


@pytest.mark.parametrize("code", ["compiled", "interpreted"])
@pytest.mark.parametrize(("scheme", "points"), [("radau", 3), ("legendre", 2), ("radau", 2)])
def test_collocation_of_a_double_integrator_is_exact(code, scheme, points):
    opti = casadi.Opti()
    grid = Grid(stages=8, duration=2.0, code=code)
    way = collocation(opti, dae(slider()), grid, points=points, scheme=scheme, p=[3.0])
    assert moved(way, 1.5) == pytest.approx(least(3.0, 1.5, 2.0, 8), rel=1e-7)


@pytest.mark.parametrize("form", ["reduced", "function"])
def test_shooting_of_a_double_integrator_is_exact(form):
    x, u = casadi.SX.sym("x", 2), casadi.SX.sym("u")
    ode = casadi.Function("ode", [x, u], [casadi.vertcat(x[1], u / 2)])
    opti = casadi.Opti()
    model = dae(slider()) if form == "reduced" else ode
    way = multiple_shooting(opti, model, Grid(stages=8, duration=2.0, code="interpreted"))
    assert moved(way, 1.5) == pytest.approx(least(2.0, 1.5, 2.0, 8), rel=1e-7)


@pytest.mark.parametrize("stages", [1, 7])
def test_stages_in_threads_give_the_same(stages):
    costs = []
    for parallel in ("serial", "thread"):
        way = multiple_shooting(
            casadi.Opti(), dae(slider()), grid(stages=stages, parallel=parallel), substeps=2
        )
        way.opti.minimize(casadi.sumsqr(way.x[:, -1] - [1.0, 0.5]) + 0.1 * casadi.sumsqr(way.u))
        way.opti.solver("ipopt", *QUIET)
        found = way.opti.solve()
        costs.append(found.value(way.opti.f))
    assert costs[0] == costs[1]


def test_the_duration_may_be_a_variable():
    opti = casadi.Opti()
    total = opti.variable()
    grid = Grid(stages=10, duration=total, code="interpreted")
    way = multiple_shooting(opti, dae(slider()), grid)
    opti.subject_to(way.x[:, 0] == 0)
    opti.subject_to(way.x[:, -1] == [1, 0])
    opti.subject_to(opti.bounded(-4, casadi.vec(way.u), 4))
    opti.minimize(total)
    opti.subject_to(total >= 0.1)
    opti.set_initial(total, 1.0)
    opti.solver("ipopt", *QUIET)
    assert opti.solve().value(total) == pytest.approx(np.sqrt(2), rel=1e-6)  # bang-bang, 2 m/s2


def test_acrobot_finds_its_optimum():
    opti = casadi.Opti()
    way = multiple_shooting(opti, dae(acrobot()), Grid(stages=60, duration=4.0))
    hanging, upright = np.array([[-np.pi / 2, 0, 0, 0], [np.pi / 2, 0, 0, 0]])
    opti.subject_to(way.x[:, 0] == hanging)
    opti.subject_to(way.x[:, -1] == upright)
    opti.subject_to(opti.bounded(-30, way.u, 30))
    opti.minimize(way.integral(way.u**2))
    way.guess(np.linspace(hanging, upright, 61).T)
    opti.solver("ipopt", {"detect_simple_bounds": True, **QUIET[0]}, QUIET[1])
    assert opti.solve().value(opti.f) == pytest.approx(53.527, abs=1e-3)


@pytest.mark.parametrize(("form", "iterations"), [("reduced", 14), ("index2", 8), ("ggl", 8)])
def test_four_bar_finds_its_optimum(form, iterations):
    system = four_bar()
    angles = np.linspace(0.3, 4.3, 41)
    starts = [dae(system, form, q0={"j1": angle}, v0={"j1": 4.0}) for angle in angles]
    model = starts[0]
    opti = casadi.Opti()
    way = collocation(opti, model, Grid(stages=40, duration=1.0, code="interpreted"))
    names = [name for name, _ in model.elements["x"]]
    crank = [names.index("j1.q"), names.index("j1.v")]
    closed = constraint_residuals(model, way.x[:, 0], way.p)
    if closed.numel():
        opti.subject_to(closed == 0)
    opti.subject_to(way.x[crank, 0] == [0.3, 0])
    opti.subject_to(way.x[crank, -1] == [4.3, 0])
    opti.subject_to(opti.bounded(-200, way.u, 200))
    opti.minimize(way.integral(way.u_points**2))
    way.guess(np.transpose([start.x0 for start in starts]))
    opti.solver("ipopt", QUIET[0], PIVOTING)
    found = opti.solve()
    assert found.value(opti.f) == pytest.approx(28.1827, abs=2e-4)
    assert found.stats()["iter_count"] <= iterations


def test_step_is_of_order_four():
    model = dae(acrobot())
    x, u = np.array([0.3, -0.4, 1.0, 2.0]), [3.0]
    exact = np.array(step(model, 256)(x, u, [], 0.2))
    errors = [np.abs(np.array(step(model, n)(x, u, [], 0.2)) - exact).max() for n in (16, 32)]
    assert np.log2(errors[0] / errors[1]) > 3.7


def test_step_in_a_batch_is_the_step():
    model = dae(acrobot())
    advance = step(model, 3)
    states = np.random.default_rng(5).normal(size=(37, 4))
    efforts = np.linspace(-1, 1, 37)[:, None]
    found = batch(advance)(states, efforts, np.zeros(0), np.array([0.03]))
    wanted = [
        np.array(advance(x, u, [], 0.03)).ravel() for x, u in zip(states, efforts, strict=True)
    ]
    assert np.abs(found - wanted).max() < 1e-13


@pytest.mark.parametrize("make", [lambda: catalogue_system("puma560"), four_bar])
def test_steps_in_a_batch_follow_the_simulation(make):
    """A simulation with error control, through a quarter of a second with constant efforts."""
    system = make()
    model = dae(system)
    motors = [name.removesuffix(".tau") for name, _ in model.elements["u"]]
    efforts = np.random.default_rng(6).uniform(-2, 2, (9, len(motors)))
    advance, x = batch(step(model, 4)), np.repeat(model.x0[None], 9, axis=0)
    for _ in range(50):
        x = advance(x, efforts, model.p0, np.array([0.005]))
    for k in (0, 8):
        tau = dict(zip(motors, efforts[k], strict=True))
        result = mbs.simulate.run(system, 0.25, tau=tau, tolerance=1e-11, quiet=True)
        ends = [result[name][-1] for name, _ in model.elements["x"]]
        assert x[k] == pytest.approx(ends, abs=1e-9)


def test_parameters_may_be_variables():
    """The mass that needs the least effort is the smallest allowed."""
    opti = casadi.Opti()
    mass = opti.variable()
    way = multiple_shooting(opti, dae(slider()), grid(stages=8, duration=2.0), p=mass)
    opti.subject_to(opti.bounded(1.5, mass, 9))
    opti.set_initial(mass, 3)
    assert moved(way, 1.5) == pytest.approx(least(1.5, 1.5, 2.0, 8), rel=1e-5)


def test_rows_have_names_and_parameters_too():
    opti = casadi.Opti()
    way = collocation(opti, dae(slider(), "index1"), grid(), points=2, p={"m": 5.0})
    assert [way.row(n).shape for n in ("s.q", "s.v", "s.tau", "s.a", "m")] == [
        *((1, 5), (1, 5), (1, 4), (1, 8), (1, 1)),
    ]
    assert opti.debug.value(way.row("m")) == 5.0
    way.guess(np.arange(10.0).reshape(2, 5))
    assert np.array_equal(opti.debug.value(way.row("s.v"), opti.initial()), np.arange(5.0, 10.0))
    with pytest.raises(ModelError, match=r"there is no 's\.w'; did you mean"):
        way.row("s.w")


def test_integrals_of_stages_and_of_points():
    opti = casadi.Opti()
    way = collocation(opti, dae(slider()), grid(duration=2.0), points=2)
    way.guess(np.zeros(2), u=[[1, 2, 3, 4]])
    stages, points = way.integral(way.u**2), way.integral(way.u_points**2)
    found = [opti.debug.value(value, opti.initial()) for value in (stages, points)]
    assert found == pytest.approx([15.0, 15.0])


def test_guess_reaches_every_variable():
    opti = casadi.Opti()
    grid = Grid(stages=3, duration=1.0, code="interpreted")
    way = collocation(opti, dae(slider(), "index1"), grid, points=2)
    knots = np.arange(8.0).reshape(2, 4)
    way.guess(knots, u=[[1, 2, 3]], z=np.zeros(way.z_points.shape[0]))
    assert np.array_equal(opti.debug.value(way.x, opti.initial()), knots)
    repeated = np.repeat(knots[:, 1:], 2, axis=1)
    assert np.array_equal(opti.debug.value(way.x_points, opti.initial()), repeated)
    assert np.array_equal(opti.debug.value(way.u_points, opti.initial()), [1, 1, 2, 2, 3, 3])


def grid(**changes):
    return Grid(**({"stages": 4, "duration": 1.0, "code": "interpreted"} | changes))


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda o, d: grid(stages=0), "stages is 0; use 1 or more"),
        (lambda o, d: grid(stages=4.0), "stages is 4.0; use 1 or more"),
        (lambda o, d: grid(duration=0), "duration is 0 s; use a number above zero"),
        (lambda o, d: grid(duration="2"), "duration is '2'; give seconds"),
        (lambda o, d: grid(parallel="gpu"), "parallel is 'gpu'; use one of serial, thread"),
        (
            lambda o, d: multiple_shooting(None, d, grid()),
            "None is not an Opti; give",
        ),
        (lambda o, d: multiple_shooting(o, d, 40), "40 is not a Grid; give Grid"),
        (lambda o, d: multiple_shooting(o, d, grid(), p="m"), "p is 'm'; give numbers"),
        (lambda o, d: multiple_shooting(o, d, grid(), p={"M": 1}), "p has no 'M'; .*m"),
        (
            lambda o, d: constraint_residuals(3, casadi.MX(2, 1)),
            "3 is not a Dae; give mbs.models.dae",
        ),
        (
            lambda o, d: multiple_shooting(o, d, grid()).integral(casadi.MX(2, 4)),
            r"integral: the values have the shape \(2, 4\); give \(1, 4\)",
        ),
        (
            lambda o, d: multiple_shooting(o, d, grid()).guess({"s.q": 0.0}),
            "x: the guess is .*; give numbers",
        ),
        (lambda o, d: grid(code="fast"), "code is 'fast'; use one of compiled, interpreted"),
        (
            lambda o, d: multiple_shooting(o, dae(slider(), "index1"), grid()),
            "form 'index1' has 1 algebraic states; use mbs.bridges.collocation",
        ),
        (lambda o, d: multiple_shooting(o, 3, grid()), "3 has no equations"),
        (lambda o, d: multiple_shooting(o, d, grid(), substeps=0), "substeps is 0; use 1 or more"),
        (lambda o, d: multiple_shooting(o, d, grid(), p=[1, 2]), "p has 2 values, .* 1 parameters"),
        (lambda o, d: collocation(o, d, grid(), scheme="lobatto"), "scheme is 'lobatto'; use one"),
        (lambda o, d: collocation(o, d, grid(), points=10), "points is 10; use 1 to 9"),
        (
            lambda o, d: multiple_shooting(o, d, grid()).guess(np.zeros(3)),
            r"x: the guess has the shape \(3,\); give \(2, 5\), or \(2,\)",
        ),
        (lambda o, d: step(casadi.Function("f", [casadi.SX.sym("x")], [])), "f: its inputs are i0"),
        (
            lambda o, d: step(casadi.Function("f", [casadi.SX(2, 1), casadi.SX(1, 1)], [0])),
            "f: its first output has the shape",
        ),
    ],
)
def test_refuses(act, words):
    with pytest.raises(ModelError, match=words):
        act(casadi.Opti(), dae(slider()))
