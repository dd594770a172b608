"""Integration problems: functions in a standard form, checked arguments, results and errors."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import casadi
import numpy as np
import numpy.typing as npt

from mbs.errors import Interrupted, ModelError, SolverError
from mbs.operations.graph import expanded
from mbs.text import quoted

# Functions for motions through singular configurations, where constraints become dependent.


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """Functions of t, x = [q; v; z] and p, for steps through singular configurations.

    Near them the integrator uses local tangent coordinates, see `core/source/passage.h`.

    Attributes:
        rows: `rows(t, x, p) -> place, slope, J, b, c, N, bend, rank`: residuals of the position
            constraints and their derivatives by q; velocity constraints J v = b and J a = c; q' =
            N v and q'' = N a + bend; rank of J.
        forces: `forces(t, x, p) -> M, f, rate`: M a = f + J' y with constraint forces y, and the
            rates of z.
        regularity: `regularity(t, x, p)`: measure of the independence of the constraints. Near a
            singular configuration it is small and linear in the distance.
        size: nq, nv, nz; number of position constraints; number of velocity constraints that lock
            a coordinate at its present value; number of velocity constraints; 1 if constraints
            depend on time, else 0.
        typical: regularity at a common configuration.
    """

    rows: casadi.Function
    forces: casadi.Function
    regularity: casadi.Function
    size: tuple[int, int, int, int, int, int, int]
    typical: float


# Events of an integration with discrete modes: definition and results.


Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Events:
    """Event functions: indicators, and the jumps of state and modes that they trigger.

    Modes are numbers that are constant between events. They are the last parameters of all
    functions of the integration.

    Attributes:
        indicators: `indicators(t, x, p) -> g`, positive between events. An event is a time at
            which an indicator becomes zero or negative. After the jump each indicator must be
            positive, or increase from zero.
        jump: `jump(t, x, p, fired) -> (x, modes)`: state and modes after an event. fired is 1 for
            indicators that are not positive, else 0. Without modes the result may be x only.
        modes: (nm,) initial modes.
        first_step: length of the first step after an event [s]. If zero, it is estimated from the
            derivatives, which may be too long for short processes.
        approaches: `approaches(t, x, p) -> a`, (k, 3) for k indicators. Column 1: bound of the rate
            at the present speed. Column 2: reciprocal of the shortest time in which the indicator
            falls to zero and rises again [1/s]; zero if two samples per step are enough. Column 3:
            1 if the equations depend on the indicator, else 0. None if all elements are zero.
    """

    indicators: casadi.Function
    jump: casadi.Function
    modes: npt.ArrayLike = ()
    first_step: float = 0.0
    approaches: casadi.Function | None = None


@dataclass(frozen=True, slots=True, eq=False)
class IntegrationEvent:
    """Event of a motion.

    Attributes:
        time: time of the event [s].
        fired: indices of the indicators that triggered jumps.
        modes: (nm,) modes after the event.
    """

    time: float
    fired: tuple[int, ...]
    modes: Array


@dataclass(frozen=True, slots=True, eq=False)
class EventMotion:
    """Result of an integration with events.

    Attributes:
        x: (m, nx) states at the requested times that were reached. At the time of an event, the
            state after the event.
        modes: (m, nm) modes at these times.
        events: events in order of time.
        stop: error that ended the integration early; None if all times were reached.
        first_slope: (nx,) derivative of x at the first time, if the motion starts at a singular
            configuration, on the branch that it follows; else None.
    """

    x: Array
    modes: Array
    events: tuple[IntegrationEvent, ...]
    stop: SolverError | Interrupted | None = None
    first_slope: Array | None = None


def fired_of(flags: npt.ArrayLike) -> tuple[int, ...]:
    """Return the indices of the event indicators whose flag is not zero, in increasing order.

    Args:
        flags: (k,) flag of each event indicator.
    """
    return tuple(np.flatnonzero(flags).tolist())


def modes_at(times: Array, first: Array, events: tuple[IntegrationEvent, ...]) -> Array:
    """Return the modes at given times, (m, nm); at the time of an event, the modes after it.

    Args:
        times: (m,) increasing times [s].
        first: (nm,) modes before the first event.
        events: events in order of time.
    """
    if not first.size:
        return np.empty((len(times), 0))
    values = np.array([first, *(event.modes for event in events)])
    passed = np.searchsorted([event.time for event in events], times, side="right")
    return values[passed]


Method = Literal["dopri5", "rodas"]
"""Integration method: the explicit pair of Dormand and Prince, or RODAS5P for stiff systems."""

METHODS: tuple[Method, ...] = get_args(Method)


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """Functions of an integration, with dense inputs and outputs.

    Attributes:
        rhs: `mbs_rhs(t, x, p) -> xdot`.
        jacobian: `mbs_jacobian(t, x, p) -> (d rhs / d x, d rhs / d t)`; None for an explicit
            method.
        project: `mbs_project(t, x, p) -> (x, residual)`; None without constraints.
        indicators: `mbs_indicators(t, x, p) -> g`; None without events.
        rates: `mbs_rates(t, x, p) -> dg/dt` along the motion; None without events.
        jump: `mbs_jump(t, x, p, fired) -> (x, modes)`; None without events.
        approaches: `mbs_approaches(t, x, p) -> a`, see `Events`; None if all elements are zero.
        passage: `mbs_rows`, `mbs_forces` and `mbs_regularity`; None if the integration stops at
            singular configurations.
        first_step: length of the first step after an event [s], see `Events`.
    """

    rhs: casadi.Function
    jacobian: casadi.Function | None = None
    project: casadi.Function | None = None
    indicators: casadi.Function | None = None
    rates: casadi.Function | None = None
    jump: casadi.Function | None = None
    approaches: casadi.Function | None = None
    passage: Passage | None = None
    first_step: float = 0.0

    @property
    def all(self) -> list[casadi.Function]:
        """List of the functions that are not None."""
        through = self.passage
        functions: tuple[casadi.Function | None, ...] = (
            self.rhs,
            self.jacobian,
            self.project,
            self.indicators,
            self.rates,
            self.jump,
            self.approaches,
        )
        if through is not None:
            functions = (*functions, through.rows, through.forces, through.regularity)
        return [f for f in functions if f is not None]


@dataclass(frozen=True, slots=True, eq=False)
class IntegrationProblem:
    """Integration with checked arguments.

    Attributes:
        equations: functions of the integration.
        x0: (nx,) state at the first time.
        times: (m,) increasing times [s].
        p: (np + nm,) parameters and modes.
        modes: number of modes, nm.
        rtol: relative tolerance of the error of a step.
        atol: absolute tolerance of the error of a step.
        max_step: maximum step [s].
        stops: increasing times [s] at which steps end, and for each time whether functions of time
            may be discontinuous there. If so, the step size is estimated again.
        sizes: (2, nx) factors of the absolute and of the relative tolerance of each state; None if
            all factors are 1.
    """

    equations: Equations
    x0: Array
    times: Array
    p: Array
    modes: int
    rtol: float
    atol: float
    max_step: float
    stops: tuple[Array, npt.NDArray[np.bool_]]
    sizes: Array | None = None

    def motion(
        self,
        x: Array,
        log: Sequence[IntegrationEvent],
        stop: SolverError | Interrupted | None,
        first_slope: Array | None = None,
    ) -> EventMotion:
        """Return the result of an integration as an `EventMotion`.

        Args:
            x: (k, nx) states at the first k times.
            log: events in order of time.
            stop: error that ended the integration early; None if all times were reached.
            first_slope: derivative of x at a singular start, see `EventMotion`.
        """
        first, events = self.p[len(self.p) - self.modes :], tuple(log)
        modes = modes_at(self.times[: len(x)], first, events)
        return EventMotion(x, modes, events, stop, first_slope)


def equations(
    rhs: casadi.Function,
    project: casadi.Function | None,
    method: str,
    events: Events | None,
    passage: Passage | None = None,
) -> Equations:
    """Return the functions with the names and the form that the integrator requires.

    Args:
        rhs: `rhs(t, x, p) -> xdot`.
        project: `project(t, x, p) -> (x, residual)`, or None.
        method: name in METHODS.
        events: event functions; None without events.
        passage: functions for singular configurations; None to stop there.

    Raises:
        ModelError: a function has the wrong inputs or outputs, or the method is unknown.
    """
    if method not in METHODS:
        raise ModelError(
            f"integrate: method is {quoted(method)}; use 'dopri5', or 'rodas' for stiff equations"
        )
    if rhs.n_in() not in (2, 3) or rhs.numel_in(0) != 1:
        raise ModelError(f"{rhs}: the right-hand side of an integration is rhs(t, x, p) -> xdot")
    n, n_p = rhs.numel_in(1), rhs.numel_in(2) if rhs.n_in() == 3 else 0
    if rhs.numel_out(0) != n:
        raise ModelError(
            f"{rhs.name()}: it gives {rhs.numel_out(0)} slopes for {n} states; give one for each"
        )
    t, x, p = casadi.MX.sym("t"), casadi.MX.sym("x", n), casadi.MX.sym("p", n_p)
    txp = [t, x, p]
    slope = casadi.vec(_first_output(rhs, txp[: rhs.n_in()]))
    f = _dense_function("mbs_rhs", txp, slope)
    jacobian = None
    if method == "rodas":
        f_xt = [casadi.jacobian(slope, v) for v in (x, t)]
        jacobian = _dense_function("mbs_jacobian", txp, *f_xt)
    g = None if project is None else _projection(project, txp)
    through = None if passage is None else _passage(passage, txp)
    if events is None:
        return Equations(f, jacobian, g, passage=through)
    found = _event_functions(events, txp, slope)
    return Equations(f, jacobian, g, *found, passage=through, first_step=events.first_step)


def _passage(given: Passage, txp: list[casadi.MX]) -> Passage:
    """Return a `Passage` with the function names that the integrator requires and dense vectors.

    `txp` are the symbols of t, x and p.
    """

    def vectors_dense(name: str, function: casadi.Function) -> casadi.Function:
        values = function.call(txp)
        dense = [value if value.shape[1] > 1 else casadi.densify(value) for value in values]
        return _scalar(casadi.Function(name, txp, dense))

    return replace(
        given,
        rows=vectors_dense("mbs_rows", given.rows),
        forces=vectors_dense("mbs_forces", given.forces),
        regularity=_dense_function("mbs_regularity", txp, *given.regularity.call(txp)),
    )


def _first_output(function: casadi.Function, inputs: list[casadi.MX]) -> casadi.MX:
    """Return the first output of a function for the symbolic `inputs`."""
    return function(*inputs) if function.n_out() == 1 else function(*inputs)[0]


def _dense_function(name: str, inputs: list[casadi.MX], *outputs: casadi.MX) -> casadi.Function:
    """Return the Function `name` of `inputs` with dense outputs.

    It is expanded to scalar operations if possible.
    """
    return _scalar(casadi.Function(name, inputs, [casadi.densify(value) for value in outputs]))


_OPERATIONS = ("SXFunction", "MXFunction")
_SIDE_EFFECTS = (casadi.OP_ASSERTION, casadi.OP_MONITOR)


def _scalar(function: casadi.Function) -> casadi.Function:
    """Return the function, expanded to scalar operations if these are all that it consists of.

    Machine code is written from these operations. Interpreted and compiled functions are
    bit-identical if both evaluate the same operations. Maps and branches that are not evaluated
    (Switch) are not expanded, since that would multiply the operations.
    """
    every = [function, *function.find_functions()]
    matrices = [f for f in every if f.is_a("MXFunction")]
    steps = (f.instruction_id(k) for f in matrices for k in range(f.n_instructions()))
    if any(f.class_name() not in _OPERATIONS for f in every) or any(
        step in _SIDE_EFFECTS for step in steps
    ):
        return function
    try:
        return expanded(function)
    except ModelError:
        return function


def _projection(project: casadi.Function, txp: list[casadi.MX]) -> casadi.Function:
    """Return the projection as `mbs_project(t, x, p)`; raise ModelError if its sizes do not fit.

    `txp` are the symbols of t, x and p.
    """
    sizes = [symbol.numel() for symbol in txp]
    given = [project.numel_in(k) for k in range(project.n_in())]
    fits = len(given) in (2, 3) and given == sizes[: len(given)]
    if not fits or project.n_out() != 2 or project.numel_out(0) != sizes[1]:
        raise ModelError(
            f"{project}: a projection is project(t, x, p) -> (x, residual), x ({sizes[1]},)"
        )
    outputs = project(*txp[: len(given)])
    return _dense_function("mbs_project", txp, *map(casadi.vec, outputs))


def _event_functions(
    events: Events, txp: list[casadi.MX], slope: casadi.MX
) -> tuple[casadi.Function, casadi.Function, casadi.Function, casadi.Function | None]:
    """Return indicators, their rates, jump and approaches (or None) with inputs (t, x, p).

    `txp` are the symbols of t, x and p, and `slope` is x'. Raise ModelError if sizes do not fit.
    """
    t, x, p = txp
    indicators, jump, n_modes = events.indicators, events.jump, len(numbers(events.modes))
    sizes = [1, x.numel(), p.numel()]
    given = [indicators.numel_in(k) for k in range(indicators.n_in())]
    if len(given) not in (2, 3) or given != sizes[: len(given)] or n_modes > sizes[2]:
        raise ModelError(
            f"{indicators}: indicators of events are indicators(t, x, p) -> g with the inputs of "
            f"the right-hand side, {sizes[1]} states and {sizes[2]} parameters and modes"
        )
    g = casadi.vec(_first_output(indicators, txp[: len(given)]))
    fired = casadi.MX.sym("fired", g.numel())
    taken = [jump.numel_in(k) for k in range(jump.n_in())]
    left = [jump.numel_out(k) for k in range(jump.n_out())]
    wanted = [sizes[1], n_modes] if n_modes or len(left) == 2 else [sizes[1]]
    if taken != [*sizes, g.numel()] or left != wanted:
        raise ModelError(
            f"{jump}: the jump of an event is jump(t, x, p, fired) -> (x, modes), x ({sizes[1]},), "
            f"p ({sizes[2]},) with the modes last, fired ({g.numel()},), modes ({n_modes},)"
        )
    rate = casadi.jtimes(g, x, slope) + casadi.jtimes(g, t, casadi.MX(1))
    after = [jump(*txp, fired)] if len(left) == 1 else list(jump(*txp, fired))
    modes = casadi.vec(after[1]) if n_modes else casadi.MX(0, 1)
    near = casadi.MX(0, 3) if events.approaches is None else events.approaches(*txp)
    if events.approaches is not None and near.shape != (g.numel(), 3):
        raise ModelError(
            f"{events.approaches}: approaches of events are approaches(t, x, p) -> a, a"
            f" ({g.numel()}, 3)"
        )
    return (
        _dense_function("mbs_indicators", txp, g),
        _dense_function("mbs_rates", txp, rate),
        _dense_function("mbs_jump", [*txp, fired], casadi.vec(after[0]), modes),
        None if events.approaches is None else _dense_function("mbs_approaches", txp, near),
    )


def problem(
    functions: Equations,
    x0: npt.ArrayLike,
    times: npt.ArrayLike,
    p: npt.ArrayLike | None,
    modes: npt.ArrayLike,
    tolerances: tuple[float, float],
    max_step: float,
    stops: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    sizes: npt.ArrayLike | None = None,
) -> IntegrationProblem:
    """Return an integration problem with checked arguments.

    Args:
        functions: result of `equations`.
        x0: (nx,) state at the first time.
        times: (m,) increasing times [s].
        p: (np,) parameters; none by default.
        modes: (nm,) modes at the first time.
        tolerances: relative and absolute tolerance of the error of a step.
        max_step: maximum step [s]; infinite if only the error limits it.
        stops: see `IntegrationProblem`; none by default.
        sizes: see `IntegrationProblem`.

    Raises:
        ModelError: an argument does not fit the functions.
    """
    f = functions.rhs
    n, n_p = f.numel_in(1), f.numel_in(2)
    x, t, m = numbers(x0), numbers(times), numbers(modes)
    own = numbers([] if p is None else p)
    if len(x) != n or len(own) + len(m) != n_p:
        given = f"{len(x)} initial states and {len(own)} parameters"
        raise ModelError(
            f"integrate: {given}{f' and {len(m)} modes' if len(m) else ''} were given; "
            f"the right-hand side has {n} states and {n_p} parameters"
        )
    if not np.isfinite(np.concatenate([x, t, own, m])).all():
        raise ModelError("integrate: a state, a time or a parameter is not finite; give numbers")
    if len(t) == 0 or (t[1:] < t[:-1]).any():
        raise ModelError("integrate: times must be one or more, in increasing order")
    rtol, atol = tolerances
    if not all(isinstance(value, (int, float)) and 0 < value < np.inf for value in tolerances):
        raise ModelError(f"integrate: tolerances {rtol!r} and {atol!r} must be positive numbers")
    if not (isinstance(max_step, (int, float)) and max_step > 0):
        raise ModelError(f"integrate: the longest step {max_step!r} must be a positive number, s")
    ends, jumps = np.empty(0), np.empty(0, dtype=bool)
    if stops is not None:
        ends, jumps = numbers(stops[0]), np.array(stops[1], dtype=bool).ravel()
        if len(jumps) != len(ends) or not np.isfinite(ends).all() or np.any(np.diff(ends) <= 0):
            raise ModelError(
                "integrate: stops must be finite times in increasing order, and as many flags"
            )
    every = np.concatenate([own, m])
    factors = None if sizes is None else np.ascontiguousarray(sizes, dtype=float)
    if factors is not None and (factors.shape != (2, n) or not np.all(factors > 0)):
        raise ModelError(
            f"integrate: sizes must be 2 rows of {n} positive numbers, one for each state"
        )
    limits = rtol, atol, max_step
    return IntegrationProblem(functions, x, t, every, len(m), *limits, (ends, jumps), factors)


def numbers(values: npt.ArrayLike) -> Array:
    """Return values of any shape as a vector (n,) of floats.

    Raises:
        ModelError: the values are not numeric.
    """
    try:
        return np.array(values, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        raise ModelError(f"integrate: {quoted(values)} are not numbers; give real ones") from None


# Reasons why an integration stops, as error texts.


MAX_STEPS = 100_000
REASONS = {
    "steps": f"more than {MAX_STEPS} steps between two output times; ask for a looser tolerance "
    "or, when fast decays are in the system, for a method for stiff equations",
    "small": "error control asks for a step below the rounding of time; "
    "look for a singularity or a jump",
    "rhs": "the right-hand side has no value there",
    "projection": "the projection onto the constraints does not converge; "
    "look for a singular configuration",
    "singular": "a singular configuration is not passed, the rows of the loops stay dependent "
    "around it, or rounding there exceeds the tolerance; start elsewhere, end the run before, or "
    "ask for a looser tolerance, 1e-10 or more",
    "near miss": "branches of motion come near each other and do not meet, by so little that what "
    "turns there cannot be told from what goes on; make the branches meet, or miss by more, or ask "
    "for a looser tolerance",
    "undetermined": "the motion starts in a singular configuration, where branches of motion meet, "
    "and its velocities are those of no branch with the mobility of the mechanism; give velocities "
    "of one branch to all joints, or start beside it",
    "finite": "a value is not finite; look for a singularity",
    "indicators": "an event indicator has no value there; look for efforts or laws that have none, "
    "or a singular configuration",
    "jump": "the jump of an event has no value there",
    "settle": "the events there do not settle, each jump asks for another one; "
    "let the jump make the indicators positive, or zero and rising",
    "standstill": "more than 100 events, and time hardly advances; "
    "add a mode in which what repeats is at rest",
}


class Failure(Exception):
    """Exception: an evaluation has no value, so the step must be shortened."""


class LawFailure(Exception):
    """Exception: Python code of a law raised an error, so the integration must stop."""


_OF_LAW = re.compile(
    r'Error calling "eval" for object (?P<law>\S+):\n[^\n]*?: (?P<text>.*)', re.DOTALL
)
"""Pattern of CasADi's message about an error in the `eval` of a Callback."""


