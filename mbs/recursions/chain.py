"""A chain: joints one after the other and what is known between them, from a frame to another.

The last frame seen from the first is G_0 J_1(q_1) G_1 J_2(q_2) .. J_n(q_n) G_n: each J_k moves
along its own z axis, each G_k is made of links, and of joints whose positions are known by then.
In a ring the ends coincide, G_n is a part of G_0, and the product is 1.

Everything that solves for joints works on it: rings of loops, arms that reach a pose, in symbols
and in numbers. `transforms` alone says where its frames are.

Source: Khalil & Kleinfinger 1986; Khalil & Creusot 1997, eq. 2.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from operator import matmul
from typing import Protocol, TypeVar

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.assembly.tree import Frame, Tree
from mbs.components.joints import Motion
from mbs.recursions.route import common_link
from mbs.spatial import Pose, axis_rotation, quaternion_rotation, vector

Array = NDArray[np.float64]

# One joint, and how it moves.


@dataclass(frozen=True, slots=True)
class Spin:
    """The known turn of a rod about its own line, where a spherical joint of the tree carries it.

    Attributes:
        index: number of the angle among the positions.
        rest: quaternion of the spherical joint in the assembled configuration.
    """

    index: int
    rest: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ChainJoint:
    """A joint whose position is looked for.

    Attributes:
        name: of the coordinate.
        motion: revolute or prismatic along its z axis; spherical turns in any way.
        index: index of its position; of a ring in q, beyond the end of it for a cut joint; None
            for a spherical joint whose position nothing asks for. Four numbers follow from there
            for a quaternion.
        sign: -1 where the chain runs through the joint from its frame_b to its frame_a.
        cut: whether it belongs to the joint that closes a loop.
        spin: of a spherical joint between a rod that may spin and its antecedent.
    """

    name: str
    motion: Motion
    index: int | None
    sign: int
    cut: bool = False
    spin: Spin | None = None

    @property
    def is_rotational(self) -> bool:
        """Whether the joint rotates."""
        return self.motion is not Motion.PRISMATIC

    def displacement(self, q: SX) -> Pose:
        """The pose behind the joint seen from before it, at its position [rad, m, quaternion]."""
        match self.motion:
            case Motion.FREE:
                return free_pose(q, self.sign)
            case Motion.SPHERICAL:
                return _spherical_pose(q, self.sign)
            case Motion.PRISMATIC:
                return Pose.translation(vector([0, 0, self.sign * q]))
        return Pose.rotation(axis_rotation("z", self.sign * q).matrix)


def free_pose(values: SX, sign: int = 1) -> Pose:
    """The pose that three translations and a quaternion tell, or its inverse."""
    pose = Pose.translation(values[0:3]) @ _spherical_pose(values[3:7], 1)
    return pose if sign > 0 else pose.inverse()


def _spherical_pose(quaternion: SX, sign: int) -> Pose:
    pose = Pose.rotation(quaternion_rotation(quaternion / casadi.norm_2(quaternion)))
    return pose if sign > 0 else pose.inverse()


# What stands between two joints.


@dataclass(frozen=True, slots=True, eq=False)
class Gap:
    """The known transform from one joint to the next.

    Attributes:
        pose: of the next joint's frame, seen from the frame after the joint before.
        pivots: frames of the known revolute joints between them, seen likewise.
        back: the inverse of the pose where it is known in a shorter form; nothing tells that the
            elements of a symbolic rotation are orthonormal.
    """

    pose: Pose = field(default_factory=Pose.identity)
    pivots: tuple[Pose, ...] = ()
    back: Pose | None = None

    def then(self, pose: Pose) -> Gap:
        """With one more pose at its end."""
        back = None if self.back is None else pose.inverse() @ self.back
        return Gap(self.pose @ pose, self.pivots, back)

    def after(self, gap: Gap) -> Gap:
        """With another gap before it."""
        seen = (gap.pose @ pivot for pivot in self.pivots)
        known = self.back is not None or gap.back is not None
        back = self.inverse().pose @ gap.inverse().pose if known else None
        return Gap(gap.pose @ self.pose, (*gap.pivots, *seen), back)

    def inverse(self) -> Gap:
        """From its end to its beginning."""
        back = self.back or self.pose.inverse()
        return Gap(back, tuple(back @ pivot for pivot in self.pivots), self.pose)


# The chain, and where its frames are.


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Joints, and the gaps before, between and after them.

    Attributes:
        joints: n of them, in their order.
        gaps: n + 1; in a ring n, the one before each joint.
    """

    joints: tuple[ChainJoint, ...]
    gaps: tuple[Gap, ...]

    @property
    def between(self) -> Sequence[Pose]:
        """The poses of the gaps."""
        return [gap.pose for gap in self.gaps]

    def displacements(self, q: SX) -> Sequence[Pose]:
        """Of the joints, all of one position each, at positions q, (n, 1) [rad or m]."""
        return [joint.displacement(SX(q[k])) for k, joint in enumerate(self.joints)]

    def ring(self) -> Ring:
        """The ring that it is where its ends coincide: its last gap becomes part of the first."""
        if not self.joints:
            return Ring((), ())
        return Ring(self.joints, (self.gaps[0].after(self.gaps[-1]), *self.gaps[1:-1]))


