"""Pictures and animations of mechanisms, for notebooks and files of several formats."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ExportError, ModelError
from mbs.files import PathLike, path_of, write_text
from mbs.loops.configuration import solve
from mbs.palette import Theme
from mbs.result import Result
from mbs.text import quoted
from mbs.view._scene import Scene, scene
from mbs.view.page import Look, iframe, look_of, page
from mbs.view.painter import Painter, painter, save_gif, save_mp4, save_still
from mbs.view.posed import Array, Values

_ENDINGS = (".html", ".png", ".svg", ".gif", ".mp4")
_MOST_FRAMES = 5000
_GIF_FPS = 20.0
"""Approximate frames per second of a GIF. GIF times have a resolution of 0.01 s, and more frames
make large files."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Picture:
    """Still picture or animation of a mechanism, which a notebook displays.

    Attributes:
        scene: shapes of the mechanism.
        poses: poses (n, 12 (links + 1)) of the base and links in each frame. n is 1 for a still
            picture.
        times: time (n,) of each frame [s].
        look: appearance of the picture.
        speed: seconds of the motion per second of the animation.
    """

    scene: Scene
    poses: Array
    times: Array
    look: Look
    speed: float = 1.0

    @property
    def html(self) -> str:
        """Text of a self-contained HTML file, which works offline."""
        motion = (self.times, self.poses) if len(self.times) > 1 else ()
        return page(self.scene, self.look, self.speed, *motion)

    def __repr__(self) -> str:
        """Return a short description."""
        moving = f", {len(self.times)} pictures" if len(self.times) > 1 else ""
        return f"<Picture of {self.scene.system.name}{moving}>"

    def _repr_html_(self) -> str:
        """Return the HTML element that a notebook displays."""
        return iframe(self.html)

    def save(self, path: PathLike) -> None:
        """Write a file in the format of its extension.

        Args:
            path: file with the extension .html, .png, .svg, .gif or .mp4. A .png or .svg file shows
                the first frame of a motion. .gif and .mp4 need a motion, and .mp4 needs ffmpeg. An
                existing file is replaced only if the export succeeds.

        Raises:
            ExportError: the extension is unknown, ffmpeg is missing, or the file cannot be
                written.
            ModelError: matplotlib is missing, which all formats except .html need.
        """
        ending = path_of(path).suffix.lower()
        if ending not in _ENDINGS:
            endings = f"{', '.join(_ENDINGS[:-1])} or {_ENDINGS[-1]}"
            raise ExportError(f"{path_of(path)}: the ending is {ending!r}; use {endings}")
        if ending == ".html":
            write_text(self.html, path)
        elif ending in (".png", ".svg"):
            save_still(self._painter(), self.poses[0], path)
        else:
            self._film(path, ending)

    def _film(self, path: PathLike, ending: str) -> None:
        """Write the motion as ".gif" or ".mp4" (`ending`).

        Raise an ExportError for a still picture.
        """
        if len(self.times) < 2:
            raise ExportError(
                f"{path_of(path)}: the picture does not move; save a .png, .svg or .html file, or"
                " make one with mbs.view.animate"
            )
        fps = self.speed * (len(self.times) - 1) / float(self.times[-1] - self.times[0])
        every = max(1, round(fps / _GIF_FPS)) if ending == ".gif" else 1
        save = save_gif if ending == ".gif" else save_mp4
        save(self._painter(), self.poses[::every], path, fps / every)

    def _painter(self) -> Painter:
        """Return a painter with the appearance of this picture."""
        theme: Theme = "dark" if self.look.theme == "dark" else "light"
        return painter(self.scene, self.look.view, theme, self.look.shown, self.look.hidden)


