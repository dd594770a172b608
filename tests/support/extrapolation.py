"""Motions by extrapolated midpoint steps in plain numpy: the clock that other clocks are set by."""

from __future__ import annotations

import numpy as np

_COLUMNS = 8
_COUNTS = 2 * np.arange(1, _COLUMNS + 1)


def solution(f, y0, times, tolerance=1e-12, project=None, first=1e-3):
    """States at the given times of y' = f(t, y), (m, n), by Gragg, Bulirsch and Stoer's method.

    Source: Hairer, Norsett and Wanner 1993, II.9: order 16, the error estimated from order 14.

    Args:
        f: (t, y) -> (n,).
        y0: (n,) at the first time.
        times: (m,) increasing.
        tolerance: of a step, relative to 1 + |y|.
        project: y -> y on the constraints, after each step.
        first: length of the first step.
    """
    t, y, step = times[0], np.array(y0, dtype=float), first
    found = [y]
    for end in times[1:]:
        while t < end:
            last = t + 1.0001 * step >= end
            h = end - t if last else step
            new, error = _extrapolated(f, t, y, h)
            error /= tolerance * (1 + np.max(np.abs(y)))
            grown = h * min(4.0, max(0.1, 0.8 * max(error, 1e-30) ** (-1 / (2 * _COLUMNS - 1))))
            if error <= 1:
                t, y = (end if last else t + h), (new if project is None else project(new))
            step = max(grown, step) if last and error <= 1 else grown
        found.append(y)
    return np.array(found)


def _extrapolated(f, t, y, h):
    """The state after a step and the size of its error."""
    slope = f(t, y)
    rows = []
    for j, n in enumerate(_COUNTS):
        row = [_midpoint(f, t, y, slope, h, n)]
        for k in range(1, j + 1):
            ratio = (n / _COUNTS[j - k]) ** 2 - 1
            row.append(row[-1] + (row[-1] - rows[-1][k - 1]) / ratio)
        rows.append(row)
    return rows[-1][-1], float(np.max(np.abs(rows[-1][-1] - rows[-1][-2])))


def _midpoint(f, t, y, slope, h, n):
    d = h / n
    before, now = y, y + d * slope
    for k in range(1, n):
        before, now = now, before + 2 * d * f(t + k * d, now)
    return 0.5 * (before + now + d * f(t + h, now))
