"""Accelerations of the tree under constraints by loops and prescribed motions."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import Link
from mbs.components.joints import Motion
from mbs.loops.velocity import (
    acceleration_bias,
    independent_constraint_rows,
    independent_drift,
)
from mbs.models._inverse_dynamics import tree_efforts
from mbs.models.symbols import ExternalForces, ModelSymbols
from mbs.recursions.composite_body import inertia_matrix
from mbs.solvers.linear import solve_saddle

_ROUNDING = 1e-9
"""Negative moment of inertia, relative to the largest, that counts as zero: rounding of the moment
about a thin rod, from parameters with nine digits or more."""


def constrained_accelerations(
    system: System,
    s: ModelSymbols,
    tau: SX,
    around: ExternalForces,
    prescribed: Sequence[int] | SX = (),
    a_p: SX | None = None,
    acting: SX | None = None,
) -> tuple[SX, SX, SX]:
    """Return the accelerations of the tree and the efforts of its constraints.

    Links may be massless.

    Solves A a + H = tau + J' lam + E' tau_p with J a + psi = 0 and E a = a_p.

    Args:
        system: open or closed mechanism.
        s: symbols of the system, in tree coordinates.
        tau: (nv, 1) joint efforts.
        around: base motion and external wrenches.
        prescribed: indices of the velocities with prescribed acceleration, or the rows E (k, nv).
        a_p: (k, 1) prescribed accelerations.
        acting: (k, 1) 1 if a row of E acts, 0 if it is released and its effort is zero. By default
            all rows act.

    Returns:
        a (nv, 1), lam (r, 1) of the independent closure rows, and tau_p (k, 1).
    """
    A = inertia_matrix(system.tree, s.poses)
    H = tree_efforts(system, s, SX.zeros(system.nv), around)
    J, psi = loop_rows(system, s)
    given = SX(0, 1) if a_p is None else a_p
    E = prescribed if isinstance(prescribed, SX) else unit_rows(system, prescribed)
    return constrained(system, s, (A, J, E), (tau - H, -psi, given), acting)


def unit_rows(system: System, numbers: Sequence[int]) -> SX:
    """Return rows (k, nv) of the identity matrix.

    Args:
        system: open or closed mechanism.
        numbers: k indices in v.
    """
    return SX(DM.eye(system.nv))[list(numbers), :]


def constrained(
    system: System,
    s: ModelSymbols,
    left: tuple[SX, SX, SX],
    right: tuple[SX, SX, SX],
    acting: SX | None,
) -> tuple[SX, SX, SX]:
    """Return the solution (x, y, z) of A x = b + J' y + E' z, J x = d, E x = e.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        left: mass matrix A (nv, nv) of the tree, independent rows J (r, nv), rows E (k, nv).
        right: b (nv, 1), d (r, 1) and e (k, 1).
        acting: (k, 1) 1 if a row of E acts, 0 if it is released and its z is zero. None if all rows
            act.
    """
    (A, J, E), (b, d, e) = left, right
    size, r = inertia_size(system, A, s), J.shape[0]
    corner = None
    if acting is not None:
        E, e = casadi.mtimes(casadi.diag(acting), E), acting * e
        corner = casadi.vertcat(SX(r, 1), casadi.densify(1 - acting) / size)
    rows, given = casadi.vertcat(J, E), casadi.vertcat(d, e)
    penalty = 0.0 if every_velocity_moves_its_link(system) else size
    x, efforts = solve_saddle(A, rows, b, given, size, corner, penalty)
    return x, efforts[:r], efforts[r:]


def loop_rows(system: System, s: ModelSymbols) -> tuple[SX, SX]:
    """Return Jacobian J (r, nv) and bias psi (r, 1) of the closure rows J a + psi = 0.

    Only independent rows are included. Both have no rows for an open system.

    Args:
        system: open or closed mechanism.
        s: symbols of the system, in tree coordinates.
    """
    if not system.is_closed:
        return SX(0, system.nv), SX(0, 1)
    J = independent_constraint_rows(system, s.q)
    return J, acceleration_bias(system, s.q, s.v, J, independent_drift(system, s.q))


def inertia_size(system: System, A: SX, s: ModelSymbols) -> float:
    """Return the mean diagonal element of A in the assembled configuration.

    It is 1 if a symbol has no default, or the mean is not positive.

    Args:
        system: open or closed mechanism.
        A: (nv, nv) inertia matrix of the tree.
        s: symbols of the system.
    """
    if any(p.default is None for p in system.parameters):
        return 1.0
    trace = casadi.Function("trace", [s.q, system.p], [casadi.trace(A)])
    value = float(trace(np.array(system.configuration), system.p_default))
    return value / system.nv if value > 0 else 1.0


def every_velocity_moves_its_link(system: System) -> bool:
    """Return whether the inertia matrix of the tree is known to be positive definite everywhere.

    Sufficient condition: each link has a physical inertia (not grouped base parameters) and its own
    positive inertia against the velocity of its joint. Descendants only increase the pivots.

    Args:
        system: open or closed mechanism.
    """

    def check() -> bool:
        own = [casadi.vertcat(*_own_inertia(link)) for link in system.tree.links]
        tensors = [link.inertia.J for link in system.tree.links]
        if casadi.depends_on(casadi.vertcat(*own), system.p):
            return False  # the user may set a parameter to zero
        values = casadi.Function("own", [system.p], [casadi.vertcat(*own), *tensors])
        least, *matrices = (np.array(x) for x in values.call([system.p_default]))
        bodies = all(np.all(np.isfinite(J)) and _is_tensor(J) for J in matrices)
        return bodies and bool(np.all(least > 0))

    regular: bool = system.cached("every velocity moves its link", check)
    return regular


def _is_tensor(J: NDArray[np.float64]) -> bool:
    """Return whether the symmetric matrix J (3, 3) has no negative eigenvalue, up to rounding."""
    values = np.linalg.eigvalsh(J)
    return bool(values[0] >= -_ROUNDING * values[-1])


def _own_inertia(link: Link) -> list[SX]:
    """Return the inertias of a link alone, without descendants, along the velocities of its joint.

    For a spherical joint: leading principal minors of the inertia tensor. Zero for a free joint.
    """
    J, m = link.inertia.J, link.inertia.m
    rotor = SX(0) if link.rotor is None else link.rotor.seen_at_joint
    match link.motion:
        case Motion.REVOLUTE:
            return [link.Ia + rotor + J[2, 2]]
        case Motion.PRISMATIC:
            return [link.Ia + rotor + m]
        case Motion.SPHERICAL:
            return [casadi.det(J[:k, :k]) for k in (1, 2, 3)]
    return [SX(0)]
