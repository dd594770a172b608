"""Jacobian of a frame, where its entries are zero or constant, and Renaud's factors of it.

Every joint gives the velocity z x L along its own axis, L being the vector from the joint to the
point whose velocity is asked for; the axes in which the result is asked for may be those of any
frame, and the nearer they are to the middle of the chain, the fewer rotations are needed.

Source: Renaud 1980; Khalil & Creusot 1997, eq. 3 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from operator import itemgetter

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly.tree import Frame, Tree
from mbs.components.joints import Motion
from mbs.recursions.poses import base_poses, link_poses
from mbs.recursions.route import (
    JointAt,
    OriginOf,
    OtherRotation,
    PathStep,
    PathTranslation,
    along,
    common_link,
    cost,
    express,
    join_rotations,
    path_between,
    path_to,
    relative_pose,
    reverse_path,
)
from mbs.recursions.velocities import unit_motions_at_joint
from mbs.spatial import Pose, Rotation, cross, is_zero, skew, zeros


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
    """The tree seen from the frame in whose axes a Jacobian is asked for.

    Attributes:
        tree: the links.
        branches: two paths outwards from that frame: to the frame that moves, with the joints
            that come after their common link, and to the base with the others.
    """

    tree: Tree
    branches: tuple[list[PathStep], list[PathStep]]

    @property
    def rotations(self) -> int:
        """Number of rotations on the longer branch."""
        return max(sum(isinstance(s, OtherRotation) for s in branch) for branch in self.branches)


def outlook(target: VelocityTarget) -> Outlook:
    """What the Jacobian of a frame in certain axes is made of."""
    tree, q, frame, axes = target.tree, target.q, target.frame, target.axes
    back, out = path_between(tree, q, axes, frame)
    aside = [step for step in back if not isinstance(step, (JointAt, OriginOf))]
    trunk = reverse_path(path_to(tree, q, (common_link(tree, frame[0], axes[0]), Pose.identity())))
    return Outlook(
        tree, (join_rotations([*aside, *out], tree), join_rotations([*aside, *trunk], tree))
    )


def jacobian(seen: Outlook, reference: int | None = None, matrices: int = 0) -> SX:
    """(6, nv) with [V; w] = J v, in the axes of the outlook.

    Args:
        seen: the frame that moves and the axes.
        reference: V is that of the point that is fixed on the frame and now at the origin of
            this link's frame, -1 for the base's; None for the frame's own origin.
        matrices: for so many rotations, counted from the axes, orientations are formed and applied;
            beyond, each vector is rotated by itself. It changes the operations, not the result.
    """
    J = zeros(6, seen.tree.nv)
    for branch, arms in zip(seen.branches, _arms(seen.branches, reference), strict=True):
        columns = _local_columns(seen.tree, branch, arms)
        for k, V, w in _columns_at_start(branch, columns, matrices):
            J[:, k] = casadi.vertcat(V, w)
    return J


Column = tuple[int, SX, SX]
"""Index in v, and what a unit of it gives: linear and angular velocity."""


def _arms(branches: Sequence[list[PathStep]], reference: int | None) -> list[list[SX]]:
    """After each step of each branch, the vector from there to the reference, in the axes there."""
    place = [_place(branch, reference) for branch in branches]
    here = 0 if reference is None or place[0] is not None else 1
    number = place[here]
    assert number is not None
    inward, arm = _inward(branches[here][: number + 1])
    outward = _outward(branches[here][number + 1 :], zeros())
    other = _outward(branches[1 - here], arm)
    own = inward + outward
    return [own, other] if here == 0 else [other, own]


def _place(branch: list[PathStep], reference: int | None) -> int | None:
    """The step after which the reference is; -1 is the beginning, None elsewhere."""
    if reference is None:
        return len(branch) - 1
    mark = OriginOf(reference)
    return branch.index(mark) if mark in branch else None


def _inward(branch: list[PathStep]) -> tuple[list[SX], SX]:
    """Vectors to the end of the branch, after each step and before the first."""
    arm, arms = zeros(), []
    for step in reversed(branch):
        arms.append(arm)
        match step:
            case PathTranslation(p=p):
                arm = arm + p
            case OtherRotation(rotation=rotation):
                (arm,) = along(rotation, [arm])
    return arms[::-1], arm


def _outward(branch: list[PathStep], arm: SX) -> list[SX]:
    """Vectors to a reference that lies `arm` from the beginning of the branch."""
    arms = []
    for step in branch:
        match step:
            case PathTranslation(p=p):
                arm = arm - p
            case OtherRotation(rotation=rotation) if not is_zero(arm):
                arm = casadi.densify(rotation.apply_inverse(arm))
        arms.append(arm)
    return arms


def _local_columns(tree: Tree, branch: list[PathStep], arms: list[SX]) -> list[tuple[int, Column]]:
    """For each joint on the branch, the step where it is and its columns in the axes there."""
    result = []
    for number, step in enumerate(branch):
        if isinstance(step, JointAt):
            link = tree.links[step.link]
            for column, (linear, angular) in enumerate(unit_motions_at_joint(link)):
                V = linear if is_zero(angular) else linear + cross(angular, arms[number])
                result.append((number, (link.v.start + column, V, angular)))
    return result


def _columns_at_start(
    branch: list[PathStep], columns: list[tuple[int, Column]], matrices: int
) -> list[Column]:
    """The columns in the axes at the beginning of the branch."""
    turns = [number for number, step in enumerate(branch) if isinstance(step, OtherRotation)]
    split = turns[matrices] if matrices < len(turns) else len(branch)
    R, near = Pose.identity().R, []
    for number, step in enumerate(branch[:split]):
        if isinstance(step, OtherRotation):
            R = casadi.mtimes(R, step.rotation.matrix)
        near += [_rotate(R, column) for at, column in columns if at == number]
    far: list[Column] = []
    for number in reversed(range(split, len(branch))):
        far += [column for at, column in columns if at == number]
        step = branch[number]
        if isinstance(step, OtherRotation):
            far = [_rotate_by(step.rotation, column) for column in far]
    return near + [_rotate(R, column) for column in far]


def _rotate(R: SX, column: Column) -> Column:
    k, V, w = column
    return k, casadi.mtimes(R, V), casadi.mtimes(R, w)


def _rotate_by(rotation: Rotation, column: Column) -> Column:
    k, V, w = column
    V, w = along(rotation, [V, w])
    return k, V, w


# Where the entries of a Jacobian are zero or constant, frame by frame, found on random
# configurations.
#
# An entry that is zero at several random configurations with random lengths is zero always; so the
# structure is known before a symbol is touched.


Array = NDArray[np.float64]

_SAMPLES = 3
_ZERO = 1e-10
"""Of lengths in units of the survey, and of components of unit vectors."""


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """A frame's Jacobian and the frames on the path to it, at random configurations.

    Lengths are parts of the largest one, so that a small mechanism has no more zeros than a large
    one.

    Attributes:
        frames: the base, the links on the path, and at last the axes that were asked for.
        R: (frames, samples, 3, 3) their orientations in the base.
        p: (frames, samples, 3) their origins in the base.
        target_p: (samples, 3) origin of the frame that moves, in the base.
        J: (samples, 6, nv) Jacobian in the base, for velocities in units of their own.
        units: (nv,) these: of a tree's joints the length where they slide, 1 where they turn.
    """

    frames: tuple[Frame, ...]
    R: Array
    p: Array
    target_p: Array
    J: Array
    units: Array

    def combine(self, G: Array) -> Survey:
        """The same of other velocities, of which G (samples, nv, m) makes these."""
        parts = G / self.units[:, None]
        sizes = np.abs(parts).max(axis=(0, 1))
        units = 1 / np.where(sizes > 0, sizes, 1.0)
        return replace(self, J=self.J @ parts * units, units=units)

    @property
    def on_path(self) -> range:
        """Indices of the base and of the links."""
        return range(len(self.frames) - 1)

    def linear(self, axes: int, reference: int | None) -> Array:
        """(samples, 3, nv) velocity of a reference in the axes of a frame, both as positions."""
        place = self.target_p if reference is None else self.p[reference]
        V = self.J[:, :3] + np.cross(self.J[:, 3:], (place - self.target_p)[..., None], axis=1)
        return np.asarray(np.swapaxes(self.R[axes], 1, 2) @ V)

    def angular(self, axes: int) -> Array:
        """(samples, 3, nv) angular velocity in the axes of a frame."""
        return np.asarray(np.swapaxes(self.R[axes], 1, 2) @ self.J[:, 3:])

    def orientation(self, axes: int) -> Array:
        """(samples, 3, 3) orientation of a frame in the axes that were asked for."""
        return np.asarray(np.swapaxes(self.R[-1], 1, 2) @ self.R[axes])

    def separate_origins(self) -> list[int]:
        """Indices of links whose origins are not always where a later one's or the frame's is."""
        seen, kept = [self.target_p], []
        for number in reversed(self.on_path):
            if all(np.abs(self.p[number] - other).max() > _ZERO for other in seen):
                kept.append(number)
                seen.append(self.p[number])
        return kept[::-1]

    def arm(self, reference: int | None) -> Array:
        """(samples, 3) from a reference to the frame's origin, in the axes asked for."""
        if reference is None:
            return np.zeros_like(self.target_p)
        arm = self.target_p - self.p[reference]
        return np.asarray(np.einsum("sji,sj->si", self.R[-1], arm))


