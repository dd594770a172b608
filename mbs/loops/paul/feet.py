"""The frames of a loop put where neighbouring axes are nearest to each other.

Points where axes meet are then origins of frames, however the loop was described.

Source: Khalil & Kleinfinger 1986, whose frames have their origins so.
"""

from __future__ import annotations

from dataclasses import replace

import casadi
import numpy as np
from casadi import SX

from mbs.loops.closed_form.ring import Gap, Ring
from mbs.loops.sequence import Problem
from mbs.spatial import Pose, vector

_ZERO = 1e-9


def at_feet(problem: Problem) -> Ring:
    """The loop of a problem, the frame of each turning joint moved along its axis.

    The foot of the common normal with the axis that follows becomes the origin, where that way is
    not the first one of the loop, through the known pose.
    """
    ring = problem.ring
    for k in range(len(ring.joints) - 1):
        here, after = ring.joints[k], ring.joints[k + 1]
        if here.turns and after.turns and not ring.gaps[k + 1].pivots:
            ring = _moved(problem, ring, k)
    return ring


def _moved(problem: Problem, ring: Ring, k: int) -> Ring:
    """The loop with the origin of joint k at the foot of the normal to the next axis."""
    pose = ring.gaps[k + 1].pose
    axis, cosine = pose.R[:, 2], pose.R[2, 2]
    sine2 = axis[0] ** 2 + axis[1] ** 2
    across = pose.p[2] * sine2 - (pose.p[0] * axis[0] + pose.p[1] * axis[1]) * cosine
    values = np.array(problem.at_samples(casadi.vertcat(sine2, across)))
    if np.max(np.abs(values[:, 1])) < _ZERO or np.min(np.abs(values[:, 0])) < _ZERO:
        return ring
    along = SX(across / sine2)
    to, back = (Gap(Pose.moved(vector([0, 0, sign * along]))) for sign in (1, -1))
    gaps = list(ring.gaps)
    gaps[k] = to.after(gaps[k])
    gaps[k + 1] = gaps[k + 1].after(back)
    return replace(ring, gaps=tuple(gaps))
