"""Velocities and accelerations of the links, each in its own frame.

Source: Khalil & Creusot 1997, eq. 6 and 8-10.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.motion import relative_motion
from mbs.recursions.poses import LinkPose
from mbs.spatial import cross, is_zero, zeros


@dataclass(frozen=True, slots=True, eq=False)
class Velocity:
    """Velocity of a link.

    Attributes:
        V: (3, 1) of the origin of frame j, in frame j [m/s].
        w: (3, 1) angular, in frame j [rad/s].
    """

    V: SX
    w: SX


def link_velocities(tree: Tree, poses: list[LinkPose], v: SX) -> list[Velocity]:
    """Velocity of every link for the joint velocities v, (nv, 1)."""
    result: list[Velocity] = []
    for link, pose in zip(tree.links, poses, strict=True):
        i = link.antecedent
        before = result[i] if i >= 0 else Velocity(zeros(), zeros())
        linear, angular = relative_motion(link.motion, v[link.v])
        moved = before.V if is_zero(before.w) else before.V + cross(before.w, pose.p)
        result.append(
            Velocity(pose.apply_inverse(moved) + linear, pose.apply_inverse(before.w) + angular)
        )
    return result


@dataclass(frozen=True, slots=True, eq=False)
class Acceleration:
    """What the equations of a link need of its motion.

    Attributes:
        w: (3, 1) angular velocity in frame j [rad/s].
        wd: (3, 1) angular acceleration in frame j [rad/s^2].
        U: (3, 3) skew(wd) + skew(w) skew(w), in frame j.
        vd: (3, 1) acceleration of the origin of frame j, minus gravity, in frame j [m/s^2].
    """

    w: SX
    wd: SX
    U: SX
    vd: SX


def link_accelerations(
    tree: Tree, poses: list[LinkPose], v: SX, a: SX, gravity: SX
) -> list[Acceleration]:
    """Acceleration of every link; gravity enters as an upward acceleration of the base.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        gravity: (3, 1) in the base frame [m/s^2]; zero for true accelerations.
    """
    base = Acceleration(zeros(), zeros(), zeros(3, 3), -gravity)
    result: list[Acceleration] = []
    for link, pose in zip(tree.links, poses, strict=True):
        before = result[link.antecedent] if link.antecedent >= 0 else base
        linear, angular = relative_motion(link.motion, v[link.v])
        linear_rate, angular_rate = relative_motion(link.motion, a[link.v])
        w_i = pose.apply_inverse(before.w)
        w = w_i + angular
        wd = pose.apply_inverse(before.wd) + angular_rate + cross(w_i, angular)
        vd = (
            pose.apply_inverse(before.vd + casadi.mtimes(before.U, pose.p))
            + linear_rate
            + cross(2 * w_i + angular, linear)
        )
        result.append(Acceleration(w, wd, rotation_rate(w, wd), vd))
    return result


def rotation_rate(w: SX, wd: SX) -> SX:
    """U = skew(wd) + skew(w) skew(w), (3, 3), on six products of the velocities."""
    x, y, z = w[0], w[1], w[2]
    xx, yy, zz, xy, xz, yz = -x * x, -y * y, -z * z, x * y, x * z, y * z
    return casadi.vertcat(
        casadi.horzcat(yy + zz, xy - wd[2], xz + wd[1]),
        casadi.horzcat(xy + wd[2], xx + zz, yz - wd[0]),
        casadi.horzcat(xz - wd[1], yz + wd[0], xx + yy),
    )
