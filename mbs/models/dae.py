"""Differential-algebraic equations of a mechanism, in the forms that solvers take."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

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
from mbs.loops.closure import independent_closure, row_groups
from mbs.loops.configuration import Guess, Start, Values, start
from mbs.loops.function import function
from mbs.loops.plan import branches_at, plan
from mbs.loops.reduction import reduction, reduction_matrix
from mbs.loops.velocity import (
    acceleration_bias,
    constraint_drift,
    independent_constraint_rows,
    independent_drift,
)
from mbs.models.contacts import require_no_contacts
from mbs.models.direct_dynamics import direct_dynamics, independent_dynamics
from mbs.models.inverse_dynamics import inverse_dynamics, own_efforts
from mbs.models.measurements import with_readings
from mbs.models.state.signals import by_name
from mbs.models.symbols import ModelSymbols, devices, outputs_of, part_equations, symbols_of
from mbs.recursions.parts import later_sources
from mbs.result import Result, State, device_states_of, state_of
from mbs.text import quoted

# What loops ask of a motion, on the levels of positions, velocities and accelerations.


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The independent rows of a system; all are zero along every motion.

    Attributes:
        J: (r, nv), the efforts of the rows act along its lines; those of rows that bind positions
            come first.
        positions: (s, 1) rows phi(q) that bind positions, s <= r [m or 1].
        velocities: (r, 1) J v.
        accelerations: (r, 1) J a + dJ/dt v.
        norms: one element a quaternion, its squared length less one.
    """

    J: SX
    positions: SX
    velocities: SX
    accelerations: SX
    norms: SX

    @property
    def deepest(self) -> SX:
        """(r, 1) every row on the lowest level that it has: positions, else velocities."""
        return casadi.vertcat(self.positions, self.velocities[self.positions.numel() :])

    @property
    def J_positions(self) -> SX:
        """(s, nv) the lines of J that belong to rows that bind positions."""
        return self.J[: self.positions.numel(), :]

    def join(self, other: Rows) -> Rows:
        """These rows and others of the same system; of each kind these come first."""
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
    """The independent rows at the symbols q (nq, 1), v (nv, 1), a (nv, 1)."""
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


# Equations of motion as differential-algebraic equations, in the forms that solvers take.
#
# With loops, positions q and velocities v of the whole tree follow from A a + H = tau + J' lam
# and one of phi(q) = 0, J v = 0 or J a + psi = 0; or both of the first two, the positions then
# being moved onto the loops by multipliers mu. Or the loops are solved for, and nothing is left
# of them.
#
# Source: Gear, Leimkuhler and Gupta 1985 for the form "ggl"; Brenan, Campbell and Petzold 1996
# for the index of the others.


ConstraintRows = Callable[[ModelSymbols, SX], Rows]
"""Rows at the symbols of the tree and its accelerations a (nv, 1)."""

FORMS = ("reduced", "index1", "index2", "index3", "ggl")


@dataclass(frozen=True, slots=True, eq=False)
class DaeEquations:
    """dx/dt = ode(x, z, u, p), 0 = alg(x, z, u, p), on symbols x, z, u, p.

    Attributes:
        x: differential states, those of components last.
        z: algebraic states; (0, 1) where there are none.
        u: efforts of the motors, in the order of the actuated `system.speeds` that no device
            drives, then the inputs of components, `system.inputs`.
        p: parameters, in the order of `system.parameters`.
        ode: rates of x.
        alg: as many rows as z has elements.
        invariants: of x and p; zero along every motion, so zero at every start.
        q: (nq, 1) positions of the tree that belong to x.
        v: (nv, 1) velocities of the tree that belong to x.
        excess: of p; by how much parameters are out of their bounds, not above zero where they are
            within.
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
    """Numbers of the actuated speeds but those that devices drive."""
    driven = [device.velocity for device in system.devices]
    return [k for k, s in enumerate(system.speeds) if s.actuated and k not in driven]


def implicit(system: System, form: str, constrained: ConstraintRows | None = None) -> DaeEquations:
    """The forms with x = [q; v] and z = [a; lam], or [a; lam; mu]; the mass stays implicit.

    No inertia matrix is built or factorised: the rows of a are the inverse dynamic model, which
    also serves links without mass.

    Args:
        system: open or closed.
        form: "index1", "index2", "index3" or "ggl".
        constrained: rows besides those of the loops, such as points that stand.
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
        states=(casadi.vertcat(q, v, system.z), casadi.vertcat(a, lam, mu), u),
        ode=casadi.vertcat(position_rate(system.tree, q, speed), a, rates),
        alg=casadi.vertcat(needed - tau - casadi.mtimes(rows.J.T, lam), _keep(rows, form)),
        invariants=casadi.vertcat(rows.positions, rows.velocities, rows.norms),
        motion=(q, v),
    )


