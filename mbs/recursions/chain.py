"""Serial chain of unknown joints and known transforms between two frames.

The pose of the last frame in the first frame is G_0 J_1(q_1) G_1 J_2(q_2) .. J_n(q_n) G_n. Each
J_k is the displacement of an unknown joint along or about its z axis. Each G_k is the transform of
links and of joints with known positions. In a closed loop (`Ring`) the two end frames coincide:
G_n is merged into G_0, and the product is the identity.

The solvers of closed loops and of inverse kinematics use this class, symbolically and numerically.
`transforms` computes the poses of the frames.

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

# Joint of a chain and its displacement.


@dataclass(frozen=True, slots=True)
class Spin:
    """Known rotation of a rod about its own line, if a spherical joint of the tree supports it.

    Attributes:
        index: index of the angle among the positions.
        rest: quaternion of the spherical joint in the assembled configuration.
    """

    index: int
    rest: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ChainJoint:
    """Joint of a chain, whose position is usually unknown.

    Attributes:
        name: name of the coordinate.
        motion: type of motion: revolute about z, prismatic along z, spherical or free.
        index: index of the first position. In a loop chain it is an index in q; the positions of
            the cut joint follow after the end of q. None for a spherical joint whose position is
            not required. A quaternion occupies four positions.
        sign: -1 if the chain passes through the joint from its frame_b to its frame_a, else 1.
        cut: Whether the joint belongs to the joint that closes the loop.
        spin: known rotation of a rod about its line, for a spherical joint between such a rod and
            its antecedent.
    """

    name: str
    motion: Motion
    index: int | None
    sign: int
    cut: bool = False
    spin: Spin | None = None

    @property
    def is_rotational(self) -> bool:
        """Whether the motion is not prismatic."""
        return self.motion is not Motion.PRISMATIC

    def displacement(self, q: SX) -> Pose:
        """Return the pose of the frame after the joint relative to the frame before it.

        Args:
            q: position of the joint: an angle [rad], a distance [m], a quaternion (4, 1), or for a
                free joint three translations [m] and a quaternion (7, 1).
        """
        match self.motion:
            case Motion.FREE:
                return free_pose(q, self.sign)
            case Motion.SPHERICAL:
                return _spherical_pose(q, self.sign)
            case Motion.PRISMATIC:
                return Pose.translation(vector([0, 0, self.sign * q]))
        return Pose.rotation(axis_rotation("z", self.sign * q).matrix)


def free_pose(values: SX, sign: int = 1) -> Pose:
    """Return the pose of a free joint, or its inverse.

    Args:
        values: (7, 1) three translations [m], and a quaternion w, x, y, z of any norm.
        sign: 1 for the pose, -1 for its inverse.
    """
    pose = Pose.translation(values[0:3]) @ _spherical_pose(values[3:7], 1)
    return pose if sign > 0 else pose.inverse()


def _spherical_pose(quaternion: SX, sign: int) -> Pose:
    """Return the rotation by a quaternion (4, 1) of any norm; its inverse if sign is -1."""
    pose = Pose.rotation(quaternion_rotation(quaternion / casadi.norm_2(quaternion)))
    return pose if sign > 0 else pose.inverse()


# Transform between two joints.


@dataclass(frozen=True, slots=True, eq=False)
class Gap:
    """Known transform from one joint of a chain to the next joint.

    Attributes:
        pose: pose of the frame before the next joint in the frame after the previous joint.
        pivots: poses of the known revolute joints between the two, in the same frame as `pose`.
        back: inverse of `pose`, if known in a shorter form. CasADi does not simplify symbolic
            rotations by their orthonormality. None if not known.
    """

    pose: Pose = field(default_factory=Pose.identity)
    pivots: tuple[Pose, ...] = ()
    back: Pose | None = None

    def then(self, pose: Pose) -> Gap:
        """Return the transform followed by the pose `pose`."""
        back = None if self.back is None else pose.inverse() @ self.back
        return Gap(self.pose @ pose, self.pivots, back)

    def after(self, gap: Gap) -> Gap:
        """Return the transform `gap` followed by this transform."""
        seen = (gap.pose @ pivot for pivot in self.pivots)
        known = self.back is not None or gap.back is not None
        back = self.inverse().pose @ gap.inverse().pose if known else None
        return Gap(gap.pose @ self.pose, (*gap.pivots, *seen), back)

    def inverse(self) -> Gap:
        """Return the transform from its end to its beginning."""
        back = self.back or self.pose.inverse()
        return Gap(back, tuple(back @ pivot for pivot in self.pivots), self.pose)


# The chain and the poses of its frames.


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Joints and the known transforms before, between and after them.

    Attributes:
        joints: n joints, in the order of the chain.
        gaps: n + 1 transforms. A `Ring` has n: gaps[k] comes before joints[k].
    """

    joints: tuple[ChainJoint, ...]
    gaps: tuple[Gap, ...]

    @property
    def between(self) -> Sequence[Pose]:
        """Poses of the n + 1 transforms `gaps` (n in a `Ring`)."""
        return [gap.pose for gap in self.gaps]

    def displacements(self, q: SX) -> Sequence[Pose]:
        """Return the displacements of the joints, all of which must be revolute or prismatic.

        Args:
            q: (n, 1) positions of the joints, in the order of the chain [rad or m].
        """
        return [joint.displacement(SX(q[k])) for k, joint in enumerate(self.joints)]

    def ring(self) -> Ring:
        """Return the loop whose two end frames coincide.

        The last transform is merged into the first.
        """
        if not self.joints:
            return Ring((), ())
        return Ring(self.joints, (self.gaps[0].after(self.gaps[-1]), *self.gaps[1:-1]))


