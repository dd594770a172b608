"""The one description of an FMU, from which both its XML file and its C tables are written."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Literal, get_args

import casadi

from mbs.arguments import elements_of
from mbs.assembly import System
from mbs.errors import ExportError, ModelError
from mbs.models.state.tree import TreeState
from mbs.native.scalar_source import Target
from mbs.text import quoted
from mbs.units import UNITS
from mbs.view.drawing import Drawing

# What is refused in the description of an FMU, before anything is written.


TIME = "time"
"""What the independent variable is called, in FMI 3.0 and in results."""

SOLVERS = ("dopri5", "rodas", "rk4")


def check(model: FmuModel) -> None:
    """Refuse a description that is no FMU.

    Raises:
        ExportError: a name, a number or the size of a function is wrong.
    """
    _check_names(model)
    _check_texts(model)
    _check_numbers(model)
    _check_functions(model)
    _check_target(model)


def _check_names(model: FmuModel) -> None:
    if not model.name:
        raise ExportError("FMU: the model has no name; give it one")
    seen: set[str] = set()
    names = [entry.variable.name for entry in model.entries]
    for name in (*names, *(array.name for array in model.arrays)):
        if not name or not name.isprintable():
            raise ExportError(f"FMU {model.name}: {name!r} is no name; use printable characters")
        if name == TIME:
            raise ExportError(f"FMU {model.name}: {name!r} is the name of time itself; use another")
        if name in seen:
            raise ExportError(f"FMU {model.name}: two variables are called {name!r}; rename one")
        seen.add(name)


def _check_texts(model: FmuModel) -> None:
    """What people read in the description, where other characters are lost or invalid."""
    for what, text in {"description": model.description, **asdict(model.origin)}.items():
        if not isinstance(text, str) or not text.isprintable():
            raise ExportError(
                f"FMU {model.name}: {what} is {quoted(text)}; give a line of printable characters"
            )


def _check_numbers(model: FmuModel) -> None:
    if model.solver not in SOLVERS:
        raise ExportError(
            f"FMU {model.name}: solver is {model.solver!r}; use {' or '.join(SOLVERS)}"
        )
    for entry in model.entries:
        v = entry.variable
        place = f"FMU {model.name}: {v.name}"
        if v.unit not in UNITS:
            raise ExportError(f"{place} has unit {v.unit!r}; use one of {', '.join(UNITS)}")
        if not math.isfinite(v.start):
            raise ExportError(f"{place} starts at {v.start}; use a finite number")
        if not (v.nominal > 0 and math.isfinite(v.nominal)):
            raise ExportError(f"{place} has nominal {v.nominal}; use a positive number")
        low = -math.inf if v.min is None else v.min
        high = math.inf if v.max is None else v.max
        if not low <= v.start <= high and entry.kind == "parameter":
            raise ExportError(f"{place} starts at {v.start}, outside {low} to {high}; move one")
    for what, value in (
        ("stop time", model.stop_time),
        ("tolerance", model.tolerance),
        ("step size", model.step_size),
        ("internal step", model.internal_step),
        ("longest step", 1.0 if model.max_step is None else model.max_step),
    ):
        known = isinstance(value, (int, float)) and math.isfinite(value)
        if not (known and value > 0):
            raise ExportError(f"FMU {model.name}: {what} {quoted(value)} must be positive")


def _check_functions(model: FmuModel) -> None:
    nx, nz, nu = len(model.states), len(model.dependents), len(model.inputs)
    ny, n_p, n_m = len(model.outputs), len(model.parameters), len(model.modes)
    _check_shape(model, "rhs", model.rhs, (1, nx, nz, nu, n_p + n_m), (nx, ny))
    if (model.closure is None) != (nz == 0):
        raise ExportError(
            f"FMU {model.name}: {nz} dependent coordinates need "
            f"{'a closure' if nz else 'no closure'}; give both or neither"
        )
    if model.closure is not None:
        _check_shape(model, "closure", model.closure, (nx, nz, n_p), (nz, 1))
    if model.jumps is not None:
        point, k = (1, nx, nz, nu, n_p + n_m), len(model.jumps.names)
        _check_shape(model, "first", model.jumps.first, point, (n_m, k))
        _check_shape(model, "indicators", model.jumps.indicators, point, (k,))
        _check_shape(model, "jump", model.jumps.jump, (*point, k), (nx, n_m))
        if model.jumps.approaches is not None:
            _check_shape(model, "approaches", model.jumps.approaches, point, (3 * k,))


def _check_target(model: FmuModel) -> None:
    """What bare C has: steps of a fixed length, of equations without events."""
    if model.target not in get_args(Target):
        raise ExportError(
            f"FMU {model.name}: target is {quoted(model.target)}; use 'hosted' or 'bare'"
        )
    if model.target == "hosted":
        return
    if model.solver != "rk4":
        raise ExportError(
            f"FMU {model.name}: solver is {model.solver!r}, and target='bare' takes steps of a"
            " fixed length alone; use solver='rk4'"
        )
    if model.jumps is not None:
        raise ExportError(
            f"FMU {model.name}: rigid stops, Coulomb friction and components have events, which"
            " target='bare' does not handle; take elastic stops, viscous friction and components"
            " without events, or target='hosted'"
        )
    if model.sources:
        raise ExportError(
            f"FMU {model.name}: {model.sources[0][0]} is C of its own, which target='bare' cannot"
            " vouch for; give the controller as scalar operations, or use target='hosted'"
        )


def _check_shape(
    model: FmuModel,
    what: str,
    function: casadi.Function,
    inputs: tuple[int, ...],
    outputs: tuple[int, ...],
) -> None:
    found_in = tuple(function.numel_in(k) for k in range(function.n_in()))
    found_out = tuple(function.numel_out(k) for k in range(function.n_out()))
    if found_in != inputs or found_out != outputs:
        raise ExportError(
            f"FMU {model.name}: {what} has inputs of sizes {found_in} and outputs of sizes "
            f"{found_out}; the variables ask for {inputs} and {outputs}"
        )


# What people read and see of an FMU beside its variables.


@dataclass(frozen=True, slots=True)
class PageTable:
    """A table of the documentation.

    Attributes:
        title: what it shows.
        columns: heads of the columns.
        rows: a text for each column.
        note: a sentence below the title.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True, slots=True)
