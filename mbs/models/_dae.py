"""Differential-algebraic equations of a mechanism, in the forms that solvers accept."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.pickling import packed, unpacked
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT, RATE_UNIT
from mbs.assembly.tree import norm_rows, position_rate, quaternion_slices
from mbs.assembly.validity import plain_rows
from mbs.errors import ModelError, NoClosedForm, Unclosable
from mbs.loops._function import function
from mbs.loops.closure_equations import independent_closure, row_groups
from mbs.loops.configuration import Guess, Start, Values, start
from mbs.loops.plan import branches_at, plan
from mbs.loops.reduction import reduction, reduction_matrix
from mbs.loops.velocity import (
    acceleration_bias,
    constraint_drift,
    independent_constraint_rows,
    independent_drift,
)
from mbs.models._direct_dynamics import direct_dynamics, independent_dynamics
from mbs.models._inverse_dynamics import inverse_dynamics, own_efforts
from mbs.models._measurements import with_readings
from mbs.models.contacts import require_no_contacts
from mbs.models.state.signals import by_name
from mbs.models.symbols import ModelSymbols, devices, outputs_of, part_equations, symbols_of
from mbs.recursions.parts import later_sources
from mbs.result import Result, State, device_states_of, state_of
from mbs.text import quoted

# Loop constraints on the levels of positions, velocities and accelerations.


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Residuals of the independent constraint rows of a system, zero along every motion.

    Attributes:
        J: (r, nv) constraint Jacobian; the row efforts lam act on the joints as J' lam. The s
            position constraints come first, then velocity (nonholonomic) constraints.
        positions: (s, 1) residuals phi(q) of the position constraints, s <= r [m or 1].
        velocities: (r, 1) J v, plus the drift g for rows J v + g = 0.
        accelerations: (r, 1) J a + dJ/dt v, plus dg/dt.
        norms: (k, 1) squared norm minus one of each of the k quaternions in q.
    """

    J: SX
    positions: SX
    velocities: SX
    accelerations: SX
    norms: SX

    @property
    def deepest(self) -> SX:
        """(r, 1) residuals of position constraints, then velocity residuals of other rows."""
        return casadi.vertcat(self.positions, self.velocities[self.positions.numel() :])

    @property
    def J_positions(self) -> SX:
        """(s, nv) rows of J that belong to the position constraints."""
        return self.J[: self.positions.numel(), :]

    def join(self, other: Rows) -> Rows:
        """Return the rows followed by those of `other`, position constraints before velocity ones.

        The quaternion norms are those of the first rows.
        """
        s, t = self.positions.numel(), other.positions.numel()

        def both(mine: SX, theirs: SX) -> SX:
            return casadi.vertcat(mine[:s, :], theirs[:t, :], mine[s:, :], theirs[t:, :])

        return Rows(
            J=both(self.J, other.J),
            positions=casadi.vertcat(self.positions, other.positions),
            velocities=both(self.velocities, other.velocities),
            accelerations=both(self.accelerations, other.accelerations),
            norms=self.norms,
        )


def rows_of(system: System, q: SX, v: SX, a: SX) -> Rows:
    """Return the residuals of the independent constraint rows of a system as expressions.

    Args:
        system: open or closed mechanism.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) symbols of velocities.
        a: (nv, 1) symbols of accelerations.
    """
    phi, J, drift = SX(0, 1), SX(0, system.nv), None
    if system.is_closed:
        phi, J = independent_closure(system, q), independent_constraint_rows(system, q)
        drift = independent_drift(system, q)
    speeds = casadi.mtimes(J, v)
    return Rows(
        J=J,
        positions=phi,
        velocities=speeds if drift is None else speeds + drift,
        accelerations=casadi.mtimes(J, a) + acceleration_bias(system, q, v, J, drift),
        norms=norm_rows(system.tree, q),
    )


# Equations of motion as differential-algebraic equations, in the forms that solvers accept.
#
# With loops, positions q and velocities v of the whole tree satisfy A a + H = tau + J' lam and
# one of phi(q) = 0, J v = 0 or J a + psi = 0. The form "ggl" has both phi(q) = 0 and J v = 0; its
# multipliers mu correct the positions. The form "reduced" solves the loops in advance.
#
# Source: Gear, Leimkuhler and Gupta 1985 for the form "ggl"; Brenan, Campbell and Petzold 1996
# for the index of the others.


