"""Stiff equations: RODAS5P, its coefficients, its orders and published end values."""

import ast
import re

import casadi as ca
import numpy as np
import pytest
from support.order_conditions import trees, weight_errors

from mbs.core import core_files
from mbs.errors import ModelError, SolverError
from mbs.solvers import integrate

T, X = ca.SX.sym("t"), ca.SX.sym("x", 2)
BOTH = pytest.mark.parametrize("compiled", [True, False], ids=["compiled", "interpreted"])


def table(name):
    """Numbers of a constant of rodas.c."""
    text = core_files(["rodas.c"])["rodas.c"]
    found = re.search(rf"double {name}[^=]*= ([^;]*);", text)[1]
    return ast.literal_eval(found.replace("{", "[").replace("}", "]"))


A, C, TIME, TIME_SLOPE, DENSE, GAMMA = map(
    table, ("A", "C", "TIME", "TIME_SLOPE", "DENSE", "GAMMA")
)


def classical():
    """Coefficients alpha, gamma and b of the method, from those in which it is computed."""
    n = len(A)
    a, c = (np.array([[*row, *[0.0] * (n - len(row))] for row in rows]) for rows in (A, C))
    gamma = np.linalg.inv(np.eye(n) / GAMMA - c)
    return a @ gamma, gamma, a[-1] + np.eye(n)[-1]


@pytest.mark.parametrize("order", range(1, 6))
def test_order_conditions(order):
    alpha, gamma, u = classical()
    assert weight_errors(alpha, gamma, u @ gamma, order).max() < 3e-14


def test_order_conditions_of_error_estimate_and_dense_output():
    alpha, gamma, u = classical()
    embedded = u - np.eye(len(u))[-1]
    assert max(weight_errors(alpha, gamma, embedded @ gamma, k).max() for k in range(1, 5)) < 3e-14
    assert weight_errors(alpha, gamma, embedded @ gamma, 5).max() > 1e-3
    assert weight_errors(alpha, gamma, u @ gamma, 6).max() > 1e-3
    for a in (0.1, 0.4, 0.9):
        bend = np.array(DENSE[0]) + a * (np.array(DENSE[1]) + a * np.array(DENSE[2]))
        weights = (a * u + a * (1 - a) * bend) @ gamma
        assert max(weight_errors(alpha, gamma, weights, k, a).max() for k in range(1, 5)) < 5e-14


def test_number_of_trees():
    assert [len(trees(order)) for order in range(1, 7)] == [1, 1, 2, 4, 9, 20]


def test_times_are_the_row_sums():
    alpha, gamma, _ = classical()
    assert np.allclose(alpha.sum(1), TIME, rtol=0, atol=2e-14)
    assert np.allclose(gamma.sum(1), TIME_SLOPE, rtol=0, atol=2e-14)


def test_stability_on_the_imaginary_axis_and_at_infinity():
    alpha, gamma, u = classical()
    n, b, beta = len(u), u @ gamma, alpha + gamma

    def growth(z):
        return 1 + z * (b @ np.linalg.solve(np.eye(n) - z * beta, np.ones(n)))

    y = np.concatenate([np.linspace(0, 20, 2001), np.logspace(1.3, 5, 500)])
    assert max(abs(growth(1j * value)) for value in y) < 1 + 1e-12
    assert abs(growth(-1e12)) < 1e-9


def problem_with_time():
    """x' of a nonlinear system with the solution (cos t, exp(sin t))."""
    c, e = ca.cos(T), ca.exp(ca.sin(T))
    f = ca.vertcat(-ca.sin(T) * X[1] / e - (X[0] ** 3 - c**3), ca.cos(T) * X[1] + (X[0] - c) ** 2)
    return f, lambda t: np.column_stack([np.cos(t), np.exp(np.sin(t))])


def with_steps(h, end):
    """Errors of steps of length h: of the last state, and of states between the steps."""
    f, exact = problem_with_time()
    rhs = ca.Function("f", [T, X], [f])
    inside = np.arange(0.7 * h, end, h)
    options = {"method": "rodas", "rtol": 1e3, "atol": 1e3, "max_step": h}
    x = integrate(rhs, [1, 1], [0, *inside, end], **options)
    error = np.max(np.abs(x - exact(np.array([0, *inside, end]))), axis=1)
    return error[-1], np.max(error[1:-1])


