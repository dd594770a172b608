"""Which columns of sampled regressors are independent, and how the others follow from them.

Source: Gautier 1991.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_NO_EFFECT = 1e-9
"""A column shorter than this part of the longest has no effect."""
_FLOOR = 1e-16
_LARGEST_ZERO = 1e-6
"""A singular value above this part of the largest is not rounding."""
_ROUNDING = 1e-8
"""A factor so near to a whole number is one."""


@dataclass(frozen=True, slots=True, eq=False)
class Dependence:
    """The independent columns of a matrix, in the order in which they were looked at.

    Attributes:
        independent: numbers of columns.
        dependent: numbers of the others; those without any effect are among them.
        factors: (independent, dependent), the dependent columns from the independent ones.
        gap: smallest singular value that counts by the largest one that does not, both of columns
            scaled to length one; infinite when all count.
        residual: largest error of a dependent column, by the length of the longest column.
    """

    independent: tuple[int, ...]
    dependent: tuple[int, ...]
    factors: Array
    gap: float
    residual: float


def dependence(W: Array, order: Sequence[int]) -> Dependence:
    """Independent columns of a matrix: the first ones in the order that are not combinations.

    Columns without effect are dropped before the others are scaled, since scaling would turn
    their rounding into a column. The rank is where the singular values fall most; QR without
    pivoting then takes the columns in the given order.

    Args:
        W: (rows, n), at least as many rows as columns.
        order: every number of a column once, the wanted ones first.
    """
    lengths = np.linalg.norm(W, axis=0)
    longest = float(np.max(lengths, initial=0.0))
    alive = [k for k in order if lengths[k] > _NO_EFFECT * longest]
    if not alive:
        return Dependence((), tuple(range(W.shape[1])), np.zeros((0, W.shape[1])), np.inf, 0.0)
    scaled = W[:, alive] / lengths[alive]
    R = np.linalg.qr(scaled, mode="r")
    rank, gap = _rank(np.linalg.svd(R, compute_uv=False))
    diagonal = np.abs(np.diag(R))
    first = sorted(np.argsort(-diagonal, kind="stable")[:rank])
    independent = [alive[k] for k in first]
    dependent = [k for k in range(W.shape[1]) if k not in independent]
    factors = np.zeros((rank, len(dependent)))
    live = [k for k, column in enumerate(dependent) if column in alive]
    basis, others = W[:, independent], W[:, [dependent[k] for k in live]]
    solution = np.linalg.lstsq(basis / lengths[independent], others, rcond=None)[0]
    factors[:, live] = solution / lengths[independent][:, None]
    error = W[:, dependent] - basis @ factors
    residual = float(np.max(np.linalg.norm(error, axis=0), initial=0.0)) / longest
    return Dependence(tuple(independent), tuple(dependent), factors, gap, residual)


def _rank(values: Array) -> tuple[int, float]:
    """Where the falling singular values have their widest gap, and how wide it is."""
    parts = np.maximum(values / values[0], _FLOOR)
    ratios = parts[:-1] / parts[1:]
    small = parts[1:] < _LARGEST_ZERO
    if not np.any(small):
        return len(values), float("inf")
    k = int(np.argmax(np.where(small, ratios, 0.0)))
    return k + 1, float(ratios[k])


def plain(x: float) -> float:
    """A whole number without its rounding."""
    return float(round(x)) if abs(x - round(x)) < _ROUNDING else float(x)
