"""Sampled positions of redundant joints, for arms with more joints than a pose determines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from mbs.assembly import System
from mbs.closed_forms.arm import Array
from mbs.errors import ModelError
from mbs.models.inverse_geometry.solutions import Given, bounds
from mbs.text import did_you_mean, quoted

Redundant: TypeAlias = Mapping[str, Any]
"""Samples by joint name: number of positions, or positions (S,), or (N, S) for N poses."""
Locked: TypeAlias = Mapping[str, Any]
"""Positions by joint name [rad or m]: one for all poses, or (N,) one for each of N poses."""

_TURN = 2 * math.pi
_MOST = 10_000_000
"""Maximum number of samples of one call: their configurations take some gigabytes of memory."""


@dataclass(frozen=True, slots=True, eq=False)
class LockedSamples:
    """Positions of locked joints for N poses with S samples each.

    Attributes:
        locked: positions of joints that are constant over all poses and samples, by name [rad or
            m].
        varied: names of the k joints whose positions vary.
        r: (N, S, k) positions of the varied joints [rad or m].
    """

    locked: Mapping[str, float]
    varied: tuple[str, ...]
    r: Array


def samples_of(
    system: System,
    locked: Locked | None,
    redundant: Redundant | None,
    limits: bool | Given | None,
    count: int,
) -> LockedSamples:
    """Combine locked positions and samples of redundant joints for N poses.

    Args:
        system: system of the joints.
        locked: position of each locked joint, or one position per pose.
        redundant: samples of each redundant joint; several joints form all combinations.
        limits: argument of `solve`; a number of samples is spread evenly between the limits.
        count: number N of poses.

    Raises:
        ModelError: an argument is no dict, a joint is unknown or in both, or positions have a wrong
            shape or value.
    """
    for what, given in (("locked", locked), ("redundant", redundant)):
        if given is not None and not isinstance(given, Mapping):
            raise ModelError(
                f"{system.name}: {what} is {quoted(given)}; give a dict of joint names to positions"
            )
    fixed, moving = dict(locked or {}), dict[str, Array]()
    for name in [name for name, value in fixed.items() if np.ndim(value) > 0]:
        moving[name] = _one_per_pose(system, name, fixed.pop(name), count)
    columns = list[Array]()
    for name, value in (redundant or {}).items():
        if name in (locked or {}):
            raise ModelError(
                f"{system.name}: joint {quoted(name)} is both locked and redundant; name it once"
            )
        columns.append(_positions(system, name, value, limits, count))
    varied = (*moving, *(redundant or {}))
    number = math.prod(column.shape[1] for column in columns)
    _require_few(system, ", ".join(redundant or {}), number, count)
    r = np.empty((count, number, len(varied)))
    for k, one in enumerate(moving.values()):
        r[:, :, k] = one[:, None]
    for k, column in enumerate(columns):
        # the first joint varies slowest
        repeat = math.prod(other.shape[1] for other in columns[k + 1 :])
        spread = np.repeat(column, repeat, axis=1)
        r[:, :, len(moving) + k] = np.tile(spread, number // max(spread.shape[1], 1))
    return LockedSamples(fixed, varied, r)


def _require_few(system: System, names: str, number: int, count: int) -> None:
    if number * count > _MOST:
        raise ModelError(
            f"{system.name}: {number} positions of {names} at each of {count} poses are more than"
            f" {_MOST} in all; ask for fewer"
        )


def _one_per_pose(system: System, name: str, value: Any, count: int) -> Array:
    found = _numbers(value)
    if found is None or found.shape != (count,):
        shape = "" if found is None else f" of shape {found.shape}"
        raise ModelError(
            f"{system.name}: locked positions of {quoted(name)} are {quoted(value)}{shape}; give"
            f" one number, or one for each of the {count} poses; many for one pose are given with"
            " redundant="
        )
    return found


def _positions(
    system: System, name: str, value: Any, limits: bool | Given | None, count: int
) -> Array:
    """Return the positions (N, S) of a redundant joint [rad or m]."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        _require_few(system, name, int(value), count)
        return np.tile(_spread(system, name, int(value), limits), (count, 1))
    found = _numbers(value)
    if found is not None and found.ndim == 1 and found.size:
        return np.tile(found, (count, 1))
    if found is not None and found.ndim == 2 and len(found) == count and found.shape[1]:
        return found
    shape = "" if found is None or not found.ndim else f" of shape {found.shape}"
    raise ModelError(
        f"{system.name}: redundant positions of {quoted(name)} are {quoted(value)}{shape}; give how"
        f" many (a whole number), the positions (S,), or those of each pose ({count}, S); a joint"
        " that stays at one position is given with locked="
    )


def _numbers(value: Any) -> Array | None:
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return None
    return found if np.all(np.isfinite(found)) else None


def _spread(system: System, name: str, number: int, limits: bool | Given | None) -> Array:
    """Return `number` positions evenly spread between the limits, or over one revolution."""
    if number < 1:
        raise ModelError(
            f"{system.name}: {number} redundant positions of {quoted(name)}; give one at least"
        )
    within = bounds(system, limits)
    if name not in within.names:
        raise ModelError(
            f"{system.name}: there is no joint {quoted(name)} to be redundant;"
            f" {did_you_mean(name, within.names)}"
        )
    index = within.names.index(name)
    low, high = float(within.low[index]), float(within.high[index])
    revolute = bool(within.turns[index])
    if revolute and high - low >= _TURN:
        # the end of a revolution equals its start; infinite limits start at -pi
        first = -math.pi if math.isinf(low) else low
        turn: Array = np.arange(number, dtype=np.float64) * (_TURN / number)
        return first + turn
    if math.isinf(high - low):
        raise ModelError(
            f"{system.name}: joint {quoted(name)} has no limits between which {number} positions"
            " lie; give the positions themselves, or limits="
        )
    if number == 1:
        return np.array([(low + high) / 2])
    found: Array = np.linspace(low, high, number, dtype=np.float64)
    return found
