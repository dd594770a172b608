"""Variables of an FMU by name: their values, their start values, and inputs over time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbs.errors import ModelError
from mbs.result import Result, State
from mbs.text import did_you_mean, error_text, quoted

CONTINUOUS = frozenset(("Real", "Float64", "Float32"))
NUMBERS = CONTINUOUS | {
    *("Integer", "Boolean", "Enumeration"),
    *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)),
}
NOTHING: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Element:
    """Scalar variable, or element of an array variable, with the attributes of the FMPy variable.

    Attributes:
        variable: FMPy variable.
        place: index in the array in row-major order, from 0.
        name: name with indices from 1, such as `q[2]` or `R[1,3]`.
    """

    variable: Any
    place: int
    name: str

    def __getattr__(self, name: str) -> Any:
        return getattr(self.variable, name)

    @property
    def start(self) -> float:
        """Start value in the model description; 0 if there is none."""
        values = str(self.variable.start or "0").split()
        text = values[self.place if len(values) > 1 else 0]
        return float(text == "true") if text in ("true", "false") else float(text)


def elements_of(variable: Any) -> list[Element]:
    """Return the elements of an array variable, or the variable itself as the only element."""
    return [Element(variable, k, name) for k, name in enumerate(columns_of([variable]))]


def numbers_of(description: Any) -> dict[str, Element]:
    """Return all numeric scalar variables and elements of numeric arrays, by name."""
    numeric = (v for v in description.modelVariables if v.type in NUMBERS)
    return {element.name: element for variable in numeric for element in elements_of(variable)}


def recordable(description: Any) -> dict[str, Any]:
    """Return the numeric variables that a Recorder of FMPy reads, by name."""
    return {
        v.name: v
        for v in description.modelVariables
        if v.type in NUMBERS and v.causality != "independent" and v.name != "time"
    }


def columns_of(variables: Iterable[Any]) -> dict[str, str]:
    """Return units of scalars and array elements by name; elements are named `name[1,2]`."""
    columns: dict[str, str] = {}
    for variable in variables:
        declared = variable.declaredType
        unit = variable.unit or (declared.unit if declared is not None else None) or "1"
        places = itertools.product(*(range(1, n + 1) for n in variable.shape or ()))
        for place in places:
            index = f"[{','.join(map(str, place))}]" if place else ""
            columns[variable.name + index] = unit
    return columns


def reader(instance: Any, description: Any, variables: Iterable[Any]) -> Callable[[], list[float]]:
    """Return a function that reads the values of variables, in their order.

    Args:
        instance: FMPy object of an FMU.
        description: model description of the FMU.
        variables: recordable variables of the model description.
    """
    from fmpy.simulation import Recorder

    names = [v.name for v in variables]
    recorder = Recorder(instance, description, names)
    order = {column[0]: k for k, column in enumerate(recorder.cols)}  # grouped by type

    def read() -> list[float]:
        recorder.sample(0.0)
        row = recorder.rows.pop()
        values = (row[order[name]] for name in names)
        return [float(x) for v in values for x in (v.flat if isinstance(v, np.ndarray) else (v,))]

    return read


def writer(
    instance: Any, elements: Sequence[Element], starts: Mapping[str, float] = NOTHING
) -> Callable[[Sequence[float]], None]:
    """Return a function that sets scalar variables and elements of arrays, in their order.

    An array is set as a whole. Its elements that are not in `elements` get their start value.

    Args:
        instance: FMPy object of an FMU.
        elements: variables to set.
        starts: start values by name that replace values of the model description.
    """
    # by type: setter, dict from value reference to the place of its first value, and values
    groups: dict[str, tuple[Callable[..., None], dict[int, int], list[float]]] = {}
    places: list[tuple[list[float], int, Callable[[float], float]]] = []
    for element in elements:
        kind = element.type
        if kind == "Enumeration":
            kind = "Int64" if hasattr(instance, "getFloat64") else "Integer"
        cast = bool if kind == "Boolean" else float if kind in CONTINUOUS else round
        _, first, values = groups.setdefault(kind, (getattr(instance, f"set{kind}"), {}, []))
        if element.valueReference not in first:
            first[element.valueReference] = len(values)
            values += [cast(starts.get(e.name, e.start)) for e in elements_of(element.variable)]
        places.append((values, first[element.valueReference] + element.place, cast))

    def write(given: Sequence[float]) -> None:
        for (values, place, cast), value in zip(places, given, strict=True):
            values[place] = cast(value)
        for put, first, values in groups.values():
            put(list(first), values)

    return write


# Start values, and names that the user gives.


def start_values(
    description: Any, parameters: Mapping[str, float], start: Mapping[str, float] | State
) -> dict[str, float]:
    """Return the checked initial values of parameters, states and inputs, by name."""
    from fmpy.simulation import settable_in_instantiated

    known = numbers_of(description)
    settable = {n for n, v in known.items() if settable_in_instantiated(v)}
    if isinstance(start, State):
        start = _starts_of(start, settable)
    every = (*known, *(v.name for v in description.modelVariables))
    fixed = {n for n, v in known.items() if v.causality == "parameter"}
    check_names("parameters", parameters, fixed, every)
    allowed = settable - fixed
    start = _full_names(start, allowed, every)
    check_names("start", start, allowed, every)
    return {name: finite_number(name, value) for name, value in {**start, **parameters}.items()}


def _full_names(
    start: Mapping[str, float], allowed: set[str], every: Iterable[str]
) -> dict[str, float]:
    """Replace coordinate names of `run`, such as "j1", by variable names, such as "j1.q".

    Raises:
        ModelError: a coordinate is given by both names.
    """
    found, others = dict[str, float](), set(every)
    for name, value in start.items():
        full = name
        if name not in others and {f"{name}.q", f"{name}.solved"} & allowed:
            full = f"{name}.q"
        if full in start and full != name:
            raise ModelError(f"start: {name} and {full} are the same variable; give it once")
        found[full] = value
    return found


def _starts_of(state: State, settable: set[str]) -> dict[str, float]:
    """Return the start values of an exported mechanism for a state.

    They are positions and velocities of independent joints and states of components. Positions of
    dependent joints select the branch of the loops.

    Raises:
        ModelError: the FMU has no variable of the state.
    """
    positions = {f"{name}.{end}": x for name, x in state.q.items() for end in ("q", "solved")}
    velocities = {f"{name}.v": x for name, x in state.v.items()}
    found = {n: x for n, x in {**positions, **velocities, **state.z}.items() if n in settable}
    if not found:
        raise ModelError(
            f"start: the FMU has none of the states of {state.name or 'the mechanism'}; give"
            " values by the names of its variables"
        )
    return found


def check_names(what: str, given: Iterable[str], allowed: set[str], known: Iterable[str]) -> None:
    """Raise if a name is unknown or its variable cannot be set.

    Args:
        what: name of the checked argument, for the error message.
        given: names to check.
        allowed: names that are valid here.
        known: names of all variables.

    Raises:
        ModelError: a name is not allowed. The message contains the nearest allowed name.
    """
    everything = set(known)
    for name in given:
        if name not in allowed:
            why = "cannot be set" if name in everything else "does not exist"
            solved = f"{name.removesuffix('.q')}.solved"
            if name.endswith(".q") and solved in allowed:
                independent = ", ".join(sorted(n for n in allowed if n.endswith(".q")))
                raise ModelError(
                    f"{what}: {name} follows from the loops; give {independent}, and {solved} as a"
                    " guess that chooses the branch; or give the state of a result, such as"
                    " run(system, 1e-3, q0=...).state(0)"
                )
            hint = did_you_mean(name, sorted(allowed))
            raise ModelError(f"{what}: variable {name!r} {why} here; {hint}")


def finite_number(name: str, value: Any) -> float:
    """Return a value as a finite float.

    Raises:
        ModelError: the value is not a finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not np.isfinite(number):
        raise ModelError(f"{name} = {quoted(value)}: use a finite number")
    return number


