"""Description of an FMU, from which its XML files and its C tables are generated."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import casadi

from mbs.arguments import elements_of
from mbs.assembly import System
from mbs.errors import ExportError, ModelError
from mbs.models.state.tree import TreeState
from mbs.native.scalar_source import Target
from mbs.options import described, faults, one_of
from mbs.text import quoted
from mbs.units import UNITS
from mbs.view.drawing import Drawing

# Checks of the description of an FMU, before a file is written.


TIME = "time"
"""Name of the independent variable, in FMI 3.0 and in results."""


def check(model: FmuModel) -> None:
    """Check that a description is a valid FMU.

    Raises:
        ExportError: a name, a number or the size of a function is invalid.
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
    """Raise ExportError if a text of the description contains characters that are not printable."""
    for sentence in filter(
        None, (printable("description", model.description), *faults(model.origin))
    ):
        raise ExportError(f"FMU {model.name}: {sentence}")


def _check_numbers(model: FmuModel) -> None:
    check_options(model, model.name)
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
    if model.cut_positions is not None:
        _check_shape(model, "cuts", model.cut_positions, (nx, nz, n_p), (len(model.cuts),))
    if model.jumps is not None:
        point, k = (1, nx, nz, nu, n_p + n_m), len(model.jumps.names)
        _check_shape(model, "first", model.jumps.first, point, (n_m, k))
        _check_shape(model, "indicators", model.jumps.indicators, point, (k,))
        _check_shape(model, "jump", model.jumps.jump, (*point, k), (nx, n_m))
        if model.jumps.approaches is not None:
            _check_shape(model, "approaches", model.jumps.approaches, point, (3 * k,))


def _check_target(model: FmuModel) -> None:
    """Raise ExportError if the model has contents that target="bare" does not support."""
    if model.target == "hosted":
        return
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


# Documentation of an FMU in addition to its variables.


