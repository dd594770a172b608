"""Mesh files of bodies, read by trimesh and simplified for pictures."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from mbs.errors import MbsError, ModelError
from mbs.files import PathLike
from mbs.formats.files import read_bytes
from mbs.text import install_command, quoted, shortened
from mbs.view.posed import Array

MOST_TRIANGLES = 2000
"""Largest number of triangles of a mesh in a picture. A robot of 30 meshes then takes less than
1 s and 2 MB."""
_UNIT = re.compile(rb"<(?:\w+:)?unit\b[^<>]{0,200}?\bmeter\s*=\s*[\"']([^\"']{1,40})[\"']")
_MOST_READ = 5_000_000
"""Largest number of triangles of a file. More triangles need gigabytes of memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangle mesh of the surface of a body.

    Attributes:
        points: corners (n, 3) [m].
        triangles: indices (m, 3) of points, counterclockwise as seen from outside.
        of: number of triangles in the file, at least m.
    """

    points: Array
    triangles: NDArray[np.int64]
    of: int


def read_mesh(path: PathLike) -> Mesh:
    """Read the triangles of a mesh file, and simplify a mesh of too many triangles.

    Materials and textures, which the file refers to, are not read.

    Args:
        path: .stl, .obj or .dae file. Lengths in a .dae file are in the unit of the file, in other
            files in m.

    Raises:
        ModelError: trimesh is not installed, the file is missing, or it contains no triangles.
    """
    stamp = 0
    with contextlib.suppress(OSError, ValueError):  # read_bytes reports the error
        stamp = os.stat(path).st_mtime_ns
    return _read(str(path), stamp)


@lru_cache(maxsize=256)
def _read(path: str, stamp: int) -> Mesh:
    """Read and simplify a mesh file; see `read_mesh` for the errors.

    `stamp`, the modification time of the file, is part of the cache key.
    """
    kind = Path(path).suffix.lower().removeprefix(".")
    trimesh = _module("trimesh", path)
    if kind == "dae":
        _module("collada", path)
    try:
        content = read_bytes(path)
    except MbsError as error:
        raise ModelError(str(error)) from None
    try:
        # a BytesIO has no folder, so that files it refers to cannot be opened
        plain = _without_materials(content) if kind == "dae" else content
        scene = trimesh.load_scene(
            io.BytesIO(plain), file_type=kind, process=False, skip_materials=True
        )
        points, triangles = _join(scene)
        if kind == "dae":
            points = points * _unit(content)
    except Exception as error:  # malformed files cause arbitrary exceptions in libraries
        reason = quoted(str(error) or type(error).__name__)
        raise ModelError(f"{shortened(path)}: the mesh cannot be read: {reason}") from None
    if not len(triangles) or len(triangles) > _MOST_READ or not np.isfinite(points).all():
        raise ModelError(
            f"{shortened(path)}: the mesh has {len(triangles)} triangles, or corners that are not"
            f" finite; give one of up to {_MOST_READ}"
        )
    return thin(points, triangles)


def _module(name: str, path: str) -> Any:
    """Import a library that reads meshes; raise a ModelError if it is not installed.

    `path` is the mesh file, for the error message.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise ModelError(
            f"{shortened(path)}: {name}, which reads meshes, is not installed; run: "
            + install_command("meshes")
        ) from None


def _join(scene: Any) -> tuple[Array, NDArray[np.int64]]:
    """Return points (n, 3) and triangles (m, 3) of all meshes of a file, in its root frame."""
    points, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not hasattr(mesh, "faces"):
            continue  # lines or point clouds
        corners, faces = np.array(mesh.vertices, dtype=float), np.array(mesh.faces)
        points.append(corners @ pose[:3, :3].T + pose[:3, 3])
        # the faces of a mirrored mesh are reversed
        oriented = faces[:, ::-1] if np.linalg.det(pose[:3, :3]) < 0 else faces
        triangles.append(oriented.astype(np.int64) + count)
        count += len(corners)
    return np.vstack(points), np.vstack(triangles)


def _without_materials(content: bytes) -> bytes:
    """Remove materials from a COLLADA file: pycollada drops surfaces with invalid materials."""
    root = ElementTree.fromstring(content)
    for element in list(root.iter()):
        for inner in list(element):
            if inner.tag.rpartition("}")[2] in _MATERIALS:
                element.remove(inner)
    return ElementTree.tostring(root)


_MATERIALS = {"bind_material"} | {
    f"library_{what}" for what in ("effects", "materials", "images", "cameras", "lights")
}


def _unit(content: bytes) -> float:
    """Return the length unit of a COLLADA file [m]; raise a ValueError if it is not positive."""
    found = _UNIT.search(content)
    unit = float(found[1]) if found else 1.0
    if not 0 < unit < np.inf:
        raise ValueError(f"its unit is {unit:g} m")
    return unit


def thin(points: Array, triangles: NDArray[np.int64], most: int = MOST_TRIANGLES) -> Mesh:
    """Simplify a mesh by merging all corners in a cell of a grid at their mean.

    A mesh that is small enough is returned unchanged.

    Source: Rossignac & Borrel 1993, vertex clustering.

    Args:
        points: corners (n, 3) [m].
        triangles: indices (m, 3) of points.
        most: largest number of triangles.

    Raises:
        ModelError: no grid reduces the mesh to this number of triangles.
    """
    count = len(triangles)
    for cells in _cells(most):
        if len(triangles) <= most and cells is None:
            return Mesh(points, triangles, count)
        if cells is None:
            continue
        low = points.min(axis=0)
        side = float(np.ptp(points, axis=0).max()) / cells
        keys = np.floor((points - low) / max(side, np.finfo(float).tiny)).astype(np.int64)
        _, home, many = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
        home = home.ravel()
        means = np.stack([np.bincount(home, weights=points[:, k]) for k in range(3)], axis=1)
        found = home[triangles]
        a, b, c = found.T
        found = found[(a != b) & (b != c) & (c != a)]
        found = found[np.unique(np.sort(found, axis=1), axis=0, return_index=True)[1]]
        if len(found) <= most:
            return Mesh(means / many[:, None], found, count)
    raise ModelError(f"a mesh of {count} triangles cannot be drawn with {most}; give a simpler one")


def _cells(most: int) -> Iterator[int | None]:
    """Yield None for the original mesh, then decreasing numbers of cells along the longest side.

    `most` is the largest number of triangles. A surface intersects about 6 n^2 of n^3 cells, with
    two triangles each.
    """
    yield None
    # start with a grid that is too fine even for a flat or thin mesh, and reduce by a sixth
    cells = 8.0 * np.sqrt(most)
    while cells > 1:
        yield int(cells)
        cells /= 1.2
    yield 1
