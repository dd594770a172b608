"""Redundancy resolution: minimum-norm motion, plus gradient descent of a cost in the null space.

dx = J+ dr - k (1 - J+ J) grad H

Source: Liegeois 1977; Yoshikawa 1985 (manipulability). Closed paths of the frame do not result in
closed paths of the joints: Klein & Huang 1983.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from mbs.closed_forms.arm import Array
from mbs.errors import ModelError
from mbs.models.inverse_geometry.path_equations import (
    Follower,
)
from mbs.numbers import NONZERO
from mbs.text import did_you_mean, quoted

CRITERIA = ("minimum velocity", "limits", "manipulability")
"""Names of the built-in criteria of redundancy resolution."""
Redundancy: TypeAlias = str | Callable[[Array], Array]
"""Name from `CRITERIA`, or a function q (nq,) -> gradient (nq,) of a cost."""
_DIFFERENCE = 1e-5
"""Step of a joint [rad or arm lengths] for central differences of log manipulability. Its second
derivative is about 1 except near singular configurations."""


def slope_of(
    led: Follower, start: Array, redundancy: Redundancy | None
) -> Callable[[Array], Array] | None:
    """Return the gradient function of the redundancy cost in scaled positions, or None.

    Raises:
        ModelError: the criterion is unknown.
    """
    if callable(redundancy):
        return _given_slope(led, start, redundancy)
    if redundancy is not None and redundancy not in CRITERIA:
        raise ModelError(
            f"{led.system.name}: redundancy is {quoted(redundancy)};"
            f" {did_you_mean(redundancy, CRITERIA)}, or give a function of q that returns the"
            " gradient of a cost"
        )
    if redundancy == "limits":
        return _from_limits(*led.limits)
    return _to_manipulability(led) if redundancy == "manipulability" else None


def _given_slope(
    led: Follower, start: Array, gradient: Callable[[Array], Array]
) -> Callable[[Array], Array]:
    def slope(x: Array) -> Array:
        found = np.asarray(gradient(led.whole(start, x)), dtype=float)
        if found.shape != (start.size,) or not np.all(np.isfinite(found)):
            raise ModelError(
                f"{led.system.name}: the function given as redundancy returned {quoted(found)};"
                f" return the gradient of a cost, {start.size} finite numbers"
            )
        scaled: Array = found[list(led.indices)] * led.scale
        return scaled

    return slope


def _from_limits(low: Array, high: Array) -> Callable[[Array], Array]:
    """Return the gradient of 1/2 sum ((x - middle) / half range)^2 over the limited joints.

    Source: Liegeois 1977.
    """
    limited = np.isfinite(low) & np.isfinite(high) & (high > low)
    low, high = np.where(limited, low, 0.0), np.where(limited, high, 0.0)
    half = np.where(limited, (high - low) / 2, np.inf)
    return lambda x: (x - (low + high) / 2) / half**2


def _to_manipulability(led: Follower) -> Callable[[Array], Array]:
    """Return the gradient of -log(manipulability), the product of the singular values of J.

    Source: Yoshikawa 1985.
    """
    T = np.eye(4)  # the Jacobian does not depend on the target

    def value(x: Array) -> float:
        values = np.linalg.svd(led.rows(x, T)[1], compute_uv=False)
        kept = values[: x.size - led.slack]
        return -float(np.sum(np.log(np.maximum(kept, NONZERO))))

    def slope(x: Array) -> Array:
        moves = _DIFFERENCE * np.eye(x.size)
        rises = [value(x + move) - value(x - move) for move in moves]
        return np.array(rises) / (2 * _DIFFERENCE)

    return slope
