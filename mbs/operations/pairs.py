"""The pairs of elements that many groups have in common."""

from __future__ import annotations

import heapq
from collections import defaultdict
from itertools import combinations

Group = dict[int, int]
"""The sign of each element of a group, 1 or -1."""

_Pair = tuple[int, int, int]
"""Two elements, the lower first, and the product of their signs."""

_LONGEST = 48


def extract_pairs(groups: dict[int, Group], first_name: int) -> None:
    """Make what several groups have in common an element of theirs, in place.

    The pair that is held most often, up to a common sign, becomes a group of its own, again and
    again until no pair is held twice. Of a long group the first elements alone take part, so that
    the work grows with the number of elements.

    Args:
        groups: by name; they get the new groups too.
        first_name: the first of the numbers that are free as names.
    """
    extraction = _Extraction(groups)
    name = first_name
    while (pair := extraction.most_common()) is not None:
        extraction.replace(pair, name)
        name += 1


class _Extraction:
    def __init__(self, groups: dict[int, Group]) -> None:
        self._groups = groups
        self._holders: dict[_Pair, dict[int, None]] = defaultdict(dict)
        self._queue: list[tuple[int, _Pair]] = []
        for name, group in groups.items():
            for a, b in combinations(sorted(list(group)[:_LONGEST]), 2):
                self._holders[(a, b, group[a] * group[b])][name] = None
        self._queue = [(-len(h), pair) for pair, h in self._holders.items() if len(h) > 1]
        heapq.heapify(self._queue)

    def most_common(self) -> _Pair | None:
        """A pair that no other is held more often than; None when none is held twice."""
        while self._queue:
            count, pair = heapq.heappop(self._queue)
            held = len(self._holders.get(pair, ()))
            if held == -count:
                return pair
            if held > 1:
                heapq.heappush(self._queue, (-held, pair))
        return None

    def replace(self, pair: _Pair, name: int) -> None:
        """Make a group of a pair and an element of those that hold it."""
        a, b, sign = pair
        for holder in list(self._holders.pop(pair)):
            group = self._groups[holder]
            outer = group[a]
            self._forget(holder, group, a, b)
            del group[a], group[b]
            self._notice(holder, group, name, outer)
            group[name] = outer
        self._groups[name] = {a: 1, b: sign}

    def _forget(self, holder: int, group: Group, a: int, b: int) -> None:
        for other, sign in group.items():
            for gone in (a, b):
                if other != gone:
                    low, high = min(gone, other), max(gone, other)
                    holders = self._holders.get((low, high, sign * group[gone]))
                    if holders is not None:
                        holders.pop(holder, None)

    def _notice(self, holder: int, group: Group, name: int, outer: int) -> None:
        for other in list(group)[:_LONGEST]:
            pair = (other, name, group[other] * outer)
            holders = self._holders[pair]
            holders[holder] = None
            if len(holders) > 1:
                heapq.heappush(self._queue, (-len(holders), pair))
