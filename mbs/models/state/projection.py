"""Projection of a state of the whole tree onto its constraint manifold.

Positions are projected onto g(q) = 0 and velocities onto J(q) v = b. Each projection is one Newton
step of minimum norm in scaled coordinates, dx = J' (J J')^-1 r.

Source: Hairer and Wanner 1996, section VII.2, for projection methods.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import norm_rows, normalised
from mbs.loops.closing import constraint_sizes, relative_rows
from mbs.loops.closure_equations import independent_closure
from mbs.loops.velocity import (
    independent_constraint_rows,
    independent_drift,
    kept_rows,
    scales,
)
from mbs.models.contacts import ContactEquations
from mbs.models.state.signals import Prescribed
from mbs.solvers.linear import partial_ldl

Array = NDArray[np.float64]

_DEPENDENT = 1e-6
"""Squared sine between a row and the span of the rows before, below which the row is skipped."""
_SKIPPED_WEIGHT = 1e-6
"""Weight of the residual while a row is skipped."""
_CONTACT_REGULARISATION = 1e-4
"""Regularisation that is added to the squares of contact rows, which may depend on other rows.
Convergence is as fast as without it."""
_SKIPPED_PIVOT = 1e300
"""Pivot of a skipped row: division by it makes its correction zero."""


class Projection(NamedTuple):
    """State after one Newton step onto the constraints.

    Attributes:
        q: (nq, 1) positions after the step.
        v: (nv, 1) velocities after the step.
        residual: largest residual before the step, over all rows, with lengths relative to the
            size of the mechanism.
    """

    q: SX
    v: SX
    residual: SX


def project_step(
    system: System,
    q: SX,
    v: SX,
    motions: Sequence[Prescribed],
    t: SX,
    contact: ContactEquations | None = None,
) -> Projection:
    """Project positions and velocities by one Newton step onto the constraints.

    The constraints are loop closure, unit quaternions, prescribed motions and contacts. The step
    uses the independent rows of the loops, because a dependent row is only nearly dependent off
    the loops and would amplify rounding. Near a singular configuration, a row that nearly depends
    on the others is skipped, and the residual is weighted by 1e-6 meanwhile.

    Args:
        system: open or closed system.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
        motions: prescribed motions.
        t: time [s].
        contact: equations of rigid stops and Coulomb friction, or None.
    """
    if not system.is_closed and not motions and contact is None:
        return Projection(normalised(system.tree, q), v, SX(0))
    symbols = SX.sym("q", system.nq)
    loops = _loop_constraints(system, symbols)
    drives = _drive_constraints(system, symbols, motions, t)
    contacts = _contact_constraints(system, symbols, v, contact)
    step_q, g = _position_step(system, symbols, loops, drives, contacts)
    step_v, velocity_residual, is_regular = _velocity_step(system, v, loops, drives, contacts)
    rows = casadi.vertcat(g, velocity_residual)
    residual = casadi.if_else(is_regular, 1, _SKIPPED_WEIGHT) * casadi.mmax(casadi.fabs(rows))
    values = [casadi.densify(step_q), casadi.densify(step_v), residual]
    dq, dv, residual = casadi.substitute(values, [symbols], [q])
    return Projection(q - dq, v - dv, residual)


# Constraints g(q) = 0 and J v = b of loops, prescribed motions and contacts.


class LoopConstraints(NamedTuple):
    """Independent constraints of the loops; without loops all are empty.

    Attributes:
        g: (m, 1) closure rows.
        J: (r, nv) velocity rows: the derivatives of g, then the nonholonomic rows.
        b: (r, 1) right-hand side of J v = b.
        scales: (r,) factors that scale the rows of J to about unit length.
        units: (r, 1) units of the rows of J, of the size of the mechanism [m or 1].
    """

    g: SX
    J: SX
    b: SX
    scales: Array
    units: SX


def _loop_constraints(system: System, q: SX) -> LoopConstraints:
    kept = kept_rows(system)  # empty for an open chain
    row_scales = scales(system).rows[kept]
    if not system.is_closed:
        return LoopConstraints(SX(0, 1), SX(0, system.nv), SX(0, 1), row_scales, SX(0, 1))
    J = independent_constraint_rows(system, q)
    drift = independent_drift(system, q)
    b = SX(J.shape[0], 1) if drift is None else -drift
    units = constraint_sizes(system)[kept, :]  # (0, 1) if no row is kept
    return LoopConstraints(independent_closure(system, q), J, b, row_scales, units)


class DriveConstraints(NamedTuple):
    """Constraints of the prescribed motions.

    Attributes:
        g: (m, 1) differences of the positions from their laws.
        J: (r, nv) unit rows of the prescribed velocities.
        b: (r, 1) prescribed velocities.
    """

    g: SX
    J: SX
    b: SX


def _drive_constraints(
    system: System, q: SX, motions: Sequence[Prescribed], t: SX
) -> DriveConstraints:
    laws = [(motion, *motion.law(t, system.component_states, system.p)) for motion in motions]
    g = [q[m.position] - q_p for m, q_p, _, _ in laws if m.position is not None]
    prescribed = [(m.velocity, v_p) for m, _, v_p, _ in laws if m.holds_speed]
    J = SX(DM.eye(system.nv))[[k for k, _ in prescribed], :]
    b = casadi.vertcat(SX(0, 1), *(v_p for _, v_p in prescribed))
    return DriveConstraints(casadi.vertcat(SX(0, 1), *g), J, b)


class ContactConstraints(NamedTuple):
    """Constraints of k contacts. The rows of an open or sliding contact are zero.

    Attributes:
        gap: (k, 1) distances of closed stops from their limits.
        gap_regularisation: (k, 1) additions to the squared norms of the gap rows.
        slip: (k, 1) velocities of stuck contacts.
        slip_regularisation: (k, 1) additions to the squared norms of the slip rows.
        scales: (k, 1) factors that scale the rows to about unit length.
    """

    gap: SX
    gap_regularisation: SX
    slip: SX
    slip_regularisation: SX
    scales: SX


def _contact_constraints(
    system: System, q: SX, v: SX, contact: ContactEquations | None
) -> ContactConstraints:
    if contact is None:
        return ContactConstraints(SX(0, 1), SX(0, 1), SX(0, 1), SX(0, 1), SX(0, 1))
    contacts, modes = contact.contacts, contact.modes
    row_sizes = np.linalg.norm(contacts.levers * _velocity_scales(system), axis=1)
    return ContactConstraints(
        gap=contacts.distance(q, modes.limit),
        gap_regularisation=_regularisation(modes.limit**2),
        slip=modes.stuck * contacts.velocity(q, v),
        slip_regularisation=_regularisation(modes.stuck),
        scales=SX(DM(1 / row_sizes)),
    )


def _regularisation(acts: SX) -> SX:
    """Return the addition to the squared norms of rows: 1 for an inactive row, which is zero."""
    return casadi.if_else(acts, _CONTACT_REGULARISATION, 1)


# Newton steps of positions and velocities, and residuals of all rows before the step.


def _position_step(
    system: System,
    q: SX,
    loops: LoopConstraints,
    drives: DriveConstraints,
    contacts: ContactConstraints,
) -> tuple[SX, SX]:
    """Return the Newton step (nq, 1) onto g(q) = 0, and the relative residuals of all rows."""
    norms = norm_rows(system.tree, q)
    g = casadi.vertcat(loops.g, norms, drives.g, contacts.gap)
    step, _ = _minimum_norm_step(
        LinearisedConstraints(
            J=casadi.jacobian(g, q),
            residual=g,
            loop_scales=loops.scales[: loops.g.numel()],
            contact_scales=contacts.scales,
            regularisation=contacts.gap_regularisation,
            column_scales=_position_scales(system),
        )
    )
    return step, casadi.vertcat(relative_rows(system, q), drives.g, contacts.gap)


def _velocity_step(
    system: System,
    v: SX,
    loops: LoopConstraints,
    drives: DriveConstraints,
    contacts: ContactConstraints,
) -> tuple[SX, SX, SX]:
    """Return the Newton step (nv, 1) onto J v = b, the relative residuals, and the regularity.

    The regularity is 1 if all rows are independent, and 0 if a row is skipped.
    """
    J = casadi.vertcat(loops.J, drives.J)
    error = casadi.mtimes(J, v) - casadi.vertcat(loops.b, drives.b)
    residual = casadi.vertcat(error, contacts.slip)
    step, is_regular = _minimum_norm_step(
        LinearisedConstraints(
            J=casadi.vertcat(J, casadi.jacobian(contacts.slip, v)),
            residual=residual,
            loop_scales=loops.scales,
            contact_scales=contacts.scales,
            regularisation=contacts.slip_regularisation,
            column_scales=_velocity_scales(system),
        )
    )
    r = loops.units.numel()
    return step, casadi.vertcat(residual[:r, 0] / loops.units, residual[r:, 0]), is_regular


def _position_scales(system: System) -> Array:
    """Return the typical sizes (nq,) of the positions."""
    return scales(system).columns([coordinate.unit for coordinate in system.coordinates])


def _velocity_scales(system: System) -> Array:
    """Return the typical sizes (nv,) of the velocities."""
    return scales(system).columns([speed.unit for speed in system.velocity_coordinates])


class LinearisedConstraints(NamedTuple):
    """Linear equations J dx = residual of a Newton step.

    Order of the rows: loops, rows on one coordinate or one quaternion, contacts.

    Attributes:
        J: (m, n) Jacobian.
        residual: (m, 1) residual.
        loop_scales: scales of the rows of the loops.
        contact_scales: (k, 1) scales of the rows of contacts.
        regularisation: (k, 1) additions to the squared norms of the scaled rows of contacts.
        column_scales: (n,) typical sizes of the elements of dx.
    """

    J: SX
    residual: SX
    loop_scales: Array
    contact_scales: SX
    regularisation: SX
    column_scales: Array

    def row_scales(self) -> Any:
        """Return the factors (m, 1) that scale the rows to about unit length."""
        middle = range(len(self.loop_scales), self.J.shape[0] - self.contact_scales.numel())
        single = (_single_row_scale(self.J[k, :], self.column_scales) for k in middle)
        known = DM([*self.loop_scales, *single])
        return casadi.vertcat(known, self.contact_scales) if self.contact_scales.numel() else known


def _minimum_norm_step(equations: LinearisedConstraints) -> tuple[SX, SX]:
    """Return the dx of minimum norm that solves J dx = r, and whether all rows are independent.

    With the scaled Jacobian B the multipliers solve B B' y = r, and dx = B' y. A row that nearly
    depends on the rows before it is skipped.
    """
    m, n = equations.J.shape
    if m == 0:
        return SX.zeros(n), SX(1)
    rows, columns = equations.row_scales(), DM(equations.column_scales)
    B = rows * casadi.mtimes(equations.J, casadi.diag(columns))
    added = casadi.vertcat(SX(m - equations.regularisation.numel(), 1), equations.regularisation)
    S = casadi.sparsify(casadi.mtimes(B, B.T)) + casadi.diag(added)
    squares = casadi.fmax(casadi.densify(casadi.diag(S)), 1)
    D, LT, order, is_independent = partial_ldl(S, _DEPENDENT * squares)
    pivots = casadi.if_else(is_independent, D, _SKIPPED_PIVOT)
    multipliers = casadi.ldl_solve(rows * equations.residual, pivots, LT, order)
    step = columns * casadi.mtimes(B.T, casadi.densify(multipliers))
    return step, casadi.mmin(is_independent)


def _single_row_scale(row: SX, columns: Array) -> float:
    """Return the scale of a row on one coordinate or on one quaternion."""
    columns_of_row = casadi.sparsify(row).sparsity().get_triplet()[1]
    return 1 / float(columns[columns_of_row[0]]) if columns_of_row else 1.0
