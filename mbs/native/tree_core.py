"""Libraries of the tree core: one C file for all mechanisms, and a table of numbers for each.

The core, runtime/tree_core.c, is compiled once and kept. What is compiled for a mechanism are its
numbers, the functions by which CasADi calls the core, and a short Function of the parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import casadi
from casadi import DM, MX, SX, Function

from mbs.native.compiled import generated
from mbs.native.compiler import cached_library
from mbs.native.kernel import FAST_FLAGS, function_table, processor

ROWS = {
    name: first
    for first, *names in (
        (0, "C"),
        (9, "T"),
        (12, "mass"),
        (13, "h"),
        (16, "J"),
        (22, "turn"),
        (23, "slide"),
        (24, "first"),
        (25, "inner"),
        (26, "Ia"),
        (27, "Fv"),
        (28, "stiffness"),
        (29, "rest"),
        (30, "Fs"),
        (31, "width"),
        (32, "spin"),
        (35, "own"),
    )
    for name in names
}
"""The first row of each quantity, as tree_core.h has them."""

ROW_COUNT = 36
_LIST_NAMES = (
    *("before", "link", "end", "first", "last", "kind", "fork", "q_at", "v_at"),
    *("runs_from", "runs", "joints", "rotor", "rub"),
)


def place_of(row: int, node: int) -> int:
    """Where a number of a node stands: eight nodes side by side, their rows one after the other."""
    return node // 8 * (8 * ROW_COUNT) + 8 * row + node % 8


@dataclass(frozen=True, slots=True, eq=False)
class TreeTable:
    """A mechanism as numbers; the fields are those of tree_core.h.

    Attributes:
        size: velocities.
        positions: elements of q.
        lists: indices by the names of their lists.
        numbers: the table, see `place_of`, then gravity; NaN where they follow from parameters.
        places: where these are.
        dependent: ``numbers(p)``, their values; None without parameters.
    """

    size: int
    positions: int
    lists: Mapping[str, Sequence[int]]
    numbers: Sequence[float]
    places: Sequence[int] = ()
    dependent: Function | None = None

    @property
    def in_order(self) -> bool:
        """Whether v has the order of the tree."""
        return list(self.lists["v_at"]) == list(range(self.size))

    @property
    def plain(self) -> bool:
        """Whether q has this order too, element by element."""
        return self.in_order and list(self.lists["q_at"]) == list(self.lists["v_at"])


def tree_functions(
    table: TreeTable, parameters: int, default: Sequence[float] = ()
) -> dict[str, Function]:
    """Functions that have the names and shapes of the core's, and no content.

    Args:
        table: of the mechanism.
        parameters: how many there are.
        default: CasADi's default of all of them, when there are some.
    """
    n, nq = table.size, table.positions
    sizes = {"q": (nq, 1), "v": (n, 1), "a": (n, 1), "tau": (n, 1), "p": (parameters, 1)}
    matrix = (n, n)
    shapes = {
        "idm": ("qva", [("tau", (n, 1))]),
        "inertia": ("q", [("A", matrix)]),
        "ddm": (("q", "v", "tau"), [("a", (n, 1))]),
        "idm_derivatives": (
            "qva",
            [*((f"dtau_d{x}", matrix) for x in "qva"), ("tau", (n, 1))],
        ),
        "ddm_derivatives": (
            ("q", "v", "tau"),
            [*((f"da_d{x}", matrix) for x in ("q", "v", "tau")), ("a", (n, 1))],
        ),
        "pivots": ("q", [("free", (n, 1)), ("locked", (n, 1))]),
        "jac_idm": (
            ("q", "v", "a", "out_tau"),
            [("jac_tau_q", (n, nq)), ("jac_tau_v", matrix), ("jac_tau_a", matrix)],
        ),
        "jac_ddm": (
            ("q", "v", "tau", "out_a"),
            [("jac_a_q", (n, nq)), ("jac_a_v", matrix), ("jac_a_tau", matrix)],
        ),
    }
    result = {}
    for name, (inputs, outputs) in shapes.items():
        every = [*inputs]
        if parameters:  # the last input; but for the Jacobian, whose last is the output
            every.insert(3 if name.startswith("jac_") else len(every), "p")
        if parameters and name.startswith("jac_"):
            outputs = [*outputs, (f"{outputs[0][0][:-1]}p", (n, parameters))]
        symbols = [MX.sym(x, *sizes[x.removeprefix("out_")]) for x in every]
        values = [MX(DM.zeros(*shape)) for _, shape in outputs]
        names = every, [x for x, _ in outputs]
        options = {"default_in": [default[0] if x == "p" else 0.0 for x in every]}
        result[name] = Function(name, symbols, values, *names, options)
    return result


def tree_library(table: TreeTable, parameters: int, default: Sequence[float] = ()) -> Path:
    """The library of all models of a mechanism, in CasADi's calling convention.

    Args:
        table: of the mechanism.
        parameters: how many it has.
        default: CasADi's default of all of them, when there are some.

    Raises:
        CompilerError: there is no compiler, or it refused the code.
    """
    runtime = resources.files("mbs.native").joinpath("runtime")
    own = ("tree_core.c", "tree_core.h", "sincos.h", "lanes.h")
    files = {name: runtime.joinpath(name).read_text("utf-8") for name in own}
    # the core is kept by its text, that of its headers, compiler and flags: "native" needs more
    files["lanes.h"] += f"/* {processor()} */\n"
    files["mechanism.c"] = _source(table, tree_functions(table, parameters, default))
    if table.dependent is not None:
        files["dependent.c"] = generated([table.dependent])
    return cached_library(files, FAST_FLAGS, common=["tree_core.c"])


def _source(table: TreeTable, functions: Mapping[str, Function]) -> str:
    """C text of the numbers of a mechanism and of the functions that CasADi calls."""
    dependent = table.dependent
    head = [
        "#include <math.h>",
        "#include <string.h>",
        "#include <stdint.h>",
        '#include "tree_core.h"',
        "#define casadi_int long long int",
        "#ifdef _WIN32",
        "#define EXPORT __declspec(dllexport)",
        "#else",
        '#define EXPORT __attribute__((visibility("default")))',
        "#endif",
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
        values, scratch = len(table.places), int(dependent.sz_w())
        integers = max(int(dependent.sz_iw()), 1)
        pointers = int(dependent.sz_arg()), int(dependent.sz_res())
        before = count + values + scratch + 16
        name = dependent.name()
        head += [
            _integers("places", table.places),
            f"int {name}(const double **, double **, casadi_int *, double *, int);",
            "static const mbs_tree *at(const double *p, mbs_tree *own, double **w) {",
            "  double *table = (double *)(((uintptr_t)*w + 63) & ~(uintptr_t)63);",
            f"  double *values = table + {count};",
            f"  const double *arg[{pointers[0]}] = {{p}};",
            f"  double *res[{pointers[1]}] = {{values}};",
            f"  casadi_int iw[{integers}];",
            f"  {name}(arg, res, iw, values + {values}, 0);",
            "  memcpy(table, numbers, sizeof numbers);",
            f"  for (int k = 0; k < {values}; ++k) table[places[k]] = values[k];",
            "  *own = mechanism;",
            "  own->numbers = table;",
            f"  own->gravity = table + {len(table.numbers) - 3};",
            f"  *w += {before};",
            "  return own;",
            "}",
        ]
    square = table.size * table.size
    by_parameters = table.size * functions["jac_idm"].size1_in("p") if table.dependent else 0
    lines = list(head)
    for name, function in functions.items():
        extra = 0 if table.plain else square
        own = extra if name.startswith("jac_") else 0
        lines += [
            f"EXPORT int {name}(const double **arg, double **res, casadi_int *iw, double *w, int"
            " mem) {",
            "  mbs_tree own;",
            "  (void)iw; (void)mem;",
            f"  const mbs_tree *m = at({_parameter(function)}, &own, &w);",
            *_call(name, table.plain, own, by_parameters if name.startswith("jac_") else 0),
            "  return 0;",
            "}",
            function_table(function, f"{work} + {before + own}"),
        ]
    return "\n".join([*lines, ""])


def _parameter(function: Function) -> str:
    names = function.name_in()
    return f"arg[{names.index('p')}]" if "p" in names else "0"


def _call(name: str, plain: bool, square: int, by_parameters: int) -> list[str]:
    """What a function does: the inputs and outputs of the core are those of CasADi.

    Derivatives by parameters, which the core does not have, are NaN.
    """
    if by_parameters:
        nan = f"  if (res[3]) for (int k = 0; k < {by_parameters}; ++k) res[3][k] = NAN;"
        return [nan, *_call(name, plain, square, 0)]
    match name:
        case "idm" | "ddm":
            return [f"  mbs_tree_{name}(m, arg[0], arg[1], arg[2], res[0], w);"]
        case "inertia":
            return ["  mbs_tree_inertia(m, arg[0], res[0], w);"]
        case "pivots":
            return ["  mbs_tree_pivots(m, arg[0], res[0], res[1], w);"]
        case "jac_idm" | "jac_ddm":
            model = f"{name.removeprefix('jac_')}_derivatives"
            if plain:
                results = "res[0], res[1], res[2], 0, w"
                return [f"  mbs_tree_{model}(m, arg[0], arg[1], arg[2], {results});"]
            return [
                "  double *along = res[0] ? w : 0;",
                f"  w += {square};",
                f"  mbs_tree_{model}(m, arg[0], arg[1], arg[2], along, res[1], res[2], 0, w);",
                "  if (along) mbs_tree_by_positions(m, arg[0], along, res[0]);",
            ]
    results = "res[0], res[1], res[2], res[3], w"
    return [f"  mbs_tree_{name}(m, arg[0], arg[1], arg[2], {results});"]


def _integers(name: str, values: Sequence[int]) -> str:
    return f"static const int {name}[] = {{{_wrapped(map(str, values or [0]))}}};"


def _number(value: float) -> str:
    if value != value:
        return "NAN"
    return "0" if value == 0 else repr(float(value))


def _wrapped(words: map[str]) -> str:
    """Words with commas, some on each line."""
    every = list(words)
    return ",\n".join(", ".join(every[k : k + 12]) for k in range(0, len(every), 12))


def dependent_numbers(values: Sequence[SX], p: SX) -> Function:
    """``numbers(p)``: the numbers of a table that follow from parameters."""
    column = casadi.densify(casadi.vertcat(*values))
    return Function("dependent_numbers", [p], [column], ["p"], ["numbers"], {"cse": True})
