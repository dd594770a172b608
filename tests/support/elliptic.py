"""The plane pendulum in closed form, by the arithmetic-geometric mean."""

from __future__ import annotations

import numpy as np

_MEANS = 8  # each doubles the digits


def amplitude(u, m):
    """Jacobi's am(u | m) for 0 <= m < 1.

    Source: Abramowitz and Stegun 1964, 16.4: descending Landen transformations.
    """
    a, c = [1.0], [np.sqrt(m)]
    b = np.sqrt(1 - m)
    for _ in range(_MEANS):
        a, b, c = [*a, (a[-1] + b) / 2], np.sqrt(a[-1] * b), [*c, (a[-1] - b) / 2]
    phi = 2 ** (len(a) - 1) * a[-1] * np.asarray(u, dtype=float)
    for k in range(len(a) - 1, 0, -1):
        phi = (phi + np.arcsin(c[k] / a[k] * np.sin(phi))) / 2
    return phi


def quarter_period(m):
    """Legendre's complete integral K(m), pi over twice the mean of 1 and sqrt(1 - m)."""
    a, b = 1.0, np.sqrt(1 - m)
    for _ in range(_MEANS):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return np.pi / (2 * a)


def swing(times, rate, turned):
    """Angle from the lowest configuration, released at rest at `turned`; angle'' = -rate^2
    sin(angle)."""
    m = np.sin(turned / 2) ** 2
    phi = amplitude(rate * times + quarter_period(m), m)
    return 2 * np.arcsin(np.sqrt(m) * np.sin(phi))


def whirl(times, rate, speed):
    """Angle from the lowest configuration of a pendulum that passes the highest with `speed` at
    zero."""
    at_bottom = np.sqrt(speed**2 + 4 * rate**2)
    m = (2 * rate / at_bottom) ** 2
    return 2 * amplitude(at_bottom / 2 * times + quarter_period(m), m)
