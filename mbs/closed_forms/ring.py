"""A loop as its unknown joints in cyclic order: known poses between them, geometry, samples.

Walking once around the loop leads back to the start: X_1 J_1 X_2 J_2 .. X_n J_n = 1. Each J_k
turns about or slides along its own z axis; each X_k is made of links, and of joints whose positions
are known by then.

Source: Khalil & Creusot 1997, eq. 2.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass, field, replace

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tree import Link
from mbs.components import PointOnLine, Rod, Spherical
from mbs.components.joints import Freedom, Motion
from mbs.errors import NoClosedForm
from mbs.expressions import to_sx
from mbs.recursions.route import common_link
from mbs.solvers.least_squares import gauss_newton
from mbs.solvers.rank import rank
from mbs.spatial import Pose, align_z, axis_turn, quaternion_rotation, vector

# Where positions stand: those of q, then those of cut joints, then the spins of rods.
#
# A rod between two balls may spin about its own line, which no closure row sees: one velocity of
# a quaternion is independent then, and no element of q belongs to it. Its position here is the
# angle by which the rod is turned about its line [rad], from where the shortest way leads from
# its orientation in the assembled configuration.


def cut_places(system: System) -> tuple[int, ...]:
    """Where the positions of each cut joint begin, and the end of all."""
    counts = [max(1, len(cut.edge.joint.freedoms)) for cut in system.cuts]
    return tuple(system.nq + sum(counts[:k]) for k in range(len(counts) + 1))


def spin_places(system: System) -> dict[int, int]:
    """The place of each spin, by the number in q at which the quaternion of its ball begins."""
    balls = [
        link.q.start
        for link in system.tree.links
        for k in system.free
        if link.motion is Motion.SPHERICAL and link.v.start <= k < link.v.stop
    ]
    first = cut_places(system)[-1]
    return {start: first + number for number, start in enumerate(balls)}


def extent(system: System) -> int:
    """How many positions there are, those of cut joints and spins included."""
    return cut_places(system)[-1] + len(spin_places(system))


def independent_places(system: System) -> list[int]:
    """The places of the independent joints, in the order of `system.free`.

    Raises:
        NoClosedForm: a body is free, or a ball turns freely in more than one way.
    """
    spins, places = spin_places(system), list[int]()
    for k in system.free:
        link = next(link for link in system.tree.links if link.v.start <= k < link.v.stop)
        place = link.q.start if link.motion.nq == 1 else spins.get(link.q.start)
        if place is None or place in places:
            raise NoClosedForm(_unplaced(system, link))
        places.append(place)
    return places


def _unplaced(system: System, link: Link) -> str:
    return (
        f"{system.name}: the quaternion of {link.name} turns freely, and the positions of"
        " independent joints cannot tell how; use mbs.loops.solve without branch"
    )


@dataclass(frozen=True, slots=True)
class Spin:
    """The known turn of a rod about its own line, where a ball of the tree carries it.

    Attributes:
        place: number of the angle among the positions.
        rest: quaternion of the ball in the assembled configuration.
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
    spin = None if place is None else Spin(place, system.configuration[link.q])
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


# The geometry of a loop, read from its gaps at random positions and parameters.
#
# What holds at every one of them holds by structure: lengths and angles given as numbers, or by
# the same symbol, not by accident of one configuration.


Matrix = NDArray[np.float64]

_SURVEYED = 3
_SURVEY_SEED = 20260103
_CLOSE = 1e-9
_Z = np.array([0.0, 0.0, 1.0])


def gap_samples(ring: Ring, q: SX, p: SX) -> list[list[Matrix]]:
    """At some random positions and parameters the (4, 4) pose of every gap."""
    return [[np.array(DM(T)) for T in values] for values in _evaluated(_matrices(ring.gaps), q, p)]


def _matrices(gaps: Iterable[Gap]) -> list[SX]:
    return [gap.pose.matrix for gap in gaps]


