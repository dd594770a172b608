"""Export of connected FMUs as an SSP file (System Structure and Parameterization 1.0)."""

from __future__ import annotations

import io
import math
import os
import re
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from mbs.errors import ExportError
from mbs.files import check_archive, path_of, write_bytes
from mbs.text import did_you_mean, quoted

# SystemStructure.ssd of SSP 1.0: components, connectors, connections, start values, units.


_SPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
}
START_SET = "initialValues"
"""Name of the set of start values in each component, as in other co-simulation tools."""

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
    """Component of a system structure.

    Attributes:
        name: name of the component.
        source: path of its FMU in the archive, such as `resources/robot.fmu`.
        description: model description of the FMU, as read by fmpy.
        start: dict from variable name to its value before initialization.
    """

    name: str
    source: str
    description: Any
    start: Mapping[str, float]

    @property
    def variables(self) -> dict[str, Any]:
        """Dict from name to variable of the FMU."""
        return {v.name: v for v in self.description.modelVariables}


@dataclass(frozen=True, slots=True)
class Connection:
    """Connection from an output of a component to an input of a component.

    Attributes:
        source: names of component and output.
        target: names of component and input.
    """

    source: tuple[str, str]
    target: tuple[str, str]


def ssp_kind(variable: Any) -> str | None:
    """Return the connector type of a variable, such as "Real"; None if SSP 1.0 has no such type.

    Args:
        variable: variable of an FMU, as read by fmpy.
    """
    return None if getattr(variable, "dimensions", None) else _KINDS.get(variable.type)


def unit_of(variable: Any) -> str | None:
    """Return the unit name of a real variable, or of its declared type; None without a unit.

    Args:
        variable: variable of an FMU, as read by fmpy.
    """
    declared = variable.declaredType
    unit = variable.unit or (None if declared is None else declared.unit)
    return unit if ssp_kind(variable) == "Real" and unit else None


