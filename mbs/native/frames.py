"""C functions around the blocks of a graph: work space, arguments, calls, entry points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

from casadi import Function, Sparsity

from mbs.native.c_code import LANES, BlockCode, Item
from mbs.operations.graph import Graph

# Text at the beginning of a file.


NOINLINE = """\
#undef NOINLINE
#ifdef __GNUC__
#define NOINLINE __attribute__((noinline))
#else
#define NOINLINE
#endif
#if defined __cplusplus || (defined _MSC_VER && !defined __clang__)
#undef restrict
#define restrict __restrict
#endif
"""
"""Definitions before C functions: parts of a function are not inlined, and `restrict` is defined
for compilers of C++ and for MSVC. Headers of the system must precede them."""

HEAD = f"""\
#include <math.h>
#include <string.h>
{NOINLINE}"""
"""Beginning of a C file: everything that the text of `GraphCode` and `entry` needs."""

EXPORT = """\
#define casadi_int long long int
#ifdef __cplusplus
#define EXPORT_C extern "C"
#else
#define EXPORT_C
#endif
#ifdef _WIN32
#define EXPORT EXPORT_C __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT EXPORT_C __attribute__((visibility("default")))
#else
#define EXPORT EXPORT_C
#endif
"""
"""Definitions before the functions that CasADi's `external` looks up."""


# Blocks of a graph, the lines that call them, and the functions that contain these lines.


@dataclass(frozen=True, slots=True)
class GraphCode:
    """C functions that compute a graph, one for each block.

    Attributes:
        name: beginning of the names of the C functions.
        code: writer of the functions, for one scalar type.
        blocks: steps of each block.
    """

    name: str
    code: BlockCode
    blocks: Sequence[Sequence[Item]]

    def texts(self) -> list[str]:
        """Return the texts of the C functions."""
        parts = enumerate(self.blocks)
        return [
            *self.code.repeats(),
            *(self.code.block(f"{self.name}_part{k}", k, steps) for k, steps in parts),
        ]

    def calls(
        self, blocks: Iterable[int] | None = None, inputs: str = "in", outputs: str = "out"
    ) -> list[str]:
        """Return the C lines that call blocks, with the work array `w`.

        Args:
            blocks: indices of the blocks. Default: all.
            inputs: array of pointers to the inputs.
            outputs: array of pointers to the outputs.
        """
        chosen = range(len(self.blocks)) if blocks is None else blocks
        return [f"  {self.name}_part{k}({inputs}, {outputs}, w);" for k in chosen]


def pointers(kind: str, name: str, places: Sequence[str]) -> str:
    """Return the C line that declares an array of pointers.

    Args:
        kind: C type of the numbers.
        name: name of the array.
        places: C texts of the pointers.
    """
    return f"  {kind} *const {name}[] = {{{', '.join(places) or '0'}}};"


def entry(name: str, lines: Sequence[str], linkage: str, real: str = "double") -> list[str]:
    """Return the C lines of a function in CasADi's calling convention.

    Args:
        name: name of the function.
        lines: lines that use the arguments `arg`, `res`, `iw`, `w` and `mem`.
        linkage: text before the type, such as "static ".
        real: C type of numbers.
    """
    given = f"const {real} **arg, {real} **res, long long *iw, {real} *w, int mem"
    return [
        f"{linkage}int {name}({given})",
        "{",
        "  (void)arg, (void)res, (void)iw, (void)w, (void)mem;",
        *lines,
        "  return 0;",
        "}",
    ]


def lane_loop(first: str, last: str, lines: Sequence[str]) -> list[str]:
    """Return the C lines of a loop over columns or states, MBS_LANES at a time.

    Args:
        first: C text of the first index.
        last: C text of the end of the indices, exclusive.
        lines: lines of the body. `c` is the first index of a pass and `many` the number of its
            columns.
    """
    many = f"const int many = {last} - c < MBS_LANES ? (int)({last} - c) : MBS_LANES;"
    return [
        f"  for (long long c = {first}; c < {last}; c += MBS_LANES) {{",
        *(f"  {line}" for line in (f"  {many}", *lines)),
        "  }",
    ]


# Work space of a whole Function, and the pointers to its inputs and outputs.


class WorkSize(NamedTuple):
    """Minimum lengths of the work arrays arg, res, iw and w in CasADi's calling convention."""

    arg: int = 0
    res: int = 0
    iw: int = 0
    w: int = 0

    def covering(self, other: WorkSize) -> WorkSize:
        """Return lengths that are enough for both: the elementwise maximum.

        Args:
            other: other lengths.
        """
        return WorkSize(*map(max, self, other))


