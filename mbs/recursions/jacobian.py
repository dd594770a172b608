"""Jacobian of a frame, positions of its zero and constant entries, and its factors after Renaud.

A unit velocity of a revolute joint with axis z contributes the linear velocity z x L, where L is
the vector from the joint to the reference point. The result may be expressed in the axes of any
frame. Axes near the middle of the chain need the fewest rotations.

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
from mbs.recursions.link_motions import base_poses, link_poses, unit_motions_at_joint
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
from mbs.spatial import Pose, Rotation, cross, is_zero, skew, zeros


@dataclass(frozen=True, slots=True, eq=False)
class VelocityTarget:
    """Frame whose velocity is required, and the axes of this velocity.

    Attributes:
        tree: the links.
        q: (nq, 1) symbols of positions.
        p: (np, 1) symbols of parameters. Operations on parameters alone are not counted.
        frame: moving frame whose velocity is required.
        axes: frame in whose axes the velocity is expressed.
    """

    tree: Tree
    q: SX
    p: SX
    frame: Frame
    axes: Frame

    def along(self, axes: Frame) -> VelocityTarget:
        """Return the same target with the velocity expressed in the axes of another frame."""
        return replace(self, axes=axes)


@dataclass(frozen=True, slots=True, eq=False)
class JacobianFrame:
    """Paths through a tree from the frame in whose axes a Jacobian is expressed.

    Attributes:
        tree: the links.
        branches: two paths that start at that frame. The first ends at the moving frame and
            contains the joints after the common link of both frames. The second ends at the base
            and contains the joints from the base up to the common link.
    """

    tree: Tree
    branches: tuple[list[PathStep], list[PathStep]]

    @property
    def rotations(self) -> int:
        """Number of rotations on the path that has more of them."""
        return max(sum(isinstance(s, OtherRotation) for s in branch) for branch in self.branches)


def outlook(target: VelocityTarget) -> JacobianFrame:
    """Return the paths from the axes of a target to the moving frame and to the base."""
    tree, q, frame, axes = target.tree, target.q, target.frame, target.axes
    back, out = path_between(tree, q, axes, frame)
    aside = [step for step in back if not isinstance(step, (JointAt, OriginOf))]
    trunk = reverse_path(path_to(tree, q, (common_link(tree, frame[0], axes[0]), Pose.identity())))
    return JacobianFrame(
        tree, (join_rotations([*aside, *out], tree), join_rotations([*aside, *trunk], tree))
    )


def jacobian(seen: JacobianFrame, reference: int | None = None, matrices: int = 0) -> SX:
    """Return the Jacobian J (6, nv) of a moving frame, in the axes at the start of two paths.

    [V; w] = J v with the linear velocity V [m/s] and the angular velocity w [rad/s].

    Args:
        seen: paths from the axes to the moving frame and to the base.
        reference: link (-1 for the base) whose frame origin is the reference point: V is the
            velocity of the point of the moving frame that coincides with it. None for the origin of
            the moving frame.
        matrices: number of rotations, counted from the axes, that are multiplied to orientation
            matrices. Beyond them each vector is rotated step by step. The result is the same; only
            the number of operations changes.
    """
    J = zeros(6, seen.tree.nv)
    for branch, arms in zip(seen.branches, _reference_arms(seen.branches, reference), strict=True):
        columns = _local_columns(seen.tree, branch, arms)
        for k, V, w in _columns_at_start(branch, columns, matrices):
            J[:, k] = casadi.vertcat(V, w)
    return J


Column = tuple[int, SX, SX]
"""Index in v, and the linear and angular velocity (3, 1) of a unit velocity."""


def _reference_arms(branches: Sequence[list[PathStep]], reference: int | None) -> list[list[SX]]:
    """Return vectors (3, 1) [m] from the end of each step of each path to the reference point.

    They are in the local axes of the step.

    Args:
        branches: paths to the moving frame and to the base.
        reference: link whose origin is the reference point; None for the moving frame.
    """
    place = [_reference_step(branch, reference) for branch in branches]
    here = 0 if reference is None or place[0] is not None else 1
    number = place[here]
    assert number is not None
    inward, arm = _vectors_to_end(branches[here][: number + 1])
    outward = _vectors_to_point(branches[here][number + 1 :], zeros())
    other = _vectors_to_point(branches[1 - here], arm)
    own = inward + outward
    return [own, other] if here == 0 else [other, own]


def _reference_step(branch: list[PathStep], reference: int | None) -> int | None:
    """Return the index of the step of a path at the origin of link `reference`.

    None if the path does not contain it. Without a reference it is the last step, -1 for an empty
    path.
    """
    if reference is None:
        return len(branch) - 1
    mark = OriginOf(reference)
    return branch.index(mark) if mark in branch else None


def _vectors_to_end(branch: list[PathStep]) -> tuple[list[SX], SX]:
    """Return vectors (3, 1) [m] to the end of a path: after each step, and from its start.

    Each is in the axes at its own beginning.
    """
    arm, arms = zeros(), []
    for step in reversed(branch):
        arms.append(arm)
        match step:
            case PathTranslation(p=p):
                arm = arm + p
            case OtherRotation(rotation=rotation):
                (arm,) = along(rotation, [arm])
    return arms[::-1], arm


def _vectors_to_point(branch: list[PathStep], arm: SX) -> list[SX]:
    """Return vectors (3, 1) [m] to a point from after each step of a path, in axes of the step.

    `arm` is the vector to this point from the start of the path.
    """
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
    """Return pairs (step index, Jacobian column) of the joints on a path, in axes of the step.

    `arms` are the vectors (3, 1) to the reference point, by step.
    """
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
    """Express Jacobian columns of the joints on a path in the axes at its start.

    Args:
        branch: steps of the path.
        columns: index of the step and local column of each joint.
        matrices: number of rotations that are multiplied to one matrix first; the others rotate
            each column.
    """
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
    """Return a Jacobian column (index, linear, angular) rotated by a matrix R (3, 3)."""
    k, V, w = column
    return k, casadi.mtimes(R, V), casadi.mtimes(R, w)


def _rotate_by(rotation: Rotation, column: Column) -> Column:
    """Return a Jacobian column (index, linear, angular) rotated by a rotation."""
    k, V, w = column
    V, w = along(rotation, [V, w])
    return k, V, w


# Positions of the zero and constant entries of a Jacobian in each frame, found numerically.
#
# An entry that is zero at several random configurations with random lengths is assumed to be zero
# everywhere. The structure is thus known without symbolic computation.


Array = NDArray[np.float64]

_SAMPLES = 3
_ZERO = 1e-10
"""Zero threshold of scaled lengths and of components of unit vectors; far above rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class JacobianSamples:
    """Jacobian of a moving frame, and the frames on the path to it, at random configurations.

    Lengths are divided by the largest length, so that the zero threshold does not depend on the
    size of the mechanism.

    Attributes:
        frames: base, links on the path, and the required axes last.
        R: (frames, samples, 3, 3) orientations of these frames in the base.
        p: (frames, samples, 3) scaled origins of these frames in the base.
        target_p: (samples, 3) scaled origin of the moving frame in the base.
        J: (samples, 6, nv) scaled Jacobian in the base, for velocities divided by `units`.
        units: (nv,) units of the velocities. For joints of a tree: the largest length [m] if the
            velocity only translates, else 1.
    """

    frames: tuple[Frame, ...]
    R: Array
    p: Array
    target_p: Array
    J: Array
    units: Array

    def combine(self, G: Array) -> JacobianSamples:
        """Return the same data for m other velocities u, with v = G u.

        Args:
            G: (samples, nv, m) matrix at each configuration.
        """
        parts = G / self.units[:, None]
        sizes = np.abs(parts).max(axis=(0, 1))
        units = 1 / np.where(sizes > 0, sizes, 1.0)
        return replace(self, J=self.J @ parts * units, units=units)

    @property
    def on_path(self) -> range:
        """Indices in `frames` of the base and the links on the path, without the required axes."""
        return range(len(self.frames) - 1)

    def linear(self, axes: int, reference: int | None) -> Array:
        """Return the scaled velocities (samples, 3, nv) of a point of the moving frame.

        Args:
            axes: index in `frames` of the axes in which they are expressed.
            reference: index in `frames` of the frame whose origin is the point; None for the origin
                of the moving frame.
        """
        place = self.target_p if reference is None else self.p[reference]
        V = self.J[:, :3] + np.cross(self.J[:, 3:], (place - self.target_p)[..., None], axis=1)
        return np.asarray(np.swapaxes(self.R[axes], 1, 2) @ V)

    def angular(self, axes: int) -> Array:
        """Return the angular velocities (samples, 3, nv) in the axes of frames[axes]."""
        return np.asarray(np.swapaxes(self.R[axes], 1, 2) @ self.J[:, 3:])

    def orientation(self, axes: int) -> Array:
        """Return the orientation (samples, 3, 3) of frames[axes] relative to the required axes."""
        return np.asarray(np.swapaxes(self.R[-1], 1, 2) @ self.R[axes])

    def separate_origins(self) -> list[int]:
        """Return the indices of frames on the path with distinct origins; of equal ones the last.

        Frames with the origin of the moving frame are left out.
        """
        seen, kept = [self.target_p], []
        for number in reversed(self.on_path):
            if all(np.abs(self.p[number] - other).max() > _ZERO for other in seen):
                kept.append(number)
                seen.append(self.p[number])
        return kept[::-1]

    def arm(self, reference: int | None) -> Array:
        """Return the scaled vectors (samples, 3) from frames[reference] to the moving frame.

        They are in the required axes. They are zero if `reference` is None.
        """
        if reference is None:
            return np.zeros_like(self.target_p)
        arm = self.target_p - self.p[reference]
        return np.asarray(np.einsum("sji,sj->si", self.R[-1], arm))


