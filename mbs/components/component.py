"""What bodies, joints and the world have in common: a name, and points to connect."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar

from mbs.comments import seen
from mbs.components.placement import (
    KhalilStep,
    Placement,
    Rotation,
    angle_expression,
    displacement,
)
from mbs.errors import DescriptionError
from mbs.expressions import (
    Expression,
    Scalar,
    expression,
    parameters_of,
    renamed,
    with_values,
    without_defaults,
)

_NAME = re.compile(r"[^\s.'\"]+(?:\.[^\s.'\"]+)*")


@dataclass(frozen=True, slots=True)
class Point:
    """A frame fixed on a component, where another component can be connected.

    Attributes:
        owner: the component that carries the frame.
        port: which frame of the owner the placement starts at ("" for the reference frame of a
            body; "a" or "b" for a joint).
        placement: the frame seen from that port.
    """

    owner: Component
    port: str = ""
    placement: Placement = field(default_factory=Placement)

    def at(
        self, x: Scalar = 0, y: Scalar = 0, z: Scalar = 0, *, rotation: Rotation | None = None
    ) -> Point:
        """A point displaced by (x, y, z) [m] in this frame, then turned by `rotation`."""
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
        """A point placed by the parameters of Khalil & Kleinfinger 1986, angles in rad."""
        where = f"{self.owner.name}.at_khalil"
        values = (gamma, b, alpha, d, theta, r)
        names = ("gamma", "b", "alpha", "d", "theta", "r")
        readers: Sequence[Callable[[Scalar, str], Expression]] = (angle_expression, expression) * 3
        step = KhalilStep(
            *(r(v, f"{where}, {n}") for r, n, v in zip(readers, names, values, strict=True))
        )
        return replace(self, placement=self.placement.then(step))


C = TypeVar("C", bound="Component")


@dataclass(frozen=True, slots=True)
class Component:
    """A named part of a mechanism.

    Attributes:
        name: unique in its mechanism; a dot separates the names of nested mechanisms.
    """

    name: str

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
        """Every scalar of the component that may hold parameters."""
        for f in fields(self):
            yield from _expressions(getattr(self, f.name))

    def parameters(self) -> frozenset[str]:
        """The names of the symbols that it holds."""
        return frozenset(p.name for value in self.expressions() for p in parameters_of(value))

    def _normalise(self, *names: str) -> None:
        """Turn fields that a user wrote as numbers or texts into expressions, checking each."""
        for name in names:
            value = expression(getattr(self, name), f"{self.name}, {name}")
            object.__setattr__(self, name, value)

    def scoped(self: C, prefix: str) -> C:
        """The same component inside a mechanism that is placed in another one."""
        return self._changed(lambda value: renamed(value, prefix), f"{prefix}.{self.name}")

    def without_defaults(self: C) -> C:
        """The same component, which knows no values of its parameters."""
        return self._changed(without_defaults, self.name)

    def check_values(self, values: Mapping[str, float]) -> None:
        """Refuse values of parameters that the component itself would refuse as numbers.

        Raises:
            DescriptionError: as in the constructor.
        """
        self._changed(lambda value: with_values(value, values), self.name)

    def _changed(self: C, change: Callable[[Expression], Expression], name: str) -> C:
        fresh: dict[str, Any] = {
            f.name: _mapped(getattr(self, f.name), change) for f in fields(self) if f.init
        }
        return type(self)(**{**fresh, "name": name})


def _expressions(value: object) -> Iterator[Expression]:
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, tuple):
        for element in value:
            yield from _expressions(element)
    elif is_dataclass(value):
        for f in fields(value):
            yield from _expressions(getattr(value, f.name))


def _mapped(value: Any, change: Callable[[Expression], Expression]) -> Any:
    if isinstance(value, Expression):
        return change(value)
    if isinstance(value, tuple):
        return tuple(_mapped(element, change) for element in value)
    if is_dataclass(value) and not isinstance(value, type):
        return replace(
            value, **{f.name: _mapped(getattr(value, f.name), change) for f in fields(value)}
        )
    return value
