"""Joints 4 and 5 from the null space of the matrix at an angle of joint 3.

A null vector holds the monomials x4^i x5^j, i <= 3, j <= 2, or likewise. Where m solutions share
the angle, the null space is spanned by m such vectors, and the shifts from x^i to x^(i+1) are m x m
matrices with a common basis of eigenvectors.

Source: Manocha & Canny 1994; Cao, Coutsias & Pollock 2023 for several solutions at one root.
"""

from __future__ import annotations

import numpy as np

from mbs.models.inverse_geometry.raghavan_roth.pairs import Array

_MIX = 0.6180339887  # of X5 with X4, so that eigenvalues of the sum differ


def middle_joints(M: Array, grid: tuple[int, int], count: int) -> tuple[Array, Array]:
    """The half angles x4 and x5, (N, count) each, of as many solutions as share the angle.

    Args:
        M: (N, n, n) matrices at the angles of joint 3.
        grid: numbers of powers of x4 and of x5, of which the n monomials are the products.
        count: of solutions, the dimension of the null space.
    """
    V = np.linalg.svd(M)[2][:, M.shape[-1] - count :, :]
    basis = np.swapaxes(V, -1, -2).reshape(len(M), *grid, count)
    X4 = _shift(basis[:, :-1], basis[:, 1:])
    X5 = _shift(basis[:, :, :-1], basis[:, :, 1:])
    if count == 1:
        return X4[:, :, 0], X5[:, :, 0]
    vectors = np.linalg.eig((X4 + _MIX * X5).astype(complex))[1]
    return _rayleigh(vectors, X4), _rayleigh(vectors, X5)


def _shift(low: Array, high: Array) -> Array:
    """(n, m, m) the least-squares solution X of high = low X."""
    count = low.shape[-1]
    low, high = (part.reshape(len(low), -1, count) for part in (low, high))
    return np.linalg.pinv(low, rcond=1e-13) @ high


def _rayleigh(vectors: Array, X: Array) -> Array:
    """(n, m) eigenvalues of X of the vectors in the columns; of complex ones the real part."""
    values = np.sum(np.conj(vectors) * (X @ vectors), axis=1)
    size = np.sum(np.abs(vectors) ** 2, axis=1)
    real: Array = np.real(values) / size
    return real
