"""What the model descriptions of FMI 2.0 and 3.0 have in common."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from mbs.export.fmu.dependencies import dependencies
from mbs.export.fmu.description import Entry, FmuModel, State
from mbs.units import UNITS

_CAUSALITY = {"input": "input", "output": "output", "parameter": "parameter", "mode": "output"}
_VARIABILITY = {"parameter": "tunable", "mode": "discrete"}
_INITIAL = {
    "state": "exact",
    "derivative": "calculated",
    "output": "calculated",
    "parameter": "exact",
    "mode": "calculated",
    "dependent": "approx",
}
_STARTS = ("state", "input", "parameter", "dependent")
CATEGORIES = {
    "logAll": "all messages",
    "logStatusDiscard": "a step or an evaluation without an answer",
    "logStatusError": "calls that were refused",
}


@dataclass(frozen=True, slots=True)
class Structure:
    """Which calculated values there are, and what they depend on; all by value references.

    That of time is the number of entries.

    Attributes:
        outputs: every output, states among them.
        derivatives: of the states.
        initial: what initialization calculates.
        running: states, inputs and time, where each output and derivative needs them.
        starting: likewise of `initial`, and parameters.
    """

    outputs: list[int]
    derivatives: list[int]
    initial: list[int]
    running: Mapping[int, list[int]]
    starting: Mapping[int, list[int]]


def structure(model: FmuModel) -> Structure:
    """The structure of a model."""
    n, fixed = len(model.states), range(model.first("parameter"), model.first("dependent"))
    starting = dict(dependencies(model))
    running = {ref: [r for r in known if r not in fixed] for ref, known in starting.items()}
    shown = [k for k, state in enumerate(model.states) if state.output]
    running.update({k: [k] for k in shown})
    calculated = list(range(model.first("output"), model.first("parameter")))
    derivatives = list(range(n, 2 * n))
    return Structure(shown + calculated, derivatives, derivatives + calculated, running, starting)


def variable_attributes(reference: int, entry: Entry) -> dict[str, str]:
    """Name, reference, causality, variability, description and initial of a variable."""
    v = entry.variable
    attributes = {
        "name": v.name,
        "valueReference": str(reference),
        "causality": _CAUSALITY.get(entry.kind, "local"),
        "variability": _VARIABILITY.get(entry.kind, "continuous"),
    }
    if v.description:
        attributes["description"] = v.description
    if isinstance(v, State) and v.output:
        attributes["causality"] = "output"
    if entry.kind in _INITIAL:
        attributes["initial"] = _INITIAL[entry.kind]
    return attributes


def real_attributes(entry: Entry) -> dict[str, str]:
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
    if entry.kind in _STARTS:
        real["start"] = repr(float(v.start))
    return real


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
