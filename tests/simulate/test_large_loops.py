"""Mechanisms of many loops: the same motion, assembled and compiled in proportional time."""

import sys

import numpy as np
import pytest

import mbs
from mbs.models.state.tree import full_state
from mbs.native import compiler_found
from mbs.robots import n_four_bar

INTEGRATE = sys.modules["mbs.solvers._integrate"]
SCALAR = sys.modules["mbs.native.scalar_source"]
SINGULAR = sys.modules["mbs.models.state.singular_configurations"]


@pytest.mark.skipif(not compiler_found(), reason="there is no compiler")
def test_code_in_pieces_gives_the_same_bits(monkeypatch):
    """Three seconds lead through two configurations in which all rods lie on one line."""
    monkeypatch.setattr(INTEGRATE, "_WRITING", (0.0, 0.0))
    monkeypatch.setattr(INTEGRATE, "_COMPILING", (0.0, 0.0))
    whole, motions = SCALAR._body, []
    for size in (10**9, 50):
        monkeypatch.setattr(
            SCALAR, "_body", lambda f, real, _, least, size=size: whole(f, real, size, least)
        )
        motion = mbs.simulate.run(n_four_bar(2).assemble(), duration=3, v0={"a0": -1.0})
        motions.append(np.column_stack([motion[name] for name in motion.names]))
    assert np.array_equal(*motions)


def test_zeros_of_large_matrices_are_not_written_one_by_one(monkeypatch):
    system = n_four_bar(20).assemble()
    few = full_state(system).passage
    monkeypatch.setattr(SINGULAR, "_DENSE_SIZE", 10**9)
    every = full_state(system).passage
    for made, whole in ((few.rows, every.rows), (few.forces, every.forces)):
        assert made.n_instructions() < 0.65 * whole.n_instructions()
        x = np.random.default_rng(0).normal(size=2 * system.nv)
        for value, other in zip(made(0, x, []), whole(0, x, []), strict=True):
            assert np.array_equal(value.full(), other.full())


def test_many_windows_keep_two_rows_each():
    """Steps of sparse matrices find the configurations that decide the rows."""
    system = n_four_bar(55).assemble()
    closure = system.closure
    assert closure.rows == tuple(k for k in range(5 * 55) if k % 5 < 2)
    assert closure.independent == (0,)
    assert not closure.varies
    assert closure.residual < 1e-12
    q = mbs.loops.solve(system, {"a0": 2.0})
    names = [coordinate.name for coordinate in system.coordinates]
    uprights = [q[names.index(f"a{k}")] for k in range(56)]
    assert np.array(uprights) == pytest.approx(np.full(56, 2.0), abs=1e-10)


def test_models_of_many_windows_grow_in_proportion():
    short, long = (n_four_bar(count).assemble() for count in (24, 48))
    few, many = (mbs.models.direct_dynamics(system) for system in (short, long))
    assert many.n_instructions() < 2.1 * few.n_instructions()
    # all uprights turn as one: 24 and 48 windows of one mechanism each, energy by hand
    for system, count in ((short, 24), (long, 48)):
        q = mbs.loops.solve(system, {"a0": 2.1})
        inertia = (count + 1) / 3 + count  # uprights about their ends, couplers shifted by them
        weight = 9.81 * ((count + 1) / 2 + count) * np.cos(2.1)
        a = mbs.models.direct_dynamics(system)(q, 1.3, -2.0)
        assert float(a) == pytest.approx((-weight - 2.0) / inertia, rel=1e-9)
