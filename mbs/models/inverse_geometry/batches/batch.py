"""The closed form of a chain at many poses: in machine code, several poses in vector lanes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.loops.sequence import Sequence
from mbs.models.inverse_geometry.arm import Array
from mbs.models.inverse_geometry.chain import Chain
from mbs.models.inverse_geometry.equations.all_branches import all_branches
from mbs.native import compiled

_COLUMNS = 32
"""Poses in one call: more make the code longer, fewer the calls felt."""
_MANY = 1000
"""Poses from which machine code is worth the second that a compiler takes."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseBatch:
    """What `all_branches` gives for N poses.

    Attributes:
        q: (N, branches, n) positions of the chain's joints [rad or m].
        residual, real, regular, mark: (N, branches).
    """

    q: Array
    residual: Array
    real: Array
    regular: Array
    mark: Array


def batch(chain: Chain, sequence: Sequence, p: NDArray[np.float64], T: Array) -> PoseBatch:
    """All branches at poses T, (N, 4, 4).

    Args:
        chain: what is solved for.
        sequence: its steps, for the same p.
        p: (np,) the parameters.
        T: the poses [m].
    """
    plain = _plain(chain, sequence, p)
    if len(T) < _MANY:
        return _interpreted(plain, T)
    key = ("machine code of igm_all", sequence, *chain.key, p.tobytes())
    return _by_machine(chain.system.cached(key, lambda: _machine_code(plain)), plain, T)


def _plain(chain: Chain, sequence: Sequence, p: NDArray[np.float64]) -> Function:
    key = ("igm_all", sequence, *chain.key, p.tobytes())
    plain: Function = chain.system.cached(key, lambda: all_branches(chain, sequence, p))
    return plain


def _machine_code(plain: Function) -> Function:
    return compiled(plain.map(_COLUMNS), derivatives=0, fast=True)


def _interpreted(plain: Function, T: Array) -> PoseBatch:
    """By the interpreter, which needs no compiler first."""
    if not len(T):
        return _by_machine(plain, plain, T)
    columns = np.swapaxes(T, 1, 2).reshape(-1, 4).T
    n, branches = plain.size_out(0)
    q, *rows = (np.array(part) for part in plain.map(len(T))(columns))
    return PoseBatch(q.T.reshape(-1, branches, n), *(row.T for row in rows))


def _by_machine(call: Any, plain: Function, T: Array) -> PoseBatch:
    """By machine code for so many columns at a time, straight into the arrays."""
    n, branches = plain.size_out(0)
    count = len(T)
    padded = -(-count // _COLUMNS) * _COLUMNS
    columns = np.empty((padded, 4, 4))
    columns[:count], columns[count:] = np.swapaxes(T, 1, 2), np.eye(4)
    q = np.empty((padded, branches, n))
    rows = [np.empty((padded, branches)) for _ in range(4)]
    for first in range(0, padded, _COLUMNS):
        part = slice(first, first + _COLUMNS)
        out = (q[part].reshape(-1, n).T, *(row[part].T for row in rows))
        call(columns[part].reshape(-1, 4).T, out=out)
    return PoseBatch(q[:count], *(row[:count] for row in rows))
