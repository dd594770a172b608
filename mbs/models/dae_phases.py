"""Differential-algebraic equations of a mechanism while some of its points stand on planes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly.rates import position_rate
from mbs.errors import ModelError
from mbs.messages import quoted
from mbs.models.composition import outputs_of
from mbs.models.dae import Dae, start_efforts
from mbs.models.dae_forms import FORMS, DaeEquations, equations, implicit, motor_efforts, motors
from mbs.models.dae_names import Elements, elements_of
from mbs.models.dae_rows import rows_of
from mbs.models.dae_standing import PhaseStart, Standing, split
from mbs.models.symbols import symbols_of


@dataclass(frozen=True, slots=True, eq=False)
class PhaseDae(Dae):
    """Equations of a contact phase; see `ContactPhases.dae`.

    Attributes:
        f: (3, n) forces of the planes on the points, in the axes of the planes, in terms of x, z,
            u and p; zero for points that are free.
    """

    f: SX

    def function(self) -> Function:
        """``dae(x, z, u, p) -> ode, alg, invariants, q, v, f``, of numbers, SX or MX."""
        inputs = ("x", "z", "u", "p")
        outputs = ("ode", "alg", "invariants", "q", "v", "f")
        given, results = ([getattr(self, n) for n in names] for names in (inputs, outputs))
        return Function("dae", given, results, list(inputs), list(outputs), {"cse": True})


def phase_dae(standing: Standing, explicit: Function, form: str, begin: PhaseStart) -> PhaseDae:
    """Equations of a phase in one of the forms.

    Args:
        standing: which points touch, and how.
        explicit: `ContactPhases.accelerations` of the phase.
        form: as in `mbs.models.dae`.
        begin: where it starts.
    """
    system = standing.system
    if form not in FORMS:
        raise ModelError(f"{system.name}: form is {quoted(form)}; use one of {', '.join(FORMS)}")
    tau = start_efforts(system, begin.tau0)
    q, v = standing.start(begin)
    p = np.array(system.parameter_values(begin.parameters), dtype=float)
    kept = standing.independent(q, p)
    made, f, elements = _built(standing, explicit, form, kept)
    parts = {field.name: getattr(made, field.name) for field in fields(made)}
    z0 = np.zeros(made.z.numel())
    if len(z0):
        found = standing.efforts(kept, (q, v), tau, p)
        z0[: len(found)] = found
    return PhaseDae(
        **parts,
        form=form,
        elements=elements,
        x0=np.concatenate([q, v]),
        z0=z0,
        u0=tau[motors(system)],
        p0=p,
        f=f,
    )


_Built = tuple[DaeEquations, SX, Mapping[str, Elements]]


def _built(standing: Standing, explicit: Function, form: str, kept: tuple[int, ...]) -> _Built:
    system = standing.system

    def build() -> _Built:
        names = standing.elements(kept)
        if form == "reduced":
            made, f = _explicit(standing, explicit, kept)
            return made, f, elements_of(system, "phase", names)
        made = implicit(system, form, standing.rows(kept))
        return made, _forces(standing, kept, made.z), elements_of(system, form, names)

    key = ("phase dae", standing.points, standing.ways, form, kept)
    built: _Built = system.cached(key, build)
    return built


def _explicit(
    standing: Standing, explicit: Function, kept: tuple[int, ...]
) -> tuple[DaeEquations, SX]:
    """States [q; v] and no z: accelerations and forces are solved for."""
    system = standing.system
    s, (u, tau) = symbols_of(system, "tree"), motor_efforts(system)
    a, f, *_ = outputs_of(system, explicit, s.q, s.v, tau)
    rows = rows_of(system, s.q, s.v, a).joined(standing.rows(kept)(s, a))
    made = equations(
        system,
        states=(casadi.vertcat(s.q, s.v), SX(0, 1), u),
        ode=casadi.vertcat(position_rate(system.tree, s.q, s.v), a),
        alg=SX(0, 1),
        invariants=casadi.vertcat(rows.positions, rows.velocities, rows.norms),
        motion=(s.q, s.v),
    )
    return made, f


def _forces(standing: Standing, kept: tuple[int, ...], z: SX) -> SX:
    """(3, n) forces on the points, from the efforts of the rows in z = [a; lam; mu]."""
    closure, (distances, drifts) = standing.system.closure, split(kept)
    loops, slips = (len(closure.rows), len(closure.slips)) if closure else (0, 0)
    first = standing.system.nv + loops
    second = first + len(distances) + slips
    f = SX.zeros(3 * len(standing.points))
    f[distances] = z[first : first + len(distances)]
    f[drifts] = z[second : second + len(drifts)]
    return casadi.reshape(f, 3, len(standing.points))
