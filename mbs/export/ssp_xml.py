"""SystemStructure.ssd of SSP 1.0: components, connectors, connections, start values, units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

_SPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
}
START_SET = "initialValues"
"""Name of the set of start values, one in each component, as tools of co-simulation name it."""

_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_INTEGERS = frozenset(
    ("Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)))
)
_KINDS = {"Real": "Real", "Float64": "Real", "Float32": "Real", "Boolean": "Boolean"} | {
    "String": "String",
    **dict.fromkeys(_INTEGERS, "Integer"),
}


@dataclass(frozen=True, slots=True)
class SspPart:
    """A component of a system structure.

    Attributes:
        name: of the component.
        source: its FMU in the archive, such as `resources/robot.fmu`.
        description: the model description of the FMU, as fmpy reads it.
        start: variable to its value before initialization.
    """

    name: str
    source: str
    description: Any
    start: Mapping[str, float]

    @property
    def variables(self) -> dict[str, Any]:
        """Every variable of the FMU by its name."""
        return {v.name: v for v in self.description.modelVariables}


@dataclass(frozen=True, slots=True)
class Connection:
    """A value that one component gives to another.

    Attributes:
        source: component and output.
        target: component and input.
    """

    source: tuple[str, str]
    target: tuple[str, str]


def ssp_kind(variable: Any) -> str | None:
    """The type of a connector for a variable; None where SSP 1.0 has none for it."""
    return None if getattr(variable, "dimensions", None) else _KINDS.get(variable.type)


def unit_of(variable: Any) -> str | None:
    """The name of the unit of a variable, which its type may declare; None without one."""
    declared = variable.declaredType
    unit = variable.unit or (None if declared is None else declared.unit)
    return unit if ssp_kind(variable) == "Real" and unit else None


def unit_exponents(description: Any, name: str) -> dict[str, str] | None:
    """The attributes of a unit's BaseUnit in an FMU; None where it does not define the unit."""
    for unit in description.unitDefinitions:
        if unit.name == name and unit.baseUnit is not None:
            base = unit.baseUnit
            found = {k: str(int(getattr(base, k))) for k in _BASE if int(getattr(base, k) or 0)}
            scales = (("factor", base.factor, 1.0), ("offset", base.offset, 0.0))
            found |= {k: repr(float(x)) for k, x, plain in scales if float(x) != plain}
            return found
    return None


def structure_description(
    name: str,
    parts: Iterable[SspPart],
    connections: Iterable[Connection],
    span: tuple[float, float],
) -> str:
    """The file SystemStructure.ssd.

    Args:
        name: of the system.
        parts: its components.
        connections: between them.
        span: default start and end of a simulation [s].

    Returns:
        its text.
    """
    for prefix, space in _SPACES.items():
        register_namespace(prefix, space)
    listed = list(parts)
    root = Element(_tag("ssd:SystemStructureDescription"), version="1.0", name=name)
    root.set("generationTool", "mbs")
    system = SubElement(root, _tag("ssd:System"), name=name)
    elements = SubElement(system, _tag("ssd:Elements"))
    for part in listed:
        _component(elements, part)
    _connections(system, list(connections))
    units = _units(listed)
    if units:
        _add_units(SubElement(root, _tag("ssd:Units")), units)
    start, stop = (repr(float(t)) for t in span)
    SubElement(root, _tag("ssd:DefaultExperiment"), startTime=start, stopTime=stop)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _tag(name: str) -> str:
    prefix, local = name.split(":")
    return f"{{{_SPACES[prefix]}}}{local}"


def _component(parent: Element, part: SspPart) -> None:
    element = SubElement(
        parent,
        _tag("ssd:Component"),
        name=part.name,
        type="application/x-fmu-sharedlibrary",
        source=part.source,
        implementation="CoSimulation",
    )
    if part.description.description:
        element.set("description", part.description.description)
    shown = [v for v in part.variables.values() if v.causality in ("input", "output")]
    connectors = [v for v in shown if ssp_kind(v)]
    if connectors:
        group = SubElement(element, _tag("ssd:Connectors"))
        for variable in connectors:
            _connector(group, variable)
    if part.start:
        _bindings(element, part)


def _connector(parent: Element, variable: Any) -> None:
    connector = SubElement(
        parent, _tag("ssd:Connector"), name=variable.name, kind=variable.causality
    )
    if variable.description:
        connector.set("description", variable.description)
    kind = SubElement(connector, _tag(f"ssc:{ssp_kind(variable)}"))
    unit = unit_of(variable)
    if unit:
        kind.set("unit", unit)


def _bindings(parent: Element, part: SspPart) -> None:
    bindings = SubElement(parent, _tag("ssd:ParameterBindings"))
    binding = SubElement(
        bindings, _tag("ssd:ParameterBinding"), type="application/x-ssp-parameter-set"
    )
    values = SubElement(binding, _tag("ssd:ParameterValues"))
    given = SubElement(values, _tag("ssv:ParameterSet"), version="1.0", name=START_SET)
    group = SubElement(given, _tag("ssv:Parameters"))
    for name, value in part.start.items():
        kind = ssp_kind(part.variables[name])
        entry = SubElement(group, _tag("ssv:Parameter"), name=name)
        texts = {"Real": repr(float(value)), "Boolean": "true" if value else "false"}
        SubElement(entry, _tag(f"ssv:{kind}"), value=texts.get(str(kind), str(int(value))))


def _connections(parent: Element, connections: list[Connection]) -> None:
    if not connections:
        return
    group = SubElement(parent, _tag("ssd:Connections"))
    for link in connections:
        SubElement(
            group,
            _tag("ssd:Connection"),
            startElement=link.source[0],
            startConnector=link.source[1],
            endElement=link.target[0],
            endConnector=link.target[1],
        )


def _units(parts: list[SspPart]) -> dict[str, dict[str, str]]:
    """Every unit of a connector, and the attributes of its BaseUnit."""
    return {
        unit: unit_exponents(part.description, unit) or {}
        for part in parts
        for variable in part.variables.values()
        if variable.causality in ("input", "output") and (unit := unit_of(variable))
    }


def _add_units(parent: Element, units: Mapping[str, Mapping[str, str]]) -> None:
    for name in sorted(units):
        element = SubElement(parent, _tag("ssc:Unit"), name=name)
        SubElement(element, _tag("ssc:BaseUnit"), dict(units[name]))
