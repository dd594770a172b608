"""How a picture looks: from where, on which background, and what is shown."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from mbs.errors import ModelError
from mbs.messages import did_you_mean
from mbs.view.scene import Scene


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """How a picture looks.

    Attributes:
        view: iso, front, side or top.
        theme: light or dark, or auto: what the browser prefers, and light in other files.
        shown: roles that are shown besides the usual ones: "label", "link frame".
    """

    view: str = "iso"
    theme: Literal["auto", "light", "dark"] = "auto"
    shown: tuple[str, ...] = ()


def look_of(made: Scene, view: str, theme: str, shown: Collection[str]) -> Look:
    """How a picture of a scene looks.

    Raises:
        ModelError: there is no such view, theme or role.
    """
    themes: dict[str, Literal["auto", "light", "dark"]]
    themes = {"auto": "auto", "light": "light", "dark": "dark"}
    roles = {item.role for item in made.primitives}
    given = (shown,) if isinstance(shown, str) else tuple(shown)
    for what, name, known in (
        ("view", view, made.views),
        ("theme", theme, themes),
        *(("role", role, roles) for role in given),
    ):
        if name not in known:
            raise ModelError(
                f"{made.system.name}: there is no {what} {name!r}; {did_you_mean(name, known)}"
            )
    return Look(view, themes[theme], given)
