"""The ring of a loop: its unknown joints in cyclic order, its geometry, samples of it.

A ring is a chain whose ends coincide, see `mbs.recursions.chain`; here it is read off a system.

Source: Khalil & Creusot 1997, eq. 2.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass

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
from mbs.recursions.chain import (
    ChainBuilder,
    ChainJoint,
    Gap,
    Ring,
    Spin,
    links_between,
    transforms,
)
from mbs.solvers.least_squares import gauss_newton
from mbs.solvers.rank import rank
from mbs.spatial import Pose, align_z, vector

# Where positions stand: those of q, then those of cut joints, then the spins of rods.
#
# A rod between two spherical joints may spin about its own line, which no closure row sees: one
# velocity of a quaternion is independent then, and no element of q belongs to it. Its position here
# is the angle by which the rod is rotated about its line [rad], from where the shortest rotation
# leads from its orientation in the assembled configuration.


def cut_indices(system: System) -> tuple[int, ...]:
    """Where the positions of each cut joint begin, and the end of all."""
    counts = [max(1, len(cut.edge.joint.freedoms)) for cut in system.cuts]
    return tuple(system.nq + sum(counts[:k]) for k in range(len(counts) + 1))


def spin_indices(system: System) -> dict[int, int]:
    """The index of each spin, by the one in q at which the quaternion of its joint begins."""
    spherical = [
        link.q.start
        for link in system.tree.links
        for k in system.free
        if link.motion is Motion.SPHERICAL and link.v.start <= k < link.v.stop
    ]
    first = cut_indices(system)[-1]
    return {start: first + number for number, start in enumerate(spherical)}


def extent(system: System) -> int:
    """How many positions there are, those of cut joints and spins included."""
    return cut_indices(system)[-1] + len(spin_indices(system))


def independent_indices(system: System) -> list[int]:
    """The indices of the independent joints, in the order of `system.free`.

    Raises:
        NoClosedForm: a body is free, or a spherical joint rotates freely in more than one way.
    """
    spins, indices = spin_indices(system), list[int]()
    for k in system.free:
        link = next(link for link in system.tree.links if link.v.start <= k < link.v.stop)
        index = link.q.start if link.motion.nq == 1 else spins.get(link.q.start)
        if index is None or index in indices:
            raise NoClosedForm(_unplaced(system, link))
        indices.append(index)
    return indices


def _unplaced(system: System, link: Link) -> str:
    return (
        f"{system.name}: the quaternion of {link.name} rotates freely, and the positions of"
        " independent joints cannot tell how; use mbs.loops.solve without branch"
    )


def loop_links(system: System, cut: Cut) -> tuple[list[int], list[int]]:
    """The links from frame_a of a cut joint back to the common link, and from there to frame_b."""
    return links_between(system.tree, cut.link_a, cut.link_b)


def ring_of(system: System, number: int, known: Container[int], q: SX) -> Ring:
    """The loop that a cut joint closes, from its frame_a through the tree and the joint itself.

    Args:
        system: whose loop it is.
        number: of the cut joint.
        known: indices in q of the positions that are known.
        q: (nq, 1) symbols followed by those of cut joints, of which the known ones are used.
    """
    builder, cut = ChainBuilder(known, q), system.cuts[number]
    a, b = (cut.link_a, cut.pose_a), (cut.link_b, cut.pose_b)
    builder.along_tree(system.tree, a, b, _spins(system))
    if not cut.welded:
        _pass_cut(builder, system, number)
    return builder.chain().ring()


def _spins(system: System) -> dict[int, Spin]:
    """Of the spherical joints of rods, by the index in q at which their quaternions begin."""
    rest = {link.q.start: system.configuration[link.q] for link in system.tree.links}
    return {start: Spin(index, rest[start]) for start, index in spin_indices(system).items()}


def _pass_cut(builder: ChainBuilder, system: System, number: int) -> None:
    """Back through the freedoms of the cut joint, from its frame_b to its frame_a."""
    joint = system.cuts[number].edge.joint
    spherical = ChainJoint(joint.name, Motion.SPHERICAL, None, -1, cut=True)
    freedoms = joint.freedoms
    if isinstance(joint, Spherical):
        builder.through(spherical)
        return
    if isinstance(joint, Rod):
        builder.through(spherical)
        builder.over(Pose.translation(vector([to_sx(joint.length, system.symbol_table), 0, 0])))
        builder.through(spherical)
        return
    if isinstance(joint, PointOnLine):
        builder.through(spherical)
        freedoms = (Freedom(Motion.PRISMATIC, joint.axis),)
    first = cut_indices(system)[number]
    for k, freedom in reversed(list(enumerate(freedoms))):
        aligned = Pose.rotation(align_z(freedom.axis))
        name = freedom.coordinate_of(joint.name)
        builder.over(aligned)
        builder.past(ChainJoint(name, freedom.motion, first + k, -1, cut=True))
        builder.over(aligned.inverse())


# The geometry of a loop, read from its gaps at random positions and parameters.
#
# What holds at every one of them holds by structure: lengths and angles given as numbers, or by
# the same symbol, not by accident of one configuration.


Matrix = NDArray[np.float64]

_SURVEYED = 3
_SURVEY_SEED = 20260103
_CLOSE = 1e-9
"""Lengths [m] and cosines that count as zero or equal: products of a few transforms leave 1e-15 of
rounding, and those that do not vanish everywhere are of about one at random positions."""
PARAMETERS = (0.4, 1.6)
"""Between which symbols get random values: of the size of one, positive, and not near zero, so that
they may be lengths."""
_POSITIONS = (-1.5, 1.5)
"""The same of positions [rad or m]: of both signs, and angles within a quarter turn."""
_Z = np.array([0.0, 0.0, 1.0])


def gap_samples(ring: Ring, q: SX, p: SX) -> list[list[Matrix]]:
    """At some random positions and parameters the (4, 4) pose of every gap."""
    return [[np.array(DM(T)) for T in values] for values in _evaluate(_matrices(ring.gaps), q, p)]


def _matrices(gaps: Iterable[Gap]) -> list[SX]:
    return [gap.pose.matrix for gap in gaps]


def _evaluate(values: list[SX], q: SX, p: SX) -> list[list[DM]]:
    rng = np.random.default_rng(_SURVEY_SEED)
    function = Function("samples", [q, p], values)
    return [
        function.call(
            [DM(rng.uniform(*_POSITIONS, q.numel())), DM(rng.uniform(*PARAMETERS, p.numel()))]
        )
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
    samples = [np.array(value).ravel() for (value,) in _evaluate([values], q, p)]
    return all(bool(np.all(np.abs(sample) < _CLOSE)) for sample in samples)


def constants(values: SX, q: SX, p: SX) -> list[float | None]:
    """Each element that is the same whatever the positions and parameters; None for the others."""
    samples = np.array([np.array(value).ravel() for (value,) in _evaluate([values], q, p)])
    same = np.all(np.abs(samples - samples[0]) < _CLOSE, axis=0)
    return [float(x) if fixed else None for x, fixed in zip(samples[0], same, strict=True)]


def without_idle(ring: Ring, samples: list[list[Matrix]]) -> Ring:
    """The loop less the freedoms of its cut joint that a plane loop never uses.

    These translate along the common normal of a loop, or rotate about an axis across it.
    """
    start = _first_revolute(ring)
    if start is None:
        return ring
    for k in reversed(range(len(ring.joints))):
        joint = ring.joints[k]
        if joint.cut and joint.motion is not Motion.SPHERICAL:
            cosine = abs(_normal(samples[0], start, k)[2])
            idle = cosine < _CLOSE if joint.is_rotational else cosine > 1 - _CLOSE
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
    """Whether all rotations are about one direction, and all translations across it.

    A spherical joint, the last one of the loop, may stand for a revolute one.
    """
    start = _first_revolute(ring)
    if start is None:
        return False
    spherical = any(joint.motion is Motion.SPHERICAL for joint in ring.joints)
    n = len(ring.joints)
    ends = range(start + 1, n) if spherical else range(start + 1, start + n + 1)
    return all(
        _fits(ring.joints[k % n].motion, _normal(gaps, start, k)) for gaps in samples for k in ends
    )


def _first_revolute(ring: Ring) -> int | None:
    revolute = (k for k, joint in enumerate(ring.joints) if joint.motion is Motion.REVOLUTE)
    return next(revolute, None)


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
"""Relative singular value below which a joint moves while the given stay: it is the
root of 1e-12, to which loops are closed, and so what a double root leaves of a zero."""


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
    T = transforms(ring, x)[-1]
    return SX(casadi.densify(casadi.vertcat(casadi.vec(T.R - SX.eye(3)), T.p)))


def closed_samples(ring: Ring, given: SX, p: SX) -> list[Sample]:
    """Some closed configurations: four, or fewer where random starts lead to no more.

    It ends early where joints move at two of them while the given stay.

    Args:
        ring: a loop of revolute and prismatic joints.
        given: (m, 1) the symbols of its gaps.
        p: those of them that are parameters keep their random values, the others may move.
    """
    n, rng = len(ring.joints), np.random.default_rng(_SEED)
    parameters = {symbol.name() for symbol in casadi.symvar(p)}
    names = [symbol.name() for symbol in casadi.vertsplit(given)] if given.numel() else []
    fixed = np.array([False] * n + [name in parameters for name in names])
    x = SX.sym("x", n)
    every = casadi.vertcat(x, given)
    r = closure_of(ring, x)
    function = Function("closure", [every], [r, casadi.densify(casadi.jacobian(r, every))])
    samples = list[Sample]()
    for _ in range(_TRIES):
        start = np.where(
            fixed, rng.uniform(*PARAMETERS, fixed.size), rng.uniform(*_POSITIONS, fixed.size)
        )
        closed = _closed(function, start, fixed)
        if closed is not None:
            J = np.array(function(closed)[1])[:, :n]
            samples.append(Sample(closed[:n], closed[n:], rank(J, _LOOSE)))
        movable = sum(sample.rank < n for sample in samples)
        if len(samples) == _SAMPLES or movable == _MOVABLE:
            break
    return samples


def _closed(function: Function, start: Vector, fixed: NDArray[np.bool_]) -> Vector | None:
    def residual(free: Vector) -> tuple[Vector, Vector]:
        whole = start.copy()
        whole[~fixed] = free
        r, J = (np.array(value) for value in function(whole))
        return r.ravel(), J[:, ~fixed]

    root = gauss_newton(residual, start[~fixed], iterations=_ITERATIONS)
    if not root.converged:
        return None
    whole = start.copy()
    whole[~fixed] = root.x
    return whole
