"""What writers of robot files share: the system that is meant, its XML on disk."""

from __future__ import annotations

import os
from xml.etree.ElementTree import Element, indent, tostring

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


def write_xml(root: Element, path: str | os.PathLike[str]) -> None:
    """Write an indented XML file as a whole or not at all.

    Raises:
        ExportError: the file cannot be written.
    """
    indent(root)
    content = tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    write_bytes(content, path_of(path))
