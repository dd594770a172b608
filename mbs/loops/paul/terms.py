"""The rows of a split loop that may have few unknowns, by their terms in the joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from mbs.loops.paul.knowledge import Members
from mbs.loops.paul.representation import POWERS
from mbs.loops.paul.splits import Side, Split

Values = NDArray[np.complex128]

ZERO = 1e-9
MOST_VARIABLES = 3
_MOST_JOINTS = 4


@dataclass(frozen=True, slots=True)
class Row:
    """Where an equation comes from: see `Split`.

    Attributes:
        start: the frame from which one looks.
        end: the frame at which one looks.
        seed: which axis of it.
        element: of w.
    """

    start: int
    end: int
    seed: int
    element: int

    @property
    def power(self) -> int:
        """The power of a length that its terms are."""
        return POWERS[self.element]


def simple_rows(
    split: Split, slides: frozenset[int], most: int
) -> Iterator[tuple[Row, dict[Members, Values]]]:
    """The rows that may have few unknowns, and their terms.

    Args:
        split: of the loop.
        slides: numbers of its slides.
        most: variables of a row with products of them.
    """
    offset = 0 if split.seed == 2 else -6
    rows = [r + offset for r in split.rows]
    if not rows:
        return
    sides = (split.left, split.right)
    tables = [_table(side.joints, slides) for side in sides]
    masks = [np.max(np.abs(side.values[:, rows]), axis=0) > ZERO for side in sides]
    counts = np.sum([_counts(t, mask) for t, mask in zip(tables, masks, strict=True)], axis=0)
    variables, joints, long = counts
    few = (variables <= most) | ((variables <= MOST_VARIABLES) & (long == 0))
    for number in np.flatnonzero((joints > 0) & (joints <= _MOST_JOINTS) & few):
        row = Row(split.start, split.end, split.seed, split.rows[number])
        found = dict[Members, Values]()
        for side, table, mask, sign in zip(sides, tables, masks, (1, -1), strict=True):
            _collect(found, (side, table.terms, mask[number]), rows[number], sign)
        yield row, found


def _counts(table: _Table, mask: NDArray[np.bool_]) -> NDArray[np.int_]:
    """(3, rows) how many variables, at least, joints, and products there are in each row."""
    weights = mask.astype(int)
    joints = (weights @ table.has) > 0
    together = np.zeros(joints.shape, dtype=bool)
    for (a, b), apart in zip(table.pairs, (weights @ table.apart).T, strict=True):
        together[:, b] |= joints[:, a] & joints[:, b] & (apart == 0)
    count = joints.sum(axis=1)
    return np.array([count - together.sum(axis=1), count, weights @ table.long])


def _collect(
    found: dict[Members, Values],
    source: tuple[Side, list[Members | None], NDArray[np.bool_]],
    row: int,
    sign: int,
) -> None:
    side, terms, mask = source
    for k in np.flatnonzero(mask):
        term = terms[k]
        if term is None:
            continue
        values = sign * side.values[:, row, k]
        found[term] = found[term] + values if term in found else values


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """The terms of a side of given joints.

    Attributes:
        terms: by number; None for those that are conjugates of others.
        has: (terms, joints) 1 where a joint stands in a term.
        pairs: of joints.
        apart: (terms, pairs) 1 where one of the two stands in a term without the other.
        long: (terms) 1 where there are several joints.
    """

    terms: list[Members | None]
    has: NDArray[np.int_]
    pairs: list[tuple[int, int]]
    apart: NDArray[np.int_]
    long: NDArray[np.int_]


@lru_cache(maxsize=4096)
def _table(joints: tuple[int, ...], slides: frozenset[int]) -> _Table:
    every = list(product((-1, 0, 1), repeat=len(joints)))
    terms = list[Members | None]()
    for row in every:
        term = tuple(
            (k, {-1: 1, 1: 2}[e] if k in slides else e)
            for k, e in sorted(zip(joints, row, strict=True))
            if e
        )
        leading = next((e for k, e in term if k not in slides), 1)
        terms.append(term if leading > 0 else None)
    has = (np.array(every, dtype=int).reshape(len(every), len(joints)) != 0).astype(int)
    pairs = list(combinations(range(len(joints)), 2))
    apart = np.array([has[:, a] != has[:, b] for a, b in pairs], dtype=int)
    apart = apart.reshape(len(pairs), len(every)).T
    return _Table(terms, has, pairs, apart, (has.sum(axis=1) > 1).astype(int))
