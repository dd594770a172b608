"""Equations of motion as the fields of an `AcadosModel`."""

from __future__ import annotations

from typing import Any

import casadi
from casadi import SX, Function

from mbs.bridges.explicit import require_dae
from mbs.errors import ModelError
from mbs.models.dae import Dae
from mbs.text import quoted

_HIGHER = ("index2", "index3", "ggl")


def acados_fields(dae: Dae, name: str = "model") -> dict[str, Any]:
    """Fields of an `AcadosModel`, to set one by one: ``setattr(model, field, value)``.

    f_impl_expr is [xdot - ode; alg] = 0. Its derivative by (xdot, z) is regular where that of
    `alg` by z is: always for "reduced" and for open chains, and for "index1" wherever the closure
    rows are independent. f_expl_expr is there when there are no algebraic states.

    Args:
        dae: "reduced" for the integrator ERK, or with "index1" for IRK and GNSF.
        name: of the model: letters, digits and single underscores, for it becomes a part of names
            in C.

    Returns:
        name, x, xdot, u, z, p, f_impl_expr and perhaps f_expl_expr.

    Raises:
        ModelError: the form is of index 2 or 3, which acados does not integrate; or the name does
            not serve in C.
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
