"""How the ten inertial parameters of a body change when another frame is taken."""

from __future__ import annotations

import casadi
from casadi import DM, SX

from mbs.spatial import Inertia, MatrixTurn, Pose


def lambda_transform(pose: Pose) -> SX:
    """(10, 10) parameters about frame i, in its axes, of a body known about frame j.

    Column k holds the parameters in frame i of the body whose k-th parameter in frame j is one
    and whose others are zero.

    Source: Gautier & Khalil 1990; Khalil & Dombre 2002, section 9.4.

    Args:
        pose: of frame j seen from frame i; lengths and angles may be symbols.
    """
    turn = MatrixTurn(pose.R)
    units = (Inertia.from_parameters(SX(DM.eye(10)[:, k])) for k in range(10))
    return casadi.horzcat(*(unit.seen_from(turn, pose.p).parameters for unit in units))