# Inputs of an FMU over time, with jumps and kinks.


Signal = float | Callable[[float], float] | tuple[ArrayLike, ArrayLike]
Inputs = Mapping[str, Signal] | Result

_FORMS = "a number, a function of time, or (times, values)"


@dataclass(frozen=True, slots=True)
class Track:
    """Input over time.

    Attributes:
        value: callable (time, after) that returns the value. `after` is True for the value right
            after a jump, False for the value right before it.
        corners: times of kinks and jumps [s].
        jumps: times of jumps [s].
    """

    value: Callable[[float, bool], float]
    corners: tuple[float, ...] = ()
    jumps: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Tracks:
    """Inputs of an FMU over time.

    Attributes:
        variables: input variables of the model description.
        tracks: Track of each variable.
        starts: start values by name, used for array elements without track.
    """

    variables: tuple[Element, ...]
    tracks: tuple[Track, ...]
    starts: Mapping[str, float] = field(default_factory=dict)

    @property
    def corners(self) -> list[float]:
        """Sorted times at which an input has a kink or a jump [s]."""
        return sorted({t for track in self.tracks for t in track.corners})

    @property
    def jumps(self) -> frozenset[float]:
        """Times at which an input jumps [s]."""
        return frozenset(t for track in self.tracks for t in track.jumps)

    def continuous(self) -> Tracks:
        """Return the inputs whose variables are continuous in time."""
        chosen = [k for k, variable in enumerate(self.variables) if _continuous(variable)]
        variables = tuple(self.variables[k] for k in chosen)
        return Tracks(variables, tuple(self.tracks[k] for k in chosen), self.starts)

    def at(self, time: float, after: bool) -> list[float]:
        """Return the value of each input at a time, right after or right before a jump."""
        return [track.value(time, after) for track in self.tracks]

    def setter(self, instance: Any) -> Callable[[float, bool], None]:
        """Return a function (time, after) that sets the inputs of an instance."""
        write = writer(instance, self.variables, self.starts)

        def apply(time: float, after: bool) -> None:
            if self.variables:
                write(self.at(time, after))

        return apply

    def slopes(self, begin: float, end: float) -> tuple[list[int], list[float]]:
        """Return value references of continuous inputs, and their mean rates over a step [1/s]."""
        smooth = self.continuous()
        rises = [t.value(end, False) - t.value(begin, True) for t in smooth.tracks]
        references = [v.valueReference for v in smooth.variables]
        return references, [rise / (end - begin) for rise in rises]


