"""Which calculated values of an FMU depend on which states, inputs, parameters and on time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi

from mbs.export.fmu.description import FmuModel, Kind
from mbs.export.fmu.linearity import DependencyKind, linearity

Known = Mapping[int, DependencyKind]
"""Value references of what a value depends on, in increasing order, and of what kind each is."""

_ORDER: tuple[Kind, ...] = ("state", "dependent", "input", "parameter", "mode")


@dataclass(frozen=True, slots=True)
class Dependencies:
    """What depends on states, inputs, parameters, modes and time, through the loops too.

    The reference of time is the number of entries.

    Attributes:
        running: of each derivative, output and indicator, by its value reference.
        first: of each mode, when the initialization finds it.
        jumping: of each state, its value after an event by those before it.
    """

    running: Mapping[int, Known]
    first: Mapping[int, Known]
    jumping: Mapping[int, Known]


def dependencies(model: FmuModel) -> Dependencies:
    """What each calculated value of a model depends on.

    A dependent coordinate stands for what moves it: through the block of its own loop, not
    through all loops.

    Args:
        model: what the FMU computes.
    """
    through = _through_loops(model)
    running = _rows(model, model.rhs, ("derivative", "output"), through)
    if model.jumps is None:
        return Dependencies(running, {}, {})
    running |= _rows(model, model.jumps.indicators, ("indicator",), through)
    first = _rows(model, model.jumps.first, ("mode",), through)
    jumping = _rows(model, model.jumps.jump, ("state",), through)
    return Dependencies(running, first, jumping)


def _rows(
    model: FmuModel,
    function: casadi.Function,
    kinds: Sequence[Kind],
    through: Sequence[Known],
) -> dict[int, Known]:
    """The first outputs of a function of (t, x, z, u, p), which are variables of these kinds."""
    references = [len(model.entries)]
    levels: list[DependencyKind] = ["dependent"]
    for kind in _ORDER:
        found = _references(model, kind)
        references += found
        levels += [_level(model, kind, reference) for reference in found]
    extra = sum(function.numel_in(k) for k in range(function.n_in())) - len(references)
    levels += ["dependent"] * extra
    rows = linearity(function, levels)
    z = range(model.first("dependent"), model.first("indicator"))
    answer: dict[int, Known] = {}
    for kind, output in zip(kinds, rows, strict=False):
        for row, found_in in enumerate(output):
            direct = {references[k]: how for k, how in found_in.items() if k < len(references)}
            answer[model.first(kind) + row] = _resolved(direct, z, through)
    return answer


def _references(model: FmuModel, kind: Kind) -> range:
    sizes = {
        "state": len(model.states),
        "dependent": len(model.dependents),
        "input": len(model.inputs),
        "parameter": len(model.parameters),
        "mode": len(model.modes),
    }
    return range(model.first(kind), model.first(kind) + sizes[kind])


def _level(model: FmuModel, kind: Kind, reference: int) -> DependencyKind:
    """What a variable is as a factor of others."""
    if kind == "mode":
        return "discrete"
    if kind != "parameter":
        return "dependent"
    return "fixed" if _is_fixed(model, reference) else "tunable"


def _is_fixed(model: FmuModel, reference: int) -> bool:
    return model.parameters[reference - model.first("parameter")].fixed


def _resolved(direct: Known, z: range, through: Sequence[Known]) -> Known:
    """Dependent coordinates replaced by what moves them."""
    known = {reference: how for reference, how in direct.items() if reference not in z}
    for reference in direct:
        if reference in z:
            known |= through[reference - z.start]
    return dict(sorted(known.items()))


def _through_loops(model: FmuModel) -> list[Known]:
    """The states and parameters that move each dependent coordinate."""
    if model.closure is None:
        return []
    moved = [set[int]() for _ in model.dependents]
    for k, kind in ((0, "state"), (2, "parameter")):
        first = model.first("state" if kind == "state" else "parameter")
        for row, column in zip(*model.closure.jac_sparsity(0, k).get_triplet(), strict=True):
            moved[row].add(first + column)
    return [
        dict.fromkeys(sorted(set[int]().union(*(moved[k] for k in reached))), "dependent")
        for reached in _reached(model.closure)
    ]


def _reached(closure: casadi.Function) -> list[set[int]]:
    """For each element of z, those of z that its Newton step reads, at first or second hand."""
    reads = [{k} for k in range(closure.numel_out(0))]
    for row, column in zip(*closure.jac_sparsity(0, 1).get_triplet(), strict=True):
        reads[row].add(column)
    for _ in reads:
        wider = [set().union(*(reads[k] for k in row)) for row in reads]
        if wider == reads:
            break
        reads = wider
    return reads
