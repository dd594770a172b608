"""Integration of CasADi Functions by the run-time library."""

import ctypes
import math
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt

from mbs.core import compiled_evaluation, core_library, interpreted_evaluation
from mbs.errors import Interrupted, SolverError
from mbs.native import cached_library, compiler_found
from mbs.native._compiled import calls_machine_code, exact_source, unwritten
from mbs.native.compiler import flags_for, known_library
from mbs.solvers.control_c import control_c
from mbs.solvers.problem import (
    Equations,
    EventMotion,
    Events,
    IntegrationEvent,
    IntegrationProblem,
    LawFailure,
    Passage,
    equations,
    failed,
    failure_of,
    fired_of,
    interrupted,
    problem,
    stopped_by_law,
)

Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]

_CHUNK = 200  # steps of machine code between two checks for control-C
_FEW = 10  # steps of interpreted functions between two checks whether to compile
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


def _source(equations: Equations) -> str | None:
    """Return the C code of the functions of an integration; None if they must be interpreted.

    They must if they call machine code, or if an operation has no C code.
    """
    if calls_machine_code(equations.all):
        return None
    source = exact_source(equations.all)
    return None if unwritten(source) else source


_WRITING, _COMPILING = (0.01, 2e-5), (0.2, 1e-4)
"""Times of writing and of compiling C code [s]: constant part, and part per instruction. Measured
with gcc 12 for 600 to 40,000 instructions, accurate to a factor of two."""


@dataclass(slots=True, eq=False)
class IntegrationCode:
    """Functions of an integration, compiled as soon as interpretation has cost as much time.

    Interpreted and compiled functions are bit-identical. The total time is therefore at most twice
    that of the faster method. Machine code in the cache is used as soon as interpretation has cost
    as much as writing the C code, which is the key of the cache.

    Attributes:
        equations: functions of the integration.
        may_compile: whether the functions may be compiled.
        library: compiled functions; None while CasADi interprets them.
        spent: time of the interpreted runs so far [s].
        source: C code; None until it is written.
        instructions: number of instructions of all functions.
        passage: sizes, patterns and typical regularity for singular configurations, or None.
        machine_code: one callable per function that returns a new evaluation of its machine code,
            which has scratch memory of its own; None if the function is missing. Empty until the
            functions are compiled.
    """

    equations: Equations
    may_compile: bool
    library: ctypes.CDLL | None = None
    spent: float = 0.0
    source: str | None = None
    instructions: int = field(init=False)
    passage: tuple[Any, ...] | None = field(init=False)
    machine_code: tuple[Callable[[], Any] | None, ...] = ()

    def __post_init__(self) -> None:
        every = (g for f in self.equations.all for g in (f, *f.find_functions()))
        counted = (g for g in every if g.is_a("SXFunction") or g.is_a("MXFunction"))
        self.instructions = sum(g.n_instructions() for g in counted)
        self.passage = _passage_data(self.equations.passage)

    def is_worth(self, further: float, cost: tuple[float, float]) -> bool:
        """Return whether interpreted runs have taken longer than some other work would take.

        Args:
            further: time of the present run [s], in addition to `spent`.
            cost: time of the other work: constant part [s], and part per instruction [s].
        """
        return self.spent + further > cost[0] + cost[1] * self.instructions

    def compile(self, further: float = math.inf) -> bool:
        """Compile the functions if that is worth its time. Return whether they are compiled.

        Args:
            further: time of the present run [s]. By default the functions are compiled at once.

        Raises:
            CompilerError: the compiler rejects the code.
        """
        if self.library is not None or not self.may_compile:
            return self.library is not None
        if self.source is None:
            if not self.is_worth(further, _WRITING):
                return False
            self.source = _source(self.equations)
            self.may_compile = self.source is not None
            if self.source is None:
                return False
            known = known_library(*self._build(self.source))
        else:
            known = None
        if known is None and self.is_worth(further, _COMPILING):
            known = cached_library(*self._build(self.source))
        self.library = None if known is None else ctypes.CDLL(str(known))
        return known is not None

    @staticmethod
    def _build(source: str) -> tuple[dict[str, str], tuple[str, ...]]:
        """Return the files (name to text) and the compiler flags of a C source."""
        return {"system.c": source}, flags_for(source)

    def evaluations(self) -> tuple[Any, ...]:
        """Return the functions in the form that the run-time library calls, None for missing ones.

        They are compiled or interpreted, in the order of `_in_order`.
        """
        library = self.library
        if library is None:
            return tuple(
                None if function is None else interpreted_evaluation(function, _raise_fatal)
                for function in self._in_order()
            )
        if not self.machine_code:
            self.machine_code = tuple(
                None if function is None else compiled_evaluation(function, library)
                for function in self._in_order()
            )
        return tuple(
            None if evaluation is None else evaluation() for evaluation in self.machine_code
        )

    def _in_order(self) -> tuple[casadi.Function | None, ...]:
        """Return the functions in the order of `driver_model` in driver.h, None for missing ones.

        The order is: rhs, project, jacobian, indicators, rates, jump, approaches, and rows, forces
        and regularity of the `Passage`.
        """
        own, through = self.equations, self.equations.passage
        last = (
            (None,) * 3 if through is None else (through.rows, through.forces, through.regularity)
        )
        changes = own.indicators, own.rates, own.jump, own.approaches
        return own.rhs, own.project, own.jacobian, *changes, *last


