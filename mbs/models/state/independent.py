"""State equation of the independent joints, with dependent joints solved from loop closure.

The states can be set freely and there is no constraint drift, as importers of FMUs require.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.tree import position_rate, quaternion_slices
from mbs.loops.closing import relative_rows
from mbs.loops.closure_equations import facing, square_closure
from mbs.models.state.arguments import state_arguments
from mbs.models.state.control_laws import with_laws_and_crossings
from mbs.models.state.drive import DriveInputs, TreeMotion, input_motions, tree_motion
from mbs.models.state.equations import (
    EquationsOfMotion,
    Observe,
    OutputContext,
    equations_of_motion,
    independent_accelerations,
)
from mbs.models.state.events import (
    StateEvents,
    at_limits,
    contact_events,
    join_part_events,
    minimal_jump,
)
from mbs.models.state.layout import (
    MinimalLayout,
    StateInputs,
    StatePoint,
    rows_of,
    state_inputs,
)
from mbs.models.state.orientations import (
    NORM_RATE,
    state_rates,
    tie_orientations,
    with_unit_length,
)
from mbs.models.symbols import dense_function
from mbs.solvers.linear import newton_step

__all__ = [
    "DriveInputs",
    "MinimalState",
    "Observe",
    "OutputContext",
    "consistent_start",
    "minimal_state",
]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MinimalState(MinimalLayout):
    """State equation of the independent joints; `MinimalLayout` defines x, z, u and y.

    Attributes:
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`. Here and in `events`, p contains the parameters
            followed by the modes.
        closure: `closure(x, z, p) -> (z_next, residual)`, one Newton step; None in open chains.
        slopes: `slopes(x, z, p) -> J`, Jacobian (nz, nz) of the closure equations with respect to
            z. None in open chains, and for least-squares equations, whose determinant has no
            meaningful sign.
        events: events of rigid stops, Coulomb friction and components, or None.
    """

    rhs: Function
    closure: Function | None
    slopes: Function | None
    events: StateEvents | None


def minimal_state(
    system: System,
    observe: Observe | None = None,
    drive: DriveInputs | None = None,
    *,
    crossings: bool = False,
) -> MinimalState:
    """Return the state equation of the independent joints.

    Args:
        system: open or closed system.
        observe: function that returns additional outputs at the end of y.
        drive: additional inputs, and control laws that replace the efforts of motors or the inputs
            of components.
        crossings: whether events end steps at discontinuities of laws.

    Raises:
        ModelError: `drive` is inconsistent with the system, or the independent rows of the loops
            change with the configuration, which contacts do not support.
    """
    return independent_state(state_inputs(system, drive), observe, crossings=crossings)


def independent_state(
    inputs: StateInputs, observe: Observe | None = None, *, crossings: bool = False
) -> MinimalState:
    """Return the state equation of the independent joints for given inputs.

    Args:
        inputs: inputs and outputs.
        observe: argument of `minimal_state`.
        crossings: argument of `minimal_state`.
    """
    system, layout, s = inputs.system, inputs.layout, inputs.symbols
    motion = motion_of(system, layout, s)
    at = equations_of_motion(system, motion, inputs.actions(), independent_accelerations)
    contact, states = at.response.contact, (layout.positions, layout.velocities)
    arguments = state_arguments(system, (s.t, s.x, s.z, s.u, system.p), contact)
    rate = _rate(system, layout, at)
    events = None
    if contact:
        events = contact_events(
            arguments,
            contact,
            motion,
            lambda fired: minimal_jump(system, contact, motion, (s.x, fired), states),
        )
    (rhs,), events = with_laws_and_crossings(
        inputs,
        arguments,
        motion,
        [arguments.function("rhs", [rate, inputs.outputs(at, observe)])],
        join_part_events(system, arguments, events, at.parts.events()),
        crossings=crossings,
    )
    closure, slopes = _closure_step(system, layout, s) if layout.dependents else (None, None)
    return MinimalState(
        **{field.name: getattr(layout, field.name) for field in fields(layout)},
        rhs=rhs,
        closure=closure,
        slopes=slopes,
        events=events,
    )


def motion_of(system: System, layout: MinimalLayout, s: StatePoint) -> TreeMotion:
    """Return the motion of the tree from states, dependent positions and prescribed motions."""
    laws = input_motions(layout.motions, s.motions)
    raw, q = positions_of(system, layout, s)
    v = SX.zeros(system.nv)
    v[list(layout.velocities)] = s.v
    for motion, law in zip(layout.motions, laws, strict=True):
        if motion.position is not None:
            raw[motion.position], v[motion.velocity] = law[0], law[1]
    return tree_motion(system, raw, q, v[list(system.independent)])


def positions_of(system: System, layout: MinimalLayout, s: StatePoint) -> tuple[SX, SX]:
    """Return the positions (nq, 1) of the state, and the positions (nq, 1) on the loops."""
    raw = SX.zeros(system.nq)
    raw[list(layout.dependents)] = s.z
    raw[list(layout.positions)] = s.q
    q = with_unit_length(layout.orientations, raw)
    q[list(layout.dependents)] = s.z
    return raw, q


def _rate(system: System, layout: MinimalLayout, at: EquationsOfMotion) -> SX:
    """Return the rate of x, with decay of quaternions to unit length."""
    motion, response = at.motion, at.response
    v = SX(motion.v)
    v[list(system.independent)] += at_limits(system, response.contact, motion)
    if system.is_closed:
        rate = state_rates(system, layout.orientations, (motion.raw, motion.q, v))
    else:
        rate = _steadied_rate(system, replace(motion, v=v))
    return casadi.vertcat(
        rows_of(rate, layout.positions), rows_of(response.a, layout.velocities), at.rates
    )


def _steadied_rate(system: System, motion: TreeMotion) -> SX:
    raw = position_rate(system.tree, motion.raw, motion.v)
    rate = position_rate(system.tree, motion.q, motion.v)
    for part in quaternion_slices(system.tree):
        q = motion.raw[part]
        rate[part] = raw[part] + NORM_RATE * (1 - casadi.sumsqr(q)) * q
    return rate


def _closure_step(
    system: System, layout: MinimalLayout, s: StatePoint
) -> tuple[Function, Function | None]:
    """Return the functions `closure` and `slopes` of `MinimalState`."""
    dependents = list(layout.dependents)
    symbols, z = SX.sym("q", system.nq), s.z
    raw, q = positions_of(system, layout, s)
    ties = tie_orientations(system, layout.orientations, raw, symbols)
    kept = square_closure(system, symbols, dependents, ties)
    every = relative_rows(system, symbols)
    kept, every = casadi.substitute([kept, every], [symbols], [q])
    cosines = casadi.substitute(facing(system, symbols), symbols, q)
    opposed = casadi.mmin(cosines) <= 0 if cosines.numel() else SX(0)
    residual = casadi.mmax(casadi.fabs(casadi.vertcat(every, opposed)))
    point = [s.x, z, system.p]
    slopes = Function("slopes", point, [casadi.jacobian(kept, z)], {"cse": True})
    step = newton_step(dense_function("rows", point, [kept, residual]), slopes)
    varies = system.closure is not None and system.closure.varies
    return step, None if varies else slopes


def consistent_start(system: System, state: MinimalLayout) -> tuple[list[float], list[float]]:
    """Return state x and dependents z of the assembled configuration at rest."""
    configuration = np.array(system.configuration)
    rest = [0.0] * len(state.velocities)
    x = [*configuration[list(state.positions)], *rest, *system.component_start]
    return [float(value) for value in x], [
        float(value) for value in configuration[list(state.dependents)]
    ]
