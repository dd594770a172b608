"""Inverse dynamics by Newton and Euler, linear in the inertial parameters.

Source: Khalil & Kleinfinger 1987; Khalil & Creusot 1997, eq. 15-20.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.motion import Motion
from mbs.recursions.accelerations import Acceleration, link_accelerations
from mbs.recursions.motion import effort
from mbs.recursions.poses import LinkPose
from mbs.recursions.regrouping import regrouped
from mbs.recursions.rotation_rate import moment_of_rotation
from mbs.recursions.sliding import slid
from mbs.spatial import PseudoInertia, cross, is_zero, zeros

Wrench = tuple[SX, SX]
"""Force (3, 1) and moment (3, 1) about the origin of a frame, in that frame [N, N m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """Everything that the recursions of Newton and Euler compute.

    Attributes:
        motions: of the links, each in its frame.
        own: the wrench that moves each body, in its frame.
        wrenches: the wrench that each joint transmits, in the frame of its link.
        efforts: (nv, 1) its part along the motion [N m or N].
    """

    motions: list[Acceleration]
    own: list[Wrench]
    wrenches: list[Wrench]
    efforts: SX


def newton_euler(
    tree: Tree,
    poses: list[LinkPose],
    v: SX,
    a: SX,
    base: Acceleration,
    external: dict[int, Wrench] | None = None,
) -> Dynamics:
    """The wrenches that produce the joint accelerations a, without friction and rotors.

    Accelerations run from the base to the leaves, wrenches from the leaves to the base, with the
    inertial parameters regrouped.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base; see `resting_base`.
        external: for some links the wrench that they exert on their environment.
    """
    bodies = [PseudoInertia.of(link.inertia) for link in tree.links]
    if not external:
        poses, bodies = slid(tree, poses, bodies, base_rests=is_zero(base.w))
    bodies = regrouped(tree, poses, bodies)
    motions = link_accelerations(tree, poses, v, a, base)
    own = [inertial_wrench(body, motion) for body, motion in zip(bodies, motions, strict=True)]
    wrenches = list(own)
    for j, wrench in (external or {}).items():
        wrenches[j] = _sum(wrenches[j], wrench)
    for j in reversed(range(len(tree.links))):
        i = tree.links[j].antecedent
        if i >= 0:
            wrenches[i] = _sum(wrenches[i], poses[j].wrench(*wrenches[j]))
    efforts = (effort(link.motion, f, m) for link, (f, m) in zip(tree.links, wrenches, strict=True))
    return Dynamics(motions, own, wrenches, casadi.vertcat(*efforts))


def _sum(a: Wrench, b: Wrench) -> Wrench:
    return a[0] + b[0], a[1] + b[1]


def inertial_wrench(body: PseudoInertia, motion: Acceleration) -> Wrench:
    """The wrench that moves a body: F = m vd + U ms, M = its moment of U + ms x vd."""
    f = body.m * motion.vd + casadi.mtimes(motion.rate.U, body.ms)
    return f, moment_of_rotation(body.S, motion.rate) + cross(body.ms, motion.vd)


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
