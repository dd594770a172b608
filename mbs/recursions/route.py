"""Path between two frames of a tree, relative pose and motion of frames, and operation counts.

Successive rotations about parallel axes are joined into one rotation by the sum of their angles.
The displacements of a link are defined here in addition to `link_poses`, because sums need the
angles, not their sines and cosines.

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
from mbs.recursions.link_motions import Acceleration, Velocity
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

# Operation count of an expression, to select one of several equivalent forms.


def cost(value: SX, q: SX, p: SX) -> int:
    """Return the weighted operation count of a matrix; see `mbs.operations.counts.Count.price`.

    Args:
        value: expression of the symbols q and p.
        q: (nq, 1) positions.
        p: (np, 1) parameters; operations on them alone are free.
    """
    names = ["q", "p"], ["value"]
    f = Function("f", [q, p], [casadi.densify(value)], *names, {"cse": True})
    return count(f).price


@dataclass(frozen=True, slots=True, eq=False)
class RotationAboutZ:
    """Rotation about z by an angle [rad].

    Attributes:
        angle: angle [rad].
        backwards: whether the path passes the rotation in reverse.
    """

    angle: SX
    backwards: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class OtherRotation:
    """Rotation on a path about another axis than z, or by a matrix."""

    rotation: Rotation


@dataclass(frozen=True, slots=True, eq=False)
class PathTranslation:
    """Translation p (3, 1) [m] in the current axes of the path."""

    p: SX


@dataclass(frozen=True, slots=True)
class JointAt:
    """Marker of a joint on a path: a point on its axis, or axes in which its motion is constant.

    The second case is for joints with several velocities.

    Attributes:
        link: index of the link of the joint.
    """

    link: int


@dataclass(frozen=True, slots=True)
class OriginOf:
    """Marker of the origin of a link frame on a path.

    Attributes:
        link: index of the link, -1 for the base.
    """

    link: int


PathStep = RotationAboutZ | OtherRotation | PathTranslation | JointAt | OriginOf


def path_to(tree: Tree, q: SX, frame: tuple[int, Pose]) -> list[PathStep]:
    """Return the steps from the base to a frame at positions q.

    Args:
        tree: links of the tree.
        q: (nq, 1) positions.
        frame: index of the link (-1 for the base) and pose of the frame in the link.
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
    """Return the steps from the antecedent of link k to its frame, at joint position q."""
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
    """Return the steps from a frame to the axis of the next joint: gamma, b, alpha and d."""
    return [
        RotationAboutZ(frame.gamma),
        PathTranslation(vector([0, 0, frame.b])),
        OtherRotation(axis_rotation("x", frame.alpha)),
        PathTranslation(vector([frame.d, 0, 0])),
    ]


def _fixed_steps(frame: Khalil) -> list[PathStep]:
    """Return the steps of all six Khalil parameters from a frame to the next frame of a link."""
    return [
        *_seat_steps(frame),
        RotationAboutZ(frame.theta),
        PathTranslation(vector([0, 0, frame.r])),
    ]


def _is_idle(step: PathStep) -> bool:
    """Return whether a step is the constant identity; False for markers."""
    match step:
        case RotationAboutZ(angle=angle):
            return bool(angle.is_zero())
        case OtherRotation(rotation=AxisRotation(s=s, c=c)):
            return bool(s.is_zero() and c.is_one())
        case PathTranslation(p=p):
            return is_zero(p)
    return False


def reverse_path(steps: Iterable[PathStep]) -> list[PathStep]:
    """Return the same path from its end to its beginning.

    Args:
        steps: steps of a path.
    """
    return [_inverse(step) for step in reversed(list(steps))]


def _inverse(step: PathStep) -> PathStep:
    """Return the step of the path in the opposite direction; markers are unchanged."""
    match step:
        case RotationAboutZ(angle=angle, backwards=backwards):
            return RotationAboutZ(angle, not backwards)
        case OtherRotation(rotation=rotation):
            return OtherRotation(inverse_rotation(rotation))
        case PathTranslation(p=p):
            return PathTranslation(-p)
    return step


