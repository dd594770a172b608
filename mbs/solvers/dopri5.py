"""Dormand and Prince's pair of order 5(4) in plain Python: the twin of `native/runtime/dopri5.c`.

It serves where there is no C compiler, and takes the same steps. A change here is a change there.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import SolverError

Array = npt.NDArray[np.float64]
RightHandSide = Callable[[float, Array], Array]
Projection = Callable[[float, Array], Array]

C = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
A: tuple[tuple[float, ...], ...] = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
E = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
D = (
    -12715105075 / 11282082432,
    0.0,
    87487479700 / 32700410799,
    -10690763975 / 1880347072,
    701980252875 / 199316789632,
    -1453857185 / 822651844,
    69997945 / 29380423,
)
SAFETY, SHRINK, GROW, BETA = 0.9, 0.2, 10.0, 0.04
MAX_STEPS = 100_000
REASONS = {
    "steps": f"more than {MAX_STEPS} steps between two output times; ask for a looser tolerance",
    "small": "error control asks for a step below the rounding of time; "
    "look for a singularity or a jump",
    "rhs": "the right-hand side has no value there",
    "projection": "the projection onto the constraints does not converge; "
    "look for a singular posture",
    "finite": "a value is not finite; look for a singularity",
}


class Failure(Exception):
    """An evaluation had no answer, so the step must be shortened."""


@dataclass(slots=True)
class Dopri5:
    """One integration under way; `advance` takes it from step to step.

    Attributes:
        rhs: slope at a time and a state.
        project: a state moved onto the constraints, or None.
        t: present time.
        x: present state, (n,).
        h: step that error control wants next; 0 before the first one.
    """

    rhs: RightHandSide
    project: Projection | None
    t: float
    x: Array
    rtol: float
    atol: float
    h: float = 0.0
    error: float = 1e-4
    since_output: int = 0
    last_step: float = 0.0
    slope: Array | None = None
    dense: tuple[Array, ...] = field(default_factory=tuple)

    def table(self, times: Array, row: int, rows: Array, budget: int) -> int:
        """Fill rows from `row` on with the states at times, in at most `budget` steps.

        Args:
            times: (m,) s, increasing.
            row: first row to fill.
            rows: (m, n) table that is filled.
            budget: number of steps after which to return.

        Returns:
            the first row not filled yet.

        Raises:
            SolverError: the integration cannot go on.
        """
        try:
            with np.errstate(all="ignore"):  # what overflows is rejected as not finite
                while row < len(times):
                    if times[row] <= self.t:
                        rows[row] = self._output(float(times[row]))
                        row += 1
                    elif budget <= 0:
                        break
                    else:
                        budget -= self._step(float(times[-1]))
        except Failure as failure:
            raise failed(self.t, self.h, str(failure)) from failure
        return row

    def _output(self, t: float) -> Array:
        self.since_output = 0
        if t >= self.t:
            return self.x
        a = (t - (self.t - self.last_step)) / self.last_step
        b = 1.0 - a
        y0, rise, bend, third, fourth = self.dense
        y: Array = y0 + a * (rise + b * (bend + a * (third + b * fourth)))
        return y if self.project is None else self.project(t, y)

    def _step(self, limit: float) -> int:
        """Try steps until one is accepted; returns how many were tried."""
        tried = 0
        if self.slope is None:
            self.slope = self._slope(self.t, self.x)
        if self.h <= 0.0:
            self.h = self._first_step(limit - self.t)
        while True:
            self.since_output += 1
            tried += 1
            if self.since_output > MAX_STEPS:
                raise Failure("steps")
            if self._try_step(limit):
                return tried

    def _try_step(self, limit: float) -> bool:
        cut = self.t + 1.01 * self.h >= limit
        h = limit - self.t if cut else self.h
        reason = ""
        error = 0.0
        try:
            k, y = self._stages(h)
            error = self._norm(h * _combine(E, k), y)
            if not np.isfinite(error):
                raise Failure("finite")
            if error <= 1.0:
                self._accept(y, k, limit if cut else self.t + h, h)
                self._lengthen(h, error, cut)
                return True
        except Failure as failure:
            reason = str(failure)
        self.h = h * (0.25 if reason else max(SHRINK, SAFETY / error**0.2))
        if self.h <= 4 * np.finfo(float).eps * max(abs(self.t), abs(limit)):
            raise Failure(reason or "small")
        return False

    def _lengthen(self, h: float, error: float, cut: bool) -> None:
        factor = SAFETY * self.error**BETA / max(error, 1e-10) ** (0.2 - 0.75 * BETA)
        h *= min(GROW, max(SHRINK, factor))
        self.h = max(h, self.h) if cut else h
        if not cut:
            self.error = max(error, 1e-4)

    def _stages(self, h: float) -> tuple[list[Array], Array]:
        assert self.slope is not None
        k = [self.slope]
        y = self.x
        for c, row in zip(C[1:], A[1:], strict=True):
            y = self.x + h * _combine(row, k)
            if not np.isfinite(y).all():
                raise Failure("finite")
            k.append(self._slope(self.t + c * h, y))
        return k, y

    def _accept(self, y: Array, k: list[Array], t_new: float, h: float) -> None:
        rise = y - self.x
        bend = h * k[0] - rise
        dense = (self.x, rise, bend, rise - h * k[6] - bend, h * _combine(D, k))
        next_slope = k[6]
        if self.project is not None:
            y = self.project(t_new, y)
            next_slope = self._slope(t_new, y)
        self.dense = dense
        self.t, self.x, self.slope, self.last_step = t_new, y, next_slope, h

    def _slope(self, t: float, x: Array) -> Array:
        try:
            value = self.rhs(t, x)
        except RuntimeError as error:
            raise Failure("rhs") from error
        if not np.isfinite(value).all():
            raise Failure("finite")
        return value

    def _norm(self, v: Array, y: Array) -> float:
        scale = self.atol + self.rtol * np.maximum(np.abs(self.x), np.abs(y))
        r = v / scale
        return float(np.sqrt(np.dot(r, r) / len(r))) if len(r) else 0.0

    def _first_step(self, span: float) -> float:
        """A step that an explicit Euler step and its curvature suggest (Hairer 1993, II.4)."""
        assert self.slope is not None
        d0, d1 = self._norm(self.x, self.x), self._norm(self.slope, self.x)
        h0 = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, span)
        try:
            k2 = self._slope(self.t + h0, self.x + h0 * self.slope)
        except Failure:
            return h0 * 1e-3
        d2 = self._norm(k2 - self.slope, self.x) / h0
        top = max(d1, d2)
        h1 = max(1e-6, h0 * 1e-3) if top <= 1e-15 else (0.01 / top) ** 0.2
        return float(min(100 * h0, h1, span))


def failed(t: float, h: float, reason: str) -> SolverError:
    """The error that says when, with which step and why an integration stopped.

    Args:
        t: time of the last accepted state, s.
        h: step that was wanted next, s.
        reason: a key of REASONS.

    Returns:
        an error to raise.
    """
    return SolverError(
        f"integration stopped at t = {t:.9g} s with step {h:.3g} s: {REASONS[reason]}"
    )


def _combine(weights: tuple[float, ...], k: list[Array]) -> Any:
    total = weights[0] * k[0]
    for weight, slope in zip(weights[1:], k[1:], strict=True):
        total = total + weight * slope
    return total
