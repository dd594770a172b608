"""Base of all components: names, points to connect, placements and axes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from decimal import Decimal
from functools import wraps
from inspect import signature
from typing import Any, TypeVar

import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.errors import ArgumentError, DescriptionError
from mbs.expressions import (
    Expression,
    Number,
    Scalar,
    expression,
    operation,
    parameters_of,
    renamed,
    to_float,
    to_sx,
    with_values,
    without_defaults,
)
from mbs.spatial import Khalil, Pose, align_z, nearest_rotation, unit_vector, vector
from mbs.text import did_you_mean, listed, quoted, seen

# Placements of points on a component: chains of displacements, stored as data.
#
# A placement is read from left to right: each step starts at the frame of the step before.


SymbolTable = Mapping[str, SX]
"""CasADi symbol of every parameter, by name."""

_DIGITS = 11
"""Significant digits from which a number is recognised as a rounded multiple of pi/2."""

_WRITTEN = 6e-12
"""Largest deviation of the usual texts 1.5707963268 and 1.57079632679 from pi/2 [rad]."""


@dataclass(frozen=True, slots=True)
class Translation:
    """A displacement by (x, y, z) [m] along the axes of the previous frame."""

    x: Expression
    y: Expression
    z: Expression

    def pose(self, symbols: SymbolTable) -> Pose:
        """Return the pose of the displaced frame relative to the previous frame.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        return Pose.translation(vector(to_sx(value, symbols) for value in (self.x, self.y, self.z)))


@dataclass(frozen=True, slots=True)
class ElementaryRotation:
    """A rotation by `angle` [rad] about the axis "x", "y" or "z" of the previous frame."""

    axis: str
    angle: Expression

    def pose(self, symbols: SymbolTable) -> Pose:
        """Return the pose of the rotated frame relative to the previous frame.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        return Pose.about(self.axis, to_sx(self.angle, symbols))


@dataclass(frozen=True, slots=True)
class FixedRotation:
    """A rotation by a numeric matrix, as rows. Its columns are the new axes in the old frame."""

    rows: tuple[tuple[float, float, float], ...]

    def pose(self, symbols: SymbolTable) -> Pose:
        """Return the pose of the rotated frame relative to the previous frame.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        return Pose.rotation(SX(DM(self.rows)))


@dataclass(frozen=True, slots=True)
class KhalilStep:
    """Khalil parameters of a frame j relative to its antecedent, as expressions."""

    gamma: Expression
    b: Expression
    alpha: Expression
    d: Expression
    theta: Expression
    r: Expression

    def khalil(self, symbols: SymbolTable) -> Khalil:
        """Return the six parameters as CasADi expressions.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        return Khalil(*(to_sx(getattr(self, f.name), symbols) for f in fields(self)))

    def pose(self, symbols: SymbolTable) -> Pose:
        """Return the pose of frame j relative to its antecedent.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        return self.khalil(symbols).pose()


Step = Translation | ElementaryRotation | FixedRotation | KhalilStep


