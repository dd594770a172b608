"""Quantities that depend on one joint, and equations X e^(i q) = U in another.

A linear form holds three factors: of cos q, sin q and 1 for a joint that turns, of r^2, r and 1
for one that slides. A symmetric (3, 3) matrix A of such factors stands for the sum of the products,
b^T A b with b = (cos q, sin q, 1) or (r^2, r, 1).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.loops.closed_form.ring import Gap, Ring, Unknown
from mbs.loops.sequence import Problem
from mbs.spatial import Pose, axis_turn, vector


@dataclass(frozen=True, slots=True, eq=False)
class PieperLoop:
    """The loop as Pieper sees it.

    Attributes:
        problem: to be solved.
        ring: the loop, begun and walked so that the joints to be found last are its last ones.
        length: of the size of the arm and of the pose [m].
    """

    problem: Problem
    ring: Ring
    length: SX

    def x(self, k: int) -> SX:
        """The symbol of the position of joint k of the ring."""
        return SX(self.problem.x[self.place(k)])

    def place(self, k: int) -> int:
        """The place of joint k of the ring."""
        place = self.ring.joints[k].place
        assert place is not None
        return place

    def after(self, k: int) -> Gap:
        """The way from joint k to the next."""
        return self.ring.gaps[(k + 1) % len(self.ring.gaps)]

    def motion(self, k: int) -> Pose:
        """The motion of joint k, walked along the ring."""
        joint, x = self.ring.joints[k], self.x(k)
        if joint.turns:
            return Pose.turned(axis_turn("z", joint.sign * x).matrix)
        return Pose.moved(vector([0, 0, joint.sign * x]))

    def suffix(self, k: int) -> str:
        """What the names of the coefficients of joint k end with: its number."""
        joints = self.problem.ring.joints
        digits = ["".join(c for c in joint.name if c.isdigit()) for joint in joints]
        number = joints.index(self._named(k))
        distinct = all(digits) and len(set(digits)) == len(digits)
        return digits[number] if distinct else str(number + 1)

    def _named(self, k: int) -> Unknown:
        name = self.ring.joints[k].name
        return next(joint for joint in self.problem.ring.joints if joint.name == name)

    def zero(self, values: SX) -> bool:
        """Whether the values, free of units, vanish wherever the loop closes."""
        return self.problem.always_zero(values)


def basis(scene: PieperLoop, k: int) -> SX:
    """(3, 1) what the factors of a form in joint k multiply."""
    x = scene.x(k)
    if scene.ring.joints[k].turns:
        return casadi.vertcat(casadi.cos(x), casadi.sin(x), 1)
    return casadi.vertcat(x * x, x, 1)


def moved_point(joint: Unknown, point: SX) -> SX:
    """(3, 3) forms of the coordinates of a point that the joint moves."""
    x, y, z, sign = point[0], point[1], point[2], joint.sign
    if joint.turns:
        return casadi.vertcat(
            casadi.horzcat(x, -sign * y, 0), casadi.horzcat(y, sign * x, 0), casadi.horzcat(0, 0, z)
        )
    return casadi.vertcat(
        casadi.horzcat(0, 0, x), casadi.horzcat(0, 0, y), casadi.horzcat(0, sign, z)
    )


def constant(value: SX) -> SX:
    """The form of what does not depend on the joint."""
    return casadi.vertcat(0, 0, value)


def product(a: SX, b: SX) -> SX:
    """(3, 3) of the product of two forms."""
    outer = casadi.mtimes(a, b.T)
    return SX((outer + outer.T) / 2)