def _keep(rows: Rows, form: str) -> SX:
    """What the algebraic equations of a form ask of the loops."""
    match form:
        case "index1":
            return rows.accelerations
        case "index2":
            return rows.velocities
        case "index3":
            return rows.deepest
    return casadi.vertcat(rows.positions, rows.velocities)


def open_chain(system: System) -> DaeEquations:
    """Open chains, x = [q; v] and no z: the accelerations are those of the direct dynamic model."""
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    u, tau, rates = driving(system, q, v)
    (a,) = outputs_of(system, direct_dynamics(system), q, v, tau)
    return equations(
        system,
        states=(casadi.vertcat(q, v, system.z), SX(0, 1), u),
        ode=casadi.vertcat(position_rate(system.tree, q, v), a, rates),
        alg=SX(0, 1),
        invariants=norm_rows(system.tree, q),
        motion=(q, v),
    )


def closed_form(system: System, branch: tuple[str, ...]) -> DaeEquations:
    """Closed forms, x = [q_a; v_a] and no z: q is an explicit function of q_a on one branch.

    Raises:
        NoClosedForm: a loop is solved by iteration only.
    """
    active = list(system.active)
    q_a, v_a = SX.sym("q_a", len(active)), SX.sym("v_a", len(active))
    (q,) = outputs_of(system, function(system, branch), q_a)
    u, v, a, rates = _independent_motion(system, q, v_a)
    return equations(
        system,
        states=(casadi.vertcat(q_a, v_a, system.z), SX(0, 1), u),
        ode=casadi.vertcat(v_a, a, rates),
        alg=SX(0, 1),
        invariants=SX(0, 1),
        motion=(q, v),
    )


def carried_positions(system: System) -> DaeEquations:
    """Other loops, x = [q; v_a] and no z: all positions are integrated, phi(q) is an invariant."""
    q, v_a = SX.sym("q", system.nq), SX.sym("v_a", len(system.active))
    u, v, a, rates = _independent_motion(system, q, v_a)
    return equations(
        system,
        states=(casadi.vertcat(q, v_a, system.z), SX(0, 1), u),
        ode=casadi.vertcat(position_rate(system.tree, q, v), a, rates),
        alg=SX(0, 1),
        invariants=casadi.vertcat(independent_closure(system, q), norm_rows(system.tree, q)),
        motion=(q, v),
    )


def _independent_motion(system: System, q: SX, v_a: SX) -> tuple[SX, SX, SX, SX]:
    """Symbols u, velocities of the tree, accelerations of the independent joints, rates of z."""
    (G,) = outputs_of(system, reduction_matrix(system), q)
    v = casadi.densify(casadi.mtimes(G, v_a))
    if system.closure is not None and constraint_drift(system, q) is not None:
        v = reduction(system, q).velocities(v_a)
    u, tau, rates = driving(system, q, v)
    pushed = casadi.mtimes(G.T, tau) if system.motors != system.active else tau[list(system.active)]
    (a,) = outputs_of(system, independent_dynamics(system), q, v_a, pushed)
    return u, v, a, rates