@dataclass(frozen=True, slots=True)
class Placement:
    """A chain of displacements; empty for no displacement."""

    steps: tuple[Step, ...] = ()

    def pose(self, symbols: SymbolTable) -> Pose:
        """Return the pose of the placed frame relative to the start of the chain.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        pose = Pose.identity()
        for step in self.steps:
            pose = pose @ step.pose(symbols)
        return pose

    def then(self, *steps: Step) -> Placement:
        """Return the placement followed by further steps."""
        return Placement(self.steps + steps)

    def inverse(self) -> Placement:
        """Return the inverse placement: the start of the chain relative to its end.

        The steps must be translations and rotations.
        """
        return Placement(tuple(_inverse(step) for step in reversed(self.steps)))

    def expressions(self) -> Iterator[Expression]:
        """Yield every scalar expression in the steps, such as lengths [m] and angles [rad]."""
        for step in self.steps:
            for f in fields(step):
                value = getattr(step, f.name)
                if isinstance(value, Expression):
                    yield value

    def scoped(self, prefix: str) -> Placement:
        """Return a copy whose parameters have the prefix "`prefix`.".

        Args:
            prefix: text before the names, without the dot.
        """
        return Placement(tuple(_scoped(step, prefix) for step in self.steps))


def _inverse(step: Step) -> Step:
    """Return the inverse of a translation or a rotation."""
    if isinstance(step, Translation):
        return Translation(*(operation("negate", value) for value in (step.x, step.y, step.z)))
    if isinstance(step, ElementaryRotation):
        return ElementaryRotation(step.axis, operation("negate", step.angle))
    assert isinstance(step, FixedRotation)
    a, b, c = zip(*step.rows, strict=True)
    return FixedRotation((a, b, c))


def _scoped(step: Step, prefix: str) -> Step:
    """Return a copy of a step whose parameters have the prefix "`prefix`."."""
    changed: dict[str, Any] = {}
    for f in fields(step):
        value = getattr(step, f.name)
        if isinstance(value, Expression):
            changed[f.name] = renamed(value, prefix)
    return replace(step, **changed)


Rotation = tuple[str, Scalar] | Sequence[tuple[str, Scalar]] | Sequence[Sequence[float]]
"""Rotation ("z", "pi/2 + A"), a sequence of such rotations, or a (3, 3) matrix."""


def displacement(
    where: str, x: Scalar, y: Scalar, z: Scalar, rotation: Rotation | None
) -> tuple[Step, ...]:
    """Return the steps of a translation by (x, y, z), then a rotation.

    Zero translations and a rotation of None have no step.

    Args:
        where: name of the frame in error messages.
        x: translation along x [m].
        y: translation along y [m].
        z: translation along z [m].
        rotation: rotation, or None.

    Raises:
        DescriptionError: the rotation has no valid form.
    """
    values = [
        expression(value, f"{where}, {name}") for name, value in zip("xyz", (x, y, z), strict=True)
    ]
    steps: list[Step] = []
    if any(str(value) != "0" for value in values):
        steps.append(Translation(*values))
    if rotation is not None:
        steps.extend(_rotation_steps(where, rotation))
    return tuple(steps)


def in_rotated_axes(
    vector: Sequence[Expression], rotation: Rotation, where: str
) -> tuple[Expression, ...]:
    """Return the components of a vector (3,) in rotated axes.

    Args:
        vector: components in the axes before the rotation.
        rotation: rotation of the new axes relative to the old axes.
        where: name of the rotation in error messages.

    Raises:
        DescriptionError: the value is no rotation.
    """
    for step in _rotation_steps(where, rotation):
        if isinstance(step, FixedRotation):
            columns = zip(*step.rows, strict=True)
            vector = [_sum(zip(column, vector, strict=True)) for column in columns]
        elif isinstance(step, ElementaryRotation):
            k = "xyz".index(step.axis)
            i, j = (k + 1) % 3, (k + 2) % 3
            c, s = operation("cos", step.angle), operation("sin", step.angle)
            rotated = list(vector)
            rotated[i] = _sum(((c, vector[i]), (s, vector[j])))
            rotated[j] = _sum(((c, vector[j]), (-s, vector[i])))
            vector = rotated
    return tuple(vector)


def _sum(products: Iterable[tuple[Scalar, Expression]]) -> Expression:
    """Return the sum of the products factor times value of the pairs.

    Zero products are left out.
    """
    total: Expression = Number(0.0)
    for factor, value in products:
        if 0 in (to_float(factor), to_float(value)):
            continue
        product = value if to_float(factor) == 1 else factor * value
        total = product if to_float(total) == 0 else total + product
    return total


def _rotation_steps(where: str, rotation: Any) -> Iterable[Step]:
    """Return the steps of a rotation in any form of `Rotation`; raise DescriptionError for others.

    `where` is its name in the message.
    """
    if _is_turn(rotation):
        return [_elementary_rotation(where, *rotation)]
    if isinstance(rotation, (list, tuple)) and all(map(_is_turn, rotation)):
        return [_elementary_rotation(where, *part) for part in rotation]
    try:
        R = np.asarray(rotation, dtype=float)
    except (TypeError, ValueError):
        R = np.zeros(0)
    # tolerance for cosines with six digits in files; the nearest rotation is stored
    if R.shape != (3, 3) or not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0:
        raise DescriptionError(
            f"{where}: rotation {quoted(rotation)} is not a rotation; give ('z', angle), a sequence"
            " of such rotations, or an orthonormal right-handed (3, 3) matrix"
        )
    return [FixedRotation(nearest_rotation(R.tolist()))]


def _is_turn(part: Any) -> bool:
    """Return whether a value is a pair (axis letter, angle) that describes a rotation."""
    return isinstance(part, (list, tuple)) and len(part) == 2 and isinstance(part[0], str)


def _elementary_rotation(where: str, axis: str, angle: Scalar) -> ElementaryRotation:
    """Return the rotation by `angle` [rad] about an axis "x", "y" or "z".

    Raise DescriptionError for other axes. `where` is its name in the message.
    """
    if axis not in ("x", "y", "z"):
        raise DescriptionError(f"{where}: rotation axis {axis!r} is not 'x', 'y' or 'z'; use one")
    return ElementaryRotation(axis, angle_expression(angle, f"{where}, rotation about {axis}"))


def angle_expression(angle: Scalar, where: str) -> Expression:
    """Return an angle [rad] as an expression; 1.57079632679 and longer become exactly pi/2.

    A file with 1.57079632679 means pi/2. A deviation of 5e-12 would be an unintended tilt, which
    adds operations to every model. Multiples of pi/2 are treated in the same way. Numbers with
    fewer digits stay unchanged.

    Args:
        angle: number, text or expression.
        where: name of the angle in error messages.
    """
    value = expression(angle, where)
    if not isinstance(value, Number):
        return value
    meant = round(value.value / (math.pi / 2)) * math.pi / 2
    if not 0 < abs(value.value - meant) <= _WRITTEN:
        return value
    written = Decimal(repr(value.value)).as_tuple()
    assert isinstance(written.exponent, int)
    if meant == 0 or len(written.digits) < _DIGITS:
        return value
    last_digit = 10.0**written.exponent
    return Number(meant) if abs(value.value - meant) < last_digit else value


_NAME = re.compile(r"[^\s.'\"]+(?:\.[^\s.'\"]+)*")
_NOT_IN_NAMES = re.compile(r"[\s.'\"]+")
_LONGEST_NAME = 80
"""Maximum length of a name from a file, equal to the length that messages quote."""


@dataclass(frozen=True, slots=True)
class Point:
    """A frame fixed on a component, to which another component can be connected.

    Attributes:
        owner: component that carries the frame.
        port: frame of the owner at which the placement starts ("" for the reference frame of a
            body; "a" or "b" for a joint).
        placement: placement of the frame relative to the port.
    """

    owner: Component
    port: str = ""
    placement: Placement = field(default_factory=Placement)

    def at(
        self, x: Scalar = 0, y: Scalar = 0, z: Scalar = 0, *, rotation: Rotation | None = None
    ) -> Point:
        """Return a frame that is displaced relative to this frame.

        Args:
            x: origin of the new frame along x of this frame [m].
            y: origin along y [m].
            z: origin along z [m].
            rotation: rotation of its axes relative to this frame; none by default.
        """
        steps = displacement(f"{self.owner.name}.at", x, y, z, rotation)
        return replace(self, placement=self.placement.then(*steps))

    def at_khalil(
        self,
        gamma: Scalar = 0,
        b: Scalar = 0,
        alpha: Scalar = 0,
        d: Scalar = 0,
        theta: Scalar = 0,
        r: Scalar = 0,
    ) -> Point:
        """Return a frame that is placed by Khalil parameters relative to this frame.

        The placement is Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r).

        Source: Khalil & Kleinfinger 1986.

        Args:
            gamma: angle about z to the common perpendicular [rad].
            b: distance along z to the common perpendicular [m].
            alpha: angle between the z axes, about the common perpendicular [rad].
            d: distance of the z axes, along the common perpendicular [m].
            theta: angle about the new z axis [rad].
            r: distance along the new z axis [m].
        """
        where = f"{self.owner.name}.at_khalil"
        values = (gamma, b, alpha, d, theta, r)
        names = ("gamma", "b", "alpha", "d", "theta", "r")
        readers: Sequence[Callable[[Scalar, str], Expression]] = (angle_expression, expression) * 3
        step = KhalilStep(
            *(r(v, f"{where}, {n}") for r, n, v in zip(readers, names, values, strict=True))
        )
        return replace(self, placement=self.placement.then(step))


C = TypeVar("C", bound="Component")


# Checks of constructor arguments.


def check_arguments(cls: type) -> None:
    """Make the constructor of a class raise ArgumentError for wrong arguments, in place.

    The error lists unknown, missing, surplus and repeated arguments.

    Args:
        cls: class; only an `__init__` of its own is replaced.
    """
    own = vars(cls).get("__init__")
    if own is None or hasattr(own, "__wrapped__"):
        return
    setattr(cls, "__init__", _with_checked_arguments(own))  # noqa: B010


def _with_checked_arguments(init: Callable[..., None]) -> Callable[..., None]:
    """Return a constructor that calls `init` and raises ArgumentError for wrong arguments."""

    @wraps(init)
    def checked(self: Any, *args: Any, **kwargs: Any) -> None:
        try:
            init(self, *args, **kwargs)
        except TypeError:
            fault = _wrong_arguments(init, args, kwargs)
            if not fault:
                raise
            name = kwargs.get("name", args[0] if args else "")
            title = (
                f"{type(self).__name__} {name}" if isinstance(name, str) else type(self).__name__
            )
            raise ArgumentError(f"{title.strip()}: {fault}") from None

    return checked


def _wrong_arguments(
    init: Callable[..., None], args: Sequence[Any], kwargs: Mapping[str, Any]
) -> str:
    """Return the fault of the arguments of the constructor `init`, as error text.

    It is empty if `args` and `kwargs` fit its signature.
    """
    known = list(signature(init).parameters.values())[1:]
    if any(one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD) for one in known):
        return ""
    names = [one.name for one in known]
    for name in kwargs:
        if name not in names:
            return f"there is no argument {name!r}; {did_you_mean(name, names)}"
    in_order = [one.name for one in known if one.kind is not one.KEYWORD_ONLY]
    if len(args) > len(in_order):
        return (
            f"{len(args)} arguments without a name are given, and {len(in_order)} are possible:"
            f" {', '.join(in_order)}; give the others by name"
        )
    given = {*in_order[: len(args)], *kwargs}
    twice = [name for name in in_order[: len(args)] if name in kwargs]
    if twice:
        return f"{twice[0]} is given twice, by position and by name; give it once"
    missing = [one.name for one in known if one.default is one.empty and one.name not in given]
    if not missing:
        return ""
    verb = "is" if len(missing) == 1 else "are"
    return f"{listed(missing)} {verb} missing; give for example {missing[0]}=..."


@dataclass(frozen=True, slots=True)
class Component:
    """Base of all components: a named part of a mechanism.

    Attributes:
        name: unique name in the mechanism. Dots separate the names of nested mechanisms.
    """

    name: str

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super(Component, cls).__init_subclass__(**kwargs)
        check_arguments(cls)

    def __post_init__(self) -> None:
        if (
            not isinstance(self.name, str)
            or not _NAME.fullmatch(self.name)
            or self.name != seen(self.name)
        ):
            raise DescriptionError(
                f"{type(self).__name__} {self.name!r}: a name has no blanks, quotes, control"
                " characters or empty parts; choose another name"
            )

    def expressions(self) -> Iterator[Expression]:
        """Yield every scalar field as an Expression, also inside tuples and dataclasses."""
        for f in fields(self):
            yield from _expressions(getattr(self, f.name))

    def parameters(self) -> frozenset[str]:
        """Return the names of all symbolic parameters of the component."""
        return frozenset(p.name for value in self.expressions() for p in parameters_of(value))

    def _normalise(self, *names: str) -> None:
        """Convert the fields `names`, numbers or texts such as "2*L1", to expressions, in place."""
        for name in names:
            value = expression(getattr(self, name), f"{self.name}, {name}")
            object.__setattr__(self, name, value)

    def scoped(self: C, prefix: str) -> C:
        """Return a copy whose name and parameters have the prefix "`prefix`.".

        Args:
            prefix: text before the names, without the dot.
        """
        return self._with_changed_fields(
            lambda value: renamed(value, prefix), f"{prefix}.{self.name}"
        )

    def without_defaults(self: C) -> C:
        """Return a copy whose symbolic parameters have no default values."""
        return self._with_changed_fields(without_defaults, self.name)

    def check_values(self: C, values: Mapping[str, float]) -> C:
        """Return the component with numbers for its parameters, checked as in the constructor.

        Args:
            values: value by parameter name; defaults are used for others.

        Raises:
            DescriptionError: the constructor raises it for these values.
        """
        return self._with_changed_fields(lambda value: with_values(value, values), self.name)

    def _with_changed_fields(self: C, change: Callable[[Expression], Expression], name: str) -> C:
        """Return a copy with the name `name` and with `change` applied to each scalar field."""
        fresh: dict[str, Any] = {
            f.name: _map(getattr(self, f.name), change) for f in fields(self) if f.init
        }
        return type(self)(**{**fresh, "name": name})


def _expressions(value: object) -> Iterator[Expression]:
    """Yield the expressions that a value is or contains, in tuples and dataclasses."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, tuple):
        for element in value:
            yield from _expressions(element)
    elif is_dataclass(value):
        for f in fields(value):
            yield from _expressions(getattr(value, f.name))


