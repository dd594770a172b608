"""The longest steps that do not miss what laws have of time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from mbs.solvers.problem import NO_LIMITS, StepLimits

Array = npt.NDArray[np.float64]

_SAMPLES = 2**15
"""Samples of a motion: twenty for the half width of a pulse whose width is 1e-3 of the motion."""
_POINTS = 5
"""Points of a part by which a polynomial is laid: as many as a step of order 5 looks at."""
_MISSED = 0.02
"""Part of the range of a law by which it may differ from the polynomial: error control sees it."""


def step_limits(law: Callable[[Array], Array], begin: float, end: float) -> StepLimits:
    """The longest steps in parts of a motion, so that none passes over a short pulse.

    The motion is halved until a polynomial of degree four through five points of a part follows the
    law there. The longest step in a part is its length.

    Args:
        law: `law(times)` -> (k, n) values at times (n,).
        begin: first time [s].
        end: last time [s].

    Returns:
        no limits if the law is smooth over the whole motion.
    """
    times = np.linspace(begin, end, _SAMPLES + 1)
    values = np.atleast_2d(law(times))
    values = values[np.isfinite(values).all(axis=1)]
    reach = np.ptp(values, axis=1, keepdims=True) if len(values) else np.empty((0, 1))
    moving = reach[:, 0] > 0
    if not moving.any():
        return NO_LIMITS
    values = values[moving] / reach[moving]
    parts = [(0, _SAMPLES)]
    done: list[tuple[int, int]] = []
    while parts:
        length = parts[0][1]
        rough = _rough(values, np.array([first for first, _ in parts]), length)
        done += [part for part, is_rough in zip(parts, rough, strict=True) if not is_rough]
        half = length // 2
        parts = [
            (first + shift, half)
            for (first, _), is_rough in zip(parts, rough, strict=True)
            if is_rough
            for shift in (0, half)
        ]
        if half < _POINTS:  # as fine as the samples
            done += parts
            break
    if len(done) == 1:
        return NO_LIMITS
    done.sort()
    span = (end - begin) / _SAMPLES
    firsts, counts = np.array(done).T
    return StepLimits(times[firsts], counts * span)


def _rough(values: Array, firsts: npt.NDArray[np.int64], length: int) -> npt.NDArray[np.bool_]:
    """Whether the law leaves the polynomial in parts of one length that begin at these samples."""
    places = np.linspace(0, 1, length + 1)
    knots = np.linspace(0, 1, _POINTS)
    weights = np.array(
        [np.prod([(places - b) / (a - b) for b in knots if b != a], axis=0) for a in knots]
    )
    every = values[:, firsts[:, None] + np.arange(length + 1)]
    laid = every[:, :, :: length // (_POINTS - 1)] @ weights
    found: npt.NDArray[np.bool_] = (np.abs(every - laid) > _MISSED).any(axis=(0, 2))
    return found
