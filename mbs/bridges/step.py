"""One step of the classical method of Runge and Kutta, as a Function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from casadi import MX, SX, Function

from mbs.bridges.explicit import Model, explicit
from mbs.errors import ModelError
from mbs.messages import quoted

_T = TypeVar("_T", SX, MX)


def step(model: Model, substeps: int = 1) -> Function:
    """``step(x, u, p, dt) -> x_next``: the classical fourth-order method, u constant.

    A Function without loops or branches, for `mbs.native.compiled`, to map over stages, and for
    `mbs.native.batch` to advance many copies of a mechanism.

    Source: Kutta 1901.

    Args:
        model: a Dae without algebraic states, or a Function of (x, u) or (x, u, p) that gives
            dx/dt.
        substeps: how many equal steps dt is divided into.

    Returns:
        a Function of SX operations where the model is one, else of MX. x (nx, 1) state,
        u (nu, 1) efforts, p (np, 1) parameters, dt [s]. Give p: CasADi takes zeros for an input
        that is left out.

    Raises:
        ModelError: the model has algebraic states or other inputs, or substeps is below 1.
    """
    ode = explicit(model)
    kind: Any = SX if ode.is_a("SXFunction") else MX
    start, u, p = (kind.sym(name, ode.size1_in(name)) for name in ("x", "u", "p"))
    dt = kind.sym("dt")
    x = advanced(lambda at: ode(at, u, p), start, dt, substeps)
    inputs = ["x", "u", "p", "dt"]
    return Function("step", [start, u, p, dt], [x], inputs, ["x_next"], {"cse": True})


def advanced(rate: Callable[[_T], _T], x: _T, duration: _T, substeps: int) -> _T:
    """States after equal steps of the classical method, for every column of x.

    Args:
        rate: dx/dt at states.
        x: states at the start.
        duration: of all steps together [s].
        substeps: how many steps.

    Raises:
        ModelError: substeps is below 1.
    """
    if isinstance(substeps, bool) or not isinstance(substeps, int) or substeps < 1:
        raise ModelError(f"substeps is {quoted(substeps)}; use 1 or more")
    h = duration / substeps
    for _ in range(substeps):
        k1 = rate(x)
        k2 = rate(x + h / 2 * k1)
        k3 = rate(x + h / 2 * k2)
        k4 = rate(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x
