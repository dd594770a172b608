"""What the loops of a system leave free: mobility, independent rows, independent joints.

Ranks are taken at several assembled postures, never at one, since a loop may pass through a
posture where rows that are independent elsewhere coincide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import Closure, LoopRow, System
from mbs.errors import AssemblyError, Unclosable
from mbs.loops.closing import Closing, closure_parameters
from mbs.loops.closure import closure_rows, labelled_rows
from mbs.loops.posture import closed_posture
from mbs.loops.velocity import velocity_rows
from mbs.solvers.rank import independent_rows, rank

Matrix = NDArray[np.float64]

_POSTURES = 5
_TRIES = 25
_SEED = 20260102
_REACH = 0.5
_GAP = 1e-5
"""Singular values below this part of the largest count as zero: Gauss-Newton ends about the
square root of its tolerance away from a singular posture, where they are not smaller."""


def analysed(system: System, guess: Mapping[str, float]) -> System:
    """The system with its loops closed at a posture, and what they constrain.

    Args:
        system: with open loops.
        guess: approximate positions by coordinate name; where the posture next to them is
            singular, a regular one nearby is taken.

    Raises:
        Unclosable: no posture closes the loops.
        AssemblyError: the motors do not fit the mobility.
    """
    p = closure_parameters(system)
    posture = _assembled(system, guess, p)
    postures = [posture, *_others(system, posture, p)]
    J = _jacobian(system)
    jacobians = [np.array(J(q, p)) for q in postures]
    ranks = _ranks(jacobians)
    generic = max(ranks)
    posture = postures[ranks.index(generic)]
    regular = [m for m, found in zip(jacobians, ranks, strict=True) if found == generic]
    rows = independent_rows(regular, generic)
    active = _independent_velocities(system, regular, system.nv - generic)
    labels = _labels(system)
    count = sum(len(names) for names in labels)
    closure = Closure(
        rows=tuple(rows),
        active=tuple(active),
        passive=tuple(k for k in range(system.nv) if k not in active),
        gruebler=system.nv - count,
        residual=float(np.max(np.abs(Closing(system, p).rows(posture)[0]))),
    )
    return replace(
        system,
        posture=tuple(float(x) for x in posture),
        closure=closure,
        loops=_with_rows(system.loops, labels, set(rows)),
        _cache={},
    )


def _assembled(system: System, guess: Mapping[str, float], p: Matrix) -> Matrix:
    """A closed posture near the guess: first with the motors held, then with everything free."""
    known = {name: value for name, value in guess.items() if name in _names(system)}
    start = np.array(system.position(known))
    motors = tuple(k for k, c in enumerate(system.coordinates) if c.actuated)
    try:
        return closed_posture(Closing(system, p, motors), start, restarts=10)
    except Unclosable:
        return closed_posture(Closing(system, p), start)


def _names(system: System) -> list[str]:
    return [coordinate.name for coordinate in system.coordinates]


def _others(system: System, posture: Matrix, p: Matrix) -> list[Matrix]:
    """Further closed postures around the assembled one."""
    rng = np.random.default_rng(_SEED)
    found: list[Matrix] = []
    for _ in range(_TRIES):
        start = posture + rng.uniform(-_REACH, _REACH, posture.shape)
        closed = Closing(system, p).nearest(start)
        if closed.is_closed:
            found.append(closed.q)
        if len(found) == _POSTURES:
            break
    return found


def _ranks(jacobians: Sequence[Matrix]) -> list[int]:
    """Rank of each, small values measured by the largest of all: a whole Jacobian may vanish."""
    values = [np.linalg.svd(matrix, compute_uv=False) for matrix in jacobians]
    largest = max(float(np.max(row, initial=0.0)) for row in values)
    return [int(np.sum(row > _GAP * largest)) for row in values]


def _independent_velocities(
    system: System, jacobians: Sequence[Matrix], mobility: int
) -> list[int]:
    """The motors first, then the velocities that see the remaining mobility best."""
    if mobility == 0:
        raise AssemblyError(
            f"{system.name}: the loops leave no motion (mobility 0); take a joint's constraint away"
        )
    motors = [k for k, speed in enumerate(system.speeds) if speed.actuated]
    names = ", ".join(system.speeds[k].name for k in motors)
    if len(motors) > mobility:
        raise AssemblyError(
            f"{system.name}: {len(motors)} velocities are actuated ({names}) but the mobility is"
            f" {mobility}; actuate {mobility} at most"
        )
    free = [_null_space(J, mobility) for J in jacobians]
    if motors and max(rank(N[motors], _GAP) for N in free) < len(motors):
        raise AssemblyError(
            f"{system.name}: the actuated velocities {names} depend on each other through the"
            " loops; actuate joints that can move independently"
        )
    return independent_rows(free, mobility, tuple(motors))


def _null_space(J: Matrix, mobility: int) -> Matrix:
    return np.array(np.linalg.svd(J)[2][-mobility:].T)


def _labels(system: System) -> list[list[str]]:
    q = SX.sym("q", system.nq)
    return [[label for label, _ in rows] for _, rows in labelled_rows(system, q)]


def _with_rows(
    loops: Sequence[LoopRow], labels: Sequence[Sequence[str]], kept: set[int]
) -> tuple[LoopRow, ...]:
    result, number = [], 0
    for loop, names in zip(loops, labels, strict=True):
        dropped = tuple(n for k, n in enumerate(names, start=number) if k not in kept)
        result.append(replace(loop, rows=tuple(names), dropped=dropped))
        number += len(names)
    return tuple(result)


def _jacobian(system: System) -> Function:
    """`J(q, p)`, every row."""
    q = SX.sym("q", system.nq)
    return Function("J", [q, system.p], [velocity_rows(system, q, closure_rows(system, q))])
