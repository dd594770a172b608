"""Numbers in URDF elements: vectors, origins and inertials."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NoReturn
from xml.etree.ElementTree import Element

import numpy as np

from mbs.errors import DescriptionError
from mbs.expressions import plain_numbers

Vector = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Reader:
    """Reads the numbers of one link or joint; `where` says which in the messages."""

    where: str

    def fail(self, message: str) -> NoReturn:
        """Refuse the element."""
        raise DescriptionError(f"{self.where}: {message}")

    def number(self, element: Element | None, key: str, default: float) -> float:
        """One number of an element that may be missing."""
        return self.vector(element, key, (default,))[0]

    def vector(self, element: Element | None, key: str, default: Vector) -> Vector:
        """As many numbers as the default has."""
        text = None if element is None else element.get(key)
        if text is None:
            return default
        return plain_numbers(text, len(default), f"{self.where}: {key}")


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass [kg], centre of mass [m] and (3, 3) inertia about it [kg m^2], in the link's frame."""

    mass: float = 0.0
    com: Vector = (0.0, 0.0, 0.0)
    tensor: Any = (0.0, 0.0, 0.0)


def origin_of(reader: Reader, element: Element) -> tuple[Vector, list[tuple[str, float]]]:
    """Position [m] and the turns about z, y, x [rad] of the <origin> of an element."""
    origin = element.find("origin")
    xyz = reader.vector(origin, "xyz", (0.0, 0.0, 0.0))
    roll, pitch, yaw = reader.vector(origin, "rpy", (0.0, 0.0, 0.0))
    turns = [(axis, angle) for axis, angle in (("z", yaw), ("y", pitch), ("x", roll)) if angle]
    return xyz, turns


def read_inertial(reader: Reader, link: Element) -> Inertial:
    """The inertial of a link, without mass if it has none.

    Raises:
        DescriptionError: a number is missing or cannot be read.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return Inertial()
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or mass.get("value") is None:
        reader.fail("its inertial has no mass; give <mass value='...'/>")
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    Ixx, Ixy, Ixz, Iyy, Iyz, Izz = (reader.number(inertia, key, 0.0) for key in keys)
    com, turns = origin_of(reader, inertial)
    tensor = np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]])
    for axis, angle in reversed(turns):
        R = _turn(axis, angle)
        tensor = np.einsum("ij,jk,lk->il", R, tensor, R)
    tensor = (tensor + tensor.T) / 2
    return Inertial(reader.number(mass, "value", 0.0), com, tensor.tolist())


def _turn(axis: str, angle: float) -> Any:
    k = "xyz".index(axis)
    c, s = math.cos(angle), math.sin(angle)
    R = np.eye(3)
    i, j = (k + 1) % 3, (k + 2) % 3
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = -s, s
    return R