def _map(value: Any, change: Callable[[Expression], Expression]) -> Any:
    """Return a value with `change` applied to the expressions in it, in tuples and dataclasses."""
    if isinstance(value, Expression):
        return change(value)
    if isinstance(value, tuple):
        return tuple(_map(element, change) for element in value)
    if is_dataclass(value) and not isinstance(value, type):
        return replace(
            value, **{f.name: _map(getattr(value, f.name), change) for f in fields(value)}
        )
    return value


def with_points(component: C, change: Callable[[Point], Point]) -> C:
    """Return a copy of a component with its attachment points replaced.

    Args:
        component: component with fields that are points or tuples of points.
        change: callable (point) -> new point.
    """

    def change_points(value: Any) -> Any:
        if isinstance(value, Point):
            return change(value)
        if isinstance(value, tuple) and any(isinstance(one, Point) for one in value):
            return tuple(change_points(one) for one in value)
        return value

    values = {f.name: getattr(component, f.name) for f in fields(component) if f.init}
    new = {name: change_points(value) for name, value in values.items()}
    other = {name: value for name, value in new.items() if value is not values[name]}
    return replace(component, **other) if other else component


def component_name(text: str) -> str:
    """Return a valid component name: the text with blanks, dots and quotes replaced by underscores.

    Invisible characters are removed, and the name is cut to `LONGEST_NAME` characters. The name is
    empty if nothing remains.

    Args:
        text: name in a file.
    """
    return seen(_NOT_IN_NAMES.sub("_", text.strip()))[:_LONGEST_NAME]


