"""The geometry of a loop, read from its gaps at random positions and parameters.

What holds at every one of them holds by structure: lengths and angles given as numbers, or by the
same symbol, not by accident of one posture.
"""

from __future__ import annotations

from collections.abc import Iterable

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.components.motion import Motion
from mbs.loops.closed_form.ring import Gap, Ring
from mbs.spatial import Pose

Matrix = NDArray[np.float64]

_SAMPLES = 3
_SEED = 20260103
_CLOSE = 1e-9
_Z = np.array([0.0, 0.0, 1.0])


def gap_samples(ring: Ring, q: SX, p: SX) -> list[list[Matrix]]:
    """At some random positions and parameters the (4, 4) pose of every gap."""
    return [[np.array(DM(T)) for T in values] for values in _evaluated(_matrices(ring.gaps), q, p)]


def _matrices(gaps: Iterable[Gap]) -> list[SX]:
    return [gap.pose.matrix for gap in gaps]


def _evaluated(values: list[SX], q: SX, p: SX) -> list[list[DM]]:
    rng = np.random.default_rng(_SEED)
    function = Function("samples", [q, p], values)
    return [
        function.call([DM(rng.uniform(-1.5, 1.5, q.numel())), DM(rng.uniform(0.4, 1.6, p.numel()))])
        for _ in range(_SAMPLES)
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
