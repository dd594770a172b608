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
        tau: constants of motors by name, or all of them, or a function of (t, q, v), or None. A
            function that returns a dict names joints, also such as have no motor.

    Returns:
        the Function; None when there is no effort.

    Raises:
        ModelError: a name is unknown, an effort is of a joint that has no motor, or the efforts
            are not (nv, 1) numbers.
    """
    if tau is None:
        return None
    signal = Signal("tau", "efforts", [speed.name for speed in system.speeds])
    driven = [speed.name for speed in system.speeds if speed.actuated]
    if callable(tau):
        return signal_function(system, signal, tau, driven)
    values = SX(DM(system.effort(tau)))
    if isinstance(tau, Mapping):
        _require_motors(system, tau, driven)
    return signal_function(system, signal, values, driven)


def _require_motors(system: System, tau: Mapping[str, float], driven: Sequence[str]) -> None:
    for name in tau:
        if name not in driven:
            raise ModelError(
                f"{system.name}: tau names {name!r}, which has no motor; make that joint"
                f" actuated=True, or use one of {', '.join(driven) or '(none)'}"
            )