def survey(target: VelocityTarget) -> JacobianSamples:
    """Evaluate the Jacobian of a target, and the frames on its path, at random configurations."""
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
    return JacobianSamples(
        tuple(frames[:-1]), T[:-1, :, :3, :3], p[:-1], p[-1], J_values * units, units
    )


def random_samples(tree: Tree, parameters: int) -> list[tuple[Array, Array]]:
    """Return three pairs (q, p) of random positions (nq,) and the same random parameters.

    Args:
        tree: the links.
        parameters: number of parameters.
    """
    rng = np.random.default_rng(4)
    # positive values near 1 (SI units), as lengths and masses; values near zero are not generic
    p = rng.uniform(0.3, 1.7, parameters)
    return [(_random_position(tree, rng), p) for _ in range(_SAMPLES)]


def _random_position(tree: Tree, rng: np.random.Generator) -> Array:
    """Return random positions (nq,) from 0.3 to 2.8 rad or m, with unit quaternions."""
    # [rad or m], between zero and pi, because angles of zero and pi are not generic
    q = rng.uniform(0.3, 2.8, tree.nq)
    for link in tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            part = slice(link.q.stop - 4, link.q.stop)
            q[part] /= np.linalg.norm(q[part])
    return q


def nonzero(values: Array) -> NDArray[np.bool_]:
    """Return a mask (...) of the entries that are non-zero in some sample.

    `values` is (samples, ...), with scaled lengths.
    """
    return np.asarray(
        (np.abs(values) > _ZERO * max(1.0, float(np.abs(values).max(initial=0)))).any(0)
    )


