"""Loop chain of a system: its unknown joints in cyclic order, its geometry, closed samples.

A loop chain (`Ring`) is a chain whose ends coincide, see `mbs.recursions.chain`.

Source: Khalil & Creusot 1997, eq. 2.
"""

from __future__ import annotations

from collections.abc import Container
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
    Ring,
    Spin,
    links_between,
    transforms,
)
from mbs.solvers.least_squares import gauss_newton
from mbs.solvers.rank import rank
from mbs.spatial import Pose, align_z, vector

# Indices of positions: those in q, then positions of cut joints, then spins of rods.
#
# A rod between two spherical joints may spin about its own line, which no closure row detects. Then
# one velocity of a quaternion is independent, and no element of q belongs to it. Its position is
# the angle [rad] by which the rod is rotated about its line. At zero, the shortest rotation moves
# the rod from its orientation in the assembled configuration.


def cut_indices(system: System) -> tuple[int, ...]:
    """Return the first position index of each cut joint, and the end of the last one.

    Indices of positions are those in q, then those of cut joints, then spins of rods.

    Args:
        system: system with closed loops.
    """
    counts = [max(1, len(cut.edge.joint.freedoms)) for cut in system.cuts]
    return tuple(system.nq + sum(counts[:k]) for k in range(len(counts) + 1))


def spin_indices(system: System) -> dict[int, int]:
    """Return the position index of each rod spin, by the first index in q of its quaternion.

    A spin is the rotation of a rod with two spherical joints about its own line.

    Args:
        system: system with closed loops.
    """
    spherical = [
        link.q.start
        for link in system.tree.links
        for k in system.chosen_coordinates
        if link.motion is Motion.SPHERICAL and link.v.start <= k < link.v.stop
    ]
    first = cut_indices(system)[-1]
    return {start: first + number for number, start in enumerate(spherical)}


def extent(system: System) -> int:
    """Return the number of all positions: those in q, of cut joints, and rod spins.

    Args:
        system: system with closed loops.
    """
    return cut_indices(system)[-1] + len(spin_indices(system))


def independent_indices(system: System) -> list[int]:
    """Return the position indices of the joints in the order of `system.chosen_coordinates`.

    Args:
        system: system with closed loops.

    Raises:
        NoClosedForm: a body is free, or a spherical joint has more than one independent rotation.
    """
    spins, indices = spin_indices(system), list[int]()
    for k in system.chosen_coordinates:
        link = next(link for link in system.tree.links if link.v.start <= k < link.v.stop)
        index = link.q.start if link.motion.nq == 1 else spins.get(link.q.start)
        if index is None or index in indices:
            raise NoClosedForm(_undetermined_text(system, link))
        indices.append(index)
    return indices


def _undetermined_text(system: System, link: Link) -> str:
    """Return the error message for a quaternion that the independent positions do not determine."""
    return (
        f"{system.name}: the quaternion of {link.name} rotates freely, and the positions of"
        " independent joints cannot tell how; use mbs.loops.solve without branch"
    )


def loop_links(system: System, cut: Cut) -> tuple[list[int], list[int]]:
    """Return the link indices of the two sides of the loop of a cut joint.

    Args:
        system: system of the cut joint.
        cut: cut joint.

    Returns:
        Indices from its frame_a to the common link, and from there to its frame_b.
    """
    return links_between(system.tree, cut.link_a, cut.link_b)


def ring_of(system: System, number: int, known: Container[int], q: SX) -> Ring:
    """Return the loop chain of a cut joint, from its frame_a through the tree and the cut joint.

    Args:
        system: mechanism with the loop.
        number: index of the cut joint.
        known: indices of the known positions.
        q: symbols of q (nq, 1) and of the positions of cut joints. Only known ones are used.
    """
    builder, cut = ChainBuilder(known, q), system.cuts[number]
    a, b = (cut.link_a, cut.pose_a), (cut.link_b, cut.pose_b)
    builder.along_tree(system.tree, a, b, _spins(system))
    if not cut.welded:
        _append_cut_joint(builder, system, number)
    return builder.chain().ring()


def _spins(system: System) -> dict[int, Spin]:
    """Return the spins of spherical joints of rods, by the first index in q of the quaternion."""
    rest = {link.q.start: system.configuration[link.q] for link in system.tree.links}
    return {start: Spin(index, rest[start]) for start, index in spin_indices(system).items()}


def _append_cut_joint(builder: ChainBuilder, system: System, number: int) -> None:
    """Append the freedoms of cut joint `number` to the chain, from its frame_b to its frame_a.

    `builder` is the chain under construction.
    """
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


