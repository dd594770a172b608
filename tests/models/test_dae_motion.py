"""Motions by CasADi's integrators against simulations that project onto the loops."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.dae_mechanisms import floating, four_bar, rolling, rssr, slider_crank

import mbs
from mbs.models import dae

ORDER = {
    "index1": (3.0, 3.0),
    "index2": (3.0, 3.0),
    "index3": (3.0, 2.0),
    "ggl": (3.0, 3.0),
}
"""Of the two-stage Radau method, in positions and in velocities; Hairer, Lubich and Roche 1989."""

SIMULATIONS = {}


def simulated(system, duration, **start):
    """Positions (nq, 5) and velocities (nv, 5) of a simulation, at equal intervals after t = 0."""
    key = system.name, duration, repr(start)
    if key not in SIMULATIONS:
        options = dict(step=duration / 5, tolerance=1e-11, quiet=True)
        result = mbs.simulate.run(system, duration, **options, **start)
        q = [result[f"{c.name}.q"][1:] for c in system.coordinates]
        v = [result[f"{s.name}.v"][1:] for s in system.velocity_coordinates]
        SIMULATIONS[key] = np.array(q), np.array(v)
    return SIMULATIONS[key]


def moved(d, duration, method, **options):
    """Positions, velocities, algebraic equations and invariants, at five times as `simulated`."""
    times = np.linspace(0, duration, 6)[1:]
    integrator = casadi.integrator("motion", method, d.casadi(), 0, times, options)
    given = [np.tile(values, (5, 1)).T for values in (d.u0, d.p0)]
    there = integrator(x0=d.x0, z0=d.z0, u=given[0], p=d.p0)
    _, alg, invariants, q, v = d.function()(there["xf"], there["zf"], *given)
    return tuple(np.array(value) for value in (q, v, alg, invariants))


def unwound(system, q, other):
    """What is between two configurations, whole turns of revolute joints apart."""
    gap = q - other
    turns = [coordinate.unit == "rad" for coordinate in system.coordinates]
    gap[turns] = np.remainder(gap[turns] + np.pi, 2 * np.pi) - np.pi
    return gap


def radau(d, duration, stages, steps):
    return moved(
        d,
        duration,
        "collocation",
        collocation_scheme="radau",
        interpolation_order=stages,
        number_of_finite_elements=steps // 5,
        rootfinder="newton",
        rootfinder_options={"abstol": 1e-13},
        simplify=False,
    )


STARTS = {
    "smooth": (lambda: catalogue_system("four_bar"), dict(v0={"j1": 2.0}), {"j1": -3.0}),
    "four_bar": (four_bar, dict(q0={"j1": 0.3}, v0={"j1": 3.0}), {"j1": 20.0}),
    "massless": (lambda: slider_crank(0.0), dict(v0={"j1": 4.0}), {"j1": 1.0}),
    "rssr": (rssr, dict(v0={"j1": 2.0}), {}),
    "floating": (floating, {}, {}),
    "rolling": (rolling, dict(v0={"base.wx": 0.5, "base.wy": 4.0, "base.wz": 0.7}), {}),
}


@pytest.mark.sweep
@pytest.mark.parametrize("form", ["reduced", "index1"])
@pytest.mark.parametrize("name", STARTS)
def test_idas_follows_the_simulation(name, form):
    make, start, tau = STARTS[name]
    system = make()
    d = dae(system, form, tau0=tau, **start)
    # below 1e-9 the algebraic unknowns of index 1, some 100, are held by their rounding alone, and
    # the last bits of the start decide between 2,000 steps and 90,000
    tolerance = 1e-9 if form == "index1" else 1e-11
    q, v, alg, invariants = moved(d, 0.4, "idas", abstol=tolerance, reltol=tolerance)
    expected_q, expected_v = simulated(system, 0.4, tau=tau, **start)
    np.testing.assert_allclose(unwound(system, q, expected_q), 0, atol=1e-6)
    np.testing.assert_allclose(v, expected_v, atol=1e-5)
    assert np.abs(v).max() > 0.7
    assert np.abs(alg).max(initial=0) < 1e-5
    assert np.abs(invariants).max(initial=0) < 1e-6


@pytest.mark.sweep
@pytest.mark.parametrize("form", ORDER)
@pytest.mark.parametrize("name", ["smooth", "massless", "rssr", "rolling"])
def test_radau_method_has_its_order_in_every_form(name, form):
    make, start, tau = STARTS[name]
    system = make()
    d = dae(system, form, tau0=tau, **start)
    ends = [radau(d, 0.2, 2, steps)[:2] for steps in (40, 80)]
    for k, (order, expected) in enumerate(
        zip(ORDER[form], simulated(system, 0.2, tau=tau, **start), strict=True)
    ):
        coarse, fine = (np.abs(end[k] - expected).max() for end in ends)
        assert fine < 5e-2
        assert np.log2(coarse / fine) > order - 0.4


@pytest.mark.parametrize("form", ORDER)
def test_implicit_euler_converges_in_every_form(form):
    system = slider_crank()
    d = dae(system, form, v0={"j1": 2.0})
    expected, _ = simulated(system, 0.1, v0={"j1": 2.0})
    coarse, fine = (np.abs(radau(d, 0.1, 1, n)[0] - expected).max() for n in (320, 640))
    assert fine < 1e-2
    assert np.log2(coarse / fine) == pytest.approx(1, abs=0.15)


def test_what_each_form_keeps():
    system = catalogue_system("four_bar")
    r = len(system.closure.rows)
    kept = {}
    for form in ORDER:
        d = dae(system, form, v0={"j1": 2.0})
        invariants = np.abs(radau(d, 0.4, 2, 40)[3])
        kept[form] = invariants[:r].max(), invariants[r:].max()
    small, drift = 1e-11, 1e-6
    assert kept["ggl"][0] < small
    assert kept["ggl"][1] < small
    assert kept["index3"][0] < small
    assert kept["index3"][1] > drift
    assert kept["index2"][1] < small
    assert kept["index2"][0] > drift / 100
    assert kept["index1"][0] > drift / 100
