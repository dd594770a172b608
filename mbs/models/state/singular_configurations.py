"""Functions for steps through singular configurations of the loops, in local tangent coordinates.

At a singular configuration the independent constraint rows become dependent. The steps use all
rows of the loops, because the rows that are independent in the assembled configuration may become
dependent later. The rank is that of the assembly, not from a threshold.

Notation: constraints g(q) = 0 on positions, J v = b on velocities and J a = c on accelerations.
J maps v to dg/dt, except for terms of time.

Source: Hairer and Wanner 1996, section VII.1, for the constraints of index 3, 2 and 1; Hairer,
Lubich and Wanner 2006, IV.5.3, for local tangent coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.tree import norm_rows, position_rate
from mbs.loops.closure_equations import closure_rows
from mbs.loops.velocity import (
    acceleration_bias,
    constraint_rows,
    independent_constraint_rows,
    kept_rows,
    scales,
)
from mbs.models._direct_dynamics import inertia_matrix
from mbs.models._inverse_dynamics import bias
from mbs.models.contacts import ContactEquations
from mbs.models.state.arguments import StateArguments
from mbs.models.state.signals import Prescribed
from mbs.models.symbols import outputs_of
from mbs.solvers.problem import Passage

_DENSE_SIZE = 100
"""Largest number of elements of an output whose zeros are stored. Each zero is a line of C code,
and the compile time grows more than linearly. Steps in tangent coordinates skip zeros."""


class ConstraintGroup(NamedTuple):
    """Constraints g = 0, J v = b and J a = c of loops, prescribed motions or contacts.

    Attributes:
        g: (m, 1) residuals of the position constraints.
        J: (m, nv) Jacobian with respect to the velocities.
        b: (m, 1) right-hand side on velocities.
        c: (m, 1) right-hand side on accelerations.
    """

    g: SX
    J: SX
    b: SX
    c: SX


def passage(
    system: System,
    arguments: StateArguments,
    tau: SX,
    rates: SX,
    motions: Sequence[Prescribed] = (),
    contact: ContactEquations | None = None,
) -> Passage | None:
    """Return the functions for steps through singular configurations of the loops, or None.

    None for open chains and for nonholonomic constraints. While a contact sticks on a velocity
    without a corresponding position, every configuration counts as regular.

    Args:
        system: open or closed system.
        arguments: arguments of the functions, with the state x = [q; v; z].
        tau: (nv, 1) joint efforts, without prescribed motions and contacts.
        rates: (nz, 1) rates of the states z of components.
        motions: coordinates with prescribed motions.
        contact: equations of rigid stops and Coulomb friction, or None.
    """
    if system.closure is None or system.closure.slips:
        return None
    if any(motion.position is None for motion in motions):
        return None
    t, x, *_ = arguments.point
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    loops = _loop_group(system, q, v)
    if loops is None:
        return None
    # constraints and their rank
    drives = _drive_group(system, q, motions, t)
    contacts = _contact_group(system, q, v, contact)
    rank = len(system.closure.rows) + len(motions) + _contact_rank(contact)
    constraints = _stacked([loops, drives, contacts])
    # values at the state x
    q_now, v_now = x[: system.nq], x[system.nq : system.nq + system.nv]
    rows = list(_passage_rows(system, q, v, constraints, rank))
    rows = casadi.substitute([casadi.densify(row) for row in rows], [q, v], [q_now, v_now])
    efforts = _with_sliding_friction(tau, contact)
    forces = [*_inertia_and_forces(system, q_now, v_now, efforts), rates]
    # distance from singular configurations
    measure = _regularity(system, q, drives.J)
    typical = _typical_regularity(system, q, measure)
    regularity = casadi.substitute(measure, q, q_now)
    if contact is not None:
        regularity = _regular_while_sticking(contact, regularity, typical)
    return Passage(
        rows=_function_with_sparse_outputs("rows", arguments, rows),
        forces=_function_with_sparse_outputs("forces", arguments, forces),
        regularity=arguments.function("regularity", [regularity]),
        size=(
            system.nq,
            system.nv,
            rates.numel(),
            rows[0].numel(),
            contacts.g.numel(),
            constraints.J.shape[0],
            int(bool(motions)),
        ),
        typical=typical,
    )


def without_passages(system: System, arguments: StateArguments) -> Passage:
    """Return placeholder functions without constraints; every configuration counts as regular.

    Args:
        system: open or closed system.
        arguments: arguments of the functions.
    """
    nq, nv, nz = system.nq, system.nv, system.component_states.numel()
    wide = nq > nv  # the system has unit quaternions
    rows = PassageRows(
        position=SX(0, 1),
        slope=SX(0, nq),
        J=SX(0, nv),
        b=SX(0, 1),
        c=SX(0, 1),
        N=SX.zeros(nq, nv) if wide else SX(0, nv),
        bend=SX.zeros(nq) if wide else SX(0, 1),
        rank=SX(0),
    )
    forces = [SX.zeros(nv, nv), SX.zeros(nv), SX.zeros(nz)]
    return Passage(
        rows=arguments.function("rows", list(rows)),
        forces=arguments.function("forces", forces),
        regularity=arguments.function("regularity", [SX(1)]),
        size=(nq, nv, nz, 0, 0, 0, 0),
        typical=1.0,
    )


# Constraints of loops, prescribed motions and contacts.


def _loop_group(system: System, q: SX, v: SX) -> ConstraintGroup | None:
    """Return the scaled rows of the loops, or None if no row depends on the velocities."""
    J = casadi.sparsify(constraint_rows(system, q))
    moving = sorted(set(J.sparsity().row()))  # structurally zero rows are dropped
    if not moving:
        return None
    J = J[moving, :]
    scale = DM(scales(system).rows[moving])
    return ConstraintGroup(
        g=scale * closure_rows(system, q)[moving],
        J=casadi.mtimes(casadi.diag(scale), J),
        b=SX.zeros(len(moving)),
        c=-scale * acceleration_bias(system, q, v, J),
    )


def _drive_group(system: System, q: SX, motions: Sequence[Prescribed], t: SX) -> ConstraintGroup:
    """Return the constraints of prescribed motions, whose positions are all prescribed."""
    laws = [motion.law(t, system.component_states, system.p) for motion in motions]
    positions = [motion.position for motion in motions if motion.position is not None]
    errors = [q[k] - q_p for k, (q_p, _, _) in zip(positions, laws, strict=True)]
    return ConstraintGroup(
        g=casadi.vertcat(SX(0, 1), *errors),
        J=SX(DM.eye(system.nv))[[motion.velocity for motion in motions], :],
        b=casadi.vertcat(SX(0, 1), *(v_p for _, v_p, _ in laws)),
        c=casadi.vertcat(SX(0, 1), *(a_p for _, _, a_p in laws)),
    )


def _contact_group(
    system: System, q: SX, v: SX, contact: ContactEquations | None
) -> ConstraintGroup:
    """Return the constraints of the holonomic contacts; the rows of a free contact are zero."""
    if contact is None:
        return ConstraintGroup(SX(0, 1), SX(0, system.nv), SX(0, 1), SX(0, 1))
    contacts, holonomic = contact.contacts, _holonomic(contact)
    stuck, count = contact.modes.stuck[holonomic], len(holonomic)
    positions = [x for x in contacts.anchors if x is not None]
    own = [contacts.state.rows[holonomic, :], contacts.state.bias[holonomic], *positions]
    J, psi, *positions = casadi.substitute(own, [contacts.q, contacts.v], [q, v])
    return ConstraintGroup(
        g=casadi.vertcat(SX(0, 1), *(stuck[j] * x for j, x in enumerate(positions))),
        J=casadi.mtimes(casadi.diag(stuck), J),
        b=SX.zeros(count),
        c=-stuck * psi,
    )


def _holonomic(contact: ContactEquations) -> list[int]:
    """Return the indices of the contacts whose velocity is the rate of a known position."""
    return [j for j, position in enumerate(contact.contacts.anchors) if position is not None]


def _contact_rank(contact: ContactEquations | None) -> SX | int:
    """Return the number of stuck holonomic contacts, equal rows counted once."""
    if contact is None:
        return 0
    holonomic, groups = _holonomic(contact), contact.contacts.groups
    kept = dict.fromkeys(groups[j] for j in holonomic)
    same = [[j for j in holonomic if groups[j] == k] for k in kept]
    return sum((casadi.mmax(contact.modes.stuck[rows]) for rows in same), SX(0))


# Rows, forces and regularity, as `Passage` requires them.


class PassageRows(NamedTuple):
    """Outputs of `Passage.rows`, in order.

    Attributes:
        position: (m, 1) residuals of the position constraints, with the norms of quaternions.
        slope: (m, nq) derivatives of `position` by q.
        J: (r, nv) Jacobian; empty without quaternions, where `slope` starts with the same rows.
        b: (r, 1) right-hand side on velocities.
        c: (r, 1) right-hand side on accelerations.
        N: (nq, nv) matrix of q' = N v; empty without quaternions.
        bend: (nq, 1) quadratic velocity terms of q'' = N a + bend; empty without quaternions.
        rank: rank of J.
    """

    position: SX
    slope: SX
    J: SX
    b: SX
    c: SX
    N: SX
    bend: SX
    rank: SX


def _passage_rows(
    system: System, q: SX, v: SX, constraints: ConstraintGroup, rank: SX | int
) -> PassageRows:
    """Return the rows of all constraints at the symbols q and v."""
    position = casadi.vertcat(constraints.g, norm_rows(system.tree, q))
    slope = casadi.jacobian(position, q)
    J, N, bend = SX(0, system.nv), SX(0, system.nv), SX(0, 1)
    if system.nq > system.nv:  # quaternions; otherwise q' = v, and J equals rows of `slope`
        rate = position_rate(system.tree, q, v)
        J, N, bend = constraints.J, casadi.jacobian(rate, v), casadi.jtimes(rate, q, rate)
    return PassageRows(position, slope, J, constraints.b, constraints.c, N, bend, SX(rank))


def _stacked(groups: Sequence[ConstraintGroup]) -> ConstraintGroup:
    """Return the constraints of all groups as one group."""
    return ConstraintGroup(*(casadi.vertcat(*parts) for parts in zip(*groups, strict=True)))


def _with_sliding_friction(tau: SX, contact: ContactEquations | None) -> SX:
    """Return joint efforts (nv, 1) that include the Coulomb friction of sliding contacts."""
    if contact is None:
        return tau
    return tau - casadi.mtimes(contact.state.rows.T, contact.modes.slide * contact.state.sliding)


def _inertia_and_forces(system: System, q: SX, v: SX, tau: SX) -> tuple[SX, SX]:
    """Return M (nv, nv) and f (nv, 1) of the equations of motion M a = f + J' y."""
    (M,) = outputs_of(system, inertia_matrix(system, "tree"), q)
    (H,) = outputs_of(system, bias(system, "tree"), q, v)
    return M, tau - H


