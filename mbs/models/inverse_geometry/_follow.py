"""Path tracking in joint space: continuation of one inverse-geometry branch along poses."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Arm, Array
from mbs.closed_forms.arm_search import examine_arm
from mbs.errors import ModelError
from mbs.loops.pose import goal
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.path_equations import PathJoints, Redundancy, path_joints, smallest
from mbs.models.inverse_geometry.path_poses import Path, path_of
from mbs.models.inverse_geometry.path_state import path_state
from mbs.models.inverse_geometry.path_tracking import track
from mbs.models.inverse_geometry.solutions import Given
from mbs.text import quoted


@dataclass(frozen=True, slots=True, eq=False)
class Conditioning:
    """Data from which the smallest singular values along a path are computed.

    Attributes:
        arm: open chain of the joints, or None if the singular values are already known.
        values: (k, n) scaled configurations of `arm`, or (k,) the singular values.
    """

    arm: Arm | None
    values: Array

    def smallest(self) -> Array:
        """Return the smallest singular values (k,)."""
        if self.arm is None:
            return self.values
        q = self.values * self.arm.units
        J = examine_arm(self.arm, np.eye(4), q)[2]  # the Jacobian does not depend on the target
        return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1], dtype=float)


@dataclass(frozen=True, eq=False)
class Followed:
    """Joint path along a sequence of poses.

    Attributes:
        q: (k, nq) configurations at the reached poses [rad or m]. Angles are continuous and may
            exceed half a revolution.
        reached: index of the last reached pose, counted from 0; -1 if no pose was reached.
        reason: text that explains why the path stopped; empty if its end was reached.
        residual: (k,) largest absolute pose error or loop closure error.
        stopped_at: (nq,) last configuration; between two poses if the path stopped there.
    """

    q: Array
    reached: int
    reason: str
    residual: Array
    stopped_at: Array
    _conditioning: Conditioning = field(repr=False)

    @functools.cached_property
    def singular_values(self) -> Array:
        """Smallest singular values (k,) of the Jacobian, lengths divided by the arm length."""
        return self._conditioning.smallest()


def follow(
    system: System,
    path: Any,
    start: Any,
    frame: str | int | None = None,
    *,
    samples: int = 101,
    locked: Mapping[str, float] | None = None,
    limits: bool | Given | None = None,
    redundancy: Redundancy | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Followed:
    """Compute joint positions along a path of poses, on the branch of the start configuration.

    Between two poses of an array the frame moves along a straight line and rotates about a fixed
    axis; a function specifies any curve. Steps are small enough to stay on one branch. A singular
    configuration is crossed if the joint path is smooth there; otherwise the path stops before it,
    with a reason. With fewer than six joints every pose must be reachable, and between the poses
    the frame is as close to the line as possible.

    Args:
        system: robot, open or with closed loops. Loops keep the assembly mode of the start.
        path: (N, 4, 4) poses of the frame in the base [m], or a function that returns such a pose
            for a parameter in [0, 1].
        start: (nq,) positions near the first pose, a dict by name, or a solution with attribute
            `q`. The frame first moves from its pose at the start to the first pose.
        frame: name of a body or frame, or index of a link; default is the terminal frame.
        samples: number of poses at which a path function is evaluated.
        locked: positions of joints that do not move, by name [rad or m].
        limits: (lower, upper) by joint name, to replace limits of the model; None for an unlimited
            joint. False ignores all limits.
        redundancy: criterion for redundant joints: "minimum velocity" (default), "limits" (away
            from joint limits), "manipulability" (away from singular configurations), or a function
            that returns the gradient (nq,) of a cost at q.
        parameters: values of parameters by name; default values for all others.

    Returns:
        Configurations up to the last reached pose, and the reason if the path stopped before its
        end.

    Raises:
        ModelError: a pose, a name, a criterion or the start is invalid.
    """
    require_system(system)
    name = terminal_frame(system) if frame is None else frame
    poses = path_of(system, path, samples)
    q = _start(system, start, locked)
    target = goal(system, name, np.eye(4), None, parameters)
    joints = path_joints(target, q, locked, limits, redundancy)
    state = path_state(joints, poses, q)
    reason, number = track(state), state.number
    rows, x = np.tile(q, (number, 1)), state.found[:number]
    rows[:, list(joints.indices)] = x * joints.scale
    last, missed = joints.whole(q, state.point.x), state.residual[:number]
    return Followed(rows, number - 1, reason, missed, last, _conditioning(joints, poses, x))


def _conditioning(joints: PathJoints, poses: Path, x: Array) -> Conditioning:
    """Return the data for the smallest singular values at scaled configurations x (k, n)."""
    if joints.chain is not None:
        return Conditioning(joints.chain.arm(joints.target.closing.p), x)
    J = [joints.rows(one, T)[1] for one, T in zip(x, poses.poses, strict=False)]
    return Conditioning(None, np.array([smallest(joints, one) for one in J]))


def _start(system: System, start: Any, locked: Mapping[str, float] | None) -> Array:
    """Return the start configuration (nq,), with locked joints at their locked positions."""
    given = getattr(start, "q", start)
    q = np.array(system.position(given)) if isinstance(given, Mapping) else _numbers(system, given)
    held = np.array(system.position(locked))
    names = [coordinate.name for coordinate in system.coordinates]
    indices = [names.index(name) for name in locked or {}]
    q[indices] = held[indices]
    return q


def _numbers(system: System, given: Any) -> Array:
    try:
        q = np.array(given, dtype=float).ravel()
    except (TypeError, ValueError):
        q = np.zeros(0)
    if q.size != system.nq or not np.all(np.isfinite(q)):
        raise ModelError(
            f"{system.name}: the start is {quoted(given)}; give {system.nq} positions, or a dict of"
            " joint names to positions"
        )
    return q
