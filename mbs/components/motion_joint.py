"""Joints defined by the pose of frame_b in frame_a as a function of coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.component import Point
from mbs.components.custom import At, Custom, Row
from mbs.components.joints import Free
from mbs.errors import DescriptionError
from mbs.spatial import Pose, vector
from mbs.text import quoted


class MotionJoint(Custom):
    """A joint defined by its motion: a subclass declares coordinates as unknowns and has `motion`.

        class Corkscrew(MotionJoint):
            lead = custom.parameter("m")
            phi = custom.unknown("rad")

            def motion(self, at):
                return rotation("z", at.phi) @ translation(0, 0, at.lead * at.phi)

    It is connected as any joint, `m.connect(point_a, joint, point_b)`. Constraint rows keep frame_b
    at the pose that `motion` returns, in a loop or not. The coordinates are named NAME.of_it.
    Sequences of rotations and translations are more efficient as `freedoms` of a `Joint`.

    Source: Haug 1989, chapter 9, for constraints between two frames.
    """

    frame_a = custom.Declared("frame", default=None)
    frame_b = custom.Declared("frame", default=None)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if cls.motion is MotionJoint.motion:
            raise DescriptionError(
                f"{cls.__name__}: a MotionJoint needs a method motion(self, at), which returns the"
                " pose of frame_b in frame_a"
            )

    def motion(self, at: At) -> Pose:
        """Return the required pose of frame_b relative to frame_a.

        A subclass writes it with `rotation` and `translation`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        raise NotImplementedError

    def between(self, a: Point, b: Point) -> tuple[MotionJoint, Free]:
        """Return a copy of the joint on two points, and a Free joint to connect the points.

        Args:
            a: point for frame_a.
            b: point for frame_b.
        """
        points: dict[str, Any] = {"frame_a": a, "frame_b": b}
        return replace(self, **points), Free(f"{self.name}.free")

    def rows(self, at: At) -> Mapping[str, Row | SX]:
        """Return six rows: position and rotation error of frame_b relative to the pose of `motion`.

        "force x", "force y", "force z" are the position error in axes of frame_a [m]. "moment x",
        "moment y", "moment z" are the rotation error sin(theta) u in axes of `motion`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        offset, R = self._displacement(at)
        p = casadi.vertsplit(casadi.densify(offset))
        x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
        return {
            **{f"force {axis}": Row(value) for axis, value in zip("xyz", p, strict=True)},
            **{f"moment {a}": Row(0.5 * r, "1") for a, r in zip("xyz", (x, y, z), strict=True)},
        }

    def positive(self, at: At) -> Mapping[str, SX]:
        """Return "axis x", "axis y", "axis z": cosines between axes of frame_b and of `motion`.

        Positive values exclude configurations whose rows are zero with an opposed axis.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        _, R = self._displacement(at)
        return {f"axis {axis}": R[k, k] for k, axis in enumerate("xyz")}

    def _displacement(self, at: At) -> tuple[SX, SX]:
        """Return the position error (3, 1) and the rotation (3, 3) of frame_b relative to `motion`.

        The position error is in axes of frame_a [m], the rotation in axes of `motion`. Raise
        DescriptionError if `motion` returns no pose.
        """
        seen, target = at.frame_a.to(at.frame_b), self.motion(at)
        if not isinstance(target, Pose):
            raise DescriptionError(
                f"{self.name}: motion returns a {type(target).__name__}; return what rotation(...)"
                " and translation(...) make, joined by @"
            )
        return seen.p - target.p, casadi.mtimes(target.R.T, seen.R)


def rotation(axis: str, angle: Any) -> Pose:
    """Return the pose of a frame rotated about a coordinate axis.

    Args:
        axis: "x", "y" or "z".
        angle: angle [rad], a number or an expression.

    Raises:
        DescriptionError: the axis is another value.
    """
    if axis not in ("x", "y", "z"):
        raise DescriptionError(f'a rotation is about {quoted(axis)}; give "x", "y" or "z"')
    return Pose.about(axis, SX(angle))


def translation(x: Any = 0, y: Any = 0, z: Any = 0) -> Pose:
    """Return the pose of a frame displaced by (x, y, z) [m], numbers or expressions."""
    return Pose.translation(vector([SX(x), SX(y), SX(z)]))