# Pairs of coordinate name and number.


def named_scalars(given: Any) -> list[tuple[str, Any]] | None:
    """Return pairs (name, scalar) as a list; None if `given` is not a sequence of such pairs."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        return None
    pairs = list(given)
    for pair in pairs:
        if not (isinstance(pair, (tuple, list)) and len(pair) == 2 and isinstance(pair[0], str)):
            return None
    return [(name, value) for name, value in pairs]


# Axes.


_NAMED_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def unit_axis(name: str, axis: Any) -> tuple[float, float, float]:
    """Return the unit vector (3,) of an axis.

    Args:
        name: name of the component in error messages.
        axis: "x", "y", "z", "-x", "-y", "-z", or three numbers of any length.

    Raises:
        DescriptionError: the value is no axis, or its length is zero.
    """
    if isinstance(axis, str):
        sign, letter = (-1.0, axis[1:]) if axis.startswith("-") else (1.0, axis)
        if letter not in _NAMED_AXES:
            raise DescriptionError(
                f"{name}: axis {axis!r} is unknown; give 'x', 'y', 'z', '-x' .. or three numbers"
            )
        x, y, z = _NAMED_AXES[letter]
        return sign * x, sign * y, sign * z
    try:
        values: NDArray[np.float64] = np.array([float(v) for v in axis])
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape != (3,) or not np.all(np.isfinite(values)):
        raise DescriptionError(
            f"{name}: axis {quoted(axis)} is not a direction; give three numbers"
        )
    if math.hypot(*values) < 1e-9:  # rounding of zero: axes are longer
        raise DescriptionError(f"{name}: axis {quoted(axis)} has zero length; give a direction")
    return unit_vector(values.tolist())


def in_plane(
    axis: tuple[float, float, float],
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return two unit vectors (u, v) normal to the unit vector `axis`, with u x v = axis.

    For the axis z they are x and y.
    """
    R = align_z(axis)
    u, v = ([float(R[k, column]) for k in range(3)] for column in (0, 1))
    return (u[0], u[1], u[2]), (v[0], v[1], v[2])