# Evaluations for the run-time library, and the integration.


def _raise_fatal(error: BaseException) -> None:
    """Raise the error of an evaluation if it must stop the integration; else return.

    A RuntimeError only means that the evaluation has no value there.
    """
    if not isinstance(error, RuntimeError):
        raise error
    failure_of(error, "rhs")


def _passage_data(through: Passage | None) -> tuple[Any, ...] | None:
    """Return the data of a `Passage` that the run-time library needs; None without a passage.

    They are its sizes, the sparsity patterns of its matrices, and its typical regularity.
    """
    if through is None:
        return None
    matrices = [(through.rows, number) for number in (1, 2, 5)] + [(through.forces, 0)]
    patterns = tuple(
        _sparsity_arrays(function.sparsity_out(number)) for function, number in matrices
    )
    return (tuple(through.size), patterns, through.typical)


def _sparsity_arrays(pattern: casadi.Sparsity) -> npt.NDArray[np.intc] | None:
    """Return column offsets and row indices of a sparse matrix (`passage_patterns`).

    None if dense.
    """
    if pattern.is_dense():
        return None
    return np.array([*pattern.colind(), *pattern.row()], dtype=np.intc)


def _integration(given: IntegrationProblem, code: IntegrationCode) -> Any:
    """Return an integration object of the run-time library, at the first time of the problem.

    Args:
        given: integration problem.
        code: functions of the problem.
    """
    own, indicators = given.equations, given.equations.indicators
    sizes = len(given.x0), len(given.p), given.modes
    ends, jumps = given.stops[0], given.stops[1].astype(float)
    try:
        return core_library().integration(
            code.evaluations(),
            (*sizes, 0 if indicators is None else indicators.numel_out(0)),
            code.passage,
            given.p,
            (given.rtol, given.atol, given.max_step, own.first_step),
            None if given.sizes is None else np.ascontiguousarray(given.sizes),
            (ends, jumps) if len(ends) else (None, None),
            float(given.times[0]),
        )
    except MemoryError:
        message = f"no memory is left to integrate {sizes[0]} states; close other programs"
        raise SolverError(message) from None


def run_problem(
    given: IntegrationProblem, code: IntegrationCode, progress: Progress | None
) -> EventMotion:
    """Integrate a problem up to its last time, or until an error or control-C stops it.

    Args:
        given: integration problem.
        code: functions of the problem.
        progress: callable that is called repeatedly with the present time [s].

    Returns:
        the motion up to the last time that is reached. Its `stop` is the error, or None.

    Raises:
        SolverError: no memory is left.
        CompilerError: the compiler rejects the code.
    """
    x, times = given.x0.copy(), given.times
    table = np.empty((len(times), len(x)))
    log: list[IntegrationEvent] = []
    stop: SolverError | Interrupted | None = None
    first: Array | None = None
    run, begin = _integration(given, code), time.perf_counter()
    interpreted = code.library is None
    # machine code runs no Python: the default handler of control-C raises between calls of `fill`
    guard = control_c() if interpreted else nullcontext(_no_check)
    try:
        with guard as check:
            status = run.begin(x)
            if status <= _MORE and given.equations.passage is not None:
                slope = np.empty(len(x))
                first = slope if run.leaves(x, slope) else None
            while status <= _MORE and run.done < len(times):
                status = run.fill(x, times, table, _FEW if interpreted else _CHUNK)
                if status == _FIRED:
                    log.append(_event(run, given))
                if interpreted and code.compile(time.perf_counter() - begin):
                    run.replace(core_library(), code.evaluations())
                    code.spent += time.perf_counter() - begin
                    interpreted = False
                if progress is not None:
                    progress(run.time)
                check()
        if status > _MORE:
            blamed = _event(run, given).fired if status in _CROWDED else ()
            stop = failed(run.time, run.step, _REASONS[status], blamed, x.tolist())
    except LawFailure as failure:
        stop = stopped_by_law(run.time, failure, x.tolist())
    except KeyboardInterrupt:
        stop = interrupted(run.time)
    if interpreted:
        code.spent += time.perf_counter() - begin
    return given.motion(table[: run.done], log, stop, first)


def _no_check() -> None:
    """Do nothing: the check for control-C if Python itself raises KeyboardInterrupt."""


