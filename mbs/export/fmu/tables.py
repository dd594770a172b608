"""The generated C of an FMU: its tables and the functions that it evaluates."""

import math
from collections.abc import Iterable, Sequence

import casadi

from mbs.errors import ExportError
from mbs.export.fmu.description import FmuModel, Variable
from mbs.native.compiled import generated, unwritten

_OPEN = ("mbs_rhs", "mbs_tangent", "mbs_adjoint")
_CLOSED = (*_OPEN, "mbs_closure", "mbs_sensitivity")

_HEADER = """\
/* Sizes and tables of the model, generated together with modelDescription.xml. */
#ifndef MBS_MODEL_H
#define MBS_MODEL_H

#define MODEL_GUID {guid}
#define MODEL_TOLERANCE {tolerance}
#define NX {nx}
#define NU {nu}
#define NY {ny}
#define NP {np}
#define NZ {nz}
{solver}
extern const double MODEL_START[], MODEL_NOMINAL[], MODEL_MIN[], MODEL_MAX[];
extern const char *const MODEL_NAMES[];

{prototypes}
#endif
"""
_PROTOTYPE = """\
int {name}(const double **arg, double **res, long long *iw, double *w, int mem);
int {name}_work(long long *arg, long long *res, long long *iw, long long *w);
"""


def header(model: FmuModel, guid: str) -> str:
    """The file model.h.

    Args:
        model: what the FMU is.
        guid: identity that the library asks for.

    Returns:
        its text.
    """
    names = _OPEN if model.closure is None else _CLOSED
    solver = ""
    if model.solver == "rodas":
        names, solver = (*names, "mbs_jacobian"), "#define MODEL_RODAS\n"
    elif model.solver == "rk4":
        solver = f"#define MODEL_FIXED_STEP {float(model.internal_step)!r}\n"
    return _HEADER.format(
        guid=_quoted(guid),
        tolerance=repr(float(model.tolerance)),
        nx=len(model.states),
        nu=len(model.inputs),
        ny=len(model.outputs),
        np=len(model.parameters),
        nz=len(model.dependents),
        solver=solver,
        prototypes="".join(_PROTOTYPE.format(name=name) for name in names),
    )


def source(model: FmuModel) -> str:
    """The file model.c.

    Args:
        model: what the FMU is.

    Returns:
        its text.

    Raises:
        ExportError: a function holds a node that CasADi cannot write as C.
    """
    code = generated(functions(model))
    if problem := unwritten(code):
        raise ExportError(f"FMU {model.name}: {problem}")
    variables = [entry.variable for entry in model.entries]
    low = (-math.inf if v.min is None else v.min for v in variables)
    high = (math.inf if v.max is None else v.max for v in variables)
    tables = [
        _numbers("MODEL_START", (v.start for v in variables)),
        _numbers("MODEL_NOMINAL", (v.nominal for v in variables)),
        _numbers("MODEL_MIN", low),
        _numbers("MODEL_MAX", high),
        _table("const char *const MODEL_NAMES", (_quoted(v.name) for v in variables)),
    ]
    return (
        '#include <math.h>\n\n#include "model.h"\n\n'
        + "\n".join(tables)
        + "\n/* The functions stay inside the library. */\n#define CASADI_SYMBOL_EXPORT\n"
        + code
    )


def functions(model: FmuModel) -> tuple[casadi.Function, ...]:
    """The functions under the names that core.c calls, every input and output dense.

    Args:
        model: what the FMU computes.

    Returns:
        `mbs_rhs(t, x, z, u, p) -> (xdot, y)`, `mbs_tangent(t, x, z, u, p, dx, du, dp) ->
        (dxdot, dy, dz)`, `mbs_adjoint(t, x, z, u, p, wxdot, wy, wz) -> (gx, gu, gp)` and, where
        loops are closed, `mbs_closure(x, z, p) -> (z, residual)` and
        `mbs_sensitivity(x, z, p) -> steepness`; for an implicit solver
        `mbs_jacobian(t, x, z, u, p) -> (d xdot / d x, d xdot / d t)`.
    """
    t, x = casadi.MX.sym("t"), casadi.MX.sym("x", len(model.states))
    z, u = casadi.MX.sym("z", len(model.dependents)), casadi.MX.sym("u", len(model.inputs))
    p = casadi.MX.sym("p", len(model.parameters))
    dx, du, dp = (casadi.MX.sym(name, v.numel()) for name, v in (("dx", x), ("du", u), ("dp", p)))
    point = [t, x, z, u, p]
    answers = [
        casadi.Function("mbs_rhs", point, _dense(model.rhs.call(point))),
        casadi.Function(
            "mbs_tangent", [*point, dx, du, dp], _dense(_tangent(model, point, [dx, du, dp]))
        ),
    ]
    answers.append(_adjoint(model, answers[1]))
    if model.closure is not None:
        loop = [x, z, p]
        answers.append(casadi.Function("mbs_closure", loop, _dense(model.closure.call(loop))))
        answers.append(casadi.Function("mbs_sensitivity", loop, [_steepness(model, loop)]))
    if model.solver == "rodas":
        answers.append(casadi.Function("mbs_jacobian", point, _dense(_jacobian(model, point))))
    return tuple(answers)


