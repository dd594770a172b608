"""The price of a result, by which one of several ways to it is chosen."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.operations import count


def cost(value: SX, q: SX, p: SX) -> int:
    """The price of a matrix; see `mbs.operations.counts.Count.price`.

    Args:
        value: of the symbols q and p.
        q: (nq, 1) positions.
        p: (np, 1) parameters; operations on them alone are free.
    """
    names = ["q", "p"], ["value"]
    f = Function("f", [q, p], [casadi.densify(value)], *names, {"cse": True})
    return count(f).price
