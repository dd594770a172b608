"""Inverse dynamics by the Newton-Euler recursion, linear in the inertial parameters.

Source: Khalil & Kleinfinger 1987; Khalil & Creusot 1997, eq. 15-20.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.joints import Motion, smooth_sign
from mbs.recursions.link_motions import (
    Acceleration,
    LinkPose,
    effort,
    link_accelerations,
    moment_of_rotation,
)
from mbs.recursions.regrouping import regroup, shift_frames
from mbs.spatial import PseudoInertia, Wrench, add_wrenches, cross, is_zero, zeros

# Rotors that spin with joints: efforts on joints and moments on carrier links.
#
# A rotor of inertia Jm about the unit vector z of link c, its carrier, spins at N qd relative to
# it. Its locked inertia belongs to link c. The spin adds N^2 Jm qd^2 / 2 + N Jm qd (z . w_c) to
# the kinetic energy, hence N^2 Jm qdd + N Jm (z . wd_c) to the effort of the joint and the moment
# N Jm (qdd z + w_c x z qd) to the carrier.
#
# Source: Sciavicco, Siciliano & Villani 1996.


def momentum_on(link: Link, carrier: int) -> SX:
    """Return the angular momentum (3, 1) of a joint's rotor per unit joint velocity [kg m^2].

    It is relative to the link that the rotor is mounted on, in its frame.

    Args:
        link: link whose joint drives the rotor.
        carrier: index of a link. The result is zero if the rotor is not mounted on this link.
    """
    rotor = link.rotor
    return rotor.momentum if rotor is not None and rotor.carrier == carrier else zeros()


def spin_momenta(tree: Tree, v: SX) -> dict[int, SX]:
    """Return the angular momentum (3, 1) of rotors relative to their links [N m s].

    Their links are the links that they are mounted on.

    The result is by index of this link, -1 for the base, in its frame. Links without rotors have no
    entry.

    Args:
        tree: links, rotors included.
        v: (nv, 1) joint velocities.
    """
    total: dict[int, SX] = {}
    for link in tree.links:
        if link.rotor is not None:
            c, momentum = link.rotor.carrier, link.rotor.momentum * v[link.v]
            total[c] = total[c] + momentum if c in total else momentum
    return total


def rotor_efforts(tree: Tree, a: SX, motions: list[Acceleration], base: Acceleration) -> SX:
    """Return the joint efforts (nv, 1) that accelerate the rotation of the rotors [N m or N].

    Args:
        tree: links, rotors included.
        a: (nv, 1) joint accelerations.
        motions: acceleration of each link, in its frame.
        base: motion of the base.
    """
    total = SX.zeros(tree.nv)
    for link in tree.links:
        if link.rotor is not None:
            carrier = motions[link.rotor.carrier] if link.rotor.carrier >= 0 else base
            total[link.v] = link.rotor.seen_at_joint * a[link.v] + casadi.dot(
                link.rotor.momentum, carrier.wd
            )
    return total


def rotor_moments(tree: Tree, v: SX, a: SX, motions: list[Acceleration]) -> dict[int, SX]:
    """Return the moment (3, 1) [N m] that each link exerts on the rotors mounted on it.

    The result is by link index, in the frame of the link. It is the rate of change of the angular
    momentum of the rotors relative to the link. Links without rotors have no entry.

    Args:
        tree: links, rotors included.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        motions: acceleration of each link, in its frame.
    """
    total: dict[int, SX] = {}
    for link in tree.links:
        if link.rotor is None or link.rotor.carrier < 0:
            continue
        c, momentum = link.rotor.carrier, link.rotor.momentum
        moment = momentum * a[link.v] + cross(motions[c].w, momentum * v[link.v])
        total[c] = total[c] + moment if c in total else moment
    return total


def rotor_energy(tree: Tree, v: SX, w: list[SX]) -> SX:
    """Return the kinetic energy [J] of the rotation of rotors relative to their links.

    It is the energy in addition to that of rotors locked to their links.

    Args:
        tree: links, rotors included.
        v: (nv, 1) joint velocities.
        w: angular velocity (3, 1) of each link, in its frame.
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
    """Results of the Newton-Euler recursion.

    Attributes:
        motions: acceleration of each link, in its frame.
        own: inertial wrench of each body, in its frame.
        wrenches: wrench that each joint transmits, in the frame of its link.
        efforts: (nv, 1) projection of `wrenches` on the joint motions, plus the efforts that
            accelerate rotors [N m or N].
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
    """Return the inverse dynamics of a tree for joint accelerations a.

    Drives, joint friction and springs are not included.

    The forward pass computes accelerations, the backward pass wrenches, with regrouped inertial
    parameters.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base; see `resting_base`.
        external: wrench that a link exerts on its environment, by link index.
    """
    # preparation: shift frames so that distances vanish, and regroup inertial parameters
    bodies = [PseudoInertia.of(link.inertia) for link in tree.links]
    if not external:  # external wrenches are about the original frame origins
        poses, bodies = shift_frames(tree, poses, bodies, base_rests=is_zero(base.w))
    bodies = regroup(tree, poses, bodies)

    # forward pass: accelerations of the links, and inertial wrenches of their bodies
    motions = link_accelerations(tree, poses, v, a, base)
    own = [inertial_wrench(body, motion) for body, motion in zip(bodies, motions, strict=True)]

    # add the wrenches that links exert on their environment and on their rotors
    wrenches = list(own)
    for j, wrench in (external or {}).items():
        wrenches[j] = add_wrenches(wrenches[j], wrench)
    for c, moment in rotor_moments(tree, v, a, motions).items():
        wrenches[c] = (wrenches[c][0], wrenches[c][1] + moment)

    # backward pass: sum the wrenches towards the base, and project each on its joint motion
    efforts = rotor_efforts(tree, a, motions, base)
    for j, link in reversed(list(enumerate(tree.links))):
        i = link.antecedent
        efforts[link.v] += effort(link, poses[j], *wrenches[j])
        if i >= 0:
            wrenches[i] = add_wrenches(wrenches[i], poses[j].wrench(*wrenches[j]))
    return Dynamics(motions, own, wrenches, efforts)


def inertial_wrench(body: PseudoInertia, motion: Acceleration) -> Wrench:
    """Return the wrench that accelerates a body: F = m vd + U ms, M = J wd + w x (J w) + ms x vd.

    Args:
        body: inertia of the body, about the origin and in axes of its frame.
        motion: motion of the frame; its acceleration vd includes minus gravity.

    Returns:
        force [N] and moment about the origin [N m], (3, 1) each, in axes of the frame.
    """
    f = body.m * motion.vd + casadi.mtimes(motion.rate.U, body.ms)
    return f, moment_of_rotation(body.S, motion.rate) + cross(body.ms, motion.vd)


# Effort of a joint itself, independent of the moved bodies: rotor inertia, friction and spring.
#
# Source: Khalil & Creusot 1997, eq. 20; Khalil & Dombre 2002 for elastic joints.


def joint_efforts(tree: Tree, q: SX, v: SX, a: SX) -> SX:
    """Return the efforts (nv, 1) of rotor inertia, friction and spring of each joint [N m or N].

    Args:
        tree: links of the tree.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
        a: (nv, 1) accelerations.
    """
    return rotor_and_friction(tree, v, a) + spring_effort(tree, q)


def rotor_and_friction(tree: Tree, v: SX, a: SX) -> SX:
    """Return the efforts (nv, 1) Ia a + Fv v + Fs tanh(v / Fs_width) of all joints [N m or N].

    They overcome rotor inertia, viscous and Coulomb friction. tanh replaces sign(v) of the source,
    so that integrators and optimisers can use the same model. A width of zero selects sign(v).

    Args:
        tree: links of the tree.
        v: (nv, 1) velocities.
        a: (nv, 1) accelerations.
    """
    return casadi.vertcat(*(_rotor_and_friction(link, v[link.v], a[link.v]) for link in tree.links))


def spring_effort(tree: Tree, q: SX) -> SX:
    """Return the efforts (nv, 1) stiffness (q - rest) that balance the joint springs [N m or N].

    Args:
        tree: links of the tree.
        q: (nq, 1) positions.
    """
    return casadi.vertcat(*(_spring_effort(link, q[link.q]) for link in tree.links))


def spring_energy(tree: Tree, q: SX) -> SX:
    """Return the energy [J] of the joint springs, zero at their rest positions.

    Args:
        tree: links of the tree.
        q: (nq, 1) positions.
    """
    total = SX(0)
    for link in tree.links:
        if not link.stiffness.is_zero():
            total += 0.5 * link.stiffness * (q[link.q] - link.rest) ** 2
    return total


def _spring_effort(link: Link, q: SX) -> SX:
    """Return the effort that balances the spring of a joint at its position q; zero without one."""
    if link.stiffness.is_zero():
        return zeros(link.motion.nv)
    return link.stiffness * (q - link.rest)


def _rotor_and_friction(link: Link, v: SX, a: SX) -> SX:
    """Return the effort of rotor inertia and friction of a joint.

    `v` and `a` are velocity and acceleration of the joint, (n, 1).
    """
    total = zeros(link.motion.nv)
    if link.motion is Motion.FREE:  # the linear velocity is in rotating axes
        a = a + casadi.vertcat(cross(v[3:6], v[0:3]), zeros())
    step = smooth_sign(v, link.Fs_width)
    for coefficient, rate in ((link.Ia, a), (link.Fv, v), (link.Fs, step)):
        if not coefficient.is_zero():
            total = total + coefficient * rate
    return total


# SYMORO names of the quantities that the recursions compute.
#
# The index of the element precedes the link number: W32 is the third element of the angular
# velocity of link 2. From link 10 on, an underscore separates the two numbers: W3_12.
#
# Source: Khalil & Creusot 1997, section 5.1; docs/notation.md lists them.


def newton_euler_names(dynamics: Dynamics) -> list[tuple[str, SX]]:
    """Return pairs (SYMORO name, scalar) of the intermediate results of a Newton-Euler recursion.

    Constants and single symbols are left out. The first letters of a name are W and WP (angular
    velocity and acceleration), U (its matrix), VP (acceleration), F and NO (force and moment of the
    link itself), E and N (force and moment that the joint transmits). Digits are element and link.

    Args:
        dynamics: results of `newton_euler`.
    """
    named: list[tuple[str, SX]] = []
    for j, motion in enumerate(dynamics.motions, 1):
        own, joint = dynamics.own[j - 1], dynamics.wrenches[j - 1]
        for name, matrix in (
            ("W", motion.w),
            ("WP", motion.wd),
            ("U", motion.rate.U),
            ("VP", motion.vd),
            ("F", own[0]),
            ("NO", own[1]),
            ("E", joint[0]),
            ("N", joint[1]),
        ):
            named.extend(_elements(name, matrix, j))
    return named


def _elements(name: str, matrix: SX, link: int) -> list[tuple[str, SX]]:
    """Return pairs (name, element) of a matrix of link number `link`, counted from 1.

    Constants and single symbols are left out.
    """
    rows, columns = matrix.shape
    named = []
    for column in range(columns):
        for row in range(rows):
            value = matrix[row, column]
            place = f"{row + 1}{column + 1}" if columns > 1 else f"{row + 1}"
            if not value.is_constant() and not value.is_symbolic():
                named.append((f"{name}{place}{'_' if link > 9 else ''}{link}", value))
    return named
