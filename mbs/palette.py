"""Colours of pictures by name, for light and dark backgrounds."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

Theme = Literal["light", "dark"]
Colours = Mapping[str, str | float | list[str]]

LINK_COLOURS = ("link0", "link1", "link2", "link3", "link4", "link5")
"""Colours of consecutive links."""

_LIGHT: Colours = {
    "background": "#f6f7f9",
    "text": "#1f2933",
    "grid": "#aab4c0",
    "bounce": "#c9d2de",
    "shadow": 0.2,  # opacity of shadows on the ground
    "base": "#454f5b",
    "link0": "#5288c1",
    "link1": "#56a38f",
    "link2": "#d0a24c",
    "link3": "#8878bd",
    "link4": "#86a857",
    "link5": "#bf7f6a",
    "joint": "#8a94a1",
    "active": "#e8871e",
    "loop": "#d6336c",
    "force": "#2f8f5b",
    "axis": "#7a8699",
    "axes": ["#e03131", "#2f9e44", "#1c6dd0"],
}
_DARK: Colours = {
    "background": "#15181d",
    "text": "#e6eaf0",
    "grid": "#49525f",
    "bounce": "#3b4450",
    "shadow": 0.45,  # opacity of shadows on a dark ground
    "base": "#6d7887",
    "link0": "#6ba3dc",
    "link1": "#69bda6",
    "link2": "#dfb663",
    "link3": "#a294d8",
    "link4": "#9dc16b",
    "link5": "#d6957f",
    "joint": "#aab3bf",
    "active": "#f59a36",
    "loop": "#f0598b",
    "force": "#4cc38a",
    "axis": "#8793a5",
    "axes": ["#ff6b6b", "#51cf66", "#4dabf7"],
}
PALETTE: Mapping[Theme, Colours] = MappingProxyType({"light": _LIGHT, "dark": _DARK})
