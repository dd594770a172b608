"""Jacobian of a frame: its velocity as a linear function of the joint velocities.

Every joint gives the velocity z x L along its own axis, L being the way from the joint to the
point whose velocity is asked for; the axes in which the result is wanted may be those of any
frame, and the nearer they are to the middle of the chain, the fewer turns are needed.

Source: Renaud 1980; Khalil & Creusot 1997, eq. 3 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi
from casadi import SX

from mbs.assembly.tree import Frame, Tree
from mbs.recursions.motion import unit_motions
from mbs.recursions.route import (
    JointAt,
    OriginOf,
    Shift,
    Step,
    Tilt,
    along,
    common_link,
    joined,
    walked_back,
    way_between,
    way_to,
)
from mbs.spatial import Pose, Rotation, cross, is_zero, zeros


@dataclass(frozen=True, slots=True, eq=False)
class VelocityTarget:
    """A frame whose velocity is asked for.

    Attributes:
        tree: the links.
        q: (nq, 1) symbols of positions.
        p: (np, 1) symbols of parameters, whose operations are not counted.
        frame: that moves.
        axes: in which its velocity is.
    """

    tree: Tree
    q: SX
    p: SX
    frame: Frame
    axes: Frame

    def along(self, axes: Frame) -> VelocityTarget:
        """The same in other axes."""
        return replace(self, axes=axes)


@dataclass(frozen=True, slots=True, eq=False)
class Outlook:
    """The tree seen from the frame in whose axes a Jacobian is wanted.

    Attributes:
        tree: the links.
        branches: two ways outwards from that frame: to the frame that moves, with the joints
            that come after their common link, and to the base with the others.
    """

    tree: Tree
    branches: tuple[list[Step], list[Step]]

    @property
    def turns(self) -> int:
        """Number of turns on the longer branch."""
        return max(sum(isinstance(s, Tilt) for s in branch) for branch in self.branches)


def outlook(target: VelocityTarget) -> Outlook:
    """What the Jacobian of a frame in certain axes is made of."""
    tree, q, frame, axes = target.tree, target.q, target.frame, target.axes
    back, out = way_between(tree, q, axes, frame)
    aside = [step for step in back if not isinstance(step, (JointAt, OriginOf))]
    trunk = walked_back(way_to(tree, q, (common_link(tree, frame[0], axes[0]), Pose.identity())))
    return Outlook(tree, (joined([*aside, *out], tree), joined([*aside, *trunk], tree)))


def jacobian(seen: Outlook, reference: int | None = None, matrices: int = 0) -> SX:
    """(6, nv) with [V; w] = J v, in the axes of the outlook.

    Args:
        seen: the frame that moves and the axes.
        reference: V is that of the point that is fixed on the frame and now at the origin of
            this link's frame, -1 for the base's; None for the frame's own origin.
        matrices: for so many turns, counted from the axes, orientations are formed and applied;
            beyond, each vector is turned by itself. It changes the operations, not the result.
    """
    J = zeros(6, seen.tree.nv)
    for branch, arms in zip(seen.branches, _arms(seen.branches, reference), strict=True):
        columns = _local_columns(seen.tree, branch, arms)
        for k, V, w in _carried(branch, columns, matrices):
            J[:, k] = casadi.vertcat(V, w)
    return J


Column = tuple[int, SX, SX]
"""Number in v, and what a unit of it gives: linear and angular velocity."""


def _arms(branches: Sequence[list[Step]], reference: int | None) -> list[list[SX]]:
    """After each step of each branch, the way from there to the reference, in the axes there."""
    place = [_place(branch, reference) for branch in branches]
    here = 0 if reference is None or place[0] is not None else 1
    number = place[here]
    assert number is not None
    inward, arm = _inward(branches[here][: number + 1])
    outward = _outward(branches[here][number + 1 :], zeros())
    other = _outward(branches[1 - here], arm)
    own = inward + outward
    return [own, other] if here == 0 else [other, own]


def _place(branch: list[Step], reference: int | None) -> int | None:
    """The step after which the reference is; -1 is the beginning, None elsewhere."""
    if reference is None:
        return len(branch) - 1
    mark = OriginOf(reference)
    return branch.index(mark) if mark in branch else None


def _inward(branch: list[Step]) -> tuple[list[SX], SX]:
    """Ways to the end of the branch, after each step and before the first."""
    arm, arms = zeros(), []
    for step in reversed(branch):
        arms.append(arm)
        match step:
            case Shift(p=p):
                arm = arm + p
            case Tilt(rotation=rotation):
                (arm,) = along(rotation, [arm])
    return arms[::-1], arm


def _outward(branch: list[Step], arm: SX) -> list[SX]:
    """Ways to a reference that lies `arm` from the beginning of the branch."""
    arms = []
    for step in branch:
        match step:
            case Shift(p=p):
                arm = arm - p
            case Tilt(rotation=rotation) if not is_zero(arm):
                arm = casadi.densify(rotation.apply_inverse(arm))
        arms.append(arm)
    return arms


def _local_columns(tree: Tree, branch: list[Step], arms: list[SX]) -> list[tuple[int, Column]]:
    """For each joint on the branch, the step where it is and its columns in the axes there."""
    result = []
    for number, step in enumerate(branch):
        if isinstance(step, JointAt):
            link = tree.links[step.link]
            for column, (linear, angular) in enumerate(unit_motions(link.motion)):
                V = linear if is_zero(angular) else linear + cross(angular, arms[number])
                result.append((number, (link.v.start + column, V, angular)))
    return result


def _carried(branch: list[Step], columns: list[tuple[int, Column]], matrices: int) -> list[Column]:
    """The columns in the axes at the beginning of the branch."""
    turns = [number for number, step in enumerate(branch) if isinstance(step, Tilt)]
    split = turns[matrices] if matrices < len(turns) else len(branch)
    R, near = Pose.identity().R, []
    for number, step in enumerate(branch[:split]):
        if isinstance(step, Tilt):
            R = casadi.mtimes(R, step.rotation.matrix)
        near += [_turned(R, column) for at, column in columns if at == number]
    far: list[Column] = []
    for number in reversed(range(split, len(branch))):
        far += [column for at, column in columns if at == number]
        step = branch[number]
        if isinstance(step, Tilt):
            far = [_moved(step.rotation, column) for column in far]
    return near + [_turned(R, column) for column in far]


def _turned(R: SX, column: Column) -> Column:
    k, V, w = column
    return k, casadi.mtimes(R, V), casadi.mtimes(R, w)


def _moved(rotation: Rotation, column: Column) -> Column:
    k, V, w = column
    V, w = along(rotation, [V, w])
    return k, V, w
