"""Constants of steps through singular configurations: what each tells apart, moved tenfold."""

import importlib

import numpy as np
import pytest
from support.change_points import linkage
from support.runtime import integrate_with, with_constant

import mbs
from mbs.errors import SolverError

INTEGRATE = importlib.import_module("mbs.solvers._integrate")
PARALLELOGRAM, MEETS, ANTI = "parallelogram", "a+g=b+c", "antiparallelogram"
SYSTEMS = {
    PARALLELOGRAM: lambda: mbs.robots.n_four_bar().assemble(active=["a0"]),
    MEETS: lambda: linkage((0.4, 0.9, 0.7, 1.2), (1.0, -0.5, 1.5)),
    ANTI: lambda: linkage((0.4, 1.0, 0.4, 1.0), (1.0, -1.8, -1.5)),
    1e-8: lambda: linkage((0.4, 0.9, 0.7 + 1e-8, 1.2), (1.0, -0.5, 1.5)),
    -1e-12: lambda: linkage((0.4, 0.9, 0.7 - 1e-12, 1.2), (1.0, -0.5, 1.5)),
}
FLAT = [0.0, 0.0, 0.0]
RUNS = {
    "parallelogram": (PARALLELOGRAM, 1e-4, {"v0": {"a0": -4.0}}),
    "linkage": (MEETS, 1e-10, {"v0": {"j1": 6.0}}),
    "antiparallelogram": (ANTI, 1e-10, {"v0": {"j1": 6.0}}),
    "tight": (ANTI, 1e-11, {"v0": {"j1": 6.0}}),
    "miss": (1e-8, 1e-9, {"v0": {"j1": 6.0}}),
    "start": (ANTI, 1e-8, {"q0": FLAT, "v0": [-6 / 7, 2.0, 2.0]}),
    "miss of 3e-6": (PARALLELOGRAM, 1e-8, {"q0": FLAT, "v0": [1, -1 - 3e-6, 1 - 3e-6]}),
    "miss of 3e-7": (PARALLELOGRAM, 1e-8, {"q0": FLAT, "v0": [1, -1 - 3e-7, 1 - 3e-7]}),
}
STOPS = 1e300
MOVED = [  # constant, factor, run, parts of the tolerance that tell the one from the other
    ("PASSAGE_ON", 10, "antiparallelogram", 0.15),
    ("STEPS_AHEAD", 10, "tight", 0.1),
    ("NOISE_REJECTED", 0.1, "tight", 0.5),
    ("NOISE_REJECTIONS", 0.1, "tight", 0.16),
    ("SIGMA_FLOOR", 10, "miss", STOPS),
    ("FLOORS_REGULAR", 10, "miss", STOPS),
    ("FLOORS_BETWEEN", 0.1, "start", STOPS),
    ("MIN_ALIGNMENT", 10, "parallelogram", STOPS),
    ("NEWTON_STEPS", 0.1, "start", STOPS),
    ("NEWTON_CONVERGED", 10, "miss", 1.5),
    ("ROUNDING", 10, "miss", 3.0),
    ("START_DISTANCE", 10, "start", 0.1),
    ("START_VELOCITY", 10, "miss of 3e-6", STOPS),
    ("START_VELOCITY", 0.1, "miss of 3e-7", STOPS),
]


def scale(monkeypatch, folder, constant, factor):
    """Integrate with another value of a constant of the steps through singular configurations."""
    library = with_constant(folder, constant, lambda value: value * factor)
    integrate_with(monkeypatch, library)


def outcome(run):
    """The energy error in tolerances; infinite where the motion stops.

    Each with a system of its own: a system keeps its steps in machine code.
    """
    name, tolerance, start = RUNS[run]
    duration = 1.0 if "q0" in start else 3.0
    try:
        result = mbs.simulate.run(
            SYSTEMS[name](), duration, tolerance=tolerance, step=0.05, quiet=True, **start
        )
    except SolverError:
        return np.inf
    energy = result["kinetic_energy"] + result["potential_energy"]
    return np.ptp(energy) / result["kinetic_energy"].max() / tolerance


@pytest.mark.sweep
@pytest.mark.parametrize(("constant", "factor", "run", "bound"), MOVED)
def test_a_constant_moved_tenfold_changes_a_motion(
    monkeypatch, tmp_path, constant, factor, run, bound
):
    ours = outcome(run)
    scale(monkeypatch, tmp_path, constant, factor)
    assert (ours < bound) != (outcome(run) < bound)


def test_a_miss_is_named_where_it_is_larger_than_rounding(monkeypatch, tmp_path):
    """`BRANCHES_MEET` only chooses the words of a stop."""

    def words():
        with pytest.raises(SolverError) as stop:
            mbs.simulate.run(SYSTEMS[-1e-12](), 3.0, v0={"j1": 6.0}, tolerance=1e-10, quiet=True)
        return str(stop.value)

    assert "come near each other" in words()
    scale(monkeypatch, tmp_path, "BRANCHES_MEET", 10)
    assert "is not passed" in words()


def test_the_rows_of_many_loops_in_their_order_lead_to_the_same_motion(monkeypatch, tmp_path):
    """As if few were many: without pivots, by reflections of rows where columns are not zero."""

    def motion():
        system = mbs.robots.n_four_bar(4).assemble(active=["a0"])
        return mbs.simulate.run(system, 3.0, v0={"a0": -4.0}, tolerance=1e-8, quiet=True)

    pivots = motion()
    scale(monkeypatch, tmp_path, "MANY_ROWS", 0)
    ordered = motion()
    difference = np.abs(ordered.values - pivots.values).max(axis=0)
    assert difference.max() > 0
    uprights = [f"a{k}.q" for k in range(5)]
    for name in uprights:
        np.testing.assert_allclose(ordered[name], pivots[name], atol=1e-7)
        np.testing.assert_allclose(ordered[name], ordered["a0.q"], atol=1e-8)
    energy = ordered["kinetic_energy"] + ordered["potential_energy"]
    assert np.ptp(energy) < 5e-8 * ordered["kinetic_energy"].max()
    assert ordered["closure_residual"].max() < 1e-11
