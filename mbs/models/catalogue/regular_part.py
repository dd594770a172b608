"""The square part of a frame's Jacobian that one asks for when no rows and columns are named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import LoopError
from mbs.loops.closing import closure_parameters
from mbs.loops.posture import solve
from mbs.models.kinematics import jacobian
from mbs.models.symbols import is_reduced
from mbs.recursions.survey import random_samples

Array = NDArray[np.float64]
Jacobian = tuple[str | int, str | int, str]
"""Frame, the frame in whose axes V and w are, and coordinates."""

ROWS = ("Vx", "Vy", "Vz", "wx", "wy", "wz")
"""Names of the rows of [V; w]."""

_POSTURES, _SEED = 3, 20260110
_STEP = 0.1
"""By how much independent joints leave the assembled posture [rad or m]."""
_DEPENDENT = 1e-7
"""Sine of the angle to the others below which a row or column depends on them."""


def regular_part(
    system: System,
    of: Jacobian,
    rows: Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Rows and as many columns that have an inverse where the posture is not singular.

    The first rows of [V; w] that are independent at random postures, then the first columns that
    are so in these rows; what is given stays. A frame that moves in a plane gets Vx, Vy and wz;
    one that a crank alone moves, the first row that it moves.

    Args:
        system: open or closed.
        of: whose Jacobian.
        rows: names of rows that are chosen already.
        columns: names of velocities that are chosen already.

    Returns:
        names of rows and of columns; not as many of either where the given ones do not allow it.

    Raises:
        ModelError: there is no such frame or coordinate.
    """
    reduced = is_reduced(system, of[2])
    speeds = system.active if reduced else range(system.nv)
    names = [system.speeds[k].name for k in speeds]
    every = _values(system, of)
    kept = [names.index(n) for n in columns if n in names] if columns else [*range(len(names))]
    chosen = tuple(rows) if rows else tuple(ROWS[k] for k in _independent(every[:, :, kept], 6))
    own = [ROWS.index(name) for name in chosen if name in ROWS]
    if columns:
        return chosen, tuple(columns)
    found = _independent(np.swapaxes(every[:, own], 1, 2), len(own))
    return chosen, tuple(names[k] for k in found)


def _values(system: System, of: Jacobian) -> Array:
    """(postures, 6, m) the Jacobian at some postures, lengths by the longest one."""

    def find() -> Array:
        frame, axes, coordinates = of
        function = jacobian(system, frame, axes, coordinates=coordinates)
        every = list[Array]()
        for state in _states(system):
            with suppress(LoopError):  # singular there; the other postures tell enough
                every.append(np.array(function(*state)))
        J = np.array(every).reshape(len(every), 6, function.size2_out(0))
        J[:, :3] /= float(np.abs(J[:, :3]).max(initial=0.0)) or 1.0
        return J

    found: Array = system.cached(("values of the jacobian", *of), find)
    return found


def _states(system: System) -> Iterator[tuple[Array, ...]]:
    """Positions, and parameters where there are some, as the inputs of a Function."""
    if not system.is_closed:
        for q, p in random_samples(system.tree, len(system.parameters)):
            yield (q, p) if system.parameters else (q,)
        return
    p = closure_parameters(system, None)
    for q in _closed_postures(system):
        yield (q, p) if system.parameters else (q,)


def _closed_postures(system: System) -> Iterator[Array]:
    """The assembled posture, and others near it as far as the loops close there."""
    yield np.array(system.posture)
    rng = np.random.default_rng(_SEED)
    names = [system.speeds[k].name for k in system.free]
    places = {c.name: x for c, x in zip(system.coordinates, system.posture, strict=True)}
    own = [name for name in names if name in places]
    for _ in range(_POSTURES):
        moved = {name: places[name] + rng.uniform(-_STEP, _STEP) for name in own}
        with suppress(LoopError):  # it does not reach so far
            yield solve(system, moved)


def _independent(matrices: Array, most: int) -> list[int]:
    """Numbers of the first rows of (samples, rows, columns) that are independent somewhere."""
    kept = list[int]()
    for row in range(matrices.shape[1]):
        trial = [*kept, row]
        if len(kept) < most and any(_is_regular(M[trial]) for M in matrices):
            kept = trial
    return kept


def _is_regular(rows: Array) -> bool:
    sizes = np.linalg.norm(rows, axis=1)
    if np.any(sizes < _DEPENDENT):
        return False
    sines = np.linalg.svd(rows / sizes[:, None], compute_uv=False)
    return len(sines) == len(rows) and bool(sines[-1] > _DEPENDENT)
