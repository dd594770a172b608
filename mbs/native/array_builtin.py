"""A builtin that calls a compiled function on numpy arrays, without copies and conversions."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from casadi import Function, Sparsity

from mbs.errors import CompilerError
from mbs.native.cache import cached_library

ArrayCall: TypeAlias = Callable[..., Any]
"""Takes arrays, gives arrays; None for what it does not take as it is."""

_MOST = 32
_STABLE_INTERFACE = (
    "PyObject_GetBuffer",
    "PyBuffer_Release",
    "PyErr_Clear",
    "Py_IncRef",
    "Py_DecRef",
    "PyObject_CallObject",
    "PyTuple_New",
    "PyTuple_SetItem",
    "PyCapsule_New",
    "PyCapsule_GetPointer",
    "PyCFunction_NewEx",
)
_Pointer = ctypes.c_void_p


class _Shape(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_longlong) for name in ("rows", "columns", "stored")),
        ("places", _Pointer),
    )


class _PythonInterface(ctypes.Structure):
    _fields_ = (("none", _Pointer), *((name, _Pointer) for name in _STABLE_INTERFACE))


class _Function(ctypes.Structure):
    _fields_ = (
        *((name, _Pointer) for name in ("evaluate", "checkout", "release", "empty")),
        ("new", _Pointer * _MOST),
        *((name, ctypes.c_longlong) for name in ("inputs", "outputs", "finite")),
        *((name, ctypes.c_longlong) for name in ("integers", "reals")),
        ("inputs_of", _Shape * _MOST),
        ("outputs_of", _Shape * _MOST),
    )


def array_builtin(function: Function, library: Path, finite: bool) -> ArrayCall | None:
    """The builtin of a function in a library, in CasADi's calling convention.

    Its inputs are arrays of doubles whose columns follow each other in memory; its outputs are new
    arrays, or those that follow the inputs. It answers None for anything else.

    Args:
        function: the same function for CasADi.
        library: holds it.
        finite: answer None too where an input or a result is not a finite number.

    Returns:
        the builtin; None when the function has sparse inputs, or dozens of them.
    """
    name, code = function.name(), ctypes.CDLL(str(library))
    work = [ctypes.c_longlong() for _ in range(4)]
    code[f"{name}_work"](*map(ctypes.byref, work))
    pointers, results, integers, reals = (number.value for number in work)
    inputs = [function.sparsity_in(k) for k in range(function.n_in())]
    outputs = [function.sparsity_out(k) for k in range(function.n_out())]
    caller = _caller()
    dense = all(pattern.is_dense() for pattern in inputs)
    if caller is None or not dense or max(pointers, results) > _MOST:
        return None
    if hasattr(code, f"{name}_incref"):
        code[f"{name}_incref"]()
    places = [None if pattern.is_dense() else _places(pattern) for pattern in outputs]
    stored = sum(rows.size for rows in places if rows is not None)
    new = [_arguments_of_empty(pattern) for pattern in outputs]
    description = _Function(
        *(_address(code, f"{name}{end}") for end in ("", "_checkout", "_release")),
        id(np.empty),
        (_Pointer * _MOST)(*map(id, new)),
        *(len(inputs), len(outputs), finite, integers, reals + stored),
        (_Shape * _MOST)(*(_shape(pattern, None) for pattern in inputs)),
        (_Shape * _MOST)(*map(_shape, outputs, places)),
    )
    builtin: ArrayCall = caller(ctypes.byref(description))
    return builtin


def _places(pattern: Sparsity) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Where the stored elements of a sparse matrix stand in the dense one, column after column."""
    return np.array(pattern.find(), dtype=np.int64)


def _shape(pattern: Sparsity, places: Any) -> _Shape:
    rows, columns = pattern.shape
    return _Shape(rows, columns, pattern.nnz(), None if places is None else places.ctypes.data)


def _arguments_of_empty(pattern: Sparsity) -> tuple[Any, ...]:
    """What numpy.empty is given: one column is a vector, all else a matrix."""
    rows, columns = pattern.shape
    return ((rows,) if columns == 1 else (rows, columns)), np.float64, "F"


def _address(code: ctypes.CDLL, name: str) -> int | None:
    return ctypes.cast(code[name], _Pointer).value if hasattr(code, name) else None


@functools.cache
def _caller() -> Callable[[Any], ArrayCall] | None:
    """What makes builtins; None where it cannot be built."""
    source = resources.files("mbs.native").joinpath("runtime/python_call.c").read_text("utf-8")
    try:
        library = ctypes.PyDLL(str(cached_library({"python_call.c": source})))
    except (CompilerError, OSError):
        return None
    addresses = (
        ctypes.cast(getattr(ctypes.pythonapi, name), _Pointer).value for name in _STABLE_INTERFACE
    )
    library.mbs_setup(ctypes.byref(_PythonInterface(id(None), *addresses)))
    make = library.mbs_builtin
    make.restype = ctypes.py_object
    return make
