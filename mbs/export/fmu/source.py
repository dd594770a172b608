"""Generated C files of an FMU: model.h and model.c with tables and functions."""

import math
from collections.abc import Iterable, Sequence
from itertools import accumulate

import casadi
import numpy as np

from mbs.errors import ExportError, ModelError
from mbs.export.fmu.description import FmuModel, FmuVariable, Jumps
from mbs.loops.closing import distance_units
from mbs.loops.examination import LEAST_SINE
from mbs.models.state.events import StateEvents
from mbs.models.state.tree import TreeState
from mbs.native._compiled import generated, unwritten
from mbs.native.frames import WorkSize
from mbs.native.scalar_source import plain_source
from mbs.solvers.block_triangular import Block, block_triangular

# Functions that an FMU evaluates, under the names that its C files call.


def functions(model: FmuModel, *, adjoint: bool) -> tuple[casadi.Function, ...]:
    """Return the functions that the C files of an FMU call, with dense inputs and outputs.

    Args:
        model: description of the FMU.
        adjoint: whether to include `mbs_adjoint`, which only FMI 3.0 can call.

    Returns:
        Functions with the names below. p holds the parameters, then the modes. g: indicators.
        Always `mbs_rhs(t, x, z, u, p) -> (xdot, y)` and `mbs_tangent(t, x, z, u, p, dt, dx, du, dp)
        -> (dxdot, dy, dz, dg)`, with dp for the parameters only. On request
        `mbs_adjoint(t, x, z, u, p, wxdot, wy, wz, wg) -> (gt, gx, gu, gp)`.
        For closed loops `mbs_closure(x, z, p) -> (z, residual)`, `mbs_sensitivity(x, z, p) ->
        steepness`, and `mbs_slopes(x, z, p) -> J` and `mbs_sines(x, z, p)` if the model has slopes
        and sines, and `mbs_cuts(x, z, p)` if it has cut joints. For tree equations `mbs_tree_rhs`
        and others of `TreeState`. For events `mbs_first`, `mbs_indicators`, `mbs_jump` and, if
        available, `mbs_approaches` of `Jumps`,
        and `mbs_rates(t, x, z, u, p, du) -> dg/dt` along the motion, where du are the derivatives
        of the inputs. Events on tree equations have `mbs_tree_indicators` and so on, without first.
        If the model has rules, `mbs_excess(x, p)`. For an implicit solver `mbs_jacobian(t, x, z, u,
        p, du) -> (d xdot / d x, d xdot / d t)`, or `mbs_tree_jacobian` for tree equations.
    """
    t, x = casadi.MX.sym("t"), casadi.MX.sym("x", len(model.states))
    z, u = casadi.MX.sym("z", len(model.dependents)), casadi.MX.sym("u", len(model.inputs))
    p = casadi.MX.sym("p", len(model.parameters) + len(model.modes))
    point, du = [t, x, z, u, p], casadi.MX.sym("du", u.numel())
    answers = [
        casadi.Function("mbs_rhs", point, _dense(model.rhs.call(point))),
        _tangent(model, point),
    ]
    if adjoint:
        answers.append(_adjoint(model, point))
    answers.extend(_loops(model, [x, z, p]))
    if (tree := model.tree) is not None:
        X = casadi.MX.sym("X", tree.start.numel_out(0))
        answers.extend(_tree(tree, [t, X, x, z, u, p]))
        if tree.events is not None:
            answers.extend(_tree_events(model, tree, [t, X, z, u, p], du))
    if model.jumps is not None:
        answers.extend(_events(model.jumps, point))
        rates = _rates(model, point, du)
        answers.append(casadi.Function("mbs_rates", [*point, du], _dense([rates])))
    if model.rules is not None:
        excess = _dense(model.rules.excess.call([x, _own(model, p)]))
        answers.append(casadi.Function("mbs_excess", [x, p], excess))
    if model.solver == "rodas" and tree is None:
        slopes = _dense(_jacobian(model, point, du))
        answers.append(casadi.Function("mbs_jacobian", [*point, du], slopes))
    if model.solver == "rodas" and tree is not None:
        whole = [t, X, z, u, p]
        rate = tree.rhs.call([t, X, casadi.MX(0, 1), u, p])[0]
        J = casadi.densify(casadi.jacobian(rate, X))
        rise = casadi.jacobian(rate, t) + casadi.jtimes(rate, u, du)
        slopes = _dense([J, rise])
        answers.append(casadi.Function("mbs_tree_jacobian", [*whole, du], slopes))
    return tuple(answers)