def varying(values: Array) -> NDArray[np.bool_]:
    """Return a mask (...) of the entries that differ between samples.

    `values` is (samples, ...).
    """
    return nonzero(values - values[0])


# Renaud's factors of a Jacobian, with an intermediate frame that makes the last factor simple.
#
# J = [R 0; 0 R] [I -L^; 0 I] J_i. J_i gives the velocity of a reference point in the axes of an
# intermediate frame i. The second factor shifts this velocity to the origin of the moving frame,
# the first factor rotates the result to the target axes.
#
# Source: Renaud 1980; Khalil & Creusot 1997, eq. 4.


_HOME = Pose.identity()
_COUNTED = 6
"""Number of best-ranked candidates whose operations are counted. In a long chain it is 1."""
_MOST_TURNS = 24
"""Rotations per branch above which orientation matrices are formed for all rotations."""
_MOST_PLACES = 16
"""Maximum number of frames of a chain that are tried as axes or reference."""


@dataclass(frozen=True, slots=True, eq=False)
class JacobianFactors:
    """The three factors of a Jacobian.

    Attributes:
        intermediate: link in whose axes J is expressed, -1 for the base.
        reference: link whose origin is the reference point of J; None for the origin of the
            moving frame.
        R: (3, 3) orientation of the intermediate frame in the target axes.
        L: (3, 1) vector from the reference to the moving frame, in the intermediate axes [m].
        J: (6, nv) Jacobian of the reference point in the intermediate axes.
    """

    intermediate: int
    reference: int | None
    R: SX
    L: SX
    J: SX

    @property
    def rotation(self) -> SX:
        """First factor (6, 6): rotation of V and w from the intermediate to the target axes."""
        Z = SX.zeros(3, 3)
        return casadi.vertcat(casadi.horzcat(self.R, Z), casadi.horzcat(Z, self.R))

    @property
    def displacement(self) -> SX:
        """Second factor (6, 6): shift of the velocity from the reference to the moving frame."""
        eye = casadi.densify(SX(DM.eye(3)))
        return casadi.vertcat(
            casadi.horzcat(eye, -skew(self.L)), casadi.horzcat(SX.zeros(3, 3), eye)
        )