ConstraintRows = Callable[[ModelSymbols, SX], Rows]
"""Callable (symbols of the tree, accelerations a (nv, 1)) -> constraint rows."""

FORMS = ("reduced", "index1", "index2", "index3", "ggl")


@dataclass(frozen=True, slots=True, eq=False)
class DaeEquations:
    """Equations dx/dt = ode(x, z, u, p), 0 = alg(x, z, u, p) as SX expressions.

    Attributes:
        x: symbols of the differential states; component states come last.
        z: symbols of the algebraic states; (0, 1) if there are none.
        u: symbols of the inputs: motor efforts in the order of the actuated
            `system.velocity_coordinates` without a device, then component inputs in the order
            of `system.inputs`.
        p: symbols of the parameters, in the order of `system.parameters`.
        ode: time derivatives of x.
        alg: residuals of the algebraic equations, as many as z has elements.
        invariants: expressions in x and p that are zero along every motion and at a valid start.
        q: (nq, 1) positions of the tree as expressions in x.
        v: (nv, 1) velocities of the tree as expressions in x.
        excess: expressions in p: violation of the parameter bounds, positive outside the bounds.
    """

    x: SX
    z: SX
    u: SX
    p: SX
    ode: SX
    alg: SX
    invariants: SX
    q: SX
    v: SX
    excess: SX


def motors(system: System) -> list[int]:
    """Return the indices in v of the actuated velocities that no device drives.

    Devices are components such as a motor with a drive line. The efforts of the others are inputs
    of the equations.

    Args:
        system: open or closed mechanism.
    """
    driven = [device.velocity for device in system.devices]
    return [k for k, s in enumerate(system.velocity_coordinates) if s.actuated and k not in driven]


def implicit(system: System, form: str, constrained: ConstraintRows | None = None) -> DaeEquations:
    """Return the equations with x = [q; v] and z = [a; lam] or, in form "ggl", z = [a; lam; mu].

    The equations of a are the inverse dynamics. No mass matrix is built or factorised, so that
    links may be massless.

    Args:
        system: open or closed mechanism.
        form: "index1", "index2", "index3" or "ggl".
        constrained: callable (symbols, accelerations) that returns constraint rows in addition to
            the loops, such as those of contact points; None without them.

    Raises:
        ModelError: there are further rows, and an input is wired to a measured acceleration or
            force.
    """
    s = symbols_of(system, "tree")
    q, v, a = s.q, s.v, SX.sym("a", system.nv)
    rows = rows_of(system, q, v, a)
    if constrained is not None:
        require_no_later(system)
        rows = rows.join(constrained(s, a))
    lam, mu = SX.sym("lam", rows.J.shape[0]), SX(0, 1)
    u, tau, rates = driving(system, q, v)
    (needed,) = outputs_of(system, inverse_dynamics(system, "tree"), q, v, a)
    speed = v
    if form == "ggl":
        mu = SX.sym("mu", rows.positions.numel())
        speed = v + casadi.mtimes(rows.J_positions.T, mu)
    return equations(
        system,
        states=(casadi.vertcat(q, v, system.component_states), casadi.vertcat(a, lam, mu), u),
        ode=casadi.vertcat(position_rate(system.tree, q, speed), a, rates),
        alg=casadi.vertcat(
            needed - tau - casadi.mtimes(rows.J.T, lam), _kept_residuals(rows, form)
        ),
        invariants=casadi.vertcat(rows.positions, rows.velocities, rows.norms),
        motion=(q, v),
    )


def _kept_residuals(rows: Rows, form: str) -> SX:
    """Return the constraint residuals that are algebraic equations in a form of the DAE."""
    match form:
        case "index1":
            return rows.accelerations
        case "index2":
            return rows.velocities
        case "index3":
            return rows.deepest
    return casadi.vertcat(rows.positions, rows.velocities)


