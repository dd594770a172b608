"""Loop constraints between velocities and accelerations of active, passive and cut joints."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.assembly.tree import position_rate
from mbs.components import Free, Spherical, Universal
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.loops.balance import require_no_drift
from mbs.loops.closure_equations import cut_twist
from mbs.loops.cut_positions import cut_position
from mbs.loops.examination import DETERMINED
from mbs.loops.reduction import reduction, tree_rows
from mbs.loops.velocity import (
    acceleration_bias,
    determining_rows,
    independent_constraint_rows,
    independent_drift,
)
from mbs.models.symbols import ModelSymbols, symbols_of
from mbs.recursions.route import relative_pose
from mbs.solvers.linear import solve_square
from mbs.spatial import Pose, zeros


def velocity_closure(system: System) -> Function:
    """Return the velocity constraints of the loops.

    They are ``velocity_closure(q) -> Wa, Wp, Wac, Wpc, Wc, W, G``.

    Wa v_a + Wp v_p = 0 are the independent closure rows (`system.closure.rows`), including
    couplings. Wac v_a + Wpc v_p + Wc v_c = 0, with Wc = -I, are the velocities v_c of the cut
    joints in the order of their freedoms: displacement, then angle. A spherical joint has the
    angular velocity of its frame_b, in frame_b.

    Source: Khalil & Creusot 1997, eq. 11-13.

    Args:
        system: closed mechanism with m independent, r passive and c cut velocities.

    Returns:
        Function of q (nq, 1), which must close the loops; Wa (r, m), Wp (r, r), Wac (c, m), Wpc (c,
        r), Wc (c, c), W (r, m) with v_p = W v_a, and G (nv, m) with v = G v_a. Columns are in the
        order of `system.closure.independent` and `.passive` [rad or m in each].

    Raises:
        ModelError: the system is an open chain.
    """
    require_system(system)

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        rows = _loop_rows(system, q)
        J, C, active, passive = rows.tree, rows.cut, rows.active, rows.passive
        G = reduction(system, q).G
        outputs = [
            ("Wa", J[:, active]),
            ("Wp", J[:, passive]),
            ("Wac", C[:, active]),
            ("Wpc", C[:, passive]),
            ("Wc", -SX(DM.eye(C.shape[0]))),
            ("W", G[passive, :]),
            ("G", G),
        ]
        return [("q", q)], outputs

    return model_function(system, ("velocity_closure",), build, DETERMINED)


def acceleration_closure(system: System, coordinates: str = "independent") -> Function:
    """Return the velocity-dependent terms of the acceleration constraints of the loops.

    ``acceleration_closure(q, v_a) -> Psi, Phi, G_dot``: Wa a_a + Wp a_p + Psi = 0 and Wac a_a + Wpc
    a_p + Wc a_c + Phi = 0 with the matrices of `velocity_closure`. G_dot is the time derivative of
    G along the motion.

    Source: Khalil & Creusot 1997, eq. 14.

    Args:
        system: closed mechanism.
        coordinates: "independent" (the velocities are v_a) or "tree" (all velocities v, which must
            keep the loops closed).

    Returns:
        Function of q (nq, 1), which must close the loops, and v_a (m, 1) or v (nv, 1); Psi (r, 1),
        Phi (c, 1), G_dot (nv, m).

    Raises:
        ModelError: the system is an open chain, or `coordinates` is unknown.
    """
    require_system(system)

    def build() -> tuple[Named, Named]:
        _require_loops(system)
        s = symbols_of(system, coordinates)
        rows = _loop_rows(system, s.q)
        speed = SX.sym("v", system.nv)
        both = casadi.vertcat(rows.tree, rows.cut)
        drift = independent_drift(system, s.q)
        if drift is not None:
            drift = casadi.vertcat(drift, SX.zeros(rows.cut.shape[0]))
        bias = acceleration_bias(system, s.q, speed, both, drift)
        r, every = rows.tree.shape[0], determining_rows(system, s.q)
        turned = casadi.mtimes(_rate(system, every.J, s.q, speed), reduction(system, s.q).G)
        W_dot = -solve_square(every.square, casadi.mtimes(every.mixed, turned))
        G_dot = tree_rows(system, W_dot, zeros(len(rows.active), len(rows.active)))
        values = casadi.substitute([bias, G_dot], [speed], [s.v_tree])
        outputs = [("Psi", values[0][:r]), ("Phi", values[0][r:]), ("G_dot", values[1])]
        return [("q", s.q), (f"v{s.suffix}", s.v)], outputs

    return model_function(system, ("acceleration_closure", coordinates), build, DETERMINED)


@dataclass(frozen=True, slots=True, eq=False)
class _LoopRows:
    """Constraint rows on the tree velocities, with the indices of active and passive columns.

    Attributes:
        tree: (r, nv) independent closure rows.
        cut: (c, nv) rows that map tree velocities to velocities of the cut joints.
        active, passive: indices of the columns of independent and dependent velocities.
    """

    tree: SX
    cut: SX
    active: list[int]
    passive: list[int]


def _require_loops(system: System) -> None:
    """Raise ModelError if the system is an open chain or has damped massless nodes."""
    require_no_drift(system, "the closure of velocities", range(system.nv))
    if system.closure is None:
        raise ModelError(
            f"{system.name}: an open chain has no loops whose velocities could be tied; use the"
            " models of open chains"
        )


def _loop_rows(system: System, q: SX) -> _LoopRows:
    """Return the independent constraint rows, and the velocity rows of the cut joints, at q.

    Raise ModelError for an open chain.
    """
    _require_loops(system)
    closure = system.closure
    assert closure is not None
    J = independent_constraint_rows(system, q)
    cut = [cut_velocities(system, q, cut) for cut in system.cuts if not cut.welded]
    C = casadi.vertcat(*cut) if cut else SX(0, system.nv)
    return _LoopRows(J, casadi.densify(C), list(closure.independent), list(closure.passive))


def cut_velocities(system: System, q: SX, cut: Cut) -> SX:
    """Return the Jacobian (c, nv) of the coordinates of a cut joint by the tree velocities.

    Args:
        system: closed mechanism.
        q: (nq, 1) symbols of positions.
        cut: cut joint.
    """
    pose = relative_pose(system.tree, q, *cut.frames)
    v = SX.sym("v", system.nv)
    values = _freedom_velocities(cut, pose, *cut_twist(system, pose, q, v))
    return casadi.jacobian(casadi.vertcat(*values), v) if values else SX(0, system.nv)


def _freedom_velocities(cut: Cut, pose: Pose, V: SX, w: SX) -> list[SX]:
    """Return the velocities of the coordinates of a cut joint.

    Args:
        cut: cut joint.
        pose: pose of frame_b relative to frame_a.
        V: (3, 1) velocity of frame_b relative to frame_a, in the axes of frame_a.
        w: (3, 1) angular velocity of frame_b relative to frame_a, in the axes of frame_a.
    """
    joint = cut.edge.joint
    if isinstance(joint, Free):
        return [casadi.mtimes(pose.R.T, V), casadi.mtimes(pose.R.T, w)]
    if isinstance(joint, Spherical):
        return [casadi.mtimes(pose.R.T, w)]
    axes = [SX(DM(list(freedom.axis))) for freedom in joint.freedoms]
    if isinstance(joint, Universal):
        return [casadi.dot(axes[0], w), casadi.dot(casadi.mtimes(pose.R, axes[1]), w)]
    return [
        casadi.dot(axis, V if freedom.motion is Motion.PRISMATIC else w)
        for axis, freedom in zip(axes, joint.freedoms, strict=True)
    ]


def _rate(system: System, matrix: SX, q: SX, v: SX) -> SX:
    """Return the time derivative of a matrix that depends on q, for tree velocities v."""
    rate = casadi.jtimes(casadi.vec(matrix), q, position_rate(system.tree, q, v))
    return casadi.reshape(rate, *matrix.shape)


# Coordinates of cut joints, which are not in q, and their rates.


def cut_coordinate(system: System, s: ModelSymbols, a: SX, name: str) -> tuple[SX, SX, SX]:
    """Return position, velocity and acceleration of a coordinate of a cut joint.

    Angles are between -pi and pi.

    Args:
        system: closed mechanism.
        s: symbols of the system; the positions must close the loops.
        a: (nv, 1) accelerations of the tree.
        name: name of a displacement or angle in `system.cut_coordinates`.
    """
    row = next(row for row in system.cut_coordinates if row.name == name)
    cut = next(cut for cut in system.cuts if cut.edge.joint.name == row.joint)
    freedoms = cut.edge.joint.freedoms
    number = [freedom.coordinate_of(row.joint) for freedom in freedoms].index(name)
    pose = relative_pose(system.tree, s.q, *cut.frames)
    C = cut_velocities(system, s.q, cut)[number, :]
    speed = SX.sym("v", system.nv)
    bias = casadi.substitute(acceleration_bias(system, s.q, speed, C), speed, s.v_tree)
    value = cut_position(cut, number, pose)
    return value, casadi.mtimes(C, s.v_tree), casadi.mtimes(C, a) + bias