def cheapest_jacobian(target: VelocityTarget, reference: int | None = None) -> SX:
    """Return the Jacobian (6, nv) of a target, in the cheapest of several equal forms.

    Args:
        target: moving frame, and the axes of the Jacobian.
        reference: link whose origin is the reference point of the linear velocity; None for the
            origin of the moving frame.
    """
    seen = outlook(target)
    most = seen.rotations
    numbers = [most] if most > _MOST_TURNS else sorted({*range(0, most, 2), most})
    candidates = (jacobian(seen, reference, number) for number in numbers)
    return min(candidates, key=lambda J: cost(J, target.q, target.p))


def renaud(
    target: VelocityTarget, intermediate: int | None = None, reference: int | None = None
) -> JacobianFactors:
    """Return Renaud's three factors of the Jacobian of a target.

    If the intermediate frame or the reference is not given, the choice needs the fewest operations.

    Args:
        target: moving frame, and the target axes.
        intermediate: link on the path to the frame, -1 for the base, or None to select a link.
        reference: link on the path whose origin is the reference point of J, or None to select a
            link.
    """
    found = survey(target)
    ranked = _ranked_choices(found, intermediate, reference)
    counted = _COUNTED if len(found.frames) <= _MOST_PLACES else 1
    candidates = [
        (i, r, cheapest_jacobian(target.along((i, _HOME)), r)) for i, r in ranked[:counted]
    ]
    i, r, J = min(candidates, key=lambda found: cost(found[2], target.q, target.p))
    R = relative_pose(target.tree, target.q, target.axes, (i, _HOME)).R
    return JacobianFactors(i, r, R, arm_from(target.along((i, _HOME)), r), J)


def arm_from(target: VelocityTarget, reference: int | None) -> SX:
    """Return the vector (3, 1) [m] from the origin of link `reference` to the moving frame.

    It is expressed in the axes of the target. None as reference returns zeros.
    """
    if reference is None:
        return zeros()
    place = reference, _HOME
    p = relative_pose(target.tree, target.q, place, target.frame).p
    return express(target.tree, target.q, target.axes, place, [p])[0]


def _ranked_choices(
    found: JacobianSamples, intermediate: int | None, reference: int | None
) -> list[tuple[int, int | None]]:
    """Return pairs (axes, reference) of links for the Jacobian, in the order of its expected cost.

    The cost is the number of varying, then of nonzero entries in the samples `found`. `reference`
    None is the origin of the moving frame. A given `intermediate` fixes the axes, a given
    `reference` the reference link.
    """
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
    """Return at most 16 evenly spaced elements of a sequence.

    Args:
        places: sequence; it is returned as a list if it has at most 16 elements.
    """
    picks = np.linspace(0, len(places) - 1, min(len(places), _MOST_PLACES)).round().astype(int)
    return [places[k] for k in picks]
