"""Pickles of objects that contain SX: all SX are stored as one serialized Function."""

from __future__ import annotations

import io
import pickle
import sys
from collections.abc import Sequence
from types import FunctionType
from typing import Any

import casadi
from casadi import SX, Function

Packed = tuple[bytes, tuple[str, ...], str]
"""Bytes, names of symbols, and graphs."""


def packed(state: Any) -> Packed:
    """Return a pickle of an object that contains plain data, Functions and SX.

    Args:
        state: object to pickle. It may contain any number of SX.

    Returns:
        bytes of the pickle, names of the symbols, and one serialized Function with all SX.
    """
    return _pack(state)[0]


def unpacked(data: bytes, names: Sequence[str], graphs: str) -> Any:
    """Return the object of a pickle made by `packed`.

    Args:
        data: bytes of the pickle.
        names: names of the symbols. The symbols of the result are new and have these names.
        graphs: serialized Function with all SX of the object.
    """
    found = Function.deserialize(graphs).call([SX.sym(name) for name in names])
    return _Unpickler(io.BytesIO(data), found).load()


def content_of(state: Any) -> Packed | None:
    """Return a pickle that identifies the content of an object in all processes.

    The result is None if the object contains a class or a function of a user: a pickle contains
    only its name, and its code may change. The result is also None if there is no pickle.

    Args:
        state: object that may contain any number of SX.
    """
    try:
        found, names_alone = _pack(state)
        return None if names_alone else found
    except (AttributeError, NotImplementedError, RuntimeError, TypeError, pickle.PicklingError):
        return None


def _pack(state: Any) -> tuple[Packed, bool]:
    """Return the pickle of an object, and whether it refers to code of a user by name."""
    buffer = io.BytesIO()
    pickler = _Pickler(buffer)
    pickler.dump(state)
    graphs = pickler.graphs
    # one symbol at least: without any, numbers would come back as DM
    symbols = casadi.symvar(casadi.veccat(SX.sym("any"), *graphs))
    names = tuple(symbol.name() for symbol in symbols)
    text = Function("graphs", symbols, graphs).serialize()
    return (buffer.getvalue(), names, text), pickler.names_alone


_KNOWN = frozenset({"mbs", "casadi", "numpy", *sys.stdlib_module_names})
"""Packages whose classes are the same for the same version of the package."""


class _Pickler(pickle.Pickler):
    """Pickler that stores all SX in `graphs` and notes code of users in `names_alone`."""

    def __init__(self, buffer: io.BytesIO) -> None:
        """Open a pickle that is written to `buffer`."""
        super().__init__(buffer, protocol=pickle.HIGHEST_PROTOCOL)
        self.graphs: list[SX] = []
        self.names_alone = False

    def persistent_id(self, obj: Any) -> int | None:
        """Return the index of an SX in `graphs`, to which it is added; None for other objects."""
        if not isinstance(obj, SX):
            return None
        self.graphs.append(obj)
        return len(self.graphs) - 1

    def reducer_override(self, obj: Any) -> Any:
        """Set `names_alone` if `obj` is code of a user; return NotImplemented (default pickle)."""
        if isinstance(obj, (type, FunctionType)) and obj.__module__.split(".")[0] not in _KNOWN:
            self.names_alone = True
        if isinstance(obj, Function):  # a Callback of a user is in it by its name
            parts = (obj, *obj.find_functions())
            self.names_alone |= any(part.class_name() == "CallbackInternal" for part in parts)
        return NotImplemented


class _Unpickler(pickle.Unpickler):
    """Unpickler of a pickle by `_Pickler`, with its SX in `graphs`."""

    def __init__(self, buffer: io.BytesIO, graphs: list[SX]) -> None:
        """Open the pickle in `buffer`, whose SX are `graphs`."""
        super().__init__(buffer)
        self._graphs = graphs

    def persistent_load(self, pid: Any) -> Any:
        """Return the SX with index `pid` in `graphs`."""
        return self._graphs[pid]
