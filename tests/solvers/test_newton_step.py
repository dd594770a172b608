import casadi as ca
import numpy as np

from mbs.solvers.linear import newton_step


def circle_and_line():
    """Where x = [a, b] sets the radius of a circle and the height of a line, p scales both."""
    x, z, p = ca.SX.sym("x", 2), ca.SX.sym("z", 2), ca.SX.sym("p")
    r = ca.vertcat(ca.sumsqr(z) - (p * x[0]) ** 2, z[1] - p * ca.sin(x[1]) * z[0])
    point = [x, z, p]
    rows = ca.Function("rows", point, [r, ca.norm_inf(r)])
    return newton_step(rows, ca.Function("slopes", point, [ca.jacobian(r, z)]))


def solved(step, x, p):
    z = np.array([1.0, 0.1])
    for _ in range(30):
        z, residual = step(x, z, p)
        z = z.full().ravel()
    assert float(residual) < 1e-14
    return z


def test_the_step_is_newtons():
    step = circle_and_line()
    z = solved(step, [2.0, 0.3], 1.5)
    slope = 1.5 * np.sin(0.3)
    exact = 3.0 / np.hypot(1, slope)
    assert np.allclose(z, [exact, exact * slope], rtol=1e-14)


def test_derivatives_at_a_solution_are_those_of_the_solution():
    step = circle_and_line()
    x, p = np.array([2.0, 0.3]), 1.5
    z = solved(step, x, p)
    by = {"x": np.array([0.4, -0.7]), "p": 0.9}
    forward = step.forward(1)(x, z, p, *step(x, z, p), by["x"], np.zeros(2), by["p"])[0]
    h = 1e-6
    moved = [solved(step, x + s * h * by["x"], p + s * h * by["p"]) for s in (1, -1)]
    assert np.allclose(forward.full().ravel(), (moved[0] - moved[1]) / (2 * h), atol=1e-8)
    weights = ca.DM([0.3, 1.1])
    gx, gz, gp = step.reverse(1)(x, z, p, *step(x, z, p), weights, 0.0)
    along = float(ca.dot(gx, ca.DM(by["x"]))) + float(gp) * by["p"]
    assert np.isclose(along, float(ca.dot(weights, forward)), rtol=1e-12)
    assert np.allclose(gz.full(), 0, atol=1e-12)
