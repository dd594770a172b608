"""Self-contained HTML file that shows a scene offline."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from mbs.errors import ModelError
from mbs.text import did_you_mean
from mbs.view._scene import Scene
from mbs.view.posed import Array

# Files of the viewer in a browser.


SCRIPTS = ("three.bundle.js", "shapes.js", "viewer.js")
"""Scripts of the viewer in loading order."""

STYLES = ("viewer.css",)
"""Styles of the viewer."""


def assets_folder() -> Path:
    """Return the folder with the scripts and styles of the viewer, which a web server can serve."""
    return Path(__file__).parent / "assets"


def asset(name: str) -> str:
    """Return the text of a script or style of the viewer.

    Args:
        name: file name in `assets_folder`, such as "viewer.js".
    """
    return (assets_folder() / name).read_text(encoding="utf-8")


# Appearance of a picture: view direction, theme and visible roles.


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """Appearance of a picture.

    Attributes:
        view: view direction: iso, front, side or top.
        theme: light, dark or auto. auto follows the browser, and is light in other files.
        shown: roles that are shown in addition to the default: "label", "link frame".
        hidden: roles that are hidden, such as "visual".
    """

    view: str = "iso"
    theme: Literal["auto", "light", "dark"] = "auto"
    shown: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()


def look_of(
    made: Scene, view: str, theme: str, shown: Collection[str], hidden: Collection[str] = ()
) -> Look:
    """Check the options of a picture of a scene and return them as a Look.

    Args:
        made: scene of the picture.
        view: view direction, a key of `Scene.views`.
        theme: "auto", "light" or "dark".
        shown: roles that are shown in addition to the default, or one role.
        hidden: roles that are hidden, or one role.

    Raises:
        ModelError: a view, theme or role is unknown.
    """
    themes: dict[str, Literal["auto", "light", "dark"]]
    themes = {"auto": "auto", "light": "light", "dark": "dark"}
    roles = {item.role for item in made.primitives}
    given, out = ((g,) if isinstance(g, str) else tuple(g) for g in (shown, hidden))
    for what, name, known in (
        ("view", view, made.views),
        ("theme", theme, themes),
        *(("role", role, roles) for role in (*given, *out)),
    ):
        if name not in known:
            raise ModelError(
                f"{made.system.name}: there is no {what} {name!r}; {did_you_mean(name, known)}"
            )
    return Look(view, themes[theme], given, out)


_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)
_HEIGHT = 460


def page(
    scene: Scene,
    look: Look,
    speed: float = 1.0,
    times: Array | None = None,
    poses: Array | None = None,
) -> str:
    """Return the text of a self-contained HTML file that shows a scene or a motion.

    Args:
        scene: scene to show.
        look: appearance of the picture.
        speed: seconds of the motion per second of the display.
        times: times (n,) of a motion [s], None for a still picture.
        poses: poses (n, 12 (links + 1)) from `Scene.motion`, required with `times`.
    """
    scripts = [*(asset(name) for name in SCRIPTS), asset("bar.js")]
    styles = [*(asset(name) for name in STYLES), asset("bar.css")]
    motion = None
    if times is not None and poses is not None:
        motion = {**_pack(times, poses), "speed": speed}
    drawn = scene.as_dict()
    drawn["hidden"] = [role for role in scene.hidden(look.hidden) if role not in look.shown]
    options = {"view": look.view, "theme": look.theme, "motion": motion}
    start = (
        "mbs.page = mbs.bar(document.querySelector('.mbs-page'),"
        f" {_data(drawn)}, {_data(options)});"
    )
    lines = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{html.escape(scene.system.name)}</title>",
        *(f"<style>\n{style}</style>" for style in styles),
        '</head><body><div class="mbs-page"></div>',
        *(f"<script>\n{script}</script>" for script in [*scripts, start]),
        "</body></html>",
    ]
    return "\n".join(lines) + "\n"


def iframe(text: str) -> str:
    """Return an HTML element that shows a complete HTML file inside another page or a notebook.

    Args:
        text: text of the HTML file.
    """
    source = html.escape(text, quote=True)
    look = f"width: 100%; height: {_HEIGHT}px; border: 0; border-radius: 6px"
    allowed = "allow-scripts allow-downloads"
    return f'<iframe sandbox="{allowed}" style="{look}" srcdoc="{source}"></iframe>'


def _pack(times: Array, poses: Array) -> dict[str, object]:
    """Return times (n,) and poses of a motion for the viewer: poses as base64 of 32-bit floats."""
    data = base64.b64encode(np.ascontiguousarray(poses, dtype="<f4").tobytes())
    return {"times": [round(float(t), 6) for t in times], "packed": data.decode("ascii")}


def _data(value: object) -> str:
    """Return a value as JSON that is safe inside a <script> element."""
    return json.dumps(value, allow_nan=False).replace("<", "\\u003c")