class About:
    """What the documentation shows beside text and variables.

    Attributes:
        tables: in the order of the page.
        drawing: of it at the start configuration, or None; the icon is made of it too.
    """

    tables: tuple[PageTable, ...] = ()
    drawing: Drawing | None = None


# Names: those that a user gives of what an FMU is to hold, and those of its variables.


_INDEX = r"(?:\[\d+(?:,\d+)*\])?"
_QUOTED = r"""'(?:[\w!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['"?\\abfnrtv])+'"""
_PART = rf"(?:[A-Za-z_]\w*|{_QUOTED}){_INDEX}"
_PATH = rf"{_PART}(?:\.{_PART})*"
_STRUCTURED = re.compile(rf"{_PATH}|der\({_PATH}(?:,\d+)?\)", re.ASCII)
_WHOLE_PART = re.compile(_PART, re.ASCII)
_STEM_AND_INDEX = re.compile(rf"(.+?)({_INDEX})", re.ASCII)
_ESCAPED = str.maketrans({mark: f"\\{mark}" for mark in "'\"\\"})


def once(system: System, what: str, names: Sequence[str]) -> list[str]:
    """Names as a list.

    Raises:
        ModelError: one is no text or is given twice.
    """
    found = (names,) if isinstance(names, str) else elements_of(() if names is None else names)
    if found is None:
        raise ModelError(f"{system.name}: {what} is {quoted(names)}; give a list of texts")
    given = list(found)
    for name in given:
        if not isinstance(name, str):
            raise ModelError(f"{system.name}: {what} name {quoted(name)}; give texts")
        if given.count(name) > 1:
            raise ModelError(f"{system.name}: {what} name {name!r} twice; name it once")
    return given


def structured_name(name: str) -> str:
    """A name as the naming convention `structured` of FMI has it, such as `'left-arm'.q`.

    A path of identifiers stays as it is. A part between two dots that is no identifier is put in
    single quotes. A name with characters beyond ASCII, for which the convention has no place, stays
    too: see `is_structured`.

    Args:
        name: of a variable or terminal.
    """
    if is_structured(name) or not (name.isascii() and name.isprintable()):
        return name
    parts = name.split(".")
    return ".".join(map(_part, parts)) if all(parts) else _part(name)


