"""Kinematic models: velocities of frames."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.loops.reduction import reduction
from mbs.models.symbols import check_coordinates
from mbs.recursions.jacobian import jacobian as frame_jacobian
from mbs.recursions.poses import link_poses, relative_pose


def jacobian(
    system: System,
    frame: str | int,
    expressed_in: str | int = "base",
    coordinates: str = "independent",
) -> Function:
    """``jacobian(q) -> J``: velocity of a frame, [V; w] = J v, V being that of its origin.

    Source: Khalil & Creusot 1997, eq. 3 and 5; for closed systems J G.

    Args:
        system: open or closed; q must close the loops.
        frame: a body, a named frame, or the number of a link.
        expressed_in: the frame in whose axes V and w are.
        coordinates: of a closed system, "independent" (v is v_a) or "tree".

    Returns:
        Function of q (nq, 1); J (6, m) [m or 1; 1/m or 1].

    Raises:
        ModelError: there is no such frame.
    """
    require_system(system)
    check_coordinates(system, coordinates)
    target, axes = system.frame(frame), system.frame(expressed_in)

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        poses = link_poses(system.tree, q)
        J = frame_jacobian(system.tree, poses, target)
        R = relative_pose(system.tree, poses, axes, system.frame("base")).R
        J = casadi.vertcat(casadi.mtimes(R, J[0:3, :]), casadi.mtimes(R, J[3:6, :]))
        if system.is_closed and coordinates == "independent":
            J = casadi.mtimes(J, reduction(system, q).G)
        return [("q", q)], [("J", J)]

    return model_function(system, ("jacobian", frame, expressed_in, coordinates), build)