def open_chain(system: System) -> DaeEquations:
    """Return the equations of an open chain with x = [q; v] and no z, by its forward dynamics.

    Args:
        system: open mechanism.
    """
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    u, tau, rates = driving(system, q, v)
    (a,) = outputs_of(system, direct_dynamics(system), q, v, tau)
    return equations(
        system,
        states=(casadi.vertcat(q, v, system.component_states), SX(0, 1), u),
        ode=casadi.vertcat(position_rate(system.tree, q, v), a, rates),
        alg=SX(0, 1),
        invariants=norm_rows(system.tree, q),
        motion=(q, v),
    )


def closed_form(system: System, branch: tuple[str, ...]) -> DaeEquations:
    """Return the equations of a system with closed-form loops: x = [q_a; v_a], no z, q = f(q_a).

    Args:
        system: closed mechanism; q_a and v_a are its independent positions and velocities.
        branch: labels of the assembly branch on which q follows from q_a.

    Raises:
        NoClosedForm: a loop has no closed-form solution.
    """
    active = list(system.independent)
    q_a, v_a = SX.sym("q_a", len(active)), SX.sym("v_a", len(active))
    (q,) = outputs_of(system, function(system, branch), q_a)
    u, v, a, rates = _independent_motion(system, q, v_a)
    return equations(
        system,
        states=(casadi.vertcat(q_a, v_a, system.component_states), SX(0, 1), u),
        ode=casadi.vertcat(v_a, a, rates),
        alg=SX(0, 1),
        invariants=SX(0, 1),
        motion=(q, v),
    )


def carried_positions(system: System) -> DaeEquations:
    """Return the equations of a closed system with x = [q; v_a] and no z.

    All positions q are integrated, with the independent velocities v_a only. The closure residual
    phi(q) is an invariant.

    Args:
        system: closed mechanism.
    """
    q, v_a = SX.sym("q", system.nq), SX.sym("v_a", len(system.independent))
    u, v, a, rates = _independent_motion(system, q, v_a)
    return equations(
        system,
        states=(casadi.vertcat(q, v_a, system.component_states), SX(0, 1), u),
        ode=casadi.vertcat(position_rate(system.tree, q, v), a, rates),
        alg=SX(0, 1),
        invariants=casadi.vertcat(independent_closure(system, q), norm_rows(system.tree, q)),
        motion=(q, v),
    )


def _independent_motion(system: System, q: SX, v_a: SX) -> tuple[SX, SX, SX, SX]:
    """Return the motion of a closed system at positions q and independent velocities v_a.

    Returns:
        symbols of the inputs u, tree velocities (nv, 1), independent accelerations, rates of
        component states.
    """
    (G,) = outputs_of(system, reduction_matrix(system), q)
    v = casadi.densify(casadi.mtimes(G, v_a))
    if system.closure is not None and constraint_drift(system, q) is not None:
        v = reduction(system, q).velocities(v_a)
    u, tau, rates = driving(system, q, v)
    pushed = (
        casadi.mtimes(G.T, tau)
        if system.motors != system.independent
        else tau[list(system.independent)]
    )
    (a,) = outputs_of(system, independent_dynamics(system), q, v_a, pushed)
    return u, v, a, rates


def require_no_later(system: System) -> None:
    """Raise if a component input is wired to a measured acceleration or force.

    Contacts of phases change these, which the equations do not consider.

    Args:
        system: open or closed mechanism.

    Raises:
        ModelError: the message names the first wire.
    """
    for source in later_sources(system):
        raise ModelError(
            f"{system.name}: the wire from {source} follows from accelerations or forces, which"
            " contacts of phases change; take the wire away"
        )


def driving(system: System, q: SX, v: SX, *, resolved: bool = True) -> tuple[SX, SX, SX]:
    """Return symbols of inputs, joint efforts of motors and devices, and rates of component states.

    Args:
        system: open or closed mechanism.
        q: (nq, 1) positions.
        v: (nv, 1) velocities of the tree.
        resolved: whether sensor signals of accelerations and forces that are wired to inputs are
            replaced by their expressions in the rates.

    Returns:
        input symbols u, joint efforts tau (nv, 1), and rates (nz, 1) of the component states.
    """
    driven = motors(system)
    u = SX.sym("u", len(driven))
    tau, rates, _ = part_equations(system, q, v)
    for k, number in enumerate(driven):
        tau[number] += u[k]
    if resolved:
        (rates,) = with_readings(system, [rates], (q, v, None, tau))
    return casadi.vertcat(u, system.u), tau, rates


