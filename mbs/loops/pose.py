"""The inverse geometric model by iteration: a posture that brings a frame to a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.errors import Unclosable
from mbs.loops.closing import Closed, Vector
from mbs.loops.goal import ROWS, WHOLE, Goal, goal
from mbs.loops.posture import starts
from mbs.messages import quoted

_FEWEST = 3
"""Attempts that are brought as near to an unreachable pose as they can."""


def solve_pose(
    system: System,
    frame: str | int,
    T: Any,
    *,
    rows: Sequence[str] | None = None,
    guess: Mapping[str, float] | Sequence[float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Vector:
    """A posture that closes the loops and brings a frame to a pose: the inverse geometric model.

    Gauss-Newton on the closure rows and those of the pose together, every position of the tree
    free, from the guess and then from starts ever further away, always the same ones. Which of
    several postures is found depends on the guess; `working_modes` looks for the others.

    Args:
        system: open or closed.
        frame: a body, a named frame, or the number of a link.
        T: (4, 4) wanted pose in the base, homogeneous [m]; an orientation that is orthonormal but
            for 1e-6 is rounded to the nearest one.
        rows: what of the pose counts: "x", "y", "z", "orientation", and "axis" for the z axis of
            the frame alone; the whole pose when left out. A robot of fewer than six freedoms needs
            a pose that it can take, or names, such as ["x", "y"] in a plane.
        guess: approximate positions, by name or all of them; the others as in the assembled
            posture.
        parameters: values of symbols, the others at their defaults.

    Returns:
        q (nq,) [rad or m]. The rows of the loops and of the pose are below 1e-12.

    Raises:
        Unclosable: no posture was found; the message says how near the frame comes.
        ModelError: there is no such frame, row or coordinate, or T is no pose.
    """
    wanted = goal(system, frame, T, rows, parameters)
    start = np.array(system.position(guess))
    tried: list[Closed] = []
    for q in starts(start, wanted.closing.free):
        found = wanted.nearest(q)
        if found.is_closed:
            return found.q
        tried.append(found)
    raise Unclosable(_refusal(wanted, start, tried))


def _refusal(wanted: Goal, start: Vector, tried: Sequence[Closed]) -> str:
    """Why no posture was found: the loops stay open, or the pose is out of reach."""
    closing = wanted.closing
    best = sorted(tried, key=lambda found: found.residual)[:_FEWEST]
    near = [wanted.approached(q) for q in (*(found.q for found in best), start)]
    gaps = [wanted.gap(found.q) for found in near if found.is_closed]
    title = f"{closing.system.name}: frame {quoted(wanted.frame)} cannot be brought to this pose"
    if not gaps:
        return f"{title}; the best posture found leaves {closing.gap(best[0].q)}; change the guess"
    distance, angle = min(gaps, key=lambda gap: gap[0] ** 2 + gap[1] ** 2)
    away = [f"{round(distance, 6):.4g} m away"] * bool(set(wanted.rows) & set("xyz"))
    away += [f"turned by {round(angle, 6):.4g} rad"] * bool(
        set(wanted.rows) & {"orientation", "axis"}
    )
    named = wanted.rows != WHOLE or len(closing.system.active) >= 6
    remedy = "" if named else f"name the rows=[...] that count, of {', '.join(ROWS)}, or "
    return (
        f"{title}; the nearest posture found with closed loops leaves it {' and '.join(away)};"
        f" {remedy}give another pose or guess"
    )
