"""Contenders in one process, timed in turns by loops of C++."""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import casadi
import numpy as np

from mbs.native.compiler import cache_dir

STATES = 64
BLOCK_NS = 1.5e5
_SOURCE = Path(__file__).with_name("harness.cpp")
# What pinocchio's own build system passes to those who use its library.
_DEFINES = (
    "PINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
    "BOOST_MPL_LIMIT_LIST_SIZE=30",
    "BOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "BOOST_FUSION_INVOKE_MAX_ARITY=12",
)
ALGORITHMS = ("IDM", "A", "DDM", "dIDM", "dDDM")
Array = np.ndarray[Any, Any]


def harness() -> ctypes.CDLL:
    """The timing loops, linked to the library of the installed pinocchio; built once.

    No flag for this processor is given: the layout of its types must be that of the library, and
    nothing but loops is compiled here.
    """
    import pinocchio

    prefix = Path(pinocchio.__file__).resolve().parents[4]
    eigen = Path(casadi.__file__).parent / "include" / "eigen3"
    flags = ["-std=c++17", "-O2", "-w", "-fPIC", "-shared", *(f"-D{d}" for d in _DEFINES)]
    flags += [f"-I{prefix / 'include'}", f"-I{eigen}"]
    libraries = [f"-L{prefix / 'lib'}", "-lpinocchio_default", "-lboost_serialization"]
    libraries += [f"-Wl,-rpath,{prefix / 'lib'}"]
    text = _SOURCE.read_text() + pinocchio.__version__ + " ".join(flags + libraries)
    name = hashlib.sha256(text.encode()).hexdigest()[:20]
    target = cache_dir() / f"harness-{name}.so"
    if not target.exists():
        command = ["g++", *flags, str(_SOURCE), "-o", str(target), *libraries]
        subprocess.run(command, check=True)
    library = ctypes.CDLL(str(target))
    library.peer_open.restype = ctypes.c_void_p
    library.peer_time.restype = library.function_time.restype = ctypes.c_double
    return library


class Contender(Protocol):
    """Code that can be timed and whose values can be read."""

    def time(self, states: int, cycles: int) -> float:
        """Nanoseconds of one evaluation."""

    def value(self, state: int) -> Array:
        """Every number it computes for one state, outputs after each other in columns."""


class Peer:
    """An algorithm of pinocchio's library."""

    def __init__(
        self, library: ctypes.CDLL, model: Path, algorithm: str, inputs: Sequence[Array], size: int
    ) -> None:
        self._library = library
        self._handle = ctypes.c_void_p(library.peer_open(str(model).encode()))
        self._algorithm = ALGORITHMS.index(algorithm)
        zero = np.zeros_like(inputs[-1])
        self._inputs = [np.ascontiguousarray(x) for x in (*inputs, zero, zero)[:3]]
        self._size = size

    def time(self, states: int, cycles: int) -> float:
        """See Contender."""
        arguments = [_address(x) for x in self._inputs]
        return float(
            self._library.peer_time(self._handle, self._algorithm, *arguments, states, cycles)
        )

    def value(self, state: int) -> Array:
        """See Contender."""
        out = np.zeros(self._size)
        arguments = [_address(x[state]) for x in self._inputs]
        self._library.peer_value(self._handle, self._algorithm, *arguments, _address(out))
        return out


class InLibrary:
    """A function in CasADi's calling convention."""

    def __init__(
        self, loops: ctypes.CDLL, path: Path, function: casadi.Function, inputs: Sequence[Array]
    ) -> None:
        self._loops, code, name = loops, ctypes.CDLL(str(path)), function.name()
        work = [ctypes.c_longlong() for _ in range(4)]
        code[f"{name}_work"](*map(ctypes.byref, work))
        self._code = code[name]
        self._iw = np.zeros(work[2].value + 1, dtype=np.int64)
        self._w = np.zeros(work[3].value + 1)
        self._inputs = [np.ascontiguousarray(x) for x in inputs]
        self._outputs = [np.zeros(function.nnz_out(k)) for k in range(function.n_out())]

    def time(self, states: int, cycles: int) -> float:
        """See Contender."""
        return self._run(self._inputs, states, cycles)

    def value(self, state: int) -> Array:
        """See Contender."""
        self._run([x[state : state + 1] for x in self._inputs], 1, 1)
        return np.concatenate(self._outputs)

    def _run(self, inputs: Sequence[Array], states: int, cycles: int) -> float:
        sizes = (ctypes.c_int * len(inputs))(*(x.shape[1] for x in inputs))
        pointers = (ctypes.c_void_p * len(inputs))(*(x.ctypes.data for x in inputs))
        results = (ctypes.c_void_p * 32)(*(y.ctypes.data for y in self._outputs))
        arguments = (self._code, len(inputs), pointers, sizes, results)
        work = _address(self._iw), _address(self._w)
        return float(self._loops.function_time(*arguments, *work, states, cycles))


def best_times(contenders: Mapping[Any, Contender], blocks: int) -> dict[Any, float]:
    """Nanoseconds of one evaluation: for each contender the best of many short blocks, in turns."""
    best = {key: contender.time(STATES, 1) for key, contender in contenders.items()}
    for _ in range(blocks):
        for key, contender in contenders.items():
            cycles = max(1, round(BLOCK_NS / (STATES * best[key])))
            best[key] = min(best[key], contender.time(STATES, cycles))
    return best


def _address(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