def _loops(model: FmuModel, whole: list[casadi.MX]) -> list[casadi.Function]:
    """Return the functions of closed loops, with arguments x, z and p."""
    if model.closure is None:
        return []
    x, z, p = whole
    loop = [x, z, _own(model, p)]
    found = {"closure": _dense(model.closure.call(loop)), "sensitivity": [_steep(model, loop)]}
    if model.slopes is not None:
        found["slopes"] = [casadi.densify(model.slopes.call(loop)[0])]
    if model.sines is not None:
        found["sines"] = _dense(model.sines.call(loop))
    if model.cut_positions is not None:
        found["cuts"] = _dense(model.cut_positions.call(loop))
    return [casadi.Function(f"mbs_{name}", whole, values) for name, values in found.items()]


def _tree(tree: TreeState, symbols: list[casadi.MX]) -> list[casadi.Function]:
    """Return the functions `mbs_tree_..(t, X, z, u, p)` of the tree equations; z has no effect.

    They include `mbs_tree_start(t, x, z, u, p) -> X` and `mbs_tree_rate(X) -> q'`.
    """
    t, X, x, z, u, p = symbols
    through = tree.passage
    named = {
        "rhs": tree.rhs,
        "project": tree.project,
        "rows": through.rows,
        "forces": through.forces,
        "regularity": through.regularity,
    }
    empty, point, first = [t, X, casadi.MX(0, 1), u, p], [t, X, z, u, p], [t, x, z, u, p]
    functions = [
        casadi.Function(f"mbs_tree_{name}", point, _dense(function.call(empty)))
        for name, function in named.items()
    ]
    start = casadi.Function("mbs_tree_start", first, _dense(tree.start.call(first)))
    return [*functions, start, casadi.Function("mbs_tree_rate", [X], _dense([tree.rate(X)]))]


def _tree_events(
    model: FmuModel, tree: TreeState, point: list[casadi.MX], du: casadi.MX
) -> list[casadi.Function]:
    """Return the event functions `mbs_tree_..(t, X, z, u, p)` of the tree; z has no effect."""
    t, X, _, u, p = point
    events, own = tree.events, [t, X, casadi.MX(0, 1), u, p]
    assert events is not None
    fired = casadi.MX.sym("fired", len(events.names))
    along = [casadi.MX(1), tree.rhs.call(own)[0], own[2], du, casadi.MX(p.numel(), 1)]
    named = {
        "indicators": (point, events.indicators.call(own)),
        "rates": ([*point, du], _forward(events.indicators, own, along)),
        "jump": ([*point, fired], events.jump.call([*own, fired])),
    }
    if events.approaches is not None:
        named["approaches"] = point, events.approaches.call(own)
    return [
        casadi.Function(f"mbs_tree_{name}", taken, _dense(values))
        for name, (taken, values) in named.items()
    ]


def watched(model: FmuModel) -> tuple[str, ...]:
    """Return the names of the event indicators of a model, for error messages.

    Args:
        model: description of the FMU.
    """
    return model.jumps.names if model.jumps else ()


