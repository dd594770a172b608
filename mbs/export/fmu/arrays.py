"""Variables of FMI 3.0 that are arrays: q, v, a and tau in place of one variable for each joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from mbs.export.fmu.description import Array, FmuEntry, FmuModel, FmuState, FmuVariable, Kind
from mbs.export.fmu.xml import KINDS, DependencyKind, Known


@dataclass(frozen=True, slots=True)
class Group:
    """Variables of one kind that are to be one array.

    Attributes:
        name: of the array.
        kind: of its elements.
        first: which of that kind is its first element, from 0.
        size: number of elements; nothing is done where it is 0.
        text: what they are, in front of their names.
    """

    name: str
    kind: Kind
    first: int
    size: int
    text: str


@dataclass(frozen=True, slots=True)
class Listed:
    """A variable as the model description lists it.

    Attributes:
        reference: value reference, of its first element.
        entry: the variable; of an array with what all elements share.
        elements: one for a scalar.
        array: whether it has a dimension.
    """

    reference: int
    entry: FmuEntry
    elements: tuple[FmuVariable, ...]
    array: bool

    @property
    def start(self) -> str:
        """The start values, one after the other."""
        return " ".join(repr(float(v.start)) for v in self.elements)

    @property
    def united(self) -> bool:
        """Whether all elements have one unit, as an attribute of the whole says."""
        return len({v.unit for v in self.elements}) == 1


def in_arrays(model: FmuModel, groups: Iterable[Group]) -> FmuModel:
    """The same model, its elements named `q[1]` and so on, listed as arrays.

    Args:
        model: without arrays.
        groups: states bring their derivatives with them.
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
    """The variables of a model, arrays as one, in the order of the value references."""
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
    """References of elements as those of the variables that hold them, each once."""
    owner = _owners(model)
    return list(dict.fromkeys(owner.get(reference, reference) for reference in references))


def dependencies_of_arrays(model: FmuModel, known: Mapping[int, Known]) -> dict[int, Known]:
    """What arrays depend on: whatever one of their elements does, of the widest kind."""
    owner, found = _owners(model), dict[int, dict[int, DependencyKind]]()
    for reference, row in known.items():
        into = found.setdefault(owner.get(reference, reference), {})
        for other, kind in row.items():
            whole = owner.get(other, other)
            into[whole] = max(into.get(whole, kind), kind, key=KINDS.index)
    return {reference: dict(sorted(row.items())) for reference, row in found.items()}


def _owners(model: FmuModel) -> dict[int, int]:
    """The reference of the array of each element."""
    return {a.first + k: a.first for a in model.arrays for k in range(a.size)}
