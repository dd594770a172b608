"""The state equation of the whole tree, with a projection that keeps its loops closed.

Every position and velocity of the tree is a state: the motion runs through postures where no
choice of independent joints would hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.rates import position_rate, quaternion_slices
from mbs.loops.closure import closure_rows
from mbs.models.composition import dense_function, outputs_of
from mbs.models.contact_dynamics import ContactEquations, contact_equations
from mbs.models.devices import device_equations, state_count
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.energy import energy
from mbs.models.hybrid_dynamics import hybrid_dynamics
from mbs.models.impacts import tree_jump
from mbs.models.passage import passage
from mbs.models.prescribed import Prescribed
from mbs.models.projection import projected
from mbs.solvers.passage import Passage


@dataclass(frozen=True, slots=True, eq=False)
class FullState:
    """State x = [q; v; z] of the whole tree and of the devices that drive its shafts.

    Attributes:
        rhs: `rhs(t, x, p) -> xdot`.
        project: `project(t, x, p) -> (x, residual)`, one Newton step onto loops, unit quaternions
            and prescribed motions, None where there is nothing to keep.
        observe: `observe(t, x, p) -> a, tau, u, y, held, E, U, openness`, what a result shows
            beside x: u and y are inputs and outputs of the devices, `held` the efforts of rigid
            stops and of dry friction, the last is the largest closure row.
        events: `indicators(t, x, p) -> g` and `jump(t, x, p, fired) -> (x, modes)` of rigid stops
            and dry friction, whose modes are then the last of p; None where there are none.
        passage: for steps through singular configurations of the loops; None where there are none.
    """

    rhs: Function
    project: Function | None
    observe: Function
    events: tuple[Function, Function] | None = None
    passage: Passage | None = None


def full_state(
    system: System,
    effort: Function | None = None,
    inputs: Function | None = None,
    motions: Sequence[Prescribed] = (),
) -> FullState:
    """The state equation of the whole tree under given joint efforts and inputs of devices.

    Args:
        system: open or closed.
        effort: `effort(t, q, v, p) -> tau`, (nv, 1), beside what devices deliver; no effort when
            left out.
        inputs: `inputs(t, q, v, p) -> u`, (nu, 1), one for each device; zeros when left out.
        motions: coordinates that drives move along laws; their efforts are added to tau.
    """
    nq, n = system.nq, system.nq + system.nv
    t, x = SX.sym("t"), SX.sym("x", n + state_count(system))
    q, v, z, p = x[:nq], x[nq:n], x[n:], system.p
    tau = SX.zeros(system.nv) if effort is None else casadi.densify(effort(t, q, v, p))
    u = SX.zeros(len(system.devices)) if inputs is None else SX(inputs(t, q, v, p))
    delivered, z_rate, y = device_equations(system, v, z, u)
    tau += delivered
    given = SX(tau)
    contact = contact_equations(
        system, q, v, tau, {motion.velocity: motion.law(t)[2] for motion in motions}
    )
    a, tau = (contact.a, contact.tau) if contact else _accelerations(system, q, v, tau, motions, t)
    rate = casadi.vertcat(position_rate(system.tree, q, v), a, z_rate)
    through = passage(system, (t, x, p), given, z_rate, motions, contact)
    touch = (contact.contacts, contact.modes) if contact else None
    *kept, residual = projected(system, q, v, motions, t, touch)
    rows = closure_rows(system, q)
    openness = casadi.mmax(casadi.fabs(rows)) if rows.numel() else SX(0)
    E, U = outputs_of(system, energy(system, "tree"), q, v)
    held = contact.efforts if contact else SX(0, 1)
    observed = [a, tau, u, y, held, E, U, openness]
    keeps = system.is_closed or motions or touch or quaternion_slices(system.tree)
    moved = [casadi.vertcat(*kept, z), residual]
    p = casadi.vertcat(p, contact.values) if contact else p
    return FullState(
        rhs=dense_function("rhs", [t, x, p], [rate]),
        project=dense_function("project", [t, x, p], moved) if keeps else None,
        observe=dense_function("observe", [t, x, p], observed),
        events=_events(system, contact, [t, x, p]) if contact else None,
        passage=through,
    )


def _events(system: System, contact: ContactEquations, txp: list[SX]) -> tuple[Function, Function]:
    """The functions of `FullState.events`."""
    fired = SX.sym("fired", contact.indicators.numel())
    after, modes = tree_jump(system, contact, txp[1], fired)
    return (
        dense_function("indicators", txp, [contact.indicators]),
        dense_function("jump", [*txp, fired], [after, modes]),
    )


def _accelerations(
    system: System, q: SX, v: SX, tau: SX, motions: Sequence[Prescribed], t: SX
) -> tuple[SX, SX]:
    """Accelerations of the tree, and its efforts, those of drives included."""
    if not motions:
        ddm = direct_dynamics(system, coordinates="tree")
        return outputs_of(system, ddm, q, v, tau)[0], tau
    hybrid = hybrid_dynamics(system, [motion.name for motion in motions])
    given = casadi.vertcat(*(motion.law(t)[2] for motion in motions))
    a, drives, *_ = outputs_of(system, hybrid, q, v, tau, given)
    every = SX(tau)
    for row, motion in enumerate(motions):
        every[motion.velocity] += drives[row]
    return a, every
