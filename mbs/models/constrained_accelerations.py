"""Accelerations of the tree where loops, and motions that are prescribed, constrain them."""

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
from mbs.models.inverse_dynamics import tree_efforts
from mbs.models.symbols import ModelSymbols, Surroundings
from mbs.recursions.composite_body import inertia_matrix
from mbs.solvers.linear import solve_saddle

_ROUNDING = 1e-9
"""A moment of inertia negative by this part of the largest counts as zero: that of a thin rod, from
parameters with nine digits and more."""


def constrained_accelerations(
    system: System,
    s: ModelSymbols,
    tau: SX,
    around: Surroundings,
    prescribed: Sequence[int] | SX = (),
    a_p: SX | None = None,
    acting: SX | None = None,
) -> tuple[SX, SX, SX]:
    """Accelerations of the tree, and the efforts of what constrains them; links may be massless.

    A a + H = tau + J' lam + E' tau_p with J a + psi = 0 and E a = a_p.

    Args:
        system: open or closed.
        s: its symbols, in tree coordinates.
        tau: (nv, 1) joint efforts.
        around: what acts from outside.
        prescribed: indices of the velocities whose accelerations are given, or the rows E (k, nv).
        a_p: (k, 1) these accelerations.
        acting: (k, 1) 1 where an acceleration is given, 0 where it is free after all and the
            effort is zero; all are given when left out.

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
    """(k, nv) rows of the unit matrix, by indices of velocities."""
    return SX(DM.eye(system.nv))[list(numbers), :]


def constrained(
    system: System,
    s: ModelSymbols,
    left: tuple[SX, SX, SX],
    right: tuple[SX, SX, SX],
    acting: SX | None,
) -> tuple[SX, SX, SX]:
    """The x, y and z of A x = b + J' y + E' z, J x = d, E x = e where it acts.

    Args:
        system: open or closed.
        s: its symbols.
        left: A (nv, nv) inertia matrix of the tree, J (r, nv) independent rows, E (k, nv) rows.
        right: b, d and e.
        acting: as of `constrained_accelerations`.
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
    """J (r, nv) and psi (r, 1) of the independent rows."""
    if not system.is_closed:
        return SX(0, system.nv), SX(0, 1)
    J = independent_constraint_rows(system, s.q)
    return J, acceleration_bias(system, s.q, s.v, J, independent_drift(system, s.q))


def inertia_size(system: System, A: SX, s: ModelSymbols) -> float:
    """The mean diagonal element of A as assembled; 1 where symbols have no value."""
    if any(p.default is None for p in system.parameters):
        return 1.0
    trace = casadi.Function("trace", [s.q, system.p], [casadi.trace(A)])
    value = float(trace(np.array(system.configuration), system.p_default))
    return value / system.nv if value > 0 else 1.0


def every_velocity_moves_its_link(system: System) -> bool:
    """Whether the inertia matrix of the tree is known to be positive definite everywhere.

    It is where every link is a body, not one of grouped parameters, with inertia of its own
    against the velocity of its joint: what the links behind it add to a pivot is never negative.
    """

    def check() -> bool:
        own = [casadi.vertcat(*_own_inertia(link)) for link in system.tree.links]
        tensors = [link.inertia.J for link in system.tree.links]
        if casadi.depends_on(casadi.vertcat(*own), system.p):
            return False  # a parameter may be set to zero
        values = casadi.Function("own", [system.p], [casadi.vertcat(*own), *tensors])
        least, *matrices = (np.array(x) for x in values.call([system.p_default]))
        bodies = all(np.all(np.isfinite(J)) and _is_tensor(J) for J in matrices)
        return bodies and bool(np.all(least > 0))

    regular: bool = system.cached("every velocity moves its link", check)
    return regular


def _is_tensor(J: NDArray[np.float64]) -> bool:
    values = np.linalg.eigvalsh(J)
    return bool(values[0] >= -_ROUNDING * values[-1])


def _own_inertia(link: Link) -> list[SX]:
    """What a link has against each of its velocities, itself alone."""
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
