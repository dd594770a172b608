"""Columns of a regressor, and what is known of their linear relations.

D is the regressor. A relation says that some combination of its columns vanishes in every state;
it takes one parameter out and adds it to others.

Source: Gautier 1991.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.identification.base.quotient import quotient
from mbs.solvers.rank import first_best

Terms = Mapping[int, SX]
"""Coefficients of some of the columns, by their numbers from 0."""

Sampled = Callable[[list[SX]], NDArray[np.float64]]
"""(samples, n) values of n scalars at samples of the parameters of a system."""

_CANCELLED = 1e-13
_ZERO = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Grouping:
    """Every column as a combination of those that are kept.

    Attributes:
        columns: for each column of the regressor the coefficients of the kept ones.
    """

    columns: tuple[Terms, ...]

    @staticmethod
    def none(size: int) -> Grouping:
        """All of them kept."""
        return Grouping(tuple({k: SX(1)} for k in range(size)))

    @property
    def kept(self) -> list[int]:
        """Numbers of the kept columns."""
        return [k for k, terms in enumerate(self.columns) if k in terms]

    def reduced(self, terms: Terms) -> dict[int, SX]:
        """A combination of any columns as one of the kept columns."""
        total: dict[int, SX] = {}
        for column, coefficient in terms.items():
            for k, part in self.columns[column].items():
                _add(total, k, coefficient * part)
        return total

    def replaced(self, dropped: int, terms: Terms) -> Grouping:
        """The grouping once a kept column is known to equal a combination of other columns."""
        equal = self.reduced(terms)
        columns = []
        for column in self.columns:
            if dropped in column:
                changed = {k: x for k, x in column.items() if k != dropped}
                for k, part in equal.items():
                    _add(changed, k, column[dropped] * part)
                columns.append(changed)
            else:
                columns.append(dict(column))
        return Grouping(tuple(columns))


def related(
    grouping: Grouping, relation: Terms, ranks: Callable[[int], int], sampled: Sampled
) -> Grouping:
    """The grouping once a combination of columns is known to vanish.

    The column of highest rank that still is kept leaves, among those whose coefficient vanishes
    for no sample; among equals the one of the largest coefficient, so that no quotient is large.

    Args:
        grouping: what is known so far.
        relation: the combination.
        ranks: number of a column; the highest leaves first.
        sampled: values of coefficients, which say whether they vanish.
    """
    rest = grouping.reduced(relation)
    if not rest:
        return grouping
    sizes = np.abs(sampled(list(rest.values())))
    least, most = (dict(zip(rest, f(sizes, axis=0), strict=True)) for f in (np.min, np.max))
    zero = _ZERO * max(1.0, float(np.max(sizes)))
    able = [k for k, size in least.items() if size > zero]
    if not able:
        return grouping
    highest = max(map(ranks, able))
    last = [k for k in able if ranks(k) == highest]
    pivot = last[first_best([float(least[k]) for k in last])]
    left = [k for k, size in most.items() if k != pivot and size > zero]
    return grouping.replaced(pivot, {k: -quotient(rest[k], rest[pivot]) for k in left})


def without_zeros(grouping: Grouping, sampled: Sampled) -> Grouping:
    """The grouping without coefficients whose symbols cancel, though they are still written."""
    columns = []
    for terms in grouping.columns:
        written = {k: x for k, x in terms.items() if not x.is_constant()}
        sizes = np.max(np.abs(sampled(list(written.values()))), axis=0) if written else np.zeros(0)
        zero = {k for k, size in zip(written, sizes, strict=True) if size <= _CANCELLED}
        columns.append({k: x for k, x in terms.items() if k not in zero})
    return Grouping(tuple(columns))


def coefficients(grouping: Grouping) -> Iterable[tuple[int, int, SX]]:
    """Kept column, any column, and how much of the second parameter the first one takes."""
    for number, terms in enumerate(grouping.columns):
        for k, coefficient in terms.items():
            yield k, number, coefficient


def _add(total: dict[int, SX], k: int, part: SX) -> None:
    """Add to one coefficient; numbers that cancel but for rounding leave none."""
    if part.is_zero():
        return
    if k not in total:
        total[k] = part
        return
    both = SX(total[k] + part)
    if both.is_constant() and total[k].is_constant():
        small = abs(float(both)) <= _CANCELLED * (abs(float(total[k])) + abs(float(part)))
        both = SX(0) if small else both
    if both.is_zero():
        del total[k]
    else:
        total[k] = both
