"""Components by their equations: ports, parameters, states, inputs, outputs, and what they do.

A class that derives from `Custom` declares what it has, and says by methods what it does:

    class Drag(Custom):
        \"\"\"Air drag on a point: force -c |v| v.\"\"\"

        point = custom.frame()
        c = custom.parameter("kg/m", min=0)

        def loads(self, at):
            v = at.point.v
            return {"point": custom.force(-at.c * custom.regular_length(v) * v)}

        def dissipation(self, at):
            v = at.point.v
            return at.c * custom.regular_length(v) * casadi.dot(v, v)

Every method gets `at`, which has all that was declared under its name as CasADi expressions.
Assembling a mechanism checks what they return and brings it into every model. Force elements,
drives and frictions of this package are written in the same way.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property
from types import SimpleNamespace
from typing import Any, ClassVar, TypeVar

import casadi
from casadi import SX

from mbs.components.component import Component, Point, check_arguments
from mbs.components.on_points import OnPoints
from mbs.components.shapes import Shape
from mbs.errors import DescriptionError
from mbs.expressions import (
    MORE_THAN_ZERO,
    Expression,
    Number,
    Parameter,
    Scalar,
    out_of_bounds,
    to_float,
)
from mbs.expressions.expression import finite
from mbs.spatial import vector, zeros
from mbs.text import did_you_mean, quoted
from mbs.units import UNITS

# What a component declares.


EFFORT = "effort"
"""The unit of an effort along a coordinate: N m or N."""

REQUIRED: Any = object()
"""Stands where there is no default."""


@dataclass(frozen=True, slots=True, eq=False)
class Declared:
    """One thing that a component has.

    Attributes:
        kind: frame, flange, coordinate, parameter, state, mode, unknown, input or output.
        unit: of its value.
        default: of a parameter or an input; the start of a state, the guess of an unknown.
        low, high: least and greatest value of a parameter.
        nominal: typical size of a state.
    """

    kind: str
    unit: str = "1"
    default: Any = REQUIRED
    low: float | None = None
    high: float | None = None
    nominal: float = 1.0

    def __post_init__(self) -> None:
        if self.unit not in UNITS and self.unit != EFFORT:
            raise DescriptionError(
                f"a declared {self.kind} has the unit {quoted(self.unit)}; give a product of SI"
                " units such as 'kg/m', 'N.s/m' or 'm3/s'"
            )


def frame() -> Any:
    """A port on a point of a body: the component is made with a body or `body.at(...)` for it."""
    return Declared("frame")


def flange(*, slides: bool | None = False) -> Any:
    """A port on a shaft: `m.connect(component.name_of_it, joint.flange)` connects it.

    Args:
        slides: it is a place on a slide, whose position is in m, and is connected to flanges of
            prismatic joints; None where it may be either.
    """
    return Declared("flange", "1" if slides is None else "m" if slides else "rad")


def coordinate() -> Any:
    """A port on a coordinate of a joint: the component is made with its name, such as "j1"."""
    return Declared("coordinate")


def parameter(
    unit: str = "1",
    default: Scalar | None = REQUIRED,
    *,
    min: float | None = None,
    max: float | None = None,
    positive: bool = False,
) -> Any:
    """A number, a text or an `mbs.Parameter`; it stays a symbol where one is in it.

    Args:
        unit: of its value.
        default: where the component is made without it, and it must be given when left out; with
            None it may stay away, and at.of_it is None.
        min: the least value that is taken.
        max: the greatest.
        positive: take what is more than zero only.
    """
    low = MORE_THAN_ZERO if positive and min is None else min
    return Declared("parameter", unit, default, low, max)


def state(unit: str = "1", *, start: float = 0.0, nominal: float = 1.0) -> Any:
    """A quantity with a rate of its own, which `rates` gives; `start` may be given by its name.

    Args:
        unit: of its value.
        start: where a motion begins when nothing else is said.
        nominal: typical size, by which solvers measure errors.
    """
    return Declared("state", unit, start, nominal=nominal)


def mode(start: float = 0.0) -> Any:
    """A number that is constant between events, such as 1 where something is locked.

    It is a state whose rate is zero, and which `events` sets.

    Args:
        start: at the start of a motion; it may be given by its name.
    """
    return Declared("mode", "1", start)


def unknown(unit: str = "m", *, guess: float = 0.0) -> Any:
    """A quantity that the rows of the component determine together with the configuration.

    It is a coordinate of the system, without mass, named NAME.of_it; its rate is an element of v.

    Args:
        unit: "m" or "rad".
        guess: near which assembling looks for it.
    """
    if unit not in ("m", "rad"):
        raise DescriptionError(
            f"an unknown is declared with the unit {quoted(unit)}; use 'm' or 'rad'"
        )
    return Declared("unknown", unit, guess)


def input(unit: str = "1", *, default: float = 0.0) -> Any:
    """A signal from outside: of `run`, an FMU, an optimal control problem, or `m.wire`.

    Args:
        unit: of its value.
        default: where nothing gives it.
    """
    return Declared("input", unit, default)


def output(unit: str = "1") -> Any:
    """A signal that `outputs` gives: a column of results, an output of FMUs, a source of wires."""
    return Declared("output", unit)


@dataclass(frozen=True, slots=True)
class Signal:
    """An input or output of a component, which `Mechanism.wire` takes.

    Attributes:
        owner: the component.
        name: of the signal in it.
        kind: "input" or "output".
    """

    owner: Component
    name: str
    kind: str

    def __str__(self) -> str:
        return f"{self.owner.name}.{self.name}"


@dataclass(frozen=True, slots=True)
class Flange:
    """An end of a shaft that another one can be connected to.

    Attributes:
        owner: the component that it belongs to: a part of a drive line, or a joint.
        port: which flange of it, "a" or "b"; nothing where there is only one.
    """

    owner: Component
    port: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """The name of its component, and which flange of it."""
        return self.owner.name, self.port

    def __str__(self) -> str:
        if self.port in ("", "a", "b"):
            return f"{self.owner.name}.flange{'_' if self.port else ''}{self.port}"
        return f"{self.owner.name}.{self.port}"


class _Handle:
    """What stands in a class for a flange, an input or an output: `motor.voltage` is a Signal."""

    def __init__(self, kind: str, name: str) -> None:
        self.kind, self.name = kind, name

    def __repr__(self) -> str:
        return f"the {self.kind} {self.name!r} of a class, not of a component"

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        if owner is None:
            return self
        if self.kind == "flange":
            return Flange(owner, port_of_flange(self.name))
        return Signal(owner, self.name, self.kind)


def port_of_flange(name: str) -> str:
    """The port of the flange that a component declares under a name: "a" for flange_a."""
    return name.removeprefix("flange").removeprefix("_") if name.startswith("flange") else name


# What the methods of a component see: its ports where they are, its numbers as expressions.


SHORTEST = 1e-12
"""Length that is added to every norm as the root of a sum of squares."""


def regular_length(x: SX) -> SX:
    """Length of a vector, sqrt(x'x + 1e-24): unlike `casadi.norm_2` it has slopes where x is 0."""
    return casadi.sqrt(casadi.dot(x, x) + SHORTEST**2)


@dataclass(frozen=True, eq=False)
class RelativeMotion:
    """How a frame b moves, seen from a frame a and in its axes.

    Attributes:
        p: (3, 1) origin of b [m].
        R: (3, 3) orientation of b.
        V: (3, 1) rate of p [m/s].
        w: (3, 1) angular velocity of b relative to a [rad/s].
    """

    p: SX
    R: SX
    V: SX
    w: SX

    @cached_property
    def length(self) -> SX:
        """Distance of the origins [m], regular where it is zero."""
        return regular_length(self.p)

    @cached_property
    def along(self) -> SX:
        """(3, 1) unit vector from a to b."""
        return self.p / self.length

    @cached_property
    def rate(self) -> SX:
        """Rate of the distance [m/s]."""
        return casadi.dot(self.along, self.V)


class FrameAt:
    """A frame of a component in a configuration, in motion.

    Attributes:
        port: the name that the component gave it.
        p: (3, 1) its origin in the world [m].
        R: (3, 3) its orientation in the world.
        v: (3, 1) velocity of its origin, in axes of the world [m/s].
        w: (3, 1) angular velocity, in axes of the world [rad/s].
    """

    def __init__(self, port: str, seen_from: Callable[[FrameAt | None], RelativeMotion]) -> None:
        self.port = port
        self._seen_from = seen_from

    @cached_property
    def _in_world(self) -> RelativeMotion:
        return self._seen_from(None)

    @property
    def p(self) -> SX:
        """(3, 1) its origin in the world [m]."""
        return self._in_world.p

    @property
    def R(self) -> SX:
        """(3, 3) its orientation in the world."""
        return self._in_world.R

    @property
    def v(self) -> SX:
        """(3, 1) velocity of its origin, in axes of the world [m/s]."""
        return self._in_world.V

    @property
    def w(self) -> SX:
        """(3, 1) angular velocity, in axes of the world [rad/s]."""
        return self._in_world.w

    def to(self, other: FrameAt) -> RelativeMotion:
        """How another frame moves, seen from this one and in its axes."""
        return other._seen_from(self)


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateAt:
    """A coordinate, or a sum of several, each times a factor.

    Attributes:
        q: its position [rad or m]; None where it is none, as the rates of a spherical joint.
        v: its rate.
        unit: of its position, that of the first one where it is a sum.
    """

    q: SX | None
    v: SX
    unit: str = "rad"


@dataclass(frozen=True, slots=True, eq=False)
class FlangeAt:
    """A flange.

    Attributes:
        angle: of its shaft [rad]; of a flange that slides its position [m].
        speed: its rate [rad/s or m/s].
    """

    angle: SX
    speed: SX

    @property
    def position(self) -> SX:
        """Of a flange that slides [m]."""
        return self.angle


class At:
    """What a component has, at a state: every declared name is an attribute.

    Frames are `FrameAt`, flanges `FlangeAt`, coordinates `CoordinateAt`; parameters, states,
    inputs and unknowns are (1, 1) expressions. `outputs` has `lam` besides, the efforts of the
    rows by their labels. `symbols` are those of all parameters of the mechanism, by name.
    """

    def __init__(
        self, component: str, symbols: Mapping[str, SX], values: Mapping[str, Callable[[], Any]]
    ) -> None:
        self.symbols = symbols
        self._component = component
        self._values = values

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name not in self._values:
            raise DescriptionError(
                f"{self._component}: there is no at.{name} here; {did_you_mean(name, self._values)}"
            )
        value = self._values[name]()
        self.__dict__[name] = value
        return value


# What the methods of a component return.


@dataclass(frozen=True, slots=True, eq=False)
class FrameLoad:
    """What a component does to a frame.

    Attributes:
        force: (3, 1) [N].
        moment: (3, 1) about the origin of the frame [N m].
        own_axes: both are in the axes of the frame, not of the world.
    """

    force: SX
    moment: SX
    own_axes: bool = False


def force(value: Any, *, own_axes: bool = False) -> FrameLoad:
    """A force (3, 1) [N] at the origin of a frame, in axes of the world or of the frame.

    Args:
        value: (3, 1), or a list of three numbers and expressions.
        own_axes: in the axes of the frame.
    """
    return FrameLoad(_column(value), zeros(), own_axes)


def torque(value: Any, *, own_axes: bool = False) -> FrameLoad:
    """A torque (3, 1) [N m] on a frame, in axes of the world or of the frame, as `force`."""
    return FrameLoad(zeros(), _column(value), own_axes)


def _column(value: Any) -> SX:
    """What a user gave: an expression, or a list of numbers and expressions."""
    return vector(value) if isinstance(value, (list, tuple)) else SX(value)


def between(
    a: FrameAt, b: FrameAt, on_a: FrameLoad, moment_b: SX | None = None
) -> dict[str, FrameLoad]:
    """A wrench on frame a in its axes, and the opposite force on frame b.

    Args:
        a: a frame of the component.
        b: another one.
        on_a: force and moment on a, in its own axes.
        moment_b: (3, 1) moment on b about its origin, in the axes of a; none when left out.
    """
    R = a.to(b).R
    turned = zeros() if moment_b is None else moment_b
    opposite = casadi.mtimes(R.T, -on_a.force), casadi.mtimes(R.T, turned)
    return {a.port: replace(on_a, own_axes=True), b.port: FrameLoad(*opposite, own_axes=True)}


def pull(a: FrameAt, b: FrameAt, tension: SX) -> dict[str, FrameLoad]:
    """A tension [N] that draws the origins of two frames together."""
    return between(a, b, FrameLoad(a.to(b).along * tension, zeros()))


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """Something that must be zero.

    Attributes:
        value: (1, 1).
        unit: "m" for a length, "1" for what has no size, such as a cosine or an angle.
    """

    value: SX
    unit: str = "m"


@dataclass(frozen=True, slots=True, eq=False)
class Approach:
    """A crossing whose rate has a known bound, such as the distance of two bodies.

    Simulations look at it so often within a step that it does not fall to zero and rise again
    between two looks. They need no looks while it is larger than the bound lets it fall.

    Source: Mirtich 1996 for the bound of the time until two bodies touch.

    Attributes:
        value: (1, 1) what passes through zero.
        speed: (1, 1) bound of its rate for motion at the present speed in any direction; None
            where no bound is known.
        pace: (1, 1) reciprocal of the shortest time in which it falls to zero and rises again
            [1/s], such as the speed over the size of an obstacle.
    """

    value: SX
    speed: SX | None
    pace: SX


@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """Something that happens at once.

    Attributes:
        when: (1, 1) positive before; it happens where this is not positive any more. After it,
            `when` must be positive again, or leave zero upwards.
        then: what states and modes of the component become, by name.
    """

    when: SX
    then: Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Friction:
    """Dry friction: it sticks up to an effort, and is braked beyond.

    The velocity of slip is linear in velocities, with factors of positions and parameters; what it
    is at rest, such as the speed of a belt, is of parameters alone. The effort acts along it: what
    the ports get is what does the same work.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        slip: (1, 1) velocity of slip [rad/s or m/s].
        limit: (1, 1) friction while it slides, never below zero [N m or N]; of positions,
            velocities, states, inputs and parameters.
        sticking: (1, 1) the largest effort at which it sticks, at least the limit, and as large
            when left out.
        unit: of the effort, "N" or "N.m"; when left out that of the coordinate or shaft of the
            component, and "N" where it has frames.
    """

    slip: Any
    limit: Any
    sticking: Any = None
    unit: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """A rigid stop: a gap that stays between limits, with impacts and contact.

    Source: Pfeiffer and Glocker 1996, chapters 4 and 6.

    Attributes:
        gap: (1, 1) of positions and parameters [rad or m].
        lower: the least gap, of parameters; None for no stop on that side.
        upper: the largest one, likewise.
        restitution: Newton's, between 0 and 1, of parameters.
        rest_speed: of the slowest rebound [rad/s or m/s], of parameters.
        unit: of its effort, as that of `Friction`.
    """

    gap: Any
    lower: Any = 0.0
    upper: Any = None
    restitution: Any = 0.0
    rest_speed: Any = 1e-4
    unit: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class OneWay:
    """A velocity that never falls below zero: a freewheel.

    Attributes:
        velocity: (1, 1) of velocities, as the slip of a `Friction` [rad/s or m/s].
        unit: of its effort, as that of `Friction`.
    """

    velocity: Any
    unit: str | None = None


Load = FrameLoad | SX | float
"""A wrench on a frame; a force [N] or torque [N m] along a coordinate or on a flange."""

C = TypeVar("C", bound="Custom")


@dataclass(frozen=True, slots=True)
class Custom(OnPoints):
    """A component by its equations; derive from it, declare ports and numbers, write methods.

    What a component does:

    - `loads(at)`: what it does to its ports, by their names. Where it is left out and `energy` is
      there, the loads are the slopes of the energy, with the opposite sign.
    - `energy(at)`: what it stores [J]; of positions and states; inputs count as constants.
    - `dissipation(at)`: what it turns into heat [W], never negative.
    - `rates(at)`: the rate of every state, by name.
    - `rows(at)`: what must be zero, by label: each a `Row`, of positions, unknowns and parameters.
    - `positive(at)`: what must be positive where the rows are zero, by label: it tells which of the
      configurations that the rows allow is meant.
    - `velocity_rows(at)`: what must be zero, by label: linear in velocities.
    - `outputs(at)`: the value of every output, by name.
    - `events(at)`: by label, when something happens at once, and what states and modes become; in
      simulations and FMUs.
    - `frictions(at)`: dry frictions, a `Friction` each, by label; in simulations and FMUs.
    - `stops(at)`: rigid stops and freewheels, a `Stop` or `OneWay` each, by label; likewise.
    - `limits(at)`: between which values its coordinates stay, a pair each, by port.
    - `figures(at)`: what it looks like at its frames, a `Shape` each, of numbers.
    - `crossings(at)`: by label, what passes through zero where the law has a bend or is short:
      simulations end a step there; an `Approach` for what is short while bodies move far.

    Source: Haug 1989 for forces, rows and the work that they do.

    Attributes:
        name: unique in its mechanism.
    """

    declared: ClassVar[Mapping[str, Declared]] = {}
    """What the class and its bases declare, by name."""

    drives: ClassVar[bool] = False
    """Whether it is a motor on its flange: models of efforts leave what it delivers to tau."""

    fixed: ClassVar[bool] = False
    """Whether its flanges do not move."""

    shape: ClassVar[str] = "bar"
    """How pictures show it between its points, one after the other: "bar", "coil" or ""."""

    lowered: ClassVar[bool] = False
    """Whether the assembly turns it into joints and couplings, so that nothing is left of it."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super(Custom, cls).__init_subclass__(**kwargs)
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Declared)}
        inherited = [base.__dict__.get("declared", {}) for base in reversed(cls.__mro__)]
        cls.declared = {n: what for one in (*inherited, own) for n, what in one.items()}
        if own:
            _make_fields(cls, own)
            check_arguments(cls)

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        for name, what in self.declared.items():
            if what.kind in _CHECKS:
                if not hasattr(self, name):
                    raise DescriptionError(
                        f"{self.name}: {type(self).__name__}.__init__ does not set {name!r}; leave"
                        " __init__ out, since a component is made with what its class declares"
                    )
                _CHECKS[what.kind](self, name, what)

    def require_made(self) -> None:
        """Refuse a component whose class does not look at what it was made with."""
        for name in self.names_of("frame", "parameter"):
            given = getattr(self, name)
            if given is not None and not isinstance(given, (Point, Expression)):
                raise DescriptionError(
                    f"{self.name}: {type(self).__name__}.__post_init__ leaves {name!r} unchecked;"
                    " let it call Custom.__post_init__(self) first"
                )

    # Ports.

    def names_of(self, *kinds: str) -> tuple[str, ...]:
        """The names of what is declared of some kinds, in order."""
        return tuple(name for name, what in self.declared.items() if what.kind in kinds)

    def drawn(self, values: Mapping[str, float]) -> Mapping[str, Shape]:
        """Its figures at values of the symbols; none where one of its parameters has no value.

        Raises:
            DescriptionError: a figure is no Shape, or its port is no frame.
        """
        numbers: dict[str, Any] = {}
        for name in self.names_of("parameter"):
            given = getattr(self, name)
            number = None if given is None else to_float(given, values)
            if given is not None and number is None:
                return {}
            numbers[name] = number
        figures = self.figures(SimpleNamespace(**numbers, symbols=values))
        for port, shape in figures.items():
            if port not in self.frames or not isinstance(shape, Shape):
                what = "is no frame" if port not in self.frames else f"is {quoted(shape)}"
                raise DescriptionError(
                    f"{self.name}: figures has {port!r}, which {what}; give a Shape by the name of"
                    f" a frame: {', '.join(self.frames) or '(none)'}"
                )
        return figures

    @property
    def frames(self) -> Mapping[str, Point]:
        """Its points, by port."""
        return {name: getattr(self, name) for name in self.names_of("frame")}

    @property
    def points(self) -> tuple[Point, ...]:
        """Its points."""
        return tuple(self.frames.values())

    @property
    def coordinates(self) -> Mapping[str, tuple[tuple[str, Scalar], ...]]:
        """By port, the coordinates whose sum it is, each with its factor."""
        return {name: ((getattr(self, name), Number(1.0)),) for name in self.names_of("coordinate")}

    @property
    def shaft_ports(self) -> tuple[str, ...]:
        """The flanges that its methods ask for, by name."""
        return self.names_of("flange")

    @property
    def flanges(self) -> tuple[Flange, ...]:
        """All its flanges."""
        return tuple(getattr(self, name) for name in self.names_of("flange"))

    def slides(self, flange: Flange) -> bool | None:
        """Whether one of its flanges is a place on a slide; None where it may be either."""
        declared = {port_of_flange(name): name for name in self.names_of("flange")}
        unit = self.declared[declared[flange.port]].unit
        return None if unit == "1" else unit == "m"

    @property
    def own_inertia(self) -> Expression:
        """Inertia that it adds to its shaft [kg m^2], or mass to its slide [kg]."""
        return Number(0.0)

    @property
    def needs_position(self) -> bool:
        """Whether its coordinates must be positions, which those of a spherical joint are not."""
        return False

    @property
    def scope(self) -> str:
        """Where it counts, in words; nothing for a component of all models."""
        if not self.switches:
            return ""
        if self.has(*(method for method in _METHODS if method not in _SWITCHES)):
            return "; its frictions and stops in simulations, the other models leave them out"
        return ", in simulations; the other models leave it out"

    def scoped(self: C, prefix: str) -> C:
        """The same component inside a mechanism that is placed in another one."""
        inner = OnPoints.scoped(self, prefix)
        changed: dict[str, Any] = {
            name: f"{prefix}.{getattr(self, name)}" for name in self.names_of("coordinate")
        }
        return replace(inner, **changed) if changed else inner

    # What it does.

    def loads(self, at: Any) -> Mapping[str, Load]:
        """What it does to its ports, by their names: wrenches on frames, efforts on the others."""
        return {}

    def energy(self, at: Any) -> SX:
        """What it stores [J]."""
        return SX(0)

    def dissipation(self, at: Any) -> SX:
        """What it turns into heat [W]."""
        return SX(0)

    def rates(self, at: Any) -> Mapping[str, SX]:
        """The rate of every state, by its name."""
        return {}

    def rows(self, at: Any) -> Mapping[str, Row | SX]:
        """What must be zero, by label, of positions, unknowns and parameters."""
        return {}

    def positive(self, at: Any) -> Mapping[str, SX]:
        """What must be positive where the rows are zero, by label, such as a cosine."""
        return {}

    def velocity_rows(self, at: Any) -> Mapping[str, Row | SX]:
        """What must be zero, by label, linear in velocities."""
        return {}

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """The value of every output, by its name."""
        return {}

    def events(self, at: Any) -> Mapping[str, Event]:
        """What happens at once, by label: of positions, velocities, states, modes and inputs."""
        return {}

    def frictions(self, at: Any) -> Mapping[str, Friction]:
        """Its dry frictions, by label."""
        return {}

    def stops(self, at: Any) -> Mapping[str, Stop | OneWay]:
        """Its rigid stops and freewheels, by label."""
        return {}

    def limits(self, at: Any) -> Mapping[str, tuple[SX | None, SX | None]]:
        """Between which values its coordinates stay, by port; None for no limit on a side."""
        return {}

    def crossings(self, at: Any) -> Mapping[str, SX | Approach]:
        """What passes through zero where the law has a bend or is short, by label.

        It is of positions, velocities, states and parameters. A step of `mbs.simulate.run` ends
        there. An `Approach` says how fast the value can change.
        """
        return {}

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """What it looks like at its frames, by port; `at` has its parameters as numbers.

        Pictures show it. Values of parameters that nobody gave are NaN, and there is no picture.
        """
        return {}

    # What the assembly asks.

    def has(self, *methods: str) -> bool:
        """Whether the class says something by one of these methods."""
        return any(getattr(type(self), name) is not getattr(Custom, name) for name in methods)

    @property
    def has_equations(self) -> bool:
        """Whether anything is left of it in the models."""
        return not self.lowered and self.has(*_METHODS)

    @property
    def acts(self) -> bool:
        """Whether it puts loads on its ports."""
        return self.has("loads", "energy")

    @property
    def binds(self) -> bool:
        """Whether it has rows."""
        return self.has("rows", "velocity_rows")

    @property
    def switches(self) -> bool:
        """Whether it has frictions or stops, which hold at times and let go at others."""
        return self.has(*_SWITCHES)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Its states, modes among them."""
        return self.names_of("state", "mode")

    @property
    def input_names(self) -> tuple[str, ...]:
        """Its inputs."""
        return self.names_of("input")

    @property
    def output_names(self) -> tuple[str, ...]:
        """Its outputs."""
        return self.names_of("output")

    def _require_magnitudes(self, *names: str) -> None:
        """Refuse numbers below zero in these fields."""
        for name in names:
            given = getattr(self, name)
            for scalar in given if isinstance(given, tuple) else (given,):
                value = to_float(scalar)
                if value is not None and value < 0:
                    raise DescriptionError(f"{self.name}: {name} is {value:g}; give zero or more")

    def _require_positive(self, *names: str) -> None:
        """Refuse zero and numbers below it in these fields."""
        for name in names:
            value = to_float(getattr(self, name))
            if value is not None and value <= 0:
                raise DescriptionError(f"{self.name}: {name} is {value:g}; give more than zero")

    def _require_effect(self, *names: str) -> None:
        """Refuse an element all of whose strengths are zero."""
        values = [getattr(self, name) for name in names]
        flat = [v for value in values for v in (value if isinstance(value, tuple) else (value,))]
        if all(value == Number(0.0) for value in flat):
            raise DescriptionError(
                f"{self.name}: {' and '.join(names)} {'are' if len(names) > 1 else 'is'} zero, so"
                f" that the {type(self).__name__} does nothing; give a strength or leave it out"
            )


_SWITCHES = ("frictions", "stops")
"""What a component says of rows that come and go."""

_METHODS = ("loads", "energy", "rates", "rows", "velocity_rows", "outputs", *_SWITCHES)
"""What a component can say that models ask for."""

_RESERVED = frozenset({"name", "declared", "symbols", "lam", *vars(Custom)})
"""Names that a declaration must not take, since components or `at` have them already."""


def _make_fields(cls: type[Custom], own: Mapping[str, Declared]) -> None:
    """Turn what a class declares into fields of a frozen dataclass, and into handles."""
    if "__slots__" in vars(cls):
        raise DescriptionError(f"{cls.__name__}: it has __slots__; leave them out")
    annotations: dict[str, Any] = dict(inspect.get_annotations(cls))
    # fields with values, declared or not, in the order in which the class has them
    valued = {
        name: annotations.pop(name, Any) for name in vars(cls) if name in {*annotations, *own}
    }
    for name, what in own.items():
        if name in _RESERVED or name.startswith("_"):
            raise DescriptionError(
                f"{cls.__name__}: a {what.kind} cannot be named {name!r}; choose another name"
            )
        if what.kind not in _CHECKS:
            setattr(cls, name, _Handle(what.kind, name))
            valued.pop(name)
            continue
        valued[name] = Any
        if what.kind in ("state", "mode", "unknown") or (
            what.kind == "frame" and what.default is None
        ):
            setattr(cls, name, dataclass_field(default=what.default, kw_only=True))
        elif what.default is REQUIRED:
            delattr(cls, name)
        else:
            setattr(cls, name, what.default)
    if not any(what.kind in _CHECKS for what in own.values()):
        return
    cls.__annotations__ = annotations | valued
    try:
        dataclass(frozen=True)(cls)
    except TypeError as error:
        raise DescriptionError(
            f"{cls.__name__}: {error}; declare what has a default after what has none"
        ) from None


def _check_frame(component: Custom, name: str, what: Declared) -> None:
    if getattr(component, name) is not None or what.default is REQUIRED:
        component._take_point(name)


def _check_coordinate(component: Custom, name: str, what: Declared) -> None:
    given = getattr(component, name)
    if isinstance(given, Component) and not isinstance(given, OnPoints):
        given = given.name
    if not isinstance(given, str) or not given:
        raise DescriptionError(
            f"{component.name}: {name} is {quoted(given)}; give the name of a coordinate, such as"
            " 'j1' or 'slide.s'"
        )
    object.__setattr__(component, name, given)


def _check_parameter(component: Custom, name: str, what: Declared) -> None:
    if getattr(component, name) is None and what.default is None:
        return
    component._normalise(name)
    given = getattr(component, name)
    if isinstance(given, Parameter) and given.default is None and given.unit == "1":
        # a text says no unit: that of the declaration is meant
        object.__setattr__(component, name, replace(given, unit=what.unit))
    value = to_float(given)
    fault = "" if value is None else out_of_bounds(value, what.low, what.high)
    if fault:
        unit = "" if what.unit == "1" else f" {what.unit}"
        raise DescriptionError(f"{component.name}: {name} is {value:g}{unit}; {fault}")


def _check_number(component: Custom, name: str, what: Declared) -> None:
    object.__setattr__(
        component, name, finite(getattr(component, name), f"{component.name}, {name}")
    )


_CHECKS: Mapping[str, Callable[[Custom, str, Declared], None]] = {
    "frame": _check_frame,
    "coordinate": _check_coordinate,
    "parameter": _check_parameter,
    "state": _check_number,
    "mode": _check_number,
    "unknown": _check_number,
}
"""What is given to a component, by kind, and what refuses it."""

__all__ = [
    "Approach",
    "At",
    "CoordinateAt",
    "Custom",
    "Event",
    "FlangeAt",
    "FrameAt",
    "FrameLoad",
    "Friction",
    "OneWay",
    "RelativeMotion",
    "Row",
    "Signal",
    "Stop",
    "between",
    "coordinate",
    "flange",
    "force",
    "frame",
    "input",
    "mode",
    "output",
    "parameter",
    "pull",
    "regular_length",
    "state",
    "torque",
    "unknown",
]
