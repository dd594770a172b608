"""The path from one frame of a tree to another one, its price, and how frames move along it.

Rotations about parallel axes that follow each other are joined into one by the sum of their
angles; what lies between them is seen from before the first. The steps of a link are written here
once more than in `link_poses`, because a sum needs the angles, not their sines and cosines.

Source: Khalil & Kleinfinger 1986 for the frames; Renaud 1980 for sums of angles.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly.tree import Frame, Link, Tree
from mbs.components.custom import RelativeMotion
from mbs.components.joints import Motion
from mbs.operations import count
from mbs.recursions.velocities import Acceleration, Velocity
from mbs.spatial import (
    AxisRotation,
    Khalil,
    MatrixRotation,
    Pose,
    Rotation,
    axis_rotation,
    cross,
    is_zero,
    quaternion_rotation,
    vector,
    zeros,
)

# The price of a result, by which one of several forms of it is chosen.


def cost(value: SX, q: SX, p: SX) -> int:
    """The price of a matrix; see `mbs.operations.counts.Count.price`.

    Args:
        value: of the symbols q and p.
        q: (nq, 1) positions.
        p: (np, 1) parameters; operations on them alone are free.
    """
    names = ["q", "p"], ["value"]
    f = Function("f", [q, p], [casadi.densify(value)], *names, {"cse": True})
    return count(f).price


@dataclass(frozen=True, slots=True, eq=False)
class RotationAboutZ:
    """A rotation about z by an angle [rad], backwards on the path from its end to its beginning."""

    angle: SX
    backwards: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class OtherRotation:
    """Any other rotation."""

    rotation: Rotation


@dataclass(frozen=True, slots=True, eq=False)
class PathTranslation:
    """A displacement p, (3, 1), in the axes where it stands [m]."""

    p: SX


@dataclass(frozen=True, slots=True)
class JointAt:
    """Where joint k acts: on its axis z, or where the directions of its three axes are constant."""

    link: int


@dataclass(frozen=True, slots=True)
class OriginOf:
    """The origin of frame k, -1 for the base."""

    link: int


PathStep = RotationAboutZ | OtherRotation | PathTranslation | JointAt | OriginOf


def path_to(tree: Tree, q: SX, frame: tuple[int, Pose]) -> list[PathStep]:
    """The steps from the base to a frame at the positions q.

    Args:
        tree: the links.
        q: (nq, 1) positions.
        frame: link (-1 for the base) and pose of the frame in it.
    """
    j, inside = frame
    steps: list[PathStep] = [OriginOf(-1)]
    for k in tree.path(j):
        link = tree.links[k]
        steps += _link_steps(k, link, q[link.q])
    if not is_zero(inside.p):
        steps.append(PathTranslation(inside.p))
    if not inside.is_identity():
        steps.append(OtherRotation(MatrixRotation(inside.R)))
    return steps


def _link_steps(k: int, link: Link, q: SX) -> list[PathStep]:
    place, motion = link.placement, link.motion
    height = place.r + q if motion is Motion.PRISMATIC else place.r
    steps = [step for frame in link.via for step in _fixed_steps(frame)] + _seat_steps(place)
    if motion in (Motion.REVOLUTE, Motion.PRISMATIC):
        steps.append(JointAt(k))
    if motion is Motion.REVOLUTE:
        steps.append(RotationAboutZ(q))
    steps += [RotationAboutZ(place.theta), PathTranslation(vector([0, 0, height]))]
    if motion in (Motion.SPHERICAL, Motion.FREE):
        free: list[PathStep] = [
            PathTranslation(q[0:3] if motion is Motion.FREE else zeros()),
            OtherRotation(MatrixRotation(quaternion_rotation(q[motion.nq - 4 :]))),
            JointAt(k),
        ]
        steps += reverse_path(free) if link.backward else free
    return [*(step for step in steps if not _is_idle(step)), OriginOf(k)]


def _seat_steps(frame: Khalil) -> list[PathStep]:
    """From one frame to the axis of the next."""
    return [
        RotationAboutZ(frame.gamma),
        PathTranslation(vector([0, 0, frame.b])),
        OtherRotation(axis_rotation("x", frame.alpha)),
        PathTranslation(vector([frame.d, 0, 0])),
    ]


def _fixed_steps(frame: Khalil) -> list[PathStep]:
    """From one frame to the next, which does not move."""
    return [
        *_seat_steps(frame),
        RotationAboutZ(frame.theta),
        PathTranslation(vector([0, 0, frame.r])),
    ]


def _is_idle(step: PathStep) -> bool:
    match step:
        case RotationAboutZ(angle=angle):
            return bool(angle.is_zero())
        case OtherRotation(rotation=AxisRotation(s=s, c=c)):
            return bool(s.is_zero() and c.is_one())
        case PathTranslation(p=p):
            return is_zero(p)
    return False


def reverse_path(steps: Iterable[PathStep]) -> list[PathStep]:
    """The same path from its end to its beginning."""
    return [_inverse(step) for step in reversed(list(steps))]


def _inverse(step: PathStep) -> PathStep:
    match step:
        case RotationAboutZ(angle=angle, backwards=backwards):
            return RotationAboutZ(angle, not backwards)
        case OtherRotation(rotation=rotation):
            return OtherRotation(inverse_rotation(rotation))
        case PathTranslation(p=p):
            return PathTranslation(-p)
    return step


def inverse_rotation(rotation: Rotation) -> Rotation:
    """The inverse rotation."""
    if isinstance(rotation, AxisRotation):
        return AxisRotation(rotation.axis, -rotation.s, rotation.c)
    return MatrixRotation(rotation.matrix.T)


def join_rotations(steps: Sequence[PathStep], tree: Tree) -> list[PathStep]:
    """The path with successive rotations about one z axis made one, after what lies between them.

    Args:
        steps: a path outwards from some frame.
        tree: its links; joints with three axes need their own axes.

    Returns:
        the steps, without a `RotationAboutZ` in them.
    """
    result: list[PathStep] = []
    rotations: list[RotationAboutZ] = []
    for step in steps:
        match step:
            case RotationAboutZ():
                rotations.append(step)
            case PathTranslation(p=p):
                result.append(PathTranslation(_total(rotations).apply(p)))
            case JointAt(link=k) if _along_z(tree.links[k]):
                result.append(step)
            case OriginOf():
                result.append(step)
            case _:
                result += [*_one_rotation(rotations), step]
                rotations = []
    return result + _one_rotation(rotations)


def _along_z(link: Link) -> bool:
    return link.motion in (Motion.REVOLUTE, Motion.PRISMATIC)


def _one_rotation(rotations: list[RotationAboutZ]) -> list[PathStep]:
    return [OtherRotation(_total(rotations))] if rotations else []


def _total(rotations: list[RotationAboutZ]) -> AxisRotation:
    """One rotation of several, their angles added in the order of the tree in either direction."""
    forward, backward = (
        [rotation.angle for rotation in rotations if rotation.backwards is backwards]
        for backwards in (False, True)
    )
    angle = _sum(forward)
    if not backward:
        return axis_rotation("z", angle)
    turn = axis_rotation("z", _sum(backward[::-1]) - angle)
    return AxisRotation("z", -turn.s, turn.c)


def _sum(angles: list[SX]) -> SX:
    total = SX(0)
    for angle in angles:
        total = total + angle
    return total


def path_between(
    tree: Tree, q: SX, a: tuple[int, Pose], b: tuple[int, Pose]
) -> tuple[list[PathStep], list[PathStep]]:
    """The path from frame a to frame b: back to their common link, then out to b."""
    to_a, to_b = path_to(tree, q, a), path_to(tree, q, b)
    fork = OriginOf(common_link(tree, a[0], b[0]))
    return reverse_path(to_a[to_a.index(fork) + 1 :]), to_b[to_b.index(fork) + 1 :]


def relative_pose(
    tree: Tree, q: SX, a: tuple[int, Pose], b: tuple[int, Pose], *, outwards: bool = False
) -> Pose:
    """Frame b seen from frame a, rotations about parallel axes joined.

    Args:
        tree: the links.
        q: (nq, 1) positions.
        a: link (-1 for the base) and pose of the frame in it.
        b: likewise.
        outwards: begin at frame a instead of frame b; the pose is the same, its operations are
            others.
    """
    back, out = path_between(tree, q, a, b)
    steps = join_rotations([*back, *out], tree)
    pose = Pose.identity()
    for step in steps if outwards else reversed(steps):
        match step, outwards:
            case PathTranslation(p=p), True:
                pose = Pose(pose.R, pose.p + casadi.mtimes(pose.R, p))
            case PathTranslation(p=p), False:
                pose = Pose(pose.R, pose.p + p)
            case OtherRotation(rotation=rotation), True:
                rows = (rotation.apply_inverse(pose.R[k, :].T).T for k in range(3))
                pose = Pose(casadi.vertcat(*rows), pose.p)
            case OtherRotation(rotation=rotation), False:
                R = casadi.mtimes(rotation.matrix, pose.R)
                pose = Pose(R, along(rotation, [pose.p])[0])
    return pose


def cheapest_pose(tree: Tree, q: SX, p: SX, a: tuple[int, Pose], b: tuple[int, Pose]) -> Pose:
    """The relative pose from whichever end it takes fewer operations; p are the parameters."""
    both = [relative_pose(tree, q, a, b, outwards=outwards) for outwards in (False, True)]
    return min(both, key=lambda pose: cost(pose.matrix, q, p))


def express(
    tree: Tree, q: SX, axes: tuple[int, Pose], frame: tuple[int, Pose], vectors: Iterable[SX]
) -> list[SX]:
    """Vectors of a frame in the axes of another one, rotation by rotation."""
    back, out = path_between(tree, q, axes, frame)
    turned = list(vectors)
    for step in reversed(join_rotations([*back, *out], tree)):
        if isinstance(step, OtherRotation):
            turned = along(step.rotation, turned)
    return turned


def common_link(tree: Tree, a: int, b: int) -> int:
    """The last link that is on the path to both links; -1 is the base."""
    shared = [k for k, m in zip(tree.path(a), tree.path(b), strict=False) if k == m]
    return shared[-1] if shared else -1


def along(rotation: Rotation, vectors: Iterable[SX]) -> list[SX]:
    """Each vector of the rotated frame in the fixed one; zeros stay zeros."""
    return [v if is_zero(v) else casadi.densify(rotation.apply(v)) for v in vectors]


# How frames fixed on links move, by themselves and seen from each other.
#
# Source: Khalil & Dombre 2002 for composition of velocities and accelerations.


BASE: Frame = (-1, Pose.identity())
"""The frame of the base."""


@dataclass(frozen=True, slots=True, eq=False)
class RelativeAcceleration:
    """Accelerations of a frame b for an observer who moves with a frame a, in the axes of a.

    Attributes:
        A: (3, 1) of the origin of b [m/s^2].
        wd: (3, 1) angular [rad/s^2].
    """

    A: SX
    wd: SX


def relative_motion(
    tree: Tree, a: Frame, b: Frame, q: SX, moving: list[Velocity] | None
) -> RelativeMotion:
    """How frame b moves, seen from frame a and in its axes.

    Args:
        tree: the links.
        a: the frame of the observer.
        b: the frame that moves.
        q: (nq, 1) positions.
        moving: velocities of the links, each in its frame; at rest when None.
    """
    T = relative_pose(tree, q, a, b)
    if moving is None:
        return RelativeMotion(T.p, T.R, zeros(), zeros())
    V_a, w_a = frame_velocity(a, moving)
    V_b, w_b = frame_velocity(b, moving)
    V = casadi.mtimes(T.R, V_b) - V_a - cross(w_a, T.p)
    return RelativeMotion(T.p, T.R, V, casadi.mtimes(T.R, w_b) - w_a)


def frame_velocity(frame: Frame, moving: list[Velocity]) -> tuple[SX, SX]:
    """Linear and angular velocity of a frame, in its axes."""
    link, pose = frame
    if link < 0:
        return zeros(), zeros()
    V, w = moving[link].V, moving[link].w
    return casadi.mtimes(pose.R.T, V + cross(w, pose.p)), casadi.mtimes(pose.R.T, w)


def relative_acceleration(
    motion: RelativeMotion, a: Frame, b: Frame, motions: list[Acceleration]
) -> RelativeAcceleration:
    """Accelerations of frame b, seen from frame a and in its axes.

    Args:
        motion: of b seen from a.
        a: the frame of the observer.
        b: the frame that moves.
        motions: of the links, each in its frame; gravity takes no part where the base rests.
    """
    A_a, w_a, wd_a = _acceleration(a, motions)
    A_b, _, wd_b = _acceleration(b, motions)
    p, R = motion.p, motion.R
    carried = A_a + cross(wd_a, p) + cross(w_a, cross(w_a, p)) + 2 * cross(w_a, motion.V)
    return RelativeAcceleration(
        casadi.mtimes(R, A_b) - carried,
        casadi.mtimes(R, wd_b) - wd_a - cross(w_a, motion.w),
    )


def _acceleration(frame: Frame, motions: list[Acceleration]) -> tuple[SX, SX, SX]:
    """Acceleration of the origin, angular velocity and acceleration of a frame, in its axes."""
    link, pose = frame
    if link < 0:
        return zeros(), zeros(), zeros()
    motion = motions[link]
    at = motion.vd + casadi.mtimes(motion.rate.U, pose.p)
    turned = (casadi.mtimes(pose.R.T, vector) for vector in (at, motion.w, motion.wd))
    A, w, wd = turned
    return A, w, wd
