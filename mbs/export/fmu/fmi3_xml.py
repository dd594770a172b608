"""modelDescription.xml and buildDescription.xml of FMI 3.0."""

from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, SubElement

from mbs.export.fmu.arrays import dependencies_of_arrays, list_variables, of_arrays
from mbs.export.fmu.description import TIME, FmuModel
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
    "maxOutputDerivativeOrder": "1",
    "providesIntermediateUpdate": "true",
    "mightReturnEarlyFromDoStep": "true",
    "canReturnEarlyAfterIntermediateUpdate": "true",
    "hasEventMode": "true",
}

_SEEN_WITHIN_STEPS = ("state", "derivative", "output", "rate")


def model_description(model: FmuModel, token: str) -> str:
    """Return the text of the file modelDescription.xml of FMI 3.0.

    Args:
        model: description of the FMU.
        token: instantiation token that the compiled library checks.

    Returns:
        Text of the XML file.
    """
    attributes = {
        "fmiVersion": "3.0",
        "modelName": model.name,
        "instantiationToken": token,
        **texts(model),
        "generationTool": TOOL,
        "variableNamingConvention": naming_convention(model),
    }
    root = Element("fmiModelDescription", attributes)
    if model.target == "hosted":
        _interface(root, "ModelExchange", model)
    _interface(root, "CoSimulation", model)
    add_units(root, model)
    add_categories_and_experiment(root, model)
    found = structure(model)
    _variables(root, model, found)
    parent = SubElement(root, "ModelStructure")
    running = dependencies_of_arrays(model, found.running)
    starting = dependencies_of_arrays(model, found.starting)
    for tag, references, depends in (
        ("Output", found.outputs, running),
        ("ContinuousStateDerivative", found.derivatives, running),
        ("InitialUnknown", found.initial, starting),
        ("EventIndicator", found.indicators, running),
    ):
        _unknowns(parent, tag, of_arrays(model, references), depends)
    return text_of(root)


def build_description(model: FmuModel, sources: Iterable[str]) -> str:
    """Return the text of the file buildDescription.xml, which lists the sources to compile.

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


def _interface(root: Element, tag: str, model: FmuModel) -> None:
    attributes = {
        "modelIdentifier": model.identifier,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    }
    if tag == "CoSimulation":
        attributes |= _STEPPING
        if model.solver == "rk4":
            attributes["fixedInternalStepSize"] = repr(float(model.internal_step))
    else:  # the closure of loops and events need each accepted step; no step may pass the stop time
        attributes["needsCompletedIntegratorStep"] = "true"
    SubElement(root, tag, attributes)


def _variables(root: Element, model: FmuModel, found: ModelStructure) -> None:
    variables, derived = SubElement(root, "ModelVariables"), model.derived
    reset = of_arrays(model, found.reset)
    for shown in list_variables(model):
        reference, entry = shown.reference, shown.entry
        attributes = variable_attributes(reference, entry)
        if entry.kind == "mode":
            SubElement(variables, "Int32", attributes | integer_attributes(entry))
            continue
        attributes |= real_attributes(entry)
        if "start" in attributes:
            attributes["start"] = shown.start
        if not shown.united:
            attributes = {k: v for k, v in attributes.items() if k not in ("unit", "displayUnit")}
        if reference in derived:
            attributes["derivative"] = str(derived[reference])
        if reference in reset:
            attributes["reinit"] = "true"
        if entry.kind in _SEEN_WITHIN_STEPS:
            attributes["intermediateUpdate"] = "true"
        variable = SubElement(variables, "Float64", attributes)
        if shown.array:
            SubElement(variable, "Dimension", start=str(len(shown.elements)))
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


def _unknowns(
    parent: Element, tag: str, references: list[int], depends: Mapping[int, Known]
) -> None:
    for reference in references:
        known = depends[reference]
        SubElement(
            parent,
            tag,
            valueReference=str(reference),
            dependencies=" ".join(str(k) for k in known),
            dependenciesKind=" ".join(known.values()),
        )
