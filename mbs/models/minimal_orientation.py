"""Quaternion joints in loops whose motion is independent, as a whole or in part.

A rod between two ball joints spins about its own axis whatever the loops do, and no element of the
quaternion of a ball joint stands for that spin. The quaternion as a whole is then a state, and a
second one, on the loops, is solved for with the other dependent positions: of all quaternions that
close the loops the one that is not turned from the state about the independent axes.

The state turns with the same angular velocity in space as the solved quaternion, so that what is
solved moves with exactly the velocities of the joint, and decays to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.rates import position_rate
from mbs.assembly.tree import Link
from mbs.spatial import quaternion_rate, quaternion_rotation

NORM_RATE = 10.0
"""How fast a quaternion returns to unit length, and to the loops [1/s]: an error of the solver is
gone within a second, and steps that a mechanism takes at 1 Hz or faster are not shortened by it."""


@dataclass(frozen=True, slots=True, eq=False)
class Orientation:
    """A quaternion joint of which independent velocities are.

    Attributes:
        link: that it moves.
        free: numbers in v of its velocities whose positions may be chosen.
    """

    link: Link
    free: tuple[int, ...]

    @property
    def whole(self) -> bool:
        """Whether all its velocities are: its positions are states then, and none is solved for."""
        return len(self.free) == self.link.motion.nv

    @property
    def positions(self) -> tuple[int, ...]:
        """Numbers in q."""
        return tuple(range(self.link.q.start, self.link.q.stop))

    @property
    def quaternion(self) -> slice:
        """Where its quaternion stands in q."""
        return slice(self.link.q.stop - 4, self.link.q.stop)


def orientations_of(system: System) -> tuple[Orientation, ...]:
    """The quaternion joints of a closed system that are independent, in part at least."""
    free = set(system.free)
    found = (
        Orientation(link, tuple(k for k in range(link.v.start, link.v.stop) if k in free))
        for link in system.tree.links
        if link.motion.nq > link.motion.nv
    )
    return tuple(joint for joint in found if joint.free)


def with_unit_length(joints: Sequence[Orientation], q: SX) -> SX:
    """The positions with the quaternions of joints that are states alone at unit length."""
    result = SX(q)
    for joint in joints:
        if joint.whole:
            part = joint.quaternion
            result[part] = q[part] / casadi.norm_2(q[part])
    return result


def tied(system: System, joints: Sequence[Orientation], raw: SX, q: SX) -> SX:
    """(k, 1) zero where q is moved from the state by none of the independent velocities.

    Args:
        system: with closed loops.
        joints: its independent quaternion joints.
        raw: (nq, 1) positions as in the state.
        q: (nq, 1) positions that are solved for.
    """
    u = SX.sym("u", system.nv)
    N = casadi.jacobian(position_rate(system.tree, raw, u), u)
    rows = [SX(0, 1)]
    for joint in joints:
        if not joint.whole:
            size = SX.ones(system.nq)
            size[joint.quaternion] = 4  # of the columns of N, which are half unit vectors there
            part = list(joint.positions)
            along = N[part, list(joint.free)]
            rows.append(casadi.mtimes(along.T, (size * (q - raw))[part]))
    return casadi.vertcat(*rows)


def state_rates(system: System, joints: Sequence[Orientation], motion: tuple[SX, SX, SX]) -> SX:
    """(nq, 1) rates of the positions as in the state.

    Args:
        system: with closed loops.
        joints: its independent quaternion joints.
        motion: positions as in the state, positions on the loops, and velocities of the tree.
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
