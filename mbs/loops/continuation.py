"""Moving a closed posture along a line in small steps, so that it stays on its branch."""

from __future__ import annotations

import numpy as np

from mbs.assembly import System
from mbs.errors import Unclosable
from mbs.loops.closing import Closing, Vector, closure_parameters

_LARGEST_STEP = 0.2
"""Of a held position in one step [rad or m]."""
LARGEST_MOVE = 0.3
"""Of any other position from where its slope led; more may be another branch [rad or m]."""
_LONGEST_LINE = 400.0
"""Of a held position, in all [rad or m]."""
_SMALLEST_PART = 1e-4
"""Of the whole line, below which it is said to end."""


def followed_posture(system: System, target: Vector, held: tuple[int, ...], p: Vector) -> Vector:
    """The posture reached from the assembled one as its held positions, and p, move to theirs.

    Args:
        system: with loops; its posture is where the line starts.
        target: (nq,) of which the held positions count.
        held: numbers in q.
        p: (np,) values of the parameters at the end of the line.

    Returns:
        q (nq,), its held positions equal to the target's.

    Raises:
        Unclosable: the line leaves what this branch can reach; the message says where.
    """
    start, p_start = np.array(system.posture), closure_parameters(system)
    places, free = list(held), [k for k in range(system.nq) if k not in held]
    way = target[places] - start[places]
    length = float(np.max(np.abs(way), initial=0.0))
    if length > _LONGEST_LINE:
        raise Unclosable(
            f"{system.name}: a position is {length:.3g} rad or m away from the assembled posture;"
            f" give one less than {_LONGEST_LINE:g} away"
        )
    largest = min(1.0, _LARGEST_STEP / max(length, 1e-12))
    q, slope, done, part = start, np.zeros(len(free)), 0.0, largest
    while done < 1.0:
        to = min(1.0, done + part)
        trial = q.copy()
        trial[places] = target[places] if to == 1.0 else start[places] + to * way
        trial[free] += (to - done) * slope
        closing = Closing(system, p if to == 1.0 else p_start + to * (p - p_start), held)
        found = closing.nearest(trial)
        if found.is_closed and np.max(np.abs(found.q - trial), initial=0.0) < LARGEST_MOVE:
            slope = (found.q[free] - q[free]) / (to - done)
            q, done, part = found.q, to, min(2 * part, largest)
        else:
            part, slope = part / 2, slope if part > 8 * _SMALLEST_PART else np.zeros(len(free))
            if part < _SMALLEST_PART:
                raise Unclosable(
                    f"{system.name}: {closing.held_positions(target) or 'the posture'} cannot be"
                    " reached from the assembled posture, whose branch ends near"
                    f" {closing.held_positions(q) or 'it'}; give a guess of other joints to choose"
                    " another branch, or other positions"
                )
    return q
