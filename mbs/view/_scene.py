"""Scene: simple shapes on the links of a mechanism, for any viewer."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.palette import PALETTE
from mbs.view.posed import (
    Array,
    BoundingSphere,
    Floor,
    Values,
    bounds_of,
    floor_of,
    measures,
    picture_symbols,
    pose_links,
    pose_rows,
    position_of,
    views,
)
from mbs.view.primitives import (
    BallShape,
    BarShape,
    BoxShape,
    CylinderShape,
    FrameShape,
    MeshShape,
    Primitive,
    RingShape,
    Vector,
)
from mbs.view.shapes import (
    base_shapes,
    corners,
    figures,
    force_shapes,
    frame_shapes,
    joint_shapes,
    link_shapes,
    solid_shapes,
    visual_shapes,
)

HIDDEN = ("link frame", "label")
"""Roles that are hidden by default."""
COVERED = ("skeleton", "joint", "axis", "frame")
"""Roles that are also hidden by default if links have visual shapes."""

_MARGIN = 0.6  # margin of the bounds, relative to the length of frame axes, which extend further


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Shapes of a mechanism in the frames of its links [m], and view directions.

    Attributes:
        system: mechanism.
        primitives: shapes, each with its link (0 for the base) and its role: link, joint, axis,
            frame, loop, force, base, label, link frame. Shapes from `Mechanism.add_shape` or a
            robot file have the role visual, and the bars of their links the role skeleton.
        links: names of the base and the links.
        up: unit vector against gravity, in the base frame.
        size: size of the mechanism [m].
        bounds: sphere that contains the mechanism at the configuration q, in the base frame.
        floor: ground grid, in the base frame.
        views: unit vectors towards the viewer in the base frame: iso, front, side, top.
        q: configuration (nq,) at which the scene was made.
        parameters: values of the symbols that have a value.
        notes: sentences on meshes that are missing or simplified.
    """

    system: System
    primitives: tuple[Primitive, ...]
    links: tuple[str, ...]
    up: Vector
    size: float
    bounds: BoundingSphere
    floor: Floor
    views: Mapping[str, Vector]
    q: tuple[float, ...]
    parameters: Mapping[str, float]
    notes: tuple[str, ...] = ()

    def hidden(self, left_out: Collection[str] = ()) -> tuple[str, ...]:
        """Return the roles that a viewer hides by default.

        Args:
            left_out: further roles to hide. If it contains "visual", bars and joints are shown.
        """
        visual = any(item.role == "visual" for item in self.primitives)
        covered = COVERED if visual and "visual" not in left_out else ()
        return tuple(dict.fromkeys([*HIDDEN, *covered, *left_out]))

    def poses(self, q: Values = None, parameters: Mapping[str, float] | None = None) -> list[float]:
        """Return the poses of the base and the links: 12 numbers each, the rows of [R p].

        R is the rotation matrix and p the origin of the link frame in the base frame. Loops are not
        closed.

        Args:
            q: positions (nq,) [rad or m], or a dict of some positions by name, with others as in
                the assembled configuration. By default the configuration of the scene.
            parameters: values of symbols. Other symbols have the values of the scene.

        Raises:
            ModelError: a name is unknown, or the number of positions is wrong.
        """
        place = self.q if q is None else position_of(self.system, q)
        p = self._values(parameters)
        flat: list[float] = pose_rows(self.system, np.reshape(place, (-1, 1)), p).ravel().tolist()
        return flat

    def motion(self, q: Array) -> Array:
        """Return the poses of base and links along a motion.

        Args:
            q: configurations (n, nq), one per row [rad or m].

        Returns:
            Poses (n, 12 (links + 1)); each row has the numbers that `poses` returns.
        """
        p = self._values(None)
        return pose_rows(self.system, np.transpose(q), p).T

    def _values(self, parameters: Mapping[str, float] | None) -> list[float]:
        """Return the values of all parameters of the system.

        `parameters` override those of the scene.
        """
        values = {**self.parameters, **(parameters or {})}
        return self.system.parameter_values(values, picture_symbols(self.system))

    def spanning(self, q: Array) -> Scene:
        """Return a copy with bounds and ground for all configurations of a motion.

        Args:
            q: configurations (n, nq), one per row [rad or m].
        """
        marks = _bounding_points(self.primitives)
        poses = self.motion(q).reshape(len(q), -1, 3, 4)
        points = np.vstack([poses[:, k, :, :3] @ at + poses[:, k, :, 3] for k, at in marks])
        up, radius = np.array(self.up), self.bounds.radius
        # margin for shapes around the points, relative to the radius
        bounds = bounds_of(points, 0.08 * radius)
        ground = float(np.array(self.floor.center) @ up) * up
        return replace(self, bounds=bounds, floor=floor_of(np.vstack([points, ground]), up, bounds))

    def as_dict(self) -> dict[str, Any]:
        """Return the scene as a dict of names, numbers and lists that can be converted to JSON.

        It contains shapes, poses, bounds, ground, views, hidden roles and the palette of colours,
        for a viewer in a browser.
        """
        return {
            "name": self.system.name,
            "links": list(self.links),
            "primitives": [_primitive_data(item) for item in self.primitives],
            "poses": self.poses(),
            "up": list(self.up),
            "size": self.size,
            "bounds": asdict(self.bounds),
            "floor": asdict(self.floor),
            "views": {name: list(view) for name, view in self.views.items()},
            "hidden": list(self.hidden()),
            "palette": {theme: dict(colours) for theme, colours in PALETTE.items()},
        }


