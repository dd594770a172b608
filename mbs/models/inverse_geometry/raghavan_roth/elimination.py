"""The equations of a loop in three of its joints, and the matrix that is singular at a solution.

rho(Z_3) rho(C_3) rho(Z_4) rho(C_4) rho(Z_5) w(C_5)
    = rho(C_2^-1) rho(Z_2^-1) rho(C_1^-1) rho(Z_1^-1) w(C_6^-1)
is fifteen equations, of which the first is 1 = 1; joint 6 is not in them, for it turns about the
direction of the pair. The right side is a (14, 8) block times eight monomials of joints 1 and 2,
and a constant; the left null vectors of the block leave equations in joints 3, 4 and 5. With the
half angles x4, x5 they have the nine monomials x4^i x5^j, i, j <= 2; with their products by x4, or
by x5, there are twelve equations in twelve monomials. Slides have r^2 in four of the equations
only, so that without these the monomials are fewer.

Source: Raghavan & Roth 1993; Manocha & Canny 1994.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.arm import inverse
from mbs.models.inverse_geometry.raghavan_roth.pairs import (
    LINEAR,
    SIZE,
    Array,
    back_parts,
    half_parts,
    motion_parts,
    pair,
    rho,
)

Joints = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """The equations that are used of a loop, and their monomials; s elements of a pair are in them.

    Attributes:
        elements: (s,) their numbers in w.
        first: (n1, s, s) parts of rho of the inverse of joint 1, with 1, cos q, sin q or 1, r, r^2.
        second: (n2, s, s) of the inverse of joint 2.
        third: (n3, s, s) of joint 3, with the `weights` of its angle u.
        fourth: (n4, s, s) of joint 4, with 1, x4, x4^2.
        fifth: (n5, s, s) of joint 5, with 1, x5, x5^2.
        one: (n3, n4 n5) what stands for 1 in the terms of the left side.
        raised: 0 where the equations are multiplied by x4, 1 for x5.
        slides: whether joint 3 slides.
    """

    elements: NDArray[np.int64]
    first: Array
    second: Array
    third: Array
    fourth: Array
    fifth: Array
    one: Array
    raised: int
    slides: bool

    @property
    def grid(self) -> tuple[int, int]:
        """Numbers of powers of x4 and of x5 in the twelve monomials, or in fewer."""
        n4, n5 = len(self.fourth), len(self.fifth)
        return (n4, n5 + 1) if self.raised else (n4 + 1, n5)

    @property
    def size(self) -> int:
        """The size of the matrix."""
        return self.grid[0] * self.grid[1]

    def right_side(self, ways: Array) -> Array:
        """(N, s - 1, n1 n2) factors of the monomials of joints 1 and 2, of which the first is 1.

        Args:
            ways: (N, 6, 4, 4) of the loop.
        """
        u = pair(inverse(ways[:, 5]))[:, self.elements]
        once = self._carried(inverse(ways[:, 0]), np.einsum("jab,nb->naj", self.first, u))
        twice = np.einsum("iab,nbj->naij", self.second, once)
        return self._carried(inverse(ways[:, 1]), twice.reshape(*u.shape, -1))[:, 1:]

    def left_side(self, ways: Array) -> Array:
        """(N, n3, s - 1, n4 n5) factors of the monomials x4^i x5^j, for each weight of joint 3."""
        w = pair(ways[:, 4])[:, self.elements]
        once = self._carried(ways[:, 3], np.einsum("jab,nb->naj", self.fifth, w))
        twice = np.einsum("iab,nbj->naij", self.fourth, once)
        twice = self._carried(ways[:, 2], twice.reshape(*w.shape, -1))
        left: Array = np.einsum("kab,nbm->nkam", self.third, twice)[:, :, 1:]
        return left

    def equations(self, rows: Array, right: Array, left: Array) -> Array:
        """(N, n3, k, n4 n5) the equations in joints 3, 4 and 5 of null rows (N, k, s - 1)."""
        constant = rows @ right[:, :, :1]
        return rows[:, None] @ left - constant[:, None] * self.one[:, None, :]

    def dialytic(self, E: Array) -> Array:
        """(N, n3, 2 k, size) the equations, and below them their products by x4 or x5."""
        count = E.shape[2]
        M = np.zeros((*E.shape[:2], 2 * count, *self.grid))
        E = E.reshape(*E.shape[:3], len(self.fourth), len(self.fifth))
        n4, n5, raised = len(self.fourth), len(self.fifth), self.raised
        M[:, :, :count, :n4, :n5] = E
        M[:, :, count:, 1 - raised : n4 + 1 - raised, raised : n5 + raised] = E
        return M.reshape(*M.shape[:3], -1)

    def _carried(self, T: Array, columns: Array) -> Array:
        moved: Array = rho(T)[:, self.elements[:, None], self.elements] @ columns
        return moved


def weights(u: Array, count: int) -> Array:
    """(N, count) of joint 3 at angles u: 1, cos u, sin u, or cos(u/2), sin(u/2) where count is 2.

    A turn is at u, a slide at r = tan(u/2).
    """
    if count == 2:
        return np.stack([np.cos(u / 2), np.sin(u / 2)], axis=-1)
    return np.stack([np.ones_like(u), np.cos(u), np.sin(u)], axis=-1)


def at(M: Array, u: Array) -> Array:
    """(N, n, n) the matrix at angles u, (N,), from its parts (N, n3, n, n)."""
    value: Array = np.einsum("nk,nkab->nab", weights(u, M.shape[1]), M)
    return value


def null_rows(right: Array, rank: int) -> Array:
    """(N, s - 1 - rank, s - 1) orthonormal rows that the monomials of joints 1 and 2 vanish on."""
    U = np.linalg.svd(right[:, :, 1:])[0]
    return np.swapaxes(U[:, :, rank:], -1, -2)


def eliminations(prismatic: Joints) -> list[Elimination]:
    """The choices there are: the monomial that multiplies, and where joints slide the equations."""
    chosen = [np.arange(SIZE)] + ([LINEAR] if np.any(prismatic) else [])
    return [_elimination(prismatic, elements, k) for elements in chosen for k in (0, 1)]


def _elimination(prismatic: Joints, elements: NDArray[np.int64], raised: int) -> Elimination:
    slides = [bool(joint) for joint in prismatic]
    highest = 3 if len(elements) == SIZE else 2
    counts = [highest if slide else 3 for slide in slides]
    first, second = (back_parts(slides[k])[: counts[k]] for k in (0, 1))
    fourth, fifth = (half_parts(slides[k])[: counts[k]] for k in (3, 4))
    third, unit = _third(slides[2], counts[2])
    ends = (np.array([1.0, 0.0, 0.0 if slides[k] else 1.0])[: counts[k]] for k in (3, 4))
    one = np.einsum("k,i,j->kij", unit, *ends).reshape(len(unit), -1)
    own = (slice(None), elements[:, None], elements)
    return Elimination(
        elements,
        first[own],
        second[own],
        third[own],
        fourth[own],
        fifth[own],
        one,
        raised,
        slides[2],
    )


def _third(slides: bool, count: int) -> tuple[Array, Array]:
    """The parts of joint 3 that go with its `weights`, and what stands for 1."""
    parts = motion_parts(slides)[:count]
    if not slides:
        return parts, np.array([1.0, 0.0, 0.0])
    if count == 2:
        return parts, np.array([1.0, 0.0])
    low, middle, high = 0.5 * parts
    return np.array([low + high, low - high, middle]), np.array([0.5, 0.5, 0.0])