def require_no_later(system: System) -> None:
    """Refuse wired accelerations and forces where points that stand change them.

    Raises:
        ModelError: names the first wire.
    """
    for source in later_sources(system):
        raise ModelError(
            f"{system.name}: the wire from {source} follows from accelerations or forces, which"
            " contacts of phases change; take the wire away"
        )


def driving(system: System, q: SX, v: SX, *, resolved: bool = True) -> tuple[SX, SX, SX]:
    """Symbols u, the efforts tau (nv, 1) that they and devices give, and the rates of the states.

    Args:
        system: open or closed.
        q: (nq, 1) positions.
        v: (nv, 1) velocities of the tree.
        resolved: wired readings of accelerations and forces have their values in the rates.
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
    """The expressions with their common parts shared."""
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
    """For x, z, u, p, alg and invariants of a form, the name and unit of each element.

    Args:
        system: open or closed.
        form: "open", "closed form" or "carried" for the three kinds of "reduced", "phase" for that
            of a contact phase, else as in `mbs.models.dae`.
        standing: of points that touch, the rows that bind positions and those that bind velocities
            alone.
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
    v_a = tuple(v[k] for k in system.active)
    phi, slips = (a + b for a, b in zip(_rows(system), standing, strict=True))
    rows = phi + slips
    speeds = _of("der", rows, RATE_UNIT)
    explicit = {
        "open": (q + v, norms),
        "closed form": (tuple(q[k] for k in system.active) + v_a, ()),
        "carried": (q + v_a, phi + norms),
        "phase": (q + v, phi + speeds + norms),
    }
    if form in explicit:
        x, invariants = explicit[form]
        return {**fixed, "x": x + own, "z": (), "alg": (), "invariants": invariants}
    kept = {
        "index1": _of("der(der", rows, _RATE_OF_RATE, "))"),
        "index2": speeds,
        "index3": phi + _of("der", slips, RATE_UNIT),
        "ggl": phi + speeds,
    }[form]
    mu = _of("mu", phi, dict.fromkeys(RATE_UNIT, "1")) if form == "ggl" else ()
    return {
        **fixed,
        "x": q + v + own,
        "z": a + _of("lam", rows, _EFFORT) + mu,
        "alg": tau + kept,
        "invariants": phi + speeds + norms,
    }


def _coordinates(system: System) -> tuple[Elements, Elements, Elements, Elements]:
    """Of q, v, a and tau, under the names that results of simulations have."""
    q = tuple((f"{c.name}.q", c.unit) for c in system.coordinates)
    v = tuple((f"{s.name}.v", s.unit) for s in system.speeds)
    a = tuple((f"{s.name}.a", ACCELERATION_UNIT[s.unit]) for s in system.speeds)
    tau = tuple((f"{s.name}.tau", EFFORT_UNIT[s.unit]) for s in system.speeds)
    return q, v, a, tau


def _rows(system: System) -> tuple[Elements, Elements]:
    """Of the independent rows of positions and of velocities alone, these as if integrated."""
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