def failure_of(error: RuntimeError, reason: str) -> Failure:
    """Return a `Failure` for an evaluation that CasADi ended with an error.

    Raise if it must stop.

    Returns:
        `Failure(reason)`, whose catcher shortens the step.
    """
    text = str(error)
    if text.rstrip().endswith("KeyboardInterrupt"):
        raise KeyboardInterrupt from error
    if found := _OF_LAW.search(text):
        what = " ".join(found["text"].split()) or "an error without a message"
        raise LawFailure(f"the law {found['law']!r} raised an error: {what}") from error
    return Failure(reason)


_SINGULAR = ("singular", "near miss", "undetermined", "projection")


def failed(
    t: float, h: float, reason: str, fired: Sequence[int] = (), state: Sequence[float] = ()
) -> SolverError:
    """Return the error of an integration that stopped: with time, step and reason.

    Args:
        t: time of the last accepted state [s].
        h: step that was to be made next [s]; 0 if there was none.
        reason: key of REASONS.
        fired: indices of the event indicators that caused the stop.
        state: last state that was reached.

    Returns:
        an error to raise.
    """
    step = f" with step {h:.3g} s" if h > 0 else ""
    who = f"; indicators {', '.join(map(str, fired))}" if fired else ""
    return SolverError(
        f"integration stopped at t = {t:.9g} s{step}: {REASONS[reason]}{who}",
        state=state,
        singular=reason in _SINGULAR,
        time=t,
        fired=fired,
    )


def stopped_by_law(t: float, failure: LawFailure, state: Sequence[float]) -> SolverError:
    """Return the error of an integration that a law stopped, with the cause of the law's error.

    Args:
        t: time of the last accepted state [s].
        failure: error of the law.
        state: last state that was reached.
    """
    error = SolverError(f"integration stopped at t = {t:.9g} s: {failure}", state=state, time=t)
    error.__cause__ = failure.__cause__
    return error


def interrupted(t: float) -> Interrupted:
    """Return the exception of an interrupted integration.

    Args:
        t: time of the last accepted state [s].
    """
    return Interrupted(f"integration interrupted at t = {t:.9g} s", time=t)