def inverse_rotation(rotation: Rotation) -> Rotation:
    """Return the inverse of a rotation."""
    if isinstance(rotation, AxisRotation):
        return AxisRotation(rotation.axis, -rotation.s, rotation.c)
    return MatrixRotation(rotation.matrix.T)


def join_rotations(steps: Sequence[PathStep], tree: Tree) -> list[PathStep]:
    """Join successive rotations about parallel z axes into one rotation.

    The joined rotation follows the translations between them, which are rotated accordingly.

    Args:
        steps: path from a frame to another frame.
        tree: links of the tree; joints with several velocities need their own axes.

    Returns:
        steps without `RotationAboutZ`.
    """
    result: list[PathStep] = []
    rotations: list[RotationAboutZ] = []
    for step in steps:
        match step:
            case RotationAboutZ():
                rotations.append(step)
            case PathTranslation(p=p):
                result.append(PathTranslation(_product_of_rotations(rotations).apply(p)))
            case JointAt(link=k) if tree.links[k].motion in (Motion.REVOLUTE, Motion.PRISMATIC):
                result.append(step)
            case OriginOf():
                result.append(step)
            case _:
                result += [*_one_rotation(rotations), step]
                rotations = []
    return result + _one_rotation(rotations)


def _one_rotation(rotations: list[RotationAboutZ]) -> list[PathStep]:
    """Return successive rotations about z as a list of one step; empty if there are none."""
    return [OtherRotation(_product_of_rotations(rotations))] if rotations else []


def _product_of_rotations(rotations: list[RotationAboutZ]) -> AxisRotation:
    """Return the product of rotations about parallel z axes, by the sum of their angles.

    Angles are added in the order of the tree.
    """
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
    """Return the sum of expressions, added from first to last; 0 without expressions."""
    total = SX(0)
    for angle in angles:
        total = total + angle
    return total


def path_between(
    tree: Tree, q: SX, a: tuple[int, Pose], b: tuple[int, Pose]
) -> tuple[list[PathStep], list[PathStep]]:
    """Return the path from frame a to frame b in two parts, which meet at the last common link.

    Args:
        tree: links of the tree.
        q: (nq, 1) positions.
        a: index of the link (-1 for the base) and pose of frame a in the link.
        b: index of the link (-1 for the base) and pose of frame b in the link.

    Returns:
        steps from a to the frame of the last common link, and steps from there to b.
    """
    to_a, to_b = path_to(tree, q, a), path_to(tree, q, b)
    fork = OriginOf(common_link(tree, a[0], b[0]))
    return reverse_path(to_a[to_a.index(fork) + 1 :]), to_b[to_b.index(fork) + 1 :]


