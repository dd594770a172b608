"""A scene painted on a matplotlib figure: far faces first, each with the light it gets."""

from __future__ import annotations

import itertools
import shutil
import subprocess
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ExportError, ModelError
from mbs.files import PathLike, whole_file
from mbs.palette import PALETTE, Theme
from mbs.progress import progress
from mbs.result import optional_module
from mbs.text import did_you_mean
from mbs.view.mesh import Faces, faces_of, stretch
from mbs.view.posed import Array
from mbs.view.primitives import LabelShape, SpanShape, SpringShape, rgb
from mbs.view.scene import Scene

# Where a picture is seen from, and how points of space fall on it.


FIELD = np.radians(32.0)
"""Angle between the lower and the upper edge, as in the viewer."""


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A perspective view.

    Attributes:
        place: of the eye [m].
        axes: (3, 3) rows: to the right, upwards, towards the eye.
        away: distance of the eye from the middle of the picture [m].
    """

    place: Array
    axes: Array
    away: float

    def seen(self, points: Array) -> tuple[Array, Array]:
        """Places (..., 2) on the picture, whose height is 2, and depths (...), larger nearer."""
        local = (points - self.place) @ self.axes.T
        depth = local[..., 2]
        flat = local[..., :2] / (-depth[..., None] * np.tan(FIELD / 2))
        return flat, depth


def camera(scene: Scene, view: str) -> Camera:
    """The camera that looks at a scene from one of its views.

    Raises:
        ModelError: there is no such view.
    """
    if view not in scene.views:
        raise ModelError(
            f"{scene.system.name}: there is no view {view!r}; " + did_you_mean(view, scene.views)
        )
    out, up = np.array(scene.views[view]), np.array(scene.up)
    right = np.cross(up, out)
    right = right / np.linalg.norm(right)
    # the sphere around the mechanism, and a little room, fill the height
    away = 1.06 * scene.bounds.radius / float(np.sin(FIELD / 2))
    axes = np.vstack([right, np.cross(out, right), out])
    return Camera(np.array(scene.bounds.center) + away * out, axes, away)


_LIGHT = np.array([0.35, 0.85, 0.55])
"""Towards the light: right, up, towards the eye."""

_INCHES = (8.0, 5.5)
"""Width and height of a picture: as wide as a page of text."""
_LINE = 1.1
"""Width of a line [points]."""
_SEAM = 0.35
"""Width of the edge that closes the seam between two faces [points]."""


@dataclass(frozen=True, slots=True, eq=False)
class Painter:
    """A scene made ready, painted at any poses.

    Attributes:
        scene: what is painted.
        eye: where it is seen from.
        theme: light or dark.
        shown: roles that are painted.
        solid: faces on links, with the number of the link.
        figure: the matplotlib Figure.
        axes: its axes.
    """

    scene: Scene
    eye: Camera
    theme: Theme
    shown: frozenset[str]
    solid: Sequence[tuple[int, Faces]]
    figure: Any
    axes: Any

    def paint(self, poses: Sequence[float] | Array) -> Any:
        """Paint the scene at poses (12 links,), as `Scene.poses` gives them; the Figure."""
        matplotlib = optional_module("matplotlib.collections", "plot")
        axes, link_poses = self.axes, np.reshape(poses, (-1, 3, 4))
        axes.clear()
        axes.set_axis_off()
        axes.set_aspect("equal")
        width, height = _INCHES
        axes.set_xlim(-width / height, width / height)
        axes.set_ylim(-1, 1)
        # widths in points: the ground stays behind, the seams of its shadow are closed
        segments, tints = self._grid()
        axes.add_collection(
            matplotlib.LineCollection(segments, colors=tints, linewidths=0.6, zorder=0)
        )
        corners, colours, widths, shadow = self._faces(link_poses)
        dark = self._mix(self._colour("background"), np.zeros(3), self._number("shadow"))
        axes.add_collection(
            matplotlib.PolyCollection(
                shadow, facecolors=[dark], edgecolors=[dark], linewidths=0.2, zorder=1
            )
        )
        axes.add_collection(
            matplotlib.PolyCollection(
                corners, facecolors=colours, edgecolors=colours, linewidths=widths, zorder=2
            )
        )
        self._labels(link_poses)
        return self.figure

    def _faces(self, link_poses: Array) -> tuple[Array, Array, Array, Array]:
        """Corners on the picture, colours, widths of edges: far ones first; and the shadow."""
        every = [
            (self._transformed_corners(faces, link_poses[link]), faces)
            for link, faces in self.solid
        ]
        for item in self.scene.primitives:
            if isinstance(item, (SpanShape, SpringShape)) and item.role in self.shown:
                a, b = (
                    link_poses[k, :, :3] @ np.array(end) + link_poses[k, :, 3]
                    for k, end in zip(item.links, item.ends, strict=True)
                )
                faces = stretch(item, a, b)
                every.append((faces.corners, faces))
        parts = [self._light(corners, faces) for corners, faces in every if len(corners)]
        corners, colours, widths = (np.concatenate(rows) for rows in zip(*parts, strict=True))
        flat, depth = self.eye.seen(corners)
        order = np.argsort(depth.mean(axis=1), kind="stable")
        return flat[order], colours[order], widths[order], self._shadow(corners)

    def _transformed_corners(self, faces: Faces, pose: Array) -> Array:
        return np.array(faces.corners @ pose[:, :3].T + pose[:, 3])

    def _light(self, corners: Array, faces: Faces) -> tuple[Array, Array, Array]:
        """The faces that are seen, their colours under the light and the widths of their edges."""
        colour = self._colour(faces.colour)
        if faces.kind == "line":
            rows = np.tile([*colour, 1.0], (len(corners), 1))
            return corners, rows, np.full(len(corners), _LINE)
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        size = np.linalg.norm(normal, axis=1)
        normal = normal / np.where(size > 0, size, 1)[:, None]
        sight = self.eye.place - corners.mean(axis=1)
        outside = (normal * sight).sum(axis=1)
        if faces.kind == "closed":
            kept = outside > 0
            corners, normal = corners[kept], normal[kept]
        else:
            normal = normal * np.sign(outside)[:, None]
        # light from everywhere, from the sun and from the sky, of which a face away from all has
        # half
        sun = _LIGHT / np.linalg.norm(_LIGHT) @ self.eye.axes
        bright = (
            0.58 + 0.5 * np.clip(normal @ sun, 0, 1) + 0.06 * (normal @ np.array(self.scene.up))
        )
        rows = np.clip(bright[:, None] * colour, 0, 1)
        alpha = np.full((len(rows), 1), faces.opacity)
        seam = _SEAM if faces.opacity == 1 else 0.0
        return corners, np.hstack([rows, alpha]), np.full(len(corners), seam)

    def _shadow(self, corners: Array) -> Array:
        """Faces where the light throws them on the ground."""
        up, center = np.array(self.scene.up), np.array(self.scene.floor.center)
        # from high up, a little from the right and from behind, so that shadows stay short
        sun = up + 0.25 * self.eye.axes[0] - 0.1 * self.eye.axes[2]
        height = (corners - center) @ up / float(sun @ up)
        flat: Array = self.eye.seen(corners - height[..., None] * sun)[0]
        return flat

    def _grid(self) -> tuple[Array, Array]:
        floor, up = self.scene.floor, np.array(self.scene.up)
        count = int(floor.reach / floor.step)
        right = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
        right = right / np.linalg.norm(right)
        steps = np.arange(-count, count + 1) * floor.step
        near = steps[:-1], steps[1:]
        lines = np.array([[(c, a), (c, b)] for c in steps for a, b in zip(*near, strict=True)])
        lines = np.vstack([lines, lines[:, :, ::-1]])
        middle = np.linalg.norm(lines.mean(axis=1), axis=1)
        points = np.array(floor.center) + lines @ np.vstack([right, np.cross(up, right)])
        flat, depth = self.eye.seen(points)
        # what is beside the eye or behind it is not seen; lines fade out with the distance
        kept = (depth < -0.05 * self.eye.away).all(axis=1) & (middle < floor.reach)
        part = np.clip(1 - middle[kept] / floor.reach, 0, 1) ** 1.4
        far, near_colour = self._colour("background"), self._colour("grid")
        return flat[kept], far + part[:, None] * (near_colour - far)

    def _labels(self, link_poses: Array) -> None:
        effects = optional_module("matplotlib.patheffects", "plot")
        # in points, then in half heights of the picture: beside the point, one above the other
        halo = [effects.withStroke(linewidth=2.5, foreground=self._colour("background"))]
        for item in self.scene.primitives:
            if isinstance(item, LabelShape) and item.role in self.shown:
                at = link_poses[item.link, :, :3] @ np.array(item.at) + link_poses[item.link, :, 3]
                (x, y), _ = self.eye.seen(at)
                look = {"color": self._colour("text"), "fontsize": 9, "path_effects": halo}
                y += 0.02 + 0.05 * item.row
                self.axes.text(x + 0.02, y, item.text, gid=item.text, **look)

    def _colour(self, name: str) -> Array:
        return rgb(name, self.theme)

    def _number(self, name: str) -> float:
        value = PALETTE[self.theme][name]
        return float(value) if isinstance(value, (int, float)) else 0.0

    def _mix(self, first: Array, second: Array, part: float) -> Array:
        # the theme says how dark shadows are on the page; here they are somewhat lighter
        return np.array(first + 0.6 * part * (second - first))


def painter(
    scene: Scene,
    view: str,
    theme: Theme,
    shown: Collection[str] = (),
    hidden: Collection[str] = (),
) -> Painter:
    """A painter for a scene.

    Args:
        scene: what is painted.
        view: iso, front, side or top.
        theme: light or dark.
        shown: roles that are painted besides the usual ones, such as "label".
        hidden: roles that are left out, such as "visual".

    Raises:
        ModelError: matplotlib is missing, or there is no such view.
    """
    optional_module("matplotlib", "plot")
    figures = optional_module("matplotlib.figure", "plot")
    roles = frozenset(item.role for item in scene.primitives) - set(scene.hidden(hidden)) | set(
        shown
    )
    solid = [
        (item.link, faces)
        for item in scene.primitives
        if not isinstance(item, (SpanShape, SpringShape)) and item.role in roles
        for faces in faces_of(item, scene.size)
    ]
    figure = figures.Figure(figsize=_INCHES)
    figure.set_facecolor(str(PALETTE[theme]["background"]))
    axes = figure.add_axes((0, 0, 1, 1))
    return Painter(scene, camera(scene, view), theme, roles, solid, figure, axes)


# Files of pictures made without a browser: PNG and SVG, GIF by Pillow, MP4 by ffmpeg.


Image = npt.NDArray[np.uint8]

_DOTS, _FILM_DOTS = 110.0, 80.0
"""Dots an inch: 880 and 640 pixels of width, of which films have many pictures."""

_COLOURS = 256


def save_still(painter: Painter, poses: Array, path: PathLike) -> None:
    """Write one picture in the format that the ending names: .png or .svg.

    Raises:
        ExportError: the file cannot be written.
    """
    matplotlib = optional_module("matplotlib", "plot")
    figure = painter.paint(poses)
    with (
        whole_file(path) as scratch,
        matplotlib.rc_context({"svg.hashsalt": "mbs"}),
    ):
        kept = {"Date": None} if scratch.suffix.lower() == ".svg" else {}
        figure.savefig(scratch, dpi=_DOTS, metadata=kept)


def save_gif(painter: Painter, poses: Array, path: PathLike, fps: float) -> None:
    """Write a motion (n, 12 links) as a GIF that starts again at its end.

    Raises:
        ExportError: the file cannot be written.
    """
    images = optional_module("PIL.Image", "plot")
    middle = images.fromarray(next(_frames(painter, poses[len(poses) // 2 :])))
    palette = middle.quantize(_COLOURS, method=images.Quantize.MAXCOVERAGE)
    small = [
        images.fromarray(frame).quantize(palette=palette, dither=images.Dither.NONE)
        for frame in _frames(painter, poses)
    ]
    with whole_file(path) as scratch:
        small[0].save(
            scratch,
            format="GIF",
            save_all=True,
            append_images=small[1:],
            duration=round(1000 / fps),
            loop=0,
        )


def save_mp4(painter: Painter, poses: Array, path: PathLike, fps: float) -> None:
    """Write a motion (n, 12 links) as an MP4 file (H.264).

    Raises:
        ExportError: ffmpeg is not there or fails, or the file cannot be written.
    """
    program = shutil.which("ffmpeg")
    if program is None:
        raise ExportError(
            f"{Path(path)}: ffmpeg, which makes .mp4 files, was not found; install it, or save a"
            " .gif or .html file"
        )
    frames = _frames(painter, poses)
    first = next(frames)
    height, width, _ = first.shape
    given = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {fps:g} -i -"
    made = "-an -vcodec libx264 -pix_fmt yuv420p -movflags +faststart"
    with whole_file(path) as scratch:
        command = [program, "-y", "-loglevel", "error", *given.split(), *made.split()]
        _feed([*command, str(scratch)], itertools.chain([first], frames), path)


def _feed(command: list[str], frames: Iterator[Image], path: PathLike) -> None:
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        assert process.stdin is not None
        try:
            for frame in frames:
                process.stdin.write(frame.tobytes())
        except BrokenPipeError:  # it has stopped; its words say why
            pass
        _, words = process.communicate()
    if process.returncode:
        reason = " ".join(words.decode("utf-8", "replace").split())[-200:]
        raise ExportError(f"{Path(path)}: ffmpeg failed ({reason}); save a .gif or .html file")


def _frames(painter: Painter, poses: Array) -> Iterator[Image]:
    """(height, width, 3) pictures, of even height and width."""
    canvases = optional_module("matplotlib.backends.backend_agg", "plot")
    painter.figure.set_dpi(_FILM_DOTS)
    canvas: Any = canvases.FigureCanvasAgg(painter.figure)
    with progress("painting", 0.0, float(len(poses)), quiet=False) as reached:
        for number, row in enumerate(poses, start=1):
            painter.paint(row)
            canvas.draw()
            pixels: Image = np.asarray(canvas.buffer_rgba())[:, :, :3]
            height, width = pixels.shape[0] // 2 * 2, pixels.shape[1] // 2 * 2
            yield np.ascontiguousarray(pixels[:height, :width])
            reached(float(number))