def equations(
    system: System,
    states: tuple[SX, SX, SX],
    ode: SX,
    alg: SX,
    invariants: SX,
    motion: tuple[SX, SX],
) -> DaeEquations:
    """Return DaeEquations from expressions, after common subexpression elimination.

    Args:
        system: open or closed mechanism.
        states: symbols x, z and u.
        ode: time derivatives of x.
        alg: residuals of the algebraic equations.
        invariants: expressions that are zero along every motion.
        motion: positions q and velocities v of the tree.
    """
    rules = [row for row in plain_rows(system, motion[0]) if row.kind == "parameter"]
    excess = casadi.vertcat(SX(0, 1), *(row.residual - row.bound for row in rules))
    shared = casadi.cse([casadi.densify(e) for e in (ode, alg, invariants, *motion, excess)])
    return DaeEquations(*states, system.p, *(SX(e) for e in shared))


# Name and unit of every element of differential-algebraic equations.


Elements = tuple[tuple[str, str], ...]
"""Name and unit of each element of a vector."""

_RATE_OF_RATE = {"m": "m/s2", "rad": "rad/s2", "1": "1/s2"}
_EFFORT = {"m": "N", "rad": "N.m", "1": "N.m"}


def elements_of(
    system: System, form: str, standing: tuple[Elements, Elements] = ((), ())
) -> Mapping[str, Elements]:
    """Return (name, unit) of each element of x, z, u, p, alg and invariants, by these names.

    Args:
        system: open or closed mechanism.
        form: "open", "closed form" (x = [q_a; v_a]) or "carried" (x = [q; v_a]) for the three kinds
            of "reduced", "phase" for the explicit contact phase, else as in `mbs.models.dae`.
        standing: (name, unit) of the position constraints and of the velocity constraints of
            touching contact points.
    """
    q, v, a, tau = _coordinates(system)
    own = system.states
    norms = tuple(
        (f"{system.coordinates[part.start].joint}: unit quaternion", "1")
        for part in quaternion_slices(system.tree)
    )
    fixed = {
        "u": (*(tau[k] for k in motors(system)), *system.inputs),
        "p": tuple((parameter.name, parameter.unit) for parameter in system.parameters),
    }
    v_a = tuple(v[k] for k in system.independent)
    phi, slips = (a + b for a, b in zip(_rows(system), standing, strict=True))
    rows = phi + slips
    speeds = _named_rows("der", rows, RATE_UNIT)
    explicit = {
        "open": (q + v, norms),
        "closed form": (tuple(q[k] for k in system.independent) + v_a, ()),
        "carried": (q + v_a, phi + norms),
        "phase": (q + v, phi + speeds + norms),
    }
    if form in explicit:
        x, invariants = explicit[form]
        return {**fixed, "x": x + own, "z": (), "alg": (), "invariants": invariants}
    kept = {
        "index1": _named_rows("der(der", rows, _RATE_OF_RATE, "))"),
        "index2": speeds,
        "index3": phi + _named_rows("der", slips, RATE_UNIT),
        "ggl": phi + speeds,
    }[form]
    mu = _named_rows("mu", phi, dict.fromkeys(RATE_UNIT, "1")) if form == "ggl" else ()
    return {
        **fixed,
        "x": q + v + own,
        "z": a + _named_rows("lam", rows, _EFFORT) + mu,
        "alg": tau + kept,
        "invariants": phi + speeds + norms,
    }


def _coordinates(system: System) -> tuple[Elements, Elements, Elements, Elements]:
    """Return (name, unit) of the elements of q, v, a and tau, as in simulation results."""
    q = tuple((f"{c.name}.q", c.unit) for c in system.coordinates)
    v = tuple((f"{s.name}.v", s.unit) for s in system.velocity_coordinates)
    a = tuple((f"{s.name}.a", ACCELERATION_UNIT[s.unit]) for s in system.velocity_coordinates)
    tau = tuple((f"{s.name}.tau", EFFORT_UNIT[s.unit]) for s in system.velocity_coordinates)
    return q, v, a, tau


