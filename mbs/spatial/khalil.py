"""Modified Denavit-Hartenberg placement of a frame, with the two parameters of branches.

T_ij = Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r)

Source: Khalil & Kleinfinger 1986.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi
from casadi import SX

from mbs.spatial.pose import Pose
from mbs.spatial.rotation import axis_turn
from mbs.spatial.vectors import vector

_QUARTER = casadi.pi / 2 + 1e-9


@dataclass(frozen=True, slots=True)
class Khalil:
    """Placement of frame j with respect to its antecedent i.

    Attributes:
        gamma: angle from x_i to the common perpendicular, about z_i [rad].
        b: distance from x_i to the common perpendicular, along z_i [m].
        alpha: angle from z_i to z_j, about the common perpendicular [rad].
        d: distance from z_i to z_j, along the common perpendicular [m].
        theta: angle from the common perpendicular to x_j, about z_j [rad].
        r: distance from the common perpendicular to x_j, along z_j [m].
    """

    gamma: SX
    b: SX
    alpha: SX
    d: SX
    theta: SX
    r: SX

    @staticmethod
    def identity() -> Khalil:
        """Frame j on frame i."""
        return Khalil(*(SX(0) for _ in range(6)))

    @property
    def parameters(self) -> tuple[SX, SX, SX, SX, SX, SX]:
        """gamma, b, alpha, d, theta, r."""
        return self.gamma, self.b, self.alpha, self.d, self.theta, self.r

    def pose(self) -> Pose:
        """The frame j seen from frame i."""
        gamma, alpha, theta = (
            axis_turn(axis, angle)
            for axis, angle in (("z", self.gamma), ("x", self.alpha), ("z", self.theta))
        )
        R = casadi.mtimes(casadi.mtimes(gamma.matrix, alpha.matrix), theta.matrix)
        return Pose(R, self.position())

    def position(self) -> SX:
        """(3, 1) origin of frame j in frame i [m]; theta has no part in it."""
        gamma, alpha = axis_turn("z", self.gamma), axis_turn("x", self.alpha)
        return gamma.apply(vector([self.d, -self.r * alpha.s, self.b + self.r * alpha.c]))

    def turned(self, angle: SX) -> Khalil:
        """The frame turned further about its own z axis."""
        return replace(self, theta=self.theta + angle)

    def slid(self, distance: SX) -> Khalil:
        """The frame slid further along its own z axis."""
        return replace(self, r=self.r + distance)

    @staticmethod
    def of_pose(pose: Pose) -> Khalil:
        """The parameters of a frame that may stand anywhere.

        Parallel axes leave one distance free: b is then zero and r takes the offset. Structure
        (parallel, intersecting) is read from constants that are exact, so that geometry with
        symbols stays as simple as with numbers.
        """
        R, p = pose.R, pose.p
        if R[0, 2].is_zero() and R[1, 2].is_zero():
            return _parallel(R, p)
        sign = -1.0 if _points_back(_atan2(R[0, 2], -R[1, 2])) else 1.0
        gamma = _atan2(sign * R[0, 2], -sign * R[1, 2])
        turn = axis_turn("z", gamma)
        x, y, z = (turn.apply_inverse(p)[k] for k in range(3))
        s_alpha, c_alpha = -turn.apply_inverse(R[:, 2])[1], R[2, 2]
        r = -y / s_alpha
        return Khalil(
            gamma=gamma,
            b=_clean(z - r * c_alpha),
            alpha=_atan2(s_alpha, c_alpha),
            d=_clean(x),
            theta=_atan2(sign * R[2, 0], sign * R[2, 1]),
            r=_clean(r),
        )


def _points_back(angle: SX) -> bool:
    """Whether the angle is a number beyond a quarter turn; the opposite sense then reads better."""
    return bool(angle.is_constant() and abs(float(angle)) > _QUARTER)


def _parallel(R: SX, p: SX) -> Khalil:
    up = R[2, 2]
    gamma = SX(0) if p[1].is_zero() else _atan2(p[1], p[0])
    turn = axis_turn("z", gamma)
    x_axis = turn.apply_inverse(R[:, 0])
    return Khalil(
        gamma=gamma,
        b=SX(0),
        alpha=_atan2(SX(0), up),
        d=_clean(turn.apply_inverse(p)[0]),
        theta=_atan2(up * x_axis[1], x_axis[0]),
        r=up * p[2],
    )


def _atan2(y: SX, x: SX) -> SX:
    """The angle; of a lone symbol along one axis it is taken as pointing in its positive sense."""
    if y.is_zero():
        return SX(0) if not x.is_constant() or float(x) >= 0 else SX(casadi.pi)
    if x.is_zero():
        sign = 1.0 if not y.is_constant() or float(y) > 0 else -1.0
        return SX(sign * casadi.pi / 2)
    return SX(casadi.atan2(y, x))


def _clean(value: SX) -> SX:
    """A constant that is rounding noise of a metre-sized mechanism is zero."""
    return SX(0) if value.is_constant() and abs(float(value)) < 1e-13 else value
