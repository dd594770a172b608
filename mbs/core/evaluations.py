"""Functions of a model in the form in which the run-time library evaluates them."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.core.library import core_library

Arrays = tuple[NDArray[np.float64], ...]
_MOST = 4096
"""Number of functions whose addresses and sizes are kept: more than a process usually compiles."""


@lru_cache(maxsize=_MOST)
def code_address(library: ctypes.CDLL, name: str) -> int:
    """Return the address of a function in a library; 0 if the library has no function of this name.

    Args:
        library: library loaded by ctypes.
        name: name of the C function.
    """
    found = ctypes.cast(library[name], ctypes.c_void_p).value if hasattr(library, name) else None
    return found or 0


@lru_cache(maxsize=_MOST)
def work_sizes(library: ctypes.CDLL, name: str) -> tuple[int, ...]:
    """Return the lengths of arg, res, iw and w that a function needs, by CasADi's convention.

    Args:
        library: library loaded by ctypes.
        name: name of the C function, to which "_work" is appended.
    """
    sizes = [ctypes.c_longlong() for _ in range(4)]
    library[f"{name}_work"](*map(ctypes.byref, sizes))
    return tuple(size.value for size in sizes)


def compiled_evaluation(function: Function, library: ctypes.CDLL) -> Callable[[], Any]:
    """Return a callable that makes objects by which algorithms in C evaluate machine code.

    Each object has scratch memory of its own, and serves one algorithm at a time.

    Args:
        function: CasADi Function, for names and numbers of inputs and outputs.
        library: its code, in the calling convention of CasADi.
    """
    name = function.name()
    ports = function.n_in(), function.n_out()
    address = code_address(library, name)
    return partial(core_library().compiled, address, ports, work_sizes(library, name))


def interpreted_evaluation(function: Function, examine: Callable[[BaseException], None]) -> Any:
    """Return an object with which algorithms of the run-time library evaluate a CasADi Function.

    Args:
        function: Function that CasADi interprets. C passes the nonzeros of its inputs and outputs.
        examine: callable that receives the Python error of an evaluation. It returns if this error
            means that there is no value for these inputs, and raises an error if the algorithm must
            end.
    """
    bound: Any = function.buffer()
    buffer, call = bound
    inputs = tuple(np.zeros(function.nnz_in(k)) for k in range(function.n_in()))
    outputs = tuple(np.zeros(function.nnz_out(k)) for k in range(function.n_out()))
    for bind, arrays in ((buffer.set_arg, inputs), (buffer.set_res, outputs)):
        for number, array in enumerate(arrays):
            if array.size:  # a buffer of no numbers cannot be bound
                bind(number, array.data)
    return core_library().interpreted(call, examine, buffer, inputs, outputs)


def python_evaluation(call: Callable[[], None], inputs: Arrays, outputs: Arrays) -> Any:
    """Return an object with which algorithms of the run-time library call Python.

    Errors of the call end the algorithm.

    Args:
        call: callable that reads the inputs and writes the outputs.
        inputs: arrays for the inputs; the algorithm writes to them in place.
        outputs: arrays for the outputs; the algorithm reads them in place.
    """
    return core_library().interpreted(call, reraise, None, inputs, outputs)


def reraise(error: BaseException) -> None:
    """Raise an error again, so that every error ends the algorithm.

    Args:
        error: error of an evaluation.
    """
    raise error
