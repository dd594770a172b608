"""A Function as a JAX callable that runs its machine code, with its exact derivatives."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np
from casadi import Function, densify
from numpy.typing import NDArray

from mbs.errors import ModelError
from mbs.native import compiled
from mbs.native.compiled import require_function

_Array = NDArray[np.float64]


def jax_function(function: Function) -> Callable[..., Any]:
    """The Function for JAX: under `jit`, `vmap`, `grad`, `jacfwd`, `jacrev` and `hessian`.

    JAX calls machine code on the host by `jax.pure_callback`. Derivatives are products with the
    Function's own Jacobian, which is again such a callable, so they can be taken to any order and
    in both directions; each order is compiled when JAX first asks for it. For use on the CPU;
    an accelerator waits for the host at every call.

    Args:
        function: any Function of vectors without free symbols, such as a model.

    Returns:
        a callable of arrays: an input of n rows is (n,), or () where n is 1 and a number is given;
        an output of one column is (n,), of several a matrix (m, n); several outputs are a tuple.

    Raises:
        ModelError: JAX is not installed or calculates with 32 bits; an input has several columns.
    """
    jax = _jax()
    require_function(function)
    if any(function.size2_in(k) > 1 for k in range(function.n_in())):
        raise ModelError(f"{function.name()}: an input is a matrix; make it a vector")
    return _differentiable(jax, Function(function))


def _jax() -> Any:
    try:
        jax = importlib.import_module("jax")
    except ImportError as error:
        raise ModelError('JAX is not installed; use pip install "mbs[jax]"') from error
    if not jax.config.jax_enable_x64:
        raise ModelError(
            "JAX calculates with 32 bits; use jax.config.update('jax_enable_x64', True) first"
        )
    return jax


def _differentiable(jax: Any, function: Function) -> Callable[..., Any]:
    """The callable, and by the rule of its tangents all its derivatives."""
    values = _on_host(jax, function)
    slopes: list[Callable[..., Any]] = []

    @jax.custom_jvp  # type: ignore[untyped-decorator]
    def call(*inputs: Any) -> tuple[Any, ...]:
        return values(*inputs)

    @call.defjvp  # type: ignore[untyped-decorator]
    def tangents(points: Any, directions: Any) -> tuple[Any, Any]:
        if not slopes:
            slopes.append(_differentiable_jacobian(jax, function))
        return call(*points), slopes[0](points, directions)

    def answer(*given: Any) -> Any:
        outputs = call(*_inputs(jax, function, given))
        return outputs[0] if len(outputs) == 1 else outputs

    answer.outputs = call  # type: ignore[attr-defined]
    return answer


def _differentiable_jacobian(jax: Any, function: Function) -> Callable[..., tuple[Any, ...]]:
    """Sum over the inputs of d(output)/d(input) times a direction, for every output."""
    inputs, outputs = function.n_in(), function.n_out()
    point = function.mx_in()
    blocks = function.jacobian().call([*point, *function.call(point)])
    flat = Function(f"slopes_{function.name()}", point, [densify(block) for block in blocks])
    slopes = _differentiable(jax, flat).outputs  # type: ignore[attr-defined]

    def product(points: Any, directions: Any) -> tuple[Any, ...]:
        every = slopes(*points)
        result = []
        for k in range(outputs):
            row = every[k * inputs : (k + 1) * inputs]
            terms = [
                jax.numpy.atleast_2d(J).reshape(function.numel_out(k), -1) @ d
                for J, d in zip(row, directions, strict=True)
            ]
            result.append(_shaped(sum(terms), function.size_out(k)))
        return tuple(result)

    return product


def _shaped(column: Any, size: tuple[int, int]) -> Any:
    """What CasADi stacks by columns, as a vector or a matrix."""
    rows, columns = size
    return column if columns == 1 else column.reshape(columns, rows).T


def _inputs(jax: Any, function: Function, given: tuple[Any, ...]) -> list[Any]:
    names = function.name_in()
    if len(given) != len(names):
        raise ModelError(
            f"{function.name()}: {len(given)} arguments were given; the inputs are"
            f" {', '.join(names)}"
        )
    arrays = [jax.numpy.asarray(value, dtype=float).reshape(-1) for value in given]
    for name, array in zip(names, arrays, strict=True):
        if array.size != function.size1_in(name):
            raise ModelError(
                f"{function.name()}: {name} has {array.size} values, it needs"
                f" {function.size1_in(name)}"
            )
    return arrays


def _on_host(jax: Any, function: Function) -> Callable[..., tuple[Any, ...]]:
    """The machine code behind a callback; a batch of points is a loop on the host."""
    machine = compiled(function, derivatives=0)
    shapes = [_shape(function.size_out(k)) for k in range(function.n_out())]

    def evaluate(*points: Any) -> tuple[_Array, ...]:
        arrays = [np.asarray(point, dtype=float) for point in points]
        lead = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
        rows = [np.broadcast_to(a, (*lead, a.shape[-1])).reshape(-1, a.shape[-1]) for a in arrays]
        outputs = [np.empty((int(np.prod(lead)), *shape)) for shape in shapes]
        for number in range(len(outputs[0])):
            found = machine.call([row[number] for row in rows])
            for output, value, shape in zip(outputs, found, shapes, strict=True):
                output[number] = np.array(value).reshape(shape)
        return tuple(o.reshape(*lead, *s) for o, s in zip(outputs, shapes, strict=True))

    wanted = tuple(jax.ShapeDtypeStruct(shape, np.float64) for shape in shapes)

    def values(*points: Any) -> tuple[Any, ...]:
        answer: tuple[Any, ...] = jax.pure_callback(
            evaluate, wanted, *points, vmap_method="broadcast_all"
        )
        return answer

    return values


def _shape(size: tuple[int, int]) -> tuple[int, ...]:
    return size[:1] if size[1] == 1 else size