def _rows(system: System) -> tuple[Elements, Elements]:
    """Return (name, unit) of the independent position and velocity constraints of the loops.

    Velocity constraints have the unit of their integral; `_named_rows` applies that of the rate.
    """
    if system.closure is None:
        return (), ()
    driven = {c.name: system.coordinates[c.driven].unit for c in system.couplings}
    positions, slips = (
        [
            (f"{group.name}: {label}", driven.get(group.name, unit))
            for group in row_groups(system)
            for label, unit in getattr(group, kind)
        ]
        for kind in ("positions", "velocities")
    )
    kept = system.closure
    return tuple(positions[k] for k in kept.rows), tuple(slips[k] for k in kept.slips)


def _named_rows(what: str, rows: Elements, unit: Mapping[str, str], end: str = ")") -> Elements:
    """Return constraint rows (name, unit) with names "what(name)" and converted units.

    Args:
        what: prefix of the names.
        rows: names and units of the constraint rows.
        unit: unit of the result for each unit of a row.
        end: text after the name.
    """
    return tuple((f"{what}({name}{end}", unit[u]) for name, u in rows)


Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Dae(DaeEquations):
    """Differential-algebraic equations with element names and a consistent start.

    Attributes:
        form: form of the equations: "reduced", "index1", "index2", "index3" or "ggl".
        elements: dict from "x", "z", "u", "p", "alg" and "invariants" to the (name, unit) of each
            element.
        x0, z0, u0, p0: consistent start as one-dimensional arrays: `alg` and `invariants` are zero.
    """

    _outputs: ClassVar[tuple[str, ...]] = ("ode", "alg", "invariants", "q", "v")
    form: str
    elements: Mapping[str, Elements]
    x0: Array
    z0: Array
    u0: Array
    p0: Array

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling; unpickled symbols are new symbols with the same names."""
        return _unpickle, packed({f.name: getattr(self, f.name) for f in fields(self)})

    def casadi(self) -> dict[str, SX]:
        """Return the dict x, z, u, p, ode, alg for `casadi.integrator`."""
        return {name: getattr(self, name) for name in ("x", "z", "u", "p", "ode", "alg")}

    def function(self) -> Function:
        """Return the Function ``dae(x, z, u, p) -> ode, alg, invariants, q, v``.

        It accepts numbers, SX or MX.
        """
        inputs = ("x", "z", "u", "p")
        given, results = ([getattr(self, n) for n in names] for names in (inputs, self._outputs))
        return Function("dae", given, results, list(inputs), list(self._outputs), {"cse": True})


def dae(
    system: System,
    form: str = "reduced",
    *,
    q0: Start = None,
    v0: Start = None,
    tau0: Values = None,
    states: Mapping[str, float] | State | Result | None = None,
    inputs: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    guess: Guess = None,
) -> Dae:
    """Return the equations of motion dx/dt = ode, 0 = alg with a consistent start.

    Efforts are those of `direct_dynamics`. Forms:

    - "reduced": explicit equations, no z. Open chains: x = [q; v]. Closed systems with a closed
      form (`mbs.loops.function`): x = [q_a; v_a], the independent joints, on the branch of the
      start. Other closed systems: x = [q; v_a], with phi(q) as an invariant. So are systems in
      which a spring or coupling depends on the number of revolutions of a passive joint.
    - "index1", "index2", "index3": x = [q; v], z = [a; lam]; A a + H = tau + J' lam and, in this
      order, J a + psi = 0, J v = 0 or phi(q) = 0, of the independent rows.
    - "ggl": x = [q; v], z = [a; lam; mu]; dq/dt = N(q) (v + J' mu), phi(q) = 0 and J v = 0, of
      index 2; mu is zero along every motion.

    For an open chain the last four forms are the same: z = a, of index 1. With independent rows,
    d(alg)/d(z) of "index1" is regular; for the other forms it is regular after `alg` has been
    differentiated index - 1 times. Component states, such as a motor current, are at the end of x.
    Component inputs, such as a motor voltage, are at the end of u. u has no effort for a joint that
    a device drives.

    Source: Gear, Leimkuhler and Gupta 1985; Brenan, Campbell and Petzold 1996.

    Args:
        system: open or closed mechanism.
        form: "reduced", "index1", "index2", "index3" or "ggl".
        q0: start positions by name, as in `mbs.simulate.run`; by default the assembled
            configuration. Or a `State`, which also supplies velocities and component states that
            are not given.
        v0: start velocities by name; zero by default.
        tau0: start efforts of motors by name, zero by default; they determine u0 and z0.
        states: start values of component states by name, such as `motor.i`; by default as
            described.
        inputs: start values of component inputs by name, such as `motor.voltage`, or by component
            name if it has a single input; by default as described.
        parameters: values of symbols at the start; other symbols have their defaults.
        guess: approximate start positions of other joints, which select the branch.

    Raises:
        ModelError: the form or a name is unknown, a joint of tau0 has no motor, or a symbol has no
            value.
        Unclosable: the loops cannot be closed at q0.
    """
    require_system(system)
    require_no_contacts(system, "dae")
    if form not in FORMS:
        raise ModelError(f"{system.name}: form is {quoted(form)}; use one of {', '.join(FORMS)}")
    point = start_values(system, q0, v0, tau0, states, inputs, parameters, guess)
    q, v, tau, z, u, p = point.values()
    kind = _kind_of_form(system, form, q, p)
    equations, elements = _built_equations(system, kind)
    parts = {field.name: getattr(equations, field.name) for field in fields(equations)}
    x0 = np.concatenate([_start_states(system, kind[0], q, v), z])
    z0 = _start_algebraic(system, tuple(point.values()), equations.z.numel())
    u0 = np.concatenate([tau[motors(system)], u])
    return Dae(**parts, form=form, elements=elements, x0=x0, z0=z0, u0=u0, p0=p)


_Kind = tuple[str, tuple[str, ...]]
"""Form, with "reduced" resolved into "open", "closed form" or "carried", and branch labels."""


def _kind_of_form(system: System, form: str, q: Array, p: Array) -> _Kind:
    """Return the kind of equations that a requested DAE form needs, and branch labels.

    Args:
        system: mechanism.
        form: requested form. For "reduced" the kind is "open" (open chain), "closed form"
            (positions from closed forms of the loops) or "carried" (all positions are states).
        q: (nq,) start positions.
        p: (np,) parameters.
    """
    if form != "reduced":
        return form, ()
    if not system.is_closed:
        return "open", ()
    slips = bool(system.closure and system.closure.slips)
    if slips or system.nq != system.nv or _angle_turns_matter(system):
        return "carried", ()
    try:
        return "closed form", _branch(system, q, p)
    except NoClosedForm:
        return "carried", ()


def _angle_turns_matter(system: System) -> bool:
    """Return whether a full revolution of some passive joint changes efforts or couplings.

    Closed forms of loops return angles modulo 2 pi, so that they are not valid then.
    """

    def find() -> bool:
        s = symbols_of(system, "tree")
        efforts = own_efforts(system, s, SX.zeros(system.nv))
        felt = casadi.which_depends(efforts, s.q, 1, False)
        for coupling in system.couplings:
            for k in coupling.coordinates[1:]:
                felt[k] = True
        active = [system.velocity_coordinates[k].name for k in system.independent]
        return any(
            felt[k] and c.unit == "rad" and c.name not in active
            for k, c in enumerate(system.coordinates)
        )

    found: bool = system.cached("passive angle winds", find)
    return found


def _branch(system: System, q: Array, p: Array) -> tuple[str, ...]:
    """Return the labels of the assembly branch of the closed configuration q.

    `p` are the parameters. Raise Unclosable if two branches of a loop meet at q.
    """
    stages = plan(system)
    branches = branches_at(system, stages, q, p)
    if len(branches) < len(stages):
        raise Unclosable(
            f"{system.name}: the closed form of the loop of {stages[len(branches)].name} does not"
            " give the start, where two branches meet; start beside it, or take form 'index2'"
        )
    labels = [stage.labels[branch] for stage, branch in zip(stages, branches, strict=True)]
    return tuple(label for label in labels if label)


def _built_equations(system: System, kind: _Kind) -> tuple[DaeEquations, Mapping[str, Elements]]:
    """Return the equations of a kind, and (name, unit) of the elements of their vectors.

    `kind` is a result of `_kind_of_form`. The equations are cached.
    """

    def build() -> tuple[DaeEquations, Mapping[str, Elements]]:
        form, branch = kind
        match form:
            case "open":
                equations = open_chain(system)
            case "closed form":
                equations = closed_form(system, branch)
            case "carried":
                equations = carried_positions(system)
            case _:
                equations = implicit(system, form)
        return equations, elements_of(system, form)

    built: tuple[DaeEquations, Mapping[str, Elements]] = system.cached(("dae", *kind), build)
    return built


def start_efforts(system: System, tau0: Values) -> Array:
    """Return the joint efforts (nv,) for efforts given by name; zero for others.

    Args:
        system: open or closed mechanism.
        tau0: efforts of motors by name [N m or N], or None.

    Raises:
        ModelError: a joint with a nonzero effort has no motor.
    """
    tau = np.array(system.effort(tau0))
    driven = motors(system)
    for k, speed in enumerate(system.velocity_coordinates):
        if tau[k] != 0 and k not in driven:
            names = ", ".join(system.velocity_coordinates[j].name for j in driven)
            raise ModelError(
                f"{system.name}: tau0 gives {tau[k]:g} to {speed.name!r}, which has no motor; make"
                f" that joint actuated=True, or use one of {names or '(none)'}"
            )
    return tau


def start_values(
    system: System,
    q0: Start,
    v0: Start,
    tau0: Values,
    states: Mapping[str, float] | State | Result | None,
    inputs: Mapping[str, float] | None,
    parameters: Mapping[str, float] | None,
    guess: Guess,
) -> dict[str, Array]:
    """Return the start of a mechanism as arrays "q", "v", "tau", "z", "u" and "p", in this order.

    These are positions (nq,), velocities (nv,), joint efforts (nv,), component states, component
    inputs and parameters.

    Args:
        system: open or closed mechanism.
        q0: start positions, as in `dae`; a `State` also supplies component states that are not
            given.
        v0: start velocities by name; zero by default.
        tau0: start efforts of motors by name; zero by default.
        states: start values of component states by name; by default as described.
        inputs: start values of component inputs by name; by default as described.
        parameters: values of symbols; other symbols have their defaults.
        guess: approximate positions of other joints, which select the assembly branch.

    Raises:
        ModelError: a name is unknown, a joint of tau0 has no motor, or a symbol has no value.
        Unclosable: the loops cannot be closed at q0.
    """
    p = np.array(system.parameter_values(parameters), dtype=float)
    q0, own = state_of(q0), device_states_of(states)
    q, v = start(system, q0, v0, parameters, guess)
    if isinstance(q0, State) and own is None:
        own = q0.z
    tau = start_efforts(system, tau0)
    z = by_name(system, "states", own, system.states, system.component_start)
    u = by_name(system, "inputs", inputs, system.inputs, system.u_default)
    return {"q": q, "v": v, "tau": tau, "z": z, "u": u, "p": p}


def _start_states(system: System, form: str, q: Array, v: Array) -> Array:
    """Return the initial states of a form from q (nq,) and v (nv,), without component states.

    `form` is the first element of the result of `_kind_of_form`.
    """
    active = list(system.independent)
    if form == "closed form":
        return np.concatenate([q[active], v[active]])
    return np.concatenate([q, v[active] if form == "carried" else v])


def _start_algebraic(system: System, point: tuple[Array, ...], size: int) -> Array:
    """Return consistent algebraic states: accelerations, row efforts, and zeros for mu.

    Args:
        system: open or closed mechanism.
        point: q, v, motor efforts, component states, component inputs, parameters.
        size: number of algebraic states.
    """
    z0 = np.zeros(size)
    if size:
        q, v, tau, z, u, p = point
        if system.devices:
            found = devices(system)
            at = {"q": q, "v": v, "z": z, "u": u, "p": p}
            if "row_efforts" in found.name_in():  # only the outputs y depend on row efforts
                at["row_efforts"] = np.zeros(found.numel_in("row_efforts"))
            tau = tau + np.array(found.call([at[name] for name in found.name_in()])[0]).ravel()
        ddm = direct_dynamics(system, coordinates="tree")
        at = {"q": q, "v": v, "tau": tau, "z": z, "u": u, "p": p}
        determined = casadi.vertcat(*ddm.call([at[name] for name in ddm.name_in()]))
        z0[: determined.numel()] = np.array(determined).ravel()
    return z0


def _unpickle(*parts: Any) -> Dae:
    """Return a Dae from its pickled fields."""
    return Dae(**unpacked(*parts))
