"""Functions whose calls accept arrays, lists and numbers and return numpy arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from casadi import DM, MX, SX, Function, Sparsity

from mbs.core import code_address, core_library, work_sizes
from mbs.errors import ModelError
from mbs.numbers import doubles

# Built-in (C) callable that evaluates a compiled function without conversions in Python.


ArrayCall: TypeAlias = Callable[..., Any]
"""Callable from arrays, lists and numbers to arrays; returns None for unsupported arguments."""

_MOST = 64
"""Maximum number of inputs, and of outputs, of such a callable; equal to the limit in C."""


class InputCheck(NamedTuple):
    """Function that checks whether the inputs of a model are valid.

    Attributes:
        builtin: built-in callable of the check; its function returns 1 for valid inputs.
        inputs: indices of the model inputs that are passed to the check.
    """

    builtin: Any
    inputs: Sequence[int]


def array_builtin(
    function: Function,
    library: Path,
    finite: bool,
    guard: InputCheck | None = None,
    more: int = 0,
) -> ArrayCall | None:
    """Return a built-in callable for a function of a library, in CasADi's calling convention.

    Its arguments are arrays, lists and numbers. Arrays of doubles in Fortran order are not copied;
    other arguments are. Output arrays may be passed after the inputs; otherwise new arrays are
    returned. It returns None for any other argument.

    Args:
        function: the same function as a CasADi Function, for the signature.
        library: path of the library that contains the function.
        finite: whether to return None also if an input or a result is not finite, or if a nonzero
            number is passed for an input of several elements.
        guard: check of the inputs; the callable returns None also if the check fails.
        more: work space in doubles in addition to the size that the library reports.

    Returns:
        the built-in callable; None if the function has more inputs or outputs than it supports.
    """
    name, code = function.name(), ctypes.CDLL(str(library))
    *sizes, reals = work_sizes(code, name)
    inputs = [function.sparsity_in(k) for k in range(function.n_in())]
    outputs = [function.sparsity_out(k) for k in range(function.n_out())]
    if max(len(inputs), len(outputs)) > _MOST:
        return None
    if hasattr(code, f"{name}_incref"):
        code[f"{name}_incref"]()
    builtin: ArrayCall = core_library().array_call(
        tuple(code_address(code, f"{name}{end}") for end in ("", "_checkout", "_release")),
        (*sizes, reals + more),
        (np.ndarray, np.ma.MaskedArray, np.empty),
        tuple(map(_shape, inputs)),
        tuple((_shape(pattern), _arguments_of_empty(pattern)) for pattern in outputs),
        finite,
        *((None, ()) if guard is None else (guard.builtin, tuple(guard.inputs))),
    )
    return builtin


def _shape(pattern: Sparsity) -> tuple[Any, ...]:
    """Return rows, columns, number of stored elements, and their indices, of a sparsity pattern.

    The indices are None if the matrix is dense.
    """
    indices = None if pattern.is_dense() else np.array(pattern.find(), dtype=np.int64)
    return (*pattern.shape, pattern.nnz(), indices)


def _arguments_of_empty(pattern: Sparsity) -> tuple[Any, ...]:
    """Return arguments of numpy.empty for a result with a sparsity `pattern`: shape, type, order.

    The shape is (n,) for one column, else (rows, columns) in Fortran order.
    """
    rows, columns = pattern.shape
    return ((rows,) if columns == 1 else (rows, columns)), np.float64, "F"


def with_array_calls(
    function: Function,
    library: Path | None,
    like: Any = None,
    code_of: Callable[[Function], Any] | None = None,
) -> Function:
    """Change a Function in place so that calls with numbers return numpy arrays.

    Args:
        function: Function without other references.
        library: library of its code; None if it is interpreted.
        like: method of a model that adds the checks and defaults of the model to a Function.
        code_of: callable that compiles the Function which checks model inputs. Without it, calls
            of a model with such a check use the slower Python implementation.
    """
    result: Any = function if like is None else like(function)
    result.__class__ = _class_with_arrays(type(result))
    result._arrays = _decline
    if library is not None:
        valid = None if like is None else result.valid()
        if valid is None:
            finite = like is not None and not result.may_be_nan
            result._arrays = array_builtin(function, library, finite) or _decline
        elif code_of is not None:  # otherwise the model checks its inputs in Python
            result._arrays = _guarded(result, function, library, valid, code_of)
    result._last = None if like is None else default_of_last(function, like.__self__)
    result._inputs = function.n_in()
    result._model = like is not None
    return result  # type: ignore[no-any-return]


def _guarded(
    result: Any,
    function: Function,
    library: Path,
    valid: Function,
    code_of: Callable[[Function], Any],
) -> ArrayCall:
    """Return a callable for a model with an input check.

    `valid` is the Function of the check; `code_of` compiles it at the first call.

    `result` is the callable object of the model, `function` its Function and `library` its library.
    """

    def first(*args: Any) -> Any:
        builtin = code_of(valid)._arrays
        if hasattr(builtin, "__self__"):
            names = function.name_in()
            guard = InputCheck(builtin, [names.index(name) for name in valid.name_in()])
            builtin = array_builtin(function, library, True, guard) or _decline
        result._arrays = builtin
        return builtin(*args)

    return first


class ArrayCalls:
    """Mixin of a class of Functions for calls on arrays.

    A call whose arguments are all arrays, lists or numbers returns a numpy array, or a tuple of
    arrays for several outputs. An output with one column is a vector. CasADi handles other calls.
    """

    _arrays: ArrayCall
    _last: np.ndarray[Any, Any] | None
    _inputs: int
    _model: bool
    _source: tuple[Callable[[Function], Function], tuple[Function]]

    def __call__(self, *args: Any, out: Any = None, **kwargs: Any) -> Any:
        """Evaluate the Function on arrays, numbers or symbols.

        Args:
            *args: inputs in order; the parameters of a model may be omitted.
            out: array of doubles for the output, or a tuple of arrays for several outputs. Matrices
                in Fortran order that share no memory with an input are fastest.
            **kwargs: inputs by name, as for any Function; the result is then a dict.

        Returns:
            the outputs, or `out` if it was passed.

        Raises:
            ModelError: `out` does not fit. For a model also: an input has the wrong size, or the
                result is not a number.
        """
        if not kwargs:
            plain = out is None and len(args) == self._inputs
            result = self._arrays(*args) if plain else self._fast(args, out)
            if result is not None:
                return result if out is None else out
        return self._slow(args, kwargs, out)

    def _fast(self, args: tuple[Any, ...], out: Any) -> Any:
        """Return the result of the built-in callable; None if it does not support the arguments.

        `out` is None, an array or a tuple of arrays.

        `args` are the arguments of the call.
        """
        if len(args) != self._inputs:
            if self._last is None or len(args) != self._inputs - 1:
                return None
            args = (*args, self._last)
        if out is None:
            return self._arrays(*args)
        return self._arrays(*args, *(out if isinstance(out, tuple) else (out,)))

    def _slow(self, args: tuple[Any, ...], kwargs: dict[str, Any], out: Any) -> Any:
        """Return the result for `args` and `kwargs` by CasADi; it is also written to `out`.

        It serves symbols, several columns and arguments that raise errors.
        """
        if any(_holds(x, np.ma.MaskedArray) for x in args):
            raise ModelError(
                f"{self.name()}: an input has a mask, which would be passed over; give"  # type: ignore[attr-defined]
                " array.filled(value)"
            )
        numbers = bool(args) and not kwargs and not any(_holds(x, _OF_CASADI) for x in args)
        if numbers:
            found = [doubles(x) for x in args]
            if not any(isinstance(x, str) for x in found):
                result = self._fast(tuple(found), out)  # arguments that numpy could convert
                if result is not None:
                    return result if out is None else out
                if not self._model:  # a model converts and checks its arguments itself
                    args = tuple(found)
        result = super().__call__(*args, **kwargs)  # type: ignore[misc]
        if out is not None:
            return _copy(self, result, out)
        return _numpy(result) if numbers else result

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the original Function; it is compiled again when the pickle is read."""
        return self._source

    def __deepcopy__(self, dummy: Any = None) -> ArrayCalls:
        """Return the Function itself, because Functions are immutable."""
        return self


