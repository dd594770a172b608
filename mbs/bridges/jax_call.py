"""CasADi Function as a JAX callable that runs compiled code, with exact derivatives."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from casadi import Function, densify
from numpy.typing import NDArray

from mbs.errors import ModelError
from mbs.native import batch
from mbs.native._batch import Batch
from mbs.native._compiled import require_function
from mbs.text import install_command

_Outputs = Callable[..., tuple[Any, ...]]


def jax_function(function: Function) -> Callable[..., Any]:
    """Return a Function as a JAX callable for `jit`, `vmap`, `grad`, `jacfwd`, `jacrev`, `hessian`.

    JAX calls the compiled code on the host by `jax.pure_callback`, once for all points of a `vmap`,
    which form a batch; see `mbs.native.batch`. Derivatives are products with the Jacobian Function,
    which is converted in the same way, so forward and reverse derivatives of any order are
    available. Each order is compiled at its first use. The callable is intended for the CPU; an
    accelerator waits for the host at every call.

    Args:
        function: Function of vectors without free symbols, such as a model.

    Returns:
        Callable of arrays, by position or by name. The parameters of a model are optional. An input
        of n rows is (n,), or () if n is 1. An output with one column is (n,), and with several
        columns a matrix (m, n). Several outputs are a tuple.

    Raises:
        ModelError: JAX is not installed or uses 32 bits, the argument is not a Function, or an
            input has several columns.
    """
    jax = _jax()
    require_function(function)
    if any(function.size2_in(k) > 1 for k in range(function.n_in())):
        raise ModelError(f"{function.name()}: an input is a matrix; make it a vector")
    machine = batch(function)
    call = _differentiable(jax, Function(function), machine)

    def answer(*args: Any, **named: Any) -> Any:
        outputs = call(*_vectors(jax, machine, machine.ordered(args, named)))
        return outputs[0] if len(outputs) == 1 else outputs

    answer.__name__, answer.__doc__ = function.name(), str(function)
    return answer


def _jax() -> Any:
    """Return the module jax. Raise ModelError if it is not installed or uses 32 bits."""
    try:
        jax = importlib.import_module("jax")
    except ImportError as error:
        raise ModelError(f"JAX is not installed; run: {install_command('jax')}") from error
    if not jax.config.jax_enable_x64:
        raise ModelError(
            "JAX calculates with 32 bits; use jax.config.update('jax_enable_x64', True) first"
        )
    return jax


def _differentiable(jax: Any, function: Function, machine: Batch) -> _Outputs:
    """Return a JAX callable of the outputs with a rule for forward derivatives (JVP).

    JAX uses the rule for all derivatives. `machine` is the compiled batch of `function`.
    """
    values = _on_host(jax, machine)
    slopes: list[_Outputs] = []

    @jax.custom_jvp  # type: ignore[untyped-decorator]
    def call(*inputs: Any) -> tuple[Any, ...]:
        return values(*inputs)

    @call.defjvp  # type: ignore[untyped-decorator]
    def tangents(points: Any, directions: Any) -> tuple[Any, Any]:
        if not slopes:
            slopes.append(_slopes(jax, function))
        return call(*points), slopes[0](points, directions)

    outputs: _Outputs = call
    return outputs


def _slopes(jax: Any, function: Function) -> _Outputs:
    """Return a callable (points, directions) of the Jacobian-vector products of every output."""
    inputs, outputs = function.n_in(), function.n_out()
    point = function.mx_in()
    blocks = function.jacobian().call([*point, *function.call(point)])
    flat = Function(f"slopes_{function.name()}", point, [densify(block) for block in blocks])
    slopes = _differentiable(jax, flat, batch(flat))

    def product(points: Any, directions: Any) -> tuple[Any, ...]:
        every = slopes(*points)
        result = []
        for k in range(outputs):
            row = every[k * inputs : (k + 1) * inputs]
            terms = [
                J.reshape(function.numel_out(k), d.size) @ d
                for J, d in zip(row, directions, strict=True)
            ]
            result.append(_shape(sum(terms), function.size_out(k)))
        return tuple(result)

    return product


def _shape(column: Any, size: tuple[int, int]) -> Any:
    """Return an output, stacked column by column, as a vector or as a matrix of this size."""
    rows, columns = size
    return column if columns == 1 else column.reshape(columns, rows).T


def _vectors(jax: Any, machine: Batch, given: Sequence[Any]) -> list[Any]:
    """Return every input as a vector (n,).

    Raises:
        ModelError: an input has another size than the compiled batch requires.
    """
    arrays = [jax.numpy.asarray(value, dtype=float).reshape(-1) for value in given]
    for port, array in zip(machine.inputs, arrays, strict=True):
        if array.size != port.size:
            raise ModelError(
                f"{machine.function.name()}: {port.name} has {array.size} values, it needs"
                f" {port.size}"
            )
    return arrays


def _on_host(jax: Any, machine: Batch) -> _Outputs:
    """Return a JAX callable that evaluates compiled code on the host.

    The points of a `vmap` are the rows of one batch.
    """
    wanted = tuple(jax.ShapeDtypeStruct(port.shape, np.float64) for port in machine.outputs)

    def evaluate(*points: Any) -> tuple[NDArray[np.float64], ...]:
        arrays = [np.asarray(point, dtype=float) for point in points]
        lead = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
        found = machine(*(_rows(array, lead) for array in arrays))
        outputs = found if isinstance(found, tuple) else (found,)
        ports = zip(outputs, machine.outputs, strict=True)
        return tuple(output.reshape(*lead, *port.shape) for output, port in ports)

    def values(*points: Any) -> tuple[Any, ...]:
        answer: tuple[Any, ...] = jax.pure_callback(
            evaluate, wanted, *points, vmap_method="expand_dims"
        )
        return answer

    return values


def _rows(array: NDArray[np.float64], lead: tuple[int, ...]) -> NDArray[np.float64]:
    """Return points (..., n) as rows (N, n), or one vector if all points are equal.

    `lead` are the leading dimensions of all inputs together.
    """
    size = array.shape[-1]
    if array.size == size:
        return array.reshape(size)
    return np.broadcast_to(array, (*lead, size)).reshape(-1, size)
