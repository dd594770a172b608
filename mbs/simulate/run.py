"""Simulation of a system, compiled where there is a compiler, loops kept closed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.errors import ModelError
from mbs.loops.posture import require_closed, solve
from mbs.loops.reduction import reduction_matrix
from mbs.models.full_state import FullState, full_state
from mbs.result import Result
from mbs.simulate.arguments import count_steps, positive
from mbs.simulate.effort import Effort, effort_function
from mbs.simulate.progress import progress
from mbs.solvers import integrate

Values = Mapping[str, float] | Sequence[float] | None
Array = NDArray[np.float64]

_SCALARS = (("kinetic_energy", "J"), ("potential_energy", "J"), ("closure_residual", "1"))


def run(
    system: System,
    duration: float,
    *,
    q0: Values = None,
    v0: Values = None,
    tau: Effort = None,
    parameters: Mapping[str, float] | None = None,
    step: float = 0.01,
    tolerance: float = 1e-8,
    quiet: bool = False,
) -> Result:
    """The motion of a system from given positions and velocities under given joint efforts.

    Dormand and Prince's method with error control. After every step positions and velocities are
    projected onto the independent closure rows, so that loops do not drift; the step is accepted
    when all closure rows hold.

    Args:
        system: open or closed.
        duration: [s].
        q0: positions at the start by coordinate name [rad or m], the others as in the assembled
            posture; in a closed system the loops are closed with the independent ones as given.
        v0: velocities at the start by name [rad/s or m/s], the others zero; in a closed system
            they may be of any joints, and the others follow.
        tau: joint efforts [N m or N]: constants of motors by name, or a function of (t, q, v) made
            of CasADi operations that returns (nv, 1) efforts, or a casadi.Function of (t, q, v).
        parameters: values of symbols, the others at their defaults.
        step: time between the rows of the result [s]; it does not change the accuracy.
        tolerance: relative and absolute tolerance of the error of one integration step.
        quiet: no progress bar.

    Returns:
        A `Result` with, for every coordinate, `name.q`, `name.v`, `name.a`, `name.tau`, and
        `kinetic_energy`, `potential_energy`, `closure_residual`.

    Raises:
        ModelError: `system` is no System, a name is unknown or has no motor, or an argument has the
            wrong type or size.
        CompilerError: the compiler that CC names does not start.
        Unclosable: the loops cannot be closed at these positions.
        SolverError: the integration cannot go on; the message says when and why.
    """
    require_system(system)
    duration = positive(duration, "duration [s]", system.name)
    tolerance = positive(tolerance, "tolerance", system.name)
    steps = count_steps(duration, positive(step, "step [s]", system.name), system.name)
    p = system.parameter_values(parameters)
    state = full_state(system, effort_function(system, tau))
    x0 = np.concatenate(_start(system, q0, v0, parameters))
    times = np.linspace(0.0, duration, steps + 1)
    with progress(f"simulating {system.name}", 0.0, duration, quiet=quiet) as reached:
        x = integrate(
            state.rhs,
            x0,
            times,
            p=p,
            project=state.project,
            rtol=tolerance,
            atol=tolerance,
            progress=reached,
        )
    return _result(system, state, times, x, p)


def _start(
    system: System, q0: Values, v0: Values, parameters: Mapping[str, float] | None
) -> tuple[Array, Array]:
    """Positions that close the loops and velocities that fit them."""
    q = np.array(system.position(q0))
    if not system.is_closed:
        return q, np.array(system.velocity(v0))
    if isinstance(q0, Mapping) or q0 is None:
        q = solve(system, dict(q0 or {}), parameters=parameters)
    else:
        require_closed(system, q, parameters)
    return q, _tree_velocity(system, q, v0, parameters)


def _tree_velocity(
    system: System, q: Array, v0: Values, parameters: Mapping[str, float] | None
) -> Array:
    """The smallest independent velocities that give the joints named in v0 theirs, and all others.

    Raises:
        ModelError: no motion of the loops has these velocities.
    """
    p = [system.parameter_values(parameters)] if system.parameters else []
    G = np.array(reduction_matrix(system)(q, *p))
    wanted = np.array(system.velocity(v0))
    names = [speed.name for speed in system.speeds]
    named = v0 is None or isinstance(v0, Mapping)
    rows = [k for k, name in enumerate(names) if not named or name in (v0 or {})]
    v_a = np.linalg.lstsq(G[rows], wanted[rows], rcond=None)[0]
    v: Array = G @ v_a
    if not np.allclose(v[rows], wanted[rows], rtol=1e-6, atol=1e-9):
        told = ", ".join(f"{names[k]} = {wanted[k]:g}" for k in rows)
        raise ModelError(
            f"{system.name}: the loops allow no motion with the velocities {told};"
            " give those of independent joints: " + ", ".join(names[k] for k in system.active)
        )
    return v


def _result(system: System, state: FullState, times: Array, x: Array, p: Sequence[float]) -> Result:
    every = np.repeat(np.array(p, dtype=float).reshape(-1, 1), len(times), axis=1)
    observed = state.observe.map(len(times))(times.reshape(1, -1), x.T, every)
    a, tau, *scalars = (np.array(o).T for o in observed)
    units: dict[str, str] = {}
    columns: list[Array] = []

    def column(name: str, unit: str, values: Array) -> None:
        units[name] = unit
        columns.append(np.ravel(values))

    for k, coordinate in enumerate(system.coordinates):
        column(f"{coordinate.name}.q", coordinate.unit, x[:, k])
    for k, speed in enumerate(system.speeds):
        column(f"{speed.name}.v", speed.unit, x[:, system.nq + k])
        column(f"{speed.name}.a", ACCELERATION_UNIT[speed.unit], a[:, k])
        column(f"{speed.name}.tau", EFFORT_UNIT[speed.unit], tau[:, k])
    for (name, unit), values in zip(_SCALARS, scalars, strict=True):
        column(name, unit, values)
    return Result(times, np.column_stack(columns), units, name=system.name)
