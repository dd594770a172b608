"""Postures for wanted poses by the general method."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from mbs.errors import NoClosedForm
from mbs.models.inverse_geometry.raghavan_roth.elimination import at
from mbs.models.inverse_geometry.raghavan_roth.middle import middle_joints
from mbs.models.inverse_geometry.raghavan_roth.pairs import Array
from mbs.models.inverse_geometry.raghavan_roth.prepare import Prepared
from mbs.models.inverse_geometry.raghavan_roth.rest import completed
from mbs.models.inverse_geometry.raghavan_roth.roots import clusters, roots

Numbers = NDArray[np.int64]

_FAR = 1e3  # slides, in reaches of the arm, that are taken for infinite


def candidates(prepared: Prepared, T: Array) -> Array:
    """(m, 6) postures that may reach a wanted pose; polish and check them.

    Among them is every isolated posture that does, near double ones too, some of them twice; others
    do not reach the pose at all.

    Args:
        prepared: see `prepare`.
        T: (4, 4) wanted pose [m].

    Raises:
        NoClosedForm: the method does not hold for the arm, see `Prepared.regular`.
    """
    return candidates_many(prepared, np.asarray(T, dtype=float)[None])[1]


def candidates_many(prepared: Prepared, T: Array) -> tuple[Numbers, Array]:
    """Postures for many poses at once.

    Args:
        prepared: see `prepare`.
        T: (N, 4, 4) wanted poses [m].

    Returns:
        (m,) numbers of the poses, ascending, and (m, 6) postures for them.

    Raises:
        NoClosedForm: the method does not hold for the arm, see `Prepared.regular`.
    """
    if not prepared.regular:
        raise NoClosedForm(
            "the matrix of the general inverse geometric model is singular at every posture of this"
            f" arm (its regularity is {prepared.regularity:.0e}); use method='search'"
        )
    loop, T = prepared.arrangement, np.asarray(T, dtype=float)
    ways = loop.all_ways(T)
    number, middle = _middle(prepared, prepared.pencil.matrices(ways))
    row, u = completed(ways[number], loop.prismatic, middle)
    number = number[row]
    order = np.argsort(number, kind="stable")
    number, u = number[order], u[order]
    reach = 1 + np.linalg.norm(T[number, :3, 3], axis=1) / loop.length
    near = np.max(np.where(loop.prismatic, np.abs(u), 0.0), axis=1) < _FAR * reach
    return number[near], loop.postures(u[near])


def _middle(prepared: Prepared, M: Array) -> tuple[Numbers, Array]:
    """(n,) numbers of the poses, and (n, 3) positions of joints 3, 4 and 5 of the loop."""
    prismatic = prepared.arrangement.prismatic
    numbers, positions = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for count, (number, u) in _by_size(M).items():
        x4, x5 = middle_joints(at(M[number], u), prepared.pencil.elimination.grid, count)
        x3 = np.repeat(np.tan(u / 2), count)
        x = np.column_stack([x3, x4.ravel(), x5.ravel()])
        numbers.append(np.repeat(number, count))
        positions.append(np.where(prismatic[2:5], x, 2 * np.arctan(x)))
    return np.concatenate(numbers), np.concatenate(positions)


def _by_size(M: Array) -> dict[int, tuple[Numbers, Array]]:
    """By the number of solutions that share an angle: numbers of the poses, and the angles."""
    number, u = roots(M)
    sized = defaultdict(list)
    for n in np.unique(number):
        for mean, count in clusters(u[number == n]):
            sized[count].append((n, mean))
    return {
        count: (np.array([n for n, _ in found]), np.array([mean for _, mean in found]))
        for count, found in sorted(sized.items())
    }