@dataclass(frozen=True, slots=True)
class Memory:
    """Work space of a Function: work array of its blocks, discarded outputs, buffers of maps.

    Attributes:
        function: whole Function.
        graph: scalar operations of the Function. If it contains maps, the graph has additional
            outputs (arguments of the maps) and additional inputs (results of the maps).
        slots: length of the work array of the blocks, in doubles.
    """

    function: Function
    graph: Graph
    slots: int

    @property
    def size(self) -> int:
        """Total length of the work space in doubles."""
        return self.slots + self._omitted_length + (self._starts[-1] + LANES if self._sizes else 0)

    def buffer(self, number: int) -> int:
        """Return the index in the C array `out` of the buffer of a graph input that a map computes.

        Args:
            number: index of the graph input.
        """
        return len(self.graph.outputs) + number - self.function.n_in()

    def declarations(self) -> list[str]:
        """Return C lines that declare the pointer arrays `in` and `out`.

        An omitted input is replaced by zeros. An omitted output is written to a discarded part of
        the work space. `out` contains the outputs of the Function, the arguments of the maps and
        the results of the maps. The results of the maps are also the last elements of `in`.
        """
        n_in, n_out = self.function.n_in(), self.function.n_out()
        most = max((port.sparsity.nnz() for port in self.graph.inputs[:n_in]), default=0)
        places = [f"base + {start}" for start in self._starts[:-1]]
        taken = len(self.graph.outputs) - n_out
        inputs = [f"arg[{k}] ? arg[{k}] : zeros" for k in range(n_in)] + places[taken:]
        outputs = [f"res[{k}] ? res[{k}] : w + {self.slots}" for k in range(n_out)] + places
        base = f"  double *const base = mbs_aligned(w + {self.slots + self._omitted_length});"
        lanes = f"  mbs_lanes *const lanes = (mbs_lanes *)(base + {self._starts[-1]});"
        return [
            f"  static const double zeros[{most or 1}] = {{0}};",
            *([base, lanes] if self._sizes else []),
            pointers("const double", "in", inputs),
            pointers("double", "out", outputs),
        ]

    @property
    def _omitted_length(self) -> int:
        """Length of the part that receives omitted outputs, in doubles."""
        return max((self.function.nnz_out(k) for k in range(self.function.n_out())), default=0)

    @property
    def _sizes(self) -> list[int]:
        """Lengths of the arguments of the maps, then of their results, in doubles."""
        taken = self.graph.outputs[self.function.n_out() :]
        given = self.graph.inputs[self.function.n_in() :]
        return [port.sparsity.nnz() for port in (*taken, *given)]

    @property
    def _starts(self) -> list[int]:
        """First index of each buffer of the maps, rounded up to full SIMD vectors, and the end."""
        rounded = ((size + LANES - 1) // LANES * LANES for size in self._sizes)
        return list(accumulate(rounded, initial=0))


# C functions that describe a compiled function to CasADi: names, shapes, defaults, work space.


def function_table(function: Function, work: int | str) -> str:
    """Return the C functions from which CasADi's `external` reads the signature of a function.

    Args:
        function: Function to describe. The C file must define EXPORT and casadi_int.
        work: length of the work array w of the code in doubles: a number or C text.
    """
    name, n_in, n_out = function.name(), function.n_in(), function.n_out()
    shape = "const casadi_int *"
    tables = {
        "sparsity_in": [function.sparsity_in(k) for k in range(n_in)],
        "sparsity_out": [function.sparsity_out(k) for k in range(n_out)],
    }
    lines = [
        f"EXPORT casadi_int {name}_n_in(void) {{ return {n_in}; }}",
        f"EXPORT casadi_int {name}_n_out(void) {{ return {n_out}; }}",
        _switch_function("double ", f"{name}_default_in", _defaults(function)),
        _switch_function("const char *", f"{name}_name_in", [f'"{s}"' for s in function.name_in()]),
        _switch_function(
            "const char *", f"{name}_name_out", [f'"{s}"' for s in function.name_out()]
        ),
    ]
    for kind, patterns in tables.items():
        names = [f"{name}_{kind}_{k}" for k in range(len(patterns))]
        lines += [_table(*row) for row in zip(names, patterns, strict=True)]
        lines.append(_switch_function(shape, f"{name}_{kind}", names))
    return "\n".join([*lines, _work(name, n_in, n_out, work)])


def _defaults(function: Function) -> list[str]:
    """Return the C text of the default value of each input; NAN if it is not finite."""
    values = [float(function.default_in(k)) for k in range(function.n_in())]
    return [repr(x) if math.isfinite(x) else "NAN" for x in values]


def _switch_function(kind: str, name: str, answers: Sequence[str]) -> str:
    """Return a C function of type `kind` from i to `answers[i]`, and to 0 for other values of i."""
    cases = "".join(f" case {k}: return {answer};" for k, answer in enumerate(answers))
    return f"EXPORT {kind}{name}(casadi_int i) {{ switch (i) {{{cases} default: return 0; }} }}"


def _table(name: str, pattern: Sparsity) -> str:
    """Return the C array of a sparsity pattern in CasADi's compressed format.

    `name` is the name of the array.
    """
    dense = pattern.is_dense()
    numbers = [*pattern.shape, 1] if dense else [int(k) for k in pattern.compress()]
    values = ", ".join(map(str, numbers))
    return f"static const casadi_int {name}[{len(numbers)}] = {{{values}}};"


def _work(name: str, n_in: int, n_out: int, work: int | str) -> str:
    """Return the C function NAME_work, which reports the lengths of the work arrays.

    `n_in` and `n_out` are the numbers of inputs and outputs, `work` is the number of doubles.
    """
    sizes = {"arg": n_in, "res": n_out, "iw": 0, "w": work}
    pointers = ", ".join(f"casadi_int *{kind}" for kind in sizes)
    sets = " ".join(f"if ({kind}) *{kind} = {size};" for kind, size in sizes.items())
    return f"EXPORT int {name}_work({pointers}) {{ {sets} return 0; }}"