def scene(
    system: System, q: Values = None, *, parameters: Mapping[str, float] | None = None
) -> Scene:
    """Return the scene of a mechanism: shapes of links, joints, force elements and frames.

    Links with shapes from `Mechanism.add_shape` or a robot file are drawn with them. Bodies defined
    by dimensions (Box, Cylinder) are drawn to scale. Other links are bars between their joints.
    Sizes of joints and frames follow from the size of the mechanism. Loops are not closed.

    Args:
        system: mechanism, open or closed. Symbols in the geometry need a value; masses and gravity
            do not.
        q: configuration for bounds, ground and default poses: (nq,) [rad or m], or a dict of some
            positions by name. By default the assembled configuration.
        parameters: values of symbols. Other symbols have their default values.

    Raises:
        ModelError: `system` is not a System, a name is unknown, or a symbol has no value.
    """
    require_system(system)
    place = position_of(system, q)
    at = pose_links(system, place, parameters)
    solids = list(solid_shapes(at))
    notes: list[str] = []
    visuals = list(visual_shapes(at, notes))
    seen = {item.link for item in visuals}
    drawn = list(figures(at, notes))
    spread = np.vstack(
        [np.zeros((0, 3)), *(corners(at, item) for item in (*solids, *visuals, *drawn))]
    )
    sizes = measures(at, spread)
    points = np.vstack([np.zeros((1, 3)), at.points, spread])
    if not np.isfinite(points).all():
        raise ModelError(
            f"{system.name}: a point of the picture is not finite; check the values of the symbols"
        )
    bounds = bounds_of(points, _MARGIN * sizes.frame)
    floor = floor_of(points, at.up, bounds, _ground_clearance(at.system) * sizes.joint)
    level = float(np.array(floor.center) @ at.up)
    primitives = (
        *base_shapes(at, sizes, level, seen),
        *solids,
        *visuals,
        *link_shapes(at, sizes, solids, seen),
        *joint_shapes(at, sizes),
        *force_shapes(at, sizes),
        *drawn,
        *frame_shapes(at, sizes),
    )
    up = (float(at.up[0]), float(at.up[1]), float(at.up[2]))
    names = ("base", *(row.name for row in system.links))
    return Scene(
        system,
        primitives,
        names,
        up,
        sizes.size,
        bounds,
        floor,
        views(at),
        tuple(place),
        {name: value for name, value in at.parameters.items() if not math.isnan(value)},
        tuple(notes),
    )


def _ground_clearance(system: System) -> float:
    """Return the height of the mechanism above the ground, in radii of a revolute joint.

    It is 0 for mechanisms with wheels or a free joint, and 4 otherwise.
    """
    kinds = {joint.kind for joint in system.joints}
    return 0.0 if kinds & {"rollingdisc", "free"} else 4.0


def _primitive_data(item: Primitive) -> dict[str, Any]:
    """Return a primitive as a dict of its fields and of its kind, such as "bar"."""
    return {"kind": type(item).__name__.removesuffix("Shape").lower(), **asdict(item)}


def _bounding_points(primitives: tuple[Primitive, ...]) -> list[tuple[int, Array]]:
    """Return (link number, point in the link frame [m]) of the primitives.

    The bounds of a motion are computed from these points.
    """
    found: list[tuple[int, Array]] = []
    for item in primitives:
        if isinstance(item, (BarShape, CylinderShape)):
            found += [(item.link, np.array(item.a)), (item.link, np.array(item.b))]
        elif isinstance(item, (BallShape, RingShape)):
            found.append((item.link, np.array(item.at)))
        elif isinstance(item, (BoxShape, FrameShape, MeshShape)):
            found.append((item.link, np.array(item.pose).reshape(3, 4)[:, 3]))
    return found
