"""Robots whose frame hangs on balls or on more joints than a chain may have: legs solve it."""

from __future__ import annotations

import numpy as np

from mbs.loops.goal import goal
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.answers.solutions import Solutions
from mbs.models.inverse_geometry.answers.wishes import RobotSolution, Wishes
from mbs.models.inverse_geometry.arm import Array
from mbs.models.inverse_geometry.whole_robots.closed_robot import ClosedPosture, posed, why_searched

_SINGULAR = 1e-6


def parallel(wishes: Wishes, frame: str | int | None, T: Array, p: Array) -> Solutions:
    """Every posture that takes a frame of a robot with loops to a pose.

    Args:
        wishes: the robot, and what is asked for beside the pose.
        frame: as for `solve`.
        T: (4, 4) the wanted pose.
        p: (np,) parameters.
    """
    system = wishes.system
    name = terminal_frame(system) if frame is None else frame
    searched = why_searched(system, name)
    found = posed(system, name, T, p, wishes.near)
    method = "loops in closed form" if searched is None else "search"
    reason = "no posture closes the loops and takes the frame to the pose"
    if searched is not None:
        reason += f"; it was searched for from many starts, which proves nothing: {searched}"
    values = {a.name: float(x) for a, x in zip(system.parameters, p, strict=True)}
    wanted = goal(system, name, T, None, values)
    drafts = [_draft(posture, wanted.residual(posture.q)[1], k) for k, posture in enumerate(found)]
    return wishes.solutions(drafts, method, "" if drafts else reason)


def _draft(posture: ClosedPosture, slope: Array, number: int) -> RobotSolution:
    """A solution; its singular value is that of pose and loops together."""
    sigma = float(np.linalg.svd(slope, compute_uv=False)[-1])
    count = 1 if sigma > _SINGULAR else 0
    return RobotSolution(
        posture.q, posture.label or str(number + 1), posture.residual, sigma, count
    )
