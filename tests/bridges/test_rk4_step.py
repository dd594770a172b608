"""A step keeps loops closed and quaternions of unit length, or says that it cannot."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.change_points import linkage

import mbs
from mbs.bridges import step
from mbs.components import Body, Revolute, Spherical

QUIET = {"quiet": True}


def rows_after(dae, u, count, dt, substeps=2, x0=None, **options):
    """(copies, nx) states after `count` steps, those that were flagged NaN."""
    many = mbs.native.batch(step(dae, substeps, **options))
    x = np.tile(dae.x0, (len(u), 1)) if x0 is None else x0
    for _ in range(count):
        x = many(x, u, dae.p0, np.array([dt]))
    return x


@pytest.mark.parametrize("name", ["delta", "five_bar"])
def test_rows_are_closed_or_flagged(name):
    system = catalogue_system(name)
    dae = mbs.models.dae(system)
    u = np.random.default_rng(3).uniform(-1, 1, (48, dae.u.numel()))
    x = rows_after(dae, u, 300, 0.002)
    good = np.isfinite(x).all(axis=1)
    assert 10 < good.sum() < 48  # some get to singular configurations within 0.6 s
    assert np.isnan(x[~good]).all()
    q = mbs.native.batch(dae.function())(x[good], np.zeros(0), u[good], dae.p0)[3]
    closed = mbs.loops.closure_residual(system)
    assert max(np.abs(closed(row).full()).max() for row in q) < 1e-12
    motors = [system.velocity_coordinates[k].name for k in system.independent]
    for k in np.flatnonzero(good)[:3]:
        driven = dict(zip(motors, u[k], strict=True))
        run = mbs.simulate.run(system, 0.6, tau=driven, tolerance=1e-10, step=0.1, **QUIET)
        wanted = [run[f"{c.name}.q"][-1] for c in system.coordinates]
        number = int(np.sum(good[:k]))
        away = np.remainder(q[number] - wanted + np.pi, 2 * np.pi) - np.pi
        assert np.abs(away).max() < 2e-5  # the closed form of five_bar counts no turns


@pytest.mark.parametrize(
    ("lengths", "guess", "goes_on"),
    [
        ((0.5, 1.1, 1.1, 0.5), (1.0, 0.5, 2.0), False),  # a kite, which may fold
        ((0.4, 0.9, 0.7, 1.2), (1.0, -0.5, 1.5), False),  # a + g = b + c
        ((0.4, 1.0, 0.4, 1.0), (1.0, -1.8, -1.5), True),  # crossed, the way the closed form goes
    ],
)
def test_a_change_of_branch_is_flagged(lengths, guess, goes_on):
    dae = mbs.models.dae(linkage(lengths, guess))
    x0 = np.array([[dae.x0[0], speed] for speed in np.arange(-9.0, -3.0, 0.6)])
    u = np.zeros((len(x0), dae.u.numel()))
    x = rows_after(dae, u, 100, 0.01, 1, x0)
    assert np.isfinite(x).all() == goes_on
    assert np.isnan(x).all() != goes_on
    free = rows_after(dae, u, 100, 0.01, 1, x0, checked=False)
    assert np.isfinite(free).any()  # on another branch where x is NaN
    if goes_on:
        assert np.array_equal(x, free)


def test_a_parallelogram_turns_over():
    system = catalogue_system("n_four_bar")
    dae = mbs.models.dae(system)
    x = rows_after(dae, np.zeros((1, dae.u.numel())), 120, 0.01, 1, np.array([[np.pi / 2, -4.0]]))
    start = {"q0": {"a0": np.pi / 2}, "v0": {"a0": -4.0}}
    run = mbs.simulate.run(system, 1.2, **start, tolerance=1e-10, **QUIET)
    assert x[0] == pytest.approx([run["a0.q"][-1], run["a0.v"][-1]], abs=1e-4)


def test_quaternions_stay_of_unit_length():
    m = mbs.Mechanism("top")
    body = m.add(Body("b", mass=1.0, com=(0, 0, 0.1), inertia=(0.02, 0.02, 0.01)))
    m.connect(m.world, Spherical("s"), body)
    dae = mbs.models.dae(m.assemble(), v0={"s.wx": 3.0, "s.wz": 20.0})
    advance = step(dae)
    x = casadi.DM(dae.x0)
    for _ in range(50):
        x = advance(x, [], [], 0.02)
    assert abs(float(casadi.norm_2(x[:4])) - 1) < 1e-15
    fine = step(dae, 200)(dae.x0, [], [], 1.0)
    assert float(casadi.norm_inf(x - fine)) < 1e-2


def test_rows_are_flagged_as_a_whole():
    """Also where a bad number has no effect on other states."""
    m = mbs.Mechanism("two")
    for name in ("a", "b"):
        mass = mbs.Parameter(f"M_{name}", 1.0)
        body = m.add(Body(name, mass=mass, com=(0, 0, 0.1), inertia=(0.02, 0.02, 0.01)))
        m.connect(m.world, Revolute(f"j_{name}", axis="y", actuated=True), body)
    dae = mbs.models.dae(m.assemble())
    u, p, dt = np.tile(dae.u0, (4, 1)), np.tile(dae.p0, (4, 1)), np.array([0.01])
    u[1, 0], p[2, 1] = np.nan, -0.5
    checked, free = (
        mbs.native.batch(step(dae, checked=checked))(np.tile(dae.x0, (4, 1)), u, p, dt)
        for checked in (True, False)
    )
    assert np.isnan(checked[1:3]).all()
    assert np.array_equal(checked[[0, 3]], free[[0, 3]])
    assert np.isfinite(free[2]).all()
    assert np.isfinite(free[1]).any()


def test_checks_are_not_in_the_derivatives():
    """J of a step is that of the step without checks."""
    dae = mbs.models.dae(catalogue_system("cart_pole"))
    point = [dae.x0 + 0.1, [0.3], dae.p0, 0.01, 0]
    one, other = (step(dae, checked=checked).jacobian()(*point)[0] for checked in (True, False))
    np.testing.assert_allclose(one.full(), other.full(), rtol=1e-12, atol=1e-15)
