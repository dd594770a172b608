"""The inertia of an articulated body, and the joints taken out of it.

Three blocks of scalars are moved through elementary screws. The row and the column of a joint that
was taken out are zero, and cost nothing from there on.

Source: Featherstone 1983; Brandl, Johanni & Otter 1988; Khalil & Creusot 1997, section 5.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.spatial import Inertia, Rotation, skew, zeros


@dataclass(frozen=True, slots=True, eq=False)
class ArticulatedInertia:
    """What wrench a link needs for an acceleration: f = M vd + H wd, m = H' vd + J wd.

    Attributes:
        M: (3, 3) symmetric, translational [kg].
        H: (3, 3) coupling [kg m].
        J: (3, 3) symmetric, rotational [kg m^2].
    """

    M: SX
    H: SX
    J: SX

    @staticmethod
    def of(body: Inertia) -> ArticulatedInertia:
        """Of a rigid body."""
        return ArticulatedInertia(
            casadi.densify(body.m * SX.eye(3)), casadi.densify(-skew(body.ms)), body.J
        )

    def __add__(self, other: ArticulatedInertia) -> ArticulatedInertia:
        """Of two bodies that move together, in one frame."""
        return ArticulatedInertia(self.M + other.M, self.H + other.H, self.J + other.J)

    def turned(self, R: Rotation) -> ArticulatedInertia:
        """The same body about the same point in the axes of frame i."""
        return ArticulatedInertia(
            R.apply_to_tensor(self.M), R.apply_to_square(self.H), R.apply_to_tensor(self.J)
        )

    def slid(self, axis: int, t: SX) -> ArticulatedInertia:
        """The body displaced by t [m] along a coordinate axis; ten products."""
        if t.is_zero():
            return self
        k, h = (axis + 1) % 3, (axis + 2) % 3
        M, old, H, J = self.M, self.H, SX(self.H), SX(self.J)
        H[:, k] -= t * M[:, h]
        H[:, h] += t * M[:, k]
        J[k, k] -= t * (old[h, k] + H[h, k])
        J[h, h] += t * (old[k, h] + H[k, h])
        J[k, h] += t * (old[k, k] - H[h, h])
        J[k, axis] -= t * old[h, axis]
        J[h, axis] += t * old[k, axis]
        J[h, k], J[axis, k], J[axis, h] = J[k, h], J[k, axis], J[h, axis]
        return ArticulatedInertia(M, H, J)

    def column(self, direction: int) -> SX:
        """(6, 1) wrench for a unit acceleration along one direction of a twist."""
        if direction < 3:
            return casadi.vertcat(self.M[:, direction], self.H[direction, :].T)
        return casadi.vertcat(self.H[:, direction - 3], self.J[:, direction - 3])

    def without(self, pivot: Pivot) -> ArticulatedInertia:
        """What is felt of the body when it may move freely along the direction of the pivot."""
        k, g, own = pivot.direction % 3, pivot.gain, pivot.rest
        u = SX(pivot.column)
        u[pivot.direction] = 0
        M, H, J = (
            self.M + _symmetric_product(g[:3], u[:3]),
            self.H + casadi.mtimes(g[:3], u[3:].T),
            self.J + _symmetric_product(g[3:], u[3:]),
        )
        if pivot.direction < 3:
            M[k, :], M[:, k], H[k, :] = own[:3].T, own[:3], own[3:].T
        else:
            J[k, :], J[:, k], H[:, k] = own[3:].T, own[3:], own[:3]
        return ArticulatedInertia(M, H, J)


@dataclass(frozen=True, slots=True, eq=False)
class RotorDrive:
    """What turns with a joint without being a part of its link.

    Attributes:
        inertia: that the joint alone feels, beyond what moves with the column of its pivot.
        momentum: (3, 1) of rotors for its unit velocity, in the frame of the pivot; links feel it.
    """

    inertia: SX
    momentum: SX


@dataclass(frozen=True, slots=True, eq=False)
class Pivot:
    """One velocity, taken out of the equations.

    Attributes:
        direction: where it stands in a twist.
        column: (6, 1) wrench for its unit acceleration, that of the drive left out.
        rest: (6, 1) what remains of its own column in the body; zero without a drive.
        size: inertia that it moves, D.
        inverse: -1 / D; its sign keeps a product by it from being turned into a division.
        gain: (6, 1) -column / D, zero at the direction itself.
        ratio: part of the drive in D.
    """

    direction: int
    column: SX
    rest: SX
    size: SX
    inverse: SX
    gain: SX
    ratio: SX

    @staticmethod
    def of(body: ArticulatedInertia, direction: int, drive: RotorDrive) -> Pivot:
        """Along a direction of a body, with what drives the joint."""
        column = body.column(direction)
        column[3:] += drive.momentum
        D = column[direction] + drive.inertia
        inverse = -1 / D
        ratio = -drive.inertia * inverse
        gain, rest = column * inverse, column * ratio
        gain[direction] = 0
        rest[3:] -= drive.momentum
        return Pivot(direction, column, rest, D, inverse, gain, ratio)

    def transmitted(self, wrench: SX, effort: SX) -> tuple[SX, SX]:
        """The wrench (6, 1) that passes on to the antecedent, and the effort that accelerates."""
        left = effort - wrench[self.direction]
        wrench = wrench - self.gain * left
        wrench[self.direction] = effort - self.ratio * left
        return wrench, left

    def accelerated(self, twist: SX, left: SX) -> tuple[SX, SX]:
        """The acceleration (6, 1) behind the joint, and its part that the joint adds."""
        before = twist[self.direction]
        own = casadi.dot(self.gain, twist) - self.inverse * left + self.ratio * before
        twist = SX(twist)
        twist[self.direction] = own
        return twist, own - before


def _symmetric_product(a: SX, b: SX) -> SX:
    """The product a b' where it is known to be symmetric: six multiplications."""
    product = zeros(3, 3)
    for row in range(3):
        for column in range(row, 3):
            product[row, column] = product[column, row] = a[row] * b[column]
    return product
