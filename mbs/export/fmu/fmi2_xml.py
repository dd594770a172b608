"""modelDescription.xml of FMI 2.0."""

from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, SubElement

from mbs.export.fmu.description import FmuModel
from mbs.export.fmu.xml_parts import (
    add_categories_and_experiment,
    add_units,
    real_attributes,
    structure,
    text_of,
    variable_attributes,
)


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
    add_units(root, model)
    add_categories_and_experiment(root, model)
    variables = SubElement(root, "ModelVariables")
    for reference, entry in enumerate(model.entries):
        real = real_attributes(entry)
        if entry.kind == "derivative":
            real["derivative"] = str(reference - len(model.states) + 1)
        scalar = SubElement(variables, "ScalarVariable", variable_attributes(reference, entry))
        SubElement(scalar, "Real", real)
    _structure(root, model)
    return text_of(root)


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


def _structure(root: Element, model: FmuModel) -> None:
    found, time = structure(model), len(model.entries)
    running, starting = (_without(time, known) for known in (found.running, found.starting))
    parent = SubElement(root, "ModelStructure")
    _unknowns(parent, "Outputs", found.outputs, running)
    _unknowns(parent, "Derivatives", found.derivatives, running)
    _unknowns(parent, "InitialUnknowns", found.initial, starting)


def _without(time: int, known: Mapping[int, list[int]]) -> dict[int, list[int]]:
    """No variable is time: the standard then takes it that everything depends on it."""
    return {ref: [r for r in references if r != time] for ref, references in known.items()}


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