def tracks_of(description: Any, inputs: Inputs, starts: Mapping[str, float] = NOTHING) -> Tracks:
    """Return the inputs as functions of time.

    Args:
        description: model description of the FMU.
        inputs: dict from input to a number, a function of time or (times, values); or a Result,
            whose columns are the inputs of the same name. Array elements are named `tau[2]`.
        starts: start values by name.

    Raises:
        ModelError: a name is unknown or not an input, or a value is invalid.
    """
    numbers = numbers_of(description)
    known = {name: v for name, v in numbers.items() if v.causality == "input"}
    if isinstance(inputs, Result):
        inputs = _from_result(inputs, known)
    every = (*numbers, *(v.name for v in description.modelVariables))
    check_names("inputs", inputs, set(known), every)
    tracks = tuple(_track(known[name], signal) for name, signal in inputs.items())
    return Tracks(tuple(known[name] for name in inputs), tracks, starts)


def _continuous(variable: Any) -> bool:
    return variable.type in CONTINUOUS and variable.variability != "discrete"


def _from_result(result: Result, known: Mapping[str, Element]) -> dict[str, Signal]:
    found: dict[str, Signal] = {n: (result.time, result[n]) for n in known if n in result}
    if not found:
        raise ModelError(
            f"inputs: result {result.name!r} has no column of an input; the FMU has"
            f" {did_you_mean('', known)}"
        )
    return found


def _track(variable: Any, signal: Signal) -> Track:
    name = str(variable.name)
    if callable(signal):
        return _of_function(name, signal)
    if isinstance(signal, tuple):
        return _of_table(name, signal, straight=_continuous(variable))
    number = finite_number(f"input {name}", signal)
    return Track(lambda time, after: number)


def _of_function(name: str, function: Callable[[float], float]) -> Track:
    def value(time: float, after: bool) -> float:
        try:
            found = float(function(time))
        except Exception as error:
            raise ModelError(
                f"input {name}: no number at time {time:g} s ({error_text(error)}); give a"
                " function of time that returns one"
            ) from error
        if not np.isfinite(found):
            raise ModelError(
                f"input {name} has a value that is not finite at time {time:g} s; use numbers"
            )
        return found

    return Track(value)


def _of_table(name: str, signal: tuple[Any, ...], *, straight: bool) -> Track:
    try:
        times, values = (np.asarray(part, dtype=float) for part in signal)
    except (TypeError, ValueError):
        raise ModelError(f"input {name} is {quoted(signal)}; give {_FORMS}") from None
    if times.ndim != 1 or times.shape != values.shape or not len(times):
        raise ModelError(f"input {name}: give as many values as increasing times")
    if np.any(np.diff(times) < 0):
        raise ModelError(
            f"input {name}: the times decrease; give as many values as increasing times"
        )
    if not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise ModelError(f"input {name} has a value that is not finite; use numbers")
    last = len(times) - 1

    def value(time: float, after: bool) -> float:
        k = int(np.searchsorted(times, time, side="right" if after else "left"))
        if k == 0 or k > last or not straight:
            return float(values[min(max(k - 1, 0), last)])
        share = (time - times[k - 1]) / (times[k] - times[k - 1])
        return float(values[k - 1] + share * (values[k] - values[k - 1]))

    repeated = times[:-1][np.diff(times) == 0]
    jumps = repeated if straight else times[1:][np.diff(values) != 0]
    return Track(value, tuple(map(float, times)), tuple(map(float, jumps)))