def relative_pose(
    tree: Tree, q: SX, a: tuple[int, Pose], b: tuple[int, Pose], *, outwards: bool = False
) -> Pose:
    """Return the pose of frame b relative to frame a, with joined rotations about parallel axes.

    Args:
        tree: links of the tree.
        q: (nq, 1) positions.
        a: index of the link (-1 for the base) and pose of frame a in the link.
        b: index of the link (-1 for the base) and pose of frame b in the link.
        outwards: whether to multiply from frame a to frame b. By default the product starts at b.
            The pose is equal, but the operations differ.
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
    """Return the pose of frame b relative to frame a, in the cheaper of two multiplication orders.

    Args:
        tree: links of the tree.
        q: (nq, 1) positions.
        p: (np, 1) parameters; operations on them alone are free.
        a: index of the link (-1 for the base) and pose of frame a in the link.
        b: index of the link (-1 for the base) and pose of frame b in the link.
    """
    both = [relative_pose(tree, q, a, b, outwards=outwards) for outwards in (False, True)]
    return min(both, key=lambda pose: cost(pose.matrix, q, p))


def express(
    tree: Tree, q: SX, axes: tuple[int, Pose], frame: tuple[int, Pose], vectors: Iterable[SX]
) -> list[SX]:
    """Express vectors of one frame in the axes of another frame.

    Args:
        tree: links of the tree.
        q: (nq, 1) positions.
        axes: frame of the new axes: index of the link (-1 for the base) and pose in the link.
        frame: frame of the present axes, in the same form.
        vectors: vectors (3, 1) in axes of `frame`.
    """
    back, out = path_between(tree, q, axes, frame)
    turned = list(vectors)
    for step in reversed(join_rotations([*back, *out], tree)):
        if isinstance(step, OtherRotation):
            turned = along(step.rotation, turned)
    return turned


def common_link(tree: Tree, a: int, b: int) -> int:
    """Return the last link on the paths to both links a and b, -1 for the base.

    Args:
        tree: the links.
        a: index of a link, -1 for the base.
        b: index of a link, -1 for the base.
    """
    shared = [k for k, m in zip(tree.path(a), tree.path(b), strict=False) if k == m]
    return shared[-1] if shared else -1


def along(rotation: Rotation, vectors: Iterable[SX]) -> list[SX]:
    """Rotate vectors (3, 1) from the rotated frame to the fixed frame; zeros are not changed.

    Args:
        rotation: rotation from the rotated frame to the fixed frame.
        vectors: vectors in axes of the rotated frame.
    """
    return [v if is_zero(v) else casadi.densify(rotation.apply(v)) for v in vectors]


# Absolute and relative motion of frames that are fixed on links.
#
# Source: Khalil & Dombre 2002 for composition of velocities and accelerations.


BASE: Frame = (-1, Pose.identity())
"""The frame of the base."""


@dataclass(frozen=True, slots=True, eq=False)
class RelativeAcceleration:
    """Acceleration of a frame b relative to a moving frame a, in the axes of a.

    Attributes:
        A: (3, 1) acceleration of the origin of b [m/s^2].
        wd: (3, 1) angular acceleration of b [rad/s^2].
    """

    A: SX
    wd: SX


def relative_motion(
    tree: Tree, a: Frame, b: Frame, q: SX, moving: list[Velocity] | None
) -> RelativeMotion:
    """Return the pose and velocity of frame b relative to frame a, in the axes of a.

    Args:
        tree: links of the tree.
        a: reference frame.
        b: observed frame.
        q: (nq, 1) positions.
        moving: velocity of each link in its frame; None for zero velocities.
    """
    T = relative_pose(tree, q, a, b)
    if moving is None:
        return RelativeMotion(T.p, T.R, zeros(), zeros())
    V_a, w_a = frame_velocity(a, moving)
    V_b, w_b = frame_velocity(b, moving)
    V = casadi.mtimes(T.R, V_b) - V_a - cross(w_a, T.p)
    return RelativeMotion(T.p, T.R, V, casadi.mtimes(T.R, w_b) - w_a)


def frame_velocity(frame: Frame, moving: list[Velocity]) -> tuple[SX, SX]:
    """Return the linear [m/s] and angular velocity [rad/s] of a frame (3, 1), in its own axes.

    Args:
        frame: index of the link (-1 for the base) and pose of the frame in the link.
        moving: velocity of each link, in its frame.
    """
    link, pose = frame
    if link < 0:
        return zeros(), zeros()
    V, w = moving[link].V, moving[link].w
    return casadi.mtimes(pose.R.T, V + cross(w, pose.p)), casadi.mtimes(pose.R.T, w)


def relative_acceleration(
    motion: RelativeMotion, a: Frame, b: Frame, motions: list[Acceleration]
) -> RelativeAcceleration:
    """Return the acceleration of frame b relative to frame a, in the axes of a.

    Args:
        motion: pose and velocity of b relative to a.
        a: reference frame.
        b: observed frame.
        motions: acceleration of each link in its frame, without gravity; see `resting_base`.
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
    """Return the origin acceleration, angular velocity and angular acceleration of a frame.

    They are (3, 1) each, in its own axes; zero for a frame on the base. `motions` are those of the
    links.
    """
    link, pose = frame
    if link < 0:
        return zeros(), zeros(), zeros()
    motion = motions[link]
    at = motion.vd + casadi.mtimes(motion.rate.U, pose.p)
    turned = (casadi.mtimes(pose.R.T, vector) for vector in (at, motion.w, motion.wd))
    A, w, wd = turned
    return A, w, wd
