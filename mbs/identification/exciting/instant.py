"""Observations and limited quantities of a system at one instant of a motion of its joints."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import DM, MX, Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification.exciting.limits import MotionLimits
from mbs.identification.leading import signed_leads
from mbs.identification.postures import is_explicit, posture_of
from mbs.identification.regressors.columns import Column
from mbs.identification.regressors.dynamic import regressor
from mbs.models.geometry import transform
from mbs.models.inverse_dynamics import inverse_dynamics


def instant(system: System, columns: Sequence[Column], limits: MotionLimits) -> Function:
    """``instant(q_a, v_a, a_a) -> D, bounded``: what one instant adds to the observations.

    Positions of the other joints of a closed system follow by its closed form, or by continuation
    from the assembled posture where it has none.

    Args:
        system: open or closed, at the defaults of its parameters.
        columns: parameters of the system, under any names.
        limits: of which `of_models` are computed.

    Returns:
        Function of (m, 1) positions, velocities and accelerations of the independent joints;
        D (k, m) the columns as rows, bounded (r, 1).

    Raises:
        ModelError: a column is no parameter of the system, or a plane names no frame.
    """
    m = len(system.active)
    q_a, v_a, a_a = (MX.sym(name, m) for name in ("q_a", "v_a", "a_a"))
    q = posture_of(system, q_a)
    D = regressor(system, columns)(q, v_a, a_a)
    bounded = [*_efforts(system, limits, q, v_a, a_a), *(q[k] for k, _ in limits.passive)]
    for plane in limits.planes:
        T = transform(system, plane.frame)(q)
        bounded.append(casadi.dot(DM(plane.unit_normal), (T @ DM([*plane.point, 1.0]))[:3]))
    if limits.leading:
        bounded.append(signed_leads(system)(q))
    outputs = [D.T, casadi.vertcat(MX(0, 1), *bounded)]
    names = ["q_a", "v_a", "a_a"], ["D", "bounded"]
    function = Function("instant", [q_a, v_a, a_a], outputs, *names)
    return function.expand() if is_explicit(system) else function


def _efforts(system: System, limits: MotionLimits, q: MX, v_a: MX, a_a: MX) -> list[MX]:
    if not any(limit.is_finite for limit in limits.effort):
        return [MX(0) for _ in limits.effort]
    if system.motors != system.active:
        raise ModelError(
            f"{system.name}: limits of efforts are given and its motors are not its independent"
            " joints, so that they share efforts in many ways; leave the limits of efforts out"
        )
    tau = inverse_dynamics(system)(q, v_a, a_a)
    return [tau[k] for k in range(len(limits.effort))]
