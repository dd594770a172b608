"""Quaternion joints in loops whose rotations are independent, all or some of them.

A rod between two spherical joints spins freely about its own axis, and no element of the quaternion
of a spherical joint is the angle of that spin. The whole quaternion is then a state. A second
quaternion, which closes the loops, is solved with the other dependent positions. It is the one that
is not rotated relative to the state about the independent axes.

The state rotates with the same angular velocity in space as the solved quaternion and decays to it,
so the solved quaternion moves exactly with the velocities of the joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.tree import Link, position_rate
from mbs.spatial import quaternion_rate, quaternion_rotation

NORM_RATE = 10.0
"""Rate at which a quaternion state decays to unit length and to the loops [1/s]. An integration
error decays within one second, and steps of a mechanism at 1 Hz or faster are not shortened."""


@dataclass(frozen=True, slots=True, eq=False)
class Orientation:
    """Quaternion joint in a loop with at least one independent velocity.

    Attributes:
        link: link that the joint moves.
        free: indices in v of the velocities of the joint that are independent.
    """

    link: Link
    free: tuple[int, ...]

    @property
    def whole(self) -> bool:
        """Whether all velocities are independent; then all positions are states, none solved."""
        return len(self.free) == self.link.motion.nv

    @property
    def positions(self) -> tuple[int, ...]:
        """Indices in q of the positions of the joint."""
        return tuple(range(self.link.q.start, self.link.q.stop))

    @property
    def quaternion(self) -> slice:
        """Index range in q of the quaternion of the joint."""
        return slice(self.link.q.stop - 4, self.link.q.stop)


def orientations_of(system: System) -> tuple[Orientation, ...]:
    """Return the quaternion joints of a closed system with at least one independent velocity."""
    free = set(system.chosen_coordinates)
    found = (
        Orientation(link, tuple(k for k in range(link.v.start, link.v.stop) if k in free))
        for link in system.tree.links
        if link.motion.nq > link.motion.nv
    )
    return tuple(joint for joint in found if joint.free)


def with_unit_length(joints: Sequence[Orientation], q: SX) -> SX:
    """Normalise the quaternions in q (nq, 1) of the joints whose positions are all states."""
    result = SX(q)
    for joint in joints:
        if joint.whole:
            part = joint.quaternion
            result[part] = q[part] / casadi.norm_2(q[part])
    return result


def tie_orientations(system: System, joints: Sequence[Orientation], raw: SX, q: SX) -> SX:
    """Return the orientation residual (k, 1) of independent quaternion joints.

    It is the projection of q - raw on the independent velocities, and zero at the solution.

    Args:
        system: system with closed loops.
        joints: independent quaternion joints of the system.
        raw: (nq, 1) positions with the quaternions of the state.
        q: (nq, 1) positions that are solved for.
    """
    u = SX.sym("u", system.nv)
    N = casadi.jacobian(position_rate(system.tree, raw, u), u)
    rows = [SX(0, 1)]
    for joint in joints:
        if not joint.whole:
            size = SX.ones(system.nq)
            size[joint.quaternion] = 4  # compensates the columns of N, which have length 1/2 there
            part = list(joint.positions)
            along = N[part, list(joint.free)]
            rows.append(casadi.mtimes(along.T, (size * (q - raw))[part]))
    return casadi.vertcat(*rows)


def state_rates(system: System, joints: Sequence[Orientation], motion: tuple[SX, SX, SX]) -> SX:
    """Return the rates (nq, 1) of the positions of the state.

    Args:
        system: system with closed loops.
        joints: independent quaternion joints of the system.
        motion: positions of the state (nq, 1), positions that close the loops (nq, 1), and
            velocities of the tree (nv, 1).
    """
    raw, q, v = motion
    rate = position_rate(system.tree, q, v)
    for joint in joints:
        part = joint.quaternion
        w = v[joint.link.v.stop - 3 : joint.link.v.stop]
        if joint.whole:
            left = (1 - casadi.sumsqr(raw[part])) * raw[part]
            rate[part] = quaternion_rate(raw[part], w) + NORM_RATE * left
            continue
        every = list(joint.positions)
        unit = raw[part] / casadi.norm_2(raw[part])
        spin = casadi.mtimes(quaternion_rotation(q[part]), w)
        left = q[every] - raw[every]
        rate[part] = quaternion_rate(raw[part], casadi.mtimes(quaternion_rotation(unit).T, spin))
        if len(every) > 4:
            rate[every[:3]] -= casadi.cross(spin, left[:3])
        rate[every] += NORM_RATE * left
    return rate