@dataclass(frozen=True, slots=True)
class PageTable:
    """Table of the documentation.

    Attributes:
        title: heading of the table.
        columns: column headings.
        rows: rows of cell texts, each with one text per column.
        note: sentence below the title.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True, slots=True)
class Documentation:
    """Tables and drawing of the documentation.

    Attributes:
        tables: tables in the order of the page.
        drawing: drawing of the mechanism at the start configuration, or None. The icon shows it
            too.
    """

    tables: tuple[PageTable, ...] = ()
    drawing: Drawing | None = None


# Options of an FMU that its description contains as well: origin, experiment and solver.


Solver = Literal["dopri5", "rodas", "rk4"]

_SOLVERS = {"dopri5": "explicit", "rodas": "stiff", "rk4": "fixed step"}
_TARGETS: dict[str, str] = dict.fromkeys(get_args(Target), "")
_STEPS = ("dopri5", "rodas")
"""Solvers that choose their steps."""


def printable(label: str, value: object) -> str:
    """Return the error of a text that is no line of printable characters, "" if it is one."""
    if isinstance(value, str) and value.isprintable():
        return ""
    return f"{label} is {quoted(value)}; give a line of printable characters"


def _positive(label: str, value: object) -> str:
    if isinstance(value, (int, float)) and math.isfinite(value) and value > 0:
        return ""
    return f"{label} {quoted(value)} must be positive"


def _known_solver(label: str, value: object) -> str:
    if isinstance(value, str) and value in _SOLVERS:
        return ""
    return f"{label} is {value!r}; use {' or '.join(_SOLVERS)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Author and licence of a model. Empty texts are left out of the FMU."""

    author: str = field(
        default="",
        metadata=described(
            "person or organisation, for the model description.",
            check=printable,
            command="--author",
        ),
    )
    version: str = field(
        default="",
        metadata=described("version of the model.", check=printable, command="--model-version"),
    )
    copyright: str = field(
        default="",
        metadata=described(
            'copyright notice, such as "(c) 2026 Example Ltd.".',
            check=printable,
            command="--copyright",
        ),
    )
    license: str = field(
        default="",
        metadata=described(
            "name, text or address of the licence.", check=printable, command="--license"
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Default experiment, solver and target of an FMU, for classes that have slots for them."""

    __slots__ = ()

    stop_time: float = field(
        default=10.0,
        metadata=described(
            "default end of a simulation.",
            unit="s",
            label="stop time",
            check=_positive,
            command="--stop-time",
            in_form=True,
        ),
    )
    step_size: float = field(
        default=0.01,
        metadata=described(
            "default communication step.",
            unit="s",
            label="step size",
            check=_positive,
            command="--step-size",
            in_form=True,
        ),
    )
    tolerance: float = field(
        default=1e-8,
        metadata=described(
            "default relative tolerance.", check=_positive, command="--tolerance", in_form=True
        ),
    )
    solver: Solver = field(
        default="dopri5",
        metadata=described(
            'solver of Co-Simulation: "dopri5", the explicit pair of Dormand and Prince; "rodas",'
            ' the linearly implicit RODAS5P for stiff systems; "rk4", with a fixed step, for real'
            " time.",
            _SOLVERS,
            check=_known_solver,
            command="--solver",
            in_form=True,
        ),
    )
    internal_step: float = field(
        default=0.001,
        metadata=described(
            'step of "rk4".',
            unit="s",
            label="internal step",
            only_with=("solver", ("rk4",)),
            check=_positive,
            command="--internal-step",
            in_form=True,
        ),
    )
    max_step: float | None = field(
        default=None,
        metadata=described(
            'longest step of "dopri5" and "rodas". By default only the error and events limit the'
            " step.",
            unit="s",
            label="longest step",
            only_with=("solver", _STEPS),
            check=lambda label, value: "" if value is None else _positive(label, value),
            command="--max-step",
            in_form=True,
        ),
    )
    target: Target = field(
        default="hosted",
        metadata=described(
            '"hosted", or "bare" for systems without an operating system: Co-Simulation only, with'
            ' solver="rk4" and no events, in C99 that uses no heap, files or global variables. In'
            " FMI 2.0 the callbacks of the importer allocate its memory, in FMI 3.0 two functions"
            ' in memory.c, which may be replaced. Results are bit-identical to target="hosted".',
            _TARGETS,
            check=one_of(tuple(_TARGETS)),
            command="--bare",
            command_text="for microcontrollers: no heap, Co-Simulation by rk4 only, no events.",
        ),
    )


def check_options(options: Experiment, name: str) -> None:
    """Check every option of an FMU by itself, and that the target has the solver.

    Args:
        options: options of the FMU.
        name: name of the model, for error messages.

    Raises:
        ExportError: an option is invalid, or the target does not support the solver.
    """
    for sentence in faults(options):
        raise ExportError(f"FMU {name}: {sentence}")
    if options.target == "bare" and options.solver != "rk4":
        raise ExportError(
            f"FMU {name}: solver is {options.solver!r}, and target='bare' takes steps of a"
            " fixed length alone; use solver='rk4'"
        )


# Names: lists of names from the user, and names of the variables of an FMU.


_INDEX = r"(?:\[\d+(?:,\d+)*\])?"
_QUOTED = r"""'(?:[\w!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['"?\\abfnrtv])+'"""
_PART = rf"(?:[A-Za-z_]\w*|{_QUOTED}){_INDEX}"
_PATH = rf"{_PART}(?:\.{_PART})*"
_STRUCTURED = re.compile(rf"{_PATH}|der\({_PATH}(?:,\d+)?\)", re.ASCII)
_WHOLE_PART = re.compile(_PART, re.ASCII)
_STEM_AND_INDEX = re.compile(rf"(.+?)({_INDEX})", re.ASCII)
_ESCAPED = str.maketrans({mark: f"\\{mark}" for mark in "'\"\\"})


def once(system: System, what: str, names: Sequence[str]) -> list[str]:
    """Return names as a list, after checking that each is a text and occurs once.

    Args:
        system: mechanism, for error messages.
        what: name of the argument, for error messages.
        names: one name or several names.

    Raises:
        ModelError: a name is not a text or is given twice.
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
    """Convert a name to the naming convention `structured` of FMI, such as `'left-arm'.q`.

    A part between two dots that is no identifier is put in single quotes. A path of identifiers is
    unchanged. A name with characters beyond ASCII is unchanged too, because the convention does not
    allow such names: see `is_structured`.

    Args:
        name: name of a variable or terminal.
    """
    if is_structured(name) or not (name.isascii() and name.isprintable()):
        return name
    parts = name.split(".")
    return ".".join(map(_part, parts)) if all(parts) else _part(name)


def is_structured(name: str) -> bool:
    """Whether a name conforms to the naming convention `structured` of FMI."""
    return _STRUCTURED.fullmatch(name) is not None


def _part(text: str) -> str:
    """Quote a part of a path if it is no identifier. Indices such as `[1]` follow the quotes."""
    if not text or _WHOLE_PART.fullmatch(text):
        return text
    found = _STEM_AND_INDEX.fullmatch(text)
    assert found is not None  # any text is a stem without index
    stem, index = found.groups()
    return f"'{stem.translate(_ESCAPED)}'{index}"


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
    "cut",
]


WITH_START: tuple[Kind, ...] = ("state", "input", "parameter", "dependent", "slot", "cut")
"""Kinds of variables that have a start value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuVariable:
    """Input, output, parameter or dependent coordinate of an FMU.

    Attributes:
        name: name of the variable in other tools. It is converted by
            `mbs.export.fmu.description.structured_name`.
        unit: unit, a name of `mbs.units.UNITS`.
        start: value at the start. For a dependent coordinate it is a guess that selects the
            assembly mode.
        nominal: typical size, positive.
        min: smallest value, or None. A parameter below it is an error. The smallest normal number
            means "positive".
        max: largest value, or None. A parameter above it is an error.
        description: one-line description.
        fixed: whether the parameter is constant after the initialization.
        guess: whether the variable is an output whose start value, if it is set, selects the
            branch.
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
    """Continuous state and its derivative.

    Attributes:
        derivative: name of the derivative, `der(name)` by default.
        derivative_unit: unit of the derivative, a name of `mbs.units.UNITS`.
        derivative_description: description of the derivative, one line.
        output: whether the state is also an output of the FMU.
    """

    derivative: str = ""
    derivative_unit: str = "1/s"
    derivative_description: str = ""
    output: bool = False


@dataclass(frozen=True, slots=True)
class Jumps:
    """Events of an FMU, which change its states and modes. k: number of event indicators.

    In all functions p holds the parameters, then the modes, as in `FmuModel.rhs`.

    Attributes:
        modes: integer variables that are constant between events.
        first: `first(t, x, z, u, p) -> (modes, beyond)`, modes at the start, independent of the
            modes in p. beyond (k, 1) is positive if x violates the limit of an indicator.
        indicators: `indicators(t, x, z, u, p) -> g`, (k, 1), positive between events. An event
            occurs when an indicator is no longer positive.
        jump: `jump(t, x, z, u, p, fired) -> (x, modes)` after an event. fired (k, 1) is 1 for each
            indicator that is not positive.
        names: names of the indicators (k,), for error messages.
        approaches: `approaches(t, x, z, u, p) -> a`, (k, 3) as in `mbs.solvers.Events`, for steps
            of Co-Simulation. None if two evaluations of the indicators per step are enough.
        optional: whether the functions of the model are independent of the modes, as if all events
            are contacts. An external integrator then needs no events.
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
    """Variable of a terminal.

    Attributes:
        name: name in the terminal, such as "torque".
        variable: name of the variable in the FMU.
        kind: "signal", or "inflow" or "outflow" for a force or torque between two terminals.
    """

    name: str
    variable: str
    kind: Literal["signal", "inflow", "outflow"] = "signal"

    def __post_init__(self) -> None:
        object.__setattr__(self, "variable", structured_name(self.variable))


@dataclass(frozen=True, slots=True)
class Terminal:
    """Group of variables that are connected together, as at a flange (FMI 3.0).

    Attributes:
        name: name of the terminal, unique in the FMU.
        kind: kind of the terminal. Terminals of the same kind can be connected.
        members: variables of the terminal.
        matching: rule that pairs the members of two connected terminals.
        description: one-line description.
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
    """Array variable of FMI 3.0, made of variables with consecutive value references.

    Attributes:
        name: name of the array.
        first: value reference of the array and of its first element.
        size: number of elements.
        description: one-line description.
    """

    name: str
    first: int
    size: int
    description: str = ""


@dataclass(frozen=True, slots=True)
class FmuEntry:
    """Variable with its kind. Its value reference is its index in `FmuModel.entries`."""

    kind: Kind
    variable: FmuVariable


@dataclass(frozen=True, slots=True, eq=False)
class Rules:
    """Conditions on the start states and the parameters, in addition to the bounds of each.

    Attributes:
        excess: `excess(x, p) -> (k, 1)`, positive for each violated condition.
        sentences: error message of each condition: the error and its remedy.
        at_start: number of conditions on the start states. They come first.
    """

    excess: casadi.Function
    sentences: tuple[str, ...]
    at_start: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuModel(Experiment):
    """Description of an FMU: variables, equations, events, default experiment and documentation.

    The default experiment, the solver and the target are attributes of `Experiment`.

    nx, nu, ny, np and nz are the numbers of states, inputs, outputs, parameters and dependents. If
    the model has events, p in rhs holds the parameters, then the modes. p in closure, slopes and
    sines holds the parameters only.

    Attributes:
        name: name of the model. Its letters, digits and underscores form the file names in the FMU.
        description: one-line description.
        origin: author, version, copyright and licence.
        states: variables of x.
        inputs: variables of u.
        outputs: variables of y: the outputs that are not states.
        parameters: variables of p, tunable or fixed.
        dependents: variables of z, the coordinates that closed loops determine.
        cuts: positions of the joints that are cut. Their start values are guesses too.
        cut_positions: `cut_positions(x, z, p)`, positions of `cuts`; None if there are none.
        loop_size: size of the mechanism [m], the unit of distances of displacements from guesses.
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`.
        closure: `closure(x, z, p) -> (z_next, residual)`, one Newton step of z and the largest
            absolute closure residual at z. None if the model has no z.
        slopes: `slopes(x, z, p) -> J`, Jacobian of the closure equations by z. A sign change of the
            determinant of a diagonal block reveals a step across a singular configuration. None if
            it is not checked.
        sines: `sines(x, z, p) -> (2, 1)`, squared sines that measure the distance from singular
            configurations: the first for the closure rows of the dependent joints, the second for
            all closure rows, see `mbs.loops.configuration_report`. Derivatives are an error if the
            sine is too small. None if it is not checked.
        passive: index in y of the first velocity of a dependent joint, index of the first
            acceleration, and number of each.
        tree: equations of motion in the coordinates of all joints, for "dopri5" and "rodas", and
            for an external integrator if its events allow it. Their solution passes through
            singular configurations, in which the states do not determine the motion. None if the
            model has no such equations, as for open chains.
        jumps: events, None if the motion is smooth.
        rules: conditions on states and parameters, None if their bounds are sufficient.
        documentation: text for `documentation/index.html`. A blank line starts a paragraph.
        terminals: groups of variables that are connected together.
        sources: names and texts of further C files, which are compiled with the FMU.
        arrays: array variables of FMI 3.0, see `mbs.export.fmu.system_fmu`.
        about: tables and drawing of the documentation, or None.
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
    cuts: tuple[FmuVariable, ...] = ()
    cut_positions: casadi.Function | None = None
    loop_size: float = 1.0
    closure: casadi.Function | None = None
    slopes: casadi.Function | None = None
    sines: casadi.Function | None = None
    passive: tuple[int, int, int] = (0, 0, 0)
    tree: TreeState | None = None
    jumps: Jumps | None = None
    rules: Rules | None = None
    documentation: str = ""
    terminals: tuple[Terminal, ...] = ()
    sources: tuple[tuple[str, str], ...] = ()
    arrays: tuple[Array, ...] = ()
    about: Documentation | None = None

    def __post_init__(self) -> None:
        check(self)

    @property
    def charted(self) -> bool:
        """Whether an external integrator can pass singular configurations, see charts.h."""
        return self.tree is not None and self.tree.passes

    @property
    def slots(self) -> tuple[FmuState, ...]:
        """Continuous states of closed loops for an external integrator, see charts.h.

        They are the states of the independent joints, or tangent coordinates near singular
        configurations. The joint coordinates themselves are therefore outputs in model exchange.
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
        """Name as a C identifier, for the file names in the FMU."""
        text = re.sub(r"\W", "_", self.name, flags=re.ASCII)
        return text if text[:1].isalpha() else f"model_{text}"

    @property
    def entries(self) -> tuple[FmuEntry, ...]:
        """All variables in the order of the value references."""
        return tuple(_entries(self))

    @property
    def modes(self) -> tuple[FmuVariable, ...]:
        """Modes of the events, empty without events."""
        return self.jumps.modes if self.jumps else ()

    @property
    def derived(self) -> dict[int, int]:
        """Dict from the value reference of each state derivative to that of its state."""
        state, rate = self.first("state"), self.first("derivative")
        if self.slots:
            state, rate = self.first("slot"), self.first("rate")
        return {rate + k: state + k for k in range(len(self.states))}

    def first(self, kind: Kind) -> int:
        """Return the value reference of the first variable of a kind.

        Args:
            kind: kind of variables.

        Returns:
            Index in `entries`. If no variable has this kind, the index of the next kind.
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
            ("cut", len(self.cuts)),
        )
        place = 0
        for name, count in order:
            if name == kind:
                break
            place += count
        return place


def derivative_of(state: FmuState) -> FmuVariable:
    """Return the derivative of a state as a variable.

    Args:
        state: continuous state.

    Returns:
        Variable of the derivative.
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
    yield from (FmuEntry("cut", v) for v in model.cuts)
