"""Split an MX Function into scalar operations and the maps between them.

`Function.map` evaluates a Function for each column of matrices. Expanding the map would write out
each column. Here a map remains a single step, which machine code evaluates for several columns at
once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import casadi
from casadi import MX, SX, Function

from mbs.errors import ModelError
from mbs.native.c_code import ELEMENTWISE, LANES

_MAPS = ("Map", "OmpMap", "ThreadMap")


@dataclass(frozen=True, slots=True, eq=False)
class Mapped:
    """Map: a Function of a single column, and the columns for which it is evaluated.

    Attributes:
        column: Function of a single column.
        columns: number of columns.
        shared: whether an input has the same value for all columns, for each input.
        inputs: index of the output of `StagedFunction.scalar` that contains each input. A shared
            input is stored by its non-zero elements. Other inputs are stored in groups of LANES
            columns, row by row; zeros pad the last group.
        outputs: index of the input of `StagedFunction.scalar` that contains each output, a matrix
            (non-zero elements, columns).
    """

    column: Function
    columns: int
    shared: tuple[bool, ...]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class StagedFunction:
    """Scalar operations of a Function, and the maps between them.

    Attributes:
        scalar: SX Function of all operations outside the maps. Its inputs are the inputs of the
            whole Function, then the outputs of the maps. Its outputs are the outputs of the whole
            Function, then the inputs of the maps.
        maps: maps in order of evaluation. The inputs of a map depend only on the inputs of the
            Function and on previous maps.
    """

    scalar: Function
    maps: tuple[Mapped, ...]


def staged(function: Function) -> StagedFunction | None:
    """Split a Function into scalar operations and maps.

    Returns:
        the stages; None if the Function contains no map, or an operation between the maps that
        is not scalar or not supported.

    Args:
        function: any Function.
    """
    if not any(f.class_name() in _MAPS for f in (function, *function.find_functions())):
        return None
    trace = _Trace()
    inputs = [SX.sym(name, function.sparsity_in(k)) for k, name in enumerate(function.name_in())]
    try:
        outputs = trace.called(function, inputs)
    except (ModelError, RuntimeError, NotImplementedError):
        return None
    ins, outs = function.n_in(), function.n_out()
    names = [f"i{k}" for k in range(ins + len(trace.symbols))]
    results = [f"o{k}" for k in range(outs + len(trace.arguments))]
    every_in, every_out = [*inputs, *trace.symbols], [*outputs, *trace.arguments]
    scalar = Function(function.name(), every_in, every_out, names, results)
    maps = tuple(
        Mapped(
            m.column,
            m.columns,
            m.shared,
            tuple(outs + k for k in m.inputs),
            tuple(ins + k for k in m.outputs),
        )
        for m in trace.maps
    )
    return StagedFunction(scalar, maps)


class _Tiled(NamedTuple):
    """Matrix `value` that is repeated `times` times horizontally."""

    value: SX
    times: int


_Value: TypeAlias = SX | _Tiled


@dataclass(slots=True, eq=False)
class _Trace:
    """Interpreter of a Function on symbols that records the maps it meets.

    Attributes:
        symbols: symbols of the outputs of the recorded maps.
        arguments: inputs of the recorded maps.
        maps: recorded maps. Their indices refer to `arguments` and `symbols`.
    """

    symbols: list[SX] = field(default_factory=list)
    arguments: list[SX] = field(default_factory=list)
    maps: list[Mapped] = field(default_factory=list)

    def called(self, function: Function, arguments: Sequence[_Value]) -> list[SX]:
        """Return the outputs of a Function for symbolic arguments; its maps are recorded.

        Raises ModelError for operations that are not supported.

        Args:
            function: SX or MX Function.
            arguments: its inputs.
        """
        if function.class_name() in _MAPS:
            return self._map(function, arguments)
        if function.is_a("MXFunction"):
            return self._interpret(function, arguments)
        if function.is_a("SXFunction"):
            return [SX(y) for y in function.call([_as_matrix(x) for x in arguments])]
        raise ModelError(f"{function.name()} is not made of scalar operations")

    def _interpret(self, function: Function, arguments: Sequence[_Value]) -> list[SX]:
        """Return the outputs of an MX Function by executing its instructions on symbols."""
        work: dict[int, _Value] = {}
        results = [[SX(0)] * function.nnz_out(k) for k in range(function.n_out())]
        for k in range(function.n_instructions()):
            op, node = function.instruction_id(k), function.instruction_MX(k)
            source, target = function.instruction_input(k), function.instruction_output(k)
            if op == casadi.OP_OUTPUT:
                place, value = node.info(), _as_matrix(work[source[0]])
                for j in range(value.nnz()):
                    results[place["ind"]][place["offset"] + j] = SX(value.nz[j])
                continue
            if op == casadi.OP_INPUT:
                outputs: Sequence[_Value] = [_input_part(arguments, node)]
            else:
                outputs = self._step(op, node, [work[n] if n >= 0 else SX(0) for n in source])
            work.update(zip(target, outputs, strict=True))
        return [
            SX(function.sparsity_out(k), casadi.vertcat(*result))
            if result
            else SX(function.sparsity_out(k))
            for k, result in enumerate(results)
        ]

    def _step(self, op: int, node: MX, arguments: list[_Value]) -> Sequence[_Value]:
        """Return the results of one instruction of an MX Function, with CasADi operation `op`.

        `node` is the CasADi node of the instruction, with its `arguments`. Raises ModelError for
        operations that are not supported.
        """
        if op == casadi.OP_CALL:
            return self.called(node.which_function(), arguments)
        if op == casadi.OP_HORZREPMAT:
            value = _as_matrix(arguments[0])
            return [_Tiled(value, node.shape[1] // value.shape[1])]
        values = [_as_matrix(x) for x in arguments]
        if op in ELEMENTWISE:
            return [SX.binary(op, *values) if len(values) == 2 else SX.unary(op, *values)]
        if op in _SPLITS:
            ends = [0]
            for k in range(node.n_out()):
                ends.append(ends[-1] + node.get_output(k).shape[op == casadi.OP_HORZSPLIT])
            return list(_SPLITS[op](values[0], ends))
        if op not in _MOVES:
            raise ModelError(f"operation {op} of CasADi between maps is not known here")
        return [SX(_MOVES[op](node, values))]

    def _map(self, function: Function, arguments: Sequence[_Value]) -> list[SX]:
        """Record a map `function` of symbolic `arguments` and return its outputs as new symbols."""
        column, columns = function, 1
        while column.class_name() in _MAPS:
            facts = column.info()
            column, columns = facts["f"], columns * facts["n"]
        first_in, first_out = len(self.arguments), len(self.symbols)
        shared = tuple(isinstance(x, _Tiled) and x.times == columns for x in arguments)
        for k, x in enumerate(arguments):
            if isinstance(x, _Tiled) and shared[k]:
                self.arguments.append(_elements(casadi.project(x.value, column.sparsity_in(k))))
            else:
                value = casadi.project(_as_matrix(x), function.sparsity_in(k))
                self.arguments.append(_in_lanes(value, column.nnz_in(k), columns))
        results = []
        for k in range(column.n_out()):
            symbol = SX.sym(f"m{len(self.symbols)}", column.nnz_out(k), columns)
            self.symbols.append(symbol)
            results.append(SX(function.sparsity_out(k), _elements(symbol)))
        ends = range(first_in, len(self.arguments)), range(first_out, len(self.symbols))
        self.maps.append(Mapped(column, columns, shared, *map(tuple, ends)))
        return results


def _as_matrix(value: _Value) -> SX:
    """Return `value` as a matrix; a repeated matrix is written out."""
    return casadi.repmat(value.value, 1, value.times) if isinstance(value, _Tiled) else value


def _input_part(arguments: Sequence[_Value], node: MX) -> _Value:
    """Return the argument, or the part of an argument, that an input node of MX reads."""
    place, pattern = node.info(), node.sparsity()
    argument = arguments[place["ind"]]
    if isinstance(argument, _Tiled) and argument.value.shape[0] == pattern.shape[0]:
        return argument
    value, first = _as_matrix(argument), place["offset"]
    return SX(pattern, _elements(value)[first : first + pattern.nnz()])


def _elements(value: SX) -> SX:
    """Return the nonzero elements of a matrix `value` as a vector (nnz, 1), column by column."""
    return SX(value.nz[:]) if value.nnz() else SX(0, 1)


def _in_lanes(value: SX, rows: int, columns: int) -> SX:
    """Return the elements of columns in groups of LANES, row by row, as a vector.

    `value` has `rows` nonzero elements per column; zeros pad the last group.
    """
    elements = casadi.vertcat(_elements(value), 0)
    indices = [
        column * rows + row if column < columns else rows * columns
        for first in range(0, columns, LANES)
        for row in range(rows)
        for column in range(first, first + LANES)
    ]
    return SX(elements[indices]) if indices else SX(0, 1)


def _select(node: MX, values: list[SX]) -> SX:
    """Return selected nonzero elements of `values[0]` with the sparsity of the node.

    Raises ModelError if the selection leaves elements out.
    """
    facts, pattern = node.info(), node.sparsity()
    if "nz" in facts:
        indices = list(facts["nz"])
    elif "slice" in facts:
        indices = list(_range(facts["slice"]))
    else:
        inner, outer = _range(facts["inner"]), _range(facts["outer"])
        indices = [a + b for a in outer for b in inner]
    if any(place < 0 for place in indices):
        raise ModelError("a selection that leaves elements out is not known here")
    return SX(pattern, _elements(values[0])[indices]) if indices else SX(pattern)


def _range(slice_: Mapping[str, int]) -> range:
    """Return the range of a CasADi slice, a dict with start, stop and step."""
    return range(slice_["start"], slice_["stop"], slice_["step"])


_SPLITS = {casadi.OP_HORZSPLIT: casadi.horzsplit, casadi.OP_VERTSPLIT: casadi.vertsplit}
_MOVES: Mapping[int, Callable[[MX, list[SX]], SX]] = {
    casadi.OP_CONST: lambda node, _: SX(node.to_DM()),
    casadi.OP_RESHAPE: lambda node, values: SX(node.sparsity(), _elements(values[0])),
    casadi.OP_TRANSPOSE: lambda _, values: values[0].T,
    casadi.OP_MTIMES: lambda _, values: values[0] + casadi.mtimes(values[1], values[2]),
    casadi.OP_HORZCAT: lambda _, values: casadi.horzcat(*values),
    casadi.OP_VERTCAT: lambda _, values: casadi.vertcat(*values),
    casadi.OP_PROJECT: lambda node, values: casadi.project(values[0], node.sparsity()),
    casadi.OP_GETNONZEROS: _select,
}
