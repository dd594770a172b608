"""Base inertial parameters as rows of a table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from casadi import Function

from mbs.app.tasks.csv_text import csv_text
from mbs.assembly import System
from mbs.identification._base_parameters import METHODS, BaseParameters, base_parameters
from mbs.identification.regressors import symbolic_parameters

__all__ = ["METHODS", "BaseRow", "BaseTable", "base"]

_NO_OPTIONS: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class BaseRow:
    """Base inertial parameter.

    Attributes:
        name: name of the parameter. The suffix R marks a parameter to which others were added,
            as in "XX2R".
        unit: unit of the parameter.
        expression: linear combination of link parameters.
        value: value with the parameters of the description; None if a parameter has no value.
    """

    name: str
    unit: str
    expression: str
    value: float | None


@dataclass(frozen=True, slots=True)
class BaseTable:
    """Base inertial parameters of a mechanism.

    Attributes:
        system: name of the mechanism.
        method: method that found them, "symbolic" or "numeric".
        total: number of all inertial parameters.
        rows: base parameters.
        without_effect: names of parameters that no joint effort depends on.
        grouped: names of parameters that were eliminated because they act only in combination
            with others.
        check: result of the numeric check at random states.
        text: the same as plain text.
    """

    system: str
    method: str
    total: int
    rows: tuple[BaseRow, ...]
    without_effect: tuple[str, ...]
    grouped: tuple[str, ...]
    check: str
    text: str

    def csv(self) -> str:
        """Return the base parameters as comma-separated text: name, unit, expression and value."""
        head = ("name", "unit", "expression", "value")
        return csv_text(head, ((r.name, r.unit, r.expression, r.value) for r in self.rows))


def base(
    system: System, method: str = "symbolic", options: Mapping[str, Any] = _NO_OPTIONS
) -> BaseTable:
    """Compute the base inertial parameters of a mechanism.

    Args:
        system: open or closed system.
        method: "symbolic" or "numeric".
        options: further arguments of `mbs.identification.base_parameters`, such as moving_base.

    Raises:
        ModelError: the method is unknown, or the loops cannot be closed.
    """
    found = base_parameters(system, method, **options)
    without = tuple(column.name for column in found.without_effect)
    pairs = zip(found.kept, found.names, found.equations, _values(found), strict=True)
    return BaseTable(
        system=system.name,
        method=found.method,
        total=len(found.columns),
        rows=tuple(
            BaseRow(name, column.unit, equation.split(" = ", 1)[1], value)
            for column, name, equation, value in pairs
        ),
        without_effect=without,
        grouped=tuple(c.name for c in found.eliminated if c.name not in without),
        check=found.check.text,
        text=found.text() + "\n",
    )


def _values(found: BaseParameters) -> list[float | None]:
    """Return the values of the base parameters from the description.

    None if a symbol has no value.
    """
    system = found.system
    p = [system.p] if system.parameters else []
    symbolic = found.function(symbolic_parameters(system, found.columns), *p)
    at = Function("values", [system.p], [symbolic])
    numbers = np.array(at(system.p_default), dtype=float).ravel()
    return [float(x) if math.isfinite(x) else None for x in numbers]
