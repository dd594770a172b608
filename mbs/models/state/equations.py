"""Equations of motion at a state, which are the same in every form of the state equation.

The state is that of the tree or of the independent joints, in a simulation or in an FMU.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.tree import Frame
from mbs.loops.closure_equations import closure_rows
from mbs.models._direct_dynamics import (
    direct_dynamics,
    hybrid_dynamics,
    independent_dynamics,
    inertia_matrix,
)
from mbs.models._inverse_dynamics import bias
from mbs.models._joint_wrenches import shown_outputs
from mbs.models._measurements import with_readings
from mbs.models.contacts import ContactEquations, contact_equations
from mbs.models.state.drive import TreeMotion, load_of, wrenches_of
from mbs.models.state.events import RETURN_RATE, standstill
from mbs.models.symbols import outputs_of, part_equations
from mbs.recursions.parts import PartsAt
from mbs.spatial import Wrench

# Accelerations with contacts, prescribed motions and external wrenches.


@dataclass(frozen=True, slots=True, eq=False)
class Accelerations:
    """Accelerations and efforts of a tree.

    Attributes:
        a_a: (m, 1) accelerations of the independent joints.
        a: (nv, 1) accelerations of the tree.
        tau: (nv, 1) joint efforts, including prescribed motions, without contacts.
        contact: equations of the contacts, or None.
    """

    a_a: SX
    a: SX
    tau: SX
    contact: ContactEquations | None

    @property
    def every_effort(self) -> SX:
        """Joint efforts (nv, 1) including contacts."""
        total = SX(self.tau)
        return total if self.contact is None else total + self.contact.pushes


Accelerate = Callable[[System, TreeMotion, SX, SX, Mapping[int, SX]], Accelerations]
"""Function of system, motion, joint efforts tau, efforts equivalent to external wrenches, and
prescribed accelerations by index in v: `tree_accelerations` or `independent_accelerations`."""


def tree_accelerations(
    system: System, motion: TreeMotion, tau: SX, load: SX, given: Mapping[int, SX]
) -> Accelerations:
    """Compute the accelerations of a tree whose motion is projected onto its constraints.

    Args:
        system: open or closed system.
        motion: positions and velocities of the tree.
        tau: (nv, 1) joint efforts.
        load: (nv, 1) joint efforts equivalent to external wrenches.
        given: prescribed accelerations by index in v.
    """
    contact = contact_equations(system, motion.q, motion.v, tau + load, given)
    if contact is not None:
        a, drives = contact.a, contact.drives
    elif given:
        a, drives = _hybrid(system, motion, tau + load, given)
    else:
        model = direct_dynamics(system, coordinates="tree")
        a, drives = outputs_of(system, model, motion.q, motion.v, tau + load)[0], SX(0, 1)
    return Accelerations(a[list(system.independent)], a, _with_drives(tau, given, drives), contact)


def independent_accelerations(
    system: System, motion: TreeMotion, tau: SX, load: SX, given: Mapping[int, SX]
) -> Accelerations:
    """Compute the accelerations of a tree whose loops stay closed without projection.

    Prescribed accelerations and contact constraints are exact in a_a.

    Args:
        system: open or closed system.
        motion: positions and velocities of the tree.
        tau: (nv, 1) joint efforts.
        load: (nv, 1) joint efforts equivalent to external wrenches.
        given: prescribed accelerations by index in v.
    """
    contact = contact_equations(system, motion.q, motion.v, tau + load, given)
    if contact is None and not given:
        pushed = motion.reduced_effort(tau + load)
        (a_a,) = outputs_of(system, independent_dynamics(system), motion.q, motion.v_a, pushed)
        return Accelerations(a_a, motion.tree_acceleration(a_a), tau, None)
    if contact is not None:
        a, drives = _stuck_accelerations(system, contact, motion), contact.drives
    elif system.is_closed:
        a, drives = _reduced_hybrid(system, motion, motion.reduced_effort(tau + load), given)
    else:
        a, drives = _hybrid(system, motion, tau + load, given)
    for number, value in given.items():
        a[number] = value
    a_a = a[list(system.independent)]
    every = _with_drives(tau, given, drives)
    return Accelerations(a_a, motion.tree_acceleration(a_a), every, contact)


def _with_drives(tau: SX, given: Mapping[int, SX], drives: SX) -> SX:
    """Return the joint efforts (nv, 1) with the efforts of the drives of prescribed motions."""
    every = SX(tau)
    for row, number in enumerate(given):
        every[number] += drives[row]
    return every


def _hybrid(system: System, motion: TreeMotion, tau: SX, given: Mapping[int, SX]) -> tuple[SX, SX]:
    """Return accelerations (nv, 1) of the tree and efforts of the prescribed joints."""
    model = hybrid_dynamics(system, [system.velocity_coordinates[k].name for k in given])
    prescribed = casadi.vertcat(*given.values())
    a, drives, *_ = outputs_of(system, model, motion.q, motion.v, tau, prescribed)
    return a, drives


def _stuck_accelerations(system: System, contact: ContactEquations, motion: TreeMotion) -> SX:
    """Return the accelerations (nv, 1) with contacts, exact for stuck independent joints."""
    a, contacts, stuck = SX(contact.a), contact.contacts, contact.modes.stuck
    back = -RETURN_RATE * contact.state.velocity
    a[list(system.independent)] += standstill(
        system, contacts, motion, (stuck, back), contact.driven
    )
    for j, number in enumerate(contacts.velocities):
        if number is not None:
            a[number] = casadi.if_else(stuck[j], back[j], a[number])
    return a


def _reduced_hybrid(
    system: System, motion: TreeMotion, tau: SX, given: Mapping[int, SX]
) -> tuple[SX, SX]:
    """Hybrid dynamics in the independent joints with efforts tau (m, 1).

    Source: Featherstone 2008, section 9.2, for the inertia matrix G' A G.

    Returns:
        Accelerations (nv, 1), zero for dependent joints, and efforts of the prescribed joints.
    """
    (A,) = outputs_of(system, inertia_matrix(system), motion.q)
    (H,) = outputs_of(system, bias(system), motion.q, motion.v_a)
    driven = [system.independent.index(k) for k in given]
    free = [k for k in range(len(system.independent)) if k not in driven]
    a = SX.zeros(len(system.independent))
    a[driven] = casadi.vertcat(*given.values())
    if free:
        left = tau - H - casadi.mtimes(A, a)
        D, LT, order = casadi.ldl(casadi.densify(A[free, free]))
        a[free] = casadi.ldl_solve(left[free], D, LT, order)
    needed = casadi.mtimes(A, a) + H - tau
    every = SX.zeros(system.nv)
    every[list(system.independent)] = a
    return every, needed[driven]


# Equations of motion of all parts of a system.


@dataclass(frozen=True, slots=True, eq=False)
class Actions:
    """Efforts, external wrenches and prescribed motions that act on a system.

    Attributes:
        efforts: (nv, 1) joint efforts in addition to those of components.
        given: prescribed accelerations, by index in v.
        frames: frames on which external wrenches act.
        wrenches: (6 k, 1) force and moment on each of the k frames, about its origin, in axes of
            the base.
    """

    efforts: SX
    given: Mapping[int, SX]
    frames: Sequence[Frame] = ()
    wrenches: SX = field(default_factory=lambda: SX(0, 1))


@dataclass(frozen=True, slots=True, eq=False)
class EquationsOfMotion:
    """Equations of motion at a state, as expressions of its symbols and of the contact modes.

    Attributes:
        motion: positions and velocities of the tree.
        tau: (nv, 1) joint efforts of `Actions`, components and external wrenches.
        response: accelerations, and efforts that include drives of prescribed motions.
        rates: (nz, 1) rates of the states of components.
        shown: (ny, 1) outputs of components.
        parts: components at the positions and velocities.
        external: wrenches that links exert on their environment, by link index.
    """

    motion: TreeMotion
    tau: SX
    response: Accelerations
    rates: SX
    shown: SX
    parts: PartsAt
    external: dict[int, Wrench]


def equations_of_motion(
    system: System, motion: TreeMotion, actions: Actions, accelerations: Accelerate
) -> EquationsOfMotion:
    """Return the equations of motion at a state.

    Args:
        system: open or closed system.
        motion: positions and velocities of the tree.
        actions: efforts, wrenches and prescribed accelerations.
        accelerations: `tree_accelerations` or `independent_accelerations`.

    Raises:
        ModelError: a contact is not supported, or a sensor that reads forces is wired to an input
            while external wrenches act.
    """
    q, v = motion.q, motion.v
    tau, rates, parts = part_equations(system, q, v)
    tau += actions.efforts
    external = wrenches_of(system, q, actions.frames, actions.wrenches)
    load = load_of(system, q, external)
    response = accelerations(system, motion, tau, load, actions.given)
    every = response.every_effort + load
    shown = shown_outputs(system, parts, response.a, every)
    state = (q, v, response.a, every)
    rates, shown = with_readings(system, [rates, shown], state, actions.wrenches)
    return EquationsOfMotion(motion, SX(tau + load), response, rates, shown, parts, external)


@dataclass(frozen=True, slots=True, eq=False)
class OutputContext:
    """Values of a motion from which outputs are computed.

    Attributes:
        t: time [s].
        p: (np, 1) parameters of the system.
        q: (nq, 1) positions, quaternions of unit length.
        v: (nv, 1) velocities of the tree.
        a: (nv, 1) accelerations of the tree.
        v_a: (m, 1) velocities of the independent joints.
        a_a: (m, 1) accelerations of the independent joints.
        tau: (nv, 1) joint efforts: motors, devices, prescribed motions and contacts.
        external: wrench that a link exerts on its environment, by link index, about the origin and
            in axes of the link frame.
    """

    t: SX
    p: SX
    q: SX
    v: SX
    a: SX
    v_a: SX
    a_a: SX
    tau: SX
    external: dict[int, Wrench]


Observe = Callable[[OutputContext], Sequence[SX]]
"""Function that returns additional outputs of a motion."""


def observed(system: System, t: SX, at: EquationsOfMotion, observe: Observe | None) -> list[SX]:
    """Return the additional outputs of a motion.

    Args:
        system: open or closed system.
        t: time [s].
        at: equations of motion.
        observe: function that returns the outputs, or None without additional outputs.
    """
    if observe is None:
        return []
    motion, response = at.motion, at.response
    vectors = motion.q, motion.v, response.a, motion.v_a, response.a_a, response.every_effort
    return list(observe(OutputContext(t, system.p, *vectors, at.external)))


def largest_closure_residual(system: System, q: SX) -> SX:
    """Return the largest absolute closure row [m or rad], 0 without loops; q: (nq, 1) positions."""
    rows = closure_rows(system, q) if system.is_closed else SX(0, 1)
    return SX(casadi.mmax(casadi.fabs(rows))) if rows.numel() else SX(0)
