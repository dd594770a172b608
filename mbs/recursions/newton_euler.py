"""Inverse dynamics by Newton and Euler, linear in the inertial parameters.

Source: Khalil & Kleinfinger 1987; Khalil & Creusot 1997, eq. 15-20.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.forces import smooth_sign
from mbs.components.joints import Motion
from mbs.recursions.poses import LinkPose
from mbs.recursions.regrouping import regroup, shift_frames
from mbs.recursions.velocities import Acceleration, effort, link_accelerations, moment_of_rotation
from mbs.spatial import PseudoInertia, Wrench, add_wrenches, cross, is_zero, zeros

# Rotors that spin with joints: what their angular momentum asks of joints and carriers.
#
# A rotor of inertia Jm about the unit vector z of link c, its carrier, spins at N qd relative to
# it. Its locked inertia belongs to link c. The spin adds N^2 Jm qd^2 / 2 + N Jm qd (z . w_c) to
# the kinetic energy, hence N^2 Jm qdd + N Jm (z . wd_c) to the effort of the joint and the moment
# N Jm (qdd z + w_c x z qd) to the carrier.
#
# Source: Sciavicco, Siciliano & Villani 1996.


def momentum_on(link: Link, carrier: int) -> SX:
    """(3, 1) angular momentum that a unit velocity of the joint gives a carrier, in its frame.

    Zero where the joint has no rotor or its rotor is on another link [kg m^2].
    """
    rotor = link.rotor
    return rotor.momentum if rotor is not None and rotor.carrier == carrier else zeros()


def spin_momenta(tree: Tree, v: SX) -> dict[int, SX]:
    """For every link that carries rotors their angular momentum (3, 1), seen from it [N m s]."""
    total: dict[int, SX] = {}
    for link in tree.links:
        if link.rotor is not None:
            c, momentum = link.rotor.carrier, link.rotor.momentum * v[link.v]
            total[c] = total[c] + momentum if c in total else momentum
    return total


def rotor_efforts(tree: Tree, a: SX, motions: list[Acceleration], base: Acceleration) -> SX:
    """(nv, 1) efforts that accelerate the rotors of the joints [N m or N]."""
    total = SX.zeros(tree.nv)
    for link in tree.links:
        if link.rotor is not None:
            carrier = motions[link.rotor.carrier] if link.rotor.carrier >= 0 else base
            total[link.v] = link.rotor.seen_at_joint * a[link.v] + casadi.dot(
                link.rotor.momentum, carrier.wd
            )
    return total


def rotor_moments(tree: Tree, v: SX, a: SX, motions: list[Acceleration]) -> dict[int, SX]:
    """For every link that carries rotors the moment (3, 1) that turns their spin [N m]."""
    total: dict[int, SX] = {}
    for link in tree.links:
        if link.rotor is None or link.rotor.carrier < 0:
            continue
        c, momentum = link.rotor.carrier, link.rotor.momentum
        moment = momentum * a[link.v] + cross(motions[c].w, momentum * v[link.v])
        total[c] = total[c] + moment if c in total else moment
    return total


def rotor_energy(tree: Tree, v: SX, w: list[SX]) -> SX:
    """Kinetic energy of the spin, beyond that of the locked rotors [J].

    Args:
        tree: the links.
        v: (nv, 1) joint velocities.
        w: (3, 1) angular velocities of the links, each in its frame.
    """
    total = SX(0)
    for link in tree.links:
        if link.rotor is not None:
            qd = v[link.v]
            total += 0.5 * link.rotor.seen_at_joint * qd**2
            if link.rotor.carrier >= 0:
                total += qd * casadi.dot(link.rotor.momentum, w[link.rotor.carrier])
    return total


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """Everything that the recursions of Newton and Euler compute.

    Attributes:
        motions: of the links, each in its frame.
        own: the wrench that moves each body, in its frame.
        wrenches: the wrench that each joint transmits, in the frame of its link.
        efforts: (nv, 1) its part along the motion, and what spins the rotors [N m or N].
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
    """The wrenches that produce the joint accelerations a, without drives, friction and springs.

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
    # passes: frames where distances vanish, parameters in as few places as possible
    bodies = [PseudoInertia.of(link.inertia) for link in tree.links]
    if not external:  # those are about the origins of the description
        poses, bodies = shift_frames(tree, poses, bodies, base_rests=is_zero(base.w))
    bodies = regroup(tree, poses, bodies)

    # forward: accelerations of the links, and the wrenches that move their bodies
    motions = link_accelerations(tree, poses, v, a, base)
    own = [inertial_wrench(body, motion) for body, motion in zip(bodies, motions, strict=True)]

    # what bodies exert on their environment and on the rotors that they carry
    wrenches = list(own)
    for j, wrench in (external or {}).items():
        wrenches[j] = add_wrenches(wrenches[j], wrench)
    for c, moment in rotor_moments(tree, v, a, motions).items():
        wrenches[c] = (wrenches[c][0], wrenches[c][1] + moment)

    # backward: wrenches to the base, and of each its part along the joint
    efforts = rotor_efforts(tree, a, motions, base)
    for j, link in reversed(list(enumerate(tree.links))):
        i = link.antecedent
        efforts[link.v] += effort(link, poses[j], *wrenches[j])
        if i >= 0:
            wrenches[i] = add_wrenches(wrenches[i], poses[j].wrench(*wrenches[j]))
    return Dynamics(motions, own, wrenches, efforts)


def inertial_wrench(body: PseudoInertia, motion: Acceleration) -> Wrench:
    """The wrench that moves a body: F = m vd + U ms, M = its moment of U + ms x vd."""
    f = body.m * motion.vd + casadi.mtimes(motion.rate.U, body.ms)
    return f, moment_of_rotation(body.S, motion.rate) + cross(body.ms, motion.vd)


# What a joint itself needs of effort, whatever moves with it: drive, friction and spring.
#
# Source: Khalil & Creusot 1997, eq. 20; Khalil & Dombre 2002 for elastic joints.


def joint_efforts(tree: Tree, q: SX, v: SX, a: SX) -> SX:
    """(nv, 1) rotor inertia, friction and spring of every joint [N m or N].

    Args:
        tree: the links.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
        a: (nv, 1) accelerations.
    """
    return rotor_and_friction(tree, v, a) + spring_effort(tree, q)


def rotor_and_friction(tree: Tree, v: SX, a: SX) -> SX:
    """(nv, 1) Ia a + Fv v + Fs tanh(v / Fs_width) of every joint [N m or N].

    The sign(v) of the source is smoothed over a width so that integrators and optimisers can use
    the same model; a width of zero gives the sign.
    """
    return casadi.vertcat(*(_rotor_and_friction(link, v[link.v], a[link.v]) for link in tree.links))


def spring_effort(tree: Tree, q: SX) -> SX:
    """(nv, 1) stiffness (q - rest), what holds the spring of every joint [N m or N]."""
    return casadi.vertcat(*(_spring_effort(link, q[link.q]) for link in tree.links))


def spring_energy(tree: Tree, q: SX) -> SX:
    """Energy in the springs of the joints, zero where they are at rest [J]."""
    total = SX(0)
    for link in tree.links:
        if not link.stiffness.is_zero():
            total += 0.5 * link.stiffness * (q[link.q] - link.rest) ** 2
    return total


def _spring_effort(link: Link, q: SX) -> SX:
    if link.stiffness.is_zero():
        return zeros(link.motion.nv)
    return link.stiffness * (q - link.rest)


def _rotor_and_friction(link: Link, v: SX, a: SX) -> SX:
    total = zeros(link.motion.nv)
    if link.motion is Motion.FREE:  # the velocity is in the turning frame
        a = a + casadi.vertcat(cross(v[3:6], v[0:3]), zeros())
    step = smooth_sign(v, link.Fs_width)
    for coefficient, rate in ((link.Ia, a), (link.Fv, v), (link.Fs, step)):
        if not coefficient.is_zero():
            total = total + coefficient * rate
    return total
