"""Files of pictures made without a browser: PNG and SVG, GIF by Pillow, MP4 by ffmpeg."""

from __future__ import annotations

import itertools
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ExportError
from mbs.files import PathLike, whole_file
from mbs.progress import progress
from mbs.result import optional_module
from mbs.view.painter import Painter
from mbs.view.posed import Array

Image = npt.NDArray[np.uint8]

_DOTS = 110.0
_FILM_DOTS = 80.0
"""Dots an inch."""

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
