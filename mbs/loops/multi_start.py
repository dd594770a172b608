"""Postures that close the loops with some positions held, as far as random starts lead there."""

from __future__ import annotations

import numpy as np

from mbs.assembly.rates import quaternion_slices
from mbs.loops.alike import difference, within_half_turn
from mbs.loops.closing import OPEN, Closing, Vector

_TRIES, _LEAST, _SEED = 300, 40, 20260107
_REACH = np.pi
_SAME = 1e-6


def closed_postures(closing: Closing, start: Vector) -> list[Vector]:
    """Postures found by Gauss-Newton from random starts, always the same ones.

    The search ends early after at least 40 starts, once the last three quarters led to nothing new
    and every posture was met twice.

    Args:
        closing: the rows, and the positions that are held.
        start: (nq,) of which the held positions count; the starts are taken about the others.

    Returns:
        Postures (nq,) with angles within half a turn of zero; nothing proves that these are all.
    """
    rng = np.random.default_rng(_SEED)
    found, hits, newest = list[Vector](), list[int](), 0
    for number in range(1, _TRIES + 1):
        closed = closing.nearest(_moved(closing, start, rng) if number > 1 else start)
        if closed.is_closed:
            q = _tidy(closing, closed.q)
            met = [k for k, other in enumerate(found) if _distance(closing, q, other) < _SAME]
            for k in met[:1]:
                hits[k] += 1
            if not met:
                found, hits, newest = [*found, q], [*hits, 1], number
        if number >= max(_LEAST, 4 * newest) and all(count > 1 for count in hits):
            break
    return found


def _moved(closing: Closing, start: Vector, rng: np.random.Generator) -> Vector:
    q = start.copy()
    q[closing.free] += rng.uniform(-_REACH, _REACH, len(closing.free))
    for part in quaternion_slices(closing.system.tree):
        q[part] /= np.linalg.norm(q[part])
    return q


def _tidy(closing: Closing, q: Vector) -> Vector:
    """The posture with small angles where that is the same one: not so across a gear."""
    tidy = within_half_turn(closing.system, q)
    tidy[list(closing.held)] = q[list(closing.held)]
    return tidy if closing.openness(tidy) < OPEN else q


def _distance(closing: Closing, q: Vector, other: Vector) -> float:
    return float(np.max(np.abs(difference(closing.system, q, other)), initial=0.0))
