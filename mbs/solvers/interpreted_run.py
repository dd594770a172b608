"""Integrations run by the Python twins of the compiled driver."""

from collections.abc import Callable

import casadi
import numpy as np
import numpy.typing as npt

from mbs.errors import Interrupted, SolverError
from mbs.solvers.dopri5 import Dopri5
from mbs.solvers.event_stepper import EventStepper, Flags
from mbs.solvers.events import Event, EventMotion, fired_of
from mbs.solvers.failures import Failure, failed, interrupted
from mbs.solvers.problem import Problem
from mbs.solvers.rodas import Rodas
from mbs.solvers.stepper import Projection, Stepper, Table

Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]

TOLERANCE = 1e-12
ITERATIONS = 10
_CHUNK = 50  # steps between two calls of progress


def run_interpreted(problem: Problem, progress: Progress | None) -> EventMotion:
    """The motion at the times of a problem, as far as it comes.

    Args:
        problem: what to integrate.
        progress: called now and then with the time reached, s.
    """
    p = problem.p.copy()
    solver = _stepper(problem, p)
    table = Table(problem.times, np.empty((len(problem.times), len(problem.x0))))
    log: list[Event] = []
    stop: SolverError | Interrupted | None = None
    try:
        if solver.project is not None:
            solver.x = _begun(solver)
        watched = _watched(problem, p, solver)
        while not table.full:
            if watched is None:
                solver.fill(table, _CHUNK)
            elif watched.fill(table, _CHUNK):
                modes = p[len(p) - problem.modes :].copy()
                log.append(Event(solver.t, fired_of(watched.fired), modes))
            if progress is not None:
                progress(solver.t)
    except SolverError as error:
        stop = error
    except KeyboardInterrupt:
        stop = interrupted(solver.t)
    return problem.motion(table.rows[: table.done], log, stop)


def _vector(value: casadi.DM) -> Array:
    return np.asarray(value.full()[:, 0])


def _stepper(problem: Problem, p: Array) -> Stepper:
    functions, start, state = problem.equations, float(problem.times[0]), problem.x0
    project = _projection(problem, p)
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


def _begun(solver: Stepper) -> Array:
    """The first state, on the constraints."""
    assert solver.project is not None
    try:
        return solver.project(solver.t, solver.x)
    except Failure as failure:
        raise failed(solver.t, 0.0, str(failure), state=solver.x.tolist()) from failure


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


def _watched(problem: Problem, p: Array, solver: Stepper) -> EventStepper | None:
    """The integration with its events, which has looked at the first state."""
    functions, project = problem.equations, solver.project
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
