"""Observations and limited quantities of a system at one instant of a motion of its joints."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import DM, MX, Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification.columns import Column
from mbs.identification.excitation_limits import Limits
from mbs.identification.postures import is_explicit, posture_of
from mbs.identification.regressor import regressor
from mbs.messages import did_you_mean
from mbs.models.geometry import transform
from mbs.models.inverse_dynamics import inverse_dynamics


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
    q = posture_of(system, q_a)
    D = _regressor(system, columns)(q, v_a, a_a)
    bounded = [*_efforts(system, limits, q, v_a, a_a), *(q[k] for k, _ in limits.passive)]
    for plane in limits.planes:
        T = transform(system, plane.frame)(q)
        bounded.append(casadi.dot(DM(plane.unit_normal), (T @ DM([*plane.point, 1.0]))[:3]))
    outputs = [D.T, casadi.vertcat(MX(0, 1), *bounded)]
    names = ["q_a", "v_a", "a_a"], ["D", "bounded"]
    function = Function("instant", [q_a, v_a, a_a], outputs, *names)
    return function.expand() if is_explicit(system) else function


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
