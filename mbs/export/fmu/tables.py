"""The generated C of an FMU: its tables and the functions that it evaluates."""

import math
from collections.abc import Iterable, Sequence
from itertools import accumulate

import casadi
import numpy as np

from mbs.errors import ExportError, ModelError
from mbs.export.fmu.description import FmuModel
from mbs.export.fmu.equations import functions, watched
from mbs.models.tree_state import TreeState
from mbs.native.compiled import generated, unwritten
from mbs.native.plain_source import plain_source
from mbs.solvers.block_triangular import Block, block_triangular

_OPEN = ("mbs_rhs", "mbs_tangent")
_LOOPS = ("mbs_closure", "mbs_sensitivity")
_TREE = tuple(
    f"mbs_tree_{name}"
    for name in ("rhs", "project", "rows", "forces", "regularity", "start", "rate")
)
_EVENTS = ("mbs_first", "mbs_indicators", "mbs_rates", "mbs_jump")
_TREE_EVENTS = ("mbs_tree_indicators", "mbs_tree_rates", "mbs_tree_jump")

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
{options}
extern const double MODEL_START[], MODEL_NOMINAL[], MODEL_MIN[], MODEL_MAX[];
extern const char *const MODEL_NAMES[], *const MODEL_INDICATORS[];
extern const char MODEL_FIXED[];
/* 1 for states that the dependents follow from */
extern const int MODEL_LEADS[];
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
int {name}_work(long long *arg, long long *res, long long *iw, long long *w);
"""


def header(model: FmuModel, guid: str, *, adjoint: bool) -> str:
    """The file model.h.

    Args:
        model: what the FMU is.
        guid: identity that the library asks for.
        adjoint: the version of FMI calls adjoint derivatives.

    Returns:
        its text.
    """
    names: tuple[str, ...] = _OPEN
    options = ""
    if adjoint:
        names, options = (*names, "mbs_adjoint"), "#define MODEL_ADJOINT\n"
    if model.closure is not None:
        names = (*names, *_LOOPS, *(("mbs_slopes",) if model.slopes is not None else ()))
    if (tree := model.tree) is not None:
        names = (*names, *_TREE, *(_TREE_EVENTS if tree.events is not None else ()))
    if model.jumps is not None:
        names = (*names, *_EVENTS)
    if (rules := model.rules) is not None:
        names = (*names, "mbs_excess")
        options += f"#define MODEL_RULES_AT_START {rules.at_start}\n"
        options += f"#define MODEL_RULES {len(rules.sentences)}\n"
        options += "extern const char *const MODEL_SENTENCES[];\n"
    if model.solver == "rodas":
        names = (*names, "mbs_jacobian")
        options += "#define MODEL_RODAS\n"
    elif model.solver == "rk4":
        options += f"#define MODEL_FIXED_STEP {float(model.internal_step)!r}\n"
    return _HEADER.format(
        guid=_quoted(guid),
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
        arrays=_ARRAYS if model.arrays else "",
        options=options + ("" if tree is None else _tree_sizes(model, tree)),
        prototypes="".join(_PROTOTYPE.format(name=name) for name in names),
    )


def source(model: FmuModel, *, adjoint: bool) -> str:
    """The file model.c.

    Args:
        model: what the FMU is.
        adjoint: the version of FMI calls adjoint derivatives.

    Returns:
        its text.

    Raises:
        ExportError: a function holds a node that CasADi cannot write as C.
    """
    code = _code(functions(model, adjoint=adjoint))
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
        _table("const char MODEL_FIXED", ("1" if v.fixed else "0" for v in variables)),
        _table("const char *const MODEL_INDICATORS", map(_quoted, watched(model))),
        *_sentences(model),
        *_lead_tables(model),
        *_size_tables(model),
        *_block_tables(_blocks(model)),
        *_tree_tables(model),
    ]
    return (
        '#include <math.h>\n\n#include "model.h"\n\n'
        + "\n".join(tables)
        + "\n/* The functions stay inside the library. */\n#define CASADI_SYMBOL_EXPORT\n"
        + code
    )


def _tree_sizes(model: FmuModel, tree: TreeState) -> str:
    sizes = ", ".join(map(str, tree.passage.size))
    return (
        f"#define MODEL_TREE {tree.start.numel_out(0)} /* its states */\n"
        f"#define MODEL_TREE_INSIDE {int(model.solver == 'dopri5')} /* co-simulation has them */\n"
        f"#define MODEL_TREE_OUTSIDE {int(model.charted)} /* model exchange has charts of them */\n"
        f"#define MODEL_PASSAGE {{{sizes}}}\n"
        f"#define MODEL_REGULARITY {tree.passage.typical!r}\n"
        "/* where states, dependents and velocities of dependent joints stand in it, and the\n"
        " * independent joints among its velocities; typical sizes of these */\n"
        "extern const int MODEL_TREE_STATES[], MODEL_TREE_DEPENDENTS[], MODEL_TREE_PASSIVE[];\n"
        "extern const int MODEL_TREE_HELD[];\n"
        "extern const double MODEL_TREE_UNITS[];\n"
    )


def _tree_tables(model: FmuModel) -> list[str]:
    """Where the states, and the dependents, of the FMU stand among the states of its tree."""
    if (tree := model.tree) is None:
        return []
    return [
        _table("const int MODEL_TREE_STATES", map(str, tree.states)),
        _table("const int MODEL_TREE_DEPENDENTS", map(str, tree.dependents)),
        _table("const int MODEL_TREE_PASSIVE", map(str, tree.passive)),
        _table("const int MODEL_TREE_HELD", map(str, tree.held)),
        _numbers("MODEL_TREE_UNITS", (1 / unit for unit in tree.units)),
    ]


def _sentences(model: FmuModel) -> list[str]:
    """What is said where a rule is broken."""
    if model.rules is None:
        return []
    return [_table("const char *const MODEL_SENTENCES", map(_quoted, model.rules.sentences))]


def _lead_tables(model: FmuModel) -> list[str]:
    if model.closure is None:
        return []
    return [_table("const int MODEL_LEADS", map(str, leading_states(model.closure)))]


def leading_states(closure: casadi.Function) -> list[int]:
    """1 for each state that dependents follow from, as positions do, 0 for the others.

    Args:
        closure: `closure(x, z, p)`, one Newton step of z.
    """
    pattern = np.array(casadi.DM(closure.jac_sparsity(0, 0), 1))
    return [int(count > 0) for count in pattern.sum(axis=0)]


def _size_tables(model: FmuModel) -> list[str]:
    """How many elements a variable has, where some are arrays."""
    if not model.arrays:
        return []
    sizes = [1] * len(model.entries)
    for array in model.arrays:
        sizes[array.first : array.first + array.size] = [array.size] + [0] * (array.size - 1)
    return [_table("const int MODEL_SIZES", map(str, sizes))]


def _blocks(model: FmuModel) -> tuple[Block, ...]:
    return diagonal_blocks(model.slopes)


def diagonal_blocks(slopes: casadi.Function | None) -> tuple[Block, ...]:
    """The diagonal blocks of the slopes of a closure; none where they are not watched."""
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


def _code(functions: Iterable[casadi.Function]) -> str:
    """Scalar operations in short pieces, which compile fast; the rest as CasADi has it."""
    pieces, others = [], []
    for function in functions:
        try:
            pieces.append(plain_source([function]))
        except ModelError:  # it calls a foreign function, say
            others.append(function)
    return "\n".join([*pieces, *([generated(others)] if others else [])])


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
