"""What positions an independent joint can reach on a branch, the others held."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from casadi import Function

from mbs.assembly import System
from mbs.loops.closed_form.places import independent_places
from mbs.loops.closing import Vector

_POINTS = 721
_HALVINGS = 40
_LEAST_STROKE = 1.0
_DOUBLINGS = 10


def reachable(system: System, loops: Function, q_a: Vector, p: Vector) -> str:
    """The reachable ranges of the independent joints, each with the others as given, in words.

    Args:
        system: of the loops.
        loops: a closed form, q from q_a and p.
        q_a: (m,) positions that cannot be reached.
        p: (np,) parameters.
    """
    texts = []
    for number, k in enumerate(independent_places(system)):
        if k >= system.nq:
            continue
        is_reached = _test(loops, q_a, p, number)
        intervals = _intervals(is_reached, *_span(system, k, q_a[number], is_reached))
        unit = system.coordinates[k].unit
        if intervals:
            ranges = " or ".join(f"{low:.4g} to {high:.4g}" for low, high in intervals)
            texts.append(f"{system.coordinates[k].name} can be {ranges} {unit}")
    held = ", the other positions as they are" if texts and len(system.free) > 1 else ""
    return "; ".join(texts) + held if texts else "change several positions, the branch or lengths"


def _test(loops: Function, q_a: Vector, p: Vector, number: int) -> Callable[[float], bool]:
    arguments = [p] if p.size else []

    def is_reached(value: float) -> bool:
        trial = q_a.copy()
        trial[number] = value
        return bool(np.all(np.isfinite(np.array(loops.call([trial, *arguments])[0]))))

    return is_reached


def _span(
    system: System, k: int, value: float, is_reached: Callable[[float], bool]
) -> tuple[float, float]:
    """Where to look: a whole turn, or a stroke about the assembled position that ends outside."""
    if system.coordinates[k].unit == "rad":
        return -np.pi, np.pi
    middle = system.posture[k]
    stroke = max(_LEAST_STROKE, abs(value - middle))
    for _ in range(_DOUBLINGS):
        if not is_reached(middle - stroke) and not is_reached(middle + stroke):
            break
        stroke *= 2
    return middle - stroke, middle + stroke


def _intervals(
    is_reached: Callable[[float], bool], low: float, high: float
) -> list[tuple[float, float]]:
    """The intervals between low and high in which positions are reached."""
    points = np.linspace(low, high, _POINTS)
    inside = np.array([is_reached(float(x)) for x in points])
    changes = np.flatnonzero(inside[1:] != inside[:-1])
    edges = [_edge(is_reached, float(points[k]), float(points[k + 1])) for k in changes]
    edges = [low] * bool(inside[0]) + edges + [high] * bool(inside[-1])
    return list(zip(edges[::2], edges[1::2], strict=True))


def _edge(is_reached: Callable[[float], bool], low: float, high: float) -> float:
    """Where reaching begins or ends between two positions."""
    first = is_reached(low)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if is_reached(middle) == first:
            low = middle
        else:
            high = middle
    return (low + high) / 2
