"""What the model descriptions of FMI 2.0 and 3.0 have in common."""

import math
from collections.abc import Container, Mapping
from dataclasses import asdict, dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from mbs.export.fmu.dependencies import Dependencies, Known, dependencies
from mbs.export.fmu.description import WITH_START, FmuEntry, FmuModel, State
from mbs.export.fmu.linearity import KINDS, DependencyKind
from mbs.export.fmu.names import is_structured
from mbs.units import UNITS
from mbs.version import __version__

_CAUSALITY = {"input": "input", "output": "output", "parameter": "parameter", "mode": "output"}
_VARIABILITY = {"parameter": "tunable", "mode": "discrete"}
_INITIAL = {
    "state": "exact",
    "derivative": "calculated",
    "output": "calculated",
    "parameter": "exact",
    "mode": "calculated",
    "dependent": "approx",
    "indicator": "calculated",
    "slot": "exact",
    "rate": "calculated",
    "chart": "calculated",
}
_NOTHING: Known = {}
TOOL = f"mbs {__version__}"
CATEGORIES = {
    "logAll": "all messages",
    "logStatusDiscard": "a step or an evaluation without an answer",
    "logStatusError": "calls that were refused",
}


@dataclass(frozen=True, slots=True)
class ModelStructure:
    """Which calculated values there are, and what they depend on; all by value references.

    That of time is the number of entries.

    Attributes:
        outputs: every output, states and modes among them.
        derivatives: of the states.
        indicators: of events.
        initial: what initialization calculates.
        running: what each output, derivative and indicator needs, without what is frozen between
            events: modes, which need nothing then, and fixed parameters.
        starting: likewise of `initial`, and how modes begin; only "constant" and "dependent".
        reset: the states that events set anew.
    """

    outputs: list[int]
    derivatives: list[int]
    indicators: list[int]
    initial: list[int]
    running: Mapping[int, Known]
    starting: Mapping[int, Known]
    reset: list[int]


def structure(model: FmuModel) -> ModelStructure:
    """The structure of a model."""
    found = dependencies(model)
    modes = range(model.first("mode"), model.first("dependent"))
    places = enumerate(model.parameters, start=model.first("parameter"))
    frozen = {*modes, *(ref for ref, parameter in places if parameter.fixed)}
    running: dict[int, Known] = {
        ref: _without(frozen, known) for ref, known in found.running.items()
    }
    shown = [k for k, state in enumerate(model.states) if state.output]
    running |= dict.fromkeys(modes, _NOTHING)
    reset = [k for k, known in found.jumping.items() if dict(known) != {k: "constant"}]
    running.update({k: {k: "constant"} for k in shown})
    starting = dict(found.running)
    if model.slots:
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
            *range(model.first("chart"), len(model.entries)),
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
    """Of derivatives of the states and of their indicator: all that moves derivatives of joints."""
    n, every = len(model.states), dict[int, DependencyKind]()
    for known in (running[n + k] for k in range(n)):
        every |= dict.fromkeys(known, KINDS[-1])
    return {ref: every for ref in (*model.derived, model.first("chart"))}


def _through_all(model: FmuModel, known: Known) -> Known:
    """Near singular configurations every state moves what one of the joints moves."""
    states, slots = range(len(model.states)), model.derived.values()
    if not any(ref in states for ref in known):
        return known
    rest = {ref: kind for ref, kind in known.items() if ref not in states}
    return dict(sorted((rest | dict.fromkeys(slots, KINDS[-1])).items()))


def _without(references: Container[int], known: Known) -> dict[int, DependencyKind]:
    return {ref: kind for ref, kind in known.items() if ref not in references}


def _starting(known: Known, found: Dependencies, modes: range, whole: bool) -> Known:
    """What a value depends on at the start, where modes stand for what finds them.

    An integer, such as a mode, is never said to be linear in something.
    """
    direct: dict[int, DependencyKind] = {
        ref: "constant" if kind == "constant" and not whole else "dependent"
        for ref, kind in known.items()
        if ref not in modes
    }
    for mode in (ref for ref in known if ref in modes):
        direct |= dict.fromkeys((ref for ref in found.first[mode] if ref not in modes), "dependent")
    return dict(sorted(direct.items()))


def texts(model: FmuModel) -> dict[str, str]:
    """What people read of a model: description, author, version, copyright and license."""
    said = {"description": model.description, **asdict(model.origin)}
    return {name: text for name, text in said.items() if text}


def naming_convention(model: FmuModel) -> str:
    """Whether names are paths such as `j1.q`, which tools show as a tree, or flat."""
    fits = all(is_structured(entry.variable.name) for entry in model.entries)
    return "structured" if fits else "flat"


def variable_attributes(reference: int, entry: FmuEntry) -> dict[str, str]:
    """Name, reference, causality, variability, description and initial of a variable."""
    v = entry.variable
    attributes = {
        "name": v.name,
        "valueReference": str(reference),
        "causality": _CAUSALITY.get(entry.kind, "local"),
        "variability": "fixed" if v.fixed else _VARIABILITY.get(entry.kind, "continuous"),
    }
    if v.description:
        attributes["description"] = v.description
    if isinstance(v, State) and v.output:
        attributes["causality"] = "output"
    if entry.kind in _INITIAL:
        attributes["initial"] = _INITIAL[entry.kind]
    return attributes


def real_attributes(entry: FmuEntry) -> dict[str, str]:
    """Units, bounds, nominal and start of a variable."""
    v = entry.variable
    real = {"unit": v.unit}
    display = UNITS[v.unit].display
    if display:
        real["displayUnit"] = display
    for name, bound in (("min", v.min), ("max", v.max)):
        if bound is not None and math.isfinite(bound):
            real[name] = repr(float(bound))
    real["nominal"] = repr(float(v.nominal))
    if entry.kind in WITH_START:
        real["start"] = repr(float(v.start))
    return real


def integer_attributes(entry: FmuEntry) -> dict[str, str]:
    """Bounds of a mode, which is an integer."""
    bounds = (("min", entry.variable.min), ("max", entry.variable.max))
    return {name: str(int(bound)) for name, bound in bounds if bound is not None}


def add_units(root: Element, model: FmuModel) -> None:
    """The definitions of all units that occur, by base units."""
    definitions = SubElement(root, "UnitDefinitions")
    for name in sorted({entry.variable.unit for entry in model.entries} | {"s"}):
        unit = UNITS[name]
        element = SubElement(definitions, "Unit", name=name)
        SubElement(element, "BaseUnit", {k: str(n) for k, n in unit.exponents.items() if n})
        if unit.display:
            factor = repr(unit.display_factor)
            SubElement(element, "DisplayUnit", name=unit.display, factor=factor)


def add_categories_and_experiment(root: Element, model: FmuModel) -> None:
    """The log categories, and how long, how exact and in which steps one simulates by default."""
    categories = SubElement(root, "LogCategories")
    for name, text in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=text)
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0",
        stopTime=repr(model.stop_time),
        tolerance=repr(model.tolerance),
        stepSize=repr(model.step_size),
    )


def text_of(root: Element) -> str:
    """An XML file."""
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
