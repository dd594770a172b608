"""Velocities of the joints before a link, as the link sees them.

Across a run of parallel axes a velocity is turned once, by the sum of the angles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.motion import unit_motions
from mbs.recursions.poses import LinkPose
from mbs.recursions.velocities import Velocity
from mbs.spatial import cross, origin


@dataclass(frozen=True, slots=True, eq=False)
class PathTwist:
    """What a unit of one joint velocity gives a link, or the rate at which that changes.

    Attributes:
        row: number of the velocity.
        t: (3, 1) velocity of the origin of the frame.
        n: (3, 1) angular velocity.
    """

    row: int
    t: SX
    n: SX

    def at(self, p: SX) -> PathTwist:
        """About the point p, (3, 1) in the same axes."""
        return PathTwist(self.row, self.t + cross(self.n, p), self.n)

    def seen(self, turn: Callable[[SX], SX]) -> PathTwist:
        """In other axes."""
        return PathTwist(self.row, turn(self.t), turn(self.n))

    def rate(self, of: Velocity) -> PathTwist:
        """How it changes where it is fixed on a link that moves with this velocity."""
        t = cross(of.V, self.n) + cross(of.w, self.t)
        return PathTwist(self.row, t, cross(of.w, self.n))


def path_twists(tree: Tree, poses: list[LinkPose]) -> list[list[PathTwist]]:
    """For every link unit velocities of the joints from the base to it, in its frame."""
    return _carried(tree, poses, _unit_twists(tree))


def path_twist_rates(
    tree: Tree, poses: list[LinkPose], velocities: list[Velocity]
) -> list[list[PathTwist]]:
    """How those of `path_twists` change, each fixed on the link of its joint, seen at rest.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        velocities: of the links.
    """
    pairs = zip(_unit_twists(tree), velocities, strict=True)
    return _carried(tree, poses, [[twist.rate(v) for twist in own] for own, v in pairs])


def seen_by_links(tree: Tree, poses: list[LinkPose], vector: SX) -> list[SX]:
    """A vector (3, 1) of the base in the frame of every link."""
    result: list[SX] = []
    for link, pose in zip(tree.links, poses, strict=True):
        first = poses[pose.run[0]] if len(pose.run) > 1 else pose
        i = tree.links[pose.run[0]].antecedent if len(pose.run) > 1 else link.antecedent
        seat = first.at_seat(result[i] if i >= 0 else vector)
        result.append(pose.spin.apply_inverse(seat))
    return result


def _unit_twists(tree: Tree) -> list[list[PathTwist]]:
    return [
        [PathTwist(link.v.start + k, t, n) for k, (t, n) in enumerate(unit_motions(link.motion))]
        for link in tree.links
    ]


def _carried(
    tree: Tree, poses: list[LinkPose], own: list[list[PathTwist]]
) -> list[list[PathTwist]]:
    """To every link the twists of the links before it, and its own."""
    outer: list[list[PathTwist]] = []
    inner: list[list[PathTwist]] = []
    result: list[list[PathTwist]] = []
    for j, pose in enumerate(poses):
        i = tree.links[j].antecedent
        passed: list[PathTwist] = []
        if len(pose.run) > 1:
            p = poses[i].spin.apply(pose.p)
            seated = [twist.at(p) for twist in outer[i]]
            passed = [twist.at(pose.p).seen(pose.apply_inverse) for twist in inner[i]]
        else:
            before, p = result[i] if i >= 0 else [], origin(pose.motion)
            seated = [twist.at(pose.foot).seen(pose.at_seat).at(p) for twist in before]
        outer.append(seated)
        inner.append([*passed, *own[j]])
        result.append([twist.seen(pose.spin.apply_inverse) for twist in seated] + inner[j])
    return result
