"""Inputs of the devices of drive lines, in whatever form the user gives them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted
from mbs.models.effort import Effort
from mbs.models.signal_function import Signal, signal_function

Array = NDArray[np.float64]


def input_function(system: System, u: Effort) -> Function | None:
    """`u(t, q, v, p) -> u`, (nu, 1), one input for each device.

    Args:
        system: open or closed.
        u: constants by the name of the device, or all of them, or a function of (t, q, v), or
            None for zeros.

    Returns:
        the Function; None where nothing is given.

    Raises:
        ModelError: a name is unknown, or the inputs are not (nu, 1) numbers.
    """
    if u is None:
        return None
    signal = Signal("u", "inputs", [device.input[0] for device in system.devices])
    if not system.devices:
        raise ModelError(
            f"{system.name}: u is given, but no motor and no torque is connected to a flange;"
            " leave u out, or give the efforts tau of the joints"
        )
    if callable(u):
        return signal_function(system, signal, u)
    if isinstance(u, Mapping):
        names = [device.name for device in system.devices]
        return signal_function(system, signal, SX(DM(_by_name(system, "u", u, names))))
    return signal_function(system, signal, SX(DM(_numbers(system, "u", u))))


def device_states(system: System, z0: Mapping[str, float] | Sequence[float] | None) -> list[float]:
    """The states of the devices at the start, zero where none is given.

    Args:
        system: open or closed.
        z0: by name, such as `motor.i`, or all of them.

    Raises:
        ModelError: a name is unknown, or a value is no number.
    """
    names = [name for device in system.devices for name, _ in device.states]
    if z0 is None or isinstance(z0, Mapping):
        return _by_name(system, "z0", z0 or {}, names)
    values = _numbers(system, "z0", z0)
    if len(values) != len(names):
        raise ModelError(
            f"{system.name}: z0 has {len(values)} values, the devices have {len(names)} states:"
            f" {', '.join(names)}"
        )
    return values


def device_columns(
    system: System, u: Array, z: Array, y: Array
) -> Iterator[tuple[str, str, Array]]:
    """Name, unit and values of all that a result shows of devices, from inputs, states, outputs.

    Args:
        system: open or closed.
        u: (m, nu) inputs at m instants.
        z: (m, nz) states.
        y: (m, ny) outputs.
    """
    tables = (
        ([device.input for device in system.devices], u),
        ([state for device in system.devices for state in device.states], z),
        ([output for device in system.devices for output in device.outputs], y),
    )
    for quantities, values in tables:
        for column, (name, unit) in enumerate(quantities):
            yield name, unit, values[:, column]


def _by_name(
    system: System, what: str, values: Mapping[str, float], names: Sequence[str]
) -> list[float]:
    result = [0.0] * len(names)
    for name, value in values.items():
        if name not in names:
            raise ModelError(f"{system.name}: {what} names {name!r}; {did_you_mean(name, names)}")
        (result[names.index(name)],) = _numbers(system, f"{what} of {name}", [value])
    return result


def _numbers(system: System, what: str, values: Any) -> list[float]:
    try:
        numbers = [float(value) for value in values]
    except (TypeError, ValueError):
        numbers = [math.nan]
    if not all(map(math.isfinite, numbers)):
        raise ModelError(f"{system.name}: {what} is {quoted(values)}; give finite numbers")
    return numbers
