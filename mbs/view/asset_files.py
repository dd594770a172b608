"""The files that show a scene in a browser."""

from __future__ import annotations

from pathlib import Path

SCRIPTS = ("three.bundle.js", "shapes.js", "viewer.js")
"""Scripts of the viewer, in the order in which they are loaded."""

STYLES = ("viewer.css",)
"""Styles of the viewer."""


def assets_folder() -> Path:
    """The folder with the scripts and styles of the viewer, for a server to hand out."""
    return Path(__file__).parent / "assets"


def asset(name: str) -> str:
    """The text of one of these files."""
    return (assets_folder() / name).read_text(encoding="utf-8")
