"""Which postures are joined by a self-motion of several freedoms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.answers.target import Target
from mbs.models.inverse_geometry.arm import Array

_STEP, _STEPS = 0.15, 150
_ZERO = 1e-6
_ARRIVED = 1e-6


def connected(target: Target, q: Array, goal: Array) -> NDArray[np.bool_]:
    """Whether postures reach another one in small steps that keep the frame where it is.

    Every step goes as straight towards the goal as the null space of the Jacobian allows; one
    that gets stuck on the way counts as not connected.

    Args:
        target: the pose that is held.
        q: (m, n) solutions [rad or m].
        goal: (n,) another one.
    """
    x, end = q / target.unit, goal / target.unit
    for _ in range(_STEPS):
        way = target.wrapped(end - x)
        size = np.linalg.norm(way, axis=1, keepdims=True)
        if np.all(size < _ARRIVED):
            break
        _, J = target.excess(x)
        along = _projected(J, way * np.minimum(1.0, _STEP / np.maximum(size, 1e-300)))
        x = _corrected(target, x + along)
    arrived = np.linalg.norm(target.wrapped(end - x), axis=1) < _ARRIVED
    return np.asarray(arrived & (target.residual(x * target.unit) < target.tolerance))


def _projected(J: Array, way: Array) -> Array:
    """Ways (m, n) within the null spaces of J, (m, 6, n)."""
    _, s, Vt = np.linalg.svd(J, full_matrices=False)
    rows = np.where((s > _ZERO)[..., None], Vt, 0.0)
    across = np.einsum("mki,mi->mk", rows, way)
    return np.asarray(way - np.einsum("mki,mk->mi", rows, across))


def _corrected(target: Target, x: Array) -> Array:
    for _ in range(4):
        e, J = target.excess(x)
        U, s, Vt = np.linalg.svd(J, full_matrices=False)
        inverse = np.where(s > _ZERO, 1.0 / np.maximum(s, _ZERO), 0.0)
        amount = inverse * np.einsum("mik,mi->mk", U, e)
        x = x - np.clip(np.einsum("mki,mk->mi", Vt, amount), -_STEP, _STEP)
    return x
