"""Places of the parts of parallel robots from the pose of the platform, in plain numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def three_spheres(centres, radius):
    """The lower one of the two points at the same distance from three centres, (3,)."""
    a, b, c = centres
    normal = np.cross(b - a, c - a)
    normal *= -np.sign(normal[2]) / np.linalg.norm(normal)
    rows = np.array([b - a, c - a, normal])
    middle = np.linalg.solve(rows, [rows[0] @ (a + b) / 2, rows[1] @ (a + c) / 2, normal @ a])
    return middle + np.sqrt(radius**2 - (middle - a) @ (middle - a)) * normal


def rotation(vector):
    """The rotation by |vector| about it."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    K = np.cross(np.asarray(vector) / angle, np.eye(3)).T
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def _circle(radius, degrees, height):
    angles = np.asarray(degrees)
    flat = np.column_stack([np.cos(angles), np.sin(angles)]) * radius
    return np.column_stack([flat, np.full(len(angles), height)])


_THIRD = 2 * np.pi / 3
_SPLAY = np.array([-1, 1, -1, 1, -1, 1])
_MIDDLE = _THIRD * np.array([0, 0, 1, 1, 2, 2])
LEGS = (
    _circle(0.6, _MIDDLE + _SPLAY * (np.pi / 3 - 0.2), 0.0),
    _circle(0.3, _MIDDLE + _SPLAY * 0.2, 0.7),
)
"""Lower and upper ends of the legs of `stewart_platform` where it is assembled."""


@dataclass(frozen=True)
class PlacedBody:
    """A body in the world: its inertia is principal, about com and in the axes of R."""

    mass: float
    com: np.ndarray
    R: np.ndarray
    inertia: np.ndarray

    def middle(self, other):
        """The orientation half-way to another one, nearby."""
        U, _, V = np.linalg.svd(self.R + other.R)
        return U @ V


def leg_bodies(pose):
    """The platform, six barrels and six pistons at (place, rotation vector), (6,)."""
    R = rotation(pose[3:])
    platform = PlacedBody(10.0, pose[:3] + R @ [0, 0, 0.02], R, np.array([0.24, 0.24, 0.45]))
    bodies = [platform]
    for low, high in zip(*LEGS, strict=True):
        head = pose[:3] + R @ (high - [0, 0, 0.7])
        length = np.linalg.norm(head - low)
        leg = _leg(high - low, head - low)
        along = leg[:, 2]
        for mass, at in ((2.0, 0.2), (0.8, length - 0.2)):
            across = mass * 0.4**2 / 12
            inertia = np.array([across, across, 5e-4 * mass])
            bodies.append(PlacedBody(mass, low + at * along, leg, inertia))
    return bodies


def _leg(rest, now):
    """Orientation of a leg on its universal joint, whose axes x, y are those at rest."""
    x, y, z = rest / np.linalg.norm(rest)
    azimuth, polar = np.arctan2(y, x), np.arccos(z)
    foot = rotation([0, 0, azimuth]) @ rotation([0, polar, 0])
    d = foot.T @ now / np.linalg.norm(now)
    return foot @ rotation([np.arctan2(-d[1], d[2]), 0, 0]) @ rotation([0, np.arcsin(d[0]), 0])
