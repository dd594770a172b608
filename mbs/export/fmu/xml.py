"""modelDescription.xml of FMI 2.0."""

import math
from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from mbs.export.fmu.dependencies import dependencies
from mbs.export.fmu.description import Entry, FmuModel, State
from mbs.units import UNITS

_CAUSALITY = {"input": "input", "output": "output", "parameter": "parameter"}
_INITIAL = {
    "state": "exact",
    "derivative": "calculated",
    "output": "calculated",
    "parameter": "exact",
    "dependent": "approx",
}
_STARTS = ("state", "input", "parameter", "dependent")
CATEGORIES = {
    "logAll": "all messages",
    "logStatusDiscard": "a step or an evaluation without an answer",
    "logStatusError": "calls that were refused",
}


def model_description(model: FmuModel, guid: str, sources: Iterable[str]) -> str:
    """The file modelDescription.xml.

    Args:
        model: what the FMU is.
        guid: identity of the library that belongs to it.
        sources: C files to compile, in the folder `sources`.

    Returns:
        its text.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model.name,
        guid=guid,
        description=model.description,
        generationTool="mbs",
        variableNamingConvention="flat",
        numberOfEventIndicators="0",
    )
    files = list(sources)
    _interface(root, "ModelExchange", model, files)
    _interface(root, "CoSimulation", model, files)
    _units(root, model)
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
    variables = SubElement(root, "ModelVariables")
    for reference, entry in enumerate(model.entries):
        _variable(variables, model, reference, entry)
    _structure(root, model)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _interface(root: Element, tag: str, model: FmuModel, files: list[str]) -> None:
    attributes = {
        "modelIdentifier": model.identifier,
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    if tag == "CoSimulation":
        attributes["canHandleVariableCommunicationStepSize"] = "true"
    else:
        attributes["completedIntegratorStepNotNeeded"] = "false" if model.dependents else "true"
    listed = SubElement(SubElement(root, tag, attributes), "SourceFiles")
    for name in files:
        SubElement(listed, "File", name=name)


def _units(root: Element, model: FmuModel) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for name in sorted({entry.variable.unit for entry in model.entries} | {"s"}):
        unit = UNITS[name]
        element = SubElement(definitions, "Unit", name=name)
        SubElement(element, "BaseUnit", {k: str(n) for k, n in unit.exponents.items() if n})
        if unit.display:
            factor = repr(unit.display_factor)
            SubElement(element, "DisplayUnit", name=unit.display, factor=factor)


def _variable(parent: Element, model: FmuModel, reference: int, entry: Entry) -> None:
    v = entry.variable
    attributes = {
        "name": v.name,
        "valueReference": str(reference),
        "causality": _CAUSALITY.get(entry.kind, "local"),
        "variability": "tunable" if entry.kind == "parameter" else "continuous",
    }
    if v.description:
        attributes["description"] = v.description
    if isinstance(v, State) and v.output:
        attributes["causality"] = "output"
    if entry.kind in _INITIAL:
        attributes["initial"] = _INITIAL[entry.kind]
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
    if entry.kind == "derivative":
        real["derivative"] = str(reference - len(model.states) + 1)
    SubElement(SubElement(parent, "ScalarVariable", attributes), "Real", real)


def _structure(root: Element, model: FmuModel) -> None:
    n = len(model.states)
    depends = dependencies(model)
    running = {ref: [r for r in known if r < model.first("parameter")] for ref, known in depends}
    starting = dict(depends)
    outputs = [k for k, state in enumerate(model.states) if state.output]
    calculated = list(range(model.first("output"), model.first("parameter")))
    derivatives = list(range(n, 2 * n))
    running.update({k: [k] for k in outputs})
    structure = SubElement(root, "ModelStructure")
    _unknowns(structure, "Outputs", outputs + calculated, running)
    _unknowns(structure, "Derivatives", derivatives, running)
    _unknowns(structure, "InitialUnknowns", derivatives + calculated, starting)


def _unknowns(
    parent: Element, tag: str, references: list[int], depends: Mapping[int, list[int]]
) -> None:
    if not references:
        return
    group = SubElement(parent, tag)
    for reference in references:
        known = depends[reference]
        SubElement(
            group,
            "Unknown",
            index=str(reference + 1),
            dependencies=" ".join(str(k + 1) for k in known),
            dependenciesKind=" ".join("dependent" for _ in known),
        )