def show(
    system: System,
    q: Values = None,
    path: PathLike | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    view: str = "iso",
    theme: str = "auto",
    shown: Collection[str] = (),
    hidden: Collection[str] = (),
) -> Picture:
    """Return a picture of a mechanism at a configuration.

    Args:
        system: mechanism, open or closed. Every symbol in its geometry has a value.
        q: all positions (nq,), or a dict of some positions by name [rad or m]. Other positions
            come from the assembled configuration, and `mbs.loops.solve` closes the loops at the
            given positions. By default the assembled configuration.
        path: file to write, see `Picture.save`.
        parameters: values of symbols. Other symbols have their default values.
        view: view direction: iso, front, side or top.
        theme: light, dark or auto. auto follows the browser, and is light in other files.
        shown: roles that are shown in addition to the default: "label" for the names of joints,
            "link frame" for the frame of every link. Also "joint" and "frame" for a mechanism with
            visual shapes (`Mechanism.add_shape`).
        hidden: roles that are hidden. If "visual" is hidden, bars and joints replace the visual
            shapes.

    Raises:
        ModelError: a name is unknown, or a symbol has no value.
        Unclosable: the loops cannot be closed at the given positions.
        ExportError: the file cannot be written.
    """
    require_system(system)
    place: Values = q
    if isinstance(q, Mapping) and system.is_closed:
        place = solve(system, q, parameters=parameters).tolist()
    made = scene(system, place, parameters=parameters)
    look = look_of(made, view, theme, shown, hidden)
    picture = Picture(made, np.array([made.poses()]), np.zeros(1), look)
    if path is not None:
        picture.save(path)
    return picture


def animate(
    result: Result,
    system: System | None = None,
    path: PathLike | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    fps: float = 30.0,
    speed: float = 1.0,
    view: str = "iso",
    theme: str = "auto",
    shown: Collection[str] = (),
    hidden: Collection[str] = (),
) -> Picture:
    """Return an animation of a simulated or measured motion.

    Args:
        result: result with a signal `name.q` for every coordinate.
        system: mechanism that moves. By default the simulated system.
        path: file to write, see `Picture.save`.
        parameters: values of symbols. Other symbols have their default values.
        fps: frames per second.
        speed: seconds of the motion per second, below 1 for slow motion.
        view: view direction: iso, front, side or top.
        theme: light, dark or auto, see `show`.
        shown: roles that are shown in addition to the default, see `show`.
        hidden: roles that are hidden, see `show`.

    Raises:
        ModelError: the result has no system or not the positions of this system, a name is
            unknown, or the animation has more than 5000 frames.
        ExportError: the file cannot be written.
    """
    whose = _owner(result, system)
    times = _times(result, fps, speed)
    q = _positions(result, whose, times)
    made = scene(whose, q[0].tolist(), parameters=parameters).spanning(q)
    look = look_of(made, view, theme, shown, hidden)
    picture = Picture(made, made.motion(q), times, look, speed)
    if path is not None:
        picture.save(path)
    return picture


def _owner(result: Result, system: System | None) -> System:
    """Return the system whose motion a result contains: `system`, or else that of the result.

    Raise a ModelError if the result is no Result or has no system.
    """
    if not isinstance(result, Result):
        raise ModelError(f"{quoted(result)} is no Result; give what mbs.simulate.run returns")
    whose = result.system if system is None else system
    if whose is None:
        raise ModelError(
            f"result {result.name!r} does not know whose motion it is; give the System with system="
        )
    require_system(whose)
    return cast(System, whose)


def _times(result: Result, fps: float, speed: float) -> Array:
    """Return the times (n,) of the frames [s], equally spaced.

    `fps` are frames per second, `speed` seconds of the motion per second. Raise a ModelError for
    invalid options, a motion of zero duration or too many frames.
    """
    for name, value in (("fps", fps), ("speed", speed)):
        if not (isinstance(value, (int, float)) and 0 < value < np.inf):
            raise ModelError(f"{name} is {quoted(value)}; give a number above zero")
    if len(result.time) < 2 or result.time[-1] <= result.time[0]:
        raise ModelError(f"result {result.name!r} covers no time; give a motion")
    count = float(result.time[-1] - result.time[0]) * fps / speed
    if count > _MOST_FRAMES:
        raise ModelError(
            f"result {result.name!r}: {count:.0f} pictures are more than {_MOST_FRAMES}; give a"
            " larger speed or fewer fps"
        )
    return np.linspace(result.time[0], result.time[-1], max(2, round(count) + 1))


def _positions(result: Result, system: System, times: Array) -> Array:
    """Return the positions (n, nq) at the times, by linear interpolation of the result.

    Raise a ModelError if the result does not contain a position of the system.
    """
    names = [f"{coordinate.name}.q" for coordinate in system.coordinates]
    for name in names:
        if name not in result:
            raise ModelError(
                f"result {result.name!r} has no signal {name!r}, which a motion of {system.name}"
                " has; give the System it belongs to with system="
            )
    return np.column_stack([np.interp(times, result.time, result[name]) for name in names])
