"""Inverse dynamics by Newton and Euler, linear in the inertial parameters.

Source: Khalil & Kleinfinger 1987; Khalil & Creusot 1997, eq. 15-20.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.motion import Motion
from mbs.recursions.motion import effort
from mbs.recursions.poses import LinkPose
from mbs.recursions.velocities import Acceleration, link_accelerations
from mbs.spatial import Inertia, cross, is_zero, zeros

Wrench = tuple[SX, SX]
"""Force (3, 1) and moment (3, 1) about the origin of a frame, in that frame [N, N m]."""


def newton_euler(
    tree: Tree,
    poses: list[LinkPose],
    v: SX,
    a: SX,
    gravity: SX,
    external: dict[int, Wrench] | None = None,
) -> SX:
    """Joint efforts that produce the joint accelerations a, without friction and rotors.

    Accelerations run from the base to the leaves, wrenches from the leaves to the base.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        gravity: (3, 1) gravity acceleration in the base frame [m/s^2].
        external: for some links the wrench that they exert on their environment.

    Returns:
        (nv, 1) efforts along the motions [N m or N].
    """
    motions = link_accelerations(tree, poses, v, a, gravity)
    wrenches = [
        inertial_wrench(link.inertia, motion)
        for link, motion in zip(tree.links, motions, strict=True)
    ]
    for j, (f_e, m_e) in (external or {}).items():
        f, m = wrenches[j]
        wrenches[j] = f + f_e, m + m_e
    efforts: list[SX] = [SX(0)] * len(tree.links)
    for j in reversed(range(len(tree.links))):
        link, (f, m) = tree.links[j], wrenches[j]
        efforts[j] = effort(link.motion, f, m)
        if link.antecedent >= 0:
            f_i, m_i = wrenches[link.antecedent]
            f, m = moved_wrench(poses[j], f, m)
            wrenches[link.antecedent] = f_i + f, m_i + m
    return casadi.vertcat(*efforts)


def moved_wrench(pose: LinkPose, f: SX, m: SX) -> Wrench:
    """A wrench of frame j about the origin of its antecedent i and in its axes."""
    f_i = pose.apply(f)
    m_i = pose.apply(m)
    return f_i, m_i if is_zero(pose.p) else m_i + cross(pose.p, f_i)


def inertial_wrench(inertia: Inertia, motion: Acceleration) -> Wrench:
    """The wrench that moves a body: F = m vd + U ms, M = J wd + w x J w + ms x vd."""
    f = inertia.m * motion.vd + casadi.mtimes(motion.U, inertia.ms)
    m = euler_moment(inertia.J, motion) + cross(inertia.ms, motion.vd)
    return f, m


def euler_moment(J: SX, motion: Acceleration) -> SX:
    """J wd + w x (J w), (3, 1), on the entries of U: fifteen multiplications instead of 24.

    The first row is XX wd1 - XY U31 + XZ U21 + YZ (w2^2 - w3^2) + (ZZ - YY) w2 w3.
    """
    w, wd, U = motion.w, motion.wd, motion.U
    rows = []
    for k in range(3):
        m, n = (k + 1) % 3, (k + 2) % 3
        row = J[k, k] * wd[k] - J[k, m] * U[n, k] + J[k, n] * U[m, k]
        rows.append(row + J[m, n] * (U[m, m] - U[n, n]) + (J[n, n] - J[m, m]) * (w[m] * w[n]))
    return casadi.vertcat(*rows)


def rotor_and_friction(tree: Tree, v: SX, a: SX) -> SX:
    """(nv, 1) Ia a + Fv v + Fs tanh(v / Fs_width) of every joint [N m or N].

    Source: Khalil & Creusot 1997, eq. 20, its sign(v) smoothed over a width so that integrators
    and optimisers can use the same model; a width of zero gives the sign.
    """
    return casadi.vertcat(*(_rotor_and_friction(link, v[link.v], a[link.v]) for link in tree.links))


def _rotor_and_friction(link: Link, v: SX, a: SX) -> SX:
    total = zeros(link.motion.nv)
    if link.motion is Motion.FREE:  # the velocity is in the turning frame
        a = a + casadi.vertcat(cross(v[3:6], v[0:3]), zeros())
    step = _smooth_sign(v, link.Fs_width)
    for coefficient, rate in ((link.Ia, a), (link.Fv, v), (link.Fs, step)):
        if not coefficient.is_zero():
            total = total + coefficient * rate
    return total


def _smooth_sign(v: SX, width: SX) -> SX:
    """tanh(v / width), and sign(v) for a width of zero."""
    if width.is_zero():
        return casadi.sign(v)
    if width.is_constant():
        return casadi.tanh(v / width)
    vanishes = width == 0
    return casadi.if_else(vanishes, casadi.sign(v), casadi.tanh(v / (width + vanishes)))
