"""Dependencies of the calculated values of an FMU, for the element ModelStructure."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import casadi

from mbs.export.fmu.description import FmuModel, Kind

# Kind of the dependence of each function output on each input: a constant factor, or another kind.
#
# The sets of inputs on which a result depends, and the kinds of their factors, are propagated
# through the scalar operations of the function.


DependencyKind = Literal["constant", "fixed", "tunable", "discrete", "dependent"]
KINDS: tuple[DependencyKind, ...] = ("constant", "fixed", "tunable", "discrete", "dependent")
"""Kinds of FMI from least to greatest. A sum has the greatest kind of its terms."""

_WORST = len(KINDS) - 1
_Masks = tuple[int, ...]
"""Bit masks of inputs, one per kind: the inputs of that kind or a greater kind."""

_NONE: _Masks = (0,) * len(KINDS)
_SUMS = (casadi.OP_ADD, casadi.OP_SUB)
_SCALED = (casadi.OP_NEG, casadi.OP_TWICE, casadi.OP_ASSIGN)


def linearity(
    function: casadi.Function, levels: Sequence[DependencyKind]
) -> list[list[dict[int, DependencyKind]]]:
    """Return the dependencies of each output element of a function on the input elements.

    If an output is linear in an input, the dependence has the kind of the factor: "constant",
    "fixed", "tunable" or "discrete". Otherwise it is "dependent". For a function that is not an
    SX graph, all dependencies of the sparsity pattern are "dependent".

    Args:
        function: CasADi function.
        levels: kind of each input element, in order, when it is a factor of another input.

    Returns:
        For each output, a list with a dict for each element: index of the input element, counted
        over all inputs, to kind.
    """
    if not function.is_a("SXFunction"):
        return _by_sparsity(function)
    weights = [KINDS.index(level) for level in levels]
    found = _walk(function, _levels_of(weights))
    return [[_read(masks) for masks in rows] for rows in found]


def _walk(function: casadi.Function, level: Callable[[int], int]) -> list[list[_Masks]]:
    work = [_NONE] * function.sz_w()
    sizes = [function.numel_in(k) for k in range(function.n_in())]
    first = [sum(sizes[:k]) for k in range(len(sizes))]
    places_in = [_places(function.sparsity_in(k)) for k in range(function.n_in())]
    places_out = [_places(function.sparsity_out(k)) for k in range(function.n_out())]
    answer = [[_NONE] * function.numel_out(k) for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        op, out = function.instruction_id(k), function.instruction_output(k)
        given = function.instruction_input(k)
        if op == casadi.OP_INPUT:
            bit = 1 << (first[given[0]] + places_in[given[0]][given[1]])
            work[out[0]] = (bit, *_NONE[1:])
        elif op == casadi.OP_OUTPUT:
            answer[out[0]][places_out[out[0]][out[1]]] = work[given[0]]
        elif op == casadi.OP_CONST:
            work[out[0]] = _NONE
        else:
            work[out[0]] = _combine(op, [work[i] for i in given], level)
    return answer


def _combine(op: int, terms: list[_Masks], level: Callable[[int], int]) -> _Masks:
    a, b = terms[0], terms[-1]
    if op in _SCALED:
        return a
    if op in _SUMS:
        return _sum(a, b)
    if op == casadi.OP_MUL:
        return _product(a, b, level)
    if op == casadi.OP_DIV:
        return _product(a, _bend(b), level)
    if op == casadi.OP_IF_ELSE_ZERO:
        return _product(_bend(a), b, level)
    return _sum(_bend(a), _bend(b))


def _sum(a: _Masks, b: _Masks) -> _Masks:
    return tuple(x | y for x, y in zip(a, b, strict=True))


def _bend(a: _Masks) -> _Masks:
    """Dependence after a nonlinear function: every input is "dependent"."""
    return (a[0],) * len(KINDS)


def _product(a: _Masks, b: _Masks, level: Callable[[int], int]) -> _Masks:
    """Dependence of a product: the kind follows from the other factor.

    An input on which both factors depend is "dependent", because the product is nonlinear in it.
    """
    both = a[0] & b[0]
    raised = _sum(_raise_order(a, level(b[0])), _raise_order(b, level(a[0])))
    return tuple(mask | both for mask in raised)


def _raise_order(a: _Masks, kind: int) -> _Masks:
    return tuple(a[0] if k <= kind else mask for k, mask in enumerate(a))


def _levels_of(weights: Sequence[int]) -> Callable[[int], int]:
    """Return a function that gives the kind index of a factor: the greatest kind of its inputs."""
    groups = [sum(1 << k for k, w in enumerate(weights) if w == kind) for kind in range(len(KINDS))]

    def level(mask: int) -> int:
        return next((kind for kind in range(_WORST, 0, -1) if mask & groups[kind]), 0)

    return level


def _places(pattern: casadi.Sparsity) -> list[int]:
    """Return the column-major element index of each structural nonzero."""
    rows, columns = pattern.get_triplet()
    return [r + c * pattern.size1() for r, c in zip(rows, columns, strict=True)]


def _read(masks: _Masks) -> dict[int, DependencyKind]:
    found: dict[int, DependencyKind] = {}
    for kind, mask in zip(KINDS, masks, strict=True):
        while mask:
            bit = mask & -mask
            found[bit.bit_length() - 1] = kind
            mask ^= bit
    return dict(sorted(found.items()))


def _by_sparsity(function: casadi.Function) -> list[list[dict[int, DependencyKind]]]:
    answer: list[list[dict[int, DependencyKind]]] = []
    for output in range(function.n_out()):
        rows: list[dict[int, DependencyKind]] = [{} for _ in range(function.numel_out(output))]
        first = 0
        for k in range(function.n_in()):
            pattern = function.jac_sparsity(output, k)
            for row, column in zip(*pattern.get_triplet(), strict=True):
                rows[row][first + column] = "dependent"
            first += function.numel_in(k)
        answer.append(rows)
    return answer


# Dependencies of the calculated values of an FMU on states, inputs, parameters and time.


Known = Mapping[int, DependencyKind]
"""Dict from the value references on which a value depends, in increasing order, to the kind."""

_ORDER: tuple[Kind, ...] = ("state", "dependent", "input", "parameter", "mode")


@dataclass(frozen=True, slots=True)
class Dependencies:
    """Dependencies on states, inputs, parameters, modes and time, also through closed loops.

    All are dicts from value references to dependencies. The reference of time is the number of
    entries.

    Attributes:
        running: dependencies of each derivative, output and event indicator.
        first: dependencies of the initial value of each mode.
        jumping: dependencies of the value of each state after an event on the values before it.
    """

    running: Mapping[int, Known]
    first: Mapping[int, Known]
    jumping: Mapping[int, Known]


def dependencies(model: FmuModel) -> Dependencies:
    """Return the dependencies of all calculated values of a model.

    A dependent coordinate is replaced by the states and parameters that determine it through its
    own loop, not through all loops.

    Args:
        model: description of the FMU.
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
    """Return the dependencies of the first outputs of function(t, x, z, u, p), by value reference.

    kinds: kind of variables of each output.
    """
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
            answer[model.first(kind) + row] = _resolve(direct, z, through)
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
    """Return the dependency kind of FMI of a product with a variable as a factor.

    `kind` is the kind of the variable, such as "mode", and `reference` its value reference.
    """
    if kind == "mode":
        return "discrete"
    if kind != "parameter":
        return "dependent"
    return "fixed" if _is_fixed(model, reference) else "tunable"


