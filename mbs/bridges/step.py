"""One step of the classical method of Runge and Kutta, as a Function."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import casadi
from casadi import MX, SX, Function

from mbs.bridges.explicit import Model, explicit
from mbs.errors import ModelError
from mbs.models.dae import Dae
from mbs.text import quoted

_T = TypeVar("_T", SX, MX)


_NEWTON = 1e-6
"""Largest second correction of a projection [rad or m]: the error after it is its square."""

_KINK = 0.01
"""How far velocities in the middle of a step may be from the mean of those at its ends, as a part
of the largest: what a step resolves stays far below, a change of branch is far above."""

_NO_MOTION = 1e-9
"""Kinks that move nothing further than this [rad or m] are rounding."""

_LARGEST = sys.float_info.max
"""What is not above it is a number."""


def step(model: Model, substeps: int = 1, *, checked: bool = True) -> Function:
    """``step(x, u, p, dt) -> x_next``: the classical fourth-order method, u constant.

    A Function without loops or branches, for `mbs.native.compiled`, to map over stages, and for
    `mbs.native.batch` to advance many copies of a mechanism.

    Invariants of a Dae, such as loops that are closed and quaternions of unit length, hold after
    every substep: x is moved onto them, as little as possible, by two steps of Newton's method.
    Where that fails, and where velocities of a closed mechanism have a kink within the substep,
    x_next is NaN: the loops do not close any more, the step is too long, or it passed a singular
    configuration, through which `mbs.simulate.run` goes. Of a Dae the whole of x_next is NaN also
    where an input or an element of it is no finite number, and where parameters are out of their
    bounds.

    Source: Kutta 1901; projection as in Hairer and Wanner 1996, section VII.2.

    Args:
        model: a Dae without algebraic states, or a Function of (x, u) or (x, u, p) that gives
            dx/dt.
        substeps: how many equal steps dt is divided into.
        checked: whether x_next is NaN rather than false.

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
    settle = _settle(model, checked) if isinstance(model, Dae) else None
    after = None if settle is None else lambda x, middle, end, h: settle(x, middle, end, p, h)
    x = advance(lambda at: ode(at, u, p), start, dt, substeps, after)
    if checked and isinstance(model, Dae):
        x = _flag(model, x, [start, u, p, dt])
    inputs = ["x", "u", "p", "dt"]
    return Function("step", [start, u, p, dt], [x], inputs, ["x_next"], {"cse": True})


def _flag(dae: Dae, x: Any, inputs: Sequence[Any]) -> Any:
    """The states x, all of them NaN where an input or one of them has no meaning."""
    # a sum is finite where everything is, and one comparison
    given, reached = (
        sum((casadi.sum1(value) for value in values), 0.0) for values in (inputs, [x])
    )
    holds = casadi.logic_and(casadi.fabs(given) <= _LARGEST, casadi.fabs(reached) <= _LARGEST)
    excess = Function("excess", [dae.p], [dae.excess])(inputs[2])
    for row in casadi.vertsplit(excess):
        holds = casadi.logic_and(holds, row <= 0)
    return casadi.if_else(holds, x, math.nan)


def _settle(dae: Dae, checked: bool) -> Function | None:
    """``settle(x, middle, end, p, h) -> x``: what follows a substep; None where nothing does."""
    closed = dae.x.numel() < dae.q.numel() + dae.v.numel()
    if not dae.invariants.numel() and not closed:
        return None
    n = dae.x.numel()
    start, middle, end = (SX.sym(name, n) for name in ("start", "middle", "end"))
    p, h = SX.sym("p", dae.p.numel()), SX.sym("h")
    x, holds = end, SX(1)
    if dae.invariants.numel():
        correct = _correction(dae)
        x = x + correct(x, p)
        second = correct(x, p)
        x = x + second
        holds = casadi.mmax(casadi.fabs(second)) <= _NEWTON
    if closed and checked:
        velocities = Function("v", [dae.x, dae.p], [dae.v])
        v0, v, v1 = (velocities(at, p) for at in (start, middle, x))
        kink = casadi.mmax(casadi.fabs(v - (v0 + v1) / 2))
        largest = casadi.mmax(casadi.fabs(casadi.vertcat(v0, v1)))
        smooth = casadi.logic_or(kink <= _KINK * largest, kink * casadi.fabs(h) <= _NO_MOTION)
        holds = casadi.logic_and(holds, smooth)
    if checked:
        x = casadi.if_else(holds, x, math.nan)
    return Function("settle", [start, middle, end, p, h], [x], {"cse": True})


def _correction(dae: Dae) -> Function:
    """``correction(x, p)``: the least change that brings the invariants to zero, to first order."""
    J = casadi.jacobian(dae.invariants, dae.x)
    square = casadi.mtimes(J, J.T)
    # rows that depend on others in a configuration ask for no more than these
    square += 1e-12 * casadi.trace(square) * SX.eye(square.shape[0])
    D, LT, order = casadi.ldl(casadi.sparsify(square))
    change = -casadi.mtimes(J.T, casadi.ldl_solve(dae.invariants, D, LT, order))
    return Function("correction", [dae.x, dae.p], [casadi.densify(change)], {"cse": True})


def advance(
    rate: Callable[[_T], _T],
    x: _T,
    duration: _T,
    substeps: int,
    after: Callable[[_T, _T, _T, _T], _T] | None = None,
) -> _T:
    """States after equal steps of the classical method, for every column of x.

    Args:
        rate: dx/dt at states.
        x: states at the start.
        duration: of all steps together [s].
        substeps: how many steps.
        after: what makes of the states at the start, in the middle and at the end of a step, and
            of its length, those at the end.

    Raises:
        ModelError: substeps is below 1.
    """
    if isinstance(substeps, bool) or not isinstance(substeps, int) or substeps < 1:
        raise ModelError(f"substeps is {quoted(substeps)}; use 1 or more")
    h = duration / substeps
    for _ in range(substeps):
        k1 = rate(x)
        k2 = rate(x + h / 2 * k1)
        middle = x + h / 2 * k2
        k3 = rate(middle)
        k4 = rate(x + h * k3)
        end = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        x = end if after is None else after(x, middle, end, h)
    return x
