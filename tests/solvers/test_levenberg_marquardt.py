"""Minima of sums of squares against numpy and geometry."""

import numpy as np
import pytest

from mbs.solvers.least_squares import levenberg_marquardt


def test_linear_least_squares_is_that_of_numpy():
    rng = np.random.default_rng(0)
    A, b = rng.normal(size=(7, 3)), rng.normal(size=7)
    found = levenberg_marquardt(lambda x: (A @ x - b, A), np.zeros(3))
    assert found.converged
    np.testing.assert_allclose(found.x, np.linalg.lstsq(A, b, rcond=None)[0], atol=1e-6)
    assert found.residual == pytest.approx(np.linalg.norm(A @ found.x - b))


@pytest.mark.parametrize("away", [2.5, 4.0])
def test_arm_stretches_towards_a_point_out_of_reach(away):
    """Two links of 1 m: the Jacobian loses rank at the minimum, where Gauss-Newton stalls."""

    def gap(q):
        a, b = np.exp(1j * q[0]), np.exp(1j * (q[0] + q[1]))
        z = a + b - away * np.exp(0.7j)
        J = np.array([1j * (a + b), 1j * b])
        return np.array([z.real, z.imag]), np.vstack([J.real, J.imag])

    found = levenberg_marquardt(gap, np.array([0.0, 1.0]))
    assert found.converged
    np.testing.assert_allclose(found.x, [0.7, 0.0], atol=1e-6)
    assert found.residual == pytest.approx(away - 2, abs=1e-12)


def test_too_few_iterations_are_told():
    found = levenberg_marquardt(
        lambda x: (np.array([x[0] ** 2 + 1]), 2 * x[None]), [3.0], iterations=3
    )
    assert not found.converged
