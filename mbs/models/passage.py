"""What steps in local tangent coordinates need of a system: all its rows, inertia and forces.

All rows of the loops, dependent ones included, since those that assembling keeps may become
dependent where the others do not; the rank is what assembling found, never a threshold.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.rates import norm_rows, position_rate
from mbs.loops.closure import closure_rows
from mbs.loops.scales import scales
from mbs.loops.velocity import (
    acceleration_bias,
    constraint_rows,
    independent_constraint_rows,
    kept_rows,
)
from mbs.models.composition import dense_function, outputs_of
from mbs.models.contact_dynamics import ContactEquations
from mbs.models.direct_dynamics import inertia_matrix
from mbs.models.inverse_dynamics import bias
from mbs.models.prescribed import Prescribed
from mbs.solvers.passage import Passage


def passage(
    system: System,
    point: tuple[SX, SX, SX],
    tau: SX,
    rates: SX,
    motions: Sequence[Prescribed] = (),
    contact: ContactEquations | None = None,
    inputs: SX | None = None,
) -> Passage | None:
    """The functions of passages; None where nothing is lost, or rows bind velocities alone.

    Args:
        system: open or closed.
        point: t, x = [q; v; z] and p, without modes.
        tau: (nv, 1) joint efforts, those of drives and contacts left out.
        rates: (nz, 1) of z.
        motions: coordinates that drives move along laws.
        contact: what rigid stops and dry friction do.
        inputs: u, where the functions are to take (t, x, z, u, p), z empty.
    """
    closure = system.closure
    if closure is None or closure.slips:
        return None
    driven = [motion.position for motion in motions if motion.position is not None]
    if len(driven) < len(motions):
        return None
    t, x, p = point
    nq, nv = system.nq, system.nv
    q, v = SX.sym("q", nq), SX.sym("v", nv)
    J = casadi.sparsify(constraint_rows(system, q))
    moving = sorted(set(J.sparsity().row()))  # a row that nothing moves says nothing
    J = J[moving, :]
    scale = DM(scales(system).rows[moving])
    bend = acceleration_bias(system, q, v, J)
    loops = (
        scale * closure_rows(system, q)[moving],
        casadi.mtimes(casadi.diag(scale), J),
        -scale * bend,
    )
    count, held = loops[0].numel(), SX(0, 1)
    laws = [motion.law(t) for motion in motions]
    unit = SX(DM.eye(nv))
    drives = [m.velocity for m in motions]
    place = [q[number] - law[0] for number, law in zip(driven, laws, strict=True)]
    braked = SX(tau)
    anchors: list[SX] = []
    E = SX(0, nv)
    if contact is not None:
        modes, contacts = contact.modes, contact.contacts
        held = modes.held
        p = casadi.vertcat(p, contact.values)
        for j, number in enumerate(contacts.velocities):
            braked[number] -= modes.slide[j] * contacts.sliding[j]
            anchors.append(held[j] * q[_position(system, number)])
        E = casadi.mtimes(casadi.diag(held), unit[list(contacts.velocities), :])
    norms = norm_rows(system.tree, q)
    places = casadi.vertcat(loops[0], *place, *anchors, norms)
    speeds = casadi.vertcat(loops[1], unit[drives, :], E)
    still = SX.zeros(len(anchors))
    b = casadi.vertcat(SX.zeros(count), *(law[1] for law in laws), still)
    c = casadi.vertcat(loops[2], *(law[2] for law in laws), still)
    turns = nq > nv  # else N is the unit matrix, and J are the slopes of the places
    rate = position_rate(system.tree, q, v)
    rank = len(closure.rows) + len(motions) + (casadi.sum1(held) if anchors else 0)
    rows = [
        places,
        casadi.jacobian(places, q),
        speeds if turns else SX(0, nv),
        b,
        c,
        casadi.jacobian(rate, v) if turns else SX(0, nv),
        casadi.jtimes(rate, q, rate) if turns else SX(0, 1),
        SX(rank),
    ]
    at = [x[:nq], x[nq : nq + nv]]
    rows = casadi.substitute([casadi.densify(row) for row in rows], [q, v], at)
    (M,) = outputs_of(system, inertia_matrix(system, "tree"), at[0])
    (H,) = outputs_of(system, bias(system, "tree"), *at)
    measure = _regularity(system, q, unit[drives, :])
    regularity = casadi.substitute(measure, q, at[0])
    txp = [t, x, p] if inputs is None else [t, x, SX.sym("z", 0), inputs, p]
    sizes = (nq, nv, rates.numel(), places.numel(), len(anchors))
    return Passage(
        rows=dense_function("rows", txp, rows),
        forces=dense_function("forces", txp, [M, braked - H, rates]),
        regularity=dense_function("regularity", txp, [regularity]),
        size=(*sizes, speeds.shape[0], int(bool(laws))),
        typical=_typical(system, q, measure),
    )


def _position(system: System, number: int) -> int:
    """The number in q of a velocity of a joint with one degree of freedom."""
    link = next(link for link in system.tree.links if link.v.start <= number < link.v.stop)
    return int(link.q.start + number - link.v.start)


def _regularity(system: System, q: SX, drives: SX) -> SX:
    """The smallest sine between a kept row and those before it: near zero, linear in the way."""
    found = scales(system)
    columns = DM(found.columns([speed.unit for speed in system.speeds]))
    J = casadi.vertcat(
        DM(found.rows[kept_rows(system)]) * independent_constraint_rows(system, q), drives
    )
    if J.shape[0] == 0:  # the loops hold nothing
        return SX(1)
    B = casadi.mtimes(J, casadi.diag(columns))
    squares = casadi.fmax(casadi.sum2(B * B), 1)  # a row may also vanish by itself
    D, _, order = casadi.ldl(casadi.sparsify(casadi.mtimes(B, B.T)))
    return casadi.sqrt(casadi.fmax(casadi.mmin(D / squares[order]), 0))


def _typical(system: System, q: SX, measure: SX) -> float:
    """The regularity at the assembled configuration; zero where symbols have no value."""
    found = Function("typical", [q, system.p], [measure])
    value = float(found(np.array(system.posture), system.p_default))
    return value if np.isfinite(value) else 0.0
