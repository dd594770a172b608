"""Joint efforts of a simulation, in whatever form the user gives them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import quoted

Effort = Mapping[str, float] | Sequence[float] | Function | Callable[[Any, Any, Any], Any] | None
_LONGEST_REASON = 200


def effort_function(system: System, tau: Effort) -> Function | None:
    """`effort(t, q, v, p) -> tau`, (nv, 1).

    Args:
        system: open or closed.
        tau: constants by name, or all of them, or a function of (t, q, v), or None.

    Returns:
        the Function; None when there is no effort.

    Raises:
        ModelError: a name is unknown or has no motor, or the efforts are not (nv, 1) numbers.
    """
    if tau is None:
        return None
    t, q, v = SX.sym("t"), SX.sym("q", system.nq), SX.sym("v", system.nv)
    if callable(tau):
        values = _traced(system, tau, (t, q, v))
    else:
        values = SX(DM(system.effort(tau)))
        _check_motors(system, tau)
    if values.numel() != system.nv:
        names = ", ".join(speed.name for speed in system.speeds)
        raise ModelError(
            f"{system.name}: tau has {values.numel()} values, the system has {system.nv}: {names}"
        )
    inputs = [t, q, v, system.p]
    effort = Function("effort", inputs, [casadi.densify(values)], {"allow_free": True})
    if effort.has_free():
        raise ModelError(
            f"{system.name}: tau(t, q, v) holds the symbols {', '.join(effort.get_free())};"
            " make it of t, q, v and numbers"
        )
    return effort


def _check_motors(system: System, tau: Mapping[str, float] | Sequence[float]) -> None:
    if not isinstance(tau, Mapping):
        return
    driven = [speed.name for speed in system.speeds if speed.actuated]
    for name in tau:
        if name not in driven:
            raise ModelError(
                f"{system.name}: tau names {name!r}, which has no motor; make that joint"
                f" actuated=True, or use one of {', '.join(driven) or '(none)'}"
            )


def _traced(system: System, tau: Callable[..., Any], point: tuple[SX, SX, SX]) -> SX:
    """The efforts as an expression of t, q and v."""
    _check_inputs(system, tau, point)
    try:
        values = tau(*point)
    except Exception as error:
        raise ModelError(
            f"{system.name}: tau(t, q, v) could not be traced with CasADi symbols"
            f" ({_reason(error)}); build it from CasADi operations, such as casadi.sin and"
            " casadi.if_else"
        ) from error
    try:
        result = _column(values)
    except Exception:
        result = None
    if result is None or (not casadi.symvar(result) and not casadi.evalf(result).is_regular()):
        raise ModelError(
            f"{system.name}: tau(t, q, v) returns {quoted(values)}; return {system.nv} efforts,"
            " finite numbers or CasADi expressions of t, q and v"
        )
    return result


def _column(values: Any) -> SX:
    if isinstance(values, np.ndarray):
        values = list(values.ravel())
    if isinstance(values, (list, tuple)):
        return SX(casadi.vertcat(*values))
    return casadi.vec(SX(values))


def _check_inputs(system: System, tau: Callable[..., Any], point: tuple[SX, SX, SX]) -> None:
    if isinstance(tau, Function):
        sizes = [tau.numel_in(k) for k in range(tau.n_in())]
        wanted = [symbol.numel() for symbol in point]
        if sizes != wanted or tau.n_out() != 1:
            raise ModelError(
                f"{system.name}: tau has inputs of sizes {sizes} and {tau.n_out()} outputs; give a"
                f" Function of (t, q, v), of sizes {wanted}, with one output"
            )
        return
    try:
        inspect.signature(tau).bind(*point)
    except TypeError:
        raise ModelError(
            f"{system.name}: tau does not take three arguments; give a function of (t, q, v)"
        ) from None
    except ValueError:  # no signature is known: the call will tell
        return


def _reason(error: Exception) -> str:
    """The first sentence of an error; CasADi adds lists of prototypes and places in its code."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    text = lines[0] if lines else type(error).__name__
    if text.startswith("Wrong number or type of arguments"):
        text = "an operation of CasADi was given what it does not take"
    return text[:_LONGEST_REASON]