def survey(target: VelocityTarget) -> Survey:
    """The Jacobian of a frame at random configurations and parameters."""
    tree, q, frame, axes = target.tree, target.q, target.frame, target.axes
    path = tree.path(frame[0])
    poses = base_poses(tree, link_poses(tree, q))
    home = Pose.identity()
    frames = [(k, home) for k in (-1, *path)] + [axes, frame]
    placed = [(poses[k] if k >= 0 else home) @ inside for k, inside in frames]
    base = outlook(target.along((-1, home)))
    J = jacobian(base, matrices=base.rotations)
    outputs = [casadi.horzcat(*(pose.matrix for pose in placed)), casadi.densify(J)]
    f = Function("survey", [q, target.p], outputs)
    values = [f(*sample) for sample in random_samples(tree, target.p.numel())]
    T = np.array([np.array(v[0]).reshape(4, -1, 4).swapaxes(0, 1) for v in values])
    T = T.swapaxes(0, 1)
    J_values = np.array([np.array(v[1]) for v in values])
    length = float(np.abs(T[:, :, :3, 3]).max()) or 1.0
    slides = (np.abs(J_values[:, 3:]) < _ZERO).all(axis=(0, 1))
    units = np.where(slides, length, 1.0)
    J_values[:, :3] /= length
    p = T[:, :, :3, 3] / length
    return Survey(tuple(frames[:-1]), T[:-1, :, :3, :3], p[:-1], p[-1], J_values * units, units)


