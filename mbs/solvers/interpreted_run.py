"""Integrations run by the Python twins of the compiled driver."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import casadi
import numpy as np
import numpy.typing as npt

from mbs.errors import Interrupted, SolverError
from mbs.solvers.control_c import control_c
from mbs.solvers.dopri5 import Dopri5
from mbs.solvers.problem import (
    EventMotion,
    Failure,
    IntegrationEvent,
    IntegrationProblem,
    LawFailure,
    failed,
    failure_of,
    fired_of,
    interrupted,
    stopped_by_law,
)
from mbs.solvers.rodas import Rodas
from mbs.solvers.stepper import EPSILON, Array, Projection, RowTable, Stepper, Stops

# Location of events and jumps in plain Python: the twin of `native/runtime/events.c`.
#
# Source: Cellier and Kofman 2006, chapter 9; Dowell and Jarratt 1971 for the location.


Flags = npt.NDArray[np.bool_]
Values = Callable[[float, Array], Array]
Jump = Callable[[float, Array, Flags], Array]
"""(t, x, fired) -> x; it keeps the modes."""
Look = tuple[Array, Array]
"""Indicators and how fast they rise."""

LOOKS, TANGENTS, SECANTS, MAX_JUMPS, MAX_IDLE = 2, 30, 20, 20, 100
"""Looks at the indicators in a step, tangents drawn to find a dip, secants before halving, jumps at
one event, and events at one time: what comes to an end takes a few of each."""
DEPARTURE = 1e-8
"""Part of a step that an indicator which rises may take to zero without asking for a jump: rounding
and projections, 1e-12, may have left it below, and it is through sooner."""
AT_ONCE = 1e3 * EPSILON
"""Part of the time by which events differ that fall together: they are located to a few roundings
of time, and arithmetic on times adds some more."""
LEAST_TIME = 1e-3
"""Part of the last step by which the rounding of times near zero is measured, not by time itself,
which has none there."""
NEAR = 0.5
"""Product of pace and time between two looks, at most: half an obstacle, or half a radian of a
turn."""
FASTER = 1.25
"""Speed between two looks over that at the looks, which changes little in so short a time."""
FALL = 0.85
"""Part of the time to zero until the next look; 2 / (1 + FASTER) would just be near enough."""
FULL = 0.98
"""Part of the time of NEAR until the next look, since the pace may grow a little."""
OFF = 0.1
"""Part of an indicator by which it may leave the curve of the step: forces follow it and are then
wrong by as much."""
SMALLEST = 100.0
"""Multiple of the tolerance below which an indicator counts as zero there."""
SHORTER = 0.75
"""Part of a step that missed a part of a law, at most, of the next try: few tries are needed."""
AT_START = 1e-3
"""Part of a step before which an event is where the dense output has hardly left the start: what
the step saw behind the event counts with its square there."""
_TINY = float(np.finfo(float).tiny)


@dataclass(slots=True)
class EventStepper:
    """One integration with events under way.

    Attributes:
        solver: takes the steps.
        indicators: (k,) values that are positive between events.
        rates: (k,) how fast they rise along the motion.
        jump: the state after an event, projected.
        approaches: (k, 3) as `Events` has them; None where there are none.
        left: indicators at the last look, and how fast they rise there.
        armed: which of them have been positive, so that they can fire.
        due: which of them ask for a jump at the present time.
        fired: which of them asked for jumps at the last event.
        last: time of the last event, s.
        idle: number of events since time advanced.
    """

    solver: Stepper
    indicators: Values
    rates: Values
    jump: Jump
    approaches: Values | None = None
    left: Look = field(default_factory=lambda: (np.empty(0), np.empty(0)))
    armed: Flags = field(default_factory=lambda: np.empty(0, bool))
    due: Flags = field(default_factory=lambda: np.empty(0, bool))
    fired: Flags = field(default_factory=lambda: np.empty(0, bool))
    last: float = -np.inf
    idle: int = 0

    def start(self) -> None:
        """Look at the first state: an indicator may ask for a jump there.

        Raises:
            SolverError: an indicator has no value there.
        """
        try:
            with np.errstate(all="ignore"):
                self._judge()
        except Failure as failure:
            t, h, x = self.solver.t, self.solver.h, self.solver.x
            raise failed(t, h, str(failure), state=x.tolist()) from failure

    def fill(self, table: RowTable, budget: int) -> bool:
        """Fill the next rows of a table, in about `budget` steps, at most to the next event.

        Args:
            table: with the rows that are left; a row at the time of an event is after it.
            budget: number of steps after which to return.

        Returns:
            whether an event has just happened.

        Raises:
            SolverError: the integration cannot go on.
        """
        solver, limit = self.solver, float(table.times[-1])
        try:
            with np.errstate(all="ignore"):
                while not table.full:
                    t = table.next
                    if t < solver.t or (t == solver.t and not self.due.any()):
                        table.fill(solver.output(t))
                    elif self.due.any():
                        self._settle(limit)
                        return True
                    elif budget <= 0:
                        break
                    else:
                        budget -= self._step(limit)
        except Failure as failure:
            raise failed(
                solver.t, solver.h, str(failure), self._blame(failure), solver.x.tolist()
            ) from failure
        return False

    def _blame(self, failure: Failure) -> tuple[int, ...]:
        return fired_of(self.fired) if str(failure) in ("settle", "standstill") else ()

    def _values(self, t: float, x: Array) -> Array:
        return _finite(lambda: self.indicators(t, x))

    def _look(self, t: float) -> Look:
        x = self.solver.state(t)
        values = self._values(t, x)
        try:
            return values, self.rates(t, x)
        except RuntimeError as error:
            raise failure_of(error, "indicators") from error

    def _least(self, values: Array) -> float:
        return float(np.min(values[self.armed], initial=np.inf))

    def _judge(self) -> None:
        """Which indicators ask for a jump at the present state.

        One that is zero to the tolerance and does not clearly fall waits: the first look at the
        next step tells whether it leaves zero. So does one that rises from there, since rounding
        alone may have made it positive.
        """
        t, step, zero = self.solver.t, self.solver.last_step, self.solver.atol
        slack = max(AT_ONCE * abs(t), DEPARTURE * step)
        value, rise = self.left = self._look(t)
        waits = (value >= -np.fmax(zero, rise * slack)) & ~(rise * step < -zero)
        self.armed = value > np.where(rise > 0, zero, 0.0)
        self.due = (value <= 0) & ~waits

    def _step(self, limit: float) -> int:
        """One step, cut at its first event; returns how many were tried."""
        solver, start = self.solver, self.solver.t
        if solver.pass_stop():
            self._judge()
            if self.due.any():
                return 0
        armed = self.armed.copy()
        tried, repeated = solver.step(limit), False
        while True:
            found, end = self._first_event(start), solver.t
            again = found[0] if found else end
            if found and found[1] is not None:
                # its stages behind the event are of other laws: once more, as far as the event
                if repeated or not (again < end and again - start > AT_START * (end - start)):
                    break
                repeated = True
            elif not found:
                break
            solver.rewind(start)
            self.left, self.armed = self._look(start), armed.copy()
            tried += solver.step(again)
        if found:
            event, right = found
            assert right is not None
            self.due = self.armed & (right <= 0)
            solver.rewind(event)
        return tried

    def _first_event(self, start: float) -> tuple[float, Array | None] | None:
        """The first event in the step from start, and the indicators there.

        None instead of the indicators where the step has missed a part of a law, with the time at
        which a shorter one ends.
        """
        here, end, part = start, self.solver.t, 1
        left, ends = np.empty(0), None
        if self.approaches is not None:
            left, last = self._approaches(start), self._approaches(end)
            if np.any(np.maximum(left, last)[:, 1] * (end - start) > NEAR):
                ends = self._look(start), self._look(end)
        while here < end:
            planned = start + part * (end - start) / LOOKS if part < LOOKS else end
            aim = planned if ends is None else min(planned, here + self._time_to_next(left))
            aim = planned if aim <= here else aim  # a time below its rounding
            if here > start:
                to, right = aim, self._look(aim)
            else:
                to, right = self._first_look(start, aim)
            if ends is not None:
                to, right, there = self._come_near(here, to, left, right)
                paces = np.maximum(left[:, 1], there[:, 1])
                if to < end and not _follows(
                    ends,
                    (to - start) / (end - start),
                    end - start,
                    right[0],
                    paces,
                    there[:, 2],
                    self.solver.atol,
                ):
                    return min(to, start + SHORTER * (end - start)), None
                left = there
            to, right = self._dips(here, to, right)
            if self._least(right[0]) <= 0:
                return self._locate(here, to, right[0])
            self.armed |= right[0] > 0
            self.left = right
            part += to == planned
            here = to
        return None

    def _approaches(self, t: float) -> Array:
        """(k, 3) approaches at a time within the last step."""
        approaches = self.approaches
        assert approaches is not None
        return _finite(lambda: approaches(t, self.solver.state(t)))

    def _time_to_next(self, near: Array) -> float:
        """Time to the next look that is likely to be near enough, from the left one [s]."""
        speed, pace, _ = near[near[:, 1] > 0].T
        value = self.left[0][near[:, 1] > 0]
        falls = np.where((value > 0) & (speed > 0), FALL * value / speed, 0.0)
        return float(np.min(np.maximum(falls, FULL * NEAR / pace), initial=math.inf))

    def _come_near(self, a: float, b: float, left: Array, right: Look) -> tuple[float, Look, Array]:
        """A time before b so near a that no indicator can have been at zero in between."""
        there = self._approaches(b)
        while not self._are_near(a, b, np.maximum(left, there), right[0]):
            b = a + 0.5 * (b - a)
            right, there = self._look(b), self._approaches(b)
        return b, right, there

    def _are_near(self, a: float, b: float, approaches: Array, right: Array) -> bool:
        width, low = b - a, self.left[0]
        if width <= 4 * EPSILON * max(abs(b), LEAST_TIME * self.solver.last_step):
            return True
        soon = approaches[:, 1] * width <= NEAR
        far = (low > 0) & (right > 0) & (low + right > FASTER * approaches[:, 0] * width)
        return bool(np.all(soon | far))

    def _first_look(self, start: float, end: float) -> tuple[float, Look]:
        """What has just left zero may be back at the first look: look earlier."""
        right = self._look(end)
        while np.any(~self.armed & (right[0] <= 0)):
            if end - start <= 4 * EPSILON * max(abs(end), LEAST_TIME * self.solver.last_step):
                self.left = np.where(self.armed, self.left[0], _TINY), self.left[1]
                self.armed[:] = True
                break
            end = start + 0.5 * (end - start)
            right = self._look(end)
        return end, right

    def _dips(self, a: float, b: float, right: Look) -> tuple[float, Look]:
        for k in np.flatnonzero(self.armed & (self.left[0] > 0)):
            if right[0][k] > 0:
                b, right = self._dip(int(k), a, b, right)
        return b, right

    def _dip(self, k: int, a: float, b: float, right: Look) -> tuple[float, Look]:
        """A time before b at which an indicator is not positive, if it falls at a and rises at b.

        Tangents at the ends bound what is convex from below; they are drawn again from where they
        meet, until they stay positive.
        """
        end, (low, fall), (high, rise) = b, _of(self.left, k), _of(right, k)
        for _ in range(TANGENTS):
            if not (fall < 0 < rise):
                break
            width = end - a
            meet = (low - high + rise * width) / (rise - fall)
            inside = 0 < meet < width
            if inside and low + fall * meet > 0:
                break
            t = a + (meet if inside else 0.5 * width)
            seen = self._look(t)
            value, rate = _of(seen, k)
            if value <= 0:
                return t, seen
            if rate < 0:
                a, low, fall = t, value, rate
            else:
                end, high, rise = t, value, rate
        return b, right

    def _locate(self, a: float, b: float, right: Array) -> tuple[float, Array]:
        """The first time after a at which an indicator is not positive, and all of them there.

        Secants with a safeguard, and the half of each value that stays (the Illinois rule).
        """
        low, high = self._least(self.left[0]), self._least(right)
        step = self.solver.last_step
        count = side = 0
        while True:
            margin = 2 * EPSILON * max(abs(a), abs(b), LEAST_TIME * step)
            t = _next_guess(a, b, low, high, margin) if count < SECANTS else a + 0.5 * (b - a)
            if not a < t < b or b - a <= LEAST_TIME * EPSILON * step:
                return b, right
            values = self._values(t, self.solver.state(t))
            value = self._least(values)
            if value > 0:
                high *= 0.5 if side > 0 else 1.0
                a, low, side = t, value, 1
            else:
                low *= 0.5 if side < 0 else 1.0
                b, high, side, right = t, value, -1, values
            count += 1

    def _settle(self, limit: float) -> None:
        """Jumps until no indicator asks for another one."""
        solver = self.solver
        t = solver.t
        self.fired = np.zeros_like(self.due)
        jumps = 0
        while self.due.any():
            self.fired |= self.due
            if jumps == MAX_JUMPS:
                raise Failure("settle")
            solver.restart(self.jump(t, solver.x, self.due))
            self._judge()
            jumps += 1
        still = t - self.last <= AT_ONCE * max(abs(t), abs(limit))
        self.idle = self.idle + 1 if still else 0
        self.last = t
        if self.idle > MAX_IDLE:
            raise Failure("standstill")


def _finite(indicators: Callable[[], Array]) -> Array:
    """Values of indicators, or of approaches; a Failure if they have none."""
    try:
        values = indicators()
    except RuntimeError as error:
        raise failure_of(error, "indicators") from error
    if not np.isfinite(values).all():
        raise Failure("indicators")
    return values


def _follows(
    ends: tuple[Look, Look],
    u: float,
    h: float,
    seen: Array,
    paces: Array,
    acts: Array,
    zero: float,
) -> bool:
    """Whether indicators on which the equations depend are on the cubic through both ends.

    Args:
        ends: looks at the ends of the step.
        u: part of the step.
        h: length of the step [s].
        seen: indicators there.
        paces: of the indicators [1/s].
        acts: 1 where the equations depend on it.
        zero: absolute tolerance.
    """
    (low, fall), (high, rise) = ends
    w = 1 - u
    curve = w**2 * ((1 + 2 * u) * low + u * h * fall) + u**2 * ((1 + 2 * w) * high - w * h * rise)
    size = np.maximum(np.maximum(np.abs(low), np.abs(high)), SMALLEST * zero)
    off = (acts > 0) & (paces * h > NEAR) & (np.abs(seen - curve) > OFF * size)
    return not off.any()


def _of(look: Look, k: int) -> tuple[float, float]:
    return float(look[0][k]), float(look[1][k])


def _next_guess(a: float, b: float, low: float, high: float, margin: float) -> float:
    if b - a <= 4 * margin:
        return a + 0.5 * (b - a)
    return min(max(a + (b - a) * low / (low - high), a + margin), b - margin)


Progress = Callable[[float], None]

TOLERANCE = 1e-12
"""Largest residual of the constraints where a projection ends, in parts of the largest state, or of
one: roundings stay below it, and what Newton's method leaves before its last step, 1e-8, does
not."""
ITERATIONS = 10
"""Of a projection, each of which squares the error: more do not converge, and the step is
shortened."""
_CHUNK = 50  # steps between two calls of progress


def run_interpreted(problem: IntegrationProblem, progress: Progress | None) -> EventMotion:
    """The motion at the times of a problem, as far as it comes.

    Args:
        problem: what to integrate.
        progress: called now and then with the time reached, s.
    """
    p = problem.p.copy()
    solver = _stepper(problem, p)
    table = RowTable(problem.times, np.empty((len(problem.times), len(problem.x0))))
    log: list[IntegrationEvent] = []
    stop: SolverError | Interrupted | None = None
    try:
        with control_c() as check:
            if solver.project is not None:
                solver.x = _begin(solver)
            watched = _watch(problem, p, solver)
            while not table.full:
                if watched is None:
                    solver.fill(table, _CHUNK)
                elif watched.fill(table, _CHUNK):
                    modes = p[len(p) - problem.modes :].copy()
                    log.append(IntegrationEvent(solver.t, fired_of(watched.fired), modes))
                if progress is not None:
                    progress(solver.t)
                check()
    except SolverError as error:
        stop = error
    except LawFailure as failure:
        stop = stopped_by_law(solver.t, failure, solver.x.tolist())
    except KeyboardInterrupt:
        stop = interrupted(solver.t)
    return problem.motion(table.rows[: table.done], log, stop)


def _vector(value: casadi.DM) -> Array:
    return np.asarray(value.full()[:, 0])


def _stepper(problem: IntegrationProblem, p: Array) -> Stepper:
    functions, start, state = problem.equations, float(problem.times[0]), problem.x0
    stops = Stops(*problem.stops)
    stops.start(start)
    project = _projection(problem, p, stops)
    sizes = np.ones((2, 1)) if problem.sizes is None else problem.sizes
    control = problem.rtol, problem.atol, problem.max_step, functions.first_step

    def slope(t: float, x: Array) -> Array:
        return _vector(functions.rhs(stops.law_time(t), x, p))

    def jacobian(t: float, x: Array) -> tuple[Array, Array]:
        assert functions.jacobian is not None
        J, f_t = functions.jacobian(stops.law_time(t), x, p)
        return np.asarray(J.full()), _vector(f_t)

    if functions.jacobian is None:
        return Dopri5(slope, project, start, state, *control, stops=stops, sizes=sizes)
    return Rodas(
        slope, project, start, state, *control, stops=stops, sizes=sizes, jacobian=jacobian
    )


def _begin(solver: Stepper) -> Array:
    """The first state, on the constraints."""
    assert solver.project is not None
    try:
        return solver.project(solver.t, solver.x)
    except Failure as failure:
        raise failed(solver.t, 0.0, str(failure), state=solver.x.tolist()) from failure


def _projection(problem: IntegrationProblem, p: Array, stops: Stops) -> Projection | None:
    """Newton steps until the constraints hold to rounding."""
    step = problem.equations.project
    if step is None:
        return None

    def onto(t: float, x: Array) -> Array:
        for _ in range(ITERATIONS):
            try:
                moved, residual = step(stops.law_time(t), x, p)
            except RuntimeError as error:
                raise failure_of(error, "projection") from error
            x = _vector(moved)
            if not (np.isfinite(x).all() and np.isfinite(float(residual))):
                break
            if float(residual) < TOLERANCE * max(1.0, float(np.max(np.abs(x), initial=0.0))):
                return x
        raise Failure("projection")

    return onto


def _watch(problem: IntegrationProblem, p: Array, solver: Stepper) -> EventStepper | None:
    """The integration with its events, which has looked at the first state."""
    functions, project, at = problem.equations, solver.project, solver.stops.law_time
    indicators, rates, jump = functions.indicators, functions.rates, functions.jump
    approaches = functions.approaches
    if indicators is None or rates is None or jump is None:
        return None

    def after(t: float, x: Array, fired: Flags) -> Array:
        try:
            moved, modes = map(_vector, jump(at(t), x, p, fired))
        except RuntimeError as error:
            raise failure_of(error, "jump") from error
        if not (np.isfinite(moved).all() and np.isfinite(modes).all()):
            raise Failure("jump")
        p[len(p) - problem.modes :] = modes
        return moved if project is None else project(t, moved)

    watched = EventStepper(
        solver,
        lambda t, x: _vector(indicators(at(t), x, p)),
        lambda t, x: _vector(rates(at(t), x, p)),
        after,
        None if approaches is None else lambda t, x: np.asarray(approaches(at(t), x, p).full()),
    )
    watched.start()
    return watched
