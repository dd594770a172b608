"""Accelerations of the tree where loops, and motions that are prescribed, constrain them."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
from casadi import DM, SX

from mbs.assembly import System
from mbs.loops.velocity import acceleration_bias, independent_constraint_rows
from mbs.models.inverse_dynamics import tree_efforts
from mbs.models.surroundings import Surroundings
from mbs.models.symbols import ModelSymbols
from mbs.recursions.composite_body import inertia_matrix
from mbs.solvers.saddle import solve_saddle


def constrained_accelerations(
    system: System,
    s: ModelSymbols,
    tau: SX,
    around: Surroundings,
    prescribed: Sequence[int] = (),
    a_p: SX | None = None,
) -> tuple[SX, SX, SX]:
    """Accelerations of the tree, and the efforts of what constrains them; massless links may be.

    A a + H = tau + J' lam + E' tau_p with J a + psi = 0 and E a = a_p, where the rows of E are
    those of the unit matrix.

    Args:
        system: open or closed.
        s: its symbols, in tree coordinates.
        tau: (nv, 1) joint efforts.
        around: what acts from outside.
        prescribed: numbers of the velocities whose accelerations are given.
        a_p: (k, 1) these accelerations.

    Returns:
        a (nv, 1), lam (r, 1) of the independent closure rows, and tau_p (k, 1).
    """
    A = inertia_matrix(system.tree, s.poses)
    H = tree_efforts(system, s, SX.zeros(system.nv), around)
    J, psi = _loop_rows(system, s)
    E = SX(DM.eye(system.nv))[list(prescribed), :]
    given = SX(0, 1) if a_p is None else a_p
    rows, right = casadi.vertcat(J, E), casadi.vertcat(-psi, given)
    a, efforts = solve_saddle(A, rows, tau - H, right, _size(system, A, s))
    r = J.shape[0]
    return a, efforts[:r], efforts[r:]


def _loop_rows(system: System, s: ModelSymbols) -> tuple[SX, SX]:
    if not system.is_closed:
        return SX(0, system.nv), SX(0, 1)
    J = independent_constraint_rows(system, s.q)
    return J, acceleration_bias(system, s.q, s.v, J)


def _size(system: System, A: SX, s: ModelSymbols) -> float:
    """The mean diagonal element of A at the assembled posture; 1 where symbols have no value."""
    if any(p.default is None for p in system.parameters):
        return 1.0
    trace = casadi.Function("trace", [s.q, system.p], [casadi.trace(A)])
    value = float(trace(np.array(system.posture), system.p_default))
    return max(value, 1e-6) / system.nv