def is_structured(name: str) -> bool:
    """Whether the naming convention `structured` of FMI knows such a name."""
    return _STRUCTURED.fullmatch(name) is not None


def _part(text: str) -> str:
    """A part of a path, quoted where it is no identifier; its indices stay behind the quotes."""
    if not text or _WHOLE_PART.fullmatch(text):
        return text
    found = _STEM_AND_INDEX.fullmatch(text)
    assert found is not None  # any text is a stem without index
    stem, index = found.groups()
    return f"'{stem.translate(_ESCAPED)}'{index}"


Solver = Literal["dopri5", "rodas", "rk4"]
Kind = Literal[
    "state",
    "derivative",
    "input",
    "output",
    "parameter",
    "mode",
    "dependent",
    "indicator",
    "slot",
    "rate",
    "chart",
]


WITH_START: tuple[Kind, ...] = ("state", "input", "parameter", "dependent", "slot")
"""What has a start value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuVariable:
    """An input, an output, a parameter or a dependent coordinate of an FMU.

    Attributes:
        name: as other tools show it; a part that is no identifier gets quotes, as
            `mbs.export.fmu.description.structured_name` has it.
        unit: a name of `mbs.units.UNITS`.
        start: value at the start; of a dependent coordinate, a guess that chooses the
            configuration.
        nominal: typical size, positive.
        min: least value; a parameter below it is refused. The smallest normal number stands for
            more than zero.
        max: greatest value; a parameter above it is refused.
        description: one line for people.
        fixed: a parameter that keeps its value once the motion has begun.
        guess: an output whose start, where it is set, chooses the branch.
    """

    name: str
    unit: str = "1"
    start: float = 0.0
    nominal: float = 1.0
    min: float | None = None
    max: float | None = None
    description: str = ""
    fixed: bool = False
    guess: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", structured_name(self.name))


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuState(FmuVariable):
    """A continuous state and its derivative.

    Attributes:
        derivative: name of the derivative; `der(name)` by default.
        derivative_unit: a name of `mbs.units.UNITS`.
        derivative_description: one line for people.
        output: the state is an output of the FMU too.
    """

    derivative: str = ""
    derivative_unit: str = "1/s"
    derivative_description: str = ""
    output: bool = False


@dataclass(frozen=True, slots=True)
class Jumps:
    """Where an FMU's states and modes jump, and how; m counts its modes, k its indicators.

    All functions take the parameters with the modes behind them as p, as `FmuModel.rhs` does then.

    Attributes:
        modes: integers that are constant between events.
        first: `first(t, x, z, u, p) -> (modes, beyond)` before the first event, of the modes in p
            nothing; beyond (k, 1) is positive where x is outside what the model allows.
        indicators: `indicators(t, x, z, u, p) -> g`, (k, 1), positive between events. An event is
            where one of them is not positive any more.
        jump: `jump(t, x, z, u, p, fired) -> (x, modes)` after an event; fired (k, 1) is 1 for each
            indicator that is not positive.
        names: (k) what each indicator watches, for messages.
        approaches: `approaches(t, x, z, u, p) -> a`, (k, 3) as `mbs.solvers.Events` has them, for
            steps of Co-Simulation; None where two looks a step are enough.
        optional: whether the functions of the model do not depend on the modes, as where all events
            are of contacts: integrators outside need none of them.
    """

    modes: tuple[FmuVariable, ...]
    first: casadi.Function
    indicators: casadi.Function
    jump: casadi.Function
    names: tuple[str, ...]
    approaches: casadi.Function | None = None
    optional: bool = False


@dataclass(frozen=True, slots=True)
class Member:
    """A variable of a terminal.

    Attributes:
        name: in the terminal, such as "torque".
        variable: its name in the FMU.
        kind: "signal"; "inflow" or "outflow" for a force or torque that two terminals share.
    """

    name: str
    variable: str
    kind: Literal["signal", "inflow", "outflow"] = "signal"

    def __post_init__(self) -> None:
        object.__setattr__(self, "variable", structured_name(self.variable))


@dataclass(frozen=True, slots=True)
class Terminal:
    """Variables that are connected together, as at a flange.

    Attributes:
        name: unique among terminals.
        kind: what it may be connected to.
        members: its variables.
        matching: rule by which members of two terminals find each other.
        description: one line for people.
    """

    name: str
    kind: str
    members: tuple[Member, ...]
    matching: Literal["plug", "bus", "sequence"] = "bus"
    description: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", structured_name(self.name))


@dataclass(frozen=True, slots=True)
class Array:
    """Variables that follow each other and are one array in FMI 3.0.

    Attributes:
        name: of the array.
        first: value reference of its first element, and its own.
        size: number of elements.
        description: one line for people.
    """

    name: str
    first: int
    size: int
    description: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Whose a model is, each in words of its own; empty where nothing is said.

    Attributes:
        author: person or organisation.
        version: of the model.
        copyright: such as "(c) 2026 Example Ltd.".
        license: its name, text or address.
    """

    author: str = ""
    version: str = ""
    copyright: str = ""
    license: str = ""


