"""Inverse dynamics by Newton and Euler, linear in the inertial parameters.

Source: Khalil & Kleinfinger 1987; Khalil & Creusot 1997, eq. 15-20.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.accelerations import Acceleration, link_accelerations
from mbs.recursions.first_effort import moment_of_run, runs_behind
from mbs.recursions.motion import effort
from mbs.recursions.poses import LinkPose
from mbs.recursions.regrouping import regrouped
from mbs.recursions.rotation_rate import moment_of_rotation
from mbs.recursions.rotors import rotor_efforts, rotor_moments
from mbs.recursions.sliding import heights_first, slid
from mbs.spatial import PseudoInertia, Wrench, add_wrenches, cross, is_zero


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
    bodies = [PseudoInertia.of(link.inertia) for link in tree.links]
    if not external:
        poses, bodies = slid(tree, poses, bodies, base_rests=is_zero(base.w))
        poses = heights_first(poses)
    bodies = regrouped(tree, poses, bodies)
    motions = link_accelerations(tree, poses, v, a, base)
    runs = runs_behind(tree, poses)
    own = [inertial_wrench(body, motion) for body, motion in zip(bodies, motions, strict=True)]
    wrenches = list(own)
    for j, wrench in (external or {}).items():
        wrenches[j] = add_wrenches(wrenches[j], wrench)
    for c, moment in rotor_moments(tree, v, a, motions).items():
        wrenches[c] = (wrenches[c][0], wrenches[c][1] + moment)
    loads = list(wrenches)
    for j in reversed(range(len(tree.links))):
        i = tree.links[j].antecedent
        if i >= 0:
            passed = poses[j].wrench(*wrenches[j])
            wrenches[i] = add_wrenches(wrenches[i], passed)
            if j not in runs.get(i, ()) and poses[j].run == (j,):
                loads[i] = add_wrenches(loads[i], passed)
    efforts = [effort(link.motion, f, m) for link, (f, m) in zip(tree.links, wrenches, strict=True)]
    for i, members in runs.items():
        along = [f[2] for f, _ in wrenches]
        efforts[i] = loads[i][1][2] + moment_of_run(tree, poses, members, loads, along)
    spin = rotor_efforts(tree, a, motions, base)
    return Dynamics(motions, own, wrenches, casadi.vertcat(*efforts) + spin)


def inertial_wrench(body: PseudoInertia, motion: Acceleration) -> Wrench:
    """The wrench that moves a body: F = m vd + U ms, M = its moment of U + ms x vd."""
    f = body.m * motion.vd + casadi.mtimes(motion.rate.U, body.ms)
    return f, moment_of_rotation(body.S, motion.rate) + cross(body.ms, motion.vd)
