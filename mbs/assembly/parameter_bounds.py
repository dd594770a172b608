"""Between which values a parameter must lie: what the components that hold it take as a number."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from mbs.components import Component
from mbs.errors import DescriptionError
from mbs.expressions import Parameter, parameters_of

Bounds = tuple[float | None, float | None]
"""The least and the greatest value; None where there is none."""

MORE_THAN_ZERO = sys.float_info.min
"""The least value of what must be more than zero: the smallest normal number."""

_BELOW_ZERO = (
    -1.0,
    -1e-5,
)  # far, and nearer than a limit is to zero; both are refused for the sign
_ABOVE_ONE = (1.1, 1e3)


def parameter_bounds(
    components: Iterable[Component], parameters: Iterable[Parameter]
) -> dict[str, Bounds]:
    """The bounds zero and one of parameters, by what components refuse.

    A component is asked with the values themselves, all other parameters left open, so that its
    rule is stated in one place. Rules between several parameters, such as of an inner and an outer
    radius, are no bounds.

    Args:
        components: of a mechanism.
        parameters: of it.

    Returns:
        least and greatest value by name, of those that have one.
    """
    known = {parameter.name for parameter in parameters}
    found: dict[str, Bounds] = {}
    for component in components:
        names = {p.name for e in component.expressions() for p in parameters_of(e)}
        unvalued = component.without_defaults() if names else component
        for name in sorted(names & known):
            low, high = _bounds(unvalued, name)
            before = found.get(name, (None, None))
            low = max((x for x in (low, before[0]) if x is not None), default=None)
            found[name] = low, high if before[1] is None else before[1]
    return {name: bounds for name, bounds in found.items() if bounds != (None, None)}


def _bounds(component: Component, name: str) -> Bounds:
    low: float | None = None
    if all(_refuses(component, name, value) for value in _BELOW_ZERO):
        open_end = _refuses(component, name, 0.0) and not _refuses(component, name, MORE_THAN_ZERO)
        low = MORE_THAN_ZERO if open_end else 0.0
    above = all(_refuses(component, name, value) for value in _ABOVE_ONE)
    return low, 1.0 if above and not _refuses(component, name, 1.0) else None


def _refuses(component: Component, name: str, value: float) -> bool:
    try:
        component.check_values({name: value})
    except (DescriptionError, ArithmeticError):
        return True
    return False
