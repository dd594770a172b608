"""What makes positions and parameters valid: quaternions of unit length, parameters within bounds.

Loops add rows of their own; `mbs.models.validity` has all of them.
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
"""How far the length of a quaternion may be from one: finite differences move it by 1e-6."""

Kind = Literal["quaternion", "parameter", "open", "undetermined"]
"""A quaternion not of unit length, a parameter out of its bounds, open loops, and independent
joints that do not determine the others."""


@dataclass(frozen=True, slots=True, eq=False)
class ValidityRow:
    """A number of a configuration and parameters that must not be larger than its bound.

    Attributes:
        kind: what is wrong where it is larger.
        name: what it states.
        residual: (1, 1).
        bound: (1, 1) or a number.
        sentence: what is wrong where it is larger, and what to do.
    """

    kind: Kind
    name: str
    residual: SX
    bound: SX | float
    sentence: str


def plain_rows(system: System, q: SX) -> list[ValidityRow]:
    """Rows of quaternions, of parameters that have bounds, and of what is computed from them.

    Args:
        system: any.
        q: (nq, 1).
    """
    quaternions = quaternion_rows(system, q, quaternion_slices(system.tree))
    return [*quaternions, *_parameter_rows(system), *field_rows(system)]


def quaternion_rows(system: System, q: SX, parts: Iterable[slice]) -> list[ValidityRow]:
    """The lengths of some quaternions.

    Args:
        system: any.
        q: (nq, 1).
        parts: where they stand in q.
    """
    rows = []
    for part in parts:
        joint = system.coordinates[part.start].joint
        away = casadi.fabs(casadi.norm_2(q[part]) - 1)
        wrong = f"the quaternion of {joint} is not of unit length; divide it by its length"
        rows.append(ValidityRow("quaternion", f"quaternion of {joint}", away, UNIT, wrong))
    return rows


def _parameter_rows(system: System) -> list[ValidityRow]:
    symbols = system.symbol_table
    bounds = system.bounds.items()
    return [row for name, own in bounds for row in _bound_rows(name, symbols[name], own)]


def field_rows(system: System) -> list[ValidityRow]:
    """What is computed from parameters, such as a mass of "M1 + M2", and has bounds.

    Args:
        system: any.
    """
    return [row for own in system.bounded for row in _bound_rows(own.name, own.value, own.bounds)]


def _bound_rows(name: str, value: SX, bounds: Bounds) -> list[ValidityRow]:
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
    """``valid(..)`` of the inputs: 1 where every row holds, else 0, NaN too.

    Args:
        system: whose cache keeps it.
        key: distinguishes it from others of the system.
        inputs: the symbols of the rows by name.
        rows: of which it is made.
    """

    def build() -> Function:
        value = SX(1)
        for row in rows:  # a comparison with NaN is false, a maximum would lose it
            value = casadi.logic_and(value, row.residual <= row.bound)
        return Function("valid", [*inputs.values()], [value], [*inputs], ["valid"], {"cse": True})

    function: Function = system.cached(("valid", key), build)
    return function


def plain_fault(system: System, q: Vector | None, p: Vector | None) -> str:
    """What is wrong with a configuration or parameters and what to give; empty where nothing is.

    Args:
        system: any.
        q: (nq,) positions, or None where they are not known.
        p: (np,) parameters, or None.
    """
    for part in quaternion_slices(system.tree):
        length = 1.0 if q is None else float(np.linalg.norm(q[part]))
        if not abs(length - 1) <= UNIT:
            joint = system.coordinates[part.start].joint
            return f"the quaternion of {joint} has the length {length:.6g}; divide it by its length"
    return "" if p is None else system.parameter_fault(p)
