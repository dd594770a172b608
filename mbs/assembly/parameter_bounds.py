"""Between which values parameters must lie: what the components that hold them take as numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

from casadi import SX

from mbs.components import Box, Component, Cylinder
from mbs.errors import DescriptionError
from mbs.expressions import (
    MORE_THAN_ZERO,
    Number,
    Operation,
    Parameter,
    parameters_of,
    to_sx,
)

Bounds = tuple[float | None, float | None]
"""The least and the greatest value; None where there is none."""

_BELOW_ZERO = (-1.0, -1e-5)  # far, and nearer than a limit is to zero: refused for the sign
_ABOVE_ONE = (1.1, 1e3)  # near, and far: what is refused there is refused for being above one


def parameter_bounds(
    components: Iterable[Component], parameters: Iterable[Parameter]
) -> dict[str, Bounds]:
    """The bounds of parameters: their own, and zero and one by what components refuse.

    A component is asked with the values themselves, all other parameters left open, so that its
    rule is stated in one place. Rules between several parameters, such as of an inner and an outer
    radius, are no bounds; `BoundedField` and the components themselves know them.

    Args:
        components: of a mechanism.
        parameters: of it.

    Returns:
        least and greatest value by name, of those that have one.
    """
    found: dict[str, Bounds] = {p.name: (p.min, p.max) for p in parameters}
    for component in components:
        for name in sorted(component.parameters() & found.keys()):
            low, high = _bounds(partial(_with_value, component.without_defaults(), name))
            found[name] = _tighter(max, low, found[name][0]), _tighter(min, high, found[name][1])
    return {name: bounds for name, bounds in found.items() if bounds != (None, None)}


@dataclass(frozen=True, slots=True, eq=False)
class BoundedField:
    """A number of a component that is made of parameters, and its bounds.

    Attributes:
        name: of the component and the field, such as "arm, mass".
        value: (1, 1) on the symbols of the parameters.
        bounds: least and greatest value.
    """

    name: str
    value: SX
    bounds: Bounds


def bounded_fields(
    components: Iterable[Component], symbols: Mapping[str, SX]
) -> Iterator[BoundedField]:
    """What is computed from parameters and has bounds, such as a mass of "M1 + M2".

    Args:
        components: of a mechanism.
        symbols: of its parameters.
    """
    for component in components:
        unvalued = component.without_defaults()
        for f in fields(component):
            value = getattr(component, f.name)
            if f.init and isinstance(value, Operation) and any(parameters_of(value)):
                bounds = _bounds(partial(_with_field, unvalued, f.name))
                if bounds != (None, None):
                    yield BoundedField(f"{component.name}, {f.name}", to_sx(value, symbols), bounds)
        if isinstance(component, (Box, Cylinder)) and isinstance(component.solid_mass, Operation):
            mass = to_sx(component.solid_mass, symbols)
            yield BoundedField(f"{component.name}, mass", mass, (0.0, None))


def _with_value(component: Component, name: str, value: float) -> None:
    component.check_values({name: value})


def _with_field(component: Component, name: str, value: float) -> None:
    changed: dict[str, Any] = {name: Number(value)}
    replace(component, **changed)


def _tighter(choose: Callable[[Iterable[float]], float], *bounds: float | None) -> float | None:
    known = [bound for bound in bounds if bound is not None]
    return choose(known) if known else None


def _bounds(check: Callable[[float], object]) -> Bounds:
    """What a rule refuses among values below zero, of zero, and above one."""
    low: float | None = None
    if all(_is_refused(check, value) for value in _BELOW_ZERO):
        open_end = _is_refused(check, 0.0) and not _is_refused(check, MORE_THAN_ZERO)
        low = MORE_THAN_ZERO if open_end else 0.0
    above = all(_is_refused(check, value) for value in _ABOVE_ONE)
    return low, 1.0 if above and not _is_refused(check, 1.0) else None


def _is_refused(check: Callable[[float], object], value: float) -> bool:
    try:
        check(value)
    except (DescriptionError, ArithmeticError):
        return True
    return False