def _of(what: str, rows: Elements, unit: Mapping[str, str], end: str = ")") -> Elements:
    return tuple((f"{what}({name}{end}", unit[u]) for name, u in rows)


Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Dae(DaeEquations):
    """Differential-algebraic equations with names, and a consistent start.

    Attributes:
        form: which of the forms it is.
        elements: for "x", "z", "u", "p", "alg" and "invariants" the name and unit of each element.
        x0, z0, u0, p0: a start that fulfils `alg` and `invariants`, one-dimensional.
    """

    form: str
    elements: Mapping[str, Elements]
    x0: Array
    z0: Array
    u0: Array
    p0: Array

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickle holds all of it; its symbols are new ones of the same names."""
        return _unpickle, packed({f.name: getattr(self, f.name) for f in fields(self)})

    def casadi(self) -> dict[str, SX]:
        """What `casadi.integrator` takes: x, z, u, p, ode, alg."""
        return {name: getattr(self, name) for name in ("x", "z", "u", "p", "ode", "alg")}

    def function(self) -> Function:
        """``dae(x, z, u, p) -> ode, alg, invariants, q, v``, of numbers, SX or MX."""
        inputs, outputs = ("x", "z", "u", "p"), ("ode", "alg", "invariants", "q", "v")
        given, results = ([getattr(self, n) for n in names] for names in (inputs, outputs))
        return Function("dae", given, results, list(inputs), list(outputs), {"cse": True})


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
    """Equations of motion dx/dt = ode, 0 = alg, with everything that acts in `direct_dynamics`.

    - "reduced": the loops solved for, no z. Open chains: x = [q; v]. Closed systems with a closed
      form (`mbs.loops.function`): x = [q_a; v_a], the independent joints, on the branch of the
      start. Other closed systems, and those in which a spring or a coupling counts the turns of a
      passive joint: x = [q; v_a], phi(q) an invariant.
    - "index1", "index2", "index3": x = [q; v], z = [a; lam]; A a + H = tau + J' lam and, in this
      order, J a + psi = 0, J v = 0 or phi(q) = 0, of the independent rows.
    - "ggl": x = [q; v], z = [a; lam; mu]; dq/dt = N(q) (v + J' mu), phi(q) = 0 and J v = 0, of
      index 2; mu is zero along every motion.

    In an open chain the last four are the same: z = a, of index 1. d(alg)/d(z) of "index1" is
    regular where the rows are independent; in the others it is once `alg` has been differentiated
    index - 1 times. States of components, such as the current of a motor, stand at the end of x,
    and their inputs, such as its voltage, at the end of u; of a joint that a motor of a drive line
    turns u has no effort.

    Source: Gear, Leimkuhler and Gupta 1985; Brenan, Campbell and Petzold 1996.

    Args:
        system: open or closed.
        form: one of the five words.
        q0: positions at the start by name, as in `mbs.simulate.run`: the assembled configuration.
            Or a `State`, whose velocities and states of components count where none are given.
        v0: velocities at the start by name; at rest when left out.
        tau0: efforts of motors at the start by name, the others zero; they tell u0 and z0.
        states: of components at the start by name, such as `motor.i`, the others as described.
        inputs: of components at the start by name, such as `motor.voltage`, or `motor` where it has
            one alone; likewise.
        parameters: values of symbols at the start, the others at their defaults.
        guess: approximate positions of other joints at the start, which choose the branch.

    Raises:
        ModelError: there is no such form, a name is unknown or has no motor, or a symbol has no
            value.
        Unclosable: the loops cannot be closed at q0.
    """
    require_system(system)
    require_no_contacts(system, "dae")
    if form not in FORMS:
        raise ModelError(f"{system.name}: form is {quoted(form)}; use one of {', '.join(FORMS)}")
    p = np.array(system.parameter_values(parameters), dtype=float)
    q0, own = state_of(q0), device_states_of(states)
    q, v = start(system, q0, v0, parameters, guess)
    if isinstance(q0, State) and own is None:
        own = q0.z
    tau = start_efforts(system, tau0)
    z = by_name(system, "states", own, system.states, system.z_start)
    u = by_name(system, "inputs", inputs, system.inputs, system.u_default)
    kind = _kind(system, form, q, p)
    equations, elements = _built(system, kind)
    parts = {field.name: getattr(equations, field.name) for field in fields(equations)}
    x0 = np.concatenate([_start_states(system, kind[0], q, v), z])
    z0 = _start_algebraic(system, (q, v, tau, z, u, p), equations.z.numel())
    u0 = np.concatenate([tau[motors(system)], u])
    return Dae(**parts, form=form, elements=elements, x0=x0, z0=z0, u0=u0, p0=p)


_Kind = tuple[str, tuple[str, ...]]
"""A form, "reduced" being "open", "closed form" or "carried"; and the branch of a closed form."""


def _kind(system: System, form: str, q: Array, p: Array) -> _Kind:
    if form != "reduced":
        return form, ()
    if not system.is_closed:
        return "open", ()
    slips = bool(system.closure and system.closure.slips)
    if slips or system.nq != system.nv or _winds(system):
        return "carried", ()
    try:
        return "closed form", _branch(system, q, p)
    except NoClosedForm:
        return "carried", ()


def _winds(system: System) -> bool:
    """Whether some passive angle is not the same a whole turn further, as closed forms take it."""

    def find() -> bool:
        s = symbols_of(system, "tree")
        efforts = own_efforts(system, s, SX.zeros(system.nv))
        felt = casadi.which_depends(efforts, s.q, 1, False)
        for coupling in system.couplings:
            for k in coupling.coordinates[1:]:
                felt[k] = True
        active = [system.speeds[k].name for k in system.active]
        return any(
            felt[k] and c.unit == "rad" and c.name not in active
            for k, c in enumerate(system.coordinates)
        )

    found: bool = system.cached("passive angle winds", find)
    return found


def _branch(system: System, q: Array, p: Array) -> tuple[str, ...]:
    """The labels of the closed configuration q."""
    stages = plan(system)
    branches = branches_at(system, stages, q, p)
    if len(branches) < len(stages):
        raise Unclosable(
            f"{system.name}: the closed form of the loop of {stages[len(branches)].name} does not"
            " give the start, where two branches meet; start beside it, or take form 'index2'"
        )
    labels = [stage.labels[branch] for stage, branch in zip(stages, branches, strict=True)]
    return tuple(label for label in labels if label)


def _built(system: System, kind: _Kind) -> tuple[DaeEquations, Mapping[str, Elements]]:
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
    """(nv,) efforts, of motors only."""
    tau = np.array(system.effort(tau0))
    driven = motors(system)
    for k, speed in enumerate(system.speeds):
        if tau[k] != 0 and k not in driven:
            names = ", ".join(system.speeds[j].name for j in driven)
            raise ModelError(
                f"{system.name}: tau0 gives {tau[k]:g} to {speed.name!r}, which has no motor; make"
                f" that joint actuated=True, or use one of {names or '(none)'}"
            )
    return tau


def _start_states(system: System, form: str, q: Array, v: Array) -> Array:
    active = list(system.active)
    if form == "closed form":
        return np.concatenate([q[active], v[active]])
    return np.concatenate([q, v[active] if form == "carried" else v])


def _start_algebraic(system: System, point: tuple[Array, ...], size: int) -> Array:
    """The first of: accelerations, efforts of the closure rows, zeros for mu.

    Args:
        system: open or closed.
        point: q, v, efforts of motors, states and inputs of components, parameters.
        size: how many there are.
    """
    z0 = np.zeros(size)
    if size:
        q, v, tau, z, u, p = point
        if system.devices:
            found = devices(system)
            at = {"q": q, "v": v, "z": z, "u": u, "p": p}
            if "row_efforts" in found.name_in():  # outputs alone depend on them
                at["row_efforts"] = np.zeros(found.numel_in("row_efforts"))
            tau = tau + np.array(found.call([at[name] for name in found.name_in()])[0]).ravel()
        ddm = direct_dynamics(system, coordinates="tree")
        at = {"q": q, "v": v, "tau": tau, "z": z, "u": u, "p": p}
        determined = casadi.vertcat(*ddm.call([at[name] for name in ddm.name_in()]))
        z0[: determined.numel()] = np.array(determined).ravel()
    return z0


def _unpickle(*parts: Any) -> Dae:
    return Dae(**unpacked(*parts))
