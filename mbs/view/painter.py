"""Painting of a scene on a matplotlib figure: shaded faces from far to near, and video files."""

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
from mbs.view._scene import Scene
from mbs.view.mesh import Faces, faces_of, stretch
from mbs.view.posed import Array
from mbs.view.primitives import LabelShape, SpanShape, SpringShape, rgb

# Camera and perspective projection.


FIELD = np.radians(32.0)
"""Vertical field of view [rad], as in the viewer."""


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Perspective view.

    Attributes:
        place: position (3,) of the eye in the base frame [m].
        axes: unit vectors (3, 3) in the base frame by rows: to the right, upwards, towards the eye.
        away: distance of the eye from the centre of the bounds of the mechanism [m].
    """

    place: Array
    axes: Array
    away: float

    def seen(self, points: Array) -> tuple[Array, Array]:
        """Project points to the picture.

        Args:
            points: points (..., 3) in the base frame [m].

        Returns:
            Positions (..., 2) in the picture, whose height is 2, and depths (...) [m]: coordinate
            towards the eye, negative in front of it, larger if nearer.
        """
        local = (points - self.place) @ self.axes.T
        depth = local[..., 2]
        flat = local[..., :2] / (-depth[..., None] * np.tan(FIELD / 2))
        return flat, depth


def camera(scene: Scene, view: str) -> Camera:
    """Return the camera of a view of a scene.

    Args:
        scene: scene to look at.
        view: view direction, a key of `Scene.views`.

    Raises:
        ModelError: the view is unknown.
    """
    if view not in scene.views:
        raise ModelError(
            f"{scene.system.name}: there is no view {view!r}; " + did_you_mean(view, scene.views)
        )
    out, up = np.array(scene.views[view]), np.array(scene.up)
    right = np.cross(up, out)
    right = right / np.linalg.norm(right)
    # the bounding sphere and a margin of 6 percent fill the height
    away = 1.06 * scene.bounds.radius / float(np.sin(FIELD / 2))
    axes = np.vstack([right, np.cross(out, right), out])
    return Camera(np.array(scene.bounds.center) + away * out, axes, away)


_LIGHT = np.array([0.35, 0.85, 0.55])
"""Direction to the light: right, up, towards the eye."""

_INCHES = (8.0, 5.5)
"""Width and height of a picture [inches]: the width of a page of text."""
_LINE = 1.1
"""Line width [points]."""
_SEAM = 0.35
"""Width of the edges of faces [points], which hide the gaps between them."""


@dataclass(frozen=True, slots=True, eq=False)
class Painter:
    """Painter of a scene at any poses of its links.

    Attributes:
        scene: scene to paint.
        eye: camera.
        theme: light or dark.
        shown: roles that are painted.
        solid: pairs of link number and faces in the link frame.
        figure: matplotlib Figure.
        axes: axes of the figure.
    """

    scene: Scene
    eye: Camera
    theme: Theme
    shown: frozenset[str]
    solid: Sequence[tuple[int, Faces]]
    figure: Any
    axes: Any

    def paint(self, poses: Sequence[float] | Array) -> Any:
        """Paint the scene at given poses of its links.

        Args:
            poses: poses (12 (links + 1),) from `Scene.poses`.

        Returns:
            The matplotlib Figure of the painter.
        """
        matplotlib = optional_module("matplotlib.collections", "plot")
        axes, link_poses = self.axes, np.reshape(poses, (-1, 3, 4))
        axes.clear()
        axes.set_axis_off()
        axes.set_aspect("equal")
        width, height = _INCHES
        axes.set_xlim(-width / height, width / height)
        axes.set_ylim(-1, 1)
        # line widths in points; zorder=0 draws the ground first, and the outline of shadow
        # polygons hides the gaps between them
        segments, tints = self._grid()
        axes.add_collection(
            matplotlib.LineCollection(segments, colors=tints, linewidths=0.6, zorder=0)
        )
        corners, colours, widths, shadow = self._faces(link_poses)
        # the palette value is for the browser viewer; here shadows are lighter by 0.6
        paper = self._colour("background")
        dark = paper - 0.6 * self._number("shadow") * paper
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
        """Return the visible faces, far faces first, and their shadow.

        They are corners (n, 4, 2) in the picture, colours (n, 4), edge widths (n,) [points] and the
        shadow polygons (m, 4, 2). `link_poses` are poses (links + 1, 3, 4).
        """
        every = [
            (faces.corners @ link_poses[link, :, :3].T + link_poses[link, :, 3], faces)
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

    def _light(self, corners: Array, faces: Faces) -> tuple[Array, Array, Array]:
        """Return the visible faces with their shading.

        They are corners (n, 4, 3) [m], colours with opacity (n, 4), and edge widths (n,) [points].
        """
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
        # brightness: ambient light 0.58, up to 0.5 of direct light, and 0.06 more for upward faces
        sun = _LIGHT / np.linalg.norm(_LIGHT) @ self.eye.axes
        bright = (
            0.58 + 0.5 * np.clip(normal @ sun, 0, 1) + 0.06 * (normal @ np.array(self.scene.up))
        )
        rows = np.clip(bright[:, None] * colour, 0, 1)
        alpha = np.full((len(rows), 1), faces.opacity)
        seam = _SEAM if faces.opacity == 1 else 0.0
        return corners, np.hstack([rows, alpha]), np.full(len(corners), seam)

    def _shadow(self, corners: Array) -> Array:
        """Return the shadows (n, 4, 2) of faces on the ground, in the picture."""
        up, center = np.array(self.scene.up), np.array(self.scene.floor.center)
        # steep light, slightly from the right and from behind, so that shadows are short
        sun = up + 0.25 * self.eye.axes[0] - 0.1 * self.eye.axes[2]
        height = (corners - center) @ up / float(sun @ up)
        flat: Array = self.eye.seen(corners - height[..., None] * sun)[0]
        return flat

    def _grid(self) -> tuple[Array, Array]:
        """Return the ground grid: lines (n, 2, 2) in the picture, and their colours (n, 3)."""
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
        # lines next to or behind the eye are left out; lines fade out with the distance
        kept = (depth < -0.05 * self.eye.away).all(axis=1) & (middle < floor.reach)
        part = np.clip(1 - middle[kept] / floor.reach, 0, 1) ** 1.4
        far, near_colour = self._colour("background"), self._colour("grid")
        return flat[kept], far + part[:, None] * (near_colour - far)

    def _labels(self, link_poses: Array) -> None:
        """Write the names of the scene next to their points."""
        effects = optional_module("matplotlib.patheffects", "plot")
        # halo and font in points; offsets in half picture heights: next to the point, stacked
        halo = [effects.withStroke(linewidth=2.5, foreground=self._colour("background"))]
        for item in self.scene.primitives:
            if isinstance(item, LabelShape) and item.role in self.shown:
                at = link_poses[item.link, :, :3] @ np.array(item.at) + link_poses[item.link, :, 3]
                (x, y), _ = self.eye.seen(at)
                look = {"color": self._colour("text"), "fontsize": 9, "path_effects": halo}
                y += 0.02 + 0.05 * item.row
                self.axes.text(x + 0.02, y, item.text, gid=item.text, **look)

    def _colour(self, name: str) -> Array:
        """Return red, green and blue (3,) of a palette colour, from 0 to 1."""
        return rgb(name, self.theme)

    def _number(self, name: str) -> float:
        """Return a number of the palette, or 0 if the value is not a number."""
        value = PALETTE[self.theme][name]
        return float(value) if isinstance(value, (int, float)) else 0.0


def painter(
    scene: Scene,
    view: str,
    theme: Theme,
    shown: Collection[str] = (),
    hidden: Collection[str] = (),
) -> Painter:
    """Return a painter of a scene with a new matplotlib figure.

    Args:
        scene: scene to paint.
        view: view direction: iso, front, side or top.
        theme: light or dark.
        shown: roles that are painted in addition to the default, such as "label".
        hidden: roles that are hidden, such as "visual".

    Raises:
        ModelError: matplotlib is missing, or the view is unknown.
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


