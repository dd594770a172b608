"""Between which values parameters must lie: what the components that hold them take as numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

from casadi import SX

from mbs.components import Box, Component, Cylinder
from mbs.components.custom import Custom
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
_ABOVE_ONE = (1.00001, 1.1, 1e3)  # near, and far: what is refused there is above one
_ABOVE_ZERO = (MORE_THAN_ZERO, 1e-5, 1.0, 1e3)  # of which some are taken where zero is the limit


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
            own = _bounds(partial(_with_value, component.without_defaults(), name))
            found[name] = _tighter(found[name], own)
        for name, bounds in _declared(component):
            value = getattr(component, name)
            if isinstance(value, Parameter) and value.name in found:
                found[value.name] = _tighter(found[value.name], bounds)
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
        unvalued, declared = component.without_defaults(), dict(_declared(component))
        for f in fields(component):
            value = getattr(component, f.name)
            if f.init and isinstance(value, Operation) and any(parameters_of(value)):
                bounds = _bounds(partial(_with_field, unvalued, f.name))
                bounds = _tighter(bounds, declared.get(f.name, (None, None)))
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


def _declared(component: Component) -> Iterator[tuple[str, Bounds]]:
    """The bounds that a component by its equations declares, by field."""
    if isinstance(component, Custom):
        for name in component.names_of("parameter"):
            yield name, (component.declared[name].low, component.declared[name].high)


def _tighter(a: Bounds, b: Bounds) -> Bounds:
    lows = [bound for bound in (a[0], b[0]) if bound is not None]
    highs = [bound for bound in (a[1], b[1]) if bound is not None]
    return max(lows, default=None), min(highs, default=None)


def _bounds(check: Callable[[float], object]) -> Bounds:
    """What a rule refuses among values below zero, of zero, and above one."""
    low: float | None = None
    taken = not all(_is_refused(check, value) for value in _ABOVE_ZERO)
    if taken and all(_is_refused(check, value) for value in _BELOW_ZERO):
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