@dataclass(frozen=True, slots=True)
class FmuEntry:
    """A variable at its place: the value reference is the index in the table of entries."""

    kind: Kind
    variable: FmuVariable


@dataclass(frozen=True, slots=True, eq=False)
class Rules:
    """What states at the start, and parameters, must fulfil beside the bounds of each.

    Attributes:
        excess: `excess(x, p) -> (k, 1)`, more than zero where a rule is broken.
        sentences: for each what is wrong and what to do.
        at_start: how many of them, the first ones, are of states at the start.
    """

    excess: casadi.Function
    sentences: tuple[str, ...]
    at_start: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuModel:
    """All that an FMU says and computes; nx, nz, nu, np, ny count the variables below.

    Where there are jumps, p is followed by their modes in rhs, not in closure.

    Attributes:
        name: of the model; letters, digits and underscores of it make the file names inside.
        description: one line for people.
        origin: whose it is.
        states: x.
        inputs: u.
        outputs: y, those that are not states.
        parameters: p, tunable or fixed.
        dependents: z, the coordinates that closed loops determine.
        loop_size: size of the mechanism, by which distances of displacements from guesses are
            divided [m].
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`.
        closure: `closure(x, z, p) -> (z_next, residual)`, one Newton step of z and the largest
            absolute closure row at z; None when there is no z.
        slopes: `slopes(x, z, p) -> J`, how the equations of the closure change with z; the signs of
            the determinants of its diagonal blocks show on which side of a singular configuration
            z is. None when nothing watches them.
        sines: `sines(x, z, p) -> (2, 1)`, squared sines that measure the distance from singular
            configurations: of the rows of the dependent joints and of all rows of the loops, see
            `mbs.loops.examine`. Derivatives are refused where they are too small. None if nothing
            is checked.
        passive: the first output that is a velocity of a dependent joint, the first that is an
            acceleration of one, and how many of each there are.
        tree: the same motion in all coordinates, which "dopri5" and "rodas" integrate, and
            integrators outside where nothing jumps: it passes configurations in which the states
            determine nothing. None where there is none.
        jumps: events; None when the motion is smooth.
        rules: what is asked of states and parameters; None where their bounds say all.
        stop_time: default end of a simulation, s.
        tolerance: default relative tolerance of the integration.
        step_size: default communication step, s.
        solver: of co-simulation: "dopri5", explicit with error control; "rodas", the same for stiff
            equations; "rk4", with the fixed step `internal_step`.
        internal_step: length of the steps of "rk4", s.
        max_step: the longest step of the other solvers, s; None for no limit.
        target: "hosted", or "bare" for co-simulation alone, by C without heap and files.
        documentation: text for `documentation/index.html`; a blank line starts a paragraph.
        terminals: variables that belong together.
        sources: name and text of further C files, which are compiled with the FMU.
        arrays: variables that are listed as one; see `mbs.export.fmu.arrays`.
        about: what people read and see of it; None where only its variables are known.
    """

    name: str
    rhs: casadi.Function
    description: str = ""
    origin: Origin = Origin()
    states: tuple[FmuState, ...] = ()
    inputs: tuple[FmuVariable, ...] = ()
    outputs: tuple[FmuVariable, ...] = ()
    parameters: tuple[FmuVariable, ...] = ()
    dependents: tuple[FmuVariable, ...] = ()
    loop_size: float = 1.0
    closure: casadi.Function | None = None
    slopes: casadi.Function | None = None
    sines: casadi.Function | None = None
    passive: tuple[int, int, int] = (0, 0, 0)
    tree: TreeState | None = None
    jumps: Jumps | None = None
    rules: Rules | None = None
    stop_time: float = 10.0
    tolerance: float = 1e-8
    step_size: float = 0.01
    solver: Solver = "dopri5"
    internal_step: float = 0.001
    max_step: float | None = None
    target: Target = "hosted"
    documentation: str = ""
    terminals: tuple[Terminal, ...] = ()
    sources: tuple[tuple[str, str], ...] = ()
    arrays: tuple[Array, ...] = ()
    about: About | None = None

    def __post_init__(self) -> None:
        check(self)

    @property
    def charted(self) -> bool:
        """Whether integrators outside pass singular configurations: charts.h."""
        return self.tree is not None and self.tree.passes

    @property
    def slots(self) -> tuple[FmuState, ...]:
        """The states where the integrator is outside and loops are closed.

        They are the states of the independent joints but near singular configurations, so joints
        are outputs and no states there; see charts.h.
        """
        if not self.charted:
            return ()
        text = "{}, or near singular configurations a coordinate along the motion"
        return tuple(
            FmuState(
                name=f"state[{k}]",
                start=state.start,
                nominal=state.nominal,
                description=text.format(state.name),
            )
            for k, state in enumerate(self.states, start=1)
        )

    @property
    def identifier(self) -> str:
        """The name as an identifier of C, which names the files inside the FMU."""
        text = re.sub(r"\W", "_", self.name, flags=re.ASCII)
        return text if text[:1].isalpha() else f"model_{text}"

    @property
    def entries(self) -> tuple[FmuEntry, ...]:
        """Every variable in the order of the value references."""
        return tuple(_entries(self))

    @property
    def modes(self) -> tuple[FmuVariable, ...]:
        """The modes of its events."""
        return self.jumps.modes if self.jumps else ()

    @property
    def derived(self) -> dict[int, int]:
        """Value references of the derivatives of states to those of the states."""
        state, rate = self.first("state"), self.first("derivative")
        if self.slots:
            state, rate = self.first("slot"), self.first("rate")
        return {rate + k: state + k for k in range(len(self.states))}

    def first(self, kind: Kind) -> int:
        """Value reference of the first variable of a kind.

        Args:
            kind: which variables.

        Returns:
            its index in `entries`, also where there is none of that kind.
        """
        order: tuple[tuple[Kind, int], ...] = (
            ("state", len(self.states)),
            ("derivative", len(self.states)),
            ("input", len(self.inputs)),
            ("output", len(self.outputs)),
            ("parameter", len(self.parameters)),
            ("mode", len(self.modes)),
            ("dependent", len(self.dependents)),
            ("indicator", len(self.jumps.names) if self.jumps else 0),
            ("slot", len(self.slots)),
            ("rate", len(self.slots)),
            ("chart", int(self.charted)),
        )
        place = 0
        for name, count in order:
            if name == kind:
                break
            place += count
        return place


