"""The inputs that say how the base moves, and the base that the recursions start from."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.model_function import Named
from mbs.recursions.accelerations import Acceleration, moving_base, resting_base


def base_under_gravity(gravity: SX, moves: bool) -> tuple[Acceleration, Named]:
    """The base of the dynamic models, and its inputs.

    Args:
        gravity: (3, 1) gravity acceleration, in the base frame at R_0 = 1 [m/s^2].
        moves: add the inputs v_0 and a_0, (6, 1), velocity [V; w] and acceleration [vd; wd] of
            the base's origin in its own axes, and R_0, (3, 3), orientation of the base frame in
            the fixed frame in which gravity is given.
    """
    if not moves:
        return resting_base(gravity), []
    v_0, a_0, R_0 = SX.sym("v_0", 6), SX.sym("a_0", 6), SX.sym("R_0", 3, 3)
    vd = a_0[0:3] - casadi.mtimes(R_0.T, gravity)
    return moving_base(v_0[3:6], a_0[3:6], vd), [("v_0", v_0), ("a_0", a_0), ("R_0", R_0)]
