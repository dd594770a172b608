"""How one looks at a mechanism: into its plane where it has one, else from above at an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PARALLEL = 1e-6
_ELEVATION = math.radians(22)
_AZIMUTHS = tuple(
    math.radians(quarter + degrees) for quarter in (-90, 0) for degrees in (25, 35, 45, 55, 65)
)
"""Directions that are tried, none of them along an axis of the base."""


@dataclass(frozen=True, slots=True, eq=False)
class Projection:
    """An orthographic view.

    Attributes:
        right, up: (3,) unit vectors of the base frame along the sides of the drawing.
        caption: what one looks at, in words.
    """

    right: Array
    up: Array
    caption: str

    @property
    def towards(self) -> Array:
        """(3,) unit vector to the eye."""
        return np.cross(self.right, self.up)

    def of(self, vectors: Array) -> Array:
        """(k, 2) of (k, 3) points or directions."""
        return vectors @ np.column_stack((self.right, self.up))


def projection(points: Array, turns: Array, slides: Array, gravity: Array) -> Projection:
    """The view of a mechanism that shows most of it.

    Args:
        points: (k, 3) [m].
        turns: (m, 3) axes of rotations.
        slides: (n, 3) axes of translations.
        gravity: (3,), its direction is down; z is up without it.
    """
    size = float(np.linalg.norm(gravity))
    up = -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])
    normal = _plane(turns, slides)
    if normal is not None:
        return _facing(normal, up)
    return max((_above(up, azimuth) for azimuth in _AZIMUTHS), key=lambda v: _spread(v, points))


def _plane(turns: Array, slides: Array) -> Array | None:
    """The normal of the plane in which everything moves, if there is one."""
    if not len(turns):
        return None
    normal: Array = turns[0]
    askew = np.linalg.norm(np.cross(turns, normal), axis=1).max(initial=0.0)
    leaning = np.abs(slides @ normal).max(initial=0.0)
    return normal if max(askew, leaning) < _PARALLEL else None


def _facing(normal: Array, up: Array) -> Projection:
    upwards = up - normal * (up @ normal)
    if np.linalg.norm(upwards) < _PARALLEL:
        upwards = np.eye(3)[1] if abs(normal[1]) < 0.5 else np.eye(3)[2]
        upwards = upwards - normal * (upwards @ normal)
    upwards = upwards / np.linalg.norm(upwards)
    right = np.cross(upwards, normal)
    if right[np.argmax(np.abs(right))] < 0:
        right = -right
    return Projection(right, upwards, "in the plane of the motion")


def _above(up: Array, azimuth: float) -> Projection:
    side = np.eye(3)[int(np.argmin(np.abs(up)))]
    front = side - up * (side @ up)
    front /= np.linalg.norm(front)
    left = np.cross(up, front)
    away = math.cos(azimuth) * front + math.sin(azimuth) * left
    towards = math.cos(_ELEVATION) * away + math.sin(_ELEVATION) * up
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    return Projection(right, np.cross(towards, right), "seen from above at an angle")


def _spread(view: Projection, points: Array) -> float:
    """How much of the drawing the points take, rounded so that ties stay ties."""
    flat = view.of(points - points.mean(axis=0))
    return float(np.format_float_scientific(np.linalg.det(flat.T @ flat), precision=6))
