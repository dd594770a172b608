"""terminalsAndIcons.xml of FMI 3.0: what is connected together, and the icon."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from mbs.export.fmu.description import FmuModel
from mbs.export.fmu.xml_parts import text_of

_EXTENT = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}


def terminals_and_icons(model: FmuModel) -> str:
    """The file terminalsAndIcons.xml.

    Args:
        model: what the FMU is.

    Returns:
        its text.
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