def unit_exponents(description: Any, name: str) -> dict[str, str] | None:
    """Return the BaseUnit attributes of a unit in an FMU, or None if the unit is not defined.

    Args:
        description: model description of the FMU, as read by fmpy.
        name: name of the unit.
    """
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
    """Return the text of the file SystemStructure.ssd.

    Args:
        name: name of the system.
        parts: components of the system.
        connections: connections of the components.
        span: default start and end of a simulation [s].

    Returns:
        Text of the XML file.
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
    _write_connections(system, list(connections))
    units = _units(listed)
    if units:
        _add_units(SubElement(root, _tag("ssd:Units")), units)
    start, stop = (repr(float(t)) for t in span)
    SubElement(root, _tag("ssd:DefaultExperiment"), startTime=start, stopTime=stop)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _tag(name: str) -> str:
    """Return the full XML name of "prefix:name"."""
    prefix, local = name.split(":")
    return f"{{{_SPACES[prefix]}}}{local}"


def _component(parent: Element, part: SspPart) -> None:
    """Append a component with its connectors and start values to the XML element `parent`."""
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
    """Append a connector of a variable with its type and unit."""
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
    """Append the start values of a component to its XML element `parent`."""
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


def _write_connections(parent: Element, connections: list[Connection]) -> None:
    """Append the connections of the system."""
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
    """Return the BaseUnit attributes of the units of all connectors, by unit name."""
    return {
        unit: unit_exponents(part.description, unit) or {}
        for part in parts
        for variable in part.variables.values()
        if variable.causality in ("input", "output") and (unit := unit_of(variable))
    }


def _add_units(parent: Element, units: Mapping[str, Mapping[str, str]]) -> None:
    """Append the definitions of units."""
    for name in sorted(units):
        element = SubElement(parent, _tag("ssc:Unit"), name=name)
        SubElement(element, _tag("ssc:BaseUnit"), dict(units[name]))


Components = Mapping[str, str | os.PathLike[str]] | Sequence[str | os.PathLike[str]]

_EPOCH = (1980, 1, 1, 0, 0, 0)  # date of all files, so that equal systems give equal archives


def ssp(
    path: str | os.PathLike[str],
    components: Components,
    connections: Iterable[tuple[str, str]] = (),
    *,
    start: Mapping[str, float] | None = None,
    name: str | None = None,
    stop_time: float | None = None,
) -> Path:
    """Write FMUs and their connections as an SSP file for co-simulation tools.

    Every input and output becomes a connector with its unit. Variables are named
    `component.variable`, such as `robot.j1.tau`. The name of a component has no dot.

    Args:
        path: file to write, such as cell.ssp. An existing file is replaced only if the export
            succeeds.
        components: dict from the name of each component to the path of its FMU (FMI 2.0 or 3.0 with
            co-simulation). Or list of paths, whose file names are the names of the components.
        connections: (output, input) pairs, such as ("controller.tau1", "robot.j1.tau").
        start: values of parameters, inputs and states before initialization, in the units of the
            FMUs.
        name: name of the system. By default the name of the file.
        stop_time: default end of a simulation [s]. By default the latest stop time of the FMUs.

    Returns:
        Path of the file.

    Raises:
        ExportError: a file cannot be read or written, an FMU has no co-simulation, a name is
            unknown, an input has two sources, or the two ends of a connection do not fit.
    """
    target = path_of(path)
    files = _files(components)
    contents = {part: _content(part, file) for part, file in files.items()}
    sources = _sources(files, contents)
    described = {part: _describe(part, file) for part, file in files.items()}
    values = _start_values(described, start or {})
    parts = {
        part: SspPart(part, sources[part], described[part], values.get(part, {})) for part in files
    }
    links = _connections(parts, connections)
    title = target.stem if name is None else name
    text = structure_description(title, parts.values(), links, _span(parts.values(), stop_time))
    archive = {sources[part]: content for part, content in contents.items()}
    write_bytes(_zip({"SystemStructure.ssd": text.encode(), **archive}), target)
    return target


def _files(components: Any) -> dict[str, Path]:
    """Return the path of the FMU of each component; raise an ExportError for invalid names."""
    if not isinstance(components, Iterable):
        raise ExportError(f"SSP: components is {quoted(components)}; give a dict of names to paths")
    if isinstance(components, Mapping):
        named = [(str(name), path_of(file)) for name, file in components.items()]
    else:
        given = [components] if isinstance(components, (str, os.PathLike)) else components
        paths = [path_of(file) for file in given]
        named = [(file.stem, file) for file in paths]
    if not named:
        raise ExportError("SSP: there is no component; give the path of one FMU at least")
    found: dict[str, Path] = {}
    for name, file in named:
        if not name or "." in name or not name.isprintable():
            raise ExportError(
                f"SSP: {quoted(name)} is no name of a component; give a dict of names without dots"
                " to paths"
            )
        if name in found:
            raise ExportError(
                f"SSP: two components are called {name!r}; give a dict of names to paths"
            )
        found[name] = file
    return found


def _content(part: str, file: Path) -> bytes:
    """Return the content of an FMU file; raise an ExportError if it cannot be read."""
    try:
        return file.read_bytes()
    except OSError as error:
        raise ExportError(
            f"SSP: the FMU {file} of {part} cannot be read ({error.strerror}); write it by"
            " mbs.export.fmu"
        ) from error


def _describe(part: str, file: Path) -> Any:
    """Return the model description of an FMU, as read by fmpy.

    Raise an ExportError if the file is not an FMU with co-simulation of FMI 2.0 or 3.0.
    """
    import fmpy

    try:
        check_archive(file)
        description = fmpy.read_model_description(str(file), validate=False)
    except Exception as error:
        problem = " ".join(str(error).split())
        raise ExportError(f"SSP: {file} of {part} is not an FMU: {problem}") from error
    if description.fmiVersion[0] not in "23" or description.coSimulation is None:
        raise ExportError(
            f"SSP: {file} of {part} is an FMU without co-simulation of FMI 2.0 or 3.0; export it"
            " with it"
        )
    return description


def _sources(files: Mapping[str, Path], contents: Mapping[str, bytes]) -> dict[str, str]:
    """Return the path in the archive of the FMU of each component; equal FMUs share a path.

    `files` are the paths of the FMUs, `contents` their contents, by component.
    """
    paths: dict[bytes, str] = {}
    for part, file in files.items():
        if contents[part] not in paths:
            stem = re.sub(r"[^A-Za-z0-9_-]", "_", file.stem)
            plain = f"resources/{stem}.fmu"
            taken = plain in paths.values()
            paths[contents[part]] = f"resources/{stem}_{len(paths)}.fmu" if taken else plain
    return {part: paths[contents[part]] for part in files}


def _start_values(
    described: Mapping[str, Any], start: Mapping[str, float]
) -> dict[str, dict[str, float]]:
    """Return the start values of each component, by variable name.

    Raise an ExportError if a variable is unknown or cannot be set, or a value is not finite.
    """
    found: dict[str, dict[str, float]] = {}
    for address, value in start.items():
        part, variable = _variable(described, "start", address)
        if not _settable(variable):
            raise ExportError(
                f"SSP: start: {address} is calculated and cannot be set; give parameters, inputs or"
                " states"
            )
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            raise ExportError(f"SSP: start: {address} is {quoted(value)}; give a finite number")
        found.setdefault(part, {})[variable.name] = value
    return found


def _settable(variable: Any) -> bool:
    """Whether the value of a variable can be set before initialization."""
    if ssp_kind(variable) in (None, "String") or variable.variability == "constant":
        return False
    return variable.causality == "input" or variable.initial in ("exact", "approx")


def _variable(described: Mapping[str, Any], what: str, address: object) -> tuple[str, Any]:
    """Return component name and variable of an address such as `robot.j1.tau`.

    `described` are the model descriptions of the components, `what` is for error messages. Raise an
    ExportError if there is no such variable.
    """
    part, dot, name = address.partition(".") if isinstance(address, str) else ("", "", "")
    if not dot:
        raise ExportError(
            f"SSP: {what}: {quoted(address)} is no variable; write component.variable"
        )
    if part not in described:
        raise ExportError(
            f"SSP: {what}: {address!r}: there is no component {part!r};"
            f" {did_you_mean(part, described)}"
        )
    variables = {v.name: v for v in described[part].modelVariables}
    if name not in variables:
        raise ExportError(
            f"SSP: {what}: {part} has no variable {name!r}; {did_you_mean(name, variables)}"
        )
    return part, variables[name]


def _connections(
    parts: Mapping[str, SspPart], connections: Iterable[tuple[str, str]]
) -> list[Connection]:
    """Return the connections; raise an ExportError if an end is unknown or two ends do not fit."""
    described = {name: part.description for name, part in parts.items()}
    fed: dict[tuple[str, str], str] = {}
    links: list[Connection] = []
    for pair in connections:
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise ExportError(f"SSP: connection {quoted(pair)}: give a pair (output, input)")
        given, taken = pair
        source_part, source = _variable(described, "connection", given)
        target_part, target = _variable(described, "connection", taken)
        _check_causality(given, source, "output", "a connection begins at an output")
        _check_causality(taken, target, "input", "a connection ends at an input")
        address = (target_part, target.name)
        if address in fed:
            raise ExportError(
                f"SSP: input {taken} has two sources, {fed[address]} and {given}; leave one out"
            )
        fed[address] = given
        _check_types((given, source), (taken, target))
        _check_units(
            (given, source, described[source_part]), (taken, target, described[target_part])
        )
        links.append(Connection((source_part, source.name), address))
    return links


def _check_causality(address: str, variable: Any, expected: str, rule: str) -> None:
    """Raise an ExportError if a variable is not `expected` (input or output) or has no SSP type.

    `rule` is the end of the error message.
    """
    if variable.causality != expected:
        what = (
            "no input or output"
            if variable.causality == "local"
            else f"of causality {variable.causality}"
        )
        raise ExportError(f"SSP: connection: {address} is {what}; {rule}")
    if ssp_kind(variable) is None:
        raise ExportError(
            f"SSP: connection: {address} is an array or a type that SSP 1.0 does not have; connect"
            " scalars"
        )


def _check_types(source: tuple[str, Any], target: tuple[str, Any]) -> None:
    """Raise an ExportError if the types of the two ends of a connection differ.

    An end is (address, variable of the FMU).
    """
    kinds = [ssp_kind(variable) for _, variable in (source, target)]
    if kinds[0] != kinds[1]:
        raise ExportError(
            f"SSP: connection: {source[0]} is {kinds[0]} and {target[0]} is {kinds[1]}; connect"
            " variables of one type"
        )


def _check_units(source: tuple[str, Any, Any], target: tuple[str, Any, Any]) -> None:
    """Raise an ExportError if the units of the two ends of a connection differ.

    An end is (address, variable of the FMU, model description). No unit and the unit "1" fit to
    every unit.
    """
    ends = [(unit_of(variable), description) for _, variable, description in (source, target)]
    (given, _), (expected, _) = ends
    if {given, expected} & {None, "1"}:
        return
    defined = [unit_exponents(description, unit) for unit, description in ends if unit]
    same = given == expected if None in defined else defined[0] == defined[1]
    if not same:
        raise ExportError(
            f"SSP: connection: {source[0]} is in {given} and {target[0]} in {expected}; connect"
            " variables of one unit"
        )


def _span(parts: Iterable[SspPart], stop_time: float | None) -> tuple[float, float]:
    """Return default start and end of a simulation [s]: `stop_time`, or else the latest end.

    Raise an ExportError if the end is not after the start.
    """
    experiments = [part.description.defaultExperiment for part in parts]
    begins = [float(getattr(e, "startTime", None) or 0.0) for e in experiments]
    stops = [float(e.stopTime) for e in experiments if e is not None and e.stopTime is not None]
    start = min(begins)
    stop = max(stops, default=start + 1.0) if stop_time is None else stop_time
    if not isinstance(stop, (int, float)) or not start < stop < math.inf:
        raise ExportError(
            f"SSP: stop_time is {quoted(stop_time)}; give a time after {start:g} s, finite"
        )
    return start, float(stop)


def _zip(files: Mapping[str, bytes]) -> bytes:
    """Return a zip file of files by path; equal files give equal bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for file, content in files.items():
            info = zipfile.ZipInfo(file, _EPOCH)
            stored = file.endswith(".fmu")  # an FMU is compressed already
            info.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, content)
    return stream.getvalue()
