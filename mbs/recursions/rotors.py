"""Rotors that spin with joints: what their angular momentum asks of joints and carriers.

A rotor of inertia Jm about the unit vector z of link c, its carrier, spins at N qd relative to
it. Its locked inertia belongs to link c. The spin adds N^2 Jm qd^2 / 2 + N Jm qd (z . w_c) to the
kinetic energy, hence N^2 Jm qdd + N Jm (z . wd_c) to the effort of the joint and the moment
N Jm (qdd z + w_c x z qd) to the carrier.

Source: Sciavicco, Siciliano & Villani 1996.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.recursions.accelerations import Acceleration
from mbs.spatial import cross, zeros


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