def _jacobian(model: FmuModel, point: list[casadi.MX], du: casadi.MX) -> list[casadi.MX]:
    """Return d xdot / d x, dense and through the closure of the loops, and d xdot / d t."""
    t, x, z, u, p = point
    xdot = model.rhs.call(point)[0]
    J = casadi.densify(casadi.jacobian(xdot, x))
    if model.closure is not None:
        dz = casadi.jacobian(model.closure.call([x, z, _own(model, p)])[0], x)
        J += casadi.mtimes(casadi.jacobian(xdot, z), dz)
    return [J, casadi.jacobian(xdot, t) + casadi.jtimes(xdot, u, du)]


def _events(jumps: Jumps, point: list[casadi.MX]) -> list[casadi.Function]:
    fired = casadi.MX.sym("fired", len(jumps.names))
    g = jumps.indicators.call(point)
    near = []
    if jumps.approaches is not None:
        found = _dense(jumps.approaches.call(point))
        near.append(casadi.Function("mbs_approaches", point, found))
    return [
        *near,
        casadi.Function("mbs_first", point, _dense(jumps.first.call(point))),
        casadi.Function("mbs_indicators", point, _dense(g)),
        casadi.Function("mbs_jump", [*point, fired], _dense(jumps.jump.call([*point, fired]))),
    ]


def _names_of_events(events: Jumps | StateEvents | None, prefix: str = "mbs_") -> tuple[str, ...]:
    """Return the names of the event functions of an FMU."""
    if events is None:
        return ()
    names = _EVENTS if prefix == "mbs_" else _TREE_EVENTS
    return names if events.approaches is None else (*names, f"{prefix}approaches")


def _rates(model: FmuModel, point: list[casadi.MX], du: casadi.MX) -> casadi.MX:
    """Return the time derivatives of the indicators along the motion."""
    xdot, p = model.rhs.call(point)[0], casadi.MX(len(model.parameters), 1)
    return _directions(model, point, [casadi.MX(1), xdot, du, p])[3]


def _tangent(model: FmuModel, point: list[casadi.MX]) -> casadi.Function:
    t, x, _, u, _ = point
    sizes = (("dt", t), ("dx", x), ("du", u))
    seeds = [casadi.MX.sym(name, v.numel()) for name, v in sizes]
    seeds.append(casadi.MX.sym("dp", len(model.parameters)))
    moves = _directions(model, point, seeds)
    return casadi.Function("mbs_tangent", [*point, *seeds], _dense(moves))


def _directions(
    model: FmuModel, point: list[casadi.MX], seeds: list[casadi.MX]
) -> tuple[casadi.MX, casadi.MX, casadi.MX, casadi.MX]:
    """Return the directional derivatives dxdot, dy, dz and dg, with constant modes.

    At a solution of the closure, the derivative of a Newton step z - J^-1 r is -J^-1 dr. It equals
    the derivative of the dependent coordinates.
    """
    _, x, z, _, p = point
    dt, dx, du, dp = seeds
    dz, dg = casadi.MX(z.numel(), 1), casadi.MX(0, 1)
    if model.closure is not None:
        dz = _forward(model.closure, [x, z, _own(model, p)], [dx, dz, dp])[0]
    along = [dt, dx, dz, du, casadi.vertcat(dp, casadi.MX(len(model.modes), 1))]
    dxdot, dy = _forward(model.rhs, point, along)
    if model.jumps is not None:
        dg = _forward(model.jumps.indicators, point, along)[0]
    return dxdot, dy, dz, dg


