"""Array variables of FMI 3.0: q, v, a and tau instead of scalar variables for each joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from mbs.export.fmu.description import Array, FmuEntry, FmuModel, FmuState, FmuVariable, Kind
from mbs.export.fmu.xml import KINDS, DependencyKind, Known


@dataclass(frozen=True, slots=True)
class Group:
    """Request to combine consecutive variables of the same kind into an array.

    Attributes:
        name: name of the array.
        kind: kind of its elements.
        first: index of its first element among the variables of that kind, 0-based.
        size: number of elements. A group of size 0 is skipped.
        text: beginning of the description, before the names of the joints.
    """

    name: str
    kind: Kind
    first: int
    size: int
    text: str


@dataclass(frozen=True, slots=True)
class Listed:
    """Variable of the model description: a scalar or an array.

    Attributes:
        reference: value reference of the variable, which is that of its first element.
        entry: the variable. An array has the attributes of its first element, its own name and
            description, the largest nominal value and no bounds.
        elements: variables of the elements, a single variable for a scalar.
        array: whether the variable is an array.
    """

    reference: int
    entry: FmuEntry
    elements: tuple[FmuVariable, ...]
    array: bool

    @property
    def start(self) -> str:
        """Start values of all elements, separated by spaces."""
        return " ".join(repr(float(v.start)) for v in self.elements)

    @property
    def united(self) -> bool:
        """Whether all elements have the same unit, so that the variable can have it."""
        return len({v.unit for v in self.elements}) == 1


def in_arrays(model: FmuModel, groups: Iterable[Group]) -> FmuModel:
    """Return a copy of a model in which groups of variables are arrays.

    Elements are renamed to `q[1]`, `q[2]`, .... Terminals with a renamed member are dropped.

    Args:
        model: model without arrays.
        groups: arrays to form. An array of states also makes an array of their derivatives.
    """
    changed: dict[Kind, list[FmuVariable]] = {
        "state": list(model.states),
        "input": list(model.inputs),
        "output": list(model.outputs),
        "dependent": list(model.dependents),
    }
    arrays = []
    for group in groups:
        if not group.size:
            continue
        variables, indices = changed[group.kind], range(group.first, group.first + group.size)
        owners = ", ".join(variables[k].name.rpartition(".")[0] for k in indices)
        words, first = f"{group.text} {owners}", model.first(group.kind) + group.first
        arrays.append(Array(group.name, first, group.size, words))
        if group.kind == "state":
            rates = model.first("derivative") + group.first
            words = f"derivatives of the {words}"
            arrays.append(Array(f"der({group.name})", rates, group.size, words))
        for number, k in enumerate(indices, 1):
            variables[k] = replace(variables[k], name=f"{group.name}[{number}]")
    if model.slots:
        n, text = len(model.slots), "states of the model"
        arrays.append(Array("state", model.first("slot"), n, text))
        arrays.append(Array("der(state)", model.first("rate"), n, f"derivatives of the {text}"))
    names = {variable.name for variables in changed.values() for variable in variables}
    return replace(
        model,
        states=tuple(v for v in changed["state"] if isinstance(v, FmuState)),
        inputs=tuple(changed["input"]),
        outputs=tuple(changed["output"]),
        dependents=tuple(changed["dependent"]),
        arrays=tuple(arrays),
        terminals=tuple(t for t in model.terminals if {m.variable for m in t.members} <= names),
    )


def list_variables(model: FmuModel) -> list[Listed]:
    """Return the variables of a model by value reference, each array as a single variable."""
    entries, arrays = model.entries, {array.first: array for array in model.arrays}
    found, place = [], 0
    while place < len(entries):
        array, entry = arrays.get(place), entries[place]
        size = array.size if array else 1
        elements = tuple(e.variable for e in entries[place : place + size])
        if array is not None:
            shared = replace(
                entry.variable,
                name=array.name,
                description=array.description,
                nominal=max(v.nominal for v in elements),
                min=None,
                max=None,
            )
            entry = FmuEntry(entry.kind, shared)
        found.append(Listed(place, entry, elements, array is not None))
        place += size
    return found


def of_arrays(model: FmuModel, references: Iterable[int]) -> list[int]:
    """Replace value references of array elements by that of their array, without duplicates."""
    owner = _owners(model)
    return list(dict.fromkeys(owner.get(reference, reference) for reference in references))


def dependencies_of_arrays(model: FmuModel, known: Mapping[int, Known]) -> dict[int, Known]:
    """Merge dependencies of array elements into dependencies of arrays.

    An array depends on all variables on which an element depends, with the greatest kind.
    """
    owner, found = _owners(model), dict[int, dict[int, DependencyKind]]()
    for reference, row in known.items():
        into = found.setdefault(owner.get(reference, reference), {})
        for other, kind in row.items():
            whole = owner.get(other, other)
            into[whole] = max(into.get(whole, kind), kind, key=KINDS.index)
    return {reference: dict(sorted(row.items())) for reference, row in found.items()}


def _owners(model: FmuModel) -> dict[int, int]:
    """Return dict from the value reference of each array element to that of its array."""
    return {a.first + k: a.first for a in model.arrays for k in range(a.size)}