def test_order_five_by_halving_the_step():
    errors = np.array([with_steps(h, 2.0) for h in (0.2, 0.1, 0.05)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.all(orders[:, 0] > 4.7)
    assert np.all(orders[:, 1] > 4.4)
    assert errors[-1].max() < 1e-6


@BOTH
def test_tolerance_is_kept(compiled):
    f, exact = problem_with_time()
    rhs = ca.Function("f", [T, X], [f])
    times = np.linspace(0, 10, 301)
    for tolerance in (1e-5, 1e-9):
        options = {"rtol": tolerance, "atol": tolerance, "compiled": compiled}
        x = integrate(rhs, [1, 1], times, method="rodas", **options)
        assert np.max(np.abs(x - exact(times))) < 20 * tolerance


def van_der_pol():
    mu = ca.SX.sym("mu")
    return ca.Function("vdp", [T, X, mu], [ca.vertcat(X[1], mu * ((1 - X[0] ** 2) * X[1] - X[0]))])


@pytest.mark.parametrize(
    ("compiled", "tolerance", "error"), [(True, 1e-9, 2e-8), (False, 1e-6, 5e-6)]
)
def test_van_der_pol_to_published_digits(compiled, tolerance, error):
    # Hairer and Wanner 1996, IV.10, in the scaled form with epsilon = 1e-6.
    options = {"method": "rodas", "rtol": tolerance, "atol": tolerance, "compiled": compiled}
    x = integrate(van_der_pol(), [2, 0], [0, 1, 2], p=1e6, **options)
    expected = [
        [-0.1863646254808130e1, 0.7535430865435460],
        [0.1706167732170456e1, -0.8928097010248257],
    ]
    assert np.allclose(x[1:], expected, rtol=0, atol=error)


def test_van_der_pol_agrees_with_the_explicit_method():
    options = {"p": 1e3, "rtol": 1e-9, "atol": 1e-9}
    a, b = (integrate(van_der_pol(), [2, 0], [0, 2], method=m, **options) for m in METHODS)
    assert np.allclose(a, b, rtol=0, atol=1e-6)


METHODS = ("dopri5", "rodas")


def published(name):
    """Equations, first and published last state of Mazzia and Magherini 2008."""
    y = ca.SX.sym("y", {"robertson": 3, "hires": 8, "oregonator": 3}[name])
    if name == "robertson":
        back, fast = 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
        f = ca.vertcat(-0.04 * y[0] + back, 0.04 * y[0] - back - fast, fast)
        last = [0.2083340149701255e-07, 0.8333360770334713e-13, 0.9999999791665050]
        return ca.Function(name, [T, y], [f]), [1, 0, 0], 1e11, last
    if name == "oregonator":
        f = ca.vertcat(
            77.27 * (y[1] + y[0] * (1 - 8.375e-6 * y[0] - y[1])),
            (y[2] - (1 + y[0]) * y[1]) / 77.27,
            0.161 * (y[0] - y[2]),
        )
        last = [0.1000814870318523e1, 0.1228178521549917e4, 0.1320554942846706e3]
        return ca.Function(name, [T, y], [f]), [1, 2, 3], 360.0, last
    meet = 280 * y[5] * y[7]
    f = ca.vertcat(
        -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
        1.71 * y[0] - 8.75 * y[1],
        -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
        8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
        -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
        -meet + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
        meet - 1.81 * y[6],
        -meet + 1.81 * y[6],
    )
    last = [
        0.7371312573325668e-3,
        0.1442485726316185e-3,
        0.5888729740967575e-4,
        0.1175651343283149e-2,
        0.2386356198831331e-2,
        0.6238968252742796e-2,
        0.2849998395185769e-2,
        0.2850001604814231e-2,
    ]
    return ca.Function(name, [T, y], [f]), [1, 0, 0, 0, 0, 0, 0, 0.0057], 321.8122, last


@pytest.mark.parametrize("name", ["robertson", "hires", "oregonator"])
def test_published_end_values(name):
    f, first, end, last = published(name)
    x = integrate(f, first, [0, end], method="rodas", rtol=1e-10, atol=1e-18)[1]
    assert np.allclose(x, last, rtol=3e-8, atol=0)


def test_interpreted_functions_give_the_same_motion():
    f, first, end, _ = published("hires")
    times = np.linspace(0, end, 50)
    a, b = (integrate(f, first, times, method="rodas", compiled=c) for c in (True, False))
    assert a.tobytes() == b.tobytes()


def test_stiff_spring_acts_as_a_rod():
    # a heavy bob on a spring of 1e9 N/m with damping, 1 kg and 1 m, beside the rigid pendulum
    x = ca.SX.sym("x", 4)
    place, velocity = x[:2], x[2:]
    length = ca.norm_2(place)
    along = place / length
    force = -(1e9 * (length - 1) + 1e4 * ca.dot(along, velocity)) * along
    rhs = ca.Function("spring", [T, x], [ca.vertcat(velocity, force - ca.DM([0, 9.81]))])
    rigid = ca.Function("rod", [T, X], [ca.vertcat(X[1], -9.81 * ca.sin(X[0]))])
    times = np.linspace(0, 3, 31)
    start = [np.sin(1.0), -np.cos(1.0), 0, 0]
    found = integrate(rhs, start, times, method="rodas", rtol=1e-8, atol=1e-8)
    angle = integrate(rigid, [1, 0], times, rtol=1e-11, atol=1e-11)[:, 0]
    assert np.max(np.abs(np.arctan2(found[:, 0], -found[:, 1]) - angle)) < 1e-6


def test_stiff_steps_are_few():
    # the explicit method cannot make the same motion in its 100 000 steps between two rows
    f = ca.Function("f", [T, X], [ca.vertcat(-1e7 * (X[0] - ca.cos(T)), X[0])])
    x = integrate(f, [0, 0], [0, 10], method="rodas", rtol=1e-6, atol=1e-6)
    assert np.allclose(x[1], [np.cos(10), np.sin(10)], atol=1e-5)
    with pytest.raises(SolverError, match="method for stiff equations"):
        integrate(f, [0, 0], [0, 10], rtol=1e-6, atol=1e-6)


def test_a_jacobian_that_is_not_finite_is_reported():
    f = ca.Function("f", [T, X], [ca.vertcat(ca.sqrt(X[0]), 0)])
    for compiled in (True, False):
        with pytest.raises(SolverError, match="not finite"):
            integrate(f, [0, 0], [0, 1], method="rodas", compiled=compiled)


@BOTH
def test_nothing_to_integrate(compiled):
    f = ca.Function("f", [T, ca.SX.sym("x", 0)], [ca.SX(0, 1)])
    options = {"method": "rodas", "compiled": compiled}
    assert integrate(f, [], [0, 1, 2], **options).shape == (3, 0)


@BOTH
def test_projection_after_each_step(compiled):
    # a damped point on a circle, beside the same motion in its angle
    x = ca.SX.sym("x", 4)
    place, velocity = x[:2], x[2:]
    pull = (ca.dot(velocity, velocity) - 9.81 * place[1]) / ca.dot(place, place)
    f = ca.vertcat(velocity, -pull * place - ca.DM([0, 9.81]) - 100 * velocity)
    rows = ca.vertcat(ca.dot(place, place) - 1, ca.dot(place, velocity))
    J = ca.jacobian(rows, x)
    onto = ca.Function("onto", [T, x], [x - J.T @ ca.solve(J @ J.T, rows), ca.norm_inf(rows)])
    times = np.linspace(0, 20, 101)
    options = {"method": "rodas", "compiled": compiled, "rtol": 1e-8, "atol": 1e-8}
    found = integrate(ca.Function("f", [T, x], [f]), [1, 0, 0, 0], times, project=onto, **options)
    assert np.max(np.abs(np.sum(found[:, :2] ** 2, 1) - 1)) < 1e-12
    swing = ca.Function("s", [T, X], [ca.vertcat(X[1], -9.81 * ca.sin(X[0]) - 100 * X[1])])
    angle = integrate(swing, [np.pi / 2, 0], times, rtol=1e-11, atol=1e-11)[:, 0]
    assert np.max(np.abs(np.arctan2(found[:, 0], -found[:, 1]) - angle)) < 1e-6


def test_unknown_method():
    with pytest.raises(ModelError, match="method is 'euler'; use 'dopri5', or 'rodas'"):
        integrate(van_der_pol(), [2, 0], [0, 1], p=1, method="euler")
