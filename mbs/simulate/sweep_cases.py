"""Cases of a parameter sweep: the values of the varied quantities."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence

from mbs.errors import ModelError
from mbs.numbers import numbers_given
from mbs.text import quoted

Case = dict[str, float]
Grid = Mapping[str, Iterable[float]] | Sequence[Mapping[str, float]]


def cases_of(grid: Grid) -> tuple[Case, ...]:
    """Return the cases of a grid.

    Args:
        grid: dict from name to values, for all combinations (the last name varies fastest), or
            sequence of cases, each a dict from name to value.

    Raises:
        ModelError: the grid has no case, or a value is not a number.
    """
    if isinstance(grid, Mapping):
        listed = list(_combinations(grid))
    elif isinstance(grid, Sequence) and all(isinstance(case, Mapping) for case in grid):
        listed = [dict(case) for case in grid]
    else:
        raise ModelError(
            f'sweep: the grid is {quoted(grid)}; give a dict such as {{"m": [1.0, 2.0]}}, or a'
            ' list of one dict for each case, such as [{"m": 1.0}, {"m": 2.0}]'
        )
    if not grid or not listed:
        raise ModelError("sweep: the grid has no case; give at least one value for every name")
    return tuple({str(name): _number(name, x) for name, x in case.items()} for case in listed)


def _combinations(grid: Mapping[str, Iterable[float]]) -> Iterable[Case]:
    columns = [
        list(values) if isinstance(values, Iterable) else [values] for values in grid.values()
    ]
    for values in itertools.product(*columns):
        yield dict(zip(grid, values, strict=True))


def _number(name: str, value: object) -> float:
    array = numbers_given(value)
    if isinstance(array, str):
        raise ModelError(f"sweep: {name} {array}")
    if array.size != 1:
        raise ModelError(f"sweep: {name} is {quoted(value)}; give one number for each case")
    return float(array.item())
