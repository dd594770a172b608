"""One step of the classical Runge-Kutta method, as a CasADi Function."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import casadi
from casadi import MX, SX, Function

from mbs.bridges.explicit import Model, explicit
from mbs.errors import ModelError
from mbs.models._dae import Dae
from mbs.text import quoted

_T = TypeVar("_T", SX, MX)


_NEWTON = 1e-6
"""Largest second Newton correction of a projection [rad or m]; the remaining error is its
square."""

_KINK = 0.01
"""Largest distance of the velocities in the middle of a step from the mean at its ends, as a
fraction of the largest velocity. A resolved step stays far below it, a change of branch is far
above."""

_NO_MOTION = 1e-9
"""Displacement [rad or m] below which a velocity kink counts as a rounding error."""

_LARGEST = sys.float_info.max
"""Values with at most this magnitude are finite numbers."""


def step(model: Model, substeps: int = 1, *, checked: bool = True) -> Function:
    """``step(x, u, p, dt) -> x_next``: classical fourth-order Runge-Kutta step with constant u.

    The Function has no loops or branches. It can be compiled by `mbs.native.compiled`, mapped over
    stages, and used by `mbs.native.batch` to advance many copies of a mechanism.

    Invariants of a Dae, such as closed loops and quaternions of unit length, hold after every
    substep: x is projected onto them by two Newton steps of minimum norm. x_next is NaN if the
    projection fails or if the velocities of a closed mechanism have a kink within the substep. The
    loops can then no longer be closed, the step is too long, or it crosses a singular
    configuration; `mbs.simulate.run` can cross it. For a Dae, all of x_next is also NaN if an input
    or an element of x_next is not finite, or if parameters are out of bounds.

    Source: Kutta 1901; projection as in Hairer and Wanner 1996, section VII.2.

    Args:
        model: Dae without algebraic states, or Function of (x, u) or (x, u, p) that returns dx/dt.
        substeps: number of equal steps in dt.
        checked: whether x_next is set to NaN if it is invalid.

    Returns:
        Function of SX operations if the model is an SX Function, otherwise of MX operations. Its
        inputs are the state x (nx, 1), efforts u (nu, 1), parameters p (np, 1) and dt [s]. Always
        pass p, since CasADi uses zeros for omitted inputs.

    Raises:
        ModelError: the model has algebraic states or other inputs, or substeps is less than 1.
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
    """Return the states x, all NaN if an input or a state is invalid."""
    # a sum is finite if all its terms are finite, and needs only one comparison
    given, reached = (
        sum((casadi.sum1(value) for value in values), 0.0) for values in (inputs, [x])
    )
    holds = casadi.logic_and(casadi.fabs(given) <= _LARGEST, casadi.fabs(reached) <= _LARGEST)
    excess = Function("excess", [dae.p], [dae.excess])(inputs[2])
    for row in casadi.vertsplit(excess):
        holds = casadi.logic_and(holds, row <= 0)
    return casadi.if_else(holds, x, math.nan)


def _settle(dae: Dae, checked: bool) -> Function | None:
    """Return ``settle(x, middle, end, p, h) -> x``: correction of the states after a substep.

    x are the states at its start. None if the Dae has neither invariants nor loops.
    """
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
    """Return ``correction(x, p)``: minimum-norm Newton step towards zero invariants."""
    J = casadi.jacobian(dae.invariants, dae.x)
    square = casadi.mtimes(J, J.T)
    # regularisation for dependent rows in some configurations
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
    """Return the states after equal Runge-Kutta steps, for every column of x.

    Args:
        rate: function that returns dx/dt at states.
        x: states at the start.
        duration: duration of all steps together [s].
        substeps: number of steps.
        after: callable (x_start, x_mid, x_end, h) -> x that corrects the states at the end of each
            step of length h [s], such as a projection; None for no correction.

    Raises:
        ModelError: substeps is less than 1.
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
