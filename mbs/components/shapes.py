"""Shapes of bodies in pictures: boxes, cylinders, capsules, spheres and meshes, without mass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from mbs.errors import DescriptionError
from mbs.files import PathLike
from mbs.text import did_you_mean, quoted

ShapeKind = Literal["box", "cylinder", "capsule", "sphere", "ellipsoid", "mesh"]

_SIZES: dict[str, str] = {
    "box": "its sides along x, y, z",
    "cylinder": "radius, length",
    "capsule": "radius, length without its ends",
    "sphere": "radius",
    "ellipsoid": "its half axes along x, y, z",
    "mesh": "factors along x, y, z",
}
_MESH_KINDS = (".stl", ".obj", ".dae")
"""Endings of mesh files that can be drawn."""


@dataclass(frozen=True, slots=True)
class Shape:
    """Shape of a body at one of its points, for pictures, without mass and contact.

    The axis of a cylinder or a capsule is z. All shapes except meshes are centred at the point.

    Attributes:
        kind: box, cylinder, capsule, sphere, ellipsoid or mesh.
        size: lengths [m]: three sides of a box, radius and length of a cylinder or of a capsule
            (without its round ends), radius of a sphere, half axes of an ellipsoid. For a mesh:
            three scale factors, which may be negative to mirror it.
        colour: red, green and blue from 0 to 1. None for the colour of the link.
        mesh: .stl, .obj or .dae file of a mesh, which is read when a picture is made.
    """

    kind: ShapeKind
    size: tuple[float, ...] = (1.0, 1.0, 1.0)
    colour: tuple[float, float, float] | None = None
    mesh: PathLike | None = None

    def __post_init__(self) -> None:
        if self.kind not in get_args(ShapeKind):
            raise DescriptionError(
                f"shape: kind is {quoted(self.kind)}; {did_you_mean(self.kind, _SIZES)}"
            )
        size = _numbers(self.size)
        if not self._is_possible(size):
            above = "finite and not zero" if self.kind == "mesh" else "above zero"
            raise DescriptionError(
                f"{self.kind}: size is {quoted(self.size)}; give {_SIZES[self.kind]}, {above}"
            )
        object.__setattr__(self, "size", size)
        if self.colour is not None:
            colour = _numbers(self.colour)
            if len(colour) != 3 or not all(0 <= part <= 1 for part in colour):
                raise DescriptionError(
                    f"{self.kind}: colour is {quoted(self.colour)}; give red, green and blue from"
                    " 0 to 1"
                )
            object.__setattr__(self, "colour", colour)
        if (self.mesh is None) == (self.kind == "mesh"):
            raise DescriptionError(
                f"{self.kind}: mesh is {quoted(self.mesh)}; give a file to a mesh, and to nothing"
                " else"
            )
        if self.mesh is not None and not is_mesh_file(str(self.mesh)):
            raise DescriptionError(
                f"mesh: {quoted(str(self.mesh))} is of another kind;"
                f" give a file {', '.join(_MESH_KINDS[:-1])} or {_MESH_KINDS[-1]}"
            )

    def _is_possible(self, size: tuple[float, ...]) -> bool:
        """Return whether `size` has the number of lengths for `kind`, all of them in range."""
        expected = {"sphere": 1, "cylinder": 2, "capsule": 2}.get(self.kind, 3)
        if len(size) != expected or not all(map(math.isfinite, size)):
            return False
        if self.kind == "mesh":
            return all(size)
        if self.kind == "capsule":  # a capsule without length is a sphere
            return size[0] > 0 and size[1] >= 0
        return all(length > 0 for length in size)


def is_mesh_file(name: str) -> bool:
    """Return whether a file name has the ending of a mesh format that can be drawn."""
    return name.lower().endswith(_MESH_KINDS)


def _numbers(values: Any) -> tuple[float, ...]:
    """Return the numbers in a value as a tuple; empty if it is not numeric."""
    try:
        return tuple(float(value) for value in np.ravel(np.asarray(values, dtype=float)))
    except (TypeError, ValueError):
        return ()