def _adjoint(model: FmuModel, point: list[casadi.MX]) -> casadi.Function:
    """Return the transpose of the tangent, by first derivatives only, which user functions have."""
    _, x, z, _, p = point
    sizes = (len(model.states), len(model.outputs), z.numel(), len(watched(model)))
    names = ("wxdot", "wy", "wz", "wg")
    weights = [casadi.MX.sym(name, size) for name, size in zip(names, sizes, strict=True)]
    wxdot, wy, wz, wg = weights
    back = _backward(model.rhs, point, [wxdot, wy])
    if model.jumps is not None:
        more = _backward(model.jumps.indicators, point, [wg])
        back = [a + b for a, b in zip(back, more, strict=True)]
    gt, gx, gz, gu, gp = back
    gp = _own(model, gp)
    if model.closure is not None:
        loop = [x, z, _own(model, p)]
        hx, _, hp = _backward(model.closure, loop, [gz + wz, casadi.MX(1, 1)])
        gx, gp = gx + hx, gp + hp
    return casadi.Function("mbs_adjoint", [*point, *weights], _dense([gt, gx, gu, gp]))


def _own(model: FmuModel, p: casadi.MX) -> casadi.MX:
    """Return the parameters in p, without the modes after them."""
    own: casadi.MX = casadi.vertsplit(p, [0, len(model.parameters), p.numel()])[0]
    return own


def _steep(model: FmuModel, loop: list[casadi.MX]) -> casadi.MX:
    assert model.closure is not None
    return steepness(model.closure, loop, (model.states, model.parameters, model.dependents))


def steepness(
    closure: casadi.Function,
    loop: list[casadi.MX],
    variables: tuple[Sequence[FmuVariable], Sequence[FmuVariable], Sequence[FmuVariable]],
) -> casadi.MX:
    """Return the largest change of z, in nominal sizes, for changes of x and p by about their size.

    It is very large near a loss of rank of the closure Jacobian. The change of p reveals
    configurations in which the rank is lost for x and z together.

    Args:
        closure: `closure(x, z, p)` as in `FmuModel`.
        loop: symbols x, z and p.
        variables: variables of x, p and z.
    """
    _, z, p = loop
    states, parameters, dependents = variables
    dx = casadi.DM([v.nominal * w for v, w in zip(states, _weights(states), strict=True)])
    dp = p * casadi.DM(_weights(parameters))
    dz = _forward(closure, loop, [casadi.MX(dx), casadi.MX(z.numel(), 1), dp])[0]
    sizes = casadi.DM([v.nominal for v in dependents])
    return casadi.norm_inf(casadi.vec(dz) / sizes)


def _weights(variables: Sequence[FmuVariable]) -> list[float]:
    """Return unequal weights from 1 to 2, so that effects of the variables do not cancel."""
    return [1 + k / len(variables) for k in range(len(variables))]


def _forward(
    function: casadi.Function, point: list[casadi.MX], seeds: list[casadi.MX]
) -> list[casadi.MX]:
    values = function.call(point)
    answer: list[casadi.MX] = function.forward(1).call([*point, *values, *seeds])
    return answer


def _backward(
    function: casadi.Function, point: list[casadi.MX], weights: list[casadi.MX]
) -> list[casadi.MX]:
    values = function.call(point)
    answer: list[casadi.MX] = function.reverse(1).call([*point, *values, *weights])
    return answer


def _dense(values: Iterable[casadi.MX]) -> list[casadi.MX]:
    return [casadi.densify(casadi.vec(value)) for value in values]


_OPEN = ("mbs_rhs", "mbs_tangent")
_LOOPS = ("mbs_closure", "mbs_sensitivity")
_TREE = tuple(
    f"mbs_tree_{name}"
    for name in ("rhs", "project", "rows", "forces", "regularity", "start", "rate")
)
_EVENTS = ("mbs_first", "mbs_indicators", "mbs_rates", "mbs_jump")
_TREE_EVENTS = ("mbs_tree_indicators", "mbs_tree_rates", "mbs_tree_jump")


