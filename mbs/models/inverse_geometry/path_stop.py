"""Error texts for a path that could not be followed to its end."""

from __future__ import annotations

import math

import numpy as np

from mbs.closed_forms.arm import Array, gap_to
from mbs.models.inverse_geometry.path_equations import (
    AT_POSE,
    PathJoints,
    smallest,
)
from mbs.models.inverse_geometry.path_poses import Path
from mbs.models.inverse_geometry.path_steps import nearest_solution, residual_of
from mbs.models.inverse_geometry.solutions import apart
from mbs.models.inverse_geometry.target import SINGULAR_ERROR
from mbs.solvers.least_squares import gauss_newton, levenberg_marquardt

_AT_LIMIT = 1e-6
"""Distance from a joint limit [rad or m] below which the limit is the reason to stop. Step halving
ends much nearer, and a stop for another reason is rarely so near."""
_STARTS, _SEED = 6, 20260109
"""Starts for the nearest pose: the last configuration, then random ones at growing distances up to
one radian. They decide only between two error texts. Seed of the random numbers."""
_NUDGE = 1e-3
"""Move of a joint [rad or arm lengths] to find the joint that changes the smallest singular value
most: longer than the distance to the singular configuration (1e-7), shorter than to the next."""


def stop_reason(joints: PathJoints, poses: Path, number: int, q: Array, at: float) -> str:
    """Return the text that explains why a pose was not reached.

    Args:
        joints: joints that track the path.
        poses: path.
        number: index of the pose.
        q: (nq,) last configuration.
        at: position of the last configuration between the preceding pose (0) and this pose (1).
    """
    x, T = joints.scaled(q), poses.poses[number]
    title = f"pose {number} of {poses.count}"
    if at == 1.0:
        return f"{title} is not one that the joints can take: {_miss(joints, q, T)}"
    passed = joints.passed(x, _AT_LIMIT)
    if passed is not None:
        index, limit = passed
        name = joints.system.coordinates[index].name
        return f"joint {name} passes its limit {limit:.6g} before {title}"
    nearest, left = _nearest(joints, x, T)
    if left > SINGULAR_ERROR:
        return f"{title} is out of reach: {_miss(joints, joints.whole(q, nearest), T)}"
    where = f"between the start and pose 0 of {poses.count}"
    if number:
        part = (number - 1 + at) / (poses.count - 1)
        where = (
            f"between poses {number - 1} and {number} of {poses.count}, at {part:.4g} of the path"
        )
    behind = _jump(joints, x, poses.poses[min(number + (1 - at < AT_POSE), poses.count - 1)])
    beyond = _start_beyond(joints, x, poses, number) if at < AT_POSE else ""
    return f"stopped {where}: singular configuration, {_singular(joints, q)}{behind}{beyond}"


def _start_beyond(joints: PathJoints, x: Array, poses: Path, number: int) -> str:
    """Text on how to go on from a singular pose: by a start at the pose that follows it.

    Empty for the way to the first pose, and if no solution was found.
    """
    if joints.redundant or not number:
        return ""
    found = nearest_solution(joints, x, poses.poses[number])
    if found is None:
        return ""
    start = ", ".join(f"{float(value):.6g}" for value in found * joints.scale)
    return (
        f"; branches part at this pose: follow the path from pose {number} on with a start on one"
        f" of them, such as {start}, or another solution of inverse_geometry.solve for this pose"
    )


def _jump(joints: PathJoints, x: Array, T: Array) -> str:
    """Text on the joint that would jump most to the solution past the singular configuration.

    For redundant joints: text if no solution near x was found.
    """
    behind = nearest_solution(joints, x, T)
    if joints.redundant and behind is None and joints.chain is not None:
        return (
            "; beside it no configuration was found for the pose behind, as where what is redundant"
            " has no room left; another redundancy or another start may lead past"
        )
    if joints.redundant or behind is None:
        return ""
    farthest = int(np.argmax(np.abs(behind - x)))
    coordinate = joints.system.coordinates[joints.indices[farthest]]
    move = abs(float(behind[farthest] - x[farthest])) * float(joints.scale[farthest])
    far = f"{math.degrees(move):.4g} degrees" if coordinate.unit == "rad" else f"{move:.4g} m"
    return (
        "; no configuration behind it goes on smoothly, in the nearest one"
        f" {coordinate.name} is {far} away"
    )


def _miss(joints: PathJoints, q: Array, T: Array) -> str:
    gap = gap_to(T, joints.pose(q))
    distance, angle = float(np.linalg.norm(gap[:3])), float(np.linalg.norm(gap[3:]))
    return f"the nearest configuration found leaves the frame {apart(distance, angle)}"


def _nearest(joints: PathJoints, x: Array, T: Array) -> tuple[Array, float]:
    """Return the best least-squares configuration (n,) of several starts, and its pose error."""
    residual = residual_of(joints, T)
    rng = np.random.default_rng(_SEED)
    best, least = x, np.inf
    for k in range(_STARTS):
        low = levenberg_marquardt(residual, x + rng.uniform(-1, 1, x.size) * k / _STARTS)
        root = gauss_newton(residual, low.x)
        left = float(np.max(np.abs(joints.rows(root.x, T)[0])))
        if left < least:
            best, least = root.x, left
        if least < SINGULAR_ERROR:
            break
    return best, least


def _singular(joints: PathJoints, q: Array) -> str:
    """Text with the smallest singular value and the joint on which it depends most."""
    x, T = joints.scaled(q), joints.pose(q)

    def value(y: Array) -> float:
        return smallest(joints, joints.rows(y, T)[1])

    moved = np.eye(x.size) * _NUDGE
    rises = [value(x + step) + value(x - step) for step in moved]
    index = joints.indices[int(np.argmax(rises))]
    name = joints.system.coordinates[index].name
    return f"{name} = {q[index]:.3f}, smallest singular value {round(value(x), 12):.1g}"
