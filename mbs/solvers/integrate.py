"""Motions of a generated system, advanced in time by compiled code and kept on its constraints."""

import ctypes
import functools
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt

from mbs.errors import Interrupted, ModelError, SolverError
from mbs.native import cached_library, compiler_found
from mbs.native.compiled import calls_machine_code, generated, unwritten
from mbs.native.compiler import flags_for
from mbs.native.plain_source import plain_source
from mbs.solvers.control_c import control_c
from mbs.solvers.interpreted_run import run_interpreted
from mbs.solvers.problem import (
    Equations,
    EventMotion,
    Events,
    IntegrationEvent,
    IntegrationProblem,
    Passage,
    equations,
    failed,
    fired_of,
    interrupted,
    problem,
)

# Integrations run by the compiled driver `native/runtime/driver.c`.


Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]

_CHUNK = 200  # steps between two looks at the keyboard
_FIRED, _MORE = -1, 1
_REASONS = {
    2: "steps",
    3: "small",
    4: "rhs",
    5: "projection",
    6: "finite",
    7: "singular",
    8: "singular",
    9: "near miss",
    10: "singular",
    11: "undetermined",
    12: "indicators",
    13: "jump",
    14: "settle",
    15: "standstill",
}
_CROWDED = (14, 15)
_RUNTIME = ("stepper", "dopri5")


def is_compilable(function: casadi.Function) -> bool:
    """Whether there is a compiler, and CasADi can write a Function as C.

    Args:
        function: any Function.
    """
    functions = [function]
    return (
        compiler_found()
        and not calls_machine_code(functions)
        and not unwritten(generated(functions))
    )


_LONG = 10_000
"""Lines of CasADi's text beyond which it is written in pieces: compilers need more than
proportional time for long functions, and pieces of small ones cost time in every step."""


def _in_pieces(functions: Sequence[casadi.Function]) -> str:
    """The same functions in pieces that compilers take in linear time, to the last bit the same.

    Returns:
        an empty text where one of them has more than scalar operations.
    """
    try:
        text, work = plain_source(functions)
    except ModelError:
        return ""
    sizes = " ".join(f"*{name} = {size};" for name, size in work._asdict().items())
    given = ", ".join(f"long long *{name}" for name in work._asdict())
    lines = (f"int {f.name()}_work({given}) {{ {sizes} return 0; }}" for f in functions)
    return "\n".join([text, *lines])


def library_of(equations: Equations) -> ctypes.CDLL | None:
    """The compiled driver of these functions; None when CasADi can only interpret them.

    Raises:
        CompilerError: the compiler refused the code.
    """
    if calls_machine_code(equations.all):
        return None
    source = generated(equations.all)
    if unwritten(source):
        return None
    flags = [*flags_for(source)]
    if source.count("\n") > _LONG and (pieces := _in_pieces(equations.all)):
        source, flags = pieces, [*flags_for(pieces)]
    names = [*_RUNTIME]
    if equations.project is not None:
        flags.append("-DMBS_PROJECT")
    if equations.jacobian is not None:
        names.append("rodas")
        flags.append("-DMBS_RODAS")
    if equations.indicators is not None:
        names.append("events")
        flags.append("-DMBS_EVENTS")
    if equations.approaches is not None:
        flags.append("-DMBS_APPROACHES")
    if equations.passage is not None:
        names.extend(("dense", "passage"))
        flags.append("-DMBS_PASSAGE")
    runtime = _runtime(tuple(names))
    library = cached_library({"system.c": source, **runtime}, flags, common=tuple(runtime))
    return _load(library, equations.indicators is not None, equations.passage is not None)