def random_samples(tree: Tree, parameters: int) -> list[tuple[Array, Array]]:
    """Positions at random, and the same random parameters with each of them."""
    rng = np.random.default_rng(4)
    # positive and of about one, as lengths and masses are, and not near zero
    p = rng.uniform(0.3, 1.7, parameters)
    return [(_random_position(tree, rng), p) for _ in range(_SAMPLES)]


def _random_position(tree: Tree, rng: np.random.Generator) -> Array:
    # [rad or m], between zero and a half turn, of which neither is generic
    q = rng.uniform(0.3, 2.8, tree.nq)
    for link in tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            part = slice(link.q.stop - 4, link.q.stop)
            q[part] /= np.linalg.norm(q[part])
    return q


def nonzero(values: Array) -> NDArray[np.bool_]:
    """Where a matrix, (samples, ...), is not zero in every sample."""
    return np.asarray(
        (np.abs(values) > _ZERO * max(1.0, float(np.abs(values).max(initial=0)))).any(0)
    )


def varying(values: Array) -> NDArray[np.bool_]:
    """Where a matrix, (samples, ...), changes from configuration to configuration."""
    return nonzero(values - values[0])


# Renaud's factors of a Jacobian, and the frame in the middle that makes the last one simple.
#
# J = [R 0; 0 R] [I -L^; 0 I] J_i: the velocity of a reference point in the axes of an
# intermediate frame i, moved to the origin of the frame, turned into the target axes.
#
# Source: Renaud 1980; Khalil & Creusot 1997, eq. 4.


_HOME = Pose.identity()
_COUNTED = 6
"""How many candidates are built and counted; the survey has ranked them. One in a long chain."""
_MOST_TURNS = 24
"""Branches with more turns than this take orientations for all of them."""
_MOST_PLACES = 16
"""A longer chain is looked at from so many of its frames only."""


