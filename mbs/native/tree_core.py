"""Libraries of the tree core: C code for all open trees, with a numeric table per mechanism.

The core, runtime/tree_core.c, is compiled once and cached. The code that is compiled for a
mechanism consists of its table, the functions by which CasADi calls the core, and a short Function
of the parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import accumulate

import casadi
from casadi import DM, MX, SX, Function, Sparsity

from mbs.native.derivatives_on_demand import by_parameters
from mbs.native.frames import EXPORT, entry, function_table
from mbs.native.kernel import processor
from mbs.native.scalar_source import plain_source

ROWS = {
    **{"C": 0, "T": 9, "mass": 12, "h": 13, "J": 16, "turn": 22, "slide": 23, "inner": 24},
    **{"Ia": 25, "Fv": 26, "stiffness": 27, "rest": 28, "Fs": 29, "width": 30},
    **{"spin": 31, "own": 34},
}
"""First row of each quantity in the table, as in tree_core.h."""

ROW_COUNT = 35
"""MBS_ROWS of tree_core.h."""
_LIST_NAMES = (
    *("before", "link", "end", "first", "last", "kind", "fork", "q_at", "v_at"),
    *("runs_from", "runs", "joints", "rotor", "rub"),
)


def place_of(row: int, node: int) -> int:
    """Return the index of an element in the table of numbers: blocks of eight nodes, row by row.

    Args:
        row: row of the quantity, from `ROWS`.
        node: index of the node (velocity).
    """
    return node // 8 * (8 * ROW_COUNT) + 8 * row + node % 8


@dataclass(frozen=True, slots=True, eq=False)
class TreeTable:
    """Numeric description of a mechanism, with the fields of struct mbs_tree in tree_core.h.

    Attributes:
        size: number of velocities (nodes of the tree).
        positions: length of q.
        lists: integer lists of tree_core.h by name.
        numbers: table, indexed by `place_of`, followed by gravity (3). Elements that depend on
            parameters are NaN.
        places: indices of the elements that depend on parameters.
        dependent: Function ``numbers(p)`` of their values; None without parameters.
    """

    size: int
    positions: int
    lists: Mapping[str, Sequence[int]]
    numbers: Sequence[float]
    places: Sequence[int] = ()
    dependent: Function | None = None

    @property
    def in_order(self) -> bool:
        """Whether the elements of v have the order of the tree."""
        return list(self.lists["v_at"]) == list(range(self.size))

    @property
    def plain(self) -> bool:
        """Whether q and v both have the order of the tree, element by element."""
        return self.in_order and list(self.lists["q_at"]) == list(self.lists["v_at"])


@dataclass(frozen=True, slots=True, eq=False)
class JacobianPattern:
    """Sparsity of the Jacobians of a model.

    Attributes:
        by_v: sparsity of the Jacobian by velocities.
        by_q: sparsity of the Jacobian by positions.
        coupled: whether all joints of a tree on the base are coupled. If not, a joint is coupled
            with its ancestors and descendants only.
    """

    by_v: Sparsity
    by_q: Sparsity
    coupled: bool

    @property
    def is_dense(self) -> bool:
        """Whether the Jacobians are dense."""
        return bool(self.by_v.is_dense())


def nodes_of_positions(table: TreeTable) -> list[int]:
    """Return the node of each element of q; the first node for a joint of several velocities.

    Args:
        table: table of the mechanism.
    """
    nodes = [0] * table.positions
    for node, at in enumerate(table.lists["q_at"]):
        if at >= 0:
            nodes[at] = node
    joints = table.lists["joints"]
    for first, count, at in zip(joints[::3], joints[1::3], joints[2::3], strict=True):
        nodes[at : at + count + 1] = [first] * (count + 1)
    return nodes


def jacobian_pattern(table: TreeTable, model: str) -> JacobianPattern:
    """Return the sparsity of the Jacobians of a model; dense if v is not in tree order.

    Args:
        table: table of the mechanism.
        model: "idm" (inverse dynamics) or "ddm" (direct dynamics).
    """
    n, coupled = table.size, model == "ddm"
    rows = [_rows(table, node, coupled) if table.in_order else range(n) for node in range(n)]
    by_v, by_q = (
        _sparsity(n, [rows[node] for node in nodes])
        for nodes in (range(n), nodes_of_positions(table))
    )
    return JacobianPattern(by_v, by_q, coupled)


def _rows(table: TreeTable, node: int, coupled: bool) -> Sequence[int]:
    """Return the nodes whose effort (or acceleration) depends on a node, as in mbs_tree_pack.

    `coupled` is as in `JacobianPattern`.
    """
    lists = table.lists
    if coupled:
        while lists["link"][node] >= 0:
            node = lists["link"][node]
        return range(lists["first"][node], lists["end"][node])
    before = list[int]()
    for run in range(lists["runs_from"][node], lists["runs_from"][node + 1]):
        before += range(lists["runs"][2 * run], lists["runs"][2 * run + 1])
    return [*before, *range(lists["first"][node], lists["end"][node])]


def _sparsity(size: int, columns: Sequence[Sequence[int]]) -> Sparsity:
    """Return the pattern with `size` rows whose columns have nonzeros in the given rows."""
    ends = list(accumulate(map(len, columns), initial=0))
    if ends[-1] == size * len(columns):
        return Sparsity.dense(size, len(columns))
    return Sparsity(size, len(columns), ends, [row for rows in columns for row in rows])


def tree_functions(
    table: TreeTable, parameters: int, default: Sequence[float] = ()
) -> dict[str, Function]:
    """Return placeholder Functions with the names and signatures of the functions of the core.

    Args:
        table: table of the mechanism.
        parameters: number of parameters.
        default: default values of the parameters. CasADi uses the first value for all of them.
    """
    n, nq = table.size, table.positions
    sizes = {"q": nq, "v": n, "a": n, "tau": n, "p": parameters}
    column, square = Sparsity.dense(n, 1), Sparsity.dense(n, n)
    idm, ddm = ("q", "v", "a"), ("q", "v", "tau")
    shapes: dict[str, tuple[Sequence[str], list[tuple[str, Sparsity]]]] = {
        "idm": (idm, [("tau", column)]),
        "inertia": (("q",), [("A", square)]),
        "ddm": (ddm, [("a", column)]),
        "idm_derivatives": (idm, [*((f"dtau_d{x}", square) for x in idm), ("tau", column)]),
        "ddm_derivatives": (ddm, [*((f"da_d{x}", square) for x in ddm), ("a", column)]),
        "pivots": (("q",), [("free", column), ("locked", column)]),
    }
    for model, given, output in (("idm", idm, "tau"), ("ddm", ddm, "a")):
        pattern = jacobian_pattern(table, model)
        patterns = dict(zip(given, (pattern.by_q, pattern.by_v, pattern.by_v), strict=True))
        if parameters:
            patterns["p"] = Sparsity.dense(n, parameters)
        outputs = [(f"jac_{output}_{x}", patterns[x]) for x in patterns]
        shapes[f"jac_{model}"] = (given, outputs)
    result = {}
    for name, (inputs, outputs) in shapes.items():
        every = [*inputs, *(["p"] if parameters else [])]
        symbols = [MX.sym(x, sizes[x]) for x in every]
        if name.startswith("jac_"):  # CasADi also passes the output of the model
            every.append(f"out_{outputs[0][0].split('_')[1]}")
            symbols.append(MX.sym("output", n))
        values = [MX(DM.ones(pattern)) for _, pattern in outputs]
        names = every, [x for x, _ in outputs]
        options = {"default_in": [default[0] if x == "p" else 0.0 for x in every]}
        result[name] = Function(name, symbols, values, *names, options)
    return result


COMMON = ("tree_core.c",)
"""Names of the C files of `tree_files` that all mechanisms have in common."""


def tree_files(table: TreeTable, functions: Mapping[str, Function]) -> dict[str, str]:
    """Return the C code of models of a mechanism, in CasADi's calling convention.

    If table elements depend on parameters, the Jacobians call `byp_idm` and `byp_ddm` for the
    derivatives by the parameters. The text only declares these functions.

    Args:
        table: table of the mechanism.
        functions: models to include: some of the Functions of `tree_functions`.

    Returns:
        file name to text, for `FAST_FLAGS`; see `COMMON`.
    """
    runtime = resources.files("mbs.native").joinpath("runtime")
    own = ("tree_core.c", "tree_core.h", "sincos.h", "lanes.h")
    files = {name: runtime.joinpath(name).read_text("utf-8") for name in own}
    # the cached core depends on text, compiler and flags; "-march=native" also on the processor
    files["lanes.h"] += f"/* {processor()} */\n"
    scratch = 0
    if table.dependent is not None:
        files["dependent.c"], sizes = plain_source([table.dependent])
        scratch = sizes.w
    files["mechanism.c"] = _source(table, functions, scratch)
    return files


def _source(table: TreeTable, functions: Mapping[str, Function], scratch: int) -> str:
    """Return the C code of the table of a mechanism and of the functions that CasADi calls.

    `scratch` is the length of the work array for the numbers that depend on parameters.
    """
    dependent = table.dependent
    head = [
        "#include <math.h>",
        "#include <stdlib.h>",
        "#include <string.h>",
        "#include <stdint.h>",
        '#include "tree_core.h"',
        EXPORT,
        *(_integers(name, table.lists[name]) for name in _LIST_NAMES),
        "static const double numbers[] __attribute__((aligned(64))) = {"
        f"{_wrapped(map(_number, table.numbers))}}};",
        "static const mbs_tree mechanism = {"
        f"{table.size}, {table.positions}, {int(table.in_order)}, {int(table.plain)},"
        f" {len(table.lists['joints']) // 3}, {len(table.lists['rotor']) // 2},"
        f" {len(table.lists['rub'])}, {', '.join(_LIST_NAMES)},"
        f" numbers + {len(table.numbers) - 3}, numbers}};",
    ]
    work = f"MBS_TREE_WORK({table.size}, {int(table.in_order)})"
    before = 0
    if dependent is None:
        head += [
            "static const mbs_tree *at(const double *p, mbs_tree *own, double **w)",
            "{ (void)p; (void)own; (void)w; return &mechanism; }",
        ]
    else:
        count = len(table.numbers)
        values = len(table.places)
        before = count + values + scratch + 16
        name = dependent.name()
        head += [
            _integers("places", table.places),
            f"int {name}(const double **, double **, casadi_int *, double *, int);",
            "static const mbs_tree *at(const double *p, mbs_tree *own, double **w) {",
            "  double *table = (double *)(((uintptr_t)*w + 63) & ~(uintptr_t)63);",
            f"  double *values = table + {count};",
            "  const double *arg[] = {p};",
            "  double *res[] = {values};",
            f"  {name}(arg, res, 0, values + {values}, 0);",
            "  memcpy(table, numbers, sizeof numbers);",
            f"  for (int k = 0; k < {values}; ++k) table[places[k]] = values[k];",
            "  *own = mechanism;",
            "  own->numbers = table;",
            f"  own->gravity = table + {len(table.numbers) - 3};",
            f"  *w += {before};",
            "  return own;",
            "}",
        ]
    head.append(_integers("nodes_of_v", range(table.size)))
    head.append(_integers("nodes_of_q", nodes_of_positions(table)))
    lines = list(head)
    for name, function in functions.items():
        body, own = _call(name, table, function)
        model = f"  const mbs_tree *m = at({_parameter(function)}, &own, &w);"
        if name.startswith("jac_") and dependent is not None:
            lines += _by_parameters(name.removeprefix("jac_"), function.n_in() - 1)
        lines += [
            *entry(name, ["  mbs_tree own;", model, *body], "EXPORT "),
            function_table(function, f"{work} + {before + own}"),
        ]
    return "\n".join([*lines, ""])


def _by_parameters(model: str, inputs: int) -> list[str]:
    """Return C code that calls the derivatives of a model by its parameters.

    `inputs` is the number of inputs of the model. The derivatives are compiled at their first use.
    The size of their work space is not known before, so it is allocated on the heap.
    """
    name = by_parameters(model).name
    return [
        f"int {name}(const double **, double **, casadi_int *, double *, int);",
        f"int {name}_work(casadi_int *, casadi_int *, casadi_int *, casadi_int *);",
        f"static int by_parameters_of_{model}(const double **arg, double *out) {{",
        "  casadi_int a, r, i, w;",
        f"  if ({name}_work(&a, &r, &i, &w)) return 1;",
        "  double *work = malloc((w + 1) * sizeof(double));",
        "  casadi_int *integers = malloc((i + 1) * sizeof(casadi_int));",
        f"  const double **in = calloc(a + {inputs}, sizeof(double *));",
        "  double **res = calloc(r + 1, sizeof(double *));",
        "  int failed = !work || !integers || !in || !res;",
        "  if (!failed) {",
        f"    memcpy(in, arg, {inputs} * sizeof(double *));",
        "    res[0] = out;",
        f"    failed = {name}(in, res, integers, work, 0);",
        "  }",
        "  free(work); free(integers); free(in); free(res);",
        "  return failed;",
        "}",
    ]


def _parameter(function: Function) -> str:
    """Return the C text of the pointer to parameters p of a Function, "arg[k]"; "0" without p."""
    names = function.name_in()
    return f"arg[{names.index('p')}]" if "p" in names else "0"


def _call(name: str, table: TreeTable, function: Function) -> tuple[list[str], int]:
    """Return C lines that call the core for the function `name`, and its extra work in doubles."""
    match name:
        case "inertia":
            return ["  mbs_tree_inertia(m, arg[0], res[0], w);"], 0
        case "pivots":
            return ["  mbs_tree_pivots(m, arg[0], res[0], res[1], w);"], 0
        case "jac_idm" | "jac_ddm":
            return _jacobian(name.removeprefix("jac_"), table, function)
    results = ", ".join(f"res[{k}]" for k in range(function.n_out()))
    return [f"  mbs_tree_{name}(m, arg[0], arg[1], arg[2], {results}, w);"], 0


def _jacobian(model: str, table: TreeTable, function: Function) -> tuple[list[str], int]:
    """Return the C lines of a Jacobian of "idm" or "ddm", and its extra work space in doubles.

    The core computes dense derivatives along the velocities. They are converted to derivatives by
    positions, and only structurally nonzero elements are stored. Derivatives by parameters come
    from the written-out equations.
    """
    lines = []
    if "p" in function.name_in():
        every = f"memset(res[3], 0, {function.nnz_out(3)} * sizeof(double))"
        if table.dependent is not None:
            every = f"if (by_parameters_of_{model}(arg, res[3])) return 1"
        lines.append(f"  if (res[3]) {{ {every}; }}")
    call = f"  mbs_tree_{model}_derivatives(m, arg[0], arg[1], arg[2],"
    pattern = jacobian_pattern(table, model)
    if pattern.is_dense and table.plain:
        return [*lines, f"{call} res[0], res[1], res[2], 0, w);"], 0
    n, nq = table.size, table.positions
    squares = 1 if pattern.is_dense else 3
    square = n * n
    lines += [f"  double *full = w, *by_q = w + {squares * square};", f"  w = by_q + {n * nq};"]
    if pattern.is_dense:
        lines += [
            f"{call} res[0] ? full : 0, res[1], res[2], 0, w);",
            "  if (res[0]) mbs_tree_by_positions(m, arg[0], full, res[0]);",
        ]
    else:
        parts = ", ".join(f"res[{k}] ? full + {k * square} : 0" for k in range(3))
        coupled = int(pattern.coupled)
        lines += [
            f"{call} {parts}, 0, w);",
            "  if (res[0]) mbs_tree_by_positions(m, arg[0], full, by_q);",
            f"  if (res[0]) mbs_tree_pack(m, nodes_of_q, {nq}, {coupled}, by_q, res[0]);",
            *(
                f"  if (res[{k}]) mbs_tree_pack(m, nodes_of_v, {n}, {coupled},"
                f" full + {k * square}, res[{k}]);"
                for k in (1, 2)
            ),
        ]
    return lines, squares * square + n * nq


def _integers(name: str, values: Sequence[int]) -> str:
    """Return the C declaration of a constant array of integers."""
    return f"static const int {name}[] = {{{_wrapped(map(str, values or [0]))}}};"


def _number(value: float) -> str:
    """Return the C text of a double; NAN for a number that depends on parameters."""
    if value != value:
        return "NAN"
    return "0" if value == 0 else repr(float(value))


def _wrapped(words: map[str]) -> str:
    """Return words separated by commas, twelve per line."""
    every = list(words)
    return ",\n".join(", ".join(every[k : k + 12]) for k in range(0, len(every), 12))


def dependent_numbers(values: Sequence[SX], p: SX) -> Function:
    """Return the Function ``numbers(p)`` of the table elements that depend on parameters.

    Args:
        values: scalar expressions of the elements.
        p: (np, 1) symbols of the parameters.
    """
    column = casadi.densify(casadi.vertcat(*values))
    return Function("dependent_numbers", [p], [column], ["p"], ["numbers"], {"cse": True})
