"""What makes a call of a model meaningful, as numbers beside their bounds."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.validity import ValidityRow, plain_rows
from mbs.loops.examine import loop_rows


def validity(system: System) -> Function:
    """``validity(q) -> residual, bound``: valid where no residual is larger than its bound.

    The rows that `validity_rows` names: quaternions of unit length, parameters within their bounds,
    loops that are closed relative to the size of the mechanism, independent joints that lead the
    others. A NaN is not valid: ask for ``residual <= bound``. Models check this themselves where
    they are called with numbers; the Function is for what CasADi makes of them, such as graphs
    and maps of expressions, and for constraints of an optimisation.

    Args:
        system: open or closed.

    Returns:
        Function of positions q (nq, 1), and parameters p (np, 1) where there are any; residual and
        bound (k, 1), where k may be zero.

    Raises:
        ModelError: `system` is no System.
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
    """What the rows of `validity` tell, in their order.

    Args:
        system: open or closed.
    """
    require_system(system)
    return tuple(row.name for row in _rows(system, SX.sym("q", system.nq)))


def _rows(system: System, q: SX) -> list[ValidityRow]:
    return [*plain_rows(system, q), *(loop_rows(system, q) if system.is_closed else [])]
