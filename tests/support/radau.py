"""Stiff motions by Radau's method of order 5 with given steps, in plain numpy."""

from __future__ import annotations

import numpy as np

_S6 = np.sqrt(6)
_C = np.array([(4 - _S6) / 10, (4 + _S6) / 10, 1])
_A = np.array(
    [
        [(88 - 7 * _S6) / 360, (296 - 169 * _S6) / 1800, (-2 + 3 * _S6) / 225],
        [(296 + 169 * _S6) / 1800, (88 + 7 * _S6) / 360, (-2 - 3 * _S6) / 225],
        [(16 - _S6) / 36, (16 + _S6) / 36, 1 / 9],
    ]
)


def solution(f, y0, times):
    """States of y' = f(y) at every one of the times, (m, n), a step from each to the next.

    Source: Hairer and Wanner 1996, IV.5, table 5.6.
    """
    y, found = np.array(y0, dtype=float), [np.array(y0, dtype=float)]
    n = len(y)
    for h in np.diff(times):
        matrix = np.eye(3 * n) - h * np.kron(_A, _slopes(f, y))
        z = np.zeros((3, n))
        for _ in range(20):
            change = h * _A @ [f(y + stage) for stage in z] - z
            step = np.linalg.solve(matrix, change.ravel())
            z += step.reshape(3, n)
            if np.max(np.abs(step)) < 1e-13:
                break
        else:
            raise AssertionError("Newton's iteration does not converge; take shorter steps")
        y = y + z[2]
        found.append(y)
    return np.array(found)


def _slopes(f, y):
    """df/dy by central differences."""
    columns = []
    for k in range(len(y)):
        d = np.zeros(len(y))
        d[k] = 1e-6 * max(1.0, abs(y[k]))
        columns.append((np.array(f(y + d)) - np.array(f(y - d))) / (2 * d[k]))
    return np.array(columns).T
