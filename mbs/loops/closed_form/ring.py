"""A loop as its unknown joints in cyclic order, and the known poses between them.

Walking once around the loop leads back to the start: X_1 J_1 X_2 J_2 .. X_n J_n = 1. Each J_k
turns about or slides along its own z axis; each X_k is made of links, and of joints whose positions
are known by then.

Source: Khalil & Creusot 1997, eq. 2.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.components import PointOnLine, Rod, Spherical
from mbs.components.motion import Freedom, Motion
from mbs.expressions import to_sx
from mbs.loops.closed_form.places import cut_places, spin_places
from mbs.recursions.route import common_link
from mbs.spatial import Pose, align_z, axis_turn, quaternion_rotation, vector


@dataclass(frozen=True, slots=True)
class Spin:
    """The known turn of a rod about its own line, where a ball of the tree carries it.

    Attributes:
        place: number of the angle among the positions.
        rest: quaternion of the ball in the assembled posture.
    """

    place: int
    rest: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Unknown:
    """A joint of the loop whose position is looked for.

    Attributes:
        name: of the coordinate.
        motion: revolute or prismatic along its z axis; spherical turns in any way.
        place: number in q, beyond the end of it for a cut joint (see `places`); None for a
            ball whose position nothing asks for. Four numbers follow from there for a quaternion.
        sign: -1 where the way around the loop runs through the joint backwards.
        cut: whether it belongs to the joint that closes the loop.
        spin: of a ball between a rod that may spin and its antecedent.
    """

    name: str
    motion: Motion
    place: int | None
    sign: int
    cut: bool = False
    spin: Spin | None = None

    @property
    def turns(self) -> bool:
        """Whether the joint turns."""
        return self.motion is not Motion.PRISMATIC


@dataclass(frozen=True, slots=True, eq=False)
class Gap:
    """The known way from one unknown joint to the next.

    Attributes:
        pose: of the next joint's frame, seen from the frame after the joint before.
        pivots: frames of the known revolute joints on the way, seen likewise.
        back: the inverse of the pose where it is known in a shorter form; nothing tells that the
            elements of a symbolic rotation are orthonormal.
    """

    pose: Pose = field(default_factory=Pose.identity)
    pivots: tuple[Pose, ...] = ()
    back: Pose | None = None

    def then(self, pose: Pose) -> Gap:
        """The way with one more piece at its end."""
        back = None if self.back is None else pose.inverse() @ self.back
        return Gap(self.pose @ pose, self.pivots, back)

    def after(self, gap: Gap) -> Gap:
        """The way with another one before it."""
        seen = (gap.pose @ pivot for pivot in self.pivots)
        known = self.back is not None or gap.back is not None
        back = self.inverse().pose @ gap.inverse().pose if known else None
        return Gap(gap.pose @ self.pose, (*gap.pivots, *seen), back)

    def inverse(self) -> Gap:
        """The way back."""
        back = self.back or self.pose.inverse()
        return Gap(back, tuple(back @ pivot for pivot in self.pivots), self.pose)


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """A loop: gap k comes before joint k.

    Attributes:
        joints: the unknown joints.
        gaps: as many.
    """

    joints: tuple[Unknown, ...]
    gaps: tuple[Gap, ...]

    def rotated(self, first: int) -> Ring:
        """The same loop begun at another joint."""
        return Ring(
            self.joints[first:] + self.joints[:first], self.gaps[first:] + self.gaps[:first]
        )

    def reversed(self) -> Ring:
        """The same loop walked the other way round."""
        joints = tuple(replace(joint, sign=-joint.sign) for joint in self.joints[::-1])
        gaps = tuple(gap.inverse() for gap in (self.gaps[0], *self.gaps[:0:-1]))
        return Ring(joints, gaps)

    def without(self, k: int) -> Ring:
        """The loop with joint k held at zero."""
        n = len(self.joints)
        merged = self.gaps[(k + 1) % n].after(self.gaps[k])
        gaps = [merged if m == (k + 1) % n else gap for m, gap in enumerate(self.gaps) if m != k]
        return Ring(tuple(j for m, j in enumerate(self.joints) if m != k), tuple(gaps))


@dataclass(slots=True)
class _Walk:
    """The way so far: what was passed, and the gap since the last unknown joint."""

    joints: list[Unknown] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    gap: Gap = field(default_factory=Gap)

    def over(self, pose: Pose) -> None:
        self.gap = self.gap.then(pose)

    def through(self, joint: Unknown) -> None:
        self.joints.append(joint)
        self.gaps.append(self.gap)
        self.gap = Gap()

    def ring(self) -> Ring:
        if not self.joints:
            return Ring((), ())
        first = self.gaps[0].after(self.gap)
        return Ring(tuple(self.joints), (first, *self.gaps[1:]))


def loop_links(system: System, cut: Cut) -> tuple[list[int], list[int]]:
    """The links from frame_a of a cut joint back to the common link, and from there to frame_b."""
    fork = common_link(system.tree, cut.link_a, cut.link_b)
    back, out = (
        [k for k in system.tree.path(link) if k not in system.tree.path(fork)]
        for link in (cut.link_a, cut.link_b)
    )
    return back[::-1], out


def ring_of(system: System, number: int, known: Container[int], q: SX) -> Ring:
    """The loop that a cut joint closes, from its frame_a through the tree and the joint itself.

    Args:
        system: whose loop it is.
        number: of the cut joint.
        known: numbers in q of the positions that are known.
        q: (nq, 1) symbols followed by those of cut joints, of which the known ones are used.
    """
    walk, cut = _Walk(), system.cuts[number]
    back, out = loop_links(system, cut)
    walk.over(cut.pose_a.inverse())
    for k in back:
        _pass(walk, _unknown(system, k, -1), known, q)
        walk.over(system.tree.links[k].pose().inverse())
    for k in out:
        walk.over(system.tree.links[k].pose())
        _pass(walk, _unknown(system, k, 1), known, q)
    walk.over(cut.pose_b)
    if not cut.welded:
        _pass_cut(walk, system, number, known, q)
    return walk.ring()


def _unknown(system: System, k: int, sign: int) -> Unknown:
    link = system.tree.links[k]
    place = spin_places(system).get(link.q.start)
    spin = None if place is None else Spin(place, system.posture[link.q])
    return Unknown(link.name, link.motion, link.q.start, sign, spin=spin)


def _pass(walk: _Walk, joint: Unknown, known: Container[int], q: SX) -> None:
    """Through a joint; over it, where it is known."""
    place = joint.place
    if place is None or place not in known:
        walk.through(joint)
    elif joint.motion is Motion.FREE:
        walk.over(free_pose(q[place : place + 7], joint.sign))
    elif joint.motion is Motion.SPHERICAL:
        walk.over(_ball(q[place : place + 4], joint.sign))
    elif joint.motion is Motion.PRISMATIC:
        walk.over(Pose.moved(vector([0, 0, joint.sign * q[place]])))
    else:
        walk.gap = replace(walk.gap, pivots=(*walk.gap.pivots, walk.gap.pose))
        walk.over(Pose.turned(axis_turn("z", joint.sign * q[place]).matrix))


def free_pose(values: SX, sign: int = 1) -> Pose:
    """The pose that three translations and a quaternion tell, or the way back."""
    pose = Pose.moved(values[0:3]) @ _ball(values[3:7], 1)
    return pose if sign > 0 else pose.inverse()


def _ball(quaternion: SX, sign: int) -> Pose:
    pose = Pose.turned(quaternion_rotation(quaternion / casadi.norm_2(quaternion)))
    return pose if sign > 0 else pose.inverse()


def _pass_cut(walk: _Walk, system: System, number: int, known: Container[int], q: SX) -> None:
    """Back through the freedoms of the cut joint, from its frame_b to its frame_a."""
    joint = system.cuts[number].edge.joint
    ball = Unknown(joint.name, Motion.SPHERICAL, None, -1, cut=True)
    freedoms = joint.freedoms
    if isinstance(joint, Spherical):
        walk.through(ball)
        return
    if isinstance(joint, Rod):
        walk.through(ball)
        walk.over(Pose.moved(vector([to_sx(joint.length, system.symbol_table), 0, 0])))
        walk.through(ball)
        return
    if isinstance(joint, PointOnLine):
        walk.through(ball)
        freedoms = (Freedom(Motion.PRISMATIC, joint.axis),)
    first = cut_places(system)[number]
    for k, freedom in reversed(list(enumerate(freedoms))):
        aligned = Pose.turned(align_z(freedom.axis))
        name = freedom.coordinate_of(joint.name)
        walk.over(aligned)
        _pass(walk, Unknown(name, freedom.motion, first + k, -1, cut=True), known, q)
        walk.over(aligned.inverse())
