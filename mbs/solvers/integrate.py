"""Motions of a generated system, advanced in time by compiled code and kept on its constraints."""

import ctypes
import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError, SolverError
from mbs.messages import quoted
from mbs.native import cached_library, compiler_found
from mbs.native.compiled import generated, unwritten
from mbs.native.compiler import flags_for
from mbs.solvers.dopri5 import Dopri5, Failure, failed

Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]

TOLERANCE = 1e-12
ITERATIONS = 10
_CHUNK = 200  # steps between two looks at the keyboard
_CHUNK_PYTHON = 50
_REASONS = {2: "steps", 3: "small", 4: "rhs", 5: "projection", 6: "finite"}
_RUNTIME = ("dopri5.h", "dopri5.c", "driver.c")


def integrate(
    rhs: casadi.Function,
    x0: npt.ArrayLike,
    times: npt.ArrayLike,
    *,
    p: npt.ArrayLike | None = None,
    project: casadi.Function | None = None,
    rtol: float = 1e-8,
    atol: float = 1e-8,
    progress: Progress | None = None,
    compiled: bool = True,
) -> Array:
    """States at given times, by Dormand and Prince's pair of order 5(4) with dense output.

    Source: Hairer, Norsett and Wanner 1993, II.4 to II.6; projection after each accepted step as
    in Hairer, Lubich and Wanner 2006, IV.4.

    Args:
        rhs: `rhs(t, x, p) -> xdot`.
        x0: (nx,) state at the first time; it is projected too.
        times: (m,) s, increasing; the first one is the initial time.
        p: (np,) parameters; none by default.
        project: `project(x, p) -> (x, residual)`, one Newton step onto the constraints with the
            largest residual; it is repeated after each step until the residual is below 1e-12.
        rtol: relative tolerance of the error of one step.
        atol: absolute tolerance of the error of one step, in the units of the states.
        progress: called now and then with the time reached, s.
        compiled: False for the same algorithm in Python, about a hundred times slower; it is
            what runs when there is no C compiler.

    Returns:
        (m, nx), a row for each time.

    Raises:
        ModelError: an argument does not fit the functions.
        SolverError: the integration cannot go on; the message says when and why.
        CompilerError: the compiler that CC names does not start.
    """
    f, g = _dense(rhs, project)
    x, t, parameters = _checked(f, x0, times, p, rtol, atol)
    problem = Problem(f, g, x, t, parameters, rtol, atol)
    library = _library(f, g) if compiled and compiler_found() else None
    if library is None:
        return _run_python(problem, progress)
    return _run_compiled(library, problem, progress)


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """An integration, its arguments checked.

    Attributes:
        rhs: `mbs_rhs(t, x, p) -> xdot`, dense.
        project: `mbs_project(x, p) -> (x, residual)`, dense; None without constraints.
        x0: (nx,) state at the first time.
        times: (m,) s, increasing.
        p: (np,) parameters.
        rtol: relative tolerance of the error of one step.
        atol: absolute tolerance of the error of one step.
    """

    rhs: casadi.Function
    project: casadi.Function | None
    x0: Array
    times: Array
    p: Array
    rtol: float
    atol: float


def _dense(
    rhs: casadi.Function, project: casadi.Function | None
) -> tuple[casadi.Function, casadi.Function | None]:
    """The functions under the names that the driver calls, every input and output dense."""
    if rhs.n_in() not in (2, 3) or rhs.numel_in(0) != 1:
        raise ModelError(f"{rhs}: the right-hand side of an integration is rhs(t, x, p) -> xdot")
    n, n_p = rhs.numel_in(1), rhs.numel_in(2) if rhs.n_in() == 3 else 0
    if rhs.numel_out(0) != n:
        raise ModelError(
            f"{rhs.name()}: it gives {rhs.numel_out(0)} slopes for {n} states; give one for each"
        )
    t, x, p = casadi.MX.sym("t"), casadi.MX.sym("x", n), casadi.MX.sym("p", n_p)
    slope = casadi.vec(rhs(*[t, x, p][: rhs.n_in()]) if rhs.n_out() == 1 else rhs(t, x, p)[0])
    f = casadi.Function("mbs_rhs", [t, x, p], [casadi.densify(slope)])
    if project is None:
        return f, None
    if project.n_out() != 2 or project.numel_in(0) != n or project.numel_out(0) != n:
        raise ModelError(f"{project}: a projection is project(x, p) -> (x, residual), x ({n},)")
    outputs = project(*[x, p][: project.n_in()])
    dense = [casadi.densify(casadi.vec(value)) for value in outputs]
    return f, casadi.Function("mbs_project", [x, p], dense)


