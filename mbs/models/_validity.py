"""Validity of model inputs: residuals of configurations and parameters, and their bounds."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.validity import ValidityRow, plain_rows
from mbs.loops.examination import loop_rows


def validity(system: System) -> Function:
    """Return the validity of positions and parameters: ``validity(q) -> residual, bound``.

    Valid if ``residual <= bound`` for each row; NaN is invalid. The rows, named by `validity_rows`,
    are: unit norm of quaternions, bounds of parameters, loop closure relative to the size of the
    mechanism, and independent joints that determine the dependent joints. Models called with
    numbers check this themselves. The Function serves CasADi graphs and maps, and constraints of an
    optimisation.

    Args:
        system: open or closed mechanism.

    Returns:
        Function of positions q (nq, 1) and, for a system with parameters, p (np, 1); residual and
        bound (k, 1), where k may be zero.

    Raises:
        ModelError: `system` is not a System.
    """
    require_system(system)

    def build() -> Function:
        q, inputs = SX.sym("q", system.nq), ["q"]
        rows, given = _rows(system, q), [q]
        if system.parameters:
            inputs, given = ["q", "p"], [q, system.p]
        residual = casadi.vertcat(SX(0, 1), *(row.residual for row in rows))
        bound = casadi.vertcat(SX(0, 1), *(row.bound for row in rows))
        outputs = [casadi.densify(residual), casadi.densify(bound)]
        names = ["residual", "bound"]
        return Function("validity", given, outputs, inputs, names, {"cse": True})

    function: Function = system.cached("validity", build)
    return function


def validity_rows(system: System) -> tuple[str, ...]:
    """Return the names of the rows of `validity`, in order.

    Args:
        system: open or closed mechanism.
    """
    require_system(system)
    return tuple(row.name for row in _rows(system, SX.sym("q", system.nq)))


def _rows(system: System, q: SX) -> list[ValidityRow]:
    """Return the conditions, with residual and bound, under which q is valid for the models."""
    return [*plain_rows(system, q), *(loop_rows(system, q) if system.is_closed else [])]
