"""Pickles of what holds SX: graphs travel as one Function, all else as it is."""

from __future__ import annotations

import io
import pickle
from typing import Any

import casadi
from casadi import SX, Function


def packed(state: Any) -> tuple[bytes, list[str], str]:
    """Any object made of plain data, Functions and SX: its bytes, names of symbols, and graphs.

    Args:
        state: whatever `pickle` takes, SX among it.
    """
    buffer = io.BytesIO()
    pickler = _Pickler(buffer)
    pickler.dump(state)
    graphs = pickler.graphs
    # one symbol at least: without any, numbers would come back as DM
    symbols = casadi.symvar(casadi.veccat(SX.sym("any"), *graphs))
    names = [symbol.name() for symbol in symbols]
    return buffer.getvalue(), names, Function("graphs", symbols, graphs).serialize()


def unpacked(data: bytes, names: list[str], graphs: str) -> Any:
    """What was packed, all that `packed` gave; symbols have their names and are new."""
    found = Function.deserialize(graphs).call([SX.sym(name) for name in names])
    return _Unpickler(io.BytesIO(data), found).load()


class _Pickler(pickle.Pickler):
    def __init__(self, buffer: io.BytesIO) -> None:
        super().__init__(buffer, protocol=pickle.HIGHEST_PROTOCOL)
        self.graphs: list[SX] = []

    def persistent_id(self, obj: Any) -> int | None:
        if not isinstance(obj, SX):
            return None
        self.graphs.append(obj)
        return len(self.graphs) - 1


class _Unpickler(pickle.Unpickler):
    def __init__(self, buffer: io.BytesIO, graphs: list[SX]) -> None:
        super().__init__(buffer)
        self._graphs = graphs

    def persistent_load(self, pid: Any) -> Any:
        return self._graphs[pid]
