"""Limits of joints: ranges of positions, of the velocity and of the effort of the motor."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from mbs.errors import DescriptionError
from mbs.messages import quoted

Range = tuple[float, float]


def limits_by_suffix(
    name: str, suffixes: Iterable[str], limits: Any
) -> tuple[tuple[str, Range], ...]:
    """The ranges of positions of a joint by the suffix of the coordinate.

    Args:
        name: of the joint, for errors.
        suffixes: of its coordinates of one number.
        limits: None, a pair for a joint with one coordinate, or a mapping from suffixes to pairs.

    Raises:
        DescriptionError: a range names no coordinate, or is not (lower, upper).
    """
    if limits is None:
        return ()
    known = set(suffixes)
    items: list[tuple[Any, Any]] = [("" if known == {""} else None, limits)]
    if isinstance(limits, Mapping):
        items = list(limits.items())
    elif isinstance(limits, tuple) and all(_is_named_interval(item) for item in limits):
        items = list(limits)
    return tuple((suffix, _interval(name, suffix, pair, known)) for suffix, pair in items)


def motor_range(where: str, quantity: str, given: Any) -> Range | None:
    """The range of a velocity or an effort: (-x, x) where one number x is given.

    Args:
        where: it is described, for errors.
        quantity: "velocity" or "effort".
        given: None, a number above zero, or (lower, upper) with zero between them.

    Raises:
        DescriptionError: it is something else.
    """
    if given is None:
        return None
    lower, upper = _pair(given) if np.ndim(given) else _both(given)
    if not lower < upper or lower > 0 or upper < 0:
        raise DescriptionError(
            f"{where}: {quantity} is {quoted(given)}; give the largest one, above zero, or"
            " (lower, upper) with zero between them"
        )
    return lower, upper


def _both(given: Any) -> Range:
    largest = math.nan if isinstance(given, bool) else _pair((given, given))[0]
    return -largest, largest


def _pair(pair: Any) -> Range:
    """Two numbers, NaN where there are not two."""
    try:
        low, high = (float(value) for value in pair)
    except (TypeError, ValueError):
        return math.nan, math.nan
    return low, high


def _interval(name: str, suffix: Any, pair: Any, known: set[str]) -> Range:
    if suffix not in known:
        raise DescriptionError(
            f"{name}: limits {quoted(pair)} name no coordinate of one number; "
            + (f"give a mapping from {sorted(known)}" if known else "leave them out")
        )
    low, high = _pair(pair)
    if not low < high:
        raise DescriptionError(
            f"{name}: limits {quoted(pair)} are not (lower, upper); give two numbers in order"
        )
    return low, high


def _is_named_interval(item: Any) -> bool:
    return isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], str)
