"""Equations of motion as the fields of an `AcadosModel`."""

from __future__ import annotations

from typing import Any

import casadi
from casadi import SX, Function

from mbs.bridges.explicit import require_dae
from mbs.errors import ModelError
from mbs.models._dae import Dae
from mbs.text import quoted

_HIGHER = ("index2", "index3", "ggl")


def acados_fields(dae: Dae, name: str = "model") -> dict[str, Any]:
    """Return the fields of an `AcadosModel`, to set one by one: ``setattr(model, field, value)``.

    f_impl_expr is [xdot - ode; alg] = 0. Its Jacobian in (xdot, z) is regular if the Jacobian of
    `alg` in z is regular. This holds always for "reduced" and for open chains, and for "index1" if
    the closure rows are independent. f_expl_expr exists only without algebraic states.

    Args:
        dae: "reduced" for the integrator ERK; "reduced" or "index1" for IRK and GNSF.
        name: name of the model: letters, digits and single underscores, since it becomes part of C
            identifiers.

    Returns:
        Dict with name, x, xdot, u, z, p, f_impl_expr and, without algebraic states, f_expl_expr.

    Raises:
        ModelError: the form has index 2 or 3, which acados does not support, or the name is not
            valid in C.
    """
    require_dae(dae)
    if not isinstance(name, str) or not Function.check_name(name):
        raise ModelError(f"name is {quoted(name)}; use letters, digits and single underscores")
    closed = casadi.which_depends(dae.alg, dae.z, 1, True) if dae.z.numel() else []
    if dae.form in _HIGHER and not all(closed):
        raise ModelError(
            f"form {quoted(dae.form)} has algebraic equations without algebraic states; acados"
            " takes 'reduced' and 'index1'"
        )
    xdot = SX.sym("xdot", dae.x.numel())
    fields = {
        "name": name,
        "x": dae.x,
        "xdot": xdot,
        "u": dae.u,
        "z": dae.z,
        "p": dae.p,
        "f_impl_expr": casadi.vertcat(xdot - dae.ode, dae.alg),
    }
    return fields if dae.z.numel() else {**fields, "f_expl_expr": dae.ode}