def _regularity(system: System, q: SX, drives: SX) -> SX:
    """Return the smallest sine between a kept constraint row and the span of the rows before.

    The measure is zero at a singular configuration, and linear in the path nearby.

    Args:
        system: closed system.
        q: (nq, 1) symbols of the positions.
        drives: (m, nv) rows of the prescribed motions.
    """
    found = scales(system)
    columns = DM(found.columns([speed.unit for speed in system.velocity_coordinates]))
    J = casadi.vertcat(
        DM(found.rows[kept_rows(system)]) * independent_constraint_rows(system, q), drives
    )
    if J.shape[0] == 0:  # no independent constraint
        return SX(1)
    B = casadi.mtimes(J, casadi.diag(columns))
    squares = casadi.fmax(casadi.sum2(B * B), 1)  # a single row may become zero as well
    D, _, order = casadi.ldl(casadi.sparsify(casadi.mtimes(B, B.T)))
    return casadi.sqrt(casadi.fmax(casadi.mmin(D / squares[order]), 0))


def _typical_regularity(system: System, q: SX, measure: SX) -> float:
    """Return the regularity at the assembled configuration, 0 if parameters have no value."""
    found = Function("typical", [q, system.p], [measure])
    value = float(found(np.array(system.configuration), system.p_default))
    return value if np.isfinite(value) else 0.0


def _regular_while_sticking(contact: ContactEquations, regularity: SX, typical: float) -> SX:
    """Return a regularity that is large while a nonholonomic contact sticks.

    Such a contact has no position row, so that steps in local tangent coordinates are impossible.
    """
    anchors = contact.contacts.anchors
    nonholonomic = [j for j, position in enumerate(anchors) if position is None]
    if not nonholonomic:
        return regularity
    sticks = casadi.mmax(contact.modes.stuck[nonholonomic])
    return casadi.if_else(sticks, max(typical, 1.0), regularity)


def _function_with_sparse_outputs(
    name: str, arguments: StateArguments, outputs: Sequence[SX]
) -> Function:
    """Return a Function with dense outputs, except for large outputs that are mostly zero."""
    values = [casadi.densify(value) for value in arguments.values(outputs)]
    for k, value in enumerate(values):
        few = casadi.sparsify(value)
        if value.numel() > _DENSE_SIZE and 2 * few.nnz() < value.numel():
            values[k] = few
    return Function(name, arguments.symbols, values, {"cse": True})