def _jacobian(model: FmuModel, point: list[casadi.MX]) -> list[casadi.MX]:
    """How xdot changes with x, column by column and through the closure, and with t."""
    t, x, z, _, p = point
    xdot = model.rhs.call(point)[0]
    J = casadi.densify(casadi.jacobian(xdot, x))
    if model.closure is not None:
        moved = casadi.jacobian(model.closure.call([x, z, p])[0], x)
        J += casadi.mtimes(casadi.jacobian(xdot, z), moved)
    return [J, casadi.jacobian(xdot, t)]


def _tangent(model: FmuModel, point: list[casadi.MX], seeds: list[casadi.MX]) -> list[casadi.MX]:
    """dxdot, dy and dz along a direction.

    At a solution of the closure, the derivative of one Newton step z - J^-1 r is -J^-1 dr: that
    of the dependent coordinates themselves.
    """
    t, x, z, _, p = point
    dx, du, dp = seeds
    dz = casadi.MX(z.numel(), 1)
    if model.closure is not None:
        dz = _forward(model.closure, [x, z, p], [dx, dz, dp])[0]
    dt = casadi.MX(t.numel(), 1)
    return [*_forward(model.rhs, point, [dt, dx, dz, du, dp]), dz]


def _adjoint(model: FmuModel, tangent: casadi.Function) -> casadi.Function:
    """The transpose of the tangent, which is linear in its seeds."""
    point = tangent.mx_in()[:5]
    zeros = [casadi.MX(*tangent.size_in(k)) for k in range(5, 8)]
    weights = [
        casadi.MX.sym(name, tangent.numel_out(k)) for k, name in enumerate(("wxdot", "wy", "wz"))
    ]
    nominal = [casadi.MX(*tangent.size_out(k)) for k in range(3)]
    slopes = tangent.reverse(1).call([*point, *zeros, *nominal, *weights])
    return casadi.Function("mbs_adjoint", [*point, *weights], _dense(slopes[5:]))


def _steepness(model: FmuModel, loop: list[casadi.MX]) -> casadi.MX:
    """How many nominal sizes z moves when x and p change by about their own size.

    It is huge where rank is lost; p is there for postures where x and z lose it together.
    """
    assert model.closure is not None
    _, z, p = loop
    dx = casadi.DM(
        [v.nominal * w for v, w in zip(model.states, _weights(model.states), strict=True)]
    )
    dp = p * casadi.DM(_weights(model.parameters))
    dz = _forward(model.closure, loop, [casadi.MX(dx), casadi.MX(z.numel(), 1), dp])[0]
    sizes = casadi.DM([v.nominal for v in model.dependents])
    return casadi.norm_inf(casadi.vec(dz) / sizes)


def _weights(variables: Sequence[Variable]) -> list[float]:
    """Unequal numbers about one, so that effects of the variables do not cancel."""
    return [1 + k / len(variables) for k in range(len(variables))]


def _forward(
    function: casadi.Function, point: list[casadi.MX], seeds: list[casadi.MX]
) -> list[casadi.MX]:
    values = function.call(point)
    answer: list[casadi.MX] = function.forward(1).call([*point, *values, *seeds])
    return answer


def _dense(values: Iterable[casadi.MX]) -> list[casadi.MX]:
    return [casadi.densify(casadi.vec(value)) for value in values]


def _numbers(name: str, values: Iterable[float]) -> str:
    return _table(f"const double {name}", (_number(v) for v in values))


def _number(value: float) -> str:
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return repr(float(value))


def _table(declaration: str, items: Iterable[str]) -> str:
    texts = list(items) or ["0"]
    return f"{declaration}[] = {{\n" + "".join(f"    {text},\n" for text in texts) + "};\n"


def _quoted(text: str) -> str:
    plain = {byte: chr(byte) for byte in range(32, 127) if chr(byte) not in '"\\?'}
    return '"' + "".join(plain.get(byte, f"\\{byte:03o}") for byte in text.encode()) + '"'