def run_compiled(
    library: ctypes.CDLL, problem: IntegrationProblem, progress: Progress | None
) -> EventMotion:
    """The motion at the times of a problem, as far as it comes.

    Control-C is heard between two chunks of steps: the compiled code runs to the end of its own.

    Args:
        library: what `library_of` gave for its equations.
        problem: what to integrate.
        progress: called now and then with the time reached, s.

    Raises:
        SolverError: there is no memory for it.
    """
    x, times = problem.x0.copy(), problem.times
    table = np.empty((len(times), len(x)))
    done = ctypes.c_longlong(0)
    log: list[IntegrationEvent] = []
    stop: SolverError | Interrupted | None = None
    first: Array | None = None
    with _opened(library, problem) as driver, control_c() as check:
        status = library.mbs_begin(driver, _pointer(x))
        if status <= _MORE and problem.equations.passage is not None:
            slope = np.empty(len(x))
            first = slope if library.mbs_leaves(driver, _pointer(x), _pointer(slope)) else None
        try:
            while status <= _MORE and done.value < len(times):
                status = library.mbs_table(
                    driver,
                    _pointer(x),
                    _pointer(times),
                    len(times),
                    _pointer(table),
                    ctypes.byref(done),
                    _CHUNK,
                )
                if status == _FIRED:
                    log.append(_event(library, driver, problem))
                if progress is not None:
                    progress(library.mbs_time(driver))
                check()
        except KeyboardInterrupt:
            stop = interrupted(library.mbs_time(driver))
        if stop is None and status > _MORE:
            blamed = _event(library, driver, problem).fired if status in _CROWDED else ()
            stop = failed(
                library.mbs_time(driver),
                library.mbs_step(driver),
                _REASONS[status],
                blamed,
                x.tolist(),
            )
    return replace(problem.motion(table[: done.value], log, stop), first_slope=first)


def _event(
    library: ctypes.CDLL, driver: ctypes.c_void_p, problem: IntegrationProblem
) -> IntegrationEvent:
    assert problem.equations.indicators is not None
    fired = np.empty(problem.equations.indicators.numel_out(0))
    modes = np.empty(problem.modes)
    library.mbs_event(driver, _pointer(fired), _pointer(modes))
    return IntegrationEvent(library.mbs_time(driver), fired_of(fired), modes)


@functools.cache
def _runtime(names: tuple[str, ...]) -> dict[str, str]:
    folder = resources.files("mbs.native") / "runtime"
    files = ["driver.c", *(name + end for name in names for end in (".h", ".c"))]
    return {name: (folder / name).read_text(encoding="utf-8") for name in files}


def _load(path: Path, has_events: bool, has_passage: bool) -> ctypes.CDLL:
    library = ctypes.CDLL(str(path))
    handle, real, pointer = ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p
    integer = ctypes.c_longlong
    types: dict[str, tuple[Any, list[Any]]] = {
        "mbs_open": (handle, [ctypes.c_int, ctypes.c_int, pointer, pointer, real]),
        "mbs_close": (None, [handle]),
        "mbs_begin": (ctypes.c_int, [handle, pointer]),
        "mbs_table": (
            ctypes.c_int,
            [handle, pointer, pointer, integer, pointer, ctypes.POINTER(integer), integer],
        ),
        "mbs_sizes": (None, [handle, pointer, pointer]),
        "mbs_stops": (None, [handle, pointer, pointer, integer]),
        "mbs_time": (real, [handle]),
        "mbs_step": (real, [handle]),
    }
    if has_events:
        types["mbs_watch"] = (ctypes.c_int, [handle, ctypes.c_int, ctypes.c_int])
        types["mbs_event"] = (None, [handle, pointer, pointer])
    if has_passage:
        types["mbs_pass"] = (ctypes.c_int, [handle, *2 * [pointer], real])
        types["mbs_leaves"] = (ctypes.c_int, [handle, pointer, pointer])
    for name, (result, arguments) in types.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


@contextmanager
def _opened(library: ctypes.CDLL, problem: IntegrationProblem) -> Iterator[ctypes.c_void_p]:
    n, p, start = len(problem.x0), problem.p, float(problem.times[0])
    indicators = problem.equations.indicators
    afresh = problem.equations.first_step
    control = np.array([problem.rtol, problem.atol, problem.max_step, afresh])
    ends, jumps = problem.stops[0], problem.stops[1].astype(float)  # kept while the driver lives
    driver = library.mbs_open(n, len(p), _pointer(p), _pointer(control), start)
    full = not driver
    try:
        if driver and indicators is not None:
            full = library.mbs_watch(driver, indicators.numel_out(0), problem.modes) != 0
        if driver and not full and (through := problem.equations.passage) is not None:
            full = _pass(library, driver, through)
        if driver and problem.sizes is not None:
            library.mbs_sizes(driver, *map(_pointer, problem.sizes))
        if driver and len(ends):
            library.mbs_stops(driver, _pointer(ends), _pointer(jumps), len(ends))
        if full:
            raise SolverError(f"no memory is left to integrate {n} states; close other programs")
        yield driver
    finally:
        library.mbs_close(driver)


