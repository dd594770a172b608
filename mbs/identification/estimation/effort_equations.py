"""The equations of every effort by itself: least squares with a deviation for each of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mbs.identification.estimation.residuals import repetition
from mbs.identification.estimation.triangle import triangle
from mbs.identification.observations.observations import Observations

Array = npt.NDArray[np.float64]

_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A weighted least-squares solution.

    Attributes:
        values: (k,) parameters.
        root: (k, k); root' root is the inverse of the matrix of the normal equations.
        own: (m,) parameters that each effort pays for, the trace of its part of the projection.
    """

    values: Array
    root: Array
    own: Array


@dataclass(frozen=True, slots=True, eq=False)
class EffortEquations:
    """For each effort [W y] in as few rows as they have columns, and how its errors repeat.

    Attributes:
        triangles: of each effort, (at most k + 1, k + 1).
        rows: equations of each effort.
        repeated: (m,) equations that say as much as one of independent error, one or more.
    """

    triangles: tuple[Array, ...]
    rows: int
    repeated: Array

    @classmethod
    def of(cls, observations: Observations) -> EffortEquations:
        """Of observations, the errors taken as independent until `with_errors`."""
        W, y = observations.W, observations.y
        m = y.shape[1]
        parts = tuple(triangle(np.column_stack([W[:, j], y[:, j]])) for j in range(m))
        return cls(parts, len(y), np.ones(m))

    def with_errors(self, error: Array) -> EffortEquations:
        """The same, errors (n, m) showing by how much each row repeats the one before."""
        return EffortEquations(self.triangles, self.rows, repetition(error))

    def solved(self, weights: Array) -> Fit:
        """The parameters of least weighted squares, by QR of columns scaled to length one.

        Args:
            weights: (m,) of the efforts.
        """
        rows = np.vstack([w * T for w, T in zip(weights, self.triangles, strict=True)])
        A, b = rows[:, :-1], rows[:, -1]
        k, lengths = A.shape[1], np.linalg.norm(A, axis=0)
        T = triangle(np.column_stack([A / lengths, b]))
        inverse = np.linalg.inv(T[:k, :k]) / lengths[:, None]
        pairs = zip(weights, self.triangles, strict=True)
        own = [np.sum((w * X[:, :-1] @ inverse) ** 2) for w, X in pairs]
        return Fit(inverse @ T[:k, k], inverse.T, np.array(own))

    def squares(self, values: Array) -> Array:
        """(m,) sums of the squared errors of each effort."""
        with_effort = np.append(values, -1.0)
        return np.array([np.sum((T @ with_effort) ** 2) for T in self.triangles])

    def deviations(self, fit: Fit) -> Array:
        """(m,) deviation of the error of each effort [N m or N].

        Every effort pays for its part of the parameters: sum of squares over rows less `own`.
        """
        left = np.maximum(self.rows - fit.own, 1.0)
        efforts = [np.linalg.norm(T[:, -1]) / np.sqrt(self.rows) for T in self.triangles]
        return above_rounding(np.sqrt(self.squares(fit.values) / left), np.array(efforts))

    def covariance(self, fit: Fit, weights: Array, deviations: Array) -> Array:
        """(k, k) covariance of the parameters when the efforts have these deviations.

        Weights need not be those of the deviations. Rows that repeat others count as fewer.

        Source: White 1980 (deviations that differ).
        """
        scale = weights * deviations * np.sqrt(self.repeated)
        pairs = zip(weights * scale, self.triangles, strict=True)
        spread = np.vstack([f * T[:, :-1] @ fit.root.T for f, T in pairs]) @ fit.root
        return np.asarray(spread.T @ spread, dtype=float)


def above_rounding(deviations: Array, efforts: Array) -> Array:
    """(m,) deviations of errors, none so small that it is rounding.

    Args:
        deviations: (m,).
        efforts: (m,) root mean square of each effort.
    """
    least = max(_ROUNDING * float(efforts.max()), _ROUNDING**2)
    return np.asarray(np.maximum(deviations, least), dtype=float)
