"""Explicit equations dx/dt = f(x, u, p) from a Dae or a Function."""

from __future__ import annotations

from typing import Any

from casadi import MX, SX, Function

from mbs.errors import ModelError
from mbs.models._dae import Dae
from mbs.text import quoted

Model = Dae | Function
"""Equations of motion: a `Dae`, or a Function of (x, u) or (x, u, p) that returns dx/dt."""


def require_dae(model: object) -> Dae:
    """Return the model, or raise if it is not a Dae.

    Args:
        model: any object.

    Raises:
        ModelError: the model is not a Dae; the message describes the required argument.
    """
    if not isinstance(model, Dae):
        raise ModelError(f"{quoted(model)} is not a Dae; give mbs.models.dae(system)")
    return model


def explicit(model: Model) -> Function:
    """``ode(x, u, p) -> dx/dt`` of equations without algebraic states.

    Args:
        model: Dae without z, or Function of (x, u) or (x, u, p) whose first output is dx/dt.

    Raises:
        ModelError: the Dae has algebraic states, or the Function has other inputs.
    """
    names = ["x", "u", "p"], ["ode"]
    if isinstance(model, Dae):
        if model.z.numel():
            raise ModelError(
                f"form {quoted(model.form)} has {model.z.numel()} algebraic states; use"
                " mbs.bridges.collocation, or the form 'reduced'"
            )
        given = [model.x, model.u, model.p]
        return Function("ode", given, [model.ode], *names, {"cse": True})
    _check(model)
    kind: Any = SX if model.is_a("SXFunction") else MX
    x, u = (kind.sym(n, model.size1_in(k)) for k, n in enumerate("xu"))
    p = kind.sym("p", model.size1_in(2) if model.n_in() == 3 else 0)
    rate, *_ = model.call([x, u, p][: model.n_in()])
    return Function("ode", [x, u, p], [rate], *names)


def _check(model: Function) -> None:
    """Raise ModelError unless a model is a Function of (x, u) or (x, u, p) that returns dx/dt."""
    if not isinstance(model, Function):
        raise ModelError(
            f"{quoted(model)} has no equations; give mbs.models.dae(system), or a Function"
            " of (x, u) or (x, u, p) that gives dx/dt"
        )
    columns = [model.size2_in(k) for k in range(model.n_in())]
    if model.n_in() not in (2, 3) or columns != [1] * len(columns):
        raise ModelError(
            f"{model.name()}: its inputs are {', '.join(model.name_in())}; give a Function of the"
            " vectors (x, u) or (x, u, p)"
        )
    if model.size_out(0) != model.size_in(0):
        raise ModelError(
            f"{model.name()}: its first output has the shape {model.size_out(0)}, x has"
            f" {model.size_in(0)}; give dx/dt first"
        )
