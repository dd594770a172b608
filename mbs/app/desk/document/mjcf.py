"""MJCF files that were sent: what MuJoCo would read from other files is refused beforehand."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from mbs.errors import DescriptionError
from mbs.formats.urdf import parse_xml
from mbs.messages import quoted

_PARTS = ("include", "model", "attach")
"""Elements that stand for parts of the model in another file."""


def close_mjcf(path: Path) -> None:
    """Write the file anew as its parser understood it, once it is sure to name no other place.

    MuJoCo reads XML in a way of its own; it gets what was checked. Meshes may be named by plain
    relative paths: bodies whose inertia is given need none of them.

    Args:
        path: of the file, alone in its folder.

    Raises:
        DescriptionError: it is not XML, or names files at other places.
    """
    root = parse_xml(path)
    for element in root.iter():
        _check(path, element)
    path.write_bytes(ElementTree.tostring(root, encoding="utf-8"))


def _check(path: Path, element: Element) -> None:
    for name, value in element.attrib.items():
        is_path = name.startswith("file") or name.endswith("dir")
        if is_path and (element.tag in _PARTS or not _is_inside(value)):
            raise DescriptionError(
                f"{path}: <{element.tag}> names other files, {quoted(value)}, which were not sent"
                " with it; put the whole model in one file, with the inertias of its bodies"
            )


def _is_inside(value: str) -> bool:
    """Whether a path stays in the folder of the file."""
    plain = value.replace("\\", "/")
    return not plain.startswith("/") and ":" not in plain and ".." not in plain.split("/")
