"""Ropes over pulleys, through any number of points, with the same tension everywhere."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from casadi import SX

from mbs.components import custom
from mbs.components.component import Point
from mbs.components.custom import At, Custom, FrameLoad, Load, Row
from mbs.components.forces import one_sided_damping, smooth_ramp
from mbs.errors import DescriptionError
from mbs.text import quoted

_TAUT = 1e-3
"""Stretch over which a rope becomes stiff [m]: 1 mm, over which its strands settle."""


class _Rope(Custom):
    """A massless rope along a path of points. Pulleys on the path have no size and no friction."""

    path: Any
    length = custom.parameter("m", positive=True)
    tension = custom.output("N")

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        given = self.path
        if not isinstance(given, (tuple, list)) or len(given) < 2:
            raise DescriptionError(
                f"{self.name}: path is {quoted(given)}; give the points along the rope, two or"
                " more, such as (weight, world.at(0, 0, 2), load)"
            )
        points = tuple(self._as_point(one, f"path[{k}]") for k, one in enumerate(given))
        object.__setattr__(self, "path", points)

    @property
    def frames(self) -> Mapping[str, Point]:
        """Map from "p0", "p1", ... to the points of `path`, in order."""
        return {f"p{k}": point for k, point in enumerate(self.path)}

    def _segments(self, at: At) -> list[tuple[Any, Any]]:
        """Return the two end frames of each straight segment, in the order of `path`."""
        ports = [getattr(at, port) for port in self.frames]
        return list(pairwise(ports))

    def _length(self, at: At) -> SX:
        """Return the length of the path [m]: sum of the distances of successive points."""
        return sum((a.to(b).length for a, b in self._segments(at)), SX(0))


class RopeOverPulleys(_Rope):
    """A rope that does not stretch: the distances of successive points have a constant sum.

    It is one constraint row, whose effort is the tension. The row holds in both directions: with a
    negative tension a real rope would be slack, like an `ElasticRope`.

    Source: Haug 1989 for rows on distances.

    Attributes:
        path: points from one end to the other: bodies, `body.at(...)` or points of the world. The
            inner points are pulleys.
        length: length of the rope [m].
    """

    def rows(self, at: At) -> Mapping[str, Row | SX]:
        """Return {"length": length of the path minus length of the rope [m]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"length": self._length(at) - at.length}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"tension": constraint force along the rope [N]}, positive if it pulls.

        It is negative where a real rope would be slack.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"tension": -at.lam["length"]}


class ElasticRope(_Rope):
    """A rope that stretches, and is slack if its path is shorter than its length.

    With the stretch x, the sum of the distances of its points minus its length, the tension is
    stiffness r(x) + damping s(x) dx/dt, with the ramp r and its slope s of a JointStop: over the
    first `width` of the stretch the stiffness grows from zero to its full value, so that the
    spring tension and its first two derivatives are continuous. The damper tension is at most as
    large as the spring tension, so that a rope that shortens fast does not push.

    Source: Haug 1989 for forces along distances.

    Attributes:
        path: points from one end to the other: bodies, `body.at(...)` or points of the world. The
            inner points are pulleys.
        length: length of the rope without tension [m].
        stiffness: stiffness of the whole rope [N/m].
        damping: damping of the whole rope under tension [N s/m].
        width: stretch over which the stiffness grows [m].
    """

    stiffness = custom.parameter("N/m", positive=True)
    damping = custom.parameter("N.s/m", 0.0, min=0)
    width = custom.parameter("m", _TAUT, positive=True)

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the force ON each point by "p0", "p1", ...: the tension towards each neighbour.

        A force is in axes of its own point [N]. All forces are zero while the rope is slack.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        T = self._tension(at)
        total: dict[str, FrameLoad] = {}
        for a, b in self._segments(at):
            for port, load in custom.pull(a, b, T).items():
                known = total.get(port)
                force = load.force if known is None else known.force + load.force
                total[port] = FrameLoad(force, load.moment, own_axes=True)
        return total

    def energy(self, at: At) -> SX:
        """Return the energy of the stretched rope [J]; zero while the rope is slack.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.stiffness * self._stretch(at)[2])

    def dissipation(self, at: At) -> SX:
        """Return the power dissipated by the damper [W]; zero while the rope is slack.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self._tensions(at)[1] * self._rate(at))

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"tension": tension [N]}, never negative and zero while the rope is slack.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"tension": self._tension(at)}

    def _stretch(self, at: At) -> tuple[SX, SX, SX]:
        """Return (slope, ramp [m], integral of the ramp [m^2]) of `smooth_ramp` at the stretch.

        All are zero while the rope is slack.
        """
        return smooth_ramp(self._length(at) - at.length, at.width)

    def _rate(self, at: At) -> SX:
        """Return the rate of the length of the path [m/s]."""
        return sum((a.to(b).rate for a, b in self._segments(at)), SX(0))

    def _tension(self, at: At) -> SX:
        """Return the tension of the spring plus that of the damper [N]."""
        return sum(self._tensions(at), SX(0))

    def _tensions(self, at: At) -> tuple[SX, SX]:
        """Return the tensions of the spring and of the damper [N]; zero while the rope is slack.

        The damper tension is negative while the rope shortens, and at most as large as the spring
        tension.
        """
        slope, ramped, _ = self._stretch(at)
        spring = at.stiffness * ramped
        return spring, one_sided_damping(at.damping * slope * self._rate(at), spring)