# Picture files: PNG and SVG by matplotlib, GIF by Pillow, MP4 by ffmpeg.


Image = npt.NDArray[np.uint8]

_DOTS, _FILM_DOTS = 110.0, 80.0
"""Dots per inch of pictures and of animations, for a width of 880 and 640 pixels."""

_COLOURS = 256


def save_still(painter: Painter, poses: Array, path: PathLike) -> None:
    """Write a still picture as .png or .svg, by the file extension.

    Args:
        painter: painter of the scene.
        poses: poses (12 (links + 1),) of base and links.
        path: path of the file.

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
    """Write a motion as a GIF that repeats.

    Args:
        painter: painter of the scene.
        poses: poses (n, 12 (links + 1)) of base and links in each frame.
        path: path of the file.
        fps: frames per second.

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
    """Write a motion as an MP4 file (H.264).

    Args:
        painter: painter of the scene.
        poses: poses (n, 12 (links + 1)) of base and links in each frame.
        path: path of the file.
        fps: frames per second.

    Raises:
        ExportError: ffmpeg is not installed or fails, or the file cannot be written.
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
    """Run ffmpeg with the frames as its input; raise an ExportError if it fails.

    `path` is the file to write, for the error message.
    """
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        assert process.stdin is not None
        try:
            for frame in frames:
                process.stdin.write(frame.tobytes())
        except BrokenPipeError:  # ffmpeg has stopped; its error output contains the reason
            pass
        _, words = process.communicate()
    if process.returncode:
        reason = " ".join(words.decode("utf-8", "replace").split())[-200:]
        raise ExportError(f"{Path(path)}: ffmpeg failed ({reason}); save a .gif or .html file")


def _frames(painter: Painter, poses: Array) -> Iterator[Image]:
    """Yield the frames (height, width, 3) of a motion, with even height and width for H.264."""
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