@dataclass(frozen=True, slots=True, eq=False)
class Renaud:
    """The three factors of a Jacobian.

    Attributes:
        intermediate: link in whose axes J is, -1 for the base.
        reference: link whose origin V belongs to, None for the frame's own origin.
        R: (3, 3) orientation of the intermediate frame in the target axes.
        L: (3, 1) from the reference to the frame's origin, in the intermediate axes [m].
        J: (6, nv) in the intermediate axes.
    """

    intermediate: int
    reference: int | None
    R: SX
    L: SX
    J: SX

    @property
    def rotation(self) -> SX:
        """(6, 6) the first factor."""
        Z = SX.zeros(3, 3)
        return casadi.vertcat(casadi.horzcat(self.R, Z), casadi.horzcat(Z, self.R))

    @property
    def displacement(self) -> SX:
        """(6, 6) the second factor."""
        eye = casadi.densify(SX(DM.eye(3)))
        return casadi.vertcat(
            casadi.horzcat(eye, -skew(self.L)), casadi.horzcat(SX.zeros(3, 3), eye)
        )


def cheapest_jacobian(target: VelocityTarget, reference: int | None = None) -> SX:
    """(6, nv) Jacobian, of the ways to form it the one with the fewest operations.

    Args:
        target: the frame that moves, and the axes.
        reference: link whose origin V belongs to, None for the frame's own origin.
    """
    seen = outlook(target)
    most = seen.rotations
    numbers = [most] if most > _MOST_TURNS else sorted({*range(0, most, 2), most})
    candidates = (jacobian(seen, reference, number) for number in numbers)
    return min(candidates, key=lambda J: cost(J, target.q, target.p))


def renaud(
    target: VelocityTarget, intermediate: int | None = None, reference: int | None = None
) -> Renaud:
    """The three factors; what is not asked for is chosen for the fewest operations of J.

    Args:
        target: the frame that moves, and the target axes.
        intermediate: link on the path to the frame, -1 for the base, or None for the best.
        reference: link on the path whose origin the velocity J v belongs to, or None for the best.
    """
    found = survey(target)
    ranked = _rank(found, intermediate, reference)
    counted = _COUNTED if len(found.frames) <= _MOST_PLACES else 1
    candidates = [
        (i, r, cheapest_jacobian(target.along((i, _HOME)), r)) for i, r in ranked[:counted]
    ]
    i, r, J = min(candidates, key=lambda found: cost(found[2], target.q, target.p))
    R = relative_pose(target.tree, target.q, target.axes, (i, _HOME)).R
    return Renaud(i, r, R, arm_from(target.along((i, _HOME)), r), J)


def arm_from(target: VelocityTarget, reference: int | None) -> SX:
    """(3, 1) from the origin of a link's frame to that of the frame that moves [m]."""
    if reference is None:
        return zeros()
    place = reference, _HOME
    p = relative_pose(target.tree, target.q, place, target.frame).p
    return express(target.tree, target.q, target.axes, place, [p])[0]


def _rank(
    found: Survey, intermediate: int | None, reference: int | None
) -> list[tuple[int, int | None]]:
    """Pairs of axes and reference, those with the fewest entries that vary first."""
    links = [found.frames[k][0] for k in found.on_path]
    places = spread(found.on_path)
    axes = places if intermediate is None else [links.index(intermediate)]
    own: list[int | None] = [None, *spread(found.separate_origins())]
    references = own if reference is None else [links.index(reference)]
    rank: list[tuple[tuple[int, int, float], int, int | None]] = []
    for i, r in product(axes, references):
        J = np.concatenate([found.linear(i, r), found.angular(i)], axis=1)
        key = int(varying(J).sum()), int(nonzero(J).sum()), abs(i - len(links) / 2)
        rank.append((key, links[i], None if r is None else links[r]))
    rank.sort(key=itemgetter(0))
    return [(i, r) for _, i, r in rank]


def spread(places: Sequence[int]) -> list[int]:
    """Some of many places, evenly."""
    picks = np.linspace(0, len(places) - 1, min(len(places), _MOST_PLACES)).round().astype(int)
    return [places[k] for k in picks]