def _is_fixed(model: FmuModel, reference: int) -> bool:
    return model.parameters[reference - model.first("parameter")].fixed


def _resolve(direct: Known, z: range, through: Sequence[Known]) -> Known:
    """Replace dependent coordinates by the states and parameters that determine them."""
    known = {reference: how for reference, how in direct.items() if reference not in z}
    for reference in direct:
        if reference in z:
            known |= through[reference - z.start]
    return dict(sorted(known.items()))


def _through_loops(model: FmuModel) -> list[Known]:
    """Return the states and parameters that determine each dependent coordinate."""
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
    """Return for each element of z the elements on which its Newton step depends (transitively)."""
    reads = [{k} for k in range(closure.numel_out(0))]
    for row, column in zip(*closure.jac_sparsity(0, 1).get_triplet(), strict=True):
        reads[row].add(column)
    for _ in reads:
        wider = [set().union(*(reads[k] for k in row)) for row in reads]
        if wider == reads:
            break
        reads = wider
    return reads


# The element ModelStructure.


_NOTHING: Known = {}


@dataclass(frozen=True, slots=True)
class ModelStructure:
    """Content of the XML element ModelStructure, by value references.

    The reference of time is the number of entries.

    Attributes:
        outputs: outputs, including states and modes that are outputs.
        derivatives: derivatives of the states.
        indicators: event indicators.
        initial: values that the initialization calculates.
        running: dependencies of each output, derivative and indicator between events, without
            modes and fixed parameters, which are constant then. Modes depend on nothing.
        starting: dependencies of each value of `initial` at the start, of kind "constant" or
            "dependent".
        reset: states that an event may change.
    """

    outputs: list[int]
    derivatives: list[int]
    indicators: list[int]
    initial: list[int]
    running: Mapping[int, Known]
    starting: Mapping[int, Known]
    reset: list[int]


