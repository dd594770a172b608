"""Where the entries of a Jacobian are zero or constant, frame by frame, found on random postures.

An entry that is zero at several random postures with random lengths is zero always; so the
structure is known before a symbol is touched.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi
import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly.tree import Frame, Tree
from mbs.components.motion import Motion
from mbs.recursions.jacobian import VelocityTarget, jacobian, outlook
from mbs.recursions.poses import base_poses, link_poses
from mbs.spatial import Pose

Array = NDArray[np.float64]

_SAMPLES = 3
_ZERO = 1e-10
"""Of lengths in units of the survey, and of components of unit vectors."""


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """A frame's Jacobian and the frames on the way to it, at random postures.

    Lengths are parts of the largest one, so that a small mechanism has no more zeros than a large
    one.

    Attributes:
        frames: the base, the links on the way, and at last the axes that were asked for.
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

    def combined(self, G: Array) -> Survey:
        """The same of other velocities, of which G (samples, nv, m) makes these."""
        parts = G / self.units[:, None]
        sizes = np.abs(parts).max(axis=(0, 1))
        units = 1 / np.where(sizes > 0, sizes, 1.0)
        return replace(self, J=self.J @ parts * units, units=units)

    @property
    def on_the_way(self) -> range:
        """Places of the base and of the links."""
        return range(len(self.frames) - 1)

    def linear(self, axes: int, reference: int | None) -> Array:
        """(samples, 3, nv) velocity of a reference in the axes of a frame, both as positions."""
        place = self.target_p if reference is None else self.p[reference]
        V = self.J[:, :3] + np.cross(self.J[:, 3:], (place - self.target_p)[..., None], axis=1)
        return np.asarray(np.swapaxes(self.R[axes], 1, 2) @ V)

    def angular(self, axes: int) -> Array:
        """(samples, 3, nv) angular velocity in the axes of a frame."""
        return np.asarray(np.swapaxes(self.R[axes], 1, 2) @ self.J[:, 3:])

    def turned(self, axes: int) -> Array:
        """(samples, 3, 3) orientation of a frame in the axes that were asked for."""
        return np.asarray(np.swapaxes(self.R[-1], 1, 2) @ self.R[axes])

    def separate_origins(self) -> list[int]:
        """Places of links whose origins are not always where a later one's or the frame's is."""
        seen, kept = [self.target_p], []
        for number in reversed(self.on_the_way):
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
    """The Jacobian of a frame at random postures and parameters."""
    tree, q, frame, axes = target.tree, target.q, target.frame, target.axes
    path = tree.path(frame[0])
    poses = base_poses(tree, link_poses(tree, q))
    home = Pose.identity()
    frames = [(k, home) for k in (-1, *path)] + [axes, frame]
    placed = [(poses[k] if k >= 0 else home) @ inside for k, inside in frames]
    base = outlook(target.along((-1, home)))
    J = jacobian(base, matrices=base.turns)
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
    p = rng.uniform(0.3, 1.7, parameters)
    return [(_random_position(tree, rng), p) for _ in range(_SAMPLES)]


def _random_position(tree: Tree, rng: np.random.Generator) -> Array:
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
    """Where a matrix, (samples, ...), changes from posture to posture."""
    return nonzero(values - values[0])
