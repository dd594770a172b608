"""Where a picture is seen from, and how points of space fall on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs.errors import ModelError
from mbs.messages import did_you_mean
from mbs.view.posed import Array
from mbs.view.scene import Scene

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
    away = 1.06 * scene.bounds.radius / float(np.sin(FIELD / 2))
    axes = np.vstack([right, np.cross(out, right), out])
    return Camera(np.array(scene.bounds.center) + away * out, axes, away)
