"""What writers of robot files share: the system that is meant, its XML on disk."""

from __future__ import annotations

import os
from xml.etree.ElementTree import Comment, Element, indent, tostring

from mbs.assembly import System
from mbs.components import Mechanism
from mbs.errors import ModelError
from mbs.files import path_of, write_bytes
from mbs.text import quoted


def system_of(system: object) -> System:
    """The system that a user gave; a Mechanism is assembled.

    Raises:
        ModelError: it is neither.
    """
    if isinstance(system, Mechanism):
        return system.assemble()
    if not isinstance(system, System):
        raise ModelError(
            f"{quoted(system)} is a {type(system).__name__}; give a System or a Mechanism"
        )
    return system


def shapes_left_out(system: System) -> str:
    """Return the note about shapes, which no writer of robot files keeps; empty without shapes."""
    if not system.shapes:
        return ""
    names = {-1: "the base", **{j: link.name for j, link in enumerate(system.tree.links)}}
    owners = ", ".join(dict.fromkeys(names[row.link] for row in system.shapes))
    return f"Shapes that are not in this file: {len(system.shapes)}, on {owners}."


def write_xml(root: Element, path: str | os.PathLike[str], note: str = "") -> None:
    """Write an indented XML file as a whole or not at all.

    Args:
        root: element of the robot.
        path: of the file.
        note: becomes a comment at the begin.

    Raises:
        ExportError: the file cannot be written.
    """
    if note:
        root.insert(0, Comment(f" {note.replace('--', '- -')} "))
    indent(root)
    content = tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    write_bytes(content, path_of(path))
