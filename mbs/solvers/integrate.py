"""Motions of a generated system, advanced in time by compiled code and kept on its constraints."""

import math
from collections.abc import Callable

import casadi
import numpy as np
import numpy.typing as npt

from mbs.native import compiler_found
from mbs.solvers.compiled_run import library_of, run_compiled
from mbs.solvers.events import EventMotion, Events
from mbs.solvers.interpreted_run import run_interpreted
from mbs.solvers.passage import Passage
from mbs.solvers.problem import Problem, equations, problem

Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]


def integrate(
    rhs: casadi.Function,
    x0: npt.ArrayLike,
    times: npt.ArrayLike,
    *,
    p: npt.ArrayLike | None = None,
    project: casadi.Function | None = None,
    passage: Passage | None = None,
    method: str = "dopri5",
    rtol: float = 1e-8,
    atol: float = 1e-8,
    max_step: float = math.inf,
    progress: Progress | None = None,
    compiled: bool = True,
) -> Array:
    """States at given times, by a one-step method of order 5(4) with dense output.

    Source: Hairer, Norsett and Wanner 1993, II.4 to II.6; projection after each accepted step as
    in Hairer, Lubich and Wanner 2006, IV.4.

    Args:
        rhs: `rhs(t, x, p) -> xdot`.
        x0: (nx,) state at the first time; it is projected too.
        times: (m,) s, increasing; the first one is the initial time.
        p: (np,) parameters; none by default.
        project: `project(t, x, p) -> (x, residual)`, one Newton step onto the constraints with the
            largest residual; it is repeated after each step until the residual is below 1e-12.
        passage: for steps through states where the constraints become dependent; without it the
            integration stops there.
        method: "dopri5", Dormand and Prince's explicit pair; or "rodas", the linearly implicit
            RODAS5P for stiff equations, which uses the exact Jacobian of rhs.
        rtol: relative tolerance of the error of one step.
        atol: absolute tolerance of the error of one step, in the units of the states.
        max_step: the longest step, s; only the error limits it by default.
        progress: called now and then with the time reached, s.
        compiled: False for the same algorithm in Python, about a hundred times slower; it is
            what runs when there is no C compiler.

    Returns:
        (m, nx), a row for each time.

    Raises:
        ModelError: an argument does not fit the functions.
        SolverError: the integration cannot go on; the message says when and why.
        Interrupted: control-C was pressed.
        CompilerError: the compiler that CC names does not start.
    """
    motion = integrate_events(
        rhs,
        x0,
        times,
        None,
        p=p,
        project=project,
        passage=passage,
        method=method,
        rtol=rtol,
        atol=atol,
        max_step=max_step,
        progress=progress,
        compiled=compiled,
    )
    return motion.x


def integrate_events(
    rhs: casadi.Function,
    x0: npt.ArrayLike,
    times: npt.ArrayLike,
    events: Events | None,
    *,
    p: npt.ArrayLike | None = None,
    project: casadi.Function | None = None,
    passage: Passage | None = None,
    method: str = "dopri5",
    rtol: float = 1e-8,
    atol: float = 1e-8,
    max_step: float = math.inf,
    progress: Progress | None = None,
    compiled: bool = True,
    partial: bool = False,
) -> EventMotion:
    """States and modes at given times of a system whose state or equations jump at events.

    An event is where an indicator is not positive any more. It is located to the rounding of time,
    the earliest first; those that fall together are handed to one jump. After a jump the state is
    projected; an indicator that is negative, or falls from zero, asks for another jump at the same
    time, where zero is what is smaller than atol. So it is at the first time too. Indicators and
    their slopes are looked at twice in each step; what falls at one look and rises at the next is
    searched for a dip below zero. What moves faster than the steps needs max_step.

    Source: Cellier and Kofman 2006, chapter 9.

    Args:
        rhs: `rhs(t, x, p) -> xdot`; p ends with the modes, here and in all functions.
        x0: (nx,) state at the first time.
        times: (m,) s, increasing; a row at the time of an event is after it.
        events: indicators, jump and the first modes; None where there are none.
        p: (np,) parameters, without the modes.
        project: as in `integrate`, likewise the arguments below.
        passage: as in `integrate`; it has the modes of the present too.
        method: "dopri5" or "rodas".
        rtol: relative tolerance of the error of one step.
        atol: absolute tolerance of the error of one step, in the units of the states.
        max_step: the longest step, s; only the error limits it by default.
        progress: called now and then with the time reached, s.
        compiled: False for the same algorithm in Python.
        partial: True for what was reached, with its `stop`, where the integration cannot go on or
            is interrupted by control-C; nothing is raised for that then.

    Returns:
        states, modes and the list of events.

    Raises:
        ModelError: an argument does not fit the functions.
        SolverError: the integration cannot go on: as in `integrate`, or the jumps at one time do
            not come to an end, or events crowd until time stands still.
        Interrupted: control-C was pressed.
        CompilerError: the compiler that CC names does not start.
    """
    functions = equations(rhs, project, method, events, passage)
    modes = () if events is None else events.modes
    given = problem(functions, x0, times, p, modes, (rtol, atol), max_step)
    motion = _run(given, progress, compiled)
    if motion.stop is not None and not partial:
        raise motion.stop
    return motion


def _run(given: Problem, progress: Progress | None, compiled: bool) -> EventMotion:
    library = library_of(given.equations) if compiled and compiler_found() else None
    if library is None:
        return run_interpreted(given, progress)
    return run_compiled(library, given, progress)
