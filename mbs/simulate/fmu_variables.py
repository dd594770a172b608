"""Read and write FMU variables of any numeric type as Python numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

INTEGERS = frozenset(
    ("Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)))
)
CONTINUOUS = frozenset(("Real", "Float64", "Float32"))
NUMBERS = CONTINUOUS | INTEGERS | {"Boolean", "Enumeration"}
NOTHING: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Element:
    """Element of an array variable, with the attributes of the FMPy variable.

    Attributes:
        array: FMPy variable of the array.
        place: index in the array in row-major order, from 0.
        name: name with indices from 1, such as `q[2]` or `R[1,3]`.
    """

    array: Any
    place: int
    name: str

    def __getattr__(self, name: str) -> Any:
        return getattr(self.array, name)

    @property
    def start(self) -> float:
        """Start value in the model description; 0 if there is none."""
        values = str(self.array.start or "0").split()
        return _number(values[self.place if len(values) > 1 else 0])


def elements_of(variable: Any) -> list[Element]:
    """Return the elements of an array variable, or an empty list for a scalar."""
    names = columns_of([variable]) if variable.shape else ()
    return [Element(variable, place, name) for place, name in enumerate(names)]


def numbers_of(description: Any) -> dict[str, Any]:
    """Return all numeric scalar variables and elements of numeric arrays, by name."""
    return {
        v.name: v
        for variable in description.modelVariables
        if variable.type in NUMBERS
        for v in (elements_of(variable) if variable.dimensions else [variable])
    }


def size_of(variable: Any) -> int:
    """Return the number of elements of a variable; 1 for a scalar."""
    return math.prod(variable.shape) if variable.shape else 1


def columns_of(variables: Iterable[Any]) -> dict[str, str]:
    """Return units of scalars and array elements by name; elements are named `name[1,2]`."""
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
    """Return a function that reads the values of variables, in their order.

    Args:
        instance: FMPy object of an FMU.
        variables: variables of the model description.
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


def writer(
    instance: Any, variables: Sequence[Any], starts: Mapping[str, float] = NOTHING
) -> Callable[[Sequence[float]], None]:
    """Return a function that sets scalar variables and elements of arrays, in their order.

    An array is set as a whole. Its elements that are not in `variables` get their start value.

    Args:
        instance: FMPy object of an FMU.
        variables: variables of the model description, or `Element`.
        starts: start values by name that replace values of the model description.
    """
    newer = hasattr(instance, "getFloat64")
    found: dict[str, _Target] = {}
    for number, variable in enumerate(variables):
        kind = _call(variable.type, newer)
        if kind not in found:
            found[kind] = _Target(getattr(instance, f"set{kind}"), _cast(variable.type))
        found[kind].add(number, variable, starts)

    def write(values: Sequence[float]) -> None:
        for target in found.values():
            for number, place in target.places:
                target.values[place] = target.cast(values[number])
            target.put(list(target.first), target.values)

    return write


@dataclass(slots=True)
class _Target:
    """Variables of the same type, which are set by a single FMI call.

    Attributes:
        put: FMI setter (value references, values).
        cast: conversion of a float to the type.
        first: dict from value reference to the index of the first element in `values`.
        values: values of all variables, in the order of `first`.
        places: pairs of the index of an argument of `write` and its index in `values`.
    """

    put: Callable[[list[int], list[Any]], None]
    cast: Callable[[float], float | int | bool]
    first: dict[int, int] = field(default_factory=dict)
    values: list[Any] = field(default_factory=list)
    places: list[tuple[int, int]] = field(default_factory=list)

    def add(self, number: int, variable: Any, starts: Mapping[str, float]) -> None:
        """Append a variable or element that is argument `number` of `write`."""
        whole, offset = variable, 0
        if isinstance(variable, Element):
            whole, offset = variable.array, variable.place
        if whole.valueReference not in self.first:
            self.first[whole.valueReference] = len(self.values)
            begin = [starts.get(e.name, e.start) for e in elements_of(whole)] or [0.0]
            self.values += [self.cast(value) for value in begin]
        self.places.append((number, self.first[whole.valueReference] + offset))


def set_values(instance: Any, values: Mapping[str, float], description: Any) -> None:
    """Set variables and elements of arrays by name."""
    named = [v for name, v in numbers_of(description).items() if name in values]
    writer(instance, named, values)([values[v.name] for v in named])


def _number(text: str) -> float:
    return float(text == "true") if text in ("true", "false") else float(text)


def _call(kind: str, newer: bool) -> str:
    """Return the type in the name of the FMI getter and setter of a type."""
    if kind != "Enumeration":
        return kind
    return "Int64" if newer else "Integer"


def _cast(kind: str) -> Callable[[float], float | int | bool]:
    if kind == "Boolean":
        return bool
    return float if kind in CONTINUOUS else round


def _by_type(
    instance: Any, variables: Sequence[Any]
) -> list[tuple[str, list[Any], int | None, list[int]]]:
    """Return by type: FMI type, variables, number of values (FMI 3.0 only), row indices."""
    newer = hasattr(instance, "getFloat64")
    found: dict[str, tuple[list[Any], list[int]]] = {}
    first = 0
    for variable in variables:
        kind = _call(variable.type, newer)
        members, places = found.setdefault(kind, ([], []))
        members.append(variable)
        places.extend(range(first, first + size_of(variable)))
        first += size_of(variable)
    return [
        (kind, members, len(places) if newer else None, places)
        for kind, (members, places) in found.items()
    ]