def _names_of_loops(model: FmuModel) -> tuple[str, ...]:
    """Return the names of the functions of closed loops of an FMU."""
    if model.closure is None:
        return ()
    watched = ("mbs_slopes",) if model.slopes is not None else ()
    measured = ("mbs_sines",) if model.sines is not None else ()
    cut = ("mbs_cuts",) if model.cut_positions is not None else ()
    return (*_LOOPS, *watched, *measured, *cut)


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
#define NM {nm}
#define NZ {nz}
#define NK {nk}
#define NB {nb}
#define PASSIVE_V {passive_v}
#define PASSIVE_A {passive_a}
#define N_PASSIVE {n_passive}
#define NS {ns}
#define NC {nc}
#define NCUT {ncut}
/* elements of the arrays that the functions below take */
#define SZ_ARG {work.arg}
#define SZ_RES {work.res}
#define SZ_IW {work.iw}
#define SZ_W {work.w}
{options}
extern const double MODEL_START[], MODEL_NOMINAL[], MODEL_MIN[], MODEL_MAX[];
extern const char *const MODEL_NAMES[], *const MODEL_INDICATORS[];
extern const char MODEL_FIXED[];
/* 1 for states that the dependents follow from */
extern const int MODEL_LEADS[];
/* of the dependents, then of the cut joints: 1 for angles; what distances are divided by, 1 rad or
 * the size of the loops */
extern const int MODEL_TURNS[];
extern const double MODEL_SPANS[];
extern const int MODEL_QUATERNIONS[]; /* 1 for the first element of a quaternion of a cut joint */
{arrays}/* diagonal blocks of the slopes of the closure: the end of each in rows and columns */
extern const int MODEL_BLOCKS[], MODEL_ROWS[], MODEL_COLUMNS[];

