"""Styles of the app, and the scripts that its page loads from this server."""

from __future__ import annotations

from pathlib import Path

from nicegui import app, ui

from mbs.version import __version__
from mbs.view import assets_folder
from mbs.view.page import SCRIPTS

VIEW = "app-canvas"
"""HTML id of the element that contains the picture."""

_ASSETS = Path(__file__).parent / "assets"
_APP, _PICTURE = f"/app/{__version__}", f"/view/{__version__}"
_AGE = 3600


def serve_assets() -> None:
    """Make the server provide the scripts and styles of the app and of the picture."""
    app.add_static_files(_APP, _ASSETS, max_cache_age=_AGE)
    app.add_static_files(_PICTURE, assets_folder(), max_cache_age=_AGE)


def add_head() -> None:
    """Add scripts and styles to the head of the page."""
    lines = [
        f'<link rel="stylesheet" href="{_PICTURE}/viewer.css">',
        f'<link rel="stylesheet" href="{_APP}/app.css">',
        *(f'<script defer src="{_PICTURE}/{name}"></script>' for name in SCRIPTS),
        f'<script defer src="{_APP}/app.js"></script>',
    ]
    ui.add_head_html("\n".join(lines))