def _checked(
    f: casadi.Function,
    x0: npt.ArrayLike,
    times: npt.ArrayLike,
    p: npt.ArrayLike | None,
    rtol: float,
    atol: float,
) -> tuple[Array, Array, Array]:
    n, n_p = f.numel_in(1), f.numel_in(2)
    x, t, parameters = _numbers(x0), _numbers(times), _numbers([] if p is None else p)
    if len(x) != n or len(parameters) != n_p:
        raise ModelError(
            f"integrate: {len(x)} initial states and {len(parameters)} parameters were given; "
            f"the right-hand side has {n} states and {n_p} parameters"
        )
    if not all(np.isfinite(values).all() for values in (x, t, parameters)):
        raise ModelError("integrate: a state, a time or a parameter is not finite; give numbers")
    if len(t) == 0 or np.any(np.diff(t) < 0):
        raise ModelError("integrate: times must be one or more, in increasing order")
    if not all(isinstance(value, (int, float)) and 0 < value < np.inf for value in [rtol, atol]):
        raise ModelError(f"integrate: tolerances {rtol!r} and {atol!r} must be positive numbers")
    return x, t, parameters


def _numbers(values: npt.ArrayLike) -> Array:
    try:
        return np.array(values, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        raise ModelError(f"integrate: {quoted(values)} are not numbers; give real ones") from None


def _run_compiled(library: ctypes.CDLL, problem: Problem, progress: Progress | None) -> Array:
    x, times = problem.x0.copy(), problem.times
    table = np.empty((len(times), len(x)))
    done = ctypes.c_longlong(0)
    with _opened(library, problem) as driver:
        status = library.mbs_begin(driver, _pointer(x))
        while status <= 1 and done.value < len(times):
            status = library.mbs_table(
                driver,
                _pointer(x),
                _pointer(times),
                len(times),
                _pointer(table),
                ctypes.byref(done),
                _CHUNK,
            )
            if progress is not None:
                progress(library.mbs_time(driver))
        if status > 1:
            raise failed(library.mbs_time(driver), library.mbs_step(driver), _REASONS[status])
    return table


def _run_python(problem: Problem, progress: Progress | None) -> Array:
    p, times = problem.p, problem.times

    def slope(t: float, state: Array) -> Array:
        return np.asarray(problem.rhs(t, state, p).full()[:, 0])

    project = None if problem.project is None else functools.partial(_onto, problem.project, p)
    start = float(times[0])
    try:
        state = problem.x0 if project is None else project(start, problem.x0)
    except Failure as failure:
        raise failed(start, 0.0, str(failure)) from failure
    solver = Dopri5(slope, project, start, state, problem.rtol, problem.atol)
    table = np.empty((len(times), len(state)))
    row = 0
    while row < len(times):
        row = solver.table(times, row, table, _CHUNK_PYTHON)
        if progress is not None:
            progress(solver.t)
    return table


def _onto(project: casadi.Function, p: Array, _t: float, x: Array) -> Array:
    """Newton steps until the constraints hold to rounding."""
    for _ in range(ITERATIONS):
        try:
            moved, residual = project(x, p)
        except RuntimeError as error:
            raise Failure("projection") from error
        x = np.asarray(moved.full()[:, 0])
        if not (np.isfinite(x).all() and np.isfinite(float(residual))):
            break
        if float(residual) < TOLERANCE * max(1.0, float(np.max(np.abs(x), initial=0.0))):
            return x
    raise Failure("projection")


def _library(f: casadi.Function, g: casadi.Function | None) -> ctypes.CDLL | None:
    """The compiled driver of these functions; None when CasADi can only interpret them."""
    source = generated([f] if g is None else [f, g])
    if unwritten(source):
        return None
    flags = (*flags_for(source), *(() if g is None else ("-DMBS_PROJECT",)))
    return _load(cached_library({"system.c": source, **_runtime()}, flags))


@functools.cache
def _runtime() -> dict[str, str]:
    folder = resources.files("mbs.native") / "runtime"
    return {name: (folder / name).read_text(encoding="utf-8") for name in _RUNTIME}


def _load(path: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(path))
    handle, real, pointer = ctypes.c_void_p, ctypes.c_double, ctypes.POINTER(ctypes.c_double)
    integer = ctypes.c_longlong
    types: dict[str, tuple[Any, list[Any]]] = {
        "mbs_open": (handle, [ctypes.c_int, ctypes.c_int, pointer, real, real, real]),
        "mbs_close": (None, [handle]),
        "mbs_begin": (ctypes.c_int, [handle, pointer]),
        "mbs_table": (
            ctypes.c_int,
            [handle, pointer, pointer, integer, pointer, ctypes.POINTER(integer), integer],
        ),
        "mbs_time": (real, [handle]),
        "mbs_step": (real, [handle]),
    }
    for name, (result, arguments) in types.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


@contextmanager
def _opened(library: ctypes.CDLL, problem: Problem) -> Iterator[ctypes.c_void_p]:
    n, p, start = len(problem.x0), problem.p, float(problem.times[0])
    driver = library.mbs_open(n, len(p), _pointer(p), problem.rtol, problem.atol, start)
    if not driver:
        raise SolverError(f"no memory is left to integrate {n} states; close other programs")
    try:
        yield driver
    finally:
        library.mbs_close(driver)


def _pointer(array: Array) -> Any:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
