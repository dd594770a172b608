"""Accelerations of a system some of whose coordinates contacts hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.composition import outputs_of
from mbs.models.constrained_accelerations import constrained_accelerations, inertia_size
from mbs.models.contacts import Contacts, Modes, contacts_of
from mbs.models.surroundings import surroundings
from mbs.models.symbols import symbols_of
from mbs.recursions.composite_body import inertia_matrix


def held_dynamics(system: System, prescribed: tuple[int, ...]) -> Function:
    """``held(q, v, tau, a_p, acting) -> a, tau_p, inertia``: hybrid dynamics with switches.

    Args:
        system: open or closed; all coordinates are those of the tree.
        prescribed: numbers of velocities.

    Returns:
        Function of q (nq, 1), v and tau (nv, 1), the accelerations a_p (k, 1) and acting (k, 1), 1
        where a_p is given and 0 where the coordinate is free; a (nv, 1), the efforts tau_p (k, 1)
        that make a_p, and the diagonal elements (k, 1) of the inertia matrix.
    """

    def build() -> tuple[Named, Named]:
        s, k = symbols_of(system, "tree"), len(prescribed)
        tau, a_p, acting = SX.sym("tau", system.nv), SX.sym("a_p", k), SX.sym("acting", k)
        a, _, tau_p = constrained_accelerations(
            system, s, tau, surroundings(system), prescribed, a_p, acting
        )
        A = inertia_matrix(system.tree, s.poses)
        least = SX(1e-6 * inertia_size(system, A, s))
        inertia = casadi.vertcat(*(casadi.fmax(A[n, n], least) for n in prescribed))
        inputs: Named = [("q", s.q), ("v", s.v), ("tau", tau), ("a_p", a_p), ("acting", acting)]
        return inputs, [("a", a), ("tau_p", tau_p), ("inertia", inertia)]

    return model_function(system, ("held_dynamics", prescribed), build)


@dataclass(frozen=True, slots=True, eq=False)
class ContactEquations:
    """What contacts make of the equations of motion.

    Attributes:
        contacts: the coordinates that they act on.
        values: (2 k, 1) symbols of their modes.
        modes: the same by name.
        a: (nv, 1) accelerations.
        driven: numbers of the m velocities that drives move.
        drives: (m, 1) efforts that do so, in their order.
        tau: (nv, 1) joint efforts, those of drives included and those of contacts left out.
        efforts: (2 k, 1) of the stops, then of friction.
        indicators: (5 k, 1) as of `Contacts.indicators`.
    """

    contacts: Contacts
    values: SX
    modes: Modes
    a: SX
    driven: tuple[int, ...]
    drives: SX
    tau: SX
    efforts: SX
    indicators: SX


def contact_equations(
    system: System, q: SX, v: SX, tau: SX, driven: Mapping[int, SX]
) -> ContactEquations | None:
    """Accelerations, efforts and indicators under contacts; None where there are none.

    Args:
        system: open or closed.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
        tau: (nv, 1) joint efforts.
        driven: accelerations that drives give to velocities, by their numbers.

    Raises:
        ModelError: a contact acts where it cannot.
    """
    contacts = contacts_of(system)
    if not len(contacts):
        return None
    values = SX.sym("modes", 2 * len(contacts))
    modes = contacts.modes(values)
    braked, every = SX(tau), SX(tau)
    for j, number in enumerate(contacts.velocities):
        braked[number] -= modes.slide[j] * contacts.sliding[j]
    numbers, m = (*driven, *contacts.velocities), len(driven)
    given = casadi.vertcat(*driven.values(), SX.zeros(len(contacts)))
    acting = casadi.vertcat(SX.ones(m), modes.held)
    a, made, inertia = outputs_of(
        system, held_dynamics(system, numbers), q, v, braked, given, acting
    )
    for row, number in enumerate(driven):
        every[number] += made[row]
    y = made[m:]
    efforts = casadi.vertcat(*contacts.efforts(modes, y))
    indicators = contacts.indicators(q, v, modes, y, inertia[m:])
    return ContactEquations(
        contacts, values, modes, a, tuple(driven), made[:m], every, efforts, indicators
    )
