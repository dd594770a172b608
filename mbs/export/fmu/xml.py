"""modelDescription.xml, buildDescription.xml and terminalsAndIcons.xml of FMI 2.0 and 3.0."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from mbs.export.fmu.dependencies import (
    KINDS,
    DependencyKind,
    Known,
    ModelStructure,
    structure,
    without,
)
from mbs.export.fmu.description import (
    TIME,
    WITH_START,
    FmuEntry,
    FmuModel,
    FmuState,
    FmuVariable,
    is_structured,
)
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
    "cut": "approx",
}
_TOOL = f"mbs {__version__}"
_CATEGORIES = {
    "logAll": "all messages",
    "logStatusDiscard": "a step or an evaluation without an answer",
    "logStatusError": "calls that were refused",
}

_ABILITIES = {
    "2.0": {
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    },
    "3.0": {
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    },
}
_STEPPING = {
    "2.0": {
        "canHandleVariableCommunicationStepSize": "true",
        "canInterpolateInputs": "true",
        "maxOutputDerivativeOrder": "1",
    },
    "3.0": {
        "canHandleVariableCommunicationStepSize": "true",
        "maxOutputDerivativeOrder": "1",
        "providesIntermediateUpdate": "true",
        "mightReturnEarlyFromDoStep": "true",
        "canReturnEarlyAfterIntermediateUpdate": "true",
        "hasEventMode": "true",
    },
}
# the closure of loops and events need each accepted step; no step may pass the stop time
_EXCHANGE = {
    "2.0": {"completedIntegratorStepNotNeeded": "false"},
    "3.0": {"needsCompletedIntegratorStep": "true"},
}
_SEEN_WITHIN_STEPS = ("state", "derivative", "output", "rate")


def model_description(model: FmuModel, fmi: str, identity: str, sources: Sequence[str] = ()) -> str:
    """Return the text of the file modelDescription.xml.

    Args:
        model: description of the FMU.
        fmi: version of the standard, "2.0" or "3.0".
        identity: identifier that the compiled library checks.
        sources: names of the C files to compile, in the folder `sources`; used by FMI 2.0.
    """
    found = structure(model)
    fits = all(is_structured(entry.variable.name) for entry in model.entries)
    texts = {"description": model.description, **asdict(model.origin)}
    attributes = {
        "fmiVersion": fmi,
        "modelName": model.name,
        "guid" if fmi == "2.0" else "instantiationToken": identity,
        **{name: text for name, text in texts.items() if text},
        "generationTool": _TOOL,
        "variableNamingConvention": "structured" if fits else "flat",
    }
    if fmi == "2.0":
        attributes["numberOfEventIndicators"] = str(len(found.indicators))
    root = Element("fmiModelDescription", attributes)
    if model.target == "hosted":
        _interface(root, "ModelExchange", model, fmi, sources)
    _interface(root, "CoSimulation", model, fmi, sources)
    _units(root, model)
    _categories_and_experiment(root, model)
    _variables(root, model, found, fmi)
    parent = SubElement(root, "ModelStructure")
    (_structure_2 if fmi == "2.0" else _structure_3)(parent, model, found)
    return text_of(root)


def build_description(model: FmuModel, sources: Iterable[str]) -> str:
    """Return the text of the file buildDescription.xml of FMI 3.0, which lists the sources.

    Args:
        model: description of the FMU.
        sources: names of the C files to compile, in the folder `sources`.
    """
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=model.identifier)
    files = SubElement(build, "SourceFileSet", language="C99")
    for name in sources:
        SubElement(files, "SourceFile", name=name)
    return text_of(root)


def _interface(root: Element, tag: str, model: FmuModel, fmi: str, sources: Sequence[str]) -> None:
    attributes = {"modelIdentifier": model.identifier}
    if fmi == "2.0":
        hosted = str(model.target == "hosted").lower()
        attributes["canNotUseMemoryManagementFunctions"] = hosted
    attributes |= _ABILITIES[fmi] | (_STEPPING if tag == "CoSimulation" else _EXCHANGE)[fmi]
    if fmi == "3.0" and tag == "CoSimulation" and model.solver == "rk4":
        attributes["fixedInternalStepSize"] = repr(float(model.internal_step))
    interface = SubElement(root, tag, attributes)
    if fmi == "2.0":
        files = SubElement(interface, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)


def _variables(root: Element, model: FmuModel, found: ModelStructure, fmi: str) -> None:
    variables, derived = SubElement(root, "ModelVariables"), model.derived
    reset = _of_arrays(model, found.reset)
    for shown in _list_variables(model):
        reference, entry = shown.reference, shown.entry
        attributes, own = _attributes(reference, entry), _integer_attributes(entry)
        if entry.kind != "mode":
            own = _real_attributes(shown)
            if reference in derived:
                own["derivative"] = str(derived[reference] + _first(fmi))
            if reference in reset:
                own["reinit"] = "true"
        if fmi == "2.0":
            scalar = SubElement(variables, "ScalarVariable", attributes)
            SubElement(scalar, "Integer" if entry.kind == "mode" else "Real", own)
            continue
        if entry.kind in _SEEN_WITHIN_STEPS:
            own["intermediateUpdate"] = "true"
        kind = "Int32" if entry.kind == "mode" else "Float64"
        variable = SubElement(variables, kind, attributes | own)
        if shown.array:
            SubElement(variable, "Dimension", start=str(len(shown.elements)))
    if fmi == "3.0":
        SubElement(
            variables,
            "Float64",
            name=TIME,
            valueReference=str(len(model.entries)),
            causality="independent",
            variability="continuous",
            unit="s",
            description="time",
        )


def _first(fmi: str) -> int:
    """Return the number of the variable with value reference 0: FMI 2.0 counts from 1."""
    return 1 if fmi == "2.0" else 0


def _structure_2(parent: Element, model: FmuModel, found: ModelStructure) -> None:
    """Append outputs, derivatives and initial unknowns.

    Parameters, which are constant in a run, and time are left out: FMI 2.0 assumes that all values
    depend on time if no variable is the time.
    """
    time = len(model.entries)
    fixed = (*range(model.first("parameter"), model.first("mode")), time)
    for tag, references, depends, constant in (
        ("Outputs", found.outputs, found.running, fixed),
        ("Derivatives", found.derivatives, found.running, fixed),
        ("InitialUnknowns", found.initial, found.starting, (time,)),
    ):
        if references:
            group = SubElement(parent, tag)
            for reference in references:
                known = without(constant, depends[reference])
                _unknown(group, "Unknown", "index", (reference, known), "2.0")


def _structure_3(parent: Element, model: FmuModel, found: ModelStructure) -> None:
    running = _dependencies_of_arrays(model, found.running)
    starting = _dependencies_of_arrays(model, found.starting)
    for tag, references, depends in (
        ("Output", found.outputs, running),
        ("ContinuousStateDerivative", found.derivatives, running),
        ("InitialUnknown", found.initial, starting),
        ("EventIndicator", found.indicators, running),
    ):
        for reference in _of_arrays(model, references):
            _unknown(parent, tag, "valueReference", (reference, depends[reference]), "3.0")


def _unknown(parent: Element, tag: str, key: str, unknown: tuple[int, Known], fmi: str) -> None:
    (reference, known), first = unknown, _first(fmi)
    attributes = {
        key: str(reference + first),
        "dependencies": " ".join(str(k + first) for k in known),
        "dependenciesKind": " ".join(known.values()),
    }
    SubElement(parent, tag, attributes)


def _attributes(reference: int, entry: FmuEntry) -> dict[str, str]:
    """Return name, reference, causality, variability, description and initial of a variable."""
    v = entry.variable
    attributes = {
        "name": v.name,
        "valueReference": str(reference),
        "causality": _CAUSALITY.get(entry.kind, "local"),
        "variability": "fixed" if v.fixed else _VARIABILITY.get(entry.kind, "continuous"),
    }
    if v.description:
        attributes["description"] = v.description
    if isinstance(v, FmuState) and v.output:
        attributes["causality"] = "output"
    if entry.kind in _INITIAL:
        attributes["initial"] = "approx" if v.guess else _INITIAL[entry.kind]
    return attributes


def _real_attributes(shown: _Listed) -> dict[str, str]:
    """Return the XML attributes unit, bounds, nominal and start of a variable."""
    v, real = shown.entry.variable, dict[str, str]()
    if shown.united:
        real["unit"] = v.unit
        display = UNITS[v.unit].display
        if display:
            real["displayUnit"] = display
    for name, bound in (("min", v.min), ("max", v.max)):
        if bound is not None and math.isfinite(bound):
            real[name] = repr(float(bound))
    real["nominal"] = repr(float(v.nominal))
    if shown.entry.kind in WITH_START or v.guess:
        real["start"] = shown.start
    return real


def _integer_attributes(entry: FmuEntry) -> dict[str, str]:
    """Return the XML attributes min and max of a mode, which is an integer."""
    bounds = (("min", entry.variable.min), ("max", entry.variable.max))
    return {name: str(int(bound)) for name, bound in bounds if bound is not None}


def _units(root: Element, model: FmuModel) -> None:
    """Append the definitions, by base units, of all units that occur in the model."""
    definitions = SubElement(root, "UnitDefinitions")
    for name in sorted({entry.variable.unit for entry in model.entries} | {"s"}):
        unit = UNITS[name]
        element = SubElement(definitions, "Unit", name=name)
        SubElement(element, "BaseUnit", {k: str(n) for k, n in unit.exponents.items() if n})
        if unit.display:
            factor = repr(unit.display_factor)
            SubElement(element, "DisplayUnit", name=unit.display, factor=factor)


def _categories_and_experiment(root: Element, model: FmuModel) -> None:
    """Append the log categories, and the times and tolerance of the default experiment."""
    categories = SubElement(root, "LogCategories")
    for name, text in _CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=text)
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0",
        stopTime=repr(model.stop_time),
        tolerance=repr(model.tolerance),
        stepSize=repr(model.step_size),
    )


# Array variables of FMI 3.0.


@dataclass(frozen=True, slots=True)
class _Listed:
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


def _list_variables(model: FmuModel) -> list[_Listed]:
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
        found.append(_Listed(place, entry, elements, array is not None))
        place += size
    return found


def _of_arrays(model: FmuModel, references: Iterable[int]) -> list[int]:
    """Replace value references of array elements by that of their array, without duplicates."""
    owner = _owners(model)
    return list(dict.fromkeys(owner.get(reference, reference) for reference in references))


def _dependencies_of_arrays(model: FmuModel, known: Mapping[int, Known]) -> dict[int, Known]:
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


def text_of(root: Element) -> str:
    """Return the indented text of an XML file with this root element."""
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


# terminalsAndIcons.xml of FMI 3.0: terminals (variables that are connected together) and the icon.


_EXTENT = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}


def terminals_and_icons(model: FmuModel) -> str:
    """Return the text of the file terminalsAndIcons.xml.

    Args:
        model: description of the FMU.

    Returns:
        Text of the XML file.
    """
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    if model.about is not None and model.about.drawing is not None:
        graphics = SubElement(root, "GraphicalRepresentation")
        SubElement(graphics, "CoordinateSystem", _EXTENT, suggestedScalingFactorTo_mm="0.1")
        SubElement(graphics, "Icon", _EXTENT)
    if model.terminals:
        group = SubElement(root, "Terminals")
    for terminal in model.terminals:
        element = SubElement(
            group,
            "Terminal",
            name=terminal.name,
            matchingRule=terminal.matching,
            terminalKind=terminal.kind,
        )
        if terminal.description:
            element.set("description", terminal.description)
        for member in terminal.members:
            SubElement(
                element,
                "TerminalMemberVariable",
                variableName=member.variable,
                memberName=member.name,
                variableKind=member.kind,
            )
    return text_of(root)
