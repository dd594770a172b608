"""Functions that take arrays, lists and numbers and give numpy arrays."""

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

# A builtin that calls a compiled function on numbers, without conversions in Python.


ArrayCall: TypeAlias = Callable[..., Any]
"""Takes arrays, lists and numbers, gives arrays; None for what it does not take."""

_MOST = 64
"""Inputs, and outputs, of a function that is called so; as in the C code."""


class InputCheck(NamedTuple):
    """What determines whether a function takes its inputs.

    Attributes:
        builtin: of the function that gives 1 where it does.
        inputs: the numbers of the inputs that it asks for.
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
    """The builtin of a function in a library, in CasADi's calling convention.

    Its inputs are arrays, lists and numbers: arrays of doubles whose columns follow each other in
    memory are read where they are, others are gathered. Its outputs are new arrays, or those that
    follow the inputs. It answers None for anything else.

    Args:
        function: the same function for CasADi.
        library: holds it.
        finite: answer None too where an input or a result is not a finite number, or a number
            other than zero stands for several elements.
        guard: answer None too where it says so.
        more: doubles of work space beyond what the library says it needs.

    Returns:
        the builtin; None when the function has dozens of inputs or outputs.
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


def _indices(pattern: Sparsity) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Where the stored elements of a sparse matrix stand in the dense one, column after column."""
    return np.array(pattern.find(), dtype=np.int64)


def _shape(pattern: Sparsity) -> tuple[Any, ...]:
    """Rows, columns, number of stored elements, and their indices if some are not stored."""
    indices = None if pattern.is_dense() else _indices(pattern)
    return (*pattern.shape, pattern.nnz(), indices)


def _arguments_of_empty(pattern: Sparsity) -> tuple[Any, ...]:
    """What numpy.empty is given: one column is a vector, all else a matrix."""
    rows, columns = pattern.shape
    return ((rows,) if columns == 1 else (rows, columns)), np.float64, "F"


def with_array_calls(
    function: Function,
    library: Path | None,
    like: Any = None,
    code_of: Callable[[Function], Any] | None = None,
) -> Function:
    """The Function, which answers numbers with arrays from now on.

    Args:
        function: one that nobody else holds.
        library: has its code; None when it is interpreted.
        like: the method of a model that gives another Function its checks and defaults.
        code_of: gives what determines whether a model takes its inputs as a Function of this kind;
            a model that asks something of its inputs takes no short way without it.
    """
    result: Any = function if like is None else like(function)
    result.__class__ = _class_with_arrays(type(result))
    result._arrays = _decline
    if library is not None:
        valid = None if like is None else result.valid()
        if valid is None:
            finite = like is not None and not result.may_be_nan
            result._arrays = array_builtin(function, library, finite) or _decline
        elif code_of is not None:  # without it calls go the model's way, which asks them
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
    """The builtin of a model that takes not all numbers, made when it is first called."""

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
    """Mixed into a class of Functions.

    A call whose arguments are all arrays, lists or numbers returns a numpy array, or a tuple of
    them; what has one column is a vector. Any other call is CasADi's.
    """

    _arrays: ArrayCall
    _last: np.ndarray[Any, Any] | None
    _inputs: int
    _model: bool
    _source: tuple[Callable[[Function], Function], tuple[Function]]

    def __call__(self, *args: Any, out: Any = None, **kwargs: Any) -> Any:
        """Evaluate it on arrays, numbers or symbols.

        Args:
            *args: the inputs in their order; the parameters of a model may be left out.
            out: arrays of doubles that take the outputs, one or a tuple; fastest when matrices
                are in columns (order="F") and share no memory with an input.
            **kwargs: the inputs by name, as of any Function; the answer is then a dict.

        Returns:
            `out` if given.

        Raises:
            ModelError: `out` does not fit; of a model, an input has a wrong size, or the result
                is not a number.
        """
        if not kwargs:
            plain = out is None and len(args) == self._inputs
            result = self._arrays(*args) if plain else self._fast(args, out)
            if result is not None:
                return result if out is None else out
        return self._slow(args, kwargs, out)

    def _fast(self, args: tuple[Any, ...], out: Any) -> Any:
        """What the builtin answers; None where it takes the arguments not as they are."""
        if len(args) != self._inputs:
            if self._last is None or len(args) != self._inputs - 1:
                return None
            args = (*args, self._last)
        if out is None:
            return self._arrays(*args)
        return self._arrays(*args, *(out if isinstance(out, tuple) else (out,)))

    def _slow(self, args: tuple[Any, ...], kwargs: dict[str, Any], out: Any) -> Any:
        """CasADi's call: of symbols, of several columns, of what is refused."""
        if any(_holds(x, np.ma.MaskedArray) for x in args):
            raise ModelError(
                f"{self.name()}: an input has a mask, which would be passed over; give"  # type: ignore[attr-defined]
                " array.filled(value)"
            )
        numbers = bool(args) and not kwargs and not any(_holds(x, _OF_CASADI) for x in args)
        if numbers:
            found = [doubles(x) for x in args]
            if not any(isinstance(x, str) for x in found):
                result = self._fast(tuple(found), out)  # of what numpy knows to convert
                if result is not None:
                    return result if out is None else out
                if not self._model:  # a model reads its arguments itself
                    args = tuple(found)
        result = super().__call__(*args, **kwargs)  # type: ignore[misc]
        if out is not None:
            return _copy(self, result, out)
        return _numpy(result) if numbers else result

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickle holds what it was made of, and is compiled where it is read."""
        return self._source

    def __deepcopy__(self, dummy: Any = None) -> ArrayCalls:
        """Itself: a Function never changes."""
        return self


_OF_CASADI = (DM, SX, MX)
"""With one of these among the arguments of a call, CasADi says what it returns."""


def _holds(value: Any, kinds: type | tuple[type, ...]) -> bool:
    """Whether an argument, or an item of a list, is of these types."""
    if isinstance(value, (list, tuple)):
        return any(_holds(item, kinds) for item in value)
    return isinstance(value, kinds)


_CLASSES: dict[type, type] = {}


def _class_with_arrays(base: type) -> type:
    """The class of Functions with this mixin; one for each base."""
    body = {"__doc__": base.__doc__, "__module__": base.__module__}
    made = type(base.__name__, (ArrayCalls, base), body)
    return _CLASSES.setdefault(base, made)


def _decline(*_: Any) -> None:
    """The answer of a builtin that takes nothing."""


def default_of_last(function: Function, model: Any) -> np.ndarray[Any, Any] | None:
    """What a model takes for its last input p when it is left out; None when it must be given.

    Args:
        function: with the inputs of the model.
        model: knows its defaults, as `ModelFunction` does.
    """
    if function.n_in() == 0 or function.name_in(function.n_in() - 1) != "p":
        return None
    found: np.ndarray[Any, Any] | None = model.default_of_p()
    return found


def _numpy(result: Any) -> Any:
    if isinstance(result, tuple):
        return tuple(map(_numpy, result))
    array = DM(result).full()
    return array.ravel() if array.shape[1] == 1 else array


def _copy(function: Any, result: Any, out: Any) -> Any:
    """`out` with the result in it."""
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
