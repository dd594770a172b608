"""Inputs and initial states of the devices of drive lines, from all accepted forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.models.state.signals import (
    Effort,
    LawArgument,
    by_name,
    signal_function,
)
from mbs.numbers import is_vector, numbers_given
from mbs.text import quoted


def input_function(system: System, u: Effort) -> Function | None:
    """Return the Function `u(t, q, v, p) -> u` of the device inputs, (nu, 1).

    Args:
        system: open or closed system.
        u: dict of constants by device name, sequence of all nu inputs, function of (t, q, v), or
            None for the defaults `system.u_default`.

    Returns:
        Function of the inputs. None if `u` is None or empty.

    Raises:
        ModelError: a name is unknown, or the inputs are not (nu, 1) numbers.
    """
    if u is None or (isinstance(u, Mapping) and not u):
        return None
    signal = LawArgument("u", "inputs", [name for name, _ in system.inputs])
    if not system.inputs:
        raise ModelError(
            f"{system.name}: u is given, but no motor and no torque is connected to a flange, and"
            " no other component has an input; leave u out, or give the efforts tau of the joints"
        )
    if callable(u):
        return signal_function(system, signal, u)
    if isinstance(u, Mapping):
        values = by_name(system, "u", u, system.inputs, system.u_default)
        return signal_function(system, signal, SX(DM(values)))
    return signal_function(system, signal, SX(DM(_finite_values(system, "u", u))))


def device_states(system: System, z0: Mapping[str, float] | Sequence[float] | None) -> list[float]:
    """Return the states of the devices at the start.

    Args:
        system: open or closed system.
        z0: dict of states by name, such as `motor.i`, or sequence of all states. A state without
            value starts at its default `system.component_start`.

    Raises:
        ModelError: a name is unknown, the number of values is wrong, or a value is not finite.
    """
    if z0 is None or isinstance(z0, Mapping):
        return list(by_name(system, "z0", z0, system.states, system.component_start))
    names, values = [name for name, _ in system.states], _finite_values(system, "z0", z0)
    if len(values) != len(names):
        raise ModelError(
            f"{system.name}: z0 has {len(values)} values, the devices have {len(names)} states:"
            f" {', '.join(names)}"
        )
    return values


def _finite_values(system: System, what: str, values: Any) -> list[float]:
    array = numbers_given(values)
    vector = not isinstance(array, str) and array.ndim > 0 and is_vector(array.shape)
    if isinstance(array, str) or not vector or not np.isfinite(array).all():
        raise ModelError(f"{system.name}: {what} is {quoted(values)}; give finite numbers")
    return [float(value) for value in array.ravel()]
