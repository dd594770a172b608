"""Tree of links, over which all recursions run, and the relation dq/dt = N(q) v."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.components.joints import Motion
from mbs.spatial import Inertia, Khalil, Pose, quaternion_rate, quaternion_rotation

Frame = tuple[int, Pose]
"""Pair of a link index, -1 for the base, and a pose in the link's frame."""


@dataclass(frozen=True, slots=True, eq=False)
class CarriedRotor:
    """A rotor that spins with a joint, mounted on one of the two links that the joint connects.

    Attributes:
        carrier: index of the link that carries the rotor, or -1 for the base.
        axis: (3, 1) unit vector of its axis, in the frame of that link.
        inertia: moment of inertia about the axis [kg m^2].
        ratio: velocity relative to the carrier per velocity of the joint.
    """

    carrier: int
    axis: SX
    inertia: SX
    ratio: SX

    @property
    def momentum(self) -> SX:
        """(3, 1) angular momentum relative to the carrier per velocity of the joint."""
        return self.ratio * self.inertia * self.axis

    @property
    def seen_at_joint(self) -> SX:
        """Inertia reflected to the joint [kg m^2 or kg]."""
        return self.ratio * self.ratio * self.inertia


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A moving link j and its elementary motion relative to its antecedent i.

    Attributes:
        name: name of the motion: the joint, with a suffix if the joint has several motions.
        antecedent: index of link i, or -1 for the base.
        motion: motion of frame j relative to its placement.
        backward: Whether the tree passes a SPHERICAL or FREE motion from frame_b to frame_a. Its
            positions are then the pose of link i in link j; its velocities are in axes of link i.
        via: successive fixed frames between frame i and the placement. Empty if the common
            perpendicular of the axes of i and j is near.
        placement: frame j relative to the last frame of `via`, or to frame i, at the zero position
            of the motion.
        inertia: inertia of all bodies on the link, about the origin of frame j and in its axes.
        Ia: rotor inertia reflected to the joint [kg m^2 or kg].
        Fv: viscous friction [N m s/rad or N s/m].
        Fs: Coulomb friction [N m or N].
        Fs_width: velocity over which Coulomb friction changes sign [rad/s or m/s], zero for a step.
        stiffness: stiffness of the spring of a joint with a single degree of freedom
            [N m/rad or N/m].
        rest: position at which the spring is relaxed [rad or m].
        rotor: rotor that spins with the joint, or None.
        q: slice of its positions in q.
        v: slice of its velocities in v.
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
        """Fixed frames on link i, then frame j at the zero position."""
        return *self.via, self.placement

    def pose(self) -> Pose:
        """Return the pose of frame j relative to frame i at the zero position of the motion."""
        pose = self.placement.pose()
        for frame in reversed(self.via):
            pose = frame.pose() @ pose
        return pose


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Links in topological order: an antecedent has a smaller index than its link.

    Attributes:
        links: moving links.
        gravity: (3, 1) gravity acceleration in the base frame [m/s^2].
    """

    links: tuple[Link, ...]
    gravity: SX

    @property
    def nq(self) -> int:
        """Number of positions: the end of the slice of the last link."""
        return self.links[-1].q.stop if self.links else 0

    @property
    def nv(self) -> int:
        """Number of velocities: the end of the slice of the last link."""
        return self.links[-1].v.stop if self.links else 0

    def path(self, j: int) -> list[int]:
        """Return the link indices on the path from the base to a link, in this order.

        Args:
            j: index of the link; the path is empty for the base (-1).
        """
        numbers = []
        while j >= 0:
            numbers.append(j)
            j = self.links[j].antecedent
        return numbers[::-1]


# Relation of positions and velocities: dq/dt = N(q) v.


def position_rate(tree: Tree, q: SX, v: SX) -> SX:
    """Return the time derivative (nq, 1) of the positions; it equals v without quaternions.

    Args:
        tree: the links.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
    """
    return casadi.vertcat(*(_rate(link, q[link.q], v[link.v]) for link in tree.links))


def _rate(link: Link, q: SX, v: SX) -> SX:
    """Return the time derivative (nq, 1) of the positions q of one link at its velocities v."""
    match link.motion:
        case Motion.SPHERICAL:
            return quaternion_rate(q, v)
        case Motion.FREE:
            linear = casadi.mtimes(quaternion_rotation(q[3:7]), v[0:3])
            return casadi.vertcat(linear, quaternion_rate(q[3:7], v[3:6]))
    return v


def quaternion_slices(tree: Tree) -> list[slice]:
    """Return the slice of each unit quaternion in q.

    Args:
        tree: the links.
    """
    found = {Motion.SPHERICAL: 0, Motion.FREE: 3}
    return [
        slice(link.q.start + found[link.motion], link.q.stop)
        for link in tree.links
        if link.motion in found
    ]


def norm_rows(tree: Tree, q: SX) -> SX:
    """Return the squared length minus one of every quaternion in q, (k, 1).

    Args:
        tree: the links.
        q: (nq, 1) positions.
    """
    rows = [norm for _, norm in norms_of(tree, q)]
    return casadi.vertcat(*rows) if rows else SX(0, 1)


def norms_of(tree: Tree, q: SX) -> list[tuple[slice, SX]]:
    """Return the slice of each unit quaternion in q, and its squared length minus one.

    Args:
        tree: the links.
        q: (nq, 1) positions.
    """
    return [(part, casadi.sumsqr(q[part]) - 1) for part in quaternion_slices(tree)]


def normalised(tree: Tree, q: SX) -> SX:
    """Return the positions (nq, 1) with quaternions scaled to unit length.

    Args:
        tree: the links.
        q: (nq, 1) positions.
    """
    result = SX(q)
    for part in quaternion_slices(tree):
        result[part] = q[part] / casadi.sqrt(casadi.sumsqr(q[part]))
    return result


def zero_position(tree: Tree) -> list[float]:
    """Return the positions (nq,) with every joint at zero and quaternions at the identity.

    Args:
        tree: the links.
    """
    q = [0.0] * tree.nq
    for part in quaternion_slices(tree):
        q[part.start] = 1.0
    return q
