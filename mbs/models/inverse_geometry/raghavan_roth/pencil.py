"""The matrix of a loop in joint 3 alone, and how far it is from being singular everywhere."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mbs.models.inverse_geometry.raghavan_roth.elimination import Elimination, at, null_rows
from mbs.models.inverse_geometry.raghavan_roth.pairs import Array

_SEED = 20260212
_ANGLES = np.array([0.4137, 2.2691, -1.5283])  # of joint 3 [rad], at which nothing is special
_RANK = 1e-9  # singular values below it, relatively, are rounding
_SLIDING, _SPARE = 0.01, 100.0  # merit of a joint 3 that slides; the most of further equations
_SMALL = 0.1  # a matrix without larger entries is rounding


@dataclass(frozen=True, slots=True, eq=False)
class Pencil:
    """What makes the matrix from the ways of a loop.

    Attributes:
        elimination: of joints 1 and 2.
        rank: of what these joints are in, eight or less, at any pose.
        mix: (n, 2 k) orthonormal rows that make n equations of the 2 k that are left.
        regularity: reciprocal condition of the matrix at angles that are no solutions, in [0, 1].
    """

    elimination: Elimination
    rank: int
    mix: Array
    regularity: float

    @property
    def merit(self) -> float:
        """The regularity, and more where equations are left over.

        The matrix then keeps its rank near postures where joints 4 and 6 of the loop align. It is
        less where joint 3 slides, whose roots at infinity are near real ones.
        """
        size, rows = self.mix.shape
        spare = min(float(rows / size) ** 12, _SPARE)
        return self.regularity * spare * (_SLIDING if self.elimination.slides else 1.0)

    def matrices(self, ways: Array) -> Array:
        """(N, n3, n, n) parts of the matrix that is singular at the solutions.

        Args:
            ways: (N, 6, 4, 4) of the loop.
        """
        right, left = self.elimination.right_side(ways), self.elimination.left_side(ways)
        E = self.elimination.equations(null_rows(right, self.rank), right, left)
        M: Array = self.mix @ self.elimination.dialytic(E)
        return M


def pencil(elimination: Elimination, ways: Array) -> Pencil:
    """The matrix of an elimination, examined at some poses.

    Args:
        elimination: of joints 1 and 2.
        ways: (N, 6, 4, 4) of the loop at generic poses that it reaches.
    """
    s = np.linalg.svd(elimination.right_side(ways)[:, :, 1:], compute_uv=False)
    rank = int(np.max(np.sum(s > _RANK * s[:, :1], axis=1)))
    rows, size = 2 * (len(elimination.elements) - 1 - rank), elimination.size
    if rows < size:
        return Pencil(elimination, rank, np.zeros((size, rows)), 0.0)
    found = Pencil(elimination, rank, _mixed(size, rows), 0.0)
    return replace(found, regularity=regularity(found.matrices(ways)))


def regularity(M: Array) -> float:
    """Reciprocal condition at angles that are no solutions, of the worst of matrices.

    Entries are of the size of one; those that are but rounding count as nothing.

    Args:
        M: (N, n3, n, n) their parts.
    """
    count = len(_ANGLES)
    values = at(np.repeat(M, count, axis=0), np.tile(_ANGLES, len(M)))
    s = np.linalg.svd(values, compute_uv=False)
    conditions = (s[:, -1] / np.maximum(s[:, 0], _SMALL)).reshape(len(M), count)
    return float(np.min(np.median(conditions, axis=1)))


def _mixed(size: int, rows: int) -> Array:
    """(size, rows) orthonormal rows, the identity where there are as many."""
    if rows == size:
        return np.eye(size)
    columns = np.random.default_rng(_SEED).standard_normal((rows, size))
    return np.linalg.qr(columns)[0].T
