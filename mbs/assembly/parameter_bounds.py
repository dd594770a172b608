"""Bounds of parameters, from the values that their components accept, and possible inertias."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.assembly.tree import Tree
from mbs.components import Box, Component, Cylinder
from mbs.components.bodies import GROUPED, KhalilBody, RigidBody
from mbs.components.custom import Custom
from mbs.components.joints import Motion
from mbs.components.notes import ImportNote
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
"""Least and greatest value; None for no bound."""

_BELOW_ZERO = (-1.0, -1e-5)  # far from zero, and nearer than any bound: rejected for the sign
_ABOVE_ONE = (1.00001, 1.1, 1e3)  # near 1, and far: if all are rejected, the upper bound is 1
_ABOVE_ZERO = (MORE_THAN_ZERO, 1e-5, 1.0, 1e3)  # some are accepted if the lower bound is 0


def parameter_bounds(
    components: Iterable[Component], parameters: Iterable[Parameter]
) -> dict[str, Bounds]:
    """Return the bounds of parameters: their own, and bounds at 0 and 1 that components impose.

    A component is checked with trial values of one parameter and without values of other
    parameters. Its rules are therefore defined only in the component. Rules between several
    parameters, such as inner and outer radius, are not bounds; `BoundedField` and the components
    check them.

    Args:
        components: components of a mechanism.
        parameters: parameters of the mechanism.

    Returns:
        least and greatest value by name, for parameters with a bound.
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
    """A field of a component that is an expression of parameters, with its bounds.

    Attributes:
        name: names of the component and of the field, such as "arm, mass".
        value: (1, 1) expression in the symbols of the parameters.
        bounds: least and greatest value.
    """

    name: str
    value: SX
    bounds: Bounds


def bounded_fields(
    components: Iterable[Component], symbols: Mapping[str, SX]
) -> Iterator[BoundedField]:
    """Yield the fields that are expressions of parameters and have bounds, such as mass "M1 + M2".

    Args:
        components: components of a mechanism.
        symbols: symbols of its parameters.
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
    """Check a component with `value` for the parameter `name`; raise if it rejects the value."""
    component.check_values({name: value})


def _with_field(component: Component, name: str, value: float) -> None:
    """Check a component with `value` for its field `name`; raise if it rejects the value."""
    changed: dict[str, Any] = {name: Number(value)}
    replace(component, **changed)


def _declared(component: Component) -> Iterator[tuple[str, Bounds]]:
    """Yield field name and bounds of the declared parameters of an equation-based component."""
    if isinstance(component, Custom):
        for name in component.names_of("parameter"):
            yield name, (component.declared[name].low, component.declared[name].high)


def _tighter(a: Bounds, b: Bounds) -> Bounds:
    """Return the intersection of two pairs of bounds (lower, upper); None means no bound."""
    lows = [bound for bound in (a[0], b[0]) if bound is not None]
    highs = [bound for bound in (a[1], b[1]) if bound is not None]
    return max(lows, default=None), min(highs, default=None)


def _bounds(check: Callable[[float], object]) -> Bounds:
    """Return the lower bound 0 and upper bound 1 of a rule, as far as it has them.

    `check` raises for values that the rule rejects; it is called with trial values.
    """
    low: float | None = None
    taken = not all(_is_refused(check, value) for value in _ABOVE_ZERO)
    if taken and all(_is_refused(check, value) for value in _BELOW_ZERO):
        open_end = _is_refused(check, 0.0) and not _is_refused(check, MORE_THAN_ZERO)
        low = MORE_THAN_ZERO if open_end else 0.0
    above = all(_is_refused(check, value) for value in _ABOVE_ONE)
    return low, 1.0 if above and not _is_refused(check, 1.0) else None


def _is_refused(check: Callable[[float], object], value: float) -> bool:
    """Whether `check` raises for a value."""
    try:
        check(value)
    except (DescriptionError, ArithmeticError):
        return True
    return False


# Impossible inertias: an error if the body may rotate about several axes, else a note.


_PARALLEL = 1e-9
"""Largest sine of the angle between parallel axes: rounding gives 1e-15, designs differ by more."""


def inertia_notes(tree: Tree, bodies: Iterable[tuple[RigidBody, int]]) -> list[ImportNote]:
    """Return notes on bodies whose inertia no mass distribution has, such as Ixx > Iyy + Izz.

    The motion of a body with a single rotation axis depends only on the moment of inertia about it,
    so that such an inertia is only noted.

    Args:
        tree: tree of the mechanism.
        bodies: bodies with values of their parameters, and indices of their links, -1 for the base.

    Raises:
        DescriptionError: a body that may rotate about several axes has an impossible inertia.
    """
    faulty = [(body, link) for body, link in bodies if body.inertia_fault]
    several = _rotating_about_several(tree) if faulty else set()
    notes = []
    for body, link in faulty:
        if link in several:
            grouped = f", {GROUPED}" if isinstance(body, KhalilBody) else ""
            raise DescriptionError(
                f"{body.name}: {body.inertia_fault}; the largest must not exceed the sum of the"
                f" other two, unless the body rotates about one axis only{grouped}"
            )
        text = f"{body.inertia_fault}; it rotates about one axis only"
        notes.append(ImportNote("doubted", f"body {body.name!r}", text))
    return notes


def _rotating_about_several(tree: Tree) -> set[int]:
    """Return the indices of the links that may rotate about axes that are not parallel."""
    several: set[int] = set()
    axes: dict[int, NDArray[np.float64]] = {}  # rotation axis of each link, in its frame
    for j, link in enumerate(tree.links):
        i, R = link.antecedent, link.pose().R
        spins = link.motion is not Motion.PRISMATIC
        by_symbol = i in axes and not R.is_constant()
        if i in several or by_symbol or (spins and link.motion is not Motion.REVOLUTE):
            several.add(j)
        elif i in axes:
            axes[j] = np.array(DM(R)).T @ axes[i]
            if spins and np.hypot(*axes[j][:2]) > _PARALLEL:
                several.add(j)
        elif spins:
            axes[j] = np.array([0.0, 0.0, 1.0])
    return several