def structure(model: FmuModel) -> ModelStructure:
    """Return the ModelStructure of a model."""
    found = dependencies(model)
    modes = range(model.first("mode"), model.first("dependent"))
    numbered = enumerate(model.parameters, start=model.first("parameter"))
    frozen = {*modes, *(ref for ref, parameter in numbered if parameter.fixed)}
    running: dict[int, Known] = {
        ref: without(frozen, known) for ref, known in found.running.items()
    }
    shown = [k for k, state in enumerate(model.states) if state.output]
    running |= dict.fromkeys(modes, _NOTHING)
    reset = [k for k, known in found.jumping.items() if dict(known) != {k: "constant"}]
    running.update({k: {k: "constant"} for k in shown})
    starting = dict(found.running)
    if model.charted:
        reset = list(model.derived.values())
        running |= _by_joints(model, running)
        running = {ref: _through_all(model, known) for ref, known in running.items()}
        starting |= _by_joints(model, found.running)
    calculated = [*range(model.first("output"), model.first("parameter")), *modes]
    derivatives = list(model.derived)
    return ModelStructure(
        outputs=shown + calculated,
        derivatives=derivatives,
        indicators=[
            *range(model.first("indicator"), model.first("slot")),
            *range(model.first("chart"), model.first("cut")),
        ],
        initial=derivatives + calculated,
        running=running,
        starting={
            ref: _starting(
                found.first.get(ref) or starting.get(ref, {}), found, modes, ref in modes
            )
            for ref in derivatives + calculated
        },
        reset=reset,
    )


def _by_joints(model: FmuModel, running: Mapping[int, Known]) -> dict[int, Known]:
    """Dependencies of the states in charts.h: their derivatives, and the indicator of a change.

    Each depends on all variables on which a derivative of the joint states depends.
    """
    n, every = len(model.states), dict[int, DependencyKind]()
    for known in (running[n + k] for k in range(n)):
        every |= dict.fromkeys(known, KINDS[-1])
    return {ref: every for ref in (*model.derived, model.first("chart"))}


def _through_all(model: FmuModel, known: Known) -> Known:
    """Replace a dependence on a joint state by one on all states of the external integrator.

    Near a singular configuration these states are tangent coordinates, which move all joints.
    """
    states, slots = range(len(model.states)), model.derived.values()
    if not any(ref in states for ref in known):
        return known
    rest = {ref: kind for ref, kind in known.items() if ref not in states}
    return dict(sorted((rest | dict.fromkeys(slots, KINDS[-1])).items()))


def without(references: Container[int], known: Known) -> dict[int, DependencyKind]:
    """Return the dependencies on other variables than these references."""
    return {ref: kind for ref, kind in known.items() if ref not in references}


def _starting(known: Known, found: Dependencies, modes: range, whole: bool) -> Known:
    """Return the dependencies of a value at the start, with modes replaced by their dependencies.

    whole: whether the value is an integer, such as a mode. An integer is linear in no variable.
    """
    direct: dict[int, DependencyKind] = {
        ref: "constant" if kind == "constant" and not whole else "dependent"
        for ref, kind in known.items()
        if ref not in modes
    }
    for mode in (ref for ref in known if ref in modes):
        direct |= dict.fromkeys((ref for ref in found.first[mode] if ref not in modes), "dependent")
    return dict(sorted(direct.items()))
