"""Joint limits, and the whole turns by which a posture may be wound within them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted
from mbs.models.inverse_geometry.arm import Array

Given = Mapping[str, tuple[float, float] | None]
"""Limits by the name of the coordinate, None for a coordinate without."""

_TURN = 2 * math.pi
_WITHIN = 1e-9
_TURNS = 4
"""To either side of the position nearest the wanted one, at most."""
_MOST_WINDINGS = 64


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateLimits:
    """Limits of every coordinate of a system.

    Attributes:
        names: of the coordinates.
        low, high: (nq,) limits [rad or m], infinite where there is none.
        turns: (nq,) which of them may be changed by whole turns.
    """

    names: tuple[str, ...]
    low: Array
    high: Array
    turns: NDArray[np.bool_]

    def outside(self, q: Array) -> list[str]:
        """The names of the coordinates that no whole number of turns brings within limits."""
        return [self.names[k] for k in range(q.size) if not self._options(k, q[k], 0.0)]

    def windings(self, q: Array, near: Array) -> Array:
        """Postures that differ from q by whole turns and are within the limits.

        Args:
            q: (nq,) posture [rad or m].
            near: (nq,) posture by whose distance they are sorted.

        Returns:
            (w, nq), at most 64 of them; none where a coordinate cannot be brought within.
        """
        options = [self._options(k, q[k], near[k]) for k in range(q.size)]
        while math.prod(len(option) for option in options) > _MOST_WINDINGS**2:
            longest = max(range(q.size), key=lambda k: len(options[k]))
            options[longest] = options[longest][:-1]
        found = np.array(list(itertools.product(*options))).reshape(-1, q.size)
        order = np.argsort(np.linalg.norm(found - near, axis=1), kind="stable")
        nearest: Array = found[order[:_MOST_WINDINGS]]
        return nearest

    def wound(self, q: Array, near: Array) -> Array:
        """(nq,) q changed by whole turns: each coordinate within limits if it can, near `near`."""
        options = [self._options(k, q[k], near[k]) for k in range(q.size)]
        plain = np.where(self.turns, near + _remainder(q - near), q)
        return np.array([o[0] if o else x for o, x in zip(options, plain, strict=True)])

    def _options(self, k: int, value: float, near: float) -> list[float]:
        """Positions of one coordinate within its limits, the nearest first."""
        low, high = self.low[k] - _WITHIN, self.high[k] + _WITHIN
        if not self.turns[k]:
            return [value] if low <= value <= high else []
        if math.isinf(low) and math.isinf(high):
            return [value + _TURN * round((near - value) / _TURN)]
        first, last = np.ceil((low - value) / _TURN), np.floor((high - value) / _TURN)
        if first > last:
            return []
        nearest = min(max(round((near - value) / _TURN), first), last)
        turns = range(int(max(first, nearest - _TURNS)), int(min(last, nearest + _TURNS)) + 1)
        return sorted((value + _TURN * m for m in turns), key=lambda x: abs(x - near))


def bounds(
    system: System, given: bool | Given | None = None, turning: Iterable[int] | None = None
) -> CoordinateLimits:
    """The limits of a system's coordinates, some of them replaced.

    Args:
        system: whose coordinates.
        given: (lowest, highest) [rad or m] by name, None for a coordinate that has none; True,
            False and None replace nothing.
        turning: numbers of the revolute coordinates that may be changed by whole turns, all of
            them when left out.

    Raises:
        ModelError: there is no such coordinate, or limits are no dict or no pair of numbers.
    """
    names = tuple(coordinate.name for coordinate in system.coordinates)
    own = {c.name: c.limits for c in system.coordinates}
    for name, pair in _replacing(system, given).items():
        if name not in own:
            raise ModelError(
                f"{system.name}: limits are given for {quoted(name)}, which is no coordinate;"
                f" {did_you_mean(name, names)}"
            )
        own[name] = None if pair is None else _pair(system, name, pair)
    pairs = [own[name] or (-math.inf, math.inf) for name in names]
    low, high = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
    places = set(range(len(names)) if turning is None else turning)
    turns = [c.kind == "revolute" and k in places for k, c in enumerate(system.coordinates)]
    return CoordinateLimits(names, low, high, np.array(turns, dtype=bool))


def leaves_out(given: bool | Given | None) -> bool:
    """Whether limits that a user gives leave out what is beyond them."""
    return given is not None and given is not False


def _replacing(system: System, given: object) -> Given:
    if isinstance(given, Mapping):
        return given
    if given is None or isinstance(given, bool):
        return {}
    raise ModelError(
        f"{system.name}: limits is {quoted(given)}; give True for those of the robot, or a dict of"
        " names to (lowest, highest)"
    )


def _pair(system: System, name: str, pair: object) -> tuple[float, float]:
    try:
        low, high = (float(x) for x in pair)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        low = high = math.nan
    if not low <= high:
        raise ModelError(
            f"{system.name}: the limits of {name} are {quoted(pair)}; give (lowest, highest), or"
            " None for none"
        )
    return low, high


def _remainder(x: Array) -> Array:
    return np.asarray(np.mod(x + np.pi, _TURN) - np.pi)
