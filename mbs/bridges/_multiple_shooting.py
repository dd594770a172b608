"""Direct multiple shooting into `casadi.Opti`."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from casadi import MX, Opti

from mbs.bridges._step import advance
from mbs.bridges.explicit import Model, explicit
from mbs.bridges.opti import (
    Grid,
    Transcription,
    elements_of,
    parameter_values,
    require_counts,
    variable,
)


def multiple_shooting(
    opti: Opti, model: Model, grid: Grid, *, substeps: int = 1, p: Any = None
) -> Transcription:
    """Add the equations of motion to an Opti problem by direct multiple shooting.

    The variables are states at knots and efforts on stages, with the constraints x[k + 1] =
    step(x[k], u[k]). The equations are compiled once and mapped over the stages; the Runge-Kutta
    method runs on all stages at once, so the graph of the problem is as small as that of one step.
    The method is for explicit equations that are not stiff: open chains, and loops with a closed
    form, for which the loops remain exactly closed.

    Source: Bock and Plitt 1984; Kutta 1901.

    Args:
        opti: problem that receives the variables and constraints. Cost, boundary conditions and
            limits are added by the caller.
        model: Dae without algebraic states, or Function of (x, u) or (x, u, p) that returns dx/dt.
        grid: stages, their duration and evaluation.
        substeps: number of steps of the classical Runge-Kutta method of order 4 per stage.
        p: parameters as numbers or an expression of `opti`, such as variables; or a dict of numbers
            by name. Parameters of a Dae that are not given have their default values.

    Returns:
        Variables of the problem.

    Raises:
        ModelError: the model has algebraic states, or parameters have no values.
    """
    require_counts(opti, grid, substeps=substeps)
    ode, count = explicit(model), grid.stages
    x = variable(opti, ode.size1_in("x"), count + 1)
    u = variable(opti, ode.size1_in("u"), count)
    p = parameter_values(model, ode.size1_in("p"), p)
    every = casadi.repmat(p, 1, count)
    rates = grid.mapped(ode, count)
    ends = advance(lambda at: rates(at, u, every), x[:, :-1], grid.step, substeps)
    opti.subject_to(casadi.vec(x[:, 1:] - ends) == 0)
    return Transcription(
        opti=opti,
        x=x,
        u=u,
        p=p,
        step=grid.step,
        x_points=x[:, :-1],
        z_points=MX(0, count),
        u_points=u,
        weights=np.ones(1),
        nodes=np.zeros(1),
        variables={"x": x, "u": u},
        elements=elements_of(model),
    )
