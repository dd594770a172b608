"""Validity conditions of positions and parameters: unit quaternions, and bounds of parameters.

Loops add further conditions; `mbs.models.validity` contains all conditions.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly.parameter_bounds import Bounds
from mbs.assembly.tree import quaternion_slices
from mbs.expressions import out_of_bounds

if TYPE_CHECKING:
    from mbs.assembly.system import System

Vector = NDArray[np.float64]

UNIT = 1e-5
"""Largest deviation of a quaternion's length from 1: finite differences change it by 1e-6."""

Kind = Literal["quaternion", "parameter", "open", "undetermined"]
"""Violation: quaternion not of unit length, parameter out of bounds, open loops, or independent
joints that do not determine the dependent joints."""


@dataclass(frozen=True, slots=True, eq=False)
class ValidityRow:
    """Validity condition: a function of configuration and parameters that must not exceed a bound.

    Attributes:
        kind: kind of the violation.
        name: name of the condition.
        residual: (1, 1) value.
        bound: (1, 1) or a number.
        sentence: error message for a violation: the reason and the remedy.
    """

    kind: Kind
    name: str
    residual: SX
    bound: SX | float
    sentence: str


def plain_rows(system: System, q: SX) -> list[ValidityRow]:
    """Return the conditions of quaternions, and of parameters and fields with bounds.

    Args:
        system: system.
        q: (nq, 1) positions.
    """
    quaternions = quaternion_rows(system, q, quaternion_slices(system.tree))
    return [*quaternions, *_parameter_rows(system), *field_rows(system)]


def quaternion_rows(system: System, q: SX, parts: Iterable[slice]) -> list[ValidityRow]:
    """Return the conditions for unit quaternions.

    Args:
        system: system.
        q: (nq, 1) positions.
        parts: slices of the quaternions in q.
    """
    rows = []
    for part in parts:
        joint = system.coordinates[part.start].joint
        away = casadi.fabs(casadi.norm_2(q[part]) - 1)
        wrong = f"the quaternion of {joint} is not of unit length; divide it by its length"
        rows.append(ValidityRow("quaternion", f"quaternion of {joint}", away, UNIT, wrong))
    return rows


def _parameter_rows(system: System) -> list[ValidityRow]:
    """Return the conditions that parameters are within their bounds."""
    symbols = system.symbol_table
    bounds = system.bounds.items()
    return [row for name, own in bounds for row in _bound_rows(name, symbols[name], own)]


def field_rows(system: System) -> list[ValidityRow]:
    """Return the conditions of fields computed from parameters, such as a mass of "M1 + M2".

    Args:
        system: system.
    """
    return [row for own in system.bounded for row in _bound_rows(own.name, own.value, own.bounds)]


def _bound_rows(name: str, value: SX, bounds: Bounds) -> list[ValidityRow]:
    """Return the conditions that a value named `name` is within its bounds: none, one or two."""
    low, high = bounds
    rows = []
    if low is not None:
        wrong = f"{name} is too small; {out_of_bounds(-math.inf, low, None)}"
        rows.append(ValidityRow("parameter", f"least value of {name}", -value, -low, wrong))
    if high is not None:
        wrong = f"{name} is too large; {out_of_bounds(math.inf, None, high)}"
        rows.append(ValidityRow("parameter", f"greatest value of {name}", value, high, wrong))
    return rows


def all_hold(
    system: System, key: Hashable, inputs: Mapping[str, SX], rows: Iterable[ValidityRow]
) -> Function:
    """Return ``valid(..)`` of the inputs: 1 if every condition holds, else 0, also for NaN.

    Args:
        system: system whose cache stores the Function.
        key: key that distinguishes the Function from others of the system.
        inputs: symbols of the conditions by name.
        rows: conditions.
    """

    def build() -> Function:
        value = SX(1)
        for row in rows:  # comparisons with NaN are false, a maximum would drop it
            value = casadi.logic_and(value, row.residual <= row.bound)
        return Function("valid", [*inputs.values()], [value], [*inputs], ["valid"], {"cse": True})

    function: Function = system.cached(("valid", key), build)
    return function


def plain_fault(system: System, q: Vector | None, p: Vector | None) -> str:
    """Return reason and remedy of invalid quaternions or parameters; empty if they are valid.

    Args:
        system: system.
        q: (nq,) positions, or None if unknown.
        p: (np,) parameters, or None.
    """
    for part in quaternion_slices(system.tree):
        length = 1.0 if q is None else float(np.linalg.norm(q[part]))
        if not abs(length - 1) <= UNIT:
            joint = system.coordinates[part.start].joint
            return f"the quaternion of {joint} has the length {length:.6g}; divide it by its length"
    return "" if p is None else system.parameter_fault(p)
