"""Accelerations of the independent joints under contacts, prescribed motions and wrenches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.models.composition import outputs_of
from mbs.models.contact_dynamics import ContactEquations, contact_equations
from mbs.models.direct_dynamics import independent_dynamics, inertia_matrix
from mbs.models.hybrid_dynamics import hybrid_dynamics
from mbs.models.inverse_dynamics import bias
from mbs.models.minimal_motion import TreeMotion
from mbs.models.minimal_standstill import RETURN_RATE, standstill


@dataclass(frozen=True, slots=True, eq=False)
class Accelerations:
    """What a tree does under given efforts.

    Attributes:
        a_a: (m, 1) of the independent joints.
        a: (nv, 1) of the tree.
        tau: (nv, 1) joint efforts, those of prescribed motions included, those of contacts not.
        contact: what contacts do, None where there are none.
    """

    a_a: SX
    a: SX
    tau: SX
    contact: ContactEquations | None

    @property
    def every_effort(self) -> SX:
        """(nv, 1) joint efforts, those of contacts included."""
        total = SX(self.tau)
        if self.contact is not None:
            for row, number in enumerate(2 * self.contact.contacts.velocities):
                total[number] += self.contact.efforts[row]
        return total


def minimal_accelerations(
    system: System, motion: TreeMotion, tau: SX, load: SX, given: Mapping[int, SX]
) -> Accelerations:
    """Accelerations of a tree whose loops stay closed.

    What is given, and what contacts hold, is exact in a_a, since nothing projects the motion later.

    Args:
        system: open or closed.
        motion: of the tree.
        tau: (nv, 1) joint efforts.
        load: (nv, 1) what acts from outside, as joint efforts.
        given: accelerations that are prescribed, by the numbers of their velocities.
    """
    contact = contact_equations(system, motion.q, motion.v, tau + load, given)
    if contact is None and not given:
        pushed = motion.reduced_effort(tau + load)
        (a_a,) = outputs_of(system, independent_dynamics(system), motion.q, motion.v_a, pushed)
        return Accelerations(a_a, motion.tree_acceleration(a_a), tau, None)
    if contact is not None:
        a, drives = _held(system, contact, motion), contact.drives
    elif system.is_closed:
        a, drives = _reduced_hybrid(system, motion, motion.reduced_effort(tau + load), given)
    else:
        hybrid = hybrid_dynamics(system, [system.speeds[k].name for k in given])
        wanted = casadi.vertcat(*given.values())
        a, drives = outputs_of(system, hybrid, motion.q, motion.v, tau + load, wanted)
    every = SX(tau)
    for row, (number, value) in enumerate(given.items()):
        a[number] = value
        every[number] += drives[row]
    a_a = a[list(system.active)]
    return Accelerations(a_a, motion.tree_acceleration(a_a), every, contact)


def _held(system: System, contact: ContactEquations, motion: TreeMotion) -> SX:
    """(nv, 1) accelerations under contacts, those of independent joints that are held exact."""
    a, contacts, held = SX(contact.a), contact.contacts, contact.modes.held
    back = -RETURN_RATE * contacts.velocity(motion.v)
    a[list(system.active)] += standstill(system, contacts, motion, (held, back), contact.driven)
    for j, number in enumerate(contacts.velocities):
        a[number] = casadi.if_else(held[j], back[j], a[number])
    return a


def _reduced_hybrid(
    system: System, motion: TreeMotion, tau: SX, given: Mapping[int, SX]
) -> tuple[SX, SX]:
    """Hybrid dynamics in the independent joints, (m, 1) efforts tau and prescribed accelerations.

    Source: Featherstone 2008, section 9.2, for the inertia matrix G' A G.

    Returns:
        (nv, 1) accelerations, of the independent joints alone, and the efforts of drives.
    """
    (A,) = outputs_of(system, inertia_matrix(system), motion.q)
    (H,) = outputs_of(system, bias(system), motion.q, motion.v_a)
    driven = [system.active.index(k) for k in given]
    free = [k for k in range(len(system.active)) if k not in driven]
    a = SX.zeros(len(system.active))
    a[driven] = casadi.vertcat(*given.values())
    if free:
        left = tau - H - casadi.mtimes(A, a)
        D, LT, order = casadi.ldl(casadi.densify(A[free, free]))
        a[free] = casadi.ldl_solve(left[free], D, LT, order)
    needed = casadi.mtimes(A, a) + H - tau
    every = SX.zeros(system.nv)
    every[list(system.active)] = a
    return every, needed[driven]
