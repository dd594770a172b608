"""What a joint itself needs of effort, whatever moves with it: drive, friction and spring.

Source: Khalil & Creusot 1997, eq. 20; Khalil & Dombre 2002 for elastic joints.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.motion import Motion
from mbs.components.smooth_sign import smooth_sign
from mbs.spatial import cross, zeros


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
