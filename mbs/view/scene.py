"""A mechanism as simple shapes on its links, for any viewer."""

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
"""Roles that are not shown until asked for."""
COVERED = ("skeleton", "joint", "axis", "frame")
"""Roles that are not shown either where links are drawn as they look, which they would cover."""

_MARGIN = 0.6  # of the length of the axes of frames, which reach beyond what they stand on


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Shapes on links, and where they are seen from; lengths in m, in the frames of the links.

    Attributes:
        system: the mechanism.
        primitives: the shapes, each with its link (0 the base) and its role: link, joint, axis,
            frame, loop, force, base, label, link frame; visual for what the description says that
            a link looks like, and skeleton for the bars of these links.
        links: names of the base and the links.
        up: unit vector against gravity.
        size: of the mechanism [m].
        bounds: a sphere that contains it at the configuration q.
        floor: the ground grid.
        views: unit vectors towards who looks: iso, front, side, top.
        q: (nq,) configuration that it was made at.
        parameters: values of the symbols that have one.
        notes: sentences on meshes that are missing or were thinned out.
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
        """Roles that are not shown until asked for.

        Args:
            left_out: roles that are not to be shown; without "visual" the mechanism is its joints
                and bars again.
        """
        visual = any(item.role == "visual" for item in self.primitives)
        covered = COVERED if visual and "visual" not in left_out else ()
        return tuple(dict.fromkeys([*HIDDEN, *covered, *left_out]))

    def poses(self, q: Values = None, parameters: Mapping[str, float] | None = None) -> list[float]:
        """Where the base and the links are: 12 numbers each, the rows of R|p in the base frame.

        Args:
            q: (nq,) positions [rad or m], or by name, the others as in the assembled
                configuration; that of the scene when left out. Loops are not closed here.
            parameters: values of symbols, the others as in the scene.

        Raises:
            ModelError: a name is unknown, or the numbers do not fit.
        """
        place = self.q if q is None else position_of(self.system, q)
        p = self._values(parameters)
        flat: list[float] = pose_rows(self.system, np.reshape(place, (-1, 1)), p).ravel().tolist()
        return flat

    def motion(self, q: Array) -> Array:
        """(n, 12 links) poses, as `poses` gives them, at each of n configurations q (n, nq)."""
        p = self._values(None)
        return pose_rows(self.system, np.transpose(q), p).T

    def _values(self, parameters: Mapping[str, float] | None) -> list[float]:
        values = {**self.parameters, **(parameters or {})}
        return self.system.parameter_values(values, picture_symbols(self.system))

    def spanning(self, q: Array) -> Scene:
        """The same scene with bounds and ground for all of n configurations q (n, nq)."""
        marks = _marks(self.primitives)
        poses = self.motion(q).reshape(len(q), -1, 3, 4)
        points = np.vstack([poses[:, k, :, :3] @ at + poses[:, k, :, 3] for k, at in marks])
        up, radius = np.array(self.up), self.bounds.radius
        # room for what is drawn around points, in parts of the radius
        bounds = bounds_of(points, 0.08 * radius)
        ground = float(np.array(self.floor.center) @ up) * up
        return replace(self, bounds=bounds, floor=floor_of(np.vstack([points, ground]), up, bounds))

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, texts, lists and dicts, as JSON has them."""
        return {
            "name": self.system.name,
            "links": list(self.links),
            "primitives": [_plain(item) for item in self.primitives],
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
    """The shapes that stand for a mechanism.

    Links are drawn as their shapes say, where the description has them; bodies that were described
    by their dimensions as they are, the other links as bars between their joints. Sizes of joints
    and frames follow from the size of the mechanism.

    Args:
        system: open or closed. Symbols on which places of links depend need a value; masses and
            gravity need none.
        q: configuration that bounds and ground are for, and the poses unless others are asked for:
            (nq,) [rad or m], or by name; the assembled one when left out. Loops are not closed
            here.
        parameters: values of symbols, the others at their defaults.

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
    floor = floor_of(points, at.up, bounds, _gap(at.system) * sizes.joint)
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


def _gap(system: System) -> float:
    """How far the ground is below, in radii of joints: wheels touch it, arms stand above it."""
    kinds = {joint.kind for joint in system.joints}
    return 0.0 if kinds & {"rollingdisc", "free"} else 4.0


def _plain(item: Primitive) -> dict[str, Any]:
    return {"kind": type(item).__name__.removesuffix("Shape").lower(), **asdict(item)}


def _marks(primitives: tuple[Primitive, ...]) -> list[tuple[int, Array]]:
    """Points of shapes on their links, which bound a motion."""
    found: list[tuple[int, Array]] = []
    for item in primitives:
        if isinstance(item, (BarShape, CylinderShape)):
            found += [(item.link, np.array(item.a)), (item.link, np.array(item.b))]
        elif isinstance(item, (BallShape, RingShape)):
            found.append((item.link, np.array(item.at)))
        elif isinstance(item, (BoxShape, FrameShape, MeshShape)):
            found.append((item.link, np.array(item.pose).reshape(3, 4)[:, 3]))
    return found
