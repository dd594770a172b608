"""The start of a motion: positions that close the loops, and velocities that keep them closed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mbs.assembly import System
from mbs.assembly.validity import plain_fault
from mbs.errors import ModelError
from mbs.loops.closing import Vector
from mbs.loops.posture import require_closed, solve
from mbs.loops.velocity import closure_jacobian
from mbs.solvers.least_squares import smallest_solution
from mbs.solvers.rank import RELATIVE_GAP, null_space

_REFINEMENTS = 3
"""Solutions added up: the second takes the error of the first away, the third shows no change."""

Values = Mapping[str, float] | Sequence[float] | None


def start(
    system: System, q0: Values, v0: Values, parameters: Mapping[str, float] | None
) -> tuple[Vector, Vector]:
    """Positions (nq,) that close the loops and velocities (nv,) that fit them.

    Args:
        system: open or closed.
        q0: positions by coordinate name [rad or m], the others as in the assembled posture; in a
            closed system the loops are closed with the independent ones as given.
        v0: velocities by name [rad/s or m/s], the others zero; in a closed system they may be of
            any joints, and the others follow.
        parameters: values of symbols, the others at their defaults.

    Raises:
        Unclosable: the loops cannot be closed at these positions.
        LoopError: q0 holds all positions and leaves the loops open.
        ModelError: a name is unknown, a quaternion is not of unit length, or the loops allow no
            motion with these velocities.
    """
    q = np.array(system.position(q0))
    if fault := plain_fault(system, q, None):
        raise ModelError(f"{system.name}: {fault}")
    if not system.is_closed:
        return q, np.array(system.velocity(v0))
    if isinstance(q0, Mapping) or q0 is None:
        q = solve(system, dict(q0 or {}), parameters=parameters)
    else:
        require_closed(system, q, parameters)
    return q, _tree_velocity(system, q, v0, parameters)


def _tree_velocity(
    system: System, q: Vector, v0: Values, parameters: Mapping[str, float] | None
) -> Vector:
    """The smallest velocities that keep the loops closed and give the joints named in v0 theirs.

    Raises:
        ModelError: no motion of the loops has these velocities.
    """
    p = [system.parameter_values(parameters)] if system.parameters else []
    v, missed = smallest_velocity(system, np.array(closure_jacobian(system)(q, *p)), v0)
    if missed:
        raise ModelError(
            f"{system.name}: the loops allow no motion with the velocities {missed};"
            " give those of independent joints: "
            + ", ".join(system.speeds[k].name for k in system.active)
        )
    return v


def smallest_velocity(system: System, J: Vector, v0: Values) -> tuple[Vector, str]:
    """The smallest velocities with J v = 0 that give the joints named in v0 theirs.

    Args:
        system: any.
        J: (m, nv) rows, dependent ones included.
        v0: velocities by name [rad/s or m/s], or all of them.

    Returns:
        v (nv,); the velocities of v0 as text where no v has them, else an empty one.
    """
    free = null_space(J)
    wanted = np.array(system.velocity(v0))
    names = [speed.name for speed in system.speeds]
    named = v0 is None or isinstance(v0, Mapping)
    rows = [k for k, name in enumerate(names) if not named or name in (v0 or {})]
    v: Vector = free @ np.linalg.lstsq(free[rows], wanted[rows], rcond=None)[0]
    # what does not fit differs by about its own size, what fits by rounding
    fits = np.allclose(v[rows], wanted[rows], rtol=1e-6, atol=1e-9)
    if not fits:
        return v, ", ".join(f"{names[k]} = {wanted[k]:g}" for k in rows)
    return _refined(J, rows, wanted[rows]), ""


def _refined(J: Vector, rows: list[int], wanted: Vector) -> Vector:
    """The smallest v (nv,) with J v = 0 and v[rows] = wanted, where there is one, to the last bit.

    A basis of what J leaves free carries 1e-14 of noise, which differs from processor to processor.
    """
    K = np.vstack([J, np.eye(J.shape[1])[rows]])
    goal = np.concatenate([np.zeros(len(J)), wanted])
    v = np.zeros(J.shape[1])
    for _ in range(_REFINEMENTS):
        v += smallest_solution(K, goal - np.sum(K * v, axis=1), RELATIVE_GAP)
    return v
