"""Steps with error control, dense output and projection: the twin of `native/runtime/stepper.c`.

The twins serve where there is no C compiler, and take the same steps, but those in the tangent
coordinates of `native/runtime/passage.c`: at a singular configuration they stop. A change here is a
change there.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.solvers.problem import MAX_STEPS, Failure, failed, failure_of

Array = npt.NDArray[np.float64]
RightHandSide = Callable[[float, Array], Array]
Projection = Callable[[float, Array], Array]

EPSILON = float(np.finfo(float).eps)
SAFETY, SHRINK, GROW, BETA = 0.9, 0.2, 10.0, 0.04
"""Step control of the code DOPRI5: the part of the step that the error asks for, its least and its
greatest change (Hairer, Norsett and Wanner 1993, II.4, eq. 4.13), and the share of the error before
it, which calms the sequence of steps where stability limits them (Hairer and Wanner 1996, IV.2)."""
LEAST_ERROR = 1e-4
"""What the share of the error before counts at least, likewise, so that an accident of no error
does not shorten the next step; a first step is taken to have come from it."""
NEAR_ZERO = 1e-10
"""Part of the limit below which time counts as zero: a step is too small by its own rounding there,
not by that of times later on."""
UNMOVED = 0.01
"""Part of the tolerances by which a projection may move the state and leave the slope that the
method ends with: its error is then a hundredth of the one that is allowed."""

ASIDE = 1e3 * EPSILON
"""Part of the time that laws are asked beside a jump: a few roundings of arithmetic on times."""
GAP = 0.25
"""Part of the time between two jumps that this is at most."""


@dataclass(slots=True)
class Stops:
    """Times at which steps end.

    Attributes:
        times: (m,) s, increasing.
        hard: (m,) whether laws of time may jump there, so that a step begins anew.
        next: index of the first one that lies ahead.
        side: laws of time are asked between these times: on one side of their jumps.
    """

    times: Array
    hard: npt.NDArray[np.bool_]
    next: int = 0
    side: tuple[float, float] = (-math.inf, math.inf)

    def start(self, t: float) -> None:
        """Begin at a time."""
        self.next = int(np.searchsorted(self.times, t, side="right"))
        self._find_side(t)

    def limit(self, limit: float) -> float:
        """The next stop, or a limit before it."""
        return min(limit, float(self.times[self.next])) if self.next < len(self.times) else limit

    def pass_at(self, t: float) -> bool:
        """Go on behind a stop at a time, if there is one; whether laws of time may have jumped."""
        first = self.next
        self.next += int(np.searchsorted(self.times[first:], t, side="right"))
        jumps = bool(self.hard[first : self.next].any())
        if jumps:
            self._find_side(t)
        return jumps

    def law_time(self, t: float) -> float:
        """A time moved to the side of the jumps of laws on which the present step is."""
        return min(max(t, self.side[0]), self.side[1])

    def _find_side(self, t: float) -> None:
        jumps = self.times[self.hard]
        place = int(np.sum(self.hard[: self.next]))
        first = float(jumps[place - 1]) if place else -math.inf
        last = float(jumps[place]) if place < len(jumps) else math.inf
        end = abs(float(self.times[-1])) if len(self.times) else 0.0
        aside = min(ASIDE * max(end, abs(t)), GAP * (last - first))
        self.side = first + aside, last - aside


@dataclass(slots=True)
class RowTable:
    """States at given times, as far as they are reached.

    Attributes:
        times: (m,) s, increasing.
        rows: (m, n) of which the first are filled.
        done: how many.
    """

    times: Array
    rows: Array
    done: int = 0

    @property
    def next(self) -> float:
        """Time of the first row that is not filled."""
        return float(self.times[self.done])

    @property
    def full(self) -> bool:
        """Whether all rows are filled."""
        return self.done == len(self.times)

    def fill(self, x: Array) -> None:
        """The state at the next time."""
        self.rows[self.done] = x
        self.done += 1


@dataclass(slots=True)
class Stepper(ABC):
    """One integration under way, by a method whose error estimate is of order 4.

    Attributes:
        rhs: slope at a time and a state.
        project: a state moved onto the constraints, or None.
        t: present time.
        x: present state, (n,).
        max_step: the longest step, s.
        stops: times at which steps end.
        afresh: length of the first step after a jump, s; estimated where 0.
        h: step that error control wants next; 0 before the first one.
        slope: slope at the present state, or None when it is not known.
        last_step: length of the last step.
        last_end: time at its end.
        sizes: (2, n) factors of the absolute and of the relative tolerance, or (2, 1).
        moved: whether the last projection moved the state, compared with the tolerances.
    """

    rhs: RightHandSide
    project: Projection | None
    t: float
    x: Array
    rtol: float
    atol: float
    max_step: float = math.inf
    afresh: float = 0.0
    h: float = 0.0
    error: float = LEAST_ERROR
    since_output: int = 0
    last_step: float = 0.0
    last_end: float = 0.0
    moved: bool = False
    slope: Array | None = None
    dense: tuple[Array, ...] = ()
    stops: Stops = field(default_factory=lambda: Stops(np.empty(0), np.empty(0, bool)))
    sizes: Array = field(default_factory=lambda: np.ones((2, 1)))

    @abstractmethod
    def _open(self, slope: Array) -> None:
        """Compute what rejected tries of a step from the present state share."""

    @abstractmethod
    def _attempt(self, h: float, slope: Array) -> tuple[Array, Array]:
        """The state after a step, and its error."""

    @abstractmethod
    def _keep(self, h: float, y: Array) -> tuple[Array, ...]:
        """Dense output of the attempt that gave y."""

    @abstractmethod
    def _close(self, t: float, y: Array) -> Array | None:
        """The slope at the new state when the attempt gave it."""

    @abstractmethod
    def _interpolate(self, a: float) -> Array:
        """State at a part a of the last step."""

    def fill(self, table: RowTable, budget: int) -> None:
        """Fill the next rows of a table, in about `budget` steps.

        Args:
            table: with the rows that are left.
            budget: number of steps after which to return.

        Raises:
            SolverError: the integration cannot go on.
        """
        try:
            with np.errstate(all="ignore"):  # what overflows is rejected as not finite
                while not table.full:
                    if table.next <= self.t:
                        table.fill(self.output(table.next))
                    elif budget <= 0:
                        break
                    else:
                        budget -= self.step(float(table.times[-1]))
        except Failure as failure:
            raise failed(self.t, self.h, str(failure), state=self.x.tolist()) from failure

    def output(self, t: float) -> Array:
        """The state at a time within the last step, for a row of the table."""
        self.since_output = 0
        return self.state(t)

    def state(self, t: float) -> Array:
        """The state at a time within the last step, projected, (n,)."""
        if t >= self.t:
            return self.x
        y = self._interpolate((t - (self.last_end - self.last_step)) / self.last_step)
        return y if self.project is None else self.project(t, y)

    def rewind(self, t: float) -> None:
        """Go back to a time within the last step; earlier states of it remain at hand."""
        self.x = self.state(t)
        self.t, self.slope = t, None

    def restart(self, x: Array) -> None:
        """Go on from another state at the present time, with a new first step."""
        self.x, self.slope, self.h, self.error = x, None, self.afresh, LEAST_ERROR

    def pass_stop(self) -> bool:
        """Go on behind a stop at the present time; whether laws of time may have jumped there."""
        jumps = self.stops.pass_at(self.t)
        if jumps:
            self.restart(self.x)
        return jumps

    def step(self, limit: float) -> int:
        """Try steps towards limit until one is accepted.

        Returns:
            how many were tried.

        Raises:
            Failure: none can be accepted.
        """
        tried = 0
        self.pass_stop()
        limit = self.stops.limit(limit)
        slope = self._opened(limit)
        while True:
            self.since_output += 1
            tried += 1
            if self.since_output > MAX_STEPS:
                raise Failure("steps")
            if self._try_step(slope, limit):
                return tried

    def _opened(self, limit: float) -> Array:
        """The slope at the present state, and a step to try."""
        if self.slope is None:
            self.slope = self._slope(self.t, self.x)
            self._open(self.slope)
        if self.h <= 0.0:
            self.h = self._first_step(self.slope, limit - self.t)
        self.h = min(self.h, self.max_step)
        return self.slope

    def _try_step(self, slope: Array, limit: float) -> bool:
        # a rest of a hundredth of a step is taken along, as in DOPRI5
        cut = self.t + 1.01 * self.h >= limit
        h = limit - self.t if cut else self.h
        reason = ""
        error = 0.0
        try:
            y, difference = self._attempt(h, slope)
            error = self._norm(difference, y)
            if not np.isfinite(error):
                raise Failure("finite")
            if error <= 1.0:
                self._accept(y, limit if cut else self.t + h, h)
                self._lengthen(h, error, cut)
                return True
        except Failure as failure:
            reason = str(failure)
        # the root of the order of the error, 5; where there is no error, a quarter: two halvings
        self.h = h * (0.25 if reason else max(SHRINK, SAFETY / error**0.2))
        if self.h <= 4 * EPSILON * max(abs(self.t), NEAR_ZERO * abs(limit)):
            raise Failure(reason or "small")
        return False

    def _accept(self, y: Array, t_new: float, h: float) -> None:
        dense = self._keep(h, y)
        self.moved = False
        if self.project is not None:
            raw, y = y, self.project(t_new, y)
            self.moved = self._norm(raw - y, y) > UNMOVED
        self.slope = self._close(t_new, y)
        self.dense = dense
        self.t, self.x, self.last_step, self.last_end = t_new, y, h, t_new

    def _lengthen(self, h: float, error: float, cut: bool) -> None:
        # exponents of DOPRI5 for order 5; GROW is reached long before an error of 1e-10
        factor = SAFETY * self.error**BETA / max(error, 1e-10) ** (0.2 - 0.75 * BETA)
        h *= min(GROW, max(SHRINK, factor))
        self.h = max(h, self.h) if cut else h
        if not cut:
            self.error = max(error, LEAST_ERROR)

    def _slope(self, t: float, x: Array) -> Array:
        if not np.isfinite(x).all():
            raise Failure("finite")
        try:
            value = self.rhs(t, x)
        except RuntimeError as error:
            raise failure_of(error, "rhs") from error
        if not np.isfinite(value).all():
            raise Failure("finite")
        return value

    def _norm(self, v: Array, y: Array) -> float:
        absolute, relative = self.atol * self.sizes[0], self.rtol * self.sizes[1]
        scale = absolute + relative * np.maximum(np.abs(self.x), np.abs(y))
        r = v / scale
        return float(np.sqrt(np.dot(r, r) / len(r))) if len(r) else 0.0

    def _first_step(self, slope: Array, span: float) -> float:
        """A step that an explicit Euler step and its curvature suggest (Hairer 1993, II.4)."""
        # the numbers are those of the book
        d0, d1 = self._norm(self.x, self.x), self._norm(slope, self.x)
        # a step by a hundredth of the state, or 1e-6 s where state or slope are too small to tell
        h0 = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, span)
        try:
            k2 = self._slope(self.t + h0, self.x + h0 * slope)
        except Failure:
            return h0 * 1e-3  # without a curvature, as where it is zero
        d2 = self._norm(k2 - slope, self.x) / h0
        top = max(d1, d2)
        # an error of a hundredth of the tolerance, order 5; a thousandth of h0 where nothing bends
        h1 = max(1e-6, h0 * 1e-3) if top <= 1e-15 else (0.01 / top) ** 0.2
        return float(min(100 * h0, h1, span))


def combine(weights: Sequence[float], k: Sequence[Array]) -> Any:
    """Weighted sum of stages."""
    total = weights[0] * k[0]
    for weight, slope in zip(weights[1:], k[1:], strict=True):
        total = total + weight * slope
    return total
