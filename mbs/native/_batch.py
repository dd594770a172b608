"""Evaluate Functions on many states at once: arrays in, arrays out, on several cores."""

from __future__ import annotations

import ctypes
import functools
import math
import operator
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from threading import Thread
from typing import Any, NamedTuple, TypeAlias

import casadi
import numpy as np
from casadi import MX, Function

from mbs.errors import ModelError
from mbs.native._compiled import require_function
from mbs.native.array_calls import default_of_last
from mbs.native.batch_source import batch_source
from mbs.native.compiler import cached_library, compiler_found
from mbs.native.kernel import FAST_FLAGS, processor
from mbs.numbers import doubles
from mbs.text import quoted

# Arrays of many states: shapes, memory layout, and error messages for arrays that do not fit.


Array: TypeAlias = np.ndarray[Any, Any]

_DOUBLE = 8  # size of a double in bytes
_MOST_PAST = 500  # elements of a state up to which the SIMD lanes of a row fit on any stack
_LINE = 64  # size of a cache line in bytes
_SEARCH = 1000  # maximum work of the overlap check of two arrays (`max_work` of np.shares_memory)


class CPort(ctypes.Structure):
    """C structure `mbs_port` of rows.h: address and strides of an array, in doubles."""

    _fields_ = (
        ("at", ctypes.c_void_p),
        *((name, ctypes.c_longlong) for name in ("row", "column", "stream")),
    )


