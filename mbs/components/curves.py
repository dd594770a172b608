"""Point on a curve, and cams, with cubic splines through given points.

Source: Boor 1978, for the splines.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.components import custom
from mbs.components.custom import At, Custom, Row
from mbs.errors import DescriptionError
from mbs.text import quoted

Array = NDArray[np.float64]


# Splines as expressions with two continuous derivatives.
#
# The active piece is selected by a sum of steps, whose derivatives are zero. Values and derivatives
# are therefore from a single polynomial everywhere, also at the knots. A comparison of neighbouring
# pieces would average the derivatives of both at the knots.


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


_APART = 1e-9
"""Least distance of neighbouring points relative to the largest distance. Nearer points are equal
points with different rounding, through which a spline would have an arbitrary direction."""

Rows = tuple[tuple[float, ...], ...]


def _table_rows(name: str, what: str, given: Any, columns: int, least: int, example: str) -> Rows:
    """Return a table of numbers as rows; raise DescriptionError if it is invalid.

    The table `given` needs `columns` numbers per row and at least `least` rows. `name`, `what` and
    `example` are for messages.
    """
    try:
        values: NDArray[np.float64] = np.array(given, dtype=float)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.ndim != 2 or values.shape[1] != columns or len(values) < least:
        raise DescriptionError(
            f"{name}: {what} is {quoted(given)}; give {least} rows of {columns} numbers or more,"
            f" such as {example}"
        )
    if not np.all(np.isfinite(values)):
        raise DescriptionError(
            f"{name}: {what} holds a number that is not finite; give finite ones"
        )
    return tuple(tuple(float(x) for x in row) for row in values)


class PointOnCurve(Custom):
    """A point that stays on a curve: a bead on a wire, a pin in a slot, a car on rails.

    The curve is the cubic spline through given points, parameterised by the cumulative distance of
    the points, with two continuous derivatives. It is fixed in the frame `ground`. An open curve
    continues along straight lines beyond its ends. The three constraint rows are the elements of
    p - c(s), with the position p of the origin of `pin` in `ground`. The parameter s, close to the
    arc length, is an unknown with the coordinate NAME.s, so that two of the rows constrain the
    bodies. There is no friction.

    Source: Haug 1989 for point followers; Boor 1978 for splines.

    Attributes:
        ground: frame of the curve.
        pin: point that stays on the curve.
        curve: points of the curve, rows of x, y and z [m].
        closed: Whether the curve returns from the last point to the first.
    """

    ground = custom.frame()
    pin = custom.frame()
    curve: Any = field(kw_only=True)
    closed: bool = field(kw_only=True, default=False)
    s = custom.unknown("m")
    force_x = custom.output("N")
    force_y = custom.output("N")
    force_z = custom.output("N")

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        least = 3 if self.closed else 2
        rows = _table_rows(self.name, "curve", self.curve, 3, least, "[(0, 0, 0), (1, 0.2, 0)]")
        object.__setattr__(self, "curve", rows)
        distances = self._distances()
        near = [k for k, d in enumerate(distances) if d <= _APART * max(distances)]
        if near:
            raise DescriptionError(
                f"{self.name}: point {near[0]} of the curve is the same as the next one; give it"
                " once, and the first one of a closed curve not again at its end"
            )

    def rows(self, at: At) -> Mapping[str, Row | SX]:
        """Return rows "x", "y", "z": position of the pin minus the curve point c(s) [m].

        Both are vectors in axes of `ground`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        off = at.ground.to(at.pin).p - self.spline.at(at.s)
        return dict(zip("xyz", casadi.vertsplit(off), strict=True))

    def crossings(self, at: At) -> Mapping[str, SX]:
        """Return {"knots": event indicator}, which changes sign at each knot of the spline.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"knots": self.spline.bend(at.s)}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return force_x, force_y, force_z: constraint force ON the pin, in axes of ground [N].

        The body of `ground` gets the reaction, which is not part of the outputs.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {f"force_{axis}": at.lam[axis] for axis in "xyz"}

    @property
    def spline(self) -> Spline:
        """The curve in the frame `ground` [m], a function of the cumulative point distance [m]."""
        d, points = self._distances(), np.array(self.curve)
        t = np.concatenate([[0.0], np.cumsum(d)])
        return periodic_spline(t[:-1], points, t[-1]) if self.closed else natural_spline(t, points)

    def _distances(self) -> list[float]:
        """Return the distances of successive points [m]; for a closed curve also last to first."""
        points = list(self.curve)
        following = [*points[1:], points[0]] if self.closed else points[1:]
        return [math.dist(a, b) for a, b in zip(points, following, strict=False)]


class Cam(Custom):
    """A cam: driven = lift(driver), a curve through given points with two continuous derivatives.

    The lift is the cubic spline through the points. It is periodic with `period`, or continues
    along straight lines beyond its ends without a period. It is one constraint row on two
    coordinates, which may be angles or displacements. The row holds in both directions, as for a
    grooved cam. A follower that is only pressed on would leave the cam while `effort`, on the
    driven coordinate, is negative.

    Source: Boor 1978 for splines.

    Attributes:
        driven: name of the coordinate of the follower.
        driver: name of the coordinate of the cam.
        profile: rows of the positions of driver and driven coordinate, in increasing order of the
            driver [rad or m]. With a period they span less than the period.
        period: period of the driver [rad or m], by default a whole revolution. None for a curve
            with ends.
    """

    driven = custom.coordinate()
    driver = custom.coordinate()
    profile: Any = field(kw_only=True)
    period: float | None = field(kw_only=True, default=2 * math.pi)
    effort = custom.output(custom.EFFORT)

    @property
    def needs_position(self) -> bool:
        """True: the lift is a function of the position of the driver."""
        return True

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        least = 2 if self.period is None else 3
        rows = _table_rows(
            self.name, "profile", self.profile, 2, least, "[(0, 0), (2, 0.01), (4, 0)]"
        )
        object.__setattr__(self, "profile", rows)
        period = self.period
        if period is not None and not (isinstance(period, (int, float)) and 0 < period < math.inf):
            raise DescriptionError(
                f"{self.name}: period is {quoted(period)}; give a number above zero, or None for a"
                " curve with ends"
            )
        t = [row[0] for row in rows]
        span = t[-1] - t[0]
        for k, (a, b) in enumerate(pairwise(t)):
            if b - a <= _APART * span:
                raise DescriptionError(
                    f"{self.name}: the driver is at {a:g} in row {k} of profile and at {b:g} in"
                    " the next one; give rows in which it grows"
                )
        if period is not None and span >= period * (1 - _APART):
            raise DescriptionError(
                f"{self.name}: profile spans {span:g} of the driver, and the period is"
                f" {period:g}; leave the row out that repeats the first one"
            )

    def rows(self, at: At) -> Mapping[str, Row | SX]:
        """Return {"lift": driven minus lift(driver) [m or rad]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        lift = self.spline.at(at.driver.q)
        return {"lift": Row(at.driven.q - lift, "m" if at.driven.unit == "m" else "1")}

    def crossings(self, at: At) -> Mapping[str, SX]:
        """Return {"knots": event indicator}, which changes sign at each knot of the lift.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"knots": self.spline.bend(at.driver.q)}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"effort": constraint effort ON the driven coordinate [N or N m]}.

        It is negative if a follower that is only pressed on would leave the cam.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"effort": at.lam["lift"]}

    @property
    def spline(self) -> Spline:
        """Position of the driven coordinate as a function of that of the driver [rad or m]."""
        t, lift = np.array(self.profile).T
        if self.period is None:
            return natural_spline(t, lift[:, None])
        return periodic_spline(t, lift[:, None], self.period)
