"""Steps of many loops through singular configurations: sparse matrices give the same motion."""

import importlib

import casadi
import numpy as np
import pytest
from support.change_points import rod
from support.runtime import integrate_with, with_constant

import mbs
from mbs.components import Revolute, Spherical
from mbs.errors import SolverError
from mbs.models.state import singular_configurations
from mbs.solvers import problem

INTEGRATE = importlib.import_module("mbs.solvers._integrate")


def windows(count, longer=0.0, balls=False):
    """Square windows in a row, the coupler in the middle longer; on balls at one end."""
    m = mbs.Mechanism("windows", gravity=(0, -9.81, 0))
    uprights = [m.add(rod(f"u{k}", 1.0)) for k in range(count + 1)]
    for k, upright in enumerate(uprights):
        m.connect(m.world.at(k), Revolute(f"a{k}", axis="z", actuated=False), upright)
    for k in range(count):
        length = 1.0 + longer * (k == count // 2)
        coupler, closing = m.add(rod(f"c{k}", length)), Revolute(f"e{k}", axis="z")
        hinge = Spherical(f"b{k}") if balls else Revolute(f"b{k}", axis="z", actuated=False)
        m.connect(uprights[k].at(1), hinge, coupler)
        m.connect(coupler.at(length), closing, uprights[k + 1].at(1))
        m.cut(closing)
    m.guess.update({f"a{k}": np.pi / 2 for k in range(count + 1)})
    if not balls:
        m.guess.update({f"b{k}": -np.pi / 2 for k in range(count)})
    return m.assemble(active=["a0"])


def motion(system, duration=3.0, tolerance=1e-8):
    return mbs.simulate.run(system, duration, v0={"a0": -4.0}, tolerance=tolerance, quiet=True)


@pytest.mark.parametrize(("count", "balls"), [(20, False), (4, True)])
def test_sparse_matrices_give_the_bits_of_dense_ones(monkeypatch, count, balls):
    given, patterns = INTEGRATE._sparsity_arrays, []

    def seen(pattern):
        patterns.append(given(pattern))
        return patterns[-1]

    monkeypatch.setattr(INTEGRATE, "_sparsity_arrays", seen)
    sparse = motion(windows(count, balls=balls), 1.0)
    assert sum(pattern is not None for pattern in patterns) >= 2  # slopes and inertia
    patterns.clear()
    monkeypatch.setattr(singular_configurations, "_DENSE_SIZE", 10**9)
    dense = motion(windows(count, balls=balls), 1.0)
    assert all(pattern is None for pattern in patterns)
    assert np.array_equal(sparse.values, dense.values)
    energy = sparse["kinetic_energy"] + sparse["potential_energy"]
    assert np.ptp(energy) < 5e-8 * sparse["kinetic_energy"].max()


@pytest.mark.parametrize(("longer", "end"), [(0.0, -16.16758), (1e-6, 0.140902)])
def test_factors_of_rows_find_the_side_and_the_gap(monkeypatch, tmp_path, longer, end):
    """As if a window were many: it passes flat configurations, and reverses beside them."""
    few = motion(windows(1, longer))
    library = with_constant(tmp_path, "MANY_ROWS", lambda value: 0)
    integrate_with(monkeypatch, library)
    many = motion(windows(1, longer))
    # a reversal beside a singular configuration magnifies rounding by 1e10
    assert few["a0.q"][-1] == pytest.approx(end, abs=1e-5)
    assert many["a0.q"][-1] == pytest.approx(end, abs=1e-5)


def test_twenty_windows_that_do_not_quite_meet_stop():
    with pytest.raises(SolverError, match="a singular configuration is not passed") as stop:
        motion(windows(20, longer=1e-6))
    assert "t = 0.3296" in str(stop.value)


def test_vectors_stay_dense_where_matrices_are_sparse():
    x = casadi.SX.sym("x", 4)
    matrix, vector = casadi.SX(2, 2), casadi.SX(2, 1)
    matrix[0, 0] = vector[0] = x[0]
    outputs = [vector, matrix]
    txp = [casadi.MX.sym("t"), casadi.MX.sym("x", 4), casadi.MX(0, 1)]
    named = casadi.Function("rows", [casadi.SX.sym("t"), x, casadi.SX(0, 1)], outputs)
    forces = casadi.Function("forces", [casadi.SX.sym("t"), x, casadi.SX(0, 1)], [matrix])
    passage = problem.Passage(named, forces, forces, (2, 2, 0, 2, 0, 2, 0), 1.0)
    found = problem._passage(passage, txp)
    assert found.rows.sparsity_out(0).is_dense()
    assert found.rows.sparsity_out(1).nnz() == 1