@dataclass(frozen=True, slots=True)
class ArrayPort:
    """Name and shape of an input or output of a Function for one state.

    Attributes:
        name: name of the input or output.
        shape: (n,) for a column of n elements, (rows, columns) for a matrix.
    """

    name: str
    shape: tuple[int, ...]

    def __str__(self) -> str:
        """Return name and shape as text, such as `q[6]`."""
        return f"{self.name}[{'x'.join(map(str, self.shape))}]"

    @property
    def size(self) -> int:
        """Number of elements per state."""
        return math.prod(self.shape)

    def is_many(self, array: Array) -> bool:
        """Whether an array has a row for each state. Otherwise all states share it.

        Args:
            array: array of doubles whose last dimensions are the shape of this port.
        """
        return array.ndim > len(self.shape)

    def taken(self, value: Any, owner: str) -> Array:
        """Return an input value as an array of doubles, for a single state or for many.

        Arrays of doubles with constant strides are not copied. All other values are.

        Args:
            value: any object; an array of numbers is expected.
            owner: name of the batch, for the error message.

        Raises:
            ModelError: the value is not numeric or has the wrong shape. The message gives the
                expected shape.
        """
        array = doubles(value)
        fault = array if isinstance(array, str) else self._shape_error(array)
        if isinstance(array, str) or fault:
            raise ModelError(f"{owner}: input {self.name} {fault}")
        return array if self._steps(array) else np.array(array, order="C")

    def require_out(self, array: Any, owner: str) -> None:
        """Raise if an array cannot receive this output directly, for one state or for many.

        Args:
            array: any object.
            owner: name of the batch, for the error message.

        Raises:
            ModelError: the object is not an array of float64 with the right shape and constant
                strides.
        """
        fault = ""
        if not isinstance(array, np.ndarray) or array.dtype != np.float64:
            kind = f"an array of {array.dtype}" if isinstance(array, np.ndarray) else quoted(array)
            fault = f"is {kind}; give a numpy array of float64"
        elif isinstance(array, np.ma.MaskedArray):
            fault = "has a mask, which would be passed over; give an array without"
        elif not (fault := self._shape_error(array)) and self._steps(array) is None:
            fault = "has elements that are not evenly spaced in memory, in steps of 8 bytes"
        if fault:
            raise ModelError(f"{owner}: out for {self.name} {fault}")

    def _shape_error(self, array: Array) -> str:
        """Return an error text about the shape of an array; empty if the shape fits."""
        lengths = len(self.shape)
        if array.shape[-lengths:] == self.shape and array.ndim <= lengths + 1:
            return ""
        many = f"(N, {', '.join(map(str, self.shape))})"
        return (
            f"has the shape {array.shape}; give {many}, or {self.shape} that is the same for"
            " all states"
        )

    def c_port(self, array: Array, past_caches: bool) -> CPort:
        """Return the address and strides of an array for C.

        Args:
            array: array that fits this port.
            past_caches: whether to store with non-temporal stores (which bypass the caches), if
                the layout of the array permits it.
        """
        row, column = self._steps(array) or (0, 0)
        address = array.ctypes.data
        if past_caches:
            lines = (row == self.size and column == 1) or (row == 1 and column % _DOUBLE == 0)
            past_caches = lines and self.size <= _MOST_PAST and address % _LINE == 0
        return CPort(address, row, column, past_caches)

    def empty(self, states: int | None) -> Array:
        """Return a new C-ordered array for the values of this port, aligned to a cache line.

        Args:
            states: number of states; None for an array of a single state.
        """
        shape = self.shape if states is None else (states, *self.shape)
        count = math.prod(shape)
        memory = np.empty(count + _LINE // _DOUBLE)
        first = -memory.ctypes.data % _LINE // _DOUBLE
        return memory[first : first + count].reshape(shape)

    def _steps(self, array: Array) -> tuple[int, int] | None:
        """Return the strides in doubles between states and between elements; None if they vary.

        The first is zero for an array that all states share.
        """
        if array.flags.c_contiguous and array.flags.aligned:
            return (self.size if self.is_many(array) else 0), 1
        steps = array.strides
        if any(step % _DOUBLE for step in steps) or not array.flags.aligned:
            return None
        own = [
            (length, step // _DOUBLE)
            for length, step in zip(self.shape, steps[-len(self.shape) :], strict=True)
            if length != 1
        ]
        row = steps[0] // _DOUBLE if self.is_many(array) else 0
        if len(own) == 2 and own[0][1] != own[1][0] * own[1][1]:
            return None
        return row, own[-1][1] if own else 1


def same_place(one: Array, other: Array) -> bool:
    """Whether two arrays have the same address, shape and strides.

    Args:
        one: first array.
        other: second array.
    """
    first, second = ((x.ctypes.data, x.shape, x.strides) for x in (one, other))
    return first == second


def overlap(one: Array, other: Array) -> bool:
    """Whether two arrays share memory. False if the check takes too long.

    Args:
        one: first array.
        other: second array.
    """
    try:
        return np.shares_memory(one, other, max_work=_SEARCH)  # type: ignore[arg-type]
    except np.exceptions.TooHardError:
        return False


def spread(array: Array) -> bool:
    """Whether each element of an array has its own memory: no stride is zero.

    Args:
        array: any array.
    """
    return all(step or length < 2 for length, step in zip(array.shape, array.strides, strict=True))


# Several Functions joined into one Function whose inputs and outputs are dense columns.


def joined(functions: Sequence[Function]) -> tuple[Function, list[ArrayPort], list[ArrayPort]]:
    """Join Functions into one. Inputs with the same name become a single input.

    Operations that several Functions have in common are computed once.

    Args:
        functions: at least one Function.

    Returns:
        the joined Function, the names and shapes of its inputs, and the names and shapes of its
        outputs. Inputs and outputs of the joined Function are columns (matrices row by row). It
        consists of scalar operations (SX) if all Functions can be expanded.

    Raises:
        ModelError: inputs with the same name have different shapes.
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
    labels = [f"result{k}" for k in range(len(results))]
    whole = Function(name, list(symbols.values()), results, list(ports), labels)
    return _scalar_function(whole, len(functions)), list(ports.values()), outputs


def _shape(size: tuple[int, int]) -> tuple[int, ...]:
    """Return the array shape of a matrix of this size; (n,) if it has one column."""
    return size[:1] if size[1] == 1 else size


def _scalar_function(function: Function, parts: int) -> Function:
    """Expand a Function joined from `parts` Functions to scalar operations (SX).

    Common subexpressions are computed once. Functions that cannot be expanded are returned
    unchanged.
    """
    try:
        scalar = function.expand()
    except RuntimeError:
        return function
    if parts == 1:
        return scalar
    symbols = scalar.sx_in()
    results = casadi.cse(scalar.call(symbols))
    return Function(scalar.name(), symbols, results, scalar.name_in(), scalar.name_out())


_SHARE = 8192
"""States per work item of a thread; a multiple of the lanes of every processor."""

_PAST_CACHES = 4_000_000  # bytes of all outputs from which stores bypass the caches


class _Code(NamedTuple):
    """Loaded library, its work space in doubles, and the number of states per SIMD vector."""

    library: ctypes.CDLL
    work: int
    lanes: int


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Functions of the same states, evaluated on arrays of states; created by `batch`.

    Attributes:
        function: joined Function; its inputs and outputs are dense columns (matrices row by row).
        inputs: names and shapes of the inputs for one state.
        outputs: names and shapes of the outputs for one state, Function after Function.
        defaults: values of the inputs that may be omitted, by name.
        note: description of the evaluation: machine code, or interpretation with the reason.
    """

    function: Function
    inputs: tuple[ArrayPort, ...]
    outputs: tuple[ArrayPort, ...]
    defaults: dict[str, Array]
    note: str
    _code: _Code | None
    _functions: tuple[Function, ...]
    _guarded: Function | None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the Functions only; they are compiled again when the pickle is read."""
        return functools.partial(batch, checked=self._guarded is not None), (self._functions,)

    @property
    def lanes(self) -> int:
        """Number of states that a core computes at once; 0 if CasADi interprets the code."""
        return self._code.lanes if self._code else 0

    def __repr__(self) -> str:
        """Return names and shapes of inputs and outputs, and the note."""
        ins, outs = (", ".join(map(str, ports)) for ports in (self.inputs, self.outputs))
        return f"Batch({ins}) -> ({outs}): {self.note}"

    def __call__(
        self, *args: Array, out: Any = None, threads: int | None = None, **named: Array
    ) -> Any:
        """Evaluate the Functions at all states.

        An input of n elements is an array (N, n) of N states; an input matrix is an array
        (N, r, c). An input that is the same for all states is (n,) or (r, c). C order, Fortran
        order and slices of larger arrays are read without a copy. Each row is a state, whereas a
        model called on arrays expects a column per state, as CasADi does. States are independent:
        results are bit-identical for every N and every `threads`.

        Args:
            *args: inputs in order: arrays or nested lists of real numbers. Arrays of doubles with
                constant strides are not copied.
            out: array for the output, or a tuple of arrays for several outputs. An output array
                may be the array of an input of the same shape.
            threads: number of threads. Default: the number of cores of this process.
            **named: inputs by name.

        Returns:
            an array (N, n) or (N, r, c) for each output; a tuple of arrays for several outputs;
            `out` if it was passed. If all inputs are single states, the shape is (n,) or (r, c).

        Raises:
            ModelError: an array does not fit. The message gives its name and the expected shape.
        """
        values = self.ordered(args, named)
        given = [
            port.taken(value, self._name) for port, value in zip(self.inputs, values, strict=True)
        ]
        states = self._states(given)
        results = self._results(out, states)
        if out is not None:
            self._require_apart(given, results)
        count = 1 if states is None else states
        if self._code is None:
            self._interpret(given, results, count)
        else:
            self._run(self._code, [*given, *results], count, self._threads(threads, count))
        if out is not None:
            return out
        return results[0] if len(results) == 1 else tuple(results)

    @property
    def _name(self) -> str:
        """Name of the joined Function, for error messages."""
        return self.function.name()

    def ordered(self, args: Sequence[Any], named: Mapping[str, Any]) -> list[Any]:
        """Return all inputs in order, omitted inputs by their default.

        Args:
            args: inputs in order.
            named: inputs by name.

        Raises:
            ModelError: an input is missing or unknown.
        """
        names = [port.name for port in self.inputs]
        unknown = [name for name in named if name not in names[len(args) :]]
        if len(args) > len(names) or unknown:
            what = quoted(unknown[0]) if unknown else f"{len(args)} inputs"
            raise ModelError(f"{self._name} does not take {what}; it takes {', '.join(names)}")
        values = {**self.defaults, **dict(zip(names, args, strict=False)), **named}
        missing = [name for name in names if name not in values]
        if missing:
            raise ModelError(f"{self._name}: input {missing[0]} is missing; give it as an array")
        return [values[name] for name in names]

    def _states(self, given: Sequence[Array]) -> int | None:
        """Return the number of states; None if all inputs are single states.

        `given` are the arrays of the inputs. Raises ModelError if they have different numbers of
        states.
        """
        rows = [
            (port.name, len(array))
            for port, array in zip(self.inputs, given, strict=True)
            if port.is_many(array)
        ]
        if len({length for _, length in rows}) > 1:
            found = ", ".join(f"{name} has {length} states" for name, length in rows)
            raise ModelError(f"{self._name}: {found}; give them one length")
        return rows[0][1] if rows else None

    def _results(self, out: Any, states: int | None) -> list[Array]:
        """Return the arrays of the outputs: new arrays, or `out` after a check.

        `states` is the number of states, None for a single state.
        """
        if out is None:
            return [port.empty(states) for port in self.outputs]
        arrays = list(out) if isinstance(out, (tuple, list)) else [out]
        if len(arrays) != len(self.outputs):
            raise ModelError(
                f"{self._name}: out has {len(arrays)} arrays, there are {len(self.outputs)} outputs"
            )
        for port, array in zip(self.outputs, arrays, strict=True):
            port.require_out(array, self._name)
            shape = port.shape if states is None else (states, *port.shape)
            if array.shape != shape or not array.flags.writeable or not spread(array):
                raise ModelError(
                    f"{self._name}: out for {port.name} must be a writable array of shape {shape}"
                )
        return arrays

    def _require_apart(self, given: Sequence[Array], results: Sequence[Array]) -> None:
        """Raise ModelError if an output array shares memory with another array.

        An output may be exactly the array of an input.

        `given` are the arrays of the inputs, `results` those of the outputs.
        """
        for port, result in zip(self.outputs, results, strict=True):
            others = [array for array in results if array is not result]
            inputs = [array for array in given if not same_place(array, result)]
            if any(overlap(array, result) for array in (*inputs, *others)):
                raise ModelError(
                    f"{self._name}: out for {port.name} shares memory with another array; give an"
                    " array of its own, or an input itself"
                )

    def _threads(self, asked: int | None, states: int) -> int:
        """Return the number of threads: `asked` or all cores, at most one per 8192 states.

        Raises ModelError if `asked` is not a positive integer or None.
        """
        if asked is None:
            asked = cores()
        elif isinstance(asked, bool) or not hasattr(asked, "__index__") or asked < 1:
            raise ModelError(f"{self._name}: threads is {quoted(asked)}; give 1 or more, or None")
        return max(1, min(operator.index(asked), -(-states // _SHARE)))

    def _run(self, code: _Code, arrays: Sequence[Array], states: int, threads: int) -> None:
        """Evaluate all states by machine code, in shares that several threads take in turn.

        `arrays` are the inputs, then the outputs, which are overwritten.
        """
        given = len(self.inputs)
        past = sum(array.nbytes for array in arrays[given:]) > _PAST_CACHES
        ports = enumerate(zip((*self.inputs, *self.outputs), arrays, strict=True))
        table = (CPort * len(arrays))(
            *(port.c_port(array, past and k >= given) for k, (port, array) in ports)
        )
        size = _SHARE if threads > 1 else max(states, 1)
        shares = iter(range(0, states, size))

        def work(space: Array) -> None:
            for first in shares:
                last = min(first + size, states)
                code.library.mbs_batch(table, space.ctypes.data, first, last)

        spaces = [np.empty(code.work) for _ in range(threads)]
        others = [Thread(target=work, args=(space,)) for space in spaces[1:]]
        for thread in others:
            thread.start()
        work(spaces[0])
        for thread in others:
            thread.join()

    def _interpret(self, given: Sequence[Array], results: Sequence[Array], states: int) -> None:
        """Evaluate all states by a map of the CasADi Function, and write them to `results`.

        `given` are the arrays of the inputs.
        """
        columns = []
        for x, port in zip(given, self.inputs, strict=True):
            every = x.reshape(-1, port.size) if x.size or port.size else np.zeros((1, 0))
            columns.append(np.broadcast_to(every, (states, port.size)).T)
        if states == 0:
            return
        function = self._guarded or self.function
        answers = function.map(states).call([casadi.DM(c) for c in columns])
        taken = np.all([np.isfinite(c).all(axis=0) for c in columns], axis=0)
        for valid in answers[len(results) :]:
            taken &= valid.full().ravel() == 1.0
        for answer, result in zip(answers, results, strict=False):
            rows = np.array(answer.full().T)
            if self._guarded is not None:
                rows[~taken] = np.nan
            result[...] = rows.reshape(result.shape)


def batch(functions: Function | Iterable[Function], *, checked: bool = True) -> Batch:
    """Compile Functions of the same states for many states, several states per SIMD vector.

    Sines, cosines and most elementary functions are vectorised. Functions without a vector version
    are computed by libm, one lane at a time. Values differ from interpreted values by about 1e-15
    of the largest element. The library is cached on disk. Without a C compiler, or if a
    Function does not consist of scalar operations, CasADi interprets a map; `Batch.note` gives the
    reason.

    Args:
        functions: a Function, or several, such as an inverse and a direct dynamics model. Inputs
            with the same name become a single input. Common operations are computed once.
        checked: whether the rows of models become NaN if an input is not finite (even one without
            effect) or if positions or parameters are invalid, such as positions that do not close
            the loops. Other Functions are evaluated without checks.

    Raises:
        ModelError: an argument is no Function, or the inputs do not fit together.
        CompilerError: CC names no compiler, or the compiler rejects the code.

    Returns:
        Callable from arrays of inputs to arrays of outputs.
    """
    parts: list[Any] = [functions]
    if isinstance(functions, Iterable) and not isinstance(functions, str):
        parts = list(functions)
    if not parts:
        raise ModelError("there is no Function to evaluate; give one or several")
    for part in parts:
        require_function(part)
    function, inputs, outputs = joined(parts)
    models = [part for part in parts if checked and hasattr(part, "valid")]
    valid = _valid_functions(models)
    guarded = joined([*parts, *valid])[0] if valid else function if models else None
    code, note = _code(function if guarded is None else guarded, guarded is not None, len(valid))
    ports = tuple(inputs), tuple(outputs)
    return Batch(function, *ports, _defaults(parts), note, code, tuple(parts), guarded)


def _valid_functions(models: Sequence[Any]) -> list[Function]:
    """Return the different Functions that check whether inputs of models are valid."""
    asked = (model.valid() for model in models)
    return list({hash(valid): valid for valid in asked if valid is not None}.values())


def _code(function: Function, finite: bool, valid: int) -> tuple[_Code | None, str]:
    """Return the machine code of a joined Function, and the note of `Batch`.

    None instead of the code if CasADi has to interpret it. `finite` and `valid` are options of
    `batch_source`.
    """
    if not compiler_found():
        return None, "interpreted by CasADi, for there is no C compiler"
    try:
        source = batch_source(function, finite=finite, valid=valid)
    except ModelError as error:
        return None, f"interpreted by CasADi ({error})"
    files = {**source.files, "processor.h": f"/* {processor()} */\n"}
    library = ctypes.CDLL(str(cached_library(files, FAST_FLAGS)))
    number = ctypes.c_longlong
    library.mbs_batch.argtypes = (ctypes.POINTER(CPort), ctypes.c_void_p, number, number)
    library.mbs_batch.restype = None
    lanes = library.mbs_batch_lanes()
    return _Code(library, source.work, lanes), f"machine code, {lanes} states side by side"


def _defaults(functions: Sequence[Function]) -> dict[str, Array]:
    """Return {"p": default parameters (np,)} of the first of the models that has them, else {}."""
    for function in functions:
        model = function if hasattr(function, "default_of_p") else None
        value = None if model is None else default_of_last(function, model)
        if value is not None:
            return {"p": value}
    return {}


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
