"""Joint efforts that drive a motion, in whatever form the user gives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.models.signal_function import Signal, signal_function

Effort = Mapping[str, float] | Sequence[float] | Function | Callable[[Any, Any, Any], Any] | None


def effort_function(system: System, tau: Effort) -> Function | None:
    """`tau(t, q, v, p) -> tau`, (nv, 1).

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
    signal = Signal("tau", "efforts", [speed.name for speed in system.speeds])
    if callable(tau):
        return signal_function(system, signal, tau)
    values = SX(DM(system.effort(tau)))
    _check_motors(system, tau)
    return signal_function(system, signal, values)


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
