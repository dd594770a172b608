"""What makes positions and parameters valid: quaternions of unit length, parameters within bounds.

Loops add rows of their own; `mbs.models.validity` has all of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly.rates import quaternion_slices

if TYPE_CHECKING:
    from mbs.assembly.system import System

Vector = NDArray[np.float64]

UNIT = 1e-5
"""How far the length of a quaternion may be from one: finite differences move it by 1e-6."""


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A number of a configuration and parameters that must not be larger than its bound.

    Attributes:
        name: what it tells.
        residual: (1, 1).
        bound: (1, 1) or a number.
    """

    name: str
    residual: SX
    bound: SX | float


def plain_rows(system: System, q: SX) -> list[Row]:
    """Rows of quaternions and of parameters that have bounds.

    Args:
        system: any.
        q: (nq, 1).
    """
    rows = []
    for part in quaternion_slices(system.tree):
        joint = system.coordinates[part.start].joint
        length = casadi.norm_2(q[part])
        rows.append(Row(f"quaternion of {joint}", casadi.fabs(length - 1), UNIT))
    symbols = system.symbol_table
    for name, (low, high) in system.bounds.items():
        if low is not None:
            rows.append(Row(f"least value of {name}", -symbols[name], -low))
        if high is not None:
            rows.append(Row(f"greatest value of {name}", symbols[name], high))
    for own in system.bounded:
        low, high = own.bounds
        if low is not None:
            rows.append(Row(f"least value of {own.name}", -own.value, -low))
        if high is not None:
            rows.append(Row(f"greatest value of {own.name}", own.value, high))
    return rows


def all_hold(system: System, key: str, q: SX, rows: Iterable[Row]) -> Function:
    """``valid(q)``, with parameters ``valid(q, p)``: 1 where every row holds, else 0, NaN too.

    Args:
        system: whose cache keeps it.
        key: tells it from others of the system.
        q: (nq, 1) symbols of the rows.
        rows: of which it is made.
    """

    def build() -> Function:
        value = SX(1)
        for row in rows:  # a comparison with NaN is false, a maximum would lose it
            value = casadi.logic_and(value, row.residual <= row.bound)
        given = {"q": q, **({"p": system.p} if system.parameters else {})}
        return Function("valid", [*given.values()], [value], [*given], ["valid"], {"cse": True})

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
