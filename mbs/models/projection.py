"""One Newton step of a state of the whole tree onto all that constrains it."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.rates import norm_rows, normalised
from mbs.loops.closure import independent_closure
from mbs.loops.scales import scales
from mbs.loops.sizes import constraint_sizes, relative_rows
from mbs.loops.velocity import independent_constraint_rows, kept_rows
from mbs.models.contacts import Contacts, Modes
from mbs.models.prescribed import Prescribed
from mbs.solvers.partial_ldl import partial_ldl

Array = NDArray[np.float64]

_NEARLY_DEPENDENT = 1e-6
"""Squared sine between a row and the rows before it below which it is left alone."""
_ASLEEP = 1e-6
"""What rows count in that case."""
_SHARED = 1e-4
"""Square that is added to rows of contacts, which may depend on others: they converge as fast."""
_NEVER = 1e300


def projected(
    system: System,
    q: SX,
    v: SX,
    motions: Sequence[Prescribed],
    t: SX,
    touch: tuple[Contacts, Modes] | None = None,
) -> tuple[SX, SX, SX]:
    """Positions and velocities one Newton step closer, and the largest row before the step.

    The step is made on the independent rows of the loops: off the loops a dependent row is
    almost, not exactly, dependent, and would turn rounding into motion. Close to a singular
    posture the same holds for a row that the others nearly imply there: it is left alone, and
    rows count little for as long. The largest row is that of all, dependent ones included.

    Args:
        system: open or closed.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
        motions: what is prescribed.
        t: time [s].
        touch: contacts and what they do; none when left out.

    Returns:
        q (nq, 1), v (nv, 1), and the largest row, lengths as parts of the size of the mechanism.
    """
    if not system.is_closed and not motions and touch is None:
        return normalised(system.tree, q), v, SX(0)
    symbols = SX.sym("q", system.nq)
    norms = norm_rows(system.tree, symbols)
    laws = [motion.law(t) for motion in motions]
    places = [
        symbols[motion.position] - law[0]
        for motion, law in zip(motions, laws, strict=True)
        if motion.position is not None
    ]
    loops, measures = SX(0, 1), SX(0, 1)
    J = SX(0, system.nv)
    if system.is_closed:
        loops = independent_closure(system, symbols)
        measures = constraint_sizes(system)[kept_rows(system)]
        J = independent_constraint_rows(system, symbols)
    distance, place_off, still, slide_off = _touched(system, symbols, v, touch)
    r = casadi.vertcat(loops, norms, *places, distance)
    J_q = casadi.jacobian(r, symbols)
    held = [(m.velocity, law[1]) for m, law in zip(motions, laws, strict=True) if m.holds_speed]
    E = SX(DM.eye(system.nv))[[k for k, _ in held], :]
    J = casadi.vertcat(J, E)
    wanted = casadi.vertcat(SX(J.shape[0] - len(held), 1), *(speed for _, speed in held))
    J = casadi.vertcat(J, casadi.jacobian(still, v))
    speed = casadi.vertcat(casadi.mtimes(J[: wanted.numel(), :], v) - wanted, still)
    found = scales(system)
    first = found.rows[kept_rows(system)]
    places_of, speeds_of = (
        found.columns([row.unit for row in table]) for table in (system.coordinates, system.speeds)
    )
    step_q, _ = _shortest(J_q, r, place_off, first[: loops.numel()], places_of)
    step_v, awake = _shortest(J, speed, slide_off, first, speeds_of)
    relative = casadi.vertcat(speed[: measures.numel(), 0] / measures, speed[measures.numel() :, 0])
    rows = casadi.vertcat(relative_rows(system, symbols), *places, distance, relative)
    residual = casadi.if_else(awake, 1, _ASLEEP) * casadi.mmax(casadi.fabs(rows))
    values = casadi.substitute([*map(casadi.densify, (step_q, step_v)), residual], [symbols], [q])
    return q - values[0], v - values[1], values[2]


def _touched(
    system: System, q: SX, v: SX, touch: tuple[Contacts, Modes] | None
) -> tuple[SX, SX, SX, SX]:
    """Rows of positions at stops, then of velocities that are held; each with its `_switched`."""
    if touch is None:
        return SX(0, 1), SX(0, 1), SX(0, 1), SX(0, 1)
    contacts, modes = touch
    return (
        contacts.distance(q, modes.place),
        _switched(modes.place**2),
        modes.held * contacts.velocity(v),
        _switched(modes.held),
    )


def _switched(acting: SX) -> SX:
    """What stands in for the squares of rows that vanish when they do not act."""
    return casadi.if_else(acting, _SHARED, 1)


def _shortest(J: SX, r: SX, off: SX, first: Array, columns: Array) -> tuple[SX, SX]:
    """A short step x with J x = r, by rows that are not nearly dependent, and whether all are.

    Args:
        J: rows of loops, then rows on one coordinate each; the last ones are switched.
        r: what the rows are to become.
        off: what is added to the squares of the switched rows.
        first: scales of the rows of the loops; other rows are of unit length.
        columns: scales of the columns.
    """
    if J.shape[0] == 0:
        return SX.zeros(J.shape[1]), SX(1)
    rows = DM([*first, *(_unit(J[k, :], columns) for k in range(len(first), J.shape[0]))])
    B = rows * casadi.mtimes(J, casadi.diag(DM(columns)))
    every = casadi.vertcat(SX(J.shape[0] - off.numel(), 1), off)
    S = casadi.sparsify(casadi.mtimes(B, B.T)) + casadi.diag(every)
    squares = casadi.fmax(casadi.densify(casadi.diag(S)), 1)
    D, LT, order, independent = partial_ldl(S, _NEARLY_DEPENDENT * squares)
    x = casadi.ldl_solve(rows * r, casadi.if_else(independent, D, _NEVER), LT, order)
    return DM(columns) * casadi.mtimes(B.T, casadi.densify(x)), casadi.mmin(independent)


def _unit(row: SX, columns: Array) -> float:
    """The scale of a row on one coordinate, or on a quaternion."""
    places = casadi.sparsify(row).sparsity().get_triplet()[1]
    return 1 / float(columns[places[0]]) if places else 1.0
