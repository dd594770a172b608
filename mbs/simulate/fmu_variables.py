"""Reading and writing variables of an instance of an FMU, of any type, as numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

INTEGERS = frozenset(
    ("Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)))
)
CONTINUOUS = frozenset(("Real", "Float64", "Float32"))
NUMBERS = CONTINUOUS | INTEGERS | {"Boolean", "Enumeration"}


def size_of(variable: Any) -> int:
    """How many numbers a variable has."""
    return math.prod(variable.shape) if variable.shape else 1


def columns_of(variables: Iterable[Any]) -> dict[str, str]:
    """Name and unit of each number of the variables: elements of arrays as `name[1,2]`."""
    columns: dict[str, str] = {}
    for variable in variables:
        declared = variable.declaredType
        unit = variable.unit or (declared.unit if declared is not None else None) or "1"
        places = itertools.product(*(range(1, n + 1) for n in variable.shape or ()))
        for place in places:
            index = f"[{','.join(map(str, place))}]" if place else ""
            columns[variable.name + index] = unit
    return columns


def reader(instance: Any, variables: Sequence[Any]) -> Callable[[], list[float]]:
    """A function that reads variables, in their order.

    Args:
        instance: of an FMU, an object of fmpy.
        variables: of its model description.
    """
    groups = [
        (getattr(instance, f"get{kind}"), [v.valueReference for v in members], sizes, places)
        for kind, members, sizes, places in _by_type(instance, variables)
    ]
    count = sum(size_of(variable) for variable in variables)

    def read() -> list[float]:
        row = [math.nan] * count
        for get, references, sizes, places in groups:
            values = get(references) if sizes is None else get(references, nValues=sizes)
            for place, value in zip(places, values, strict=True):
                row[place] = float(value)
        return row

    return read


def writer(instance: Any, variables: Sequence[Any]) -> Callable[[Sequence[float]], None]:
    """A function that sets scalar variables, in their order.

    Args:
        instance: of an FMU, an object of fmpy.
        variables: of its model description.
    """
    groups = [
        (getattr(instance, f"set{kind}"), [v.valueReference for v in members], cast, places)
        for kind, members, _, places in _by_type(instance, variables)
        for cast in (_cast(members[0].type),)
    ]

    def write(values: Sequence[float]) -> None:
        for put, references, cast, places in groups:
            put(references, [cast(values[place]) for place in places])

    return write


def set_values(instance: Any, values: Mapping[str, float], variables: Iterable[Any]) -> None:
    """Give those of the variables that are named their values."""
    named = [v for v in variables if v.name in values]
    writer(instance, named)([values[v.name] for v in named])


def _cast(kind: str) -> Callable[[float], float | int | bool]:
    if kind == "Boolean":
        return bool
    return float if kind in CONTINUOUS else round


def _by_type(
    instance: Any, variables: Sequence[Any]
) -> list[tuple[str, list[Any], int | None, list[int]]]:
    """Type, variables of it, how many values where the call asks for it, and their places."""
    newer = hasattr(instance, "getFloat64")
    found: dict[str, tuple[list[Any], list[int]]] = {}
    first = 0
    for variable in variables:
        kind = variable.type
        if kind == "Enumeration":
            kind = "Int64" if newer else "Integer"
        members, places = found.setdefault(kind, ([], []))
        members.append(variable)
        places.extend(range(first, first + size_of(variable)))
        first += size_of(variable)
    return [
        (kind, members, len(places) if newer else None, places)
        for kind, (members, places) in found.items()
    ]
