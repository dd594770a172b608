"""Several Functions of the same inputs as one, its inputs and outputs dense columns."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import MX, Function

from mbs.errors import ModelError
from mbs.native.batch_arrays import ArrayPort


def joined(functions: Sequence[Function]) -> tuple[Function, list[ArrayPort], list[ArrayPort]]:
    """The Functions as one: inputs of one name are one, equal operations are done once.

    Args:
        functions: at least one.

    Returns:
        the Function, of scalar operations if all of them are, whose inputs and outputs are columns
        (matrices row by row), then what these are.

    Raises:
        ModelError: inputs of one name differ in shape.
    """
    symbols: dict[str, MX] = {}
    ports: dict[str, ArrayPort] = {}
    outputs, results = [], []
    for function in functions:
        arguments = []
        for k, name in enumerate(function.name_in()):
            port = ArrayPort(name, _shape(function.size_in(k)))
            if ports.setdefault(name, port) != port:
                raise ModelError(
                    f"{function.name()} has the input {port}, {functions[0].name()} has"
                    f" {ports[name]}; batches need inputs of one shape for one name"
                )
            symbol = symbols.setdefault(name, MX.sym(name, port.size))
            rows, columns = function.size_in(k)
            matrix = casadi.reshape(symbol, columns, rows).T if columns > 1 else symbol
            arguments.append(casadi.project(matrix, function.sparsity_in(k)))
        for k, result in enumerate(Function(function).call(arguments)):
            name = function.name_out(k)
            title = name if len(functions) == 1 else f"{function.name()}.{name}"
            outputs.append(ArrayPort(title, _shape(result.shape)))
            results.append(casadi.vec(casadi.densify(result).T))
    name = "_".join(function.name() for function in functions)
    whole = Function(name, list(symbols.values()), results, list(ports), _labels(len(results)))
    return _scalar(whole, len(functions)), list(ports.values()), outputs


def _shape(size: tuple[int, int]) -> tuple[int, ...]:
    """What has one column is a vector."""
    return size[:1] if size[1] == 1 else size


def _labels(count: int) -> list[str]:
    return [f"result{k}" for k in range(count)]


def _scalar(function: Function, parts: int) -> Function:
    """The same of scalar operations, those that parts have in common done once; else as it is."""
    try:
        scalar = function.expand()
    except RuntimeError:
        return function
    if parts == 1:
        return scalar
    symbols = scalar.sx_in()
    results = casadi.cse(scalar.call(symbols))
    return Function(scalar.name(), symbols, results, scalar.name_in(), scalar.name_out())