def _evaluated(values: list[SX], q: SX, p: SX) -> list[list[DM]]:
    rng = np.random.default_rng(_SURVEY_SEED)
    function = Function("samples", [q, p], values)
    return [
        function.call([DM(rng.uniform(-1.5, 1.5, q.numel())), DM(rng.uniform(0.4, 1.6, p.numel()))])
        for _ in range(_SURVEYED)
    ]


def meeting_point(pose: Pose) -> tuple[SX, SX]:
    """Where the z axes of two frames meet, along each of them; the second is seen from the first.

    The axes are taken to meet and not to be parallel.
    """
    slope, offset = pose.R[0:2, 2], pose.p[0:2]
    second = -(slope.T @ offset) / (slope.T @ slope)
    return SX(pose.p[2] + pose.R[2, 2] * second), SX(second)


def axes_meet(pose: Pose, q: SX, p: SX) -> bool:
    """Whether the z axes of two frames meet in one point, whatever is known."""
    slope, offset = pose.R[0:2, 2], pose.p[0:2]
    return not parallel(pose, q, p) and always_zero(
        slope[0] * offset[1] - slope[1] * offset[0], q, p
    )


def parallel(pose: Pose, q: SX, p: SX) -> bool:
    """Whether the z axes of two frames are parallel, whatever is known."""
    return always_zero(pose.R[0:2, 2], q, p)


def always_zero(values: SX, q: SX, p: SX) -> bool:
    """Whether every element is zero whatever the positions and parameters."""
    samples = [np.array(value).ravel() for (value,) in _evaluated([values], q, p)]
    return all(bool(np.all(np.abs(sample) < _CLOSE)) for sample in samples)


def constants(values: SX, q: SX, p: SX) -> list[float | None]:
    """Each element that is the same whatever the positions and parameters; None for the others."""
    samples = np.array([np.array(value).ravel() for (value,) in _evaluated([values], q, p)])
    same = np.all(np.abs(samples - samples[0]) < _CLOSE, axis=0)
    return [float(x) if fixed else None for x, fixed in zip(samples[0], same, strict=True)]


def without_idle(ring: Ring, samples: list[list[Matrix]]) -> Ring:
    """The loop less the freedoms of its cut joint that a plane loop never uses.

    These slide along the common normal of a loop, or turn about an axis across it.
    """
    start = _first_turn(ring)
    if start is None:
        return ring
    for k in reversed(range(len(ring.joints))):
        joint = ring.joints[k]
        if joint.cut and joint.motion is not Motion.SPHERICAL:
            cosine = abs(_normal(samples[0], start, k)[2])
            idle = cosine < _CLOSE if joint.turns else cosine > 1 - _CLOSE
            if idle:
                return ring.without(k)
    return ring


def with_elbow(ring: Ring, q: SX) -> Ring:
    """The loop begun so that the joint in the middle has rigid links on both sides, if one has."""
    for k in range(3):
        begun = ring.rotated(k)
        sides = casadi.vertcat(*(casadi.vec(gap.pose.matrix) for gap in begun.gaps[1:]))
        if not casadi.depends_on(sides, q):
            return begun
    return ring


def is_planar(ring: Ring, samples: list[list[Matrix]]) -> bool:
    """Whether all turns are about one direction, and all slides across it.

    A spherical joint, the last one of the loop, may stand for a turn.
    """
    start = _first_turn(ring)
    if start is None:
        return False
    ball = any(joint.motion is Motion.SPHERICAL for joint in ring.joints)
    n = len(ring.joints)
    ends = range(start + 1, n) if ball else range(start + 1, start + n + 1)
    return all(
        _fits(ring.joints[k % n].motion, _normal(gaps, start, k)) for gaps in samples for k in ends
    )


def _first_turn(ring: Ring) -> int | None:
    turns = (k for k, joint in enumerate(ring.joints) if joint.motion is Motion.REVOLUTE)
    return next(turns, None)


