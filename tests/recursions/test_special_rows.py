"""The recursions at angles and distances at which terms vanish, against a plain Newton-Euler."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.plain_newton_euler import MovingBase, plain_efforts
from support.random_trees import random_rotation
from support.special_rows import special_table

import mbs
import mbs.models

SHAPES = ("tree", "runs", "fan")


class Compared:
    """A table, its System, and a state in the order of either."""

    def __init__(self, table, seed=0):
        self.table, self.system = table, mbs.load(table).assemble()
        self.rng = np.random.default_rng(seed)
        self.rows = [int(c.name.removeprefix("q")) - 1 for c in self.system.coordinates]
        self.q, self.v, self.a = self.rng.uniform(-2, 2, (3, len(self.rows)))

    def plain(self, v, a, **around):
        return plain_efforts(self.table, self.q, v, a, **around)

    def state(self):
        return tuple(x[self.rows] for x in (self.q, self.v, self.a))

    def same(self, got, expected):
        scale = max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(np.array(got).ravel(), expected, rtol=0, atol=1e-11 * scale)

    def accelerates(self, method, tau, *around, **options):
        """The direct model gives back the accelerations whose efforts are tau."""
        q, v, a = self.state()
        ddm = mbs.models.direct_dynamics(self.system, method, **options)
        got = np.array(ddm(q, v, tau[self.rows], *around)).ravel()
        np.testing.assert_allclose(got, a, rtol=0, atol=1e-8 * max(1.0, np.abs(tau).max()))


def inertia_matrix(case):
    rest = np.zeros(len(case.rows))
    at_rest = case.plain(rest, rest)
    columns = [case.plain(rest, unit) - at_rest for unit in np.eye(len(rest))]
    return np.column_stack(columns)[np.ix_(case.rows, case.rows)]


def check_models(table, seed=0):
    case = Compared(table, seed)
    q, v, a = case.state()
    tau = case.plain(case.v, case.a)
    case.same(mbs.models.inverse_dynamics(case.system)(q, v, a), tau[case.rows])
    A = np.array(mbs.models.inertia_matrix(case.system)(q))
    np.testing.assert_allclose(A, inertia_matrix(case), rtol=0, atol=1e-12 * np.abs(A).max())
    for method in ("composite", "articulated"):
        case.accelerates(method, tau)


def drawn(seed):
    rng = np.random.default_rng(seed)
    return lambda options: options[rng.integers(len(options))]


@pytest.mark.sweep
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", range(8))
def test_models_of_random_rows(shape, seed):
    check_models(special_table(drawn(seed), shape, seed), seed)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(data=st.data(), shape=st.sampled_from(SHAPES))
def test_models_of_drawn_rows(data, shape):
    check_models(special_table(lambda options: data.draw(st.sampled_from(options)), shape))


@pytest.mark.sweep
@pytest.mark.parametrize("gamma", [0.0, pi, -pi, pi / 2, 0.4])
@pytest.mark.parametrize("alpha", [pi / 2, -pi / 2, 0.7])
def test_parallel_axes_behind_a_link_on_the_base(gamma, alpha):
    table = special_table(drawn(3), "runs", 1)
    row = dict.fromkeys(("gamma", "b", "alpha", "d", "theta", "r"), 0.0) | {"joint": "revolute"}
    turned = row | {"gamma": gamma, "alpha": alpha}
    table["frame"] = [
        row | {"antecedent": 0},
        turned | {"antecedent": 1, "b": 0.2, "d": 0.3},
        row | {"antecedent": 2, "b": 0.1, "d": 0.5, "r": -0.2},
        row | {"antecedent": 2, "d": -0.4},
        row | {"antecedent": 1, "alpha": pi / 2, "d": 0.1},
        row | {"antecedent": 3, "gamma": gamma, "d": 0.2},
    ]
    table["body"] = [
        special_table(drawn(3), "runs", k)["body"][0] | {"frame": k + 1} for k in range(6)
    ]
    check_models(table)


@pytest.mark.sweep
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", range(4))
def test_external_wrenches(shape, seed):
    case = Compared(special_table(drawn(seed + 50), shape, seed), seed)
    wrenches = case.rng.uniform(-3, 3, (6, len(case.rows)))
    tau = case.plain(case.v, case.a, f_ext=wrenches)
    bodies = [int(row.name.removeprefix("link")) - 1 for row in case.system.bodies]
    given_wrenches = wrenches[:, bodies]
    idm = mbs.models.inverse_dynamics(case.system, f_ext=True)
    case.same(idm(*case.state(), given_wrenches), tau[case.rows])
    for method in ("composite", "articulated"):
        case.accelerates(method, tau, given_wrenches, f_ext=True)


@pytest.mark.sweep
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", range(4))
def test_moving_base(shape, seed):
    case = Compared(special_table(drawn(seed + 90), shape, seed), seed)
    base = MovingBase(random_rotation(case.rng), *case.rng.uniform(-1, 1, (4, 3)))
    inputs = np.r_[base.v, base.w], np.r_[base.vd, base.wd], base.R
    tau = case.plain(case.v, case.a, base=base)
    idm = mbs.models.inverse_dynamics(case.system, moving_base=True)
    case.same(idm(*case.state(), *inputs), tau[case.rows])
    for method in ("composite", "articulated"):
        case.accelerates(method, tau, *inputs, moving_base=True)
