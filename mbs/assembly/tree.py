"""The tree of links that every recursion runs over, and dq/dt = N(q) v along it."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.components.joints import Motion
from mbs.spatial import Inertia, Khalil, Pose, quaternion_rate, quaternion_rotation

Frame = tuple[int, Pose]
"""A link, -1 for the base, and a pose in its frame."""


@dataclass(frozen=True, slots=True, eq=False)
class CarriedRotor:
    """A rotor that spins with a joint, mounted on one of the two links that the joint connects.

    Attributes:
        carrier: number of the link it is mounted on, or -1 for the base.
        axis: (3, 1) unit vector of its axis, in the frame of that link.
        inertia: about the axis [kg m^2].
        ratio: velocity relative to the carrier for a unit velocity of the joint.
    """

    carrier: int
    axis: SX
    inertia: SX
    ratio: SX

    @property
    def momentum(self) -> SX:
        """(3, 1) angular momentum in the carrier for a unit velocity of the joint."""
        return self.ratio * self.inertia * self.axis

    @property
    def seen_at_joint(self) -> SX:
        """Inertia that the joint feels [kg m^2 or kg]."""
        return self.ratio * self.ratio * self.inertia


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A moving link j and the elementary motion that carries it from its antecedent i.

    Attributes:
        name: of the motion: the joint's name, with a suffix when the joint has several.
        antecedent: number of link i, or -1 for the base.
        motion: how frame j moves from its placement.
        backward: whether the tree passes a SPHERICAL or FREE motion from frame_b to frame_a. Its
            positions are then the pose of link i in link j; its velocities are in axes of link i.
        via: fixed frames between frame i and the placement, one after the other; none where the
            common perpendicular of the axes of i and j is near.
        placement: frame j with respect to the last of them, or to frame i, at the zero position of
            the motion.
        inertia: of everything fixed on the link, about the origin of frame j and in its axes.
        Ia: inertia of the rotor seen at the joint [kg m^2 or kg].
        Fv: viscous friction [N m s/rad or N s/m].
        Fs: Coulomb friction [N m or N].
        Fs_width: velocity over which it changes sign [rad/s or m/s], zero for a step.
        stiffness: of the spring of a joint of one degree of freedom [N m/rad or N/m].
        rest: position at which the spring is at rest [rad or m].
        rotor: that spins with the joint, or None.
        q: where its positions stand in q.
        v: where its velocities stand in v.
    """

    name: str
    antecedent: int
    motion: Motion
    backward: bool
    via: tuple[Khalil, ...]
    placement: Khalil
    inertia: Inertia
    Ia: SX
    Fv: SX
    Fs: SX
    Fs_width: SX
    stiffness: SX
    rest: SX
    rotor: CarriedRotor | None
    q: slice
    v: slice

    @property
    def frames(self) -> tuple[Khalil, ...]:
        """The fixed frames on link i, then frame j at the zero position."""
        return *self.via, self.placement

    def pose(self) -> Pose:
        """Frame j seen from frame i at the zero position of the motion."""
        pose = self.placement.pose()
        for frame in reversed(self.via):
            pose = frame.pose() @ pose
        return pose


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Links in topological order: an antecedent has a smaller number than its link.

    Attributes:
        links: the moving links.
        gravity: (3, 1) gravity acceleration in the base frame [m/s^2].
    """

    links: tuple[Link, ...]
    gravity: SX

    @property
    def nq(self) -> int:
        """Number of positions; those of the last link end q."""
        return self.links[-1].q.stop if self.links else 0

    @property
    def nv(self) -> int:
        """Number of velocities; those of the last link end v."""
        return self.links[-1].v.stop if self.links else 0

    def path(self, j: int) -> list[int]:
        """The links from the base to link j, itself included; empty for the base (-1)."""
        numbers = []
        while j >= 0:
            numbers.append(j)
            j = self.links[j].antecedent
        return numbers[::-1]


# How positions change with velocities: dq/dt = N(q) v.


def position_rate(tree: Tree, q: SX, v: SX) -> SX:
    """(nq, 1) time derivative of the positions; equal to v where no quaternion is involved."""
    return casadi.vertcat(*(_rate(link, q[link.q], v[link.v]) for link in tree.links))


def _rate(link: Link, q: SX, v: SX) -> SX:
    match link.motion:
        case Motion.SPHERICAL:
            return quaternion_rate(q, v)
        case Motion.FREE:
            linear = casadi.mtimes(quaternion_rotation(q[3:7]), v[0:3])
            return casadi.vertcat(linear, quaternion_rate(q[3:7], v[3:6]))
    return v


def quaternion_slices(tree: Tree) -> list[slice]:
    """Where the unit quaternions stand in q."""
    found = {Motion.SPHERICAL: 0, Motion.FREE: 3}
    return [
        slice(link.q.start + found[link.motion], link.q.stop)
        for link in tree.links
        if link.motion in found
    ]


def norm_rows(tree: Tree, q: SX) -> SX:
    """(k, 1) squared length less one of every quaternion in the positions q, (nq, 1)."""
    rows = [norm for _, norm in norms_of(tree, q)]
    return casadi.vertcat(*rows) if rows else SX(0, 1)


def norms_of(tree: Tree, q: SX) -> list[tuple[slice, SX]]:
    """Where each quaternion stands in q, and its squared length less one."""
    return [(part, casadi.sumsqr(q[part]) - 1) for part in quaternion_slices(tree)]


def normalised(tree: Tree, q: SX) -> SX:
    """The positions with their quaternions brought back to unit length."""
    result = SX(q)
    for part in quaternion_slices(tree):
        result[part] = q[part] / casadi.sqrt(casadi.sumsqr(q[part]))
    return result


def zero_position(tree: Tree) -> list[float]:
    """Positions with every joint at zero, quaternions at the identity."""
    q = [0.0] * tree.nq
    for part in quaternion_slices(tree):
        q[part.start] = 1.0
    return q
