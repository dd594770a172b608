"""The effort of a joint on the base, across the parallel axes behind it.

A wrench reaches link 1 from a run of parallel axes turned once for each of them. The joint of
link 1 feels one element of its moment only; that one is had in fewer operations by turning the
load of every link of the run once, by the sum of its angles.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components.motion import Motion
from mbs.recursions.poses import LinkPose
from mbs.spatial import Rotation, Wrench, cross, vector


def runs_behind(tree: Tree, poses: list[LinkPose]) -> dict[int, list[int]]:
    """For links that turn on the base, the links of a run of parallel axes behind them.

    There is one where the run has more than one joint and its axes stand at right angles to that
    of the link on the base.
    """
    found = {}
    for g, link in enumerate(tree.links):
        i = link.antecedent
        if i < 0 or tree.links[i].antecedent >= 0 or tree.links[i].motion is not Motion.REVOLUTE:
            continue
        members = [j for j, pose in enumerate(poses) if pose.run[0] == g]
        if len(members) > 1 and i not in found and _stands_across(poses, members):
            found[i] = members
    return found


def _stands_across(poses: list[LinkPose], members: list[int]) -> bool:
    first = poses[members[0]]
    axis = first.at_seat(vector([0, 0, 1]))
    square = axis[2].is_zero() and first.foot[1].is_zero()
    return bool(square) and all(poses[j].height.is_zero() for j in members)


def moment_of_run(
    tree: Tree, poses: list[LinkPose], members: list[int], loads: list[Wrench], forces: list[SX]
) -> SX:
    """Moment of a run about the axis of the link before it.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        members: the links of the run.
        loads: for every link the wrench on it, in its frame, without what the other links of the
            run transmit to it.
        forces: for every link the force that its joint transmits along its axis.
    """
    first = poses[members[0]]
    axis = first.at_seat(vector([0, 0, 1]))
    moments = {j: loads[j][1] for j in members}
    pushes = {j: loads[j][0] for j in members}
    total = cross(axis, first.at_seat(first.foot))[2] * forces[members[0]]
    for j in reversed(members[1:]):
        i, foot = tree.links[j].antecedent, poses[j].foot
        moments[i] = moments[i] + vector([0, -foot[0] * forces[j], 0])
    for j in members:
        total += _along(axis, poses[j].spin, moments[j])
    across = cross(axis, vector([0, 0, 1]))
    for j in members[1:]:
        behind = [k for k in members if j in poses[k].run]
        total += poses[j].foot[2] * sum(
            (_along(across, poses[k].spin, pushes[k]) for k in behind), SX(0)
        )
    return total


def _along(axis: SX, turn: Rotation, vector: SX) -> SX:
    return SX(casadi.dot(axis, turn.apply(vector)))
