"""Differential-algebraic equations of a mechanism, for optimal control and for DAE solvers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.pickled import packed, unpacked
from mbs.errors import ModelError, NoClosedForm, Unclosable
from mbs.loops.closed_form.plan import plan
from mbs.loops.closed_form.stage import ways_at
from mbs.loops.start import Values, start
from mbs.messages import quoted
from mbs.models.contacts import require_no_contacts
from mbs.models.dae_forms import (
    FORMS,
    DaeEquations,
    carried_positions,
    closed_form,
    implicit,
    motors,
    open_chain,
)
from mbs.models.dae_names import Elements, elements_of
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.inverse_dynamics import own_efforts
from mbs.models.symbols import symbols_of

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
        return _unpickled, packed({f.name: getattr(self, f.name) for f in fields(self)})

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
    q0: Values = None,
    v0: Values = None,
    tau0: Values = None,
    parameters: Mapping[str, float] | None = None,
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
    index - 1 times. Of a joint or shaft that a device drives u has the effort, such as j.tau;
    currents and voltages of devices are not part of the equations.

    Source: Gear, Leimkuhler and Gupta 1985; Brenan, Campbell and Petzold 1996.

    Args:
        system: open or closed.
        form: one of the five words.
        q0: positions at the start by name, as in `mbs.simulate.run`: the assembled posture.
        v0: velocities at the start by name; at rest when left out.
        tau0: efforts of motors at the start by name, the others zero; they tell u0 and z0.
        parameters: values of symbols at the start, the others at their defaults.

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
    q, v = start(system, q0, v0, parameters)
    tau = start_efforts(system, tau0)
    kind = _kind(system, form, q, p)
    equations, elements = _built(system, kind)
    parts = {field.name: getattr(equations, field.name) for field in fields(equations)}
    x0 = _start_states(system, kind[0], q, v)
    z0 = _start_algebraic(system, q, v, tau, p, equations.z.numel())
    return Dae(**parts, form=form, elements=elements, x0=x0, z0=z0, u0=tau[motors(system)], p0=p)


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
            felt[coupling.driver] = True
        active = [system.speeds[k].name for k in system.active]
        return any(
            felt[k] and c.unit == "rad" and c.name not in active
            for k, c in enumerate(system.coordinates)
        )

    found: bool = system.cached("passive angle winds", find)
    return found


def _branch(system: System, q: Array, p: Array) -> tuple[str, ...]:
    """The labels of the closed posture q."""
    stages = plan(system)
    ways = ways_at(system, stages, q, p)
    if len(ways) < len(stages):
        raise Unclosable(
            f"{system.name}: the closed form of the loop of {stages[len(ways)].name} does not give"
            " the start, where two branches meet; start beside it, or take form 'index2'"
        )
    labels = [stage.labels[way] for stage, way in zip(stages, ways, strict=True)]
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


def _start_algebraic(system: System, q: Array, v: Array, tau: Array, p: Array, size: int) -> Array:
    """The first of: accelerations, efforts of the closure rows, zeros for mu."""
    z0 = np.zeros(size)
    if size:
        ddm = direct_dynamics(system, coordinates="tree")
        result = ddm(q, v, tau, *([p] if system.parameters else []))
        found = casadi.vertcat(*result) if isinstance(result, tuple) else result
        z0[: found.numel()] = np.array(found).ravel()
    return z0


def _unpickled(*parts: Any) -> Dae:
    return Dae(**unpacked(*parts))