def _event(run: Any, given: IntegrationProblem) -> IntegrationEvent:
    """Return the last event of an integration object `run` of the run-time library."""
    assert given.equations.indicators is not None
    fired, modes = np.empty(given.equations.indicators.numel_out(0)), np.empty(given.modes)
    run.event(fired, modes)
    return IntegrationEvent(run.time, fired_of(fired), modes)


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
    """Integrate x' = rhs(t, x, p) and return the states at given times.

    One-step methods of order 5(4) with dense output. Source: Hairer, Norsett and Wanner 1993, II.4
    to II.6; projection after each accepted step as in Hairer, Lubich and Wanner 2006, IV.4.

    Args:
        rhs: `rhs(t, x, p) -> xdot`.
        x0: (nx,) state at the first time; it is projected too.
        times: (m,) increasing times [s]; the first is the initial time.
        p: (np,) parameters; none by default.
        project: `project(t, x, p) -> (x, residual)`, a Newton step onto the constraints with the
            largest residual. It is repeated after each step until the residual is below 1e-12.
        passage: functions for steps through singular configurations, where the constraints become
            dependent. Without them the integration stops there.
        method: "dopri5", the explicit method of Dormand and Prince; or "rodas", the linearly
            implicit RODAS5P for stiff equations, which uses the exact Jacobian of rhs.
        rtol: relative tolerance of the error of a step.
        atol: absolute tolerance of the error of a step, in the units of the states.
        max_step: maximum step [s]. Only the error limits steps by default.
        progress: callable that is called repeatedly with the present time [s].
        compiled: whether functions may be compiled. With a C compiler they are compiled as soon as
            interpretation has cost as much time as compilation. Interpretation takes three to six
            times as long. The results are the same.

    Returns:
        (m, nx) states, a row for each time.

    Raises:
        ModelError: an argument does not fit the functions.
        SolverError: the integration cannot continue; the message gives time and reason.
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


Prepared = dict[tuple[str, bool], IntegrationCode]
"""Functions of an integration, by method and by whether they may be compiled."""


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
    """Integrate a system with events, and return its states and modes at given times.

    An event is a time at which an indicator reaches zero from above. Its time is accurate to the
    rounding of floating-point numbers. Events at the same time cause one call of `jump`, and the
    state is projected afterwards. An indicator that is then below -atol, or decreases from zero,
    causes another call at the same time. The same rules apply at the first time. The integrator
    evaluates indicators and their rates twice in each step. If a rate changes from negative to
    positive between two evaluations, it searches for a zero between them. Indicators that change
    faster than the steps need `approaches` in the events, or max_step.

    Source: Cellier and Kofman 2006, chapter 9; Mirtich 1996 for steps limited by rates.

    Args:
        rhs: `rhs(t, x, p) -> xdot`. The input p of all functions ends with the modes.
        x0: (nx,) state at the first time.
        times: (m,) increasing times [s]. A row at the time of an event has the state after it.
        events: indicators, jump and the first modes; None for a system without events.
        p: (np,) parameters, without the modes.
        project: one Newton step onto the constraints, see `integrate`.
        passage: functions for steps through singular configurations, see `integrate`.
        method: "dopri5" or "rodas".
        rtol: relative tolerance of the error of a step.
        atol: absolute tolerance of the error of a step, in the units of the states.
        max_step: maximum step [s]. Only the error limits steps by default.
        stops: increasing times [s] at which steps end, and for each time whether functions of time
            may be discontinuous there. If so, the previous step uses limits from the left, the next
            step limits from the right, and its size is estimated again. None without such times.
        sizes: (2, nx) factors of the absolute and of the relative tolerance of each state; one by
            default.
        progress: callable that is called repeatedly with the present time [s].
        compiled: whether functions may be compiled, see `integrate`.
        partial: whether the motion up to an error or control-C is returned, with the error in
            `EventMotion.stop`. Otherwise the error is raised.
        prepared: store of functions of earlier calls with the same functions. Functions of this
            call are added.

    Returns:
        states, modes and the list of events.

    Raises:
        ModelError: an argument does not fit the functions.
        SolverError: the integration cannot continue, see `integrate`; or the jumps at one time do
            not end; or the times of events accumulate.
        Interrupted: control-C was pressed.
        CompilerError: the compiler that CC names does not start.
    """
    kept = {} if prepared is None else prepared
    code = kept.get((method, True)) if compiled else None
    if code is None or code.library is None:  # compiled functions need no compiler
        key = (method, compiled and compiler_found())
        if key not in kept:
            made = equations(rhs, project, method, events, passage)
            kept[key] = IntegrationCode(made, may_compile=key[1])
        code = kept[key]
    modes = () if events is None else events.modes
    given = problem(code.equations, x0, times, p, modes, (rtol, atol), max_step, stops, sizes)
    motion = run_problem(given, code, progress)
    if motion.stop is not None and not partial:
        raise motion.stop
    return motion
