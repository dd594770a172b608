"""User-defined components: ports, parameters, states, inputs, outputs, and equations.

A class that derives from `Custom` declares its ports and quantities. Its methods return equations:

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

Each method gets an argument `at`. Each declared name is an attribute of `at`: a CasADi expression,
or the motion of a port. Assembling a mechanism checks the returned expressions and includes them in
all models. Force elements, drives and frictions of this package are written in the same way.
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
from mbs.expressions._expression import finite
from mbs.spatial import vector, zeros
from mbs.text import did_you_mean, quoted
from mbs.units import UNITS

# Declarations of ports and quantities in a component class.


EFFORT = "effort"
"""Unit of an effort along a coordinate: N m for a rotation, N for a displacement."""

REQUIRED: Any = object()
"""Default of a declaration that has no default: a value must be given."""


@dataclass(frozen=True, slots=True, eq=False)
class Declared:
    """Declaration of a port or a quantity of a component class.

    Attributes:
        kind: frame, flange, coordinate, parameter, state, mode, unknown, input or output.
        unit: unit of the value.
        default: default of a parameter or an input, initial value of a state or guess of an
            unknown.
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
    """Declare a port on a point of a body. In `at` it is a `FrameAt`.

    The constructor gets a body, `body.at(...)` or a frame of a joint for it.
    """
    return Declared("frame")


def flange(*, slides: bool | None = False) -> Any:
    """Declare a port on a shaft, connected by `m.connect(component.NAME, joint.flange)`.

    Args:
        slides: Whether the flange is on a prismatic joint, so that its position is in m. None if
            it may be on either kind of joint.
    """
    return Declared("flange", "1" if slides is None else "m" if slides else "rad")


def coordinate() -> Any:
    """Declare a port on a joint coordinate. In `at` it is a `CoordinateAt`.

    The constructor gets the name of the coordinate, such as "j1" or "slide.s".
    """
    return Declared("coordinate")


def parameter(
    unit: str = "1",
    default: Scalar | None = REQUIRED,
    *,
    min: float | None = None,
    max: float | None = None,
    positive: bool = False,
) -> Any:
    """Declare a parameter: a number, a text or an `mbs.Parameter`, symbolic if it has symbols.

    Args:
        unit: unit of the value.
        default: value if the constructor gets none. A parameter without default must be given. The
            default None makes the parameter optional: at.of_it is then None.
        min: least allowed value.
        max: greatest allowed value.
        positive: Whether only values above zero are allowed.
    """
    low = MORE_THAN_ZERO if positive and min is None else min
    return Declared("parameter", unit, default, low, max)


def state(unit: str = "1", *, start: float = 0.0, nominal: float = 1.0) -> Any:
    """Declare a state, whose rate the method `rates` returns. The constructor may get its start.

    Args:
        unit: unit of the value.
        start: initial value of a simulation, unless another is given.
        nominal: typical size, relative to which solvers measure errors.
    """
    return Declared("state", unit, start, nominal=nominal)


def mode(start: float = 0.0) -> Any:
    """Declare a discrete state: constant between events, such as 1 while a brake is locked.

    It is a state with rate zero, which `events` changes.

    Args:
        start: initial value of a simulation. The constructor may get another by the state's name.
    """
    return Declared("mode", "1", start)


def unknown(unit: str = "m", *, guess: float = 0.0) -> Any:
    """Declare a quantity that the constraint equations determine together with the configuration.

    It is a massless coordinate of the system, named NAME.of_it. Its rate is an element of v.

    Args:
        unit: "m" or "rad".
        guess: initial guess of its value when loops are closed.
    """
    if unit not in ("m", "rad"):
        raise DescriptionError(
            f"an unknown is declared with the unit {quoted(unit)}; use 'm' or 'rad'"
        )
    return Declared("unknown", unit, guess)


def input(unit: str = "1", *, default: float = 0.0) -> Any:
    """Declare an input signal, set by `run`, an FMU, an optimal control problem or `m.wire`.

    Args:
        unit: unit of the value.
        default: value if the input is not connected and not set.
    """
    return Declared("input", unit, default)


