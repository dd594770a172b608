"""Choice of a branch: vectorised tracking of one branch of a closed form.

A branch is a continuous function of the pose until one of its roots becomes double or a joint
becomes undetermined, that is until an indicator of the closed form vanishes. It is assumed not to
vanish between two poses if the smallest indicator is nearly equal at both, and also in the
intervals before and after. All other intervals are tracked step by step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Arm, Array
from mbs.models.inverse_geometry.closed_form import sequence_or_none
from mbs.models.inverse_geometry.draft_many import evaluate_branches
from mbs.models.inverse_geometry.path_equations import (
    LARGEST_STEP,
    PathJoints,
)
from mbs.models.inverse_geometry.path_poses import Path
from mbs.models.inverse_geometry.solutions import WITHIN
from mbs.models.inverse_geometry.target import SOLVED

_BLOCK = 20_000
"""Number of poses per block: some megabytes of memory for each branch."""
_SHORT = 20
"""Number of poses below which single steps (1 to 2 ms each) are faster than the derivation of the
closed form of a new robot."""
_RATIO = 2.0
"""Largest ratio of the branch indicator at two neighbouring poses: a change by `_CHANGE`."""
_NEARER = 0.25
"""Largest ratio of the distances of the nearest and the second nearest solution from a prediction
at which the nearest is selected."""
_ON = 1e-6
"""Largest difference [rad or arm lengths] between a tracked configuration and its branch of the
closed form. Tracked configurations have an error of at most 1e-9."""
_TURN = 2 * math.pi


@dataclass(frozen=True, slots=True, eq=False)
class BranchBlock:
    """All branches of the closed form at a block of N poses.

    Attributes:
        first: index of the first pose of the block.
        q: (N, branches, n) scaled configurations.
        residual: (N, branches) pose error of each configuration.
        good: (N, branches) whether each configuration reaches the pose and is no double root.
        size: (N, branches) indicator that vanishes where branches meet.
        arm: open chain of the joints.
        limits: lower and upper limits (n,) of the scaled positions.
    """

    first: int
    q: Array
    residual: Array
    good: NDArray[np.bool_]
    size: Array
    arm: Arm
    limits: tuple[Array, Array]

    def after(self, number: int, x: Array) -> tuple[Array, Array]:
        """Continue x (n,) from pose `number` over the poses at which its branch is certain.

        Returns:
            Configurations (k, n) at the next k poses, and their pose errors (k,).
        """
        row = number - self.first
        apart = np.max(np.abs(self.arm.wrapped(self.q[row] - x)), axis=1)
        branch = int(np.argmin(apart))
        if apart[branch] > _ON:
            return _no_poses(x.size)
        # include the preceding interval: all neighbours of an interval must be even as well
        first = max(row - 1, 0)
        q, size = self.q[first:, branch], self.size[first:, branch]
        good = self.good[first:, branch]
        move = self.arm.wrapped(np.diff(q, axis=0))
        even = good[:-1] & good[1:] & (np.max(np.abs(move), axis=1) < LARGEST_STEP)
        even &= np.maximum(size[:-1], size[1:]) <= _RATIO * np.minimum(size[:-1], size[1:])
        certain = even.copy()
        certain[1:] &= even[:-1]
        certain[:-1] &= even[1:]
        q, move, certain = q[row - first :], move[row - first :], certain[row - first :]
        count = int(np.argmin(certain)) if not np.all(certain) else len(certain)
        unwrapped = x + np.cumsum(move[:count], axis=0)
        turns = np.where(self.arm.prismatic, 0.0, np.round((unwrapped - q[1 : count + 1]) / _TURN))
        unwrapped = q[1 : count + 1] + _TURN * turns
        low, high = self.limits
        within = np.all((unwrapped >= low - WITHIN) & (unwrapped <= high + WITHIN), axis=1)
        count = count if np.all(within) else int(np.argmin(within))
        return unwrapped[:count], self.residual[row + 1 : row + 1 + count, branch]

    def nearest(self, number: int, x: Array) -> tuple[Array, float] | None:
        """Return the solution at pose `number` that is much nearer to x (n,) than all others.

        Returns:
            Configuration (n,) and its pose error. None if no solution is much nearer, or if the
            pose is not in the block.
        """
        row = number - self.first
        if not 0 <= row < len(self.q) or not np.any(self.good[row]):
            return None
        branches = np.flatnonzero(self.good[row])
        away = self.arm.wrapped(self.q[row, branches] - x)
        distance = np.linalg.norm(away, axis=1)
        best = int(np.argmin(distance))
        others = distance[np.linalg.norm(away - away[best], axis=1) > _ON]
        if distance[best] > _NEARER * np.min(others, initial=np.inf):
            return None
        return x + away[best], float(self.residual[row, branches[best]])


def _no_poses(size: int) -> tuple[Array, Array]:
    return np.empty((0, size)), np.empty(0)


def branch_block(
    joints: PathJoints, poses: Path, number: int, known: BranchBlock | None
) -> BranchBlock | None:
    """Return the branches at a block of poses from index `number`, or None.

    None without a closed form, for redundant or few poses, and at the last pose.
    """
    if known is not None and known.first <= number < known.first + len(known.q) - 1:
        return known
    last = number == poses.count - 1
    if joints.chain is None or joints.redundant or last:
        return None
    if poses.count < _SHORT and known is None:
        return None
    p = joints.target.closing.p
    sequence = sequence_or_none(joints.chain, "auto", p)
    if sequence is None:
        return None
    T = poses.poses[number : number + _BLOCK]
    every = evaluate_branches(joints.chain, sequence, p, T, np.zeros((len(T), 0)))
    arm = joints.chain.arm(p)
    good = every.residual <= SOLVED * max(1.0, arm.length)
    size = np.minimum(every.real, every.regular)
    good &= size > 0
    return BranchBlock(
        number, every.q / joints.scale, every.residual, good, size, arm, (joints.low, joints.high)
    )