@dataclass(frozen=True, slots=True, eq=False)
class Ring(Chain):
    """A chain whose ends coincide: gap k comes before joint k, and there is none after the last."""

    def rotated(self, first: int) -> Ring:
        """The same loop begun at another joint."""
        return Ring(
            self.joints[first:] + self.joints[:first], self.gaps[first:] + self.gaps[:first]
        )

    def reversed(self) -> Ring:
        """The same loop in the other direction."""
        joints = tuple(replace(joint, sign=-joint.sign) for joint in self.joints[::-1])
        gaps = tuple(gap.inverse() for gap in (self.gaps[0], *self.gaps[:0:-1]))
        return Ring(joints, gaps)

    def without(self, k: int) -> Ring:
        """The loop with joint k locked at zero."""
        n = len(self.joints)
        merged = self.gaps[(k + 1) % n].after(self.gaps[k])
        gaps = [merged if m == (k + 1) % n else gap for m, gap in enumerate(self.gaps) if m != k]
        return Ring(tuple(j for m, j in enumerate(self.joints) if m != k), tuple(gaps))


T = TypeVar("T", Pose, Array)
T_co = TypeVar("T_co", Pose, Array, covariant=True)
Q = TypeVar("Q", SX, Array)
Q_contra = TypeVar("Q_contra", SX, Array, contravariant=True)


class Transformable(Protocol[T_co, Q_contra]):
    """A chain in symbols (`Chain`), or in numbers (`mbs.closed_forms.arm.Arm`)."""

    @property
    def between(self) -> Sequence[T_co]:
        """The transforms before, between and, but in a ring, after the joints."""

    def displacements(self, q: Q_contra) -> Sequence[T_co]:
        """The transforms of the joints at their positions."""


def transforms(chain: Transformable[T, Q], q: Q) -> list[T]:
    """Where the frames of a chain are: before every joint and, last, at its end.

    Args:
        chain: of n joints.
        q: positions, (n, 1) symbols, or (..., n) numbers [rad or m].

    Returns:
        n + 1 transforms, each seen from the beginning of the chain; of many configurations the
        first one, which no joint moves, is a single (4, 4).
    """
    between = chain.between
    here = between[0]
    frames = [here]
    for k, displacement in enumerate(chain.displacements(q), 1):
        here = here @ displacement
        if k < len(between):
            here = here @ between[k]
        frames.append(here)
    return frames


def frames_at_zero(gaps: Sequence[Gap], start: Pose | None = None) -> list[Pose]:
    """The end of every gap where the joints between them are at zero, seen from one frame.

    Args:
        gaps: one after the other.
        start: where the first one begins, the identity when left out.
    """
    begin = Pose.identity() if start is None else start
    return list(accumulate((gap.pose for gap in gaps), matmul, initial=begin))[1:]


# Chains along a tree.


@dataclass(slots=True)
class ChainBuilder:
    """The chain so far: what was passed, and the gap since the last unknown joint.

    Attributes:
        known: indices in q of the positions that are known.
        q: positions, of which the known ones are used.
    """

    known: Container[int]
    q: SX
    joints: list[ChainJoint] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    gap: Gap = field(default_factory=Gap)

    def over(self, pose: Pose) -> None:
        """Over what does not move."""
        self.gap = self.gap.then(pose)

    def through(self, joint: ChainJoint) -> None:
        """Through a joint that is looked for."""
        self.joints.append(joint)
        self.gaps.append(self.gap)
        self.gap = Gap()

    def past(self, joint: ChainJoint) -> None:
        """Through a joint; over it, where its position is known."""
        index = joint.index
        if index is None or index not in self.known:
            self.through(joint)
            return
        if joint.motion is Motion.REVOLUTE:
            self.gap = replace(self.gap, pivots=(*self.gap.pivots, self.gap.pose))
        self.over(joint.displacement(self.q[index : index + joint.motion.nq]))

    def along_tree(self, tree: Tree, a: Frame, b: Frame, spins: Mapping[int, Spin]) -> None:
        """From frame a, back to the common link, and out to frame b.

        Args:
            tree: the links.
            a: where the chain stands.
            b: where it goes.
            spins: of the spherical joints of rods, by the index in q at which their quaternions
                begin.
        """
        back, out = links_between(tree, a[0], b[0])
        self.over(a[1].inverse())
        for k in back:
            self.past(_joint(tree, k, -1, spins))
            self.over(tree.links[k].pose().inverse())
        for k in out:
            self.over(tree.links[k].pose())
            self.past(_joint(tree, k, 1, spins))
        self.over(b[1])

    def chain(self) -> Chain:
        """What was passed."""
        return Chain(tuple(self.joints), (*self.gaps, self.gap))


def _joint(tree: Tree, k: int, sign: int, spins: Mapping[int, Spin]) -> ChainJoint:
    link = tree.links[k]
    sign = -sign if link.backward else sign
    return ChainJoint(link.name, link.motion, link.q.start, sign, spin=spins.get(link.q.start))


def links_between(tree: Tree, a: int, b: int) -> tuple[list[int], list[int]]:
    """The links from link a back to the common link, and from there out to link b."""
    fork = common_link(tree, a, b)
    back, out = ([k for k in tree.path(link) if k not in tree.path(fork)] for link in (a, b))
    return back[::-1], out


def tree_chain(tree: Tree, a: Frame, b: Frame, known: Container[int], q: SX) -> Chain:
    """The chain from one frame of a tree to another.

    Args:
        tree: the links.
        a: where it begins.
        b: where it ends.
        known: indices in q of the positions that are known.
        q: (nq, 1) positions, of which the known ones are used.
    """
    builder = ChainBuilder(known, q)
    builder.along_tree(tree, a, b, {})
    return builder.chain()
