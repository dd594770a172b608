"""The table that says what each element of the inputs and outputs of a model is."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mbs.assembly.model_function import ModelFunction
    from mbs.assembly.system import System

_QUANTITIES = {
    "q": "position",
    "v": "velocity",
    "a": "acceleration",
    "tau": "effort",
    "p": "parameter",
    "z": "state of a device",
    "u": "input of a device",
    "y": "output of a device",
}


def function_table(function: ModelFunction) -> str:
    """One line for each input and output, and one for each of its elements that has a name.

    Args:
        function: the model; q, v, a and tau are in the order of the coordinates of its system, and
            those that end in _a are of the independent joints.

    Returns:
        Lines of index, name, quantity and unit; parameters with their defaults, and positions,
        velocities and efforts with the limits that the joints describe.
    """
    lines = [f"{function.name()} of {function.system.name}"]
    for way, names, shape in (
        ("input", function.name_in(), function.size_in),
        ("output", function.name_out(), function.size_out),
    ):
        for name in names:
            lines += [f"{way} {name} {shape(name)}", *_elements(function, name, shape(name)[0])]
    return "\n".join(lines)


def _elements(function: ModelFunction, name: str, size: int) -> list[str]:
    rows = function.elements(name)
    if len(rows) != size:
        return []
    quantity = _QUANTITIES.get(name.removesuffix("_a"), "")
    defaults = function.system.parameter_values(needed=()) if name == "p" else []
    limits = _limits(function.system, name.removesuffix("_a"))
    width = max((len(element) for element, _ in rows), default=0)
    return [
        f"  {k:>3}  {element:<{width}}  {quantity} [{unit}]{limits.get(element, '')}"
        + (f" = {defaults[k]:g}" if k < len(defaults) and defaults[k] == defaults[k] else "")
        for k, (element, unit) in enumerate(rows)
    ]


def _limits(system: System, name: str) -> dict[str, str]:
    """What to write of the limits of the elements of an input, by the name of the element."""
    ranges = {
        "q": [(row.name, row.limits) for row in system.coordinates],
        "v": [(row.name, row.limits) for row in system.speeds],
        "tau": [(row.name, row.effort) for row in system.speeds],
    }
    return {
        element: f" {ends[0]:g} .. {ends[1]:g}"
        for element, ends in ranges.get(name, [])
        if ends is not None
    }