{prototypes}
#endif
"""
_ARRAYS = """\
#define MODEL_ARRAYS
/* elements of each variable, none of one that stands within an array */
extern const int MODEL_SIZES[];
"""
_PROTOTYPE = """\
int {name}(const double **arg, double **res, long long *iw, double *w, int mem);
"""


def header(model: FmuModel, guid: str, work: WorkSize, *, adjoint: bool) -> str:
    """Return the text of the file model.h.

    Args:
        model: description of the FMU.
        guid: identifier that the compiled library checks.
        work: sizes of the work arrays of the functions in model.c.
        adjoint: whether the FMI version has adjoint derivatives.

    Returns:
        Text of the header.
    """
    names: tuple[str, ...] = _OPEN
    options = ""
    if adjoint:
        names, options = (*names, "mbs_adjoint"), "#define MODEL_ADJOINT\n"
    names = (*names, *_names_of_loops(model))
    if "mbs_sines" in names:
        options += f"#define MODEL_SINES {LEAST_SINE!r} /* squared; no derivatives below it */\n"
    if (tree := model.tree) is not None:
        names = (*names, *_TREE, *_names_of_events(tree.events, "mbs_tree_"))
    names = (*names, *_names_of_events(model.jumps))
    if "mbs_approaches" in names:
        options += "#define MODEL_APPROACHES\n"
    if (rules := model.rules) is not None:
        names = (*names, "mbs_excess")
        options += f"#define MODEL_RULES_AT_START {rules.at_start}\n"
        options += f"#define MODEL_RULES {len(rules.sentences)}\n"
        options += "extern const char *const MODEL_SENTENCES[];\n"
    if model.target == "bare":
        options += "#define MODEL_BARE\n"
    if model.solver == "rodas":
        names = (*names, "mbs_jacobian" if tree is None else "mbs_tree_jacobian")
        options += "#define MODEL_RODAS\n"
    elif model.solver == "rk4":
        options += f"#define MODEL_FIXED_STEP {float(model.internal_step)!r}\n"
    if model.max_step is not None and model.solver != "rk4":
        options += f"#define MODEL_MAX_STEP {float(model.max_step)!r}\n"
    return _HEADER.format(
        guid=_quote(guid),
        tolerance=repr(float(model.tolerance)),
        nx=len(model.states),
        nu=len(model.inputs),
        ny=len(model.outputs),
        np=len(model.parameters),
        nm=len(model.modes),
        nk=len(watched(model)),
        nz=len(model.dependents),
        nb=len(_blocks(model)),
        passive_v=model.passive[0],
        passive_a=model.passive[1],
        n_passive=model.passive[2],
        ns=len(model.slots),
        nc=int(model.charted),
        ncut=len(model.cuts),
        work=work,
        arrays=_ARRAYS if model.arrays else "",
        options=options + ("" if tree is None else _tree_sizes(model, tree)),
        prototypes="".join(_PROTOTYPE.format(name=name) for name in names),
    )


_LEAST = WorkSize(arg=9, res=8)
"""Smallest sizes of arg and res: the C files of an FMU always set these elements."""


def source(model: FmuModel, *, adjoint: bool) -> tuple[str, WorkSize]:
    """Return the text of the file model.c and the work sizes of its functions.

    Args:
        model: description of the FMU.
        adjoint: whether the FMI version has adjoint derivatives.

    Returns:
        Text of the C file, and sizes of the work arrays.

    Raises:
        ExportError: a function contains a node that CasADi cannot write as C, or that
            target="bare" does not support.
    """
    code, work = _code(model, functions(model, adjoint=adjoint))
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
        _table("const char *const MODEL_NAMES", (_quote(v.name) for v in variables)),
        _table("const char MODEL_FIXED", ("1" if v.fixed else "0" for v in variables)),
        _table("const char *const MODEL_INDICATORS", map(_quote, watched(model))),
        *_sentences(model),
        *_lead_tables(model),
        *_size_tables(model),
        *_block_tables(_blocks(model)),
        *_tree_tables(model),
    ]
    text = (
        '#include <math.h>\n\n#include "model.h"\n\n'
        + "\n".join(tables)
        + "\n/* The functions stay inside the library. */\n#define CASADI_SYMBOL_EXPORT\n"
        + code
    )
    return text, work.covering(_LEAST)


def _tree_sizes(model: FmuModel, tree: TreeState) -> str:
    sizes = ", ".join(map(str, tree.passage.size))
    alone = model.charted and (model.jumps is None or model.jumps.optional)
    return (
        f"#define MODEL_TREE {tree.start.numel_out(0)} /* its states */\n"
        f"#define MODEL_TREE_INSIDE {int(model.solver != 'rk4')} /* co-simulation has them */\n"
        f"#define MODEL_TREE_OUTSIDE {int(model.charted)} /* model exchange has charts of them */\n"
        f"#define MODEL_CHARTS_ALONE {int(alone)} /* and needs no events */\n"
        f"#define MODEL_PASSAGE {{{sizes}}}\n"
        f"#define N_HELD {len(tree.independent)}\n"
        f"#define MODEL_REGULARITY {tree.passage.typical!r}\n"
        "/* where states, dependents and velocities of dependent joints stand in it, and the\n"
        " * independent joints among its velocities; typical sizes of these */\n"
        "extern const int MODEL_TREE_STATES[], MODEL_TREE_DEPENDENTS[], MODEL_TREE_PASSIVE[];\n"
        "extern const int MODEL_TREE_HELD[];\n"
        "extern const double MODEL_TREE_UNITS[];\n"
    )


def _tree_tables(model: FmuModel) -> list[str]:
    """Return the C tables of indices of states and dependents of the FMU in the tree state."""
    if (tree := model.tree) is None:
        return []
    return [
        _table("const int MODEL_TREE_STATES", map(str, tree.states)),
        _table("const int MODEL_TREE_DEPENDENTS", map(str, tree.dependents)),
        _table("const int MODEL_TREE_PASSIVE", map(str, tree.passive)),
        _table("const int MODEL_TREE_HELD", map(str, tree.independent)),
        _numbers("MODEL_TREE_UNITS", (1 / unit for unit in tree.units)),
    ]


def _sentences(model: FmuModel) -> list[str]:
    """Return the C table of error messages of violated rules."""
    if model.rules is None:
        return []
    return [_table("const char *const MODEL_SENTENCES", map(_quote, model.rules.sentences))]


def _lead_tables(model: FmuModel) -> list[str]:
    if model.closure is None:
        return []
    units = [variable.unit for variable in (*model.dependents, *model.cuts)]
    firsts = (str(int(variable.name.endswith(".qw.solved"))) for variable in model.cuts)
    return [
        *([_table("const int MODEL_QUATERNIONS", firsts)] if model.cuts else []),
        _table("const int MODEL_LEADS", map(str, leading_states(model.closure))),
        _table("const int MODEL_TURNS", (str(int(unit == "rad")) for unit in units)),
        _numbers("MODEL_SPANS", distance_units(units, model.loop_size)),
    ]


def leading_states(closure: casadi.Function) -> list[int]:
    """Return 1 for each state on which the dependents depend, such as positions, else 0.

    Args:
        closure: `closure(x, z, p)`, one Newton step of z.
    """
    pattern = np.array(casadi.DM(closure.jac_sparsity(0, 0), 1))
    return [int(count > 0) for count in pattern.sum(axis=0)]


def _size_tables(model: FmuModel) -> list[str]:
    """Return the C table of numbers of elements of the variables, if some are arrays."""
    if not model.arrays:
        return []
    sizes = [1] * len(model.entries)
    for array in model.arrays:
        sizes[array.first : array.first + array.size] = [array.size] + [0] * (array.size - 1)
    return [_table("const int MODEL_SIZES", map(str, sizes))]


def _blocks(model: FmuModel) -> tuple[Block, ...]:
    return diagonal_blocks(model.slopes)


def diagonal_blocks(slopes: casadi.Function | None) -> tuple[Block, ...]:
    """Return the diagonal blocks of the closure Jacobian, empty if slopes is None."""
    if slopes is None:
        return ()
    pattern = np.array(casadi.DM(slopes.sparsity_out(0), 1)) != 0
    return block_triangular(pattern) or ()


def _block_tables(blocks: Sequence[Block]) -> list[str]:
    ends = accumulate(block.size for block in blocks)
    rows = (row for block in blocks for row in block.rows)
    columns = (column for block in blocks for column in block.columns)
    names = ("MODEL_BLOCKS", "MODEL_ROWS", "MODEL_COLUMNS")
    return [
        _table(f"const int {name}", map(str, values))
        for name, values in zip(names, (ends, rows, columns), strict=True)
    ]


def _code(model: FmuModel, functions: Iterable[casadi.Function]) -> tuple[str, WorkSize]:
    """Return C code and work sizes of functions.

    SX functions are written in short pieces, which compile fast, other functions by CasADi.
    """
    pieces, others, most = [], [], WorkSize()
    for function in functions:
        try:
            piece, work = plain_source([function])
        except ModelError as error:  # for example, it calls a user function
            if model.target == "bare":
                raise ExportError(
                    f"FMU {model.name}: an equation is not made of scalar operations ({error});"
                    " use target='hosted', or a controller that is"
                ) from error
            others.append(function)
            work = WorkSize(function.sz_arg(), function.sz_res(), function.sz_iw(), function.sz_w())
        else:
            pieces.append(piece)
        most = most.covering(work)
    return "\n".join([*pieces, *([generated(others)] if others else [])]), most


def _numbers(name: str, values: Iterable[float]) -> str:
    return _table(f"const double {name}", (_number(v) for v in values))


def _number(value: float) -> str:
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return repr(float(value))


def _table(declaration: str, items: Iterable[str]) -> str:
    texts = list(items) or ["0"]
    return f"{declaration}[] = {{\n" + "".join(f"    {text},\n" for text in texts) + "};\n"


def _quote(text: str) -> str:
    plain = {byte: chr(byte) for byte in range(32, 127) if chr(byte) not in '"\\?'}
    return '"' + "".join(plain.get(byte, f"\\{byte:03o}") for byte in text.encode()) + '"'