def _normal(gaps: list[Matrix], start: int, end: int) -> Matrix:
    """The axis of joint `start` seen from the frame of joint `end`, all between at zero."""
    normal, n = _Z, len(gaps)
    for k in range(start + 1, end + 1 if end > start else end + n + 1):
        normal = gaps[k % n][:3, :3].T @ normal
    return normal


def _fits(motion: Motion, normal: Matrix) -> bool:
    if motion is Motion.SPHERICAL:
        return True
    cosine = abs(float(normal[2]))
    return cosine < _CLOSE if motion is Motion.PRISMATIC else cosine > 1 - _CLOSE


# Numbers at which a loop closes, from random starts: known positions move with the unknown ones.
#
# What holds at all of them holds by structure, as in `survey`; here of loops that do not close
# for every value of what is known.


Vector = NDArray[np.float64]

_SAMPLES, _TRIES, _SEED = 4, 24, 20260107
_ITERATIONS = 40
_MOVABLE = 2
_LOOSE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A configuration that closes a loop.

    Attributes:
        x: (n,) positions of its joints, in their order.
        given: (m,) values of the symbols in its gaps.
        rank: of the derivative of the closure by x; below n, joints move while the given stay.
    """

    x: Vector
    given: Vector
    rank: int


def closure_of(ring: Ring, x: SX) -> SX:
    """(12, 1) what is missing in X_1 J_1 .. X_n J_n = 1 at positions x (n, 1) [m or 1]."""
    T = Pose.identity()
    for k, (joint, gap) in enumerate(zip(ring.joints, ring.gaps, strict=True)):
        moved = joint.sign * x[k]
        turn = Pose.turned(axis_turn("z", moved).matrix)
        T = T @ gap.pose @ (turn if joint.turns else Pose.moved(vector([0, 0, moved])))
    return SX(casadi.densify(casadi.vertcat(casadi.vec(T.R - SX.eye(3)), T.p)))


def closed_samples(ring: Ring, given: SX, p: SX) -> list[Sample]:
    """Some closed configurations: four, or fewer where random starts lead to no more.

    It ends early where joints move at two of them while the given stay.

    Args:
        ring: a loop of turns and slides.
        given: (m, 1) the symbols of its gaps.
        p: those of them that are parameters keep their random values, the others may move.
    """
    n, rng = len(ring.joints), np.random.default_rng(_SEED)
    parameters = {symbol.name() for symbol in casadi.symvar(p)}
    names = [symbol.name() for symbol in casadi.vertsplit(given)] if given.numel() else []
    held = np.array([False] * n + [name in parameters for name in names])
    x = SX.sym("x", n)
    every = casadi.vertcat(x, given)
    r = closure_of(ring, x)
    function = Function("closure", [every], [r, casadi.densify(casadi.jacobian(r, every))])
    samples = list[Sample]()
    for _ in range(_TRIES):
        start = np.where(held, rng.uniform(0.4, 1.6, held.size), rng.uniform(-1.5, 1.5, held.size))
        closed = _closed(function, start, held)
        if closed is not None:
            J = np.array(function(closed)[1])[:, :n]
            samples.append(Sample(closed[:n], closed[n:], rank(J, _LOOSE)))
        movable = sum(sample.rank < n for sample in samples)
        if len(samples) == _SAMPLES or movable == _MOVABLE:
            break
    return samples


def _closed(function: Function, start: Vector, held: NDArray[np.bool_]) -> Vector | None:
    def residual(free: Vector) -> tuple[Vector, Vector]:
        whole = start.copy()
        whole[~held] = free
        r, J = (np.array(value) for value in function(whole))
        return r.ravel(), J[:, ~held]

    root = gauss_newton(residual, start[~held], iterations=_ITERATIONS)
    if not root.converged:
        return None
    whole = start.copy()
    whole[~held] = root.x
    return whole
