"""How every model becomes a casadi.Function: names, parameters with defaults, checked calls."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly.system import System
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.errors import ModelError

Named = Sequence[tuple[str, SX]]
"""Inputs or outputs of a model: name and value."""


_SAME_UNIT = {unit: unit for unit in EFFORT_UNIT}


class ModelFunction(Function):
    """A casadi.Function that knows the names of its elements and the defaults of its parameters.

    It is called like any Function. The last input p may be left out: its defaults are taken
    (CasADi's own `default_in` holds one number per input, so it cannot keep them). A call with a
    wrong number of values says so by the names of the coordinates.
    """

    def __init__(self, function: Function, system: System) -> None:
        Function.__init__(self, function)
        self._system = system

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate it on numbers or symbols, as a casadi.Function, its inputs checked."""
        names = self.name_in()
        for name, value in [*zip(names, args, strict=False), *kwargs.items()]:
            self._check(name, value)
        if self._system.parameters and "p" not in kwargs:
            if kwargs or not args:
                kwargs["p"] = self._defaults()
            elif len(args) == len(names) - 1:
                args = (*args, self._defaults())
        return Function.__call__(self, *args, **kwargs)

    def elements(self, name: str) -> list[tuple[str, str]]:
        """Name and unit of every element of an input or output; empty where they have none."""
        return _elements(self._system).get(name, [])

    def _defaults(self) -> DM:
        return DM(self._system.parameter_values())

    def _check(self, name: str, value: Any) -> None:
        names = self.name_in()
        if name not in names or isinstance(value, (int, float)):
            return
        shape = value.shape if hasattr(value, "shape") else np.shape(value)
        rows, columns = (*shape, 1, 1)[:2]
        wanted = self.size_in(names.index(name))
        if rows == wanted[0] or rows == 0 or (rows, columns) == (1, wanted[0]):
            return
        elements = ", ".join(element for element, _ in self.elements(name))
        known = f": {elements}" if elements else ""
        raise ModelError(
            f"{self.name()}({self._system.name}): {name} has {rows} values, it needs"
            f" {wanted[0]}{known}"
        )


def model_function(
    system: System,
    key: tuple[Any, ...],
    build: Callable[[], tuple[Named, Named]],
) -> Function:
    """The model of a system under this key, built the first time it is asked for.

    Args:
        system: whose model it is; its cache keeps the Function.
        key: the name of the Function, then whatever tells it from others of the same name.
        build: gives the named inputs and outputs on CasADi symbols. When the system has
            parameters they become the last input p.
    """
    require_system(system)

    def make() -> Function:
        inputs, outputs = build()
        named = [*inputs, *([("p", system.p)] if system.parameters else [])]
        function = Function(
            str(key[0]),
            [symbol for _, symbol in named],
            [casadi.densify(value) for _, value in outputs],
            [label for label, _ in named],
            [label for label, _ in outputs],
            {"cse": True, **_default_in(system, len(inputs))},
        )
        return ModelFunction(function, system)

    function: Function = system.cached(key, make)
    return function


def _default_in(system: System, others: int) -> Mapping[str, list[float]]:
    """CasADi's default of p, where one number can be it."""
    values = set(system.p_default)
    if len(values) == 1 and not any(math.isnan(value) for value in values):
        return {"default_in": [0.0] * others + [values.pop()]}
    return {}


def require_system(system: object) -> None:
    """Refuse what is not a System, such as a mechanism that was not assembled.

    Raises:
        ModelError: says what to call.
    """
    if not isinstance(system, System):
        name = getattr(system, "name", system)
        raise ModelError(
            f"{name}: models are made of a System, not of a {type(system).__name__};"
            " call assemble() first"
        )


def _elements(system: System) -> dict[str, list[tuple[str, str]]]:
    q = [(coordinate.name, coordinate.unit) for coordinate in system.coordinates]
    units = {"v": _SAME_UNIT, "a": ACCELERATION_UNIT, "tau": EFFORT_UNIT}
    result = {"q": q, "p": [(parameter.name, parameter.unit) for parameter in system.parameters]}
    for name, unit in units.items():
        every = [(speed.name, unit[speed.unit]) for speed in system.speeds]
        result[name] = every
        result[f"{name}_a"] = [every[k] for k in system.active]
    return result
