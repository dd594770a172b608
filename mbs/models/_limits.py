"""Limits of positions, velocities and efforts as vectors, for bounds of optimal control."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real

import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.recursions.parts import PartsAt
from mbs.text import did_you_mean, quoted

Array = NDArray[np.float64]
Largest = Mapping[str, float] | None
"""Largest magnitude by the name of a velocity; it replaces the value of the description."""


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Bounds of the vectors q, v and tau; infinite for an element without a limit.

    Attributes:
        q_lower, q_upper: (nq,) position bounds [rad, m or 1].
        v_lower, v_upper: (nv,) velocity bounds [rad/s or m/s].
        tau_lower, tau_upper: (nv,) effort bounds [N m or N]; zero for a joint without a motor.
    """

    q_lower: Array
    q_upper: Array
    v_lower: Array
    v_upper: Array
    tau_lower: Array
    tau_upper: Array


def limits(system: System, *, speed: Largest = None, effort: Largest = None) -> Limits:
    """Return the bounds of positions, velocities and efforts of a system, for optimal control.

    Position bounds are the intersection of joint limits and stops. Elements of unit quaternions are
    between -1 and 1. By default velocity and effort bounds are `velocity` and `effort` of the joint
    description.

    Args:
        system: open or closed mechanism.
        speed: largest velocities by name, in both directions [rad/s or m/s].
        effort: largest efforts of motors by name, in both directions [N m or N].

    Raises:
        ModelError: a name is unknown or has no motor, a value is not a positive number, or limits
            and stops of a joint do not overlap.
    """
    require_system(system)
    q_lower, q_upper = _position_limits(system)
    for row, least, largest in zip(system.coordinates, q_lower, q_upper, strict=True):
        if least > largest:
            raise ModelError(
                f"{system.name}: limits and stops of {row.name!r} leave it nothing between"
                f" {least:g} and {largest:g}; let them overlap"
            )
    v_lower, v_upper = _bound_arrays([row.limits for row in system.velocity_coordinates])
    tau_lower, tau_upper = _bound_arrays([row.effort for row in system.velocity_coordinates])
    for number, value in _magnitudes(system, "speed", speed):
        v_lower[number], v_upper[number] = -value, value
    for number, value in _magnitudes(system, "effort", effort):
        if not system.velocity_coordinates[number].actuated:
            raise ModelError(
                f"{system.name}: effort has {system.velocity_coordinates[number].name!r}, which has"
                " no motor; leave it out, or make that joint actuated=True"
            )
        tau_lower[number], tau_upper[number] = -value, value
    still = [k for k, row in enumerate(system.velocity_coordinates) if not row.actuated]
    tau_lower[still] = tau_upper[still] = 0
    return Limits(q_lower, q_upper, v_lower, v_upper, tau_lower, tau_upper)


def _bound_arrays(ranges: list[tuple[float, float] | None]) -> tuple[Array, Array]:
    """Return arrays (n,) of lower and upper bounds; infinite for None."""
    lower, upper = zip(*(given or (-np.inf, np.inf) for given in ranges), strict=True)
    return np.array(lower, dtype=float), np.array(upper, dtype=float)


def _position_limits(system: System) -> tuple[Array, Array]:
    """Return lower and upper limits (nq,) of positions, from coordinates and from stops."""
    lower, upper = np.full(system.nq, -np.inf), np.full(system.nq, np.inf)
    for k, coordinate in enumerate(system.coordinates):
        if coordinate.kind == "quaternion":
            lower[k], upper[k] = -1.0, 1.0
        if coordinate.limits is not None:
            lower[k], upper[k] = coordinate.limits
    at = PartsAt(system, SX.sym("q", system.nq))
    for force in system.parts:
        if not force.element.has("limits"):
            continue
        for port, (least, largest) in force.element.limits(at.at(force)).items():
            levers = force.coordinates[port]
            one = len(levers) == 1 and levers[0].factor.is_one()
            place = levers[0].position if one else None
            if place is not None:
                lower[place] = max(lower[place], _limit_or(least, -np.inf))
                upper[place] = min(upper[place], _limit_or(largest, np.inf))
    return lower, upper


def _limit_or(limit: SX | None, otherwise: float) -> float:
    """Return a limit as a float, or `otherwise` if it is None or symbolic."""
    value = SX(otherwise) if limit is None else SX(limit)
    return float(value) if value.is_constant() else otherwise


def _magnitudes(system: System, what: str, given: Largest) -> list[tuple[int, float]]:
    """Return (index in v, largest magnitude) for each entry of a mapping from names to numbers.

    `what` is the argument in messages. Raise ModelError if a name is unknown, or a value is not
    positive.
    """
    if given is not None and not isinstance(given, Mapping):
        raise ModelError(
            f"{system.name}: {what} is {quoted(given)}; give a mapping from names to numbers"
        )
    names = [row.name for row in system.velocity_coordinates]
    found: list[tuple[int, float]] = []
    for name, value in (given or {}).items():
        if name not in names:
            raise ModelError(
                f"{system.name}: {what} has {quoted(name)}; {did_you_mean(str(name), names)}"
            )
        if isinstance(value, bool) or not isinstance(value, Real) or not value > 0:
            raise ModelError(
                f"{system.name}: {what} of {name!r} is {quoted(value)}; give a number above zero"
            )
        found.append((names.index(name), float(value)))
    return found
