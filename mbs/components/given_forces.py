"""Forces, torques and efforts that come from outside: inputs of runs, FMUs, controllers, wires."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.custom import Custom, Load
from mbs.components.drives import Device, TwoFlanges
from mbs.errors import DescriptionError
from mbs.text import quoted

_AXES = ("world", "body")


class _GivenOnPoint(Custom):
    """Three inputs on a point, along the axes of the world or of the point."""

    point = custom.frame()
    axes: str = field(default="world", kw_only=True)

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        if self.axes not in _AXES:
            raise DescriptionError(
                f"{self.name}: axes is {quoted(self.axes)}; use 'world', or 'body' for those of the"
                " point, which rotate with it"
            )


class ForceInput(_GivenOnPoint):
    """A force on a point: the inputs x, y and z [N].

    Attributes:
        point: of a body, or a body for its reference frame.
        axes: "world" for components along axes fixed in space, "body" for those of the point,
            which rotate with it.
    """

    x = custom.input("N")
    y = custom.input("N")
    z = custom.input("N")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The force, without a moment about its point."""
        F = casadi.vertcat(at.x, at.y, at.z)
        return {"point": custom.force(F, own_axes=self.axes == "body")}


class TorqueInput(_GivenOnPoint):
    """A torque on a body: the inputs x, y and z [N m].

    Attributes:
        point: of a body, or a body for its reference frame.
        axes: "world" for components along axes fixed in space, "body" for those of the point,
            which rotate with it.
    """

    x = custom.input("N.m")
    y = custom.input("N.m")
    z = custom.input("N.m")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The torque alone."""
        T = casadi.vertcat(at.x, at.y, at.z)
        return {"point": custom.torque(T, own_axes=self.axes == "body")}


class PairForceInput(Custom):
    """A force on point b along the axes of frame a, and its reaction on the body of a.

    The inputs are x, y and z [N]. The line of action goes through b, so that the reaction has the
    moment p x F about the origin of a, p being the origin of b in frame a.

    Attributes:
        a, b: points of two bodies, or bodies for their reference frames.
    """

    a = custom.frame()
    b = custom.frame()
    x = custom.input("N")
    y = custom.input("N")
    z = custom.input("N")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The force on b, the opposite wrench on a."""
        F = casadi.vertcat(at.x, at.y, at.z)
        on_a = custom.FrameLoad(-F, -casadi.cross(at.a.to(at.b).p, F))
        return custom.between(at.a, at.b, on_a)


class PairTorqueInput(Custom):
    """A torque on the body of b along the axes of frame a, and its reaction on the body of a.

    The inputs are x, y and z [N m].

    Attributes:
        a, b: points of two bodies, or bodies for their reference frames.
    """

    a = custom.frame()
    b = custom.frame()
    x = custom.input("N.m")
    y = custom.input("N.m")
    z = custom.input("N.m")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The torque on b, the opposite on a."""
        T = casadi.vertcat(at.x, at.y, at.z)
        return custom.between(at.a, at.b, custom.FrameLoad(SX.zeros(3), -T), T)


class LineForceInput(Custom):
    """A force along the line from a to b: the input `tension` [N] draws the points together.

    A tension below zero pushes them apart, as a hydraulic cylinder does.

    Attributes:
        a, b: points of two bodies, or bodies for their reference frames.
    """

    a = custom.frame()
    b = custom.frame()
    tension = custom.input("N")
    length = custom.output("m")
    speed = custom.output("m/s")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The tension, each point towards the other."""
        return custom.pull(at.a, at.b, at.tension)

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """The distance of the points and its rate."""
        motion = at.a.to(at.b)
        return {"length": motion.length, "speed": motion.rate}


class JointEffort(Custom):
    """An effort along a coordinate of a joint: the input `tau` [N m or N].

    It is added to what motors deliver and, other than these, is no part of the efforts tau of
    models: `inverse_dynamics` takes it off what the motors need.

    Attributes:
        joint: name of the coordinate: the joint, with a suffix when it has several.
    """

    joint = custom.coordinate()
    tau = custom.input(custom.EFFORT)

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The input."""
        return {"joint": at.tau}


class ShaftTorqueInput(TwoFlanges):
    """A torque between two shafts: the input `tau` [N m] on flange_b, the opposite on flange_a."""

    tau = custom.input("N.m")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The input on flange_b, its reaction on flange_a."""
        return {"flange_a": -at.tau, "flange_b": at.tau}


class SlidingForceInput(TwoFlanges):
    """A force between flanges that slide: the input `force` [N] on flange_b, its opposite on a."""

    flange_a = custom.flange(slides=True)
    flange_b = custom.flange(slides=True)
    force = custom.input("N")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The input on flange_b, its reaction on flange_a."""
        return {"flange_a": -at.force, "flange_b": at.force}


class ForceSource(Device):
    """A given force on a flange that slides, as a motor: the input `force` [N].

    What it delivers is in the efforts tau of models, as that of a TorqueSource on a shaft is.
    """

    flange = custom.flange(slides=True)
    force = custom.input("N")
    v = custom.output("m/s")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The input."""
        return {"flange": at.force}

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """The velocity of the flange."""
        return {"v": at.flange.speed}
