"""How frames fixed on links move, by themselves and seen from each other.

Source: Khalil & Dombre 2002 for composition of velocities and accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Frame, Tree
from mbs.components.forces import RelativeMotion
from mbs.recursions.accelerations import Acceleration
from mbs.recursions.route import relative_pose
from mbs.recursions.velocities import Velocity
from mbs.spatial import Pose, cross, zeros

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
    tree: Tree, a: Frame, b: Frame, q: SX, moving: list[Velocity]
) -> RelativeMotion:
    """How frame b moves, seen from frame a and in its axes.

    Args:
        tree: the links.
        a: the frame of the observer.
        b: the frame that moves.
        q: (nq, 1) positions.
        moving: velocities of the links, each in its frame.
    """
    T = relative_pose(tree, q, a, b)
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