def derivative_of(state: FmuState) -> FmuVariable:
    """The derivative of a state, as a variable.

    Args:
        state: a state.

    Returns:
        its derivative, without start value.
    """
    return FmuVariable(
        name=state.derivative or f"der({state.name})",
        unit=state.derivative_unit,
        description=state.derivative_description or f"derivative of {state.name}",
    )


def _entries(model: FmuModel) -> Iterator[FmuEntry]:
    yield from (FmuEntry("state", v) for v in model.states)
    yield from (FmuEntry("derivative", derivative_of(v)) for v in model.states)
    yield from (FmuEntry("input", v) for v in model.inputs)
    yield from (FmuEntry("output", v) for v in model.outputs)
    yield from (FmuEntry("parameter", v) for v in model.parameters)
    yield from (FmuEntry("mode", v) for v in model.modes)
    yield from (FmuEntry("dependent", v) for v in model.dependents)
    for name in model.jumps.names if model.jumps else ():
        text = f"positive between events: {name}"
        words = f"indicator.{name.replace(' ', '_')}"
        yield FmuEntry("indicator", FmuVariable(name=words, description=text))
    yield from (FmuEntry("slot", v) for v in model.slots)
    yield from (FmuEntry("rate", derivative_of(v)) for v in model.slots)
    if model.charted:
        text = "positive while the present states serve"
        yield FmuEntry("chart", FmuVariable(name="indicator.coordinates", description=text))