# Geometry of a loop from its known transforms at random positions and parameters.
#
# A property that holds at all samples is structural: it follows from numeric or equal symbolic
# lengths and angles, and not from one special configuration.


Matrix = NDArray[np.float64]

_SURVEYED = 3
_SURVEY_SEED = 20260103
_CLOSE = 1e-9
"""Largest length [m] or cosine that counts as zero, and difference that counts as equal: products
of a few transforms have rounding of 1e-15, and other values are about one at random positions."""
PARAMETERS = (0.4, 1.6)
"""Range of random values of parameters: of size one, positive and not near zero, as lengths are."""
_POSITIONS = (-1.5, 1.5)
"""Range of random positions [rad or m]: both signs, and angles within a quarter rotation."""
_Z = np.array([0.0, 0.0, 1.0])


def gap_samples(ring: Ring, q: SX, p: SX) -> list[list[Matrix]]:
    """Return the poses (4, 4) of all known transforms of a loop, at three random samples.

    Args:
        ring: loop chain.
        q: symbols of positions, which are random in each sample.
        p: symbols of parameters, which are random in each sample.
    """
    return [
        [np.array(DM(T)) for T in values]
        for values in _values_at_samples([gap.pose.matrix for gap in ring.gaps], q, p)
    ]


def _values_at_samples(values: list[SX], q: SX, p: SX) -> list[list[DM]]:
    """Return the values of expressions of q and p at three random positions and parameters."""
    rng = np.random.default_rng(_SURVEY_SEED)
    function = Function("samples", [q, p], values)
    return [
        function.call(
            [DM(rng.uniform(*_POSITIONS, q.numel())), DM(rng.uniform(*PARAMETERS, p.numel()))]
        )
        for _ in range(_SURVEYED)
    ]


def meeting_point(pose: Pose) -> tuple[SX, SX]:
    """Return the intersection of the z axes of two frames, as a coordinate along each axis [m].

    The axes must intersect and must not be parallel.

    Args:
        pose: pose of the second frame relative to the first.

    Returns:
        Coordinate along the first axis, and along the second axis.
    """
    slope, offset = pose.R[0:2, 2], pose.p[0:2]
    second = -(slope.T @ offset) / (slope.T @ slope)
    return SX(pose.p[2] + pose.R[2, 2] * second), SX(second)


def axes_meet(pose: Pose, q: SX, p: SX) -> bool:
    """Whether the z axes of two frames intersect in one point, for all positions and parameters.

    Args:
        pose: pose of the second frame relative to the first.
        q: symbols of positions.
        p: symbols of parameters.
    """
    slope, offset = pose.R[0:2, 2], pose.p[0:2]
    return not parallel(pose, q, p) and always_zero(
        slope[0] * offset[1] - slope[1] * offset[0], q, p
    )


def parallel(pose: Pose, q: SX, p: SX) -> bool:
    """Whether the z axes of two frames are parallel, for all positions and parameters.

    Args:
        pose: pose of the second frame relative to the first.
        q: symbols of positions.
        p: symbols of parameters.
    """
    return always_zero(pose.R[0:2, 2], q, p)


def always_zero(values: SX, q: SX, p: SX) -> bool:
    """Whether each element of an expression is zero for all positions and parameters.

    It is decided at three random samples.

    Args:
        values: expression.
        q: symbols of positions.
        p: symbols of parameters.
    """
    samples = [np.array(value).ravel() for (value,) in _values_at_samples([values], q, p)]
    return all(bool(np.all(np.abs(sample) < _CLOSE)) for sample in samples)


def constants(values: SX, q: SX, p: SX) -> list[float | None]:
    """Return each element of an expression as a number if it is constant, else None.

    Args:
        values: expression.
        q: symbols of positions on which an element may depend.
        p: symbols of parameters on which an element may depend.
    """
    samples = np.array([np.array(value).ravel() for (value,) in _values_at_samples([values], q, p)])
    same = np.all(np.abs(samples - samples[0]) < _CLOSE, axis=0)
    return [float(x) if fixed else None for x, fixed in zip(samples[0], same, strict=True)]