def _pass(library: ctypes.CDLL, driver: ctypes.c_void_p, through: Passage) -> bool:
    """Whether no memory is left for steps through singular configurations."""
    sizes = (ctypes.c_int * len(through.size))(*through.size)
    matrices = [(through.rows, number) for number in (1, 2, 5)] + [(through.forces, 0)]
    places = [_places(function.sparsity_out(number)) for function, number in matrices]
    pointers = (ctypes.c_void_p * len(places))(
        *(None if x is None else _pointer(x) for x in places)
    )
    return bool(library.mbs_pass(driver, sizes, pointers, through.typical))


def _places(pattern: casadi.Sparsity) -> npt.NDArray[np.intc] | None:
    """Where a matrix has elements, as passage.h takes it; None if it has all of them."""
    if pattern.is_dense():
        return None
    return np.array([*pattern.colind(), *pattern.row()], dtype=np.intc)


def _pointer(array: npt.NDArray[Any]) -> int:
    return array.ctypes.data


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


Prepared = dict[tuple[str, bool], tuple[Equations, ctypes.CDLL | None]]
"""Functions of an integration and their machine code, by method and whether it is compiled."""


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
    stops: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    sizes: npt.ArrayLike | None = None,
    progress: Progress | None = None,
    compiled: bool = True,
    partial: bool = False,
    prepared: Prepared | None = None,
) -> EventMotion:
    """States and modes at given times of a system whose state or equations jump at events.

    An event is where an indicator is not positive any more. It is located to the rounding of time,
    the earliest first; those that fall together are handed to one jump. After a jump the state is
    projected; an indicator that is negative, or falls from zero, asks for another jump at the same
    time, where zero is what is smaller than atol. So it is at the first time too. Indicators and
    their slopes are looked at twice in each step; what falls at one look and rises at the next is
    searched for a dip below zero. What moves faster than the steps needs `approaches` in the
    events, or max_step.

    Source: Cellier and Kofman 2006, chapter 9; Mirtich 1996 for looks by the bound of a rate.

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
        stops: times at which steps end, s, in increasing order, and for each whether functions may
            jump there as functions of time. Up to such a time they are asked before it, then
            behind it, and a step begins anew. None when left out.
        sizes: (2, nx) factors of the absolute and of the relative tolerance of each state; one if
            left out.
        progress: called now and then with the time reached, s.
        compiled: False for the same algorithm in Python.
        partial: True for what was reached, with its `stop`, where the integration cannot go on or
            is interrupted by control-C; nothing is raised for that then.
        prepared: what an earlier call made of the same functions and method, and what this one
            makes is kept in; nothing is kept when left out.

    Returns:
        states, modes and the list of events.

    Raises:
        ModelError: an argument does not fit the functions.
        SolverError: the integration cannot go on: as in `integrate`, or the jumps at one time do
            not come to an end, or events crowd until time stands still.
        Interrupted: control-C was pressed.
        CompilerError: the compiler that CC names does not start.
    """
    key = (method, compiled and compiler_found())
    kept = {} if prepared is None else prepared
    if key not in kept:
        made = equations(rhs, project, method, events, passage)
        kept[key] = made, library_of(made) if key[1] else None
    functions, library = kept[key]
    modes = () if events is None else events.modes
    given = problem(functions, x0, times, p, modes, (rtol, atol), max_step, stops, sizes)
    motion = _run(given, library, progress)
    if motion.stop is not None and not partial:
        raise motion.stop
    return motion


def _run(
    given: IntegrationProblem, library: ctypes.CDLL | None, progress: Progress | None
) -> EventMotion:
    if library is None:
        return run_interpreted(given, progress)
    return run_compiled(library, given, progress)
