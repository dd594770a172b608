"""What makes positions and parameters valid: quaternions of unit length, parameters within bounds.

Loops add rows of their own; `mbs.models.validity` has all of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly.rates import quaternion_slices
from mbs.errors import ModelError

if TYPE_CHECKING:
    from mbs.assembly.system import System

UNIT = 1e-5
"""How far the length of a quaternion may be from one: finite differences move it by 1e-6."""

Kind = Literal["quaternion", "parameter", "open", "undetermined"]
"""A quaternion not of unit length, a parameter out of its bounds, open loops, and independent
joints that do not determine the others."""


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A number of a configuration and parameters that must not be larger than its bound.

    Attributes:
        kind: what is wrong where it is larger.
        name: what it tells.
        residual: (1, 1).
        bound: (1, 1) or a number.
    """

    kind: Kind
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
        rows.append(Row("quaternion", f"quaternion of {joint}", casadi.fabs(length - 1), UNIT))
    symbols = system.symbol_table
    for name, (low, high) in system.bounds.items():
        if low is not None:
            rows.append(Row("parameter", f"least value of {name}", -symbols[name], -low))
        if high is not None:
            rows.append(Row("parameter", f"greatest value of {name}", symbols[name], high))
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


def require_plain(
    system: System, title: str, q: NDArray[np.float64] | None, p: NDArray[np.float64] | None
) -> None:
    """Refuse quaternions that are not of unit length, and parameters out of their bounds.

    Args:
        system: any.
        title: of the model, for the message.
        q: (nq, n) positions, or None.
        p: (np, n) parameters, or None.

    Raises:
        ModelError: says which and what to do.
    """
    if q is not None and len(q) == system.nq:
        for part in quaternion_slices(system.tree):
            lengths = np.linalg.norm(q[part], axis=0)
            far = lengths[np.argmax(np.abs(lengths - 1))]
            if not abs(far - 1) <= UNIT:
                joint = system.coordinates[part.start].joint
                raise ModelError(
                    f"{title}: the quaternion of {joint} has the length {far:.6g}; divide it by"
                    " its length"
                )
    if p is None or len(p) != len(system.parameters):
        return
    for k, parameter in enumerate(system.parameters):
        low, high = system.bounds.get(parameter.name, (None, None))
        if low is not None and not p[k].min() >= low:
            least = "more than zero" if low > 0 else "at least 0"
            raise ModelError(
                f"{title}: {parameter.name} = {p[k].min():.6g} has no sense; it must be {least}"
            )
        if high is not None and not p[k].max() <= high:
            raise ModelError(
                f"{title}: {parameter.name} = {p[k].max():.6g} has no sense; it must be at most"
                f" {high:g}"
            )
