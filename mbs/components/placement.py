"""Where a point of a component is: a chain of displacements, kept as data.

A placement is read from left to right: each step starts where the one before it ended.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from decimal import Decimal
from typing import Any

import numpy as np
from casadi import DM, SX

from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, renamed, to_sx
from mbs.messages import quoted
from mbs.spatial import Khalil, Pose, nearest_rotation, vector

SymbolTable = Mapping[str, SX]
"""The CasADi symbol of every parameter, by name."""

_DIGITS = 11
"""Significant digits from which on a number may be a multiple of pi/2 that was written down."""

_WRITTEN = 6e-12
"""How far the usual texts 1.5707963268 and 1.57079632679 are from pi/2, at most [rad]."""


@dataclass(frozen=True, slots=True)
class Translation:
    """A displacement (x, y, z) [m]."""

    x: Expression
    y: Expression
    z: Expression

    def pose(self, symbols: SymbolTable) -> Pose:
        """The displaced frame seen from the one before."""
        return Pose.moved(vector(to_sx(value, symbols) for value in (self.x, self.y, self.z)))


@dataclass(frozen=True, slots=True)
class Turned:
    """A rotation by an angle [rad] about the axis "x", "y" or "z"."""

    axis: str
    angle: Expression

    def pose(self, symbols: SymbolTable) -> Pose:
        """The turned frame seen from the one before."""
        return Pose.about(self.axis, to_sx(self.angle, symbols))


@dataclass(frozen=True, slots=True)
class Oriented:
    """A rotation given by its matrix, row by row."""

    rows: tuple[tuple[float, float, float], ...]

    def pose(self, symbols: SymbolTable) -> Pose:
        """The turned frame seen from the one before."""
        return Pose.turned(SX(DM(self.rows)))


@dataclass(frozen=True, slots=True)
class KhalilStep:
    """The six parameters of a frame j with respect to its antecedent, kept as they were written."""

    gamma: Expression
    b: Expression
    alpha: Expression
    d: Expression
    theta: Expression
    r: Expression

    def khalil(self, symbols: SymbolTable) -> Khalil:
        """The parameters on CasADi symbols."""
        return Khalil(*(to_sx(getattr(self, f.name), symbols) for f in fields(self)))

    def pose(self, symbols: SymbolTable) -> Pose:
        """Frame j seen from its antecedent."""
        return self.khalil(symbols).pose()


Step = Translation | Turned | Oriented | KhalilStep


@dataclass(frozen=True, slots=True)
class Placement:
    """A chain of displacements; empty means "here"."""

    steps: tuple[Step, ...] = ()

    def pose(self, symbols: SymbolTable) -> Pose:
        """The placed frame seen from where the chain starts."""
        pose = Pose.identity()
        for step in self.steps:
            pose = pose @ step.pose(symbols)
        return pose

    def then(self, *steps: Step) -> Placement:
        """The placement with further steps at its end."""
        return Placement(self.steps + steps)

    def expressions(self) -> Iterator[Expression]:
        """Every scalar in the placement."""
        for step in self.steps:
            for field in fields(step):
                value = getattr(step, field.name)
                if isinstance(value, Expression):
                    yield value

    def scoped(self, prefix: str) -> Placement:
        """The placement with its parameters put in the scope of a nested mechanism."""
        return Placement(tuple(_scoped(step, prefix) for step in self.steps))


def _scoped(step: Step, prefix: str) -> Step:
    changed: dict[str, Any] = {}
    for field in fields(step):
        value = getattr(step, field.name)
        if isinstance(value, Expression):
            changed[field.name] = renamed(value, prefix)
    return replace(step, **changed)


Rotation = tuple[str, Scalar] | Sequence[tuple[str, Scalar]] | Sequence[Sequence[float]]
"""("z", "pi/2 + A"), a sequence of such turns, or a (3, 3) matrix."""


def displacement(
    where: str, x: Scalar, y: Scalar, z: Scalar, rotation: Rotation | None
) -> tuple[Step, ...]:
    """The steps of "at (x, y, z), then turned by `rotation`"."""
    values = [
        expression(value, f"{where}, {name}") for name, value in zip("xyz", (x, y, z), strict=True)
    ]
    steps: list[Step] = []
    if any(str(value) != "0" for value in values):
        steps.append(Translation(*values))
    if rotation is not None:
        steps.extend(_rotation_steps(where, rotation))
    return tuple(steps)


def _rotation_steps(where: str, rotation: Any) -> Iterable[Step]:
    if _is_turn(rotation):
        return [_turn(where, *rotation)]
    if isinstance(rotation, (list, tuple)) and all(map(_is_turn, rotation)):
        return [_turn(where, *part) for part in rotation]
    try:
        R = np.asarray(rotation, dtype=float)
    except (TypeError, ValueError):
        R = np.zeros(0)
    if R.shape != (3, 3) or not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0:
        raise DescriptionError(
            f"{where}: rotation {quoted(rotation)} is not a rotation; give ('z', angle), a sequence"
            " of such turns, or an orthonormal right-handed (3, 3) matrix"
        )
    return [Oriented(nearest_rotation(R.tolist()))]


def _is_turn(part: Any) -> bool:
    return isinstance(part, (list, tuple)) and len(part) == 2 and isinstance(part[0], str)


def _turn(where: str, axis: str, angle: Scalar) -> Turned:
    if axis not in ("x", "y", "z"):
        raise DescriptionError(f"{where}: rotation axis {axis!r} is not 'x', 'y' or 'z'; use one")
    return Turned(axis, angle_expression(angle, f"{where}, rotation about {axis}"))


def angle_expression(angle: Scalar, where: str) -> Expression:
    """An angle [rad]; a multiple of pi/2 that was written with 11 digits or more is exactly that.

    1.57079632679 in a file means pi/2. Five units of 1e-12 would be a tilt that nobody meant, for
    which every model pays in operations. A text with fewer digits is taken at its word.
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
