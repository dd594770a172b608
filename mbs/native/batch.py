"""Functions evaluated on many states at once: arrays in, arrays out, several cores."""

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
from mbs.native.array_calls import default_of_last
from mbs.native.batch_source import batch_source
from mbs.native.compiled import require_function
from mbs.native.compiler import cached_library, compiler_found
from mbs.native.kernel import FAST_FLAGS, processor
from mbs.numbers import doubles
from mbs.text import quoted

# Arrays of many states: shapes, where their elements are, and messages about what does not fit.


Array: TypeAlias = np.ndarray[Any, Any]

_DOUBLE = 8  # bytes
_MOST_PAST = 500  # elements of a row whose lanes fit on any stack
_LINE = 64  # bytes of a cache line
_SEARCH = 1000  # steps that looking for common memory may take


class CPort(ctypes.Structure):
    """An array as `mbs_port` in rows.h."""

    _fields_ = (
        ("at", ctypes.c_void_p),
        *((name, ctypes.c_longlong) for name in ("row", "column", "stream")),
    )


@dataclass(frozen=True, slots=True)
class ArrayPort:
    """An input or output of one state: its name and shape, of one or two lengths."""

    name: str
    shape: tuple[int, ...]

    def __str__(self) -> str:
        """As in a heading, `q[6]`."""
        return f"{self.name}[{'x'.join(map(str, self.shape))}]"

    @property
    def size(self) -> int:
        """Elements of one state."""
        return math.prod(self.shape)

    def is_many(self, array: Array) -> bool:
        """Whether an array that fits has a row for each state."""
        return array.ndim > len(self.shape)

    def taken(self, value: Any, owner: str) -> Array:
        """The doubles of an input; only arrays of doubles, evenly spaced, are not copied.

        Args:
            value: anything.
            owner: who takes it, to begin a message.

        Raises:
            ModelError: it holds no numbers, or not of this shape, or of many; says what to give.
        """
        array = doubles(value)
        fault = array if isinstance(array, str) else self._fault(array)
        if isinstance(array, str) or fault:
            raise ModelError(f"{owner}: input {self.name} {fault}")
        return array if self._steps(array) else np.array(array, order="C")

    def require_out(self, array: Any, owner: str) -> None:
        """Refuse what cannot take this output, of one state or of many, as it is.

        Args:
            array: anything.
            owner: who fills it, to begin a message.

        Raises:
            ModelError: says what to give.
        """
        fault = ""
        if not isinstance(array, np.ndarray) or array.dtype != np.float64:
            kind = f"an array of {array.dtype}" if isinstance(array, np.ndarray) else quoted(array)
            fault = f"is {kind}; give a numpy array of float64"
        elif isinstance(array, np.ma.MaskedArray):
            fault = "has a mask, which would be passed over; give an array without"
        elif not (fault := self._fault(array)) and self._steps(array) is None:
            fault = "has elements that are not evenly spaced in memory, in steps of 8 bytes"
        if fault:
            raise ModelError(f"{owner}: out for {self.name} {fault}")

    def _fault(self, array: Array) -> str:
        """What is wrong with the shape of an array and what to give; empty where it fits."""
        lengths = len(self.shape)
        if array.shape[-lengths:] == self.shape and array.ndim <= lengths + 1:
            return ""
        many = f"(N, {', '.join(map(str, self.shape))})"
        return (
            f"has the shape {array.shape}; give {many}, or {self.shape} that is the same for"
            " all states"
        )

    def c_port(self, array: Array, past_caches: bool) -> CPort:
        """Where C finds the array.

        Args:
            array: one that fits.
            past_caches: store it past the caches if that is possible.
        """
        row, column = self._steps(array) or (0, 0)
        address = array.ctypes.data
        if past_caches:
            lines = (row == self.size and column == 1) or (row == 1 and column % _DOUBLE == 0)
            past_caches = lines and self.size <= _MOST_PAST and address % _LINE == 0
        return CPort(address, row, column, past_caches)

    def empty(self, states: int | None) -> Array:
        """A new array whose rows follow each other; of one state alone when `states` is None."""
        shape = self.shape if states is None else (states, *self.shape)
        count = math.prod(shape)
        memory = np.empty(count + _LINE // _DOUBLE)
        first = -memory.ctypes.data % _LINE // _DOUBLE
        return memory[first : first + count].reshape(shape)

    def _steps(self, array: Array) -> tuple[int, int] | None:
        """Doubles from state to state and from element to element; None when they vary."""
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
    """Whether two arrays have each element in the same place."""
    first, second = ((x.ctypes.data, x.shape, x.strides) for x in (one, other))
    return first == second


def overlap(one: Array, other: Array) -> bool:
    """Whether two arrays have some element in one place, as far as that is found out soon."""
    try:
        return np.shares_memory(one, other, max_work=_SEARCH)  # type: ignore[arg-type]
    except np.exceptions.TooHardError:
        return False


def spread(array: Array) -> bool:
    """Whether every element has a place of its own, of an array whose strides do not interlace."""
    return all(step or length < 2 for length, step in zip(array.shape, array.strides, strict=True))


# Several Functions of the same inputs as one, its inputs and outputs dense columns.


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


_SHARE = 8192
"""States that a thread takes at a time; a multiple of the lanes of every processor."""

_PAST_CACHES = 4_000_000  # bytes of outputs from which they are stored past the caches


class _Code(NamedTuple):
    """A library, the doubles of work space it needs, and the states it computes at once."""

    library: ctypes.CDLL
    work: int
    lanes: int


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Functions of the same states as one call on arrays; made by `batch`.

    Attributes:
        function: all of them in one, its inputs and outputs dense columns (matrices row by row).
        inputs: names and shapes of one state.
        outputs: the same, Function after Function.
        defaults: of inputs that may be left out, their values.
        note: what kind of code answers.
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
        """A pickle holds the Functions, which are compiled where it is read."""
        return functools.partial(batch, checked=self._guarded is not None), (self._functions,)

    @property
    def lanes(self) -> int:
        """States computed side by side by one core; 0 when CasADi interprets the Functions."""
        return self._code.lanes if self._code else 0

    def __repr__(self) -> str:
        """What goes in and out, and what computes it."""
        ins, outs = (", ".join(map(str, ports)) for ports in (self.inputs, self.outputs))
        return f"Batch({ins}) -> ({outs}): {self.note}"

    def __call__(
        self, *args: Array, out: Any = None, threads: int | None = None, **named: Array
    ) -> Any:
        """Evaluate every state.

        An input of n elements is an array (N, n) of N states, of r x c elements (N, r, c); one
        that is the same for all states is (n,) or (r, c). Rows may follow each other in memory
        (order "C"), or states (order "F"), or be parts of a larger array: such arrays are not
        copied. Rows are states, while a model called on arrays takes columns, as CasADi does.
        States do not depend on each other: neither N nor `threads` changes a bit of a result.

        Args:
            *args: the inputs in their order: arrays, or nested lists, of real numbers. Arrays of
                doubles that are evenly spaced are not copied.
            out: arrays that take the outputs, one or a tuple; an output may take the place of an
                input of its shape.
            threads: how many work at once; as many as this process may use when left out.
            **named: inputs by name.

        Returns:
            an array (N, n) or (N, r, c) for each output, a tuple of them for several, or `out`;
            of one state, (n,) or (r, c), when all inputs are.

        Raises:
            ModelError: an array does not fit; says which, and how it should be.
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
        return self.function.name()

    def ordered(self, args: Sequence[Any], named: Mapping[str, Any]) -> list[Any]:
        """Every input in its order, what is left out by its default.

        Args:
            args: inputs in their order.
            named: inputs by name.

        Raises:
            ModelError: one is missing, or is not taken.
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
        """How many there are; None when every input is of one."""
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
        """The arrays of the outputs, new ones or those given."""
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
        """Refuse outputs that would write over inputs that are still to be read."""
        for port, result in zip(self.outputs, results, strict=True):
            others = [array for array in results if array is not result]
            inputs = [array for array in given if not same_place(array, result)]
            if any(overlap(array, result) for array in (*inputs, *others)):
                raise ModelError(
                    f"{self._name}: out for {port.name} shares memory with another array; give an"
                    " array of its own, or an input itself"
                )

    def _threads(self, asked: int | None, states: int) -> int:
        if asked is None:
            asked = cores()
        elif isinstance(asked, bool) or not hasattr(asked, "__index__") or asked < 1:
            raise ModelError(f"{self._name}: threads is {quoted(asked)}; give 1 or more, or None")
        return max(1, min(operator.index(asked), -(-states // _SHARE)))

    def _run(self, code: _Code, arrays: Sequence[Array], states: int, threads: int) -> None:
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
        """The map of CasADi."""
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
    """Functions of the same states as machine code for many of them: several in vector lanes.

    Sines, cosines and most elementary functions are computed in lanes too; what lanes do not know
    goes through libm, lane by lane. Values differ from those of the interpreter by about 1e-15 of
    the largest element. The library is kept in the cache. Without a compiler, or for what is not
    made of scalar operations, CasADi interprets a map; `Batch.note` says so.

    Args:
        functions: one or several, such as an inverse and a direct dynamics model: inputs of one
            name are one input, and operations that they have in common are done once.
        checked: of models, rows come out as NaN where an input is not a finite number, also one
            that has no effect, and where positions or parameters have no sense, such as positions
            that leave loops open; otherwise, as of any other Function, they are computed as they
            are.

    Raises:
        ModelError: one is no Function, or their inputs do not fit together.
        CompilerError: CC names no compiler, or the compiler refused the code.
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
    """What determines whether models take a state, each once."""
    asked = (model.valid() for model in models)
    return list({hash(valid): valid for valid in asked if valid is not None}.values())


def _code(function: Function, finite: bool, valid: int) -> tuple[_Code | None, str]:
    """The machine code, None where there can be none, and what to say about it."""
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
    """Values of the parameters of models, when they may be left out."""
    for function in functions:
        model = function if hasattr(function, "default_of_p") else None
        value = None if model is None else default_of_last(function, model)
        if value is not None:
            return {"p": value}
    return {}


def cores() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
