"""Cubic splines through given points, as expressions with two continuous derivatives.

The active piece is selected by a sum of steps, whose derivatives are zero. Values and derivatives
are therefore from a single polynomial everywhere, also at the knots. A comparison of neighbouring
pieces would average the derivatives of both at the knots.

Source: Boor 1978.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """A curve of cubic pieces, each a polynomial in the distance from its knot.

    Attributes:
        knots: (m,) start of each piece. The first piece also holds before its knot.
        coefficients: (4, m, d) coefficients of the powers 0 .. 3.
        period: period of the curve. None for a curve that continues straight beyond its ends.
    """

    knots: Array
    coefficients: Array
    period: float | None

    def at(self, t: SX) -> SX:
        """Return the point (d, 1) of the curve.

        Args:
            t: (1, 1) parameter of the curve.
        """
        t, _ = self._within(t)
        steps = [t >= knot for knot in self.knots[1:]]
        u = t - _chosen(self.knots, steps)
        dimension = self.coefficients.shape[2]
        return casadi.vertcat(*(self._element(k, u, steps) for k in range(dimension)))

    def bend(self, t: SX) -> SX:
        """Return an event indicator (1, 1) that is zero at the knots.

        The third derivative of the curve is discontinuous there.

        It is a parabola between two knots, alternately positive and negative, with slopes of 1 or
        -1 at the knots.

        Args:
            t: (1, 1) parameter of the curve.
        """
        t, turns = self._within(t)
        knots = np.unique(self.knots)
        if self.period is not None:
            knots = np.append(knots, knots[0] + self.period)
        # the first and the last of the parabolas between knots continue beyond the ends
        steps = [t >= knot for knot in knots[1:-1]]
        count = turns * (len(knots) - 1) + sum(steps, SX(0))
        sign = 1 - 2 * casadi.fmod(casadi.fabs(count), 2)
        before, after = _chosen(knots[:-1], steps), _chosen(knots[1:], steps)
        return SX(sign * (t - before) * (after - t) / (after - before))

    def _within(self, t: SX) -> tuple[SX, SX]:
        """Return t reduced to the first period, and the number of removed periods.

        Without a period they are t and 0.
        """
        if self.period is None:
            return t, SX(0)
        turns = casadi.floor((t - self.knots[0]) / self.period)
        return SX(t - self.period * turns), SX(turns)

    def _element(self, k: int, u: SX, steps: Sequence[SX]) -> SX:
        """Return element k of the active piece at the distance u from its knot.

        `steps` is whether t is at or above each knot but the first.
        """
        value = SX(0)
        for power in (3, 2, 1, 0):
            value = value * u + _chosen(self.coefficients[power, :, k], steps)
        return value


def _chosen(values: Array, steps: Sequence[SX]) -> SX:
    """Return the entry of `values` whose index is the number of true `steps`.

    The steps, expressions of 0 or 1, count the knots that are passed: the entry of the active
    piece.
    """
    found = SX(float(values[0]))
    for step, jump in zip(steps, np.diff(values), strict=True):
        found += step * float(jump)
    return found


def natural_spline(t: Array, points: Array) -> Spline:
    """Return the spline through points, straight beyond its ends.

    Its second derivatives are zero at both ends.

    Args:
        t: (n,) increasing parameters of the points.
        points: (n, d) points.
    """
    h: Array = np.diff(t)
    slopes: Array = np.diff(points, axis=0) / h[:, None]
    # second derivatives are zero at the ends, where straight lines continue
    A = np.eye(len(t))
    right = np.zeros_like(points)
    for k in range(1, len(t) - 1):
        A[k, k - 1 : k + 2] = h[k - 1], 2 * (h[k - 1] + h[k]), h[k]
        right[k] = 6 * (slopes[k] - slopes[k - 1])
    M: Array = np.linalg.solve(A, right).astype(np.float64)
    pieces = _pieces(points, slopes, h, M)
    # straight lines at both ends; the first has the first knot, since the first piece holds before
    # it
    first = np.stack([points[0], pieces[1, 0], 0 * points[0], 0 * points[0]])[:, None]
    end: Array = slopes[-1] + h[-1] * (M[-2] + 2 * M[-1]) / 6
    last = np.stack([points[-1], end, 0 * end, 0 * end])[:, None]
    knots = np.concatenate([t[:1], t])
    return Spline(knots, np.concatenate([first, pieces, last], axis=1), None)


def periodic_spline(t: Array, points: Array, period: float) -> Spline:
    """Return the periodic spline through points.

    Args:
        t: (n,) increasing parameters of the points, within one period.
        points: (n, d) points.
        period: period of the parameter.
    """
    n = len(t)
    h: Array = np.diff(np.append(t, t[0] + period))
    slopes = np.diff(np.concatenate([points, points[:1]]), axis=0) / h[:, None]
    A = np.zeros((n, n))
    for k in range(n):
        A[k, k] += 2 * (h[k - 1] + h[k])
        A[k, (k + 1) % n] += h[k]
        A[k, k - 1] += h[k - 1]
    right = 6 * (slopes - np.roll(slopes, 1, axis=0))
    M: Array = np.linalg.solve(A, right).astype(np.float64)
    ends: Array = np.concatenate([M, M[:1]])
    pieces = _pieces(points, slopes, h, ends)
    return Spline(t, pieces, period)


def _pieces(points: Array, slopes: Array, h: Array, M: Array) -> Array:
    """Return the coefficients (4, m, d) of the powers 0 .. 3 of each piece.

    `points` (m or m + 1, d) are the points, `slopes` (m, d) those of the chords, `h` (m,) the
    lengths of the pieces in the parameter, and `M` (m + 1, d) the second derivatives at the knots.
    """
    h = h[:, None]
    first = slopes - h * (2 * M[:-1] + M[1:]) / 6
    return np.stack([points[: len(h)], first, M[:-1] / 2, np.diff(M, axis=0) / (6 * h)])
