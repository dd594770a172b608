"""What the compiled general method knows of an arm, and its calls."""

from __future__ import annotations

import ctypes
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.arm import Arm, Array
from mbs.models.inverse_geometry.numeric.core import Handed
from mbs.models.inverse_geometry.raghavan_roth import Prepared

Numbers: TypeAlias = NDArray[np.int64]

_ROOM = 4096  # postures of one call
_CANDIDATES = 144  # ROTH_POSTURES: those of one pose, at most

_int, _double = ctypes.c_int, ctypes.c_double


class _LoopStruct(ctypes.Structure):
    _fields_ = (
        ("order", _int * 6),
        ("sign", _int),
        ("slides", _int * 6),
        ("offsets", _double * 6),
        ("ways", _double * 96),
        ("place", _int),
        ("after", _double * 16),
        ("length", _double),
        ("count", _int),
        ("elements", _int * 15),
        ("powers", _int * 5),
        ("raised", _int),
        ("rank", _int),
        ("size", _int),
        ("mix", ctypes.c_void_p),
    )


class HandedLoop:
    """A prepared arm as C sees it; keeps the arrays alive that it points to."""

    def __init__(self, arm: Arm, prepared: Prepared) -> None:
        loop, pencil = prepared.arrangement, prepared.pencil
        elimination = pencil.elimination
        self.arm = Handed(arm)
        self.mix = np.ascontiguousarray(pencil.mix, dtype=float)
        square = self.mix.shape[0] == self.mix.shape[1]
        parts = ("first", "second", "third", "fourth", "fifth")
        elements = [*elimination.elements.tolist(), *[0] * 15][:15]
        self.loop = _LoopStruct(
            (_int * 6)(*loop.order.tolist()),
            loop.sign,
            (_int * 6)(*map(int, loop.prismatic)),
            (_double * 6)(*loop.offsets.tolist()),
            (_double * 96)(*loop.ways.ravel().tolist()),
            loop.place,
            (_double * 16)(*loop.after.ravel().tolist()),
            loop.length,
            len(elimination.elements),
            (_int * 15)(*elements),
            (_int * 5)(*(len(getattr(elimination, part)) for part in parts)),
            elimination.raised,
            pencil.rank,
            elimination.size,
            None if square else self.mix.ctypes.data,
        )
        self.address = ctypes.addressof(self.loop)


def solved_by(library: ctypes.CDLL, handed: HandedLoop, T: Array) -> tuple[Numbers, Array]:
    """The solutions for poses T, (N, 4, 4).

    Returns:
        (m,) numbers of the poses, ascending, and (m, 6) postures for them.
    """
    wanted = np.ascontiguousarray(T, dtype=float)
    room = min(_ROOM, _CANDIDATES * len(wanted))
    q, start, done = np.empty((room, 6)), 0, ctypes.c_longlong(0)
    number, hits = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    found = list[tuple[Numbers, Array]]()
    while start < len(wanted) or not found:
        count = library.mbs_general(
            handed.arm.address,
            handed.address,
            wanted[start:].ctypes.data,
            len(wanted) - start,
            room,
            q.ctypes.data,
            number.ctypes.data,
            hits.ctypes.data,
            ctypes.addressof(done),
        )
        found.append((number[:count] + start, q[:count].copy()))
        start += done.value
    if len(found) == 1:
        return found[0]
    numbers, postures = zip(*found, strict=True)
    return np.concatenate(numbers), np.concatenate(postures)
