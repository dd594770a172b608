"""Integrations run by the Python twins of the compiled driver."""

from collections.abc import Callable

import casadi
import numpy as np
import numpy.typing as npt

from mbs.solvers.dopri5 import Dopri5
from mbs.solvers.event_stepper import EventStepper, Flags
from mbs.solvers.events import Event, fired_of
from mbs.solvers.failures import Failure, failed
from mbs.solvers.problem import Problem
from mbs.solvers.rodas import Rodas
from mbs.solvers.stepper import Projection, Stepper

Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]

TOLERANCE = 1e-12
ITERATIONS = 10
_CHUNK = 50  # steps between two calls of progress


def run_interpreted(problem: Problem, progress: Progress | None) -> tuple[Array, list[Event]]:
    """States at the times of a problem, and its events.

    Args:
        problem: what to integrate.
        progress: called now and then with the time reached, s.

    Returns:
        (m, nx) a row for each time; the events in the order of time.

    Raises:
        SolverError: the integration cannot go on.
    """
    p, times = problem.p.copy(), problem.times
    project = _projection(problem, p)
    start = float(times[0])
    try:
        state = problem.x0 if project is None else project(start, problem.x0)
    except Failure as failure:
        raise failed(start, 0.0, str(failure)) from failure
    solver = _stepper(problem, p, project, state)
    table = np.empty((len(times), len(state)))
    log: list[Event] = []
    watched = _watched(problem, p, project, solver)
    row = 0
    while row < len(times):
        if watched is None:
            row = solver.table(times, row, table, _CHUNK)
        else:
            row, happened = watched.table(times, row, table, _CHUNK)
            if happened:
                fired = fired_of(watched.fired)
                log.append(Event(solver.t, fired, p[len(p) - problem.modes :].copy()))
        if progress is not None:
            progress(solver.t)
    return table, log


def _vector(value: casadi.DM) -> Array:
    return np.asarray(value.full()[:, 0])


def _stepper(problem: Problem, p: Array, project: Projection | None, state: Array) -> Stepper:
    functions, start = problem.equations, float(problem.times[0])
    control = problem.rtol, problem.atol, problem.max_step

    def slope(t: float, x: Array) -> Array:
        return _vector(functions.rhs(t, x, p))

    def jacobian(t: float, x: Array) -> tuple[Array, Array]:
        assert functions.jacobian is not None
        J, f_t = functions.jacobian(t, x, p)
        return np.asarray(J.full()), _vector(f_t)

    if functions.jacobian is None:
        return Dopri5(slope, project, start, state, *control)
    return Rodas(slope, project, start, state, *control, jacobian=jacobian)


def _projection(problem: Problem, p: Array) -> Projection | None:
    """Newton steps until the constraints hold to rounding."""
    step = problem.equations.project
    if step is None:
        return None

    def onto(t: float, x: Array) -> Array:
        for _ in range(ITERATIONS):
            try:
                moved, residual = step(t, x, p)
            except RuntimeError as error:
                raise Failure("projection") from error
            x = _vector(moved)
            if not (np.isfinite(x).all() and np.isfinite(float(residual))):
                break
            if float(residual) < TOLERANCE * max(1.0, float(np.max(np.abs(x), initial=0.0))):
                return x
        raise Failure("projection")

    return onto


def _watched(
    problem: Problem, p: Array, project: Projection | None, solver: Stepper
) -> EventStepper | None:
    """The integration with its events, which has looked at the first state."""
    functions = problem.equations
    indicators, rates, jump = functions.indicators, functions.rates, functions.jump
    if indicators is None or rates is None or jump is None:
        return None

    def after(t: float, x: Array, fired: Flags) -> Array:
        try:
            moved, modes = map(_vector, jump(t, x, p, fired))
        except RuntimeError as error:
            raise Failure("jump") from error
        if not (np.isfinite(moved).all() and np.isfinite(modes).all()):
            raise Failure("jump")
        p[len(p) - problem.modes :] = modes
        return moved if project is None else project(t, moved)

    watched = EventStepper(
        solver,
        lambda t, x: _vector(indicators(t, x, p)),
        lambda t, x: _vector(rates(t, x, p)),
        after,
    )
    watched.start()
    return watched
