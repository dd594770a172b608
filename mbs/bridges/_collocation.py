"""Direct collocation into `casadi.Opti`."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from casadi import MX, Function, Opti

from mbs.bridges.explicit import Model, explicit, require_dae
from mbs.bridges.opti import (
    Grid,
    Transcription,
    elements_of,
    parameter_values,
    require_counts,
    variable,
)
from mbs.errors import ModelError
from mbs.models._dae import Dae
from mbs.text import quoted

SCHEMES = ("radau", "legendre")


def collocation(
    opti: Opti,
    model: Model,
    grid: Grid,
    *,
    points: int = 3,
    scheme: str = "radau",
    p: Any = None,
) -> Transcription:
    """Add the equations of motion to an Opti problem by direct collocation.

    The states are polynomials on each stage that satisfy the equations at the collocation points.
    The equations at one point are a Function that is compiled once and mapped over all points; the
    polynomials are a few matrix products for all stages. All forms of `mbs.models.dae` are
    supported; forms of index 2 and 3 require "radau". With "radau", the last point of a stage is
    the next knot, which is then not a separate variable.

    Source: Hairer and Wanner 1996, IV.5; Biegler 2010, chapter 10.

    Args:
        opti: problem that receives the variables and constraints. Cost, boundary conditions and
            limits are added by the caller. The invariants of a Dae are not included; add them at
            one knot, see `constraint_residuals`.
        model: Dae, or Function of (x, u) or (x, u, p) that returns dx/dt.
        grid: stages, their duration and evaluation.
        points: number K of collocation points per stage, 1 to 9.
        scheme: "radau", of order 2K - 1 and stiffly accurate, or "legendre", of order 2K.
        p: parameters as numbers or an expression of `opti`, such as variables; or a dict of numbers
            by name. Parameters of a Dae that are not given have their default values.

    Returns:
        Variables of the problem.

    Raises:
        ModelError: the scheme is unknown, or parameters have no values.
    """
    require_counts(opti, grid, points=points)
    nodes = _nodes(points, scheme)
    slopes, ends, weights = (np.array(c) for c in casadi.collocation_coeff(list(nodes)))
    residual, count = _residual(model), grid.stages
    x, z, u = (variable(opti, residual.size1_in(n), w) for n, w in _widths(points, count, scheme))
    inside = variable(opti, x.shape[0], points * count)
    last = inside[:, points - 1 :: points]
    knots = casadi.horzcat(x, last) if scheme == "radau" else x
    basis = [knots[:, :-1], *(inside[:, k::points] for k in range(points))]
    u_points = u[:, [k for k in range(count) for _ in range(points)]]
    p = parameter_values(model, residual.size1_in("p"), p)
    rates = casadi.vertcat(*(_combine(basis, slopes[:, k]) for k in range(points)))
    total = points * count
    rates = casadi.reshape(rates, x.shape[0], total)
    fixed = [casadi.repmat(value, 1, total) for value in (p, grid.step)]
    (rows,) = grid.mapped(residual, total).call([inside, rates, z, u_points, *fixed])
    opti.subject_to(casadi.vec(rows) == 0)
    if scheme != "radau":
        opti.subject_to(casadi.vec(knots[:, 1:] - _combine(basis, ends.ravel())) == 0)
    return Transcription(
        opti=opti,
        x=knots,
        u=u,
        p=p,
        step=grid.step,
        x_points=inside,
        z_points=z,
        u_points=u_points,
        weights=weights.ravel(),
        nodes=nodes,
        variables={"x": x, "u": u, "z": z, "x_points": inside},
        elements=elements_of(model),
    )


def constraint_residuals(model: Dae, x: MX, p: Any = None) -> MX:
    """Return the invariants of a Dae at a knot, which are zero along every motion.

    Constrain them to zero at one knot only, and only if x is not fixed there.

    Args:
        model: Dae of the states.
        x: (nx, 1) states at a knot.
        p: (np, 1) parameters of the transcription; default values if None.

    Raises:
        ModelError: the model is not a Dae, or the number of parameters is wrong.
    """
    p = parameter_values(require_dae(model), model.p.numel(), p)
    function = Function("invariants", [model.x, model.p], [model.invariants], {"cse": True})
    rows: MX = function(x, p)
    return rows


def _nodes(points: int, scheme: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the collocation points (points,) in a stage of length 1.

    Raises ModelError for an unknown scheme or more than nine points.
    """
    if scheme not in SCHEMES:
        raise ModelError(f"scheme is {quoted(scheme)}; use one of {', '.join(SCHEMES)}")
    if points > 9:
        raise ModelError(f"points is {quoted(points)}; use 1 to 9")
    return np.array(casadi.collocation_points(points, scheme))


def _widths(points: int, count: int, scheme: str) -> list[tuple[str, int]]:
    """Return (name, number of columns) of the variables x, z and u for `count` stages.

    Knots that are collocation points are not separate variables.
    """
    return [("x", 1 if scheme == "radau" else count + 1), ("z", points * count), ("u", count)]


def _residual(model: Model) -> Function:
    """Return the Function ``residual(x, rate, z, u, p, h)`` of the equations at one point.

    Its rows are h dx/dt - rate, with the rate per stage length, then the algebraic equations.
    """
    names = ["x", "rate", "z", "u", "p", "h"]
    if isinstance(model, Dae):
        rate, h = casadi.SX.sym("rate", model.x.numel()), casadi.SX.sym("h")
        rows = casadi.vertcat(h * model.ode - rate, model.alg)
        given = [model.x, rate, model.z, model.u, model.p, h]
        return Function("residual", given, [rows], names, ["rows"], {"cse": True})
    ode = explicit(model)
    kind: Any = casadi.SX if ode.is_a("SXFunction") else MX
    x, u, p = (kind.sym(n, ode.size1_in(n)) for n in ("x", "u", "p"))
    speed, h, z = kind.sym("rate", x.numel()), kind.sym("h"), kind.sym("z", 0)
    return Function("residual", [x, speed, z, u, p, h], [h * ode(x, u, p) - speed], names, ["rows"])


def _combine(basis: list[MX], weights: np.ndarray[Any, Any]) -> MX:
    """Return the sum of the matrices in `basis`, each times a number in `weights`; same shape."""
    terms = [float(w) * b for w, b in zip(weights, basis, strict=True)]
    total: MX = sum(terms[1:], terms[0])
    return total
