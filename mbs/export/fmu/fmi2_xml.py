"""modelDescription.xml of FMI 2.0."""

from collections.abc import Iterable, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

from mbs.export.fmu.description import FmuModel
from mbs.export.fmu.xml import (
    TOOL,
    Known,
    ModelStructure,
    add_categories_and_experiment,
    add_units,
    integer_attributes,
    naming_convention,
    real_attributes,
    structure,
    text_of,
    texts,
    variable_attributes,
)

_STEPPING = {
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "true",
    "maxOutputDerivativeOrder": "1",
}


def model_description(model: FmuModel, guid: str, sources: Iterable[str]) -> str:
    """Return the text of the file modelDescription.xml of FMI 2.0.

    Args:
        model: description of the FMU.
        guid: identifier that the compiled library checks.
        sources: names of the C files to compile, in the folder `sources`.

    Returns:
        Text of the XML file.
    """
    found = structure(model)
    attributes = {
        "fmiVersion": "2.0",
        "modelName": model.name,
        "guid": guid,
        **texts(model),
        "generationTool": TOOL,
        "variableNamingConvention": naming_convention(model),
        "numberOfEventIndicators": str(len(found.indicators)),
    }
    root = Element("fmiModelDescription", attributes)
    files = list(sources)
    if model.target == "hosted":
        _interface(root, "ModelExchange", model, files)
    _interface(root, "CoSimulation", model, files)
    add_units(root, model)
    add_categories_and_experiment(root, model)
    variables, derived = SubElement(root, "ModelVariables"), model.derived
    for reference, entry in enumerate(model.entries):
        scalar = SubElement(variables, "ScalarVariable", variable_attributes(reference, entry))
        if entry.kind == "mode":
            SubElement(scalar, "Integer", integer_attributes(entry))
            continue
        real = real_attributes(entry)
        if reference in derived:
            real["derivative"] = str(derived[reference] + 1)
        if reference in found.reset:
            real["reinit"] = "true"
        SubElement(scalar, "Real", real)
    _structure(root, model, found)
    return text_of(root)


def _interface(root: Element, tag: str, model: FmuModel, files: list[str]) -> None:
    attributes = {
        "modelIdentifier": model.identifier,
        "canNotUseMemoryManagementFunctions": str(model.target == "hosted").lower(),
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    if tag == "CoSimulation":
        attributes |= _STEPPING
    else:  # the closure of loops and events need each accepted step; no step may pass the stop time
        attributes["completedIntegratorStepNotNeeded"] = "false"
    listed = SubElement(SubElement(root, tag, attributes), "SourceFiles")
    for name in files:
        SubElement(listed, "File", name=name)


def _structure(root: Element, model: FmuModel, found: ModelStructure) -> None:
    fixed = range(model.first("parameter"), model.first("mode"))
    time = len(model.entries)
    running = {ref: _without((*fixed, time), known) for ref, known in found.running.items()}
    starting = {ref: _without((time,), known) for ref, known in found.starting.items()}
    parent = SubElement(root, "ModelStructure")
    _unknowns(parent, "Outputs", found.outputs, running)
    _unknowns(parent, "Derivatives", found.derivatives, running)
    _unknowns(parent, "InitialUnknowns", found.initial, starting)


def _without(references: Sequence[int], known: Known) -> Known:
    """Remove references, such as parameters, which are constant in a run, and time.

    FMI 2.0 assumes that all values depend on time if no variable is the time.
    """
    return {ref: kind for ref, kind in known.items() if ref not in references}


def _unknowns(
    parent: Element, tag: str, references: list[int], depends: Mapping[int, Known]
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
            dependenciesKind=" ".join(known.values()),
        )