def without_unused_freedom(ring: Ring, samples: list[list[Matrix]]) -> Ring:
    """Return the loop without one freedom of its cut joint that a plane loop never uses.

    Such a freedom is a translation along the normal, or a rotation about an axis in the plane. The
    same object is returned if there is none.

    Args:
        ring: loop chain.
        samples: poses of its known transforms at samples, from `gap_samples`.
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
    """Return a loop of three joints, started so that rigid links adjoin the joint in the middle.

    The loop is unchanged if no start has this property.

    Args:
        ring: loop chain of three joints.
        q: symbols of positions.
    """
    for k in range(3):
        begun = ring.rotated(k)
        sides = casadi.vertcat(*(casadi.vec(gap.pose.matrix) for gap in begun.gaps[1:]))
        if not casadi.depends_on(sides, q):
            return begun
    return ring


def is_planar(ring: Ring, samples: list[list[Matrix]]) -> bool:
    """Whether all rotations are about one direction, and all translations perpendicular to it.

    A spherical joint at the end of the loop may act as a revolute joint.

    Args:
        ring: loop chain.
        samples: poses of its known transforms at samples, from `gap_samples`.
    """
    start = _first_revolute(ring)
    if start is None:
        return False
    spherical = any(joint.motion is Motion.SPHERICAL for joint in ring.joints)
    n = len(ring.joints)
    ends = range(start + 1, n) if spherical else range(start + 1, start + n + 1)
    return all(
        _fits_plane(ring.joints[k % n].motion, _normal(gaps, start, k))
        for gaps in samples
        for k in ends
    )


def _first_revolute(ring: Ring) -> int | None:
    """Return the index of the first revolute joint of a loop, or None."""
    revolute = (k for k, joint in enumerate(ring.joints) if joint.motion is Motion.REVOLUTE)
    return next(revolute, None)


def _normal(gaps: list[Matrix], start: int, end: int) -> Matrix:
    """Return the axis (3,) of joint `start` in the frame of joint `end`, with joints at zero.

    `gaps` are the known transforms (4, 4) of the loop.
    """
    normal, n = _Z, len(gaps)
    for k in range(start + 1, end + 1 if end > start else end + n + 1):
        normal = gaps[k % n][:3, :3].T @ normal
    return normal


def _fits_plane(motion: Motion, normal: Matrix) -> bool:
    """Whether a joint can move in a plane with this normal (3,) in the joint frame.

    `motion` is the type of the joint.
    """
    if motion is Motion.SPHERICAL:
        return True
    cosine = abs(float(normal[2]))
    return cosine < _CLOSE if motion is Motion.PRISMATIC else cosine > 1 - _CLOSE


# Numeric configurations that close a loop, from random starts, in which known positions may change.
#
# A property of all of them is structural, as above, for loops that do not close for all values of
# the known positions.


Vector = NDArray[np.float64]

_SAMPLES, _TRIES, _SEED = 4, 24, 20260107
_ITERATIONS = 40
_MOVABLE = 2
_LOOSE = 1e-6
"""Relative singular value below which a joint can move while known positions are fixed: it is the
root of 1e-12, to which loops are closed, and so the error of a zero at a double root."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Configuration that closes a loop.

    Attributes:
        x: (n,) positions of the joints, in their order.
        given: (m,) values of the symbols in the known transforms.
        rank: rank of the derivative of the closure by x. Below n, joints can move for fixed
            `given`.
    """

    x: Vector
    given: Vector
    rank: int


def closure_of(ring: Ring, x: SX) -> SX:
    """Return the closure error (12, 1) of a loop: rotation matrix minus identity, then position.

    Args:
        ring: loop chain of n joints.
        x: (n, 1) positions of the joints [rad or m].
    """
    T = transforms(ring, x)[-1]
    return SX(casadi.densify(casadi.vertcat(casadi.vec(T.R - SX.eye(3)), T.p)))


def closed_samples(ring: Ring, given: SX, p: SX) -> list[Sample]:
    """Return up to four closed configurations from random starts.

    The search ends early after two configurations at which joints can move for fixed `given`.

    Args:
        ring: loop chain of revolute and prismatic joints.
        given: (m, 1) symbols of its known transforms.
        p: symbols of parameters, which keep their random values. Other symbols of `given` may
            change.
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
        closed = _gauss_newton(function, start, fixed)
        if closed is not None:
            J = np.array(function(closed)[1])[:, :n]
            samples.append(Sample(closed[:n], closed[n:], rank(J, _LOOSE)))
        movable = sum(sample.rank < n for sample in samples)
        if len(samples) == _SAMPLES or movable == _MOVABLE:
            break
    return samples


def _gauss_newton(function: Function, start: Vector, fixed: NDArray[np.bool_]) -> Vector | None:
    """Return a closed configuration near `start` by Gauss-Newton; None if it does not converge.

    Elements of the mask `fixed` are kept.

    `function` maps all positions to the closure error and its Jacobian.
    """

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