@dataclass(frozen=True, slots=True, eq=False)
class Ring(Chain):
    """Loop: closed chain, whose two end frames coincide; gaps[k] comes before joints[k]."""

    def rotated(self, first: int) -> Ring:
        """Return the same loop, which starts with the joint of index `first`."""
        return Ring(
            self.joints[first:] + self.joints[:first], self.gaps[first:] + self.gaps[:first]
        )

    def reversed(self) -> Ring:
        """Return the same loop in the opposite direction."""
        joints = tuple(replace(joint, sign=-joint.sign) for joint in self.joints[::-1])
        gaps = tuple(gap.inverse() for gap in (self.gaps[0], *self.gaps[:0:-1]))
        return Ring(joints, gaps)

    def without(self, k: int) -> Ring:
        """Return the loop with joint k locked at position zero, as part of the transforms."""
        n = len(self.joints)
        merged = self.gaps[(k + 1) % n].after(self.gaps[k])
        gaps = [merged if m == (k + 1) % n else gap for m, gap in enumerate(self.gaps) if m != k]
        return Ring(tuple(j for m, j in enumerate(self.joints) if m != k), tuple(gaps))


T = TypeVar("T", Pose, Array)
T_co = TypeVar("T_co", Pose, Array, covariant=True)
Q = TypeVar("Q", SX, Array)
Q_contra = TypeVar("Q_contra", SX, Array, contravariant=True)


class JointChain(Protocol[T_co, Q_contra]):
    """Protocol of a symbolic chain (`Chain`) or a numeric chain (`mbs.closed_forms.arm.Arm`)."""

    @property
    def between(self) -> Sequence[T_co]:
        """Known transforms before, between and (except in a ring) after the joints."""

    def displacements(self, q: Q_contra) -> Sequence[T_co]:
        """Return the transforms of the joints at positions q [rad or m]."""


def transforms(chain: JointChain[T, Q], q: Q) -> list[T]:
    """Return the poses of the frames before every joint and at the end of a chain.

    Args:
        chain: chain of n joints.
        q: positions [rad or m]: symbolic (n, 1), or numeric (..., n).

    Returns:
        n + 1 transforms relative to the beginning of the chain. The first transform does not depend
        on q, so that it is a single (4, 4) matrix even for many configurations.
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
    """Return the poses of the ends of all transforms, with the joints between them at zero.

    Args:
        gaps: transforms, in the order of the chain.
        start: pose of the beginning of the first transform. Default is the identity.
    """
    begin = Pose.identity() if start is None else start
    return list(accumulate((gap.pose for gap in gaps), matmul, initial=begin))[1:]


# Chains along a tree.


@dataclass(slots=True)
class ChainBuilder:
    """Builder of a chain, step by step along links and joints.

    Attributes:
        known: indices in q of the known positions.
        q: positions (nq, 1). Only the known positions are used.
        joints: unknown joints so far.
        gaps: transforms before these joints.
        gap: transform since the last unknown joint.
    """

    known: Container[int]
    q: SX
    joints: list[ChainJoint] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    gap: Gap = field(default_factory=Gap)

    def over(self, pose: Pose) -> None:
        """Append a known transform, a pose, to the chain."""
        self.gap = self.gap.then(pose)

    def through(self, joint: ChainJoint) -> None:
        """Append a joint with unknown position to the chain."""
        self.joints.append(joint)
        self.gaps.append(self.gap)
        self.gap = Gap()

    def past(self, joint: ChainJoint) -> None:
        """Append a joint: a known transform if its position is known, else an unknown joint."""
        index = joint.index
        if index is None or index not in self.known:
            self.through(joint)
            return
        if joint.motion is Motion.REVOLUTE:
            self.gap = replace(self.gap, pivots=(*self.gap.pivots, self.gap.pose))
        self.over(joint.displacement(self.q[index : index + joint.motion.nq]))

    def along_tree(self, tree: Tree, a: Frame, b: Frame, spins: Mapping[int, Spin]) -> None:
        """Append the path in a tree from frame a to frame b.

        The path goes towards the base up to the common link of both frames.

        Args:
            tree: the links.
            a: frame at the current end of the chain.
            b: frame at the new end of the chain.
            spins: rotations of rods with spherical joints, by the first index in q of their
                quaternions.
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
        """Return the chain built so far."""
        return Chain(tuple(self.joints), (*self.gaps, self.gap))


def _joint(tree: Tree, k: int, sign: int, spins: Mapping[int, Spin]) -> ChainJoint:
    """Return the chain joint of link k of a tree.

    `sign` is -1 if the chain passes it towards the base, else 1; `spins` as in
    `ChainBuilder.along_tree`.
    """
    link = tree.links[k]
    sign = -sign if link.backward else sign
    return ChainJoint(link.name, link.motion, link.q.start, sign, spin=spins.get(link.q.start))


def links_between(tree: Tree, a: int, b: int) -> tuple[list[int], list[int]]:
    """Return the links on the path from link a to link b of a tree, in two parts.

    Args:
        tree: the links.
        a: index of the first link, -1 for the base.
        b: index of the last link, -1 for the base.

    Returns:
        links from a towards the base, without the last common link of both; and links from there to
        b.
    """
    fork = common_link(tree, a, b)
    back, out = ([k for k in tree.path(link) if k not in tree.path(fork)] for link in (a, b))
    return back[::-1], out


def tree_chain(tree: Tree, a: Frame, b: Frame, known: Container[int], q: SX) -> Chain:
    """Return the chain from frame a to frame b of a tree.

    Args:
        tree: the links.
        a: first frame of the chain.
        b: last frame of the chain.
        known: indices in q of the known positions.
        q: (nq, 1) positions. Only the known positions are used.
    """
    builder = ChainBuilder(known, q)
    builder.along_tree(tree, a, b, {})
    return builder.chain()