_OF_CASADI = (DM, SX, MX)
"""CasADi types. If an argument has one of them, CasADi determines the type of the result."""


def _holds(value: Any, kinds: type | tuple[type, ...]) -> bool:
    """Whether a value, or an item of a list of values, has one of the types `kinds`."""
    if isinstance(value, (list, tuple)):
        return any(_holds(item, kinds) for item in value)
    return isinstance(value, kinds)


_CLASSES: dict[type, type] = {}


def _class_with_arrays(base: type) -> type:
    """Return the subclass of `base` with the mixin `ArrayCalls`; the same class at every call."""
    body = {"__doc__": base.__doc__, "__module__": base.__module__}
    made = type(base.__name__, (ArrayCalls, base), body)
    return _CLASSES.setdefault(base, made)


def _decline(*_: Any) -> None:
    """Return None: placeholder of a built-in callable that supports no arguments."""


def default_of_last(function: Function, model: Any) -> np.ndarray[Any, Any] | None:
    """Return the default of the last input `p` of a model; None if it must be passed.

    Args:
        function: Function with the inputs of the model.
        model: model with the method `default_of_p`, such as a `ModelFunction`.
    """
    if function.n_in() == 0 or function.name_in(function.n_in() - 1) != "p":
        return None
    found: np.ndarray[Any, Any] | None = model.default_of_p()
    return found


def _numpy(result: Any) -> Any:
    """Return a numeric result of CasADi as a numpy array: a vector if it has one column.

    A tuple of results becomes a tuple of arrays.
    """
    if isinstance(result, tuple):
        return tuple(map(_numpy, result))
    array = DM(result).full()
    return array.ravel() if array.shape[1] == 1 else array


def _copy(function: Any, result: Any, out: Any) -> Any:
    """Copy a result of `function` to the arrays of `out` and return `out`.

    Raises ModelError if an array does not fit.
    """
    if isinstance(result, dict):
        result = tuple(result.values())
    results = result if isinstance(result, tuple) else (result,)
    targets = out if isinstance(out, tuple) else (out,)
    if len(targets) != len(results):
        raise ModelError(
            f"{function.name()}: out has {len(targets)} arrays, there are {len(results)} outputs"
        )
    for name, value, target in zip(function.name_out(), results, targets, strict=True):
        array = _numpy(value)
        fits = isinstance(target, np.ndarray) and target.shape in (array.shape, (*array.shape, 1))
        if not (fits and target.dtype == np.float64 and target.flags.writeable):
            raise ModelError(
                f"{function.name()}: out for {name} must be a writable array of doubles of shape"
                f" {array.shape}"
            )
        target[...] = array.reshape(target.shape)
    return out
