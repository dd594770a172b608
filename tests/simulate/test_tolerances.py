"""Tolerances of units and of single states; notes on small motions."""

import importlib

import numpy as np
import pytest
from support.catalogue_systems import CLOSED, catalogue_system

import mbs
from mbs.components import Body, Prismatic, Revolute, Spring
from mbs.errors import ModelError

INTEGRATE = importlib.import_module("mbs.solvers._integrate")


@pytest.fixture(scope="module")
def system():
    """A mass on a spring that vibrates by micrometres, and a rotor."""
    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    slider, rotor = m.add(Body("s", 1.0)), m.add(Body("r", 1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Prismatic("x", axis="x"), slider)
    m.connect(m.world, Revolute("phi", axis="z"), rotor)
    m.add(Spring("spring", m.world.at(-1, 0, 0), slider, stiffness=(2 * np.pi) ** 2, length=1.0))
    return m.assemble()


START = {"q0": {"x": 1e-6}, "v0": {"phi": 1.0}, "step": 0.05, "quiet": True}


def error(result):
    """Largest error of the vibration [m]."""
    return np.abs(result["x.q"] - 1e-6 * np.cos(2 * np.pi * result.time)).max()


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_tolerances_by_unit_and_by_name(system, method, compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(INTEGRATE, "compiler_found", lambda: False)
    coarse = mbs.simulate.run(system, 5.0, tolerance=1e-5, method=method, **START)
    assert error(coarse) > 3e-10
    for fine in ({"m": 1e-12, "m/s": 1e-12}, {"x.q": 1e-12, "x.v": 1e-12}, {"others": 1e-12}):
        given = {"others": 1e-5, **fine}
        result = mbs.simulate.run(system, 5.0, tolerance=given, method=method, **START)
        assert error(result) < 1e-10
        assert "note" not in result.info


@pytest.mark.parametrize("compiled", [True, False])
def test_relative_tolerances_of_some_states(compiled, monkeypatch):
    """A rotor far from zero on a spring: its angle may err in proportion, if it is said so."""
    if not compiled:
        monkeypatch.setattr(INTEGRATE, "compiler_found", lambda: False)
    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    rotor = m.add(Body("r", 1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("phi", stiffness=(2 * np.pi) ** 2, rest=1e4), rotor)
    system = m.assemble()

    def found(relative):
        tolerance = {"rad": (1e-9, relative), "rad/s": 1e-2}
        options = {"q0": {"phi": 1e4 + 1.0}, "step": 0.05, "quiet": True, "tolerance": tolerance}
        result = mbs.simulate.run(system, 2.0, **options)
        exact = 1e4 + np.cos(2 * np.pi * result.time)
        return np.abs(result["phi.q"] - exact).max()

    loose, tight = found(1e-7), found(1e-11)
    assert 1e-5 < loose < 1e-2
    assert tight < 1e-6


def test_small_motions_are_noted(system):
    result = mbs.simulate.run(system, 5.0, tolerance=1e-5, **START)
    assert result.info["note"] == "less than 100 tolerances: x; ask for a smaller tolerance"
    assert result.info["tolerance"] == 1e-5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"deg": 1e-6}, r"tolerance names 'deg', which is no unit and no state; use one of others"),
        ({"x": 1e-6}, r"tolerance names 'x'.*use one of others, m, rad, m/s, rad/s, x.q"),
        ({"rad": 0}, r"tolerance of rad is 0; give a finite positive number"),
        ({"rad": None}, r"tolerance of rad is None"),
        ({"rad": (1e-8, 0)}, r"tolerance of rad is 0; give a finite positive number"),
        (
            {"rad": (1e-8,)},
            r"tolerance of rad is .*give a number, or a pair of an absolute",
        ),
    ],
)
def test_other_tolerances_are_refused(system, given, message):
    with pytest.raises(ModelError, match=message):
        mbs.simulate.run(system, 1.0, tolerance=given, **START)


@pytest.mark.sweep
@pytest.mark.parametrize("name", CLOSED)
def test_errors_of_closed_mechanisms_follow_the_tolerance(name):
    """At unstable equilibria at high speed errors grow: the squeezer moves for a shorter time."""
    system, random = catalogue_system(name), np.random.default_rng(1)
    v0 = {
        system.velocity_coordinates[k].name: float(random.uniform(-1, 1))
        for k in system.independent
    }
    duration = 0.03 if name == "andrews_squeezer" else 1.0

    def motion(tolerance):
        options = {"v0": v0, "step": duration / 20, "quiet": True, "tolerance": tolerance}
        result = mbs.simulate.run(system, duration, **options)
        positions = [result[f"{one.name}.q"] for one in system.coordinates]
        velocities = [result[f"{one.name}.v"] for one in system.velocity_coordinates]
        return np.array(positions + velocities)

    exact = motion(1e-13)
    sizes = np.maximum(np.abs(exact).max(axis=1, keepdims=True), 1)
    for tolerance in (1e-5, 1e-7, 1e-9, 1e-11):
        errors = np.abs(motion(tolerance) - exact) / sizes
        assert errors.max() < 100 * tolerance
