"""A Panda from point to point: the optimum does not depend on how the problem is written."""

from dataclasses import replace
from itertools import pairwise

import casadi
import numpy as np
import pytest
from casadi import MX, Function
from support.catalogue_systems import catalogue_system

from mbs.models import inverse_dynamics, limits

FROM = np.array([0, -0.6, 0, -2.2, 0, 1.6, 0.8])
TO = np.array([1.4, 0.5, -0.4, -1.3, 0.4, 2.2, -0.5])
SECONDS = 1.5


@pytest.fixture(scope="module")
def arm():
    return catalogue_system("panda")


def solved(opti):
    quiet = {"print_level": 0, "sb": "yes"}
    opti.solver("ipopt", {"print_time": False, "detect_simple_bounds": True}, quiet)
    return opti.solve()


def bounded(opti, most, q, v, tau):
    """Limits for columns of q, v and tau."""
    for value, lower, upper in (
        (q, most.q_lower, most.q_upper),
        (v, most.v_lower, most.v_upper),
        (tau, most.tau_lower, most.tau_upper),
    ):
        for k in range(7):
            opti.subject_to(opti.bounded(lower[k], value[k, :], upper[k]))


def by_stages(arm, most, stages, seconds=None):
    """Accelerations constant on each stage, torques in its middle: seconds, effort, tau, v."""
    opti, size = casadi.Opti(), stages + 1
    q, v, a = (opti.variable(7, width) for width in (size, size, stages))
    total = opti.variable() if seconds is None else MX(seconds)
    h = total / stages
    opti.subject_to(casadi.vec(q[:, 1:] - q[:, :-1] - h * v[:, :-1] - h**2 / 2 * a) == 0)
    opti.subject_to(casadi.vec(v[:, 1:] - v[:, :-1] - h * a) == 0)
    middle = q[:, :-1] + h / 2 * v[:, :-1] + h**2 / 8 * a, v[:, :-1] + h / 2 * a
    tau = Function.map(inverse_dynamics(arm), stages)(*middle, a)
    bounded(opti, most, q[:, 1:-1], v[:, 1:-1], tau)
    for knot, configuration in ((0, FROM), (-1, TO)):
        opti.subject_to(q[:, knot] == configuration)
        opti.subject_to(v[:, knot] == 0)
    opti.set_initial(q, np.linspace(FROM, TO, size).T)
    effort = h * casadi.sumsqr(tau / casadi.repmat(most.tau_upper, 1, stages))
    if seconds is None:
        opti.subject_to(total >= 0.1)
        opti.set_initial(total, SECONDS)
    opti.minimize(total + 1e-4 * effort if seconds is None else effort)
    found = solved(opti)
    return [np.array(found.value(x)) for x in (total, effort, tau, v)]


def chebyshev(at, degree, order):
    """(points, degree + 1) derivatives of this order of Chebyshev's polynomials."""
    derived = [np.polynomial.chebyshev.chebder(row, order) for row in np.eye(degree + 1)]
    return np.array([np.polynomial.chebyshev.chebval(at, row) for row in derived]).T


def by_polynomials(arm, most, pieces, degree):
    """Polynomials on pieces that are shorter at the ends, the effort by Gauss's rule."""
    s, w = np.polynomial.legendre.leggauss(2 * degree)
    knots = (1 - np.cos(np.pi * np.linspace(0, 1, pieces + 1))) / 2
    opti, efforts = casadi.Opti(), []
    before, rest = MX(FROM), MX(7, 1)
    for first, last in pairwise(knots):
        half = SECONDS * (last - first) / 2
        c = opti.variable(7, degree + 1)
        q, v, a = (casadi.mtimes(c, chebyshev(s, degree, k).T) / half**k for k in range(3))
        tau = Function.map(inverse_dynamics(arm), 2 * degree)(q, v, a)
        bounded(opti, most, q, v, tau)
        load = tau / casadi.repmat(most.tau_upper, 1, 2 * degree)
        efforts.append(half * casadi.mtimes(casadi.sum1(load**2), w))
        begin, end = (
            [casadi.mtimes(c, chebyshev([at], degree, k).T) / half**k for k in (0, 1)]
            for at in (-1.0, 1.0)
        )
        opti.subject_to(begin[0] == before)
        opti.subject_to(begin[1] == rest)
        before, rest = end
        opti.set_initial(c[:, 0], FROM + (TO - FROM) * (first + last) / 2)
        opti.set_initial(c[:, 1], (TO - FROM) * (last - first) / 2)
    opti.subject_to(before == TO)
    opti.subject_to(rest == 0)
    opti.minimize(sum(efforts))
    return float(solved(opti).value(sum(efforts)))


def test_least_effort_is_that_of_polynomials(arm):
    """Stages converge with the square of their length to what smooth polynomials give."""
    wide = np.full(7, np.inf)
    most = replace(limits(arm), q_lower=-wide, q_upper=wide, v_lower=-wide, v_upper=wide)
    coarse, fine = (float(by_stages(arm, most, stages, SECONDS)[1]) for stages in (16, 32))
    exact = by_polynomials(arm, most, 6, 8)
    assert fine + (fine - coarse) / 3 == pytest.approx(exact, rel=3e-4)
    assert (coarse - exact) / (fine - exact) == pytest.approx(4, abs=0.3)


def test_least_effort_within_limits(arm):
    """Where a limit is reached there is a corner, at which polynomials lose a little."""
    most = limits(arm)
    _, effort, _, v = by_stages(arm, most, 40, SECONDS)
    assert np.abs(v[:4]).max() == pytest.approx(2.175, rel=1e-6)
    assert by_polynomials(arm, most, 5, 6) == pytest.approx(float(effort), rel=3e-3)


def test_least_time_is_where_limits_leave_nothing(arm):
    """Halved stages move it little, and everywhere some torque or velocity is at its limit."""
    most = limits(arm)
    (coarse, *_), (fine, _, tau, v) = (by_stages(arm, most, stages) for stages in (20, 40))
    used = np.abs(tau / most.tau_upper[:, None]).max(axis=0)
    fast = np.abs(v / most.v_upper[:, None]).max(axis=0)
    reached = np.maximum(used, np.maximum(fast[1:], fast[:-1])) > 0.98
    assert reached.mean() > 0.9
    assert fine < coarse < 1.03 * fine
    assert (np.abs(TO - FROM) / most.v_upper).max() < fine < SECONDS
