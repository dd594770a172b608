"""Wheel sets that roll without slipping."""

from __future__ import annotations

from collections.abc import Mapping

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.custom import At, Custom, Row


class WheelSet(Custom):
    """Two wheels on one axle that roll on a plane without slipping.

    The plane is z = 0 of the frame `ground`, whose z points to the wheels. The axle is y of the
    frame `axle`, whose origin is the middle between the wheels; the left wheel is at y > 0. Two
    constraint rows on positions keep the axle at the height of the radius and parallel to the
    plane. Three rows on velocities, in the direction of travel and along the axle, prevent slip.
    They are independent at every heading. The wheels themselves are bodies on revolute joints about
    y.

    Source: Modelica Association 2023, `Joints.RollingWheelSet`, whose axle does not pitch.

    Attributes:
        ground: frame of the plane.
        axle: frame on the body that carries the wheels.
        left: name of the coordinate of the left wheel, its angle relative to `axle` about y.
        right: name of the coordinate of the right wheel, its angle relative to `axle` about y.
        radius: radius of the wheels [m].
        track: distance of the wheels [m].
        force_left: force of the ground on the left wheel in the direction of travel [N].
        force_right: force of the ground on the right wheel in the direction of travel [N].
        force_lateral: force of the ground on both wheels along the axle [N].
        force_normal: force of the ground on both wheels away from the plane [N].
    """

    ground = custom.frame()
    axle = custom.frame()
    left = custom.coordinate()
    right = custom.coordinate()
    radius = custom.parameter("m", positive=True)
    track = custom.parameter("m", positive=True)
    force_left = custom.output("N")
    force_right = custom.output("N")
    force_lateral = custom.output("N")
    force_normal = custom.output("N")

    def rows(self, at: At) -> Mapping[str, Row | SX]:
        """Return the position rows "height" [m] and "level".

        "height" is the height of the axle centre above the plane less the radius. "level" is the
        cosine between the axle and the normal of the plane.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        motion = at.ground.to(at.axle)
        return {"height": motion.p[2] - at.radius, "level": Row(motion.R[2, 1], "1")}

    def positive(self, at: At) -> Mapping[str, SX]:
        """Return {"upright": cosine of the z axes of `axle` and `ground`}, to be positive.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"upright": at.ground.to(at.axle).R[2, 2]}

    def velocity_rows(self, at: At) -> Mapping[str, SX]:
        """Return slip velocities [m/s]: "lateral" along the axle, "left" and "right" ahead.

        "left" and "right" are the velocities of the lowest point of each wheel in the direction of
        travel.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        motion = at.ground.to(at.axle)
        axle = motion.R[:, 1]
        ahead = casadi.vertcat(axle[1], -axle[0], SX(0))
        speed, spin = casadi.dot(ahead, motion.V), casadi.dot(axle, motion.w)
        turn = at.track / 2 * motion.w[2]
        return {
            "lateral": casadi.dot(axle, motion.V),
            "left": speed - turn - at.radius * (spin + at.left.v),
            "right": speed + turn - at.radius * (spin + at.right.v),
        }

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return the forces of the ground ON the wheels [N].

        Names: force_left and force_right in the direction of travel, force_lateral along y of the
        axle, force_normal away from the plane.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {
            "force_left": at.lam["left"],
            "force_right": at.lam["right"],
            "force_lateral": at.lam["lateral"],
            "force_normal": at.lam["height"],
        }
