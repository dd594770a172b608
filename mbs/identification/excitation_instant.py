"""Observations and limited quantities of a system at one instant of a motion of its joints."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, Function

from mbs.assembly import System
from mbs.errors import ModelError, NoClosedForm
from mbs.identification.columns import Column
from mbs.identification.excitation_limits import Limits
from mbs.identification.regressor import regressor
from mbs.loops.function import function as closed_form
from mbs.loops.numeric import follow_active
from mbs.messages import did_you_mean
from mbs.models.geometry import transform
from mbs.models.inverse_dynamics import inverse_dynamics

Array = npt.NDArray[np.float64]


def instant(system: System, columns: Sequence[Column], limits: Limits) -> Function:
    """``instant(q_a, v_a, a_a) -> D, bounded``: what one instant adds to the observations.

    Positions of the other joints of a closed system follow by its closed form, or by continuation
    from the assembled posture where it has none.

    Args:
        system: open or closed, at the defaults of its parameters.
        columns: of the regressor that count.
        limits: of which `of_models` are computed.

    Returns:
        Function of (m, 1) positions, velocities and accelerations of the independent joints;
        D (k, m) the columns as rows, bounded (r, 1).

    Raises:
        ModelError: the regressor has no such column, or a plane names no frame.
    """
    m = len(system.active)
    q_a, v_a, a_a = (MX.sym(name, m) for name in ("q_a", "v_a", "a_a"))
    q = _posture(system, q_a)
    D = _regressor(system, columns)(q, v_a, a_a)
    bounded = [*_efforts(system, limits, q, v_a, a_a), *(q[k] for k, _ in limits.passive)]
    for plane in limits.planes:
        T = transform(system, plane.frame)(q)
        bounded.append(casadi.dot(DM(plane.unit_normal), (T @ DM([*plane.point, 1.0]))[:3]))
    outputs = [D.T, casadi.vertcat(MX(0, 1), *bounded)]
    names = ["q_a", "v_a", "a_a"], ["D", "bounded"]
    function = Function("instant", [q_a, v_a, a_a], outputs, *names)
    return function.expand() if _is_explicit(system) else function


def positions(system: System, q_a: Array) -> Array:
    """(n, nq) positions of the tree for independent ones (n, m)."""
    x = MX.sym("q_a", len(system.active))
    follow = Function("positions", [x], [_posture(system, x)])
    return np.asarray(DM(follow.map(len(q_a))(q_a.T))).T


def _posture(system: System, q_a: MX) -> MX:
    if not system.is_closed:
        return q_a
    p = DM(system.parameter_values())
    if _is_explicit(system):
        inputs = [q_a, p] if system.parameters else [q_a]
        return MX(Function.__call__(closed_form(system), *inputs))
    return MX(follow_active(system)(q_a, p))


def _is_explicit(system: System) -> bool:
    """Whether no iteration is needed to close the loops."""
    if not system.is_closed:
        return True
    try:
        closed_form(system)
    except NoClosedForm:
        return False
    return True


def _efforts(system: System, limits: Limits, q: MX, v_a: MX, a_a: MX) -> list[MX]:
    if not any(limit.is_finite for limit in limits.effort):
        return [MX(0) for _ in limits.effort]
    tau = inverse_dynamics(system)(q, v_a, a_a)
    return [tau[k] for k in range(len(limits.effort))]


def _regressor(system: System, columns: Sequence[Column]) -> Function:
    """The regressor with these columns alone."""
    model = regressor(
        system,
        offsets=any(column.kind == "offset" for column in columns),
        couplings=list(dict.fromkeys((c.link, c.other) for c in columns if c.other)),
    )
    places = []
    for column in columns:
        if column.name not in model.names:
            raise ModelError(
                f"{system.name}: the regressor has no column {column.name!r};"
                f" {did_you_mean(column.name, model.names)}"
            )
        places.append(model.names.index(column.name))
    m = len(system.active)
    inputs = [MX.sym(name, size) for name, size in (("q", system.nq), ("v", m), ("a", m))]
    return Function("columns", inputs, [model(*inputs)[:, places]])
