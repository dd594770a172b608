"""How badly observations W tell parameters apart, as a number with an exact gradient.

Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997 (log-determinant); Gautier & Khalil
1992 (condition number).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, Sparsity

Array = npt.NDArray[np.float64]

Criterion = Callable[[Array], tuple[float, Array]]
"""Value, and its (n, n) gradient, for the Gram matrix W'W (n, n) of the observations."""

_POWER = 8


def log_det(G: Array) -> tuple[float, Array]:
    """-log det(W'W)/n: the mean logarithm of the variances, the same in all units but for a sum."""
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    values, vectors = np.linalg.eigh(G / np.outer(size, size))
    if values[0] <= 0:
        return np.nan, np.full(G.shape, np.nan)
    inverse = (vectors / values) @ vectors.T / np.outer(size, size)
    return -float(np.log(values).sum() + 2 * np.log(size).sum()) / len(G), -inverse / len(G)


def condition(G: Array) -> tuple[float, Array]:
    """The logarithm of the condition number of W in SI units, made smooth.

    The largest and the smallest eigenvalue of W'W are taken as norms of high order of all
    eigenvalues and of their inverses, which are never smaller.
    """
    values, vectors = np.linalg.eigh(G)
    if values[0] <= 0:
        return np.nan, np.full(G.shape, np.nan)
    up, down = (values / values[-1]) ** _POWER, (values[0] / values) ** _POWER
    value = np.log(values[-1] / values[0]) + np.log(up.sum() * down.sum()) / _POWER
    slope = (up / up.sum() - down / down.sum()) / values
    return float(value / 2), (vectors * (slope / 2)) @ vectors.T


def scaled_condition(G: Array) -> tuple[float, Array]:
    """The same of W with columns of length one, which no choice of units moves."""
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    S = G / np.outer(size, size)
    value, slope = condition(S)
    gradient = slope / np.outer(size, size)
    np.fill_diagonal(gradient, (np.diag(slope) - np.sum(slope * S, axis=1)) / size**2)
    return value, gradient


CRITERIA: Mapping[str, Criterion] = {
    "log_det": log_det,
    "condition": condition,
    "scaled_condition": scaled_condition,
}


class CriterionFunction(casadi.Callback):
    """``criterion(G) -> f`` within a CasADi graph; its Jacobian is the gradient of the criterion.

    It must be kept as long as a Function that holds it.
    """

    def __init__(self, criterion: Criterion, n: int) -> None:
        casadi.Callback.__init__(self)
        self._criterion = criterion
        self._n = n
        self._slopes: list[_Slope] = []
        self.construct("criterion", {})

    def get_n_in(self) -> int:
        """G."""
        return 1

    def get_n_out(self) -> int:
        """Its value."""
        return 1

    def get_sparsity_in(self, _: int) -> Sparsity:
        """(n, n)."""
        return Sparsity.dense(self._n, self._n)

    def get_sparsity_out(self, _: int) -> Sparsity:
        """(1, 1)."""
        return Sparsity.dense(1, 1)

    def eval(self, arguments: Sequence[DM]) -> list[DM]:
        """The value."""
        return [DM(self._criterion(np.array(arguments[0]))[0])]

    def has_jacobian(self) -> bool:
        """Yes."""
        return True

    def get_jacobian(self, name: str, *_: Any) -> casadi.Function:
        """The gradient as one row."""
        self._slopes.append(_Slope(self._criterion, self._n, name))
        return self._slopes[-1]


class _Slope(casadi.Callback):
    """``(G, f) -> df/dG`` (1, n^2)."""

    def __init__(self, criterion: Criterion, n: int, name: str) -> None:
        casadi.Callback.__init__(self)
        self._criterion = criterion
        self._n = n
        self.construct(name, {})

    def get_n_in(self) -> int:
        return 2

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, k: int) -> Sparsity:
        return Sparsity.dense(self._n, self._n) if k == 0 else Sparsity.dense(1, 1)

    def get_sparsity_out(self, _: int) -> Sparsity:
        return Sparsity.dense(1, self._n**2)

    def eval(self, arguments: Sequence[DM]) -> list[DM]:
        gradient = self._criterion(np.array(arguments[0]))[1]
        return [DM(gradient.reshape(1, -1))]
