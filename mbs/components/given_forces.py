"""Forces, torques and efforts from inputs of simulations, FMUs, controllers and wires."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.custom import At, Custom, Load
from mbs.components.drives import Device, TwoFlanges


class _GivenOnPoint(Custom):
    """Base of vectors with three inputs on a point, in axes of the world or of the point."""

    point = custom.frame()
    axes: str = field(default="world", kw_only=True)

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        self._require_axes()


class ForceInput(_GivenOnPoint):
    """A force on a point, with the inputs x, y and z [N].

    Attributes:
        point: point of a body. A body stands for its reference frame.
        axes: "world" for components along axes fixed in space, "body" for components along the axes
            of the point, which rotate with it.
    """

    x = custom.input("N")
    y = custom.input("N")
    z = custom.input("N")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"point": force (x, y, z) ON the body [N]} at the origin of the point.

        The components are along the axes of the world or of the point, see `axes`. No other body
        gets a reaction.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        F = casadi.vertcat(at.x, at.y, at.z)
        return {"point": custom.force(F, own_axes=self.axes == "body")}


class TorqueInput(_GivenOnPoint):
    """A torque on a body, with the inputs x, y and z [N m].

    Attributes:
        point: point of a body. A body stands for its reference frame.
        axes: "world" for components along axes fixed in space, "body" for components along the axes
            of the point, which rotate with it.
    """

    x = custom.input("N.m")
    y = custom.input("N.m")
    z = custom.input("N.m")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"point": torque (x, y, z) ON the body [N m]}, without a reaction on other bodies.

        The components are along the axes of the world or of the point, see `axes`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        T = casadi.vertcat(at.x, at.y, at.z)
        return {"point": custom.torque(T, own_axes=self.axes == "body")}


class PairForceInput(Custom):
    """A force on point b along the axes of frame a, and its reaction on the body of a.

    The inputs are x, y and z [N]. The line of action passes through b, so that the reaction has the
    moment -p x F about the origin of a, with the position p of the origin of b in frame a.

    Attributes:
        a, b: points of two bodies. A body stands for its reference frame.
    """

    a = custom.frame()
    b = custom.frame()
    x = custom.input("N")
    y = custom.input("N")
    z = custom.input("N")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the wrenches by "a" and "b": force (x, y, z) ON b at its origin, reaction ON a.

        Each is in axes of its own frame, about its own origin [N, N m].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        F = casadi.vertcat(at.x, at.y, at.z)
        on_a = custom.FrameLoad(-F, -casadi.cross(at.a.to(at.b).p, F))
        return custom.between(at.a, at.b, on_a)


class PairTorqueInput(Custom):
    """A torque on the body of b along the axes of frame a, and its reaction on the body of a.

    The inputs are x, y and z [N m].

    Attributes:
        a, b: points of two bodies. A body stands for its reference frame.
    """

    a = custom.frame()
    b = custom.frame()
    x = custom.input("N.m")
    y = custom.input("N.m")
    z = custom.input("N.m")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the torques by "a" and "b": (x, y, z) ON b, the opposite ON a [N m].

        The inputs are along the axes of a. Each load is converted to axes of its own frame.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        T = casadi.vertcat(at.x, at.y, at.z)
        return custom.between(at.a, at.b, custom.FrameLoad(SX.zeros(3), -T), T)


class LineForceInput(Custom):
    """A force along the line from a to b: the input `tension` [N] pulls the points together.

    A negative tension pushes them apart, as a hydraulic cylinder does.

    Attributes:
        a, b: points of two bodies. A body stands for its reference frame.
    """

    a = custom.frame()
    b = custom.frame()
    tension = custom.input("N")
    length = custom.output("m")
    speed = custom.output("m/s")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the forces ON the points "a" and "b": `tension` [N], towards the other point.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return custom.pull(at.a, at.b, at.tension)

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return "length": distance of the points [m], and "speed": its rate [m/s].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        motion = at.a.to(at.b)
        return {"length": motion.length, "speed": motion.rate}


class JointEffort(Custom):
    """An effort along a joint coordinate, with the input `tau` [N m or N].

    It acts in addition to the motors. It is not part of the efforts tau of models:
    `inverse_dynamics` subtracts it from the required motor efforts.

    Attributes:
        joint: name of the coordinate: the joint, with a suffix if the joint has several.
    """

    joint = custom.coordinate()
    tau = custom.input(custom.EFFORT)

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"joint": effort ON the coordinate [N m or N]}, equal to the input `tau`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"joint": at.tau}


class ShaftTorqueInput(TwoFlanges):
    """A torque between two shafts: the input `tau` [N m] on flange_b, the opposite on flange_a."""

    tau = custom.input("N.m")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the torques ON the shafts [N m]: `tau` on "flange_b", -`tau` on "flange_a".

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"flange_a": -at.tau, "flange_b": at.tau}


class SlidingForceInput(TwoFlanges):
    """A force between sliding flanges: the input `force` [N] on flange_b, its opposite on a."""

    flange_a = custom.flange(slides=True)
    flange_b = custom.flange(slides=True)
    force = custom.input("N")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the forces ON the flanges [N]: `force` on "flange_b", -`force` on "flange_a".

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"flange_a": -at.force, "flange_b": at.force}


class ForceSource(Device):
    """An imposed force on a sliding flange, as a motor: the input `force` [N].

    Its force is part of the efforts tau of models, as the torque of a TorqueSource on a shaft.
    """

    flange = custom.flange(slides=True)
    force = custom.input("N")
    v = custom.output("m/s")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"flange": force ON the sliding part [N]}, equal to the input `force`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"flange": at.force}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"v": velocity of the flange [m/s]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"v": at.flange.speed}