def output(unit: str = "1") -> Any:
    """Declare an output signal, whose value the method `outputs` returns: for results, FMUs, wires.

    Args:
        unit: unit of the value; `EFFORT` for N or N m, depending on the coordinate.
    """
    return Declared("output", unit)


@dataclass(frozen=True, slots=True)
class Signal:
    """An input or output of a component, as an argument of `Mechanism.connect_signal`.

    Attributes:
        owner: component that has the signal.
        name: name of the signal in the component.
        kind: "input" or "output".
    """

    owner: Component
    name: str
    kind: str

    def __str__(self) -> str:
        return f"{self.owner.name}.{self.name}"


@dataclass(frozen=True, slots=True)
class Flange:
    """An end of a shaft, which can be connected to other flanges.

    Attributes:
        owner: component that has the flange: a part of a drive line, or a joint.
        port: name of the flange in its owner, such as "a" or "b". Empty for a single flange.
    """

    owner: Component
    port: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """(component name, port): the unique key of the flange in a mechanism."""
        return self.owner.name, self.port

    def __str__(self) -> str:
        if self.port in ("", "a", "b"):
            return f"{self.owner.name}.flange{'_' if self.port else ''}{self.port}"
        return f"{self.owner.name}.{self.port}"


class _Handle:
    """Class attribute of a flange, an input or an output.

    On a component, such as `motor.voltage`, it returns a `Flange` or a `Signal`.
    """

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
    """Return the port of a flange name: "a" for "flange_a", "" for "flange", "sun" for "sun"."""
    return name.removeprefix("flange").removeprefix("_") if name.startswith("flange") else name


# Arguments of the component methods: motion of the ports, and values as expressions.


SHORTEST = 1e-12
"""Length [m] under the root of every norm, so that norms are differentiable at zero."""


def regular_length(x: SX) -> SX:
    """Return the length (1, 1) sqrt(x'x + 1e-24) of a column x, differentiable at x = 0."""
    return casadi.sqrt(casadi.dot(x, x) + SHORTEST**2)


@dataclass(frozen=True, eq=False)
class RelativeMotion:
    """Motion of a frame b relative to a frame a, in the axes of a.

    Attributes:
        p: (3, 1) position of the origin of b [m].
        R: (3, 3) orientation of b: its columns are the axes of b in axes of a.
        V: (3, 1) rate of p, seen by an observer on a [m/s].
        w: (3, 1) angular velocity of b relative to a [rad/s].
    """

    p: SX
    R: SX
    V: SX
    w: SX

    @cached_property
    def length(self) -> SX:
        """Distance sqrt(p'p + 1e-24) of the origins [m], differentiable at zero."""
        return regular_length(self.p)

    @cached_property
    def along(self) -> SX:
        """Unit vector (3, 1) from the origin of a to that of b, in axes of a. Zero if p is zero."""
        return self.p / self.length

    @cached_property
    def rate(self) -> SX:
        """Rate of the distance of the origins [m/s], positive if they separate."""
        return casadi.dot(self.along, self.V)


class FrameAt:
    """Pose and velocity of a frame of a component.

    Attributes:
        port: name of the frame in the component.
        p: (3, 1) position of the origin in the world [m].
        R: (3, 3) orientation in the world.
        v: (3, 1) velocity of the origin, in axes of the world [m/s].
        w: (3, 1) angular velocity, in axes of the world [rad/s].
    """

    def __init__(self, port: str, seen_from: Callable[[FrameAt | None], RelativeMotion]) -> None:
        self.port = port
        self._seen_from = seen_from

    @cached_property
    def _in_world(self) -> RelativeMotion:
        """Motion of the frame relative to the world, in axes of the world."""
        return self._seen_from(None)

    @property
    def p(self) -> SX:
        """(3, 1) position of the origin in the world [m]."""
        return self._in_world.p

    @property
    def R(self) -> SX:
        """(3, 3) orientation in the world; columns are the axes of the frame in world axes."""
        return self._in_world.R

    @property
    def v(self) -> SX:
        """(3, 1) velocity of the origin, in axes of the world [m/s]."""
        return self._in_world.V

    @property
    def w(self) -> SX:
        """(3, 1) angular velocity relative to the world, in axes of the world [rad/s]."""
        return self._in_world.w

    def to(self, other: FrameAt) -> RelativeMotion:
        """Return the motion of another frame relative to this frame, in axes of this frame.

        Args:
            other: second frame of the component.
        """
        return other._seen_from(self)


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateAt:
    """Position and rate of a joint coordinate, or of a weighted sum of coordinates.

    Attributes:
        q: position [rad or m]. None for rates without a position, as of a spherical joint.
        v: rate [rad/s or m/s].
        unit: unit of the position. For a sum, the unit of its first coordinate.
    """

    q: SX | None
    v: SX
    unit: str = "rad"


