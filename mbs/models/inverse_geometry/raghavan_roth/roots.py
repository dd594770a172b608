"""The angles of joint 3 where the matrix is singular: eigenvalues of a companion matrix.

Source: Manocha & Canny 1994.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.raghavan_roth.elimination import weights
from mbs.models.inverse_geometry.raghavan_roth.pairs import Array

_OFF_CIRCLE = 0.5  # |log| of the size of e^(i u) of roots that are kept
_OFFSETS = 0.2731 + np.arange(8) * np.pi / 4  # of joint 3 [rad], angles that no design prefers
_COARSE, _FINE = 1e-3, 1e-6  # gaps between angles that may be one multiple root, a double one [rad]
_LARGEST = 6  # solutions at one root
_ROUNDING, _TINY = 1e-16, 1e-300


def roots(M: Array) -> tuple[NDArray[np.int64], Array]:
    """The angles u of joint 3 where the matrix is singular, or nearly so for a real angle.

    Args:
        M: (N, n3, n, n) parts of the matrices, see `elimination.weights`.

    Returns:
        (m,) numbers of the matrix, ascending, and (m,) angles in [-pi, pi), of roots e^(i u) near
        the unit circle; a double root is there twice.
    """
    offset, coefficients = _rotated(M / np.max(np.abs(M), axis=(1, 2, 3), keepdims=True))
    x = np.linalg.eigvals(_companion(coefficients)).astype(complex)
    top, bottom = 1 + 1j * x, 1 - 1j * x
    size = np.log(np.abs(top) + _TINY) - np.log(np.abs(bottom) + _TINY)
    number, column = np.nonzero(np.abs(size) < _OFF_CIRCLE)
    u = (offset[:, None] + np.angle(top * np.conj(bottom)))[number, column]
    return number, (u + np.pi) % (2 * np.pi) - np.pi


def _companion(coefficients: Array) -> Array:
    """(N, d n, d n) matrices whose eigenvalues x make a polynomial of degree d in x singular."""
    count, degree, n = len(coefficients), coefficients.shape[1] - 1, coefficients.shape[-1]
    companion = np.zeros((count, degree * n, degree * n))
    companion[:, range((degree - 1) * n), range(n, degree * n)] = 1.0
    lower = np.concatenate([coefficients[:, k] for k in range(degree)], axis=-1)
    U, s, V = np.linalg.svd(coefficients[:, -1])
    s = np.maximum(s, _ROUNDING * s[:, :1] + _TINY)
    companion[:, -n:] = -np.swapaxes(V, 1, 2) @ (np.swapaxes(U, 1, 2) / s[..., None] @ lower)
    return companion


def _rotated(M: Array) -> tuple[Array, Array]:
    """Offsets (N,), and (N, d + 1, n, n) factors of 1, x, .. for u = offset + 2 atan x.

    Of eight offsets the one where the last factor, the matrix at x = infinity, is best conditioned.
    """
    far = np.einsum("ok,nkab->noab", weights(_OFFSETS + np.pi, M.shape[1]), M)
    values = np.linalg.svd(far, compute_uv=False)
    best = np.argmax(values[..., -1] / np.maximum(values[..., 0], _TINY), axis=1)
    offset = _OFFSETS[best]
    if M.shape[1] == 2:
        c, s = (part[:, None, None] for part in (np.cos(offset / 2), np.sin(offset / 2)))
        return offset, np.stack([c * M[:, 0] + s * M[:, 1], c * M[:, 1] - s * M[:, 0]], axis=1)
    c, s = (part[:, None, None] for part in (np.cos(offset), np.sin(offset)))
    cosine, sine = c * M[:, 1] + s * M[:, 2], c * M[:, 2] - s * M[:, 1]
    return offset, np.stack([M[:, 0] + cosine, 2 * sine, M[:, 0] - cosine], axis=1)


def clusters(u: Array) -> list[tuple[float, int]]:
    """Groups of angles (m,) of one matrix: their means, and how many they are.

    Roots that several solutions share are one group; a wide group is also there in narrow ones.
    """
    wide = _grouped(u, _COARSE)
    narrow = [group for group in _grouped(u, _FINE) if not any(_same(group, own) for own in wide)]
    return [(float(np.mean(group)), min(len(group), _LARGEST)) for group in wide + narrow]


def _grouped(u: Array, gap: float) -> list[Array]:
    """Around the circle, from the widest gap on."""
    if len(u) < 2:
        return [u] if len(u) else []
    u = np.sort(u)
    gaps = np.diff(np.append(u, u[0] + 2 * np.pi))
    start = int(np.argmax(gaps)) + 1
    u = np.concatenate([u[start:], u[:start] + 2 * np.pi])
    return np.split(u, np.nonzero(np.diff(u) > gap)[0] + 1)


def _same(a: Array, b: Array) -> bool:
    return len(a) == len(b) and abs(a[0] - b[0]) < _FINE