@dataclass(frozen=True, slots=True, eq=False)
class FlangeAt:
    """Position and rate of a flange.

    Attributes:
        angle: angle of the shaft [rad], or position of a sliding flange [m].
        speed: rate of `angle` [rad/s or m/s].
    """

    angle: SX
    speed: SX

    @property
    def position(self) -> SX:
        """`angle` of a sliding flange: its position [m]."""
        return self.angle


class At:
    """Argument of the methods of a component: values in the current state, as attributes.

    Each declared name is an attribute. Frames are `FrameAt`, flanges `FlangeAt`, coordinates
    `CoordinateAt`. Parameters, states, inputs and unknowns are (1, 1) expressions. In `outputs`,
    `lam` has the constraint effort of each row by label. A positive effort acts towards an increase
    of the value of the row. `symbols` has the symbol of each parameter of the mechanism by name.
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


# Results of the component methods.


@dataclass(frozen=True, slots=True, eq=False)
class FrameLoad:
    """Wrench that a component exerts ON the body of a frame.

    Attributes:
        force: (3, 1) force at the origin of the frame [N].
        moment: (3, 1) moment about the origin of the frame [N m].
        own_axes: Whether force and moment are in axes of the frame, instead of world axes.
    """

    force: SX
    moment: SX
    own_axes: bool = False


def force(value: Any, *, own_axes: bool = False) -> FrameLoad:
    """Return the load of a force on the origin of a frame, in axes of the world or of the frame.

    Args:
        value: (3, 1) force [N], or a list of three numbers and expressions.
        own_axes: Whether the force is in the axes of the frame.
    """
    return FrameLoad(_column(value), zeros(), own_axes)


def torque(value: Any, *, own_axes: bool = False) -> FrameLoad:
    """Return the load of a torque ON a frame, in axes of the world or of the frame.

    Args:
        value: (3, 1) torque [N m], or a list of three numbers and expressions.
        own_axes: Whether the torque is in the axes of the frame.
    """
    return FrameLoad(zeros(), _column(value), own_axes)


def _column(value: Any) -> SX:
    """Return a column (k, 1), given as an expression or as a list of numbers and expressions."""
    return vector(value) if isinstance(value, (list, tuple)) else SX(value)


def between(
    a: FrameAt, b: FrameAt, on_a: FrameLoad, moment_b: SX | None = None
) -> dict[str, FrameLoad]:
    """Return the loads of a wrench ON frame a and of the opposite force ON frame b, by port.

    Both loads are in axes of their own frames. The force on b acts at the origin of b.

    Args:
        a: frame of the component.
        b: second frame of the component.
        on_a: force and moment ON a, about its origin, in the axes of a.
        moment_b: (3, 1) moment ON b about its origin, in the axes of a. Zero if left out.
    """
    R = a.to(b).R
    turned = zeros() if moment_b is None else moment_b
    opposite = casadi.mtimes(R.T, -on_a.force), casadi.mtimes(R.T, turned)
    return {a.port: replace(on_a, own_axes=True), b.port: FrameLoad(*opposite, own_axes=True)}


def pull(a: FrameAt, b: FrameAt, tension: SX) -> dict[str, FrameLoad]:
    """Return the forces that a tension exerts ON two points, each towards the other, by port.

    Each force acts at the origin of its frame and is in its own axes.

    Args:
        a: frame of the component.
        b: second frame of the component.
        tension: (1, 1) tension [N]; a negative tension pushes the points apart.
    """
    return between(a, b, FrameLoad(a.to(b).along * tension, zeros()))


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """Constraint equation: a value that must be zero.

    Attributes:
        value: (1, 1).
        unit: "m" for a length, "1" for a dimensionless value such as a cosine or an angle.
    """

    value: SX
    unit: str = "m"


@dataclass(frozen=True, slots=True, eq=False)
class Approach:
    """Event indicator with a known bound of its rate, such as the distance of two bodies.

    Simulations evaluate it often enough within a step that it cannot fall to zero and rise again
    between two evaluations. They skip evaluations while the bound keeps it above zero.

    Source: Mirtich 1996 for the bound of the time until two bodies touch.

    Attributes:
        value: (1, 1) event indicator, whose zeros are located.
        speed: (1, 1) bound of its rate for motion at the present speed in any direction. None
            if no bound is known.
        pace: (1, 1) reciprocal of the shortest time in which it falls to zero and rises again
            [1/s], such as the speed over the size of an obstacle.
    """

    value: SX
    speed: SX | None
    pace: SX


@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """Event that changes states and modes of a component instantly.

    Attributes:
        when: (1, 1) event indicator, positive before the event. The event occurs when it stops
            being positive. Afterwards `when` must be positive again, or rise from zero.
        then: new values of states and modes of the component, by name.
    """

    when: SX
    then: Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Friction:
    """Dry friction: it sticks up to a largest effort and slides beyond it.

    The slip velocity is linear in velocities, with factors of positions and parameters. Its value
    at rest, such as the speed of a belt, depends on parameters only. The efforts on the ports
    follow from virtual work along the slip velocity.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        slip: (1, 1) slip velocity [rad/s or m/s].
        limit: (1, 1) friction effort during sliding, at least zero [N m or N]. A function of
            positions, velocities, states, inputs and parameters.
        sticking: (1, 1) largest effort during sticking, at least the limit, which is the default
            [N m or N].
        unit: unit of the effort, "N" or "N.m". The default is the unit of the coordinate or shaft
            of the component, and "N" if it has frames.
    """

    slip: Any
    limit: Any
    sticking: Any = None
    unit: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """Rigid stop: a distance or angle that stays between limits, with impacts and contact.

    Source: Pfeiffer and Glocker 1996, chapters 4 and 6.

    Attributes:
        gap: (1, 1) distance or angle [rad or m], a function of positions and parameters.
        lower: least gap, a function of parameters. None for no stop on that side.
        upper: greatest gap, a function of parameters. None for no stop on that side.
        restitution: Newton's coefficient, between 0 and 1, a function of parameters.
        rest_speed: speed of the slowest rebound [rad/s or m/s], a function of parameters.
        unit: unit of the effort, with the same default as in `Friction`.
    """

    gap: Any
    lower: Any = 0.0
    upper: Any = None
    restitution: Any = 0.0
    rest_speed: Any = 1e-4
    unit: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class OneWay:
    """Freewheel: a velocity that never falls below zero.

    Attributes:
        velocity: (1, 1) linear in velocities, as the slip of a `Friction` [rad/s or m/s].
        unit: unit of the effort, with the same default as in `Friction`.
    """

    velocity: Any
    unit: str | None = None


Load = FrameLoad | SX | float
"""Load ON a port: wrench on a frame, or force [N] or torque [N m] on a coordinate or flange."""

C = TypeVar("C", bound="Custom")


@dataclass(frozen=True, slots=True)
class Custom(OnPoints):
    """Base of user-defined components: a subclass declares ports and quantities, with methods.

    Methods that a subclass may define:

    - `loads(at)`: loads that the component exerts ON its ports, by port. If only `energy` is
      defined, the loads are the negative derivatives of the energy.
    - `energy(at)`: stored energy [J], a function of positions and states. Inputs count as
      constants.
    - `dissipation(at)`: dissipated power [W], never negative.
    - `rates(at)`: time derivative of every state, by name.
    - `rows(at)`: constraint equations on positions, unknowns and parameters, by label, each a
      `Row`.
    - `positive(at)`: expressions by label. Among the configurations at which the rows are zero, the
      intended configurations are those with positive values.
    - `velocity_rows(at)`: constraint equations linear in velocities, by label.
    - `outputs(at)`: value of every output, by name.
    - `events(at)`: instant changes of states and modes, an `Event` each, by label. They apply to
      simulations and FMUs.
    - `frictions(at)`: dry frictions, a `Friction` each, by label, for simulations and FMUs.
    - `stops(at)`: rigid stops and freewheels, a `Stop` or `OneWay` each, by label, for simulations
      and FMUs.
    - `limits(at)`: pair (lower, upper) of limits of each coordinate [rad or m], by port.
    - `figures(at)`: shapes that pictures show at its frames, a `Shape` of numbers each, by port.
    - `crossings(at)`: event indicators at which simulations end a step, by label: zero at a kink of
      the law. An `Approach` is for a law that acts only briefly, such as a contact.

    Source: Haug 1989 for forces, rows and the work that they do.

    Attributes:
        name: unique name in the mechanism.
    """

    declared: ClassVar[Mapping[str, Declared]] = {}
    """Declarations of the class and its bases, by name."""

    drives: ClassVar[bool] = False
    """Whether it is a motor on its flange: its torque is part of the efforts tau of models."""

    fixed: ClassVar[bool] = False
    """Whether its flanges are at rest."""

    shape: ClassVar[str] = "bar"
    """Form of the line through its points in pictures: "bar", "coil", or "" for none."""

    lowered: ClassVar[bool] = False
    """Whether assembling replaces it completely by joints and couplings."""

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
        """Raise DescriptionError if the class skipped the `__post_init__` of Custom."""
        for name in self.names_of("frame", "parameter"):
            given = getattr(self, name)
            if given is not None and not isinstance(given, (Point, Expression)):
                raise DescriptionError(
                    f"{self.name}: {type(self).__name__}.__post_init__ leaves {name!r} unchecked;"
                    " let it call Custom.__post_init__(self) first"
                )

    # Ports.

    def names_of(self, *kinds: str) -> tuple[str, ...]:
        """Return the names of the declarations of some kinds, in the order of the class.

        Args:
            kinds: kinds of declarations, such as "state" or "parameter", see `Declared`.
        """
        return tuple(name for name, what in self.declared.items() if what.kind in kinds)

    def drawn(self, values: Mapping[str, float]) -> Mapping[str, Shape]:
        """Return the shapes that pictures show, by frame port; empty if a parameter has no value.

        Args:
            values: value of each symbol, by name.

        Raises:
            DescriptionError: an entry of `figures` is no Shape, or its port is no frame.
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
        """Attachment points of the component, by the name of the port."""
        return {name: getattr(self, name) for name in self.names_of("frame")}

    @property
    def points(self) -> tuple[Point, ...]:
        """Attachment points of the component, in the order of `frames`."""
        return tuple(self.frames.values())

    @property
    def coordinates(self) -> Mapping[str, tuple[tuple[str, Scalar], ...]]:
        """Pairs (coordinate name, factor) by port: a port is the sum of factor times coordinate.

        A declared coordinate has the single pair (name, 1).
        """
        return {name: ((getattr(self, name), Number(1.0)),) for name in self.names_of("coordinate")}

    @property
    def shaft_ports(self) -> tuple[str, ...]:
        """Names of the flanges that are attributes of `at`: all declared flanges."""
        return self.names_of("flange")

    @property
    def flanges(self) -> tuple[Flange, ...]:
        """All declared flanges of the component, as `Flange` objects to connect."""
        return tuple(getattr(self, name) for name in self.names_of("flange"))

    def slides(self, flange: Flange) -> bool | None:
        """Return whether the position of a flange is in m (True) or rad (False).

        None if both are allowed.
        """
        declared = {port_of_flange(name): name for name in self.names_of("flange")}
        unit = self.declared[declared[flange.port]].unit
        return None if unit == "1" else unit == "m"

    @property
    def own_inertia(self) -> Expression:
        """Inertia that the assembly adds to the shaft [kg m^2], or mass of a sliding part [kg].

        It is zero by default.
        """
        return Number(0.0)

    @property
    def needs_position(self) -> bool:
        """Whether `at` must have positions of its coordinates. If False, rates suffice.

        A coordinate of a spherical joint has a rate but no position.
        """
        return False

    @property
    def scope(self) -> str:
        """End of the message that reports the component: the models that contain it.

        Empty if all models contain it.
        """
        if not self.switches:
            return ""
        if self.has(*(method for method in _METHODS if method not in _SWITCHES)):
            return "; its frictions and stops in simulations, the other models leave them out"
        return ", in simulations; the other models leave it out"

    def scoped(self: C, prefix: str) -> C:
        """Return a copy whose name, parameters, points and coordinates start with "`prefix`.".

        Args:
            prefix: text before the names, without the dot.
        """
        inner = OnPoints.scoped(self, prefix)
        changed: dict[str, Any] = {
            name: f"{prefix}.{getattr(self, name)}" for name in self.names_of("coordinate")
        }
        return replace(inner, **changed) if changed else inner

    # Equations of the component.

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the loads that the component exerts ON its ports, by port.

        A load is a `FrameLoad` on a frame, or an effort along a coordinate or flange [N or N m].
        Ports without an entry get no load.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def energy(self, at: At) -> SX:
        """Return the stored energy (1, 1) [J], zero by default.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(0)

    def dissipation(self, at: At) -> SX:
        """Return the dissipated power (1, 1) [W], zero by default.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(0)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return the time derivative of each state, by state name.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def rows(self, at: At) -> Mapping[str, Row | SX]:
        """Return position constraints by label: values that must be zero, in m or as a `Row`.

        They depend on positions, unknowns and parameters.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def positive(self, at: At) -> Mapping[str, SX]:
        """Return expressions by label that are positive at the intended configurations only.

        The rows of a loop also have solutions with opposed axes. Loop closure takes a solution at
        which all these expressions are positive.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def velocity_rows(self, at: At) -> Mapping[str, Row | SX]:
        """Return velocity constraints by label: values, linear in velocities, that must be zero.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return the value of each output, by output name.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def events(self, at: At) -> Mapping[str, Event]:
        """Return the events by label, each with an indicator and new values of states or modes.

        They depend on positions, velocities, states, modes and inputs.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def frictions(self, at: At) -> Mapping[str, Friction]:
        """Return dry frictions with sticking by label. A single friction may have the label "".

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def stops(self, at: At) -> Mapping[str, Stop | OneWay]:
        """Return rigid stops and freewheels by label. A single element may have the label "".

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def limits(self, at: At) -> Mapping[str, tuple[SX | None, SX | None]]:
        """Return limits (lower, upper) of its coordinates, by port [rad or m].

        None for no limit.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def crossings(self, at: At) -> Mapping[str, SX | Approach]:
        """Return event indicators by label, which change sign where a law is not smooth.

        An indicator depends on positions, velocities, states and parameters. A step of
        `mbs.simulate.run` ends at its zero. An `Approach` also has a bound of its rate, for laws
        that act only briefly.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {}

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return shapes that pictures show, by frame port; empty by default.

        The component is not drawn if a parameter has no value.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        return {}

    # Properties that the assembly uses.

    def has(self, *methods: str) -> bool:
        """Return whether the class overrides one of the methods of Custom with these names."""
        return any(getattr(type(self), name) is not getattr(Custom, name) for name in methods)

    @property
    def has_equations(self) -> bool:
        """Whether the component contributes loads, states, rows, outputs, frictions or stops.

        False if the assembly replaces it by joints and couplings (`lowered`).
        """
        return not self.lowered and self.has(*_METHODS)

    @property
    def acts(self) -> bool:
        """Whether the component exerts loads on its ports: it has `loads` or `energy`."""
        return self.has("loads", "energy")

    @property
    def binds(self) -> bool:
        """Whether the component has constraint rows on positions or velocities."""
        return self.has("rows", "velocity_rows")

    @property
    def switches(self) -> bool:
        """Whether it has frictions, stops or freewheels, which constrain the motion at times."""
        return self.has(*_SWITCHES)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the declared states and modes, in class order."""
        return self.names_of("state", "mode")

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the declared inputs, in class order."""
        return self.names_of("input")

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the declared outputs, in class order."""
        return self.names_of("output")

    def _require_magnitudes(self, *names: str) -> None:
        """Raise DescriptionError if a number in the fields `names` is below zero; symbols pass."""
        for name in names:
            given = getattr(self, name)
            for scalar in given if isinstance(given, tuple) else (given,):
                value = to_float(scalar)
                if value is not None and value < 0:
                    raise DescriptionError(f"{self.name}: {name} is {value:g}; give zero or more")

    def _require_positive(self, *names: str) -> None:
        """Raise DescriptionError if a number in the fields `names` is zero or less.

        Symbols pass.
        """
        for name in names:
            value = to_float(getattr(self, name))
            if value is not None and value <= 0:
                raise DescriptionError(f"{self.name}: {name} is {value:g}; give more than zero")

    def _require_effect(self, *names: str) -> None:
        """Raise DescriptionError if all the fields `names` are zero, so that it does nothing."""
        values = [getattr(self, name) for name in names]
        flat = [v for value in values for v in (value if isinstance(value, tuple) else (value,))]
        if all(value == Number(0.0) for value in flat):
            raise DescriptionError(
                f"{self.name}: {' and '.join(names)} {'are' if len(names) > 1 else 'is'} zero, so"
                f" that the {type(self).__name__} does nothing; give a strength or leave it out"
            )


_SWITCHES = ("frictions", "stops")
"""Methods that return constraints which are active only at times."""

_METHODS = ("loads", "energy", "rates", "rows", "velocity_rows", "outputs", *_SWITCHES)
"""Methods whose results become equations of the models."""

_RESERVED = frozenset({"name", "declared", "symbols", "lam", *vars(Custom)})
"""Names that a declaration must not have, since components or `at` use them."""


def _make_fields(cls: type[Custom], own: Mapping[str, Declared]) -> None:
    """Replace declarations `own` of a class by dataclass fields and signal handles, in place.

    Raise DescriptionError for an invalid name, `__slots__`, or a wrong order of defaults.
    """
    if "__slots__" in vars(cls):
        raise DescriptionError(f"{cls.__name__}: it has __slots__; leave them out")
    annotations: dict[str, Any] = dict(inspect.get_annotations(cls))
    # fields that have values, declared or not, in the order of the class body
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
    """Replace the field `name` of a component, a body or a point, by a point, in place.

    None stays if it is the default of the declaration `what`. Raise DescriptionError for other
    values.
    """
    if getattr(component, name) is not None or what.default is REQUIRED:
        component._take_point(name)


def _check_coordinate(component: Custom, name: str, what: Declared) -> None:
    """Replace the field `name`, a joint or a coordinate name, by a coordinate name, in place.

    Raise DescriptionError for other values.
    """
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
    """Convert the field `name` of a component to an expression, in place.

    Raise DescriptionError if it is a number outside the bounds of its declaration `what`.
    """
    if getattr(component, name) is None and what.default is None:
        return
    component._normalise(name)
    given = getattr(component, name)
    if isinstance(given, Parameter) and given.default is None and given.unit == "1":
        # a text specifies no unit: it has the unit of the declaration
        object.__setattr__(component, name, replace(given, unit=what.unit))
    value = to_float(given)
    fault = "" if value is None else out_of_bounds(value, what.low, what.high)
    if fault:
        unit = "" if what.unit == "1" else f" {what.unit}"
        raise DescriptionError(f"{component.name}: {name} is {value:g}{unit}; {fault}")


def _check_number(component: Custom, name: str, what: Declared) -> None:
    """Convert the field `name` of a component to a finite float, in place.

    Raise ExpressionError for other values.
    """
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
"""Check of a constructor argument, by kind of its declaration."""

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
