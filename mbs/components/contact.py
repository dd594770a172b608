"""Compliant contact: shapes on planes, on height fields and on each other, with friction.

The laws are smooth, without events: a normal force that grows with the penetration depth, and
friction that depends on the slip velocity. A shape returns its contact points as `Spot`s; `Contact`
computes the forces at them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any, ClassVar

import casadi
from casadi import SX, Function

from mbs.components import custom
from mbs.components.bodies import three
from mbs.components.custom import Approach, At, Load, RelativeMotion
from mbs.components.forces import ForceElement
from mbs.components.shapes import Shape
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, out_of_bounds, to_float, to_sx
from mbs.spatial import cross, vector, zeros
from mbs.text import did_you_mean, error_text, quoted

_LAWS = ("regularised", "bristle")
_OUTPUTS = {"normal_force": "N", "friction_force": "N", "depth": "m", "slip": "m/s"}
_NOMINAL = 1e-4
"""Nominal size of the bristle states [m] for the error of solvers: the default of `bristle`."""
_STILL = 1e-6
"""Speed [m/s] over which |v| is rounded at zero in the rate of bristles: far below sliding speeds,
and quadratic there, so that a body at rest does not creep."""
_ELASTIC = 0.25
"""Square of the fraction of the friction limit up to which bristles bend without any slip."""
_TOUCHING = 1e-9
"""Distance [m] below which shapes count as touching at the end of a step: a body that is placed
exactly on a plane is in contact in spite of rounding."""
_THIN = 0.03
"""Half the width of a wheel without a round rim in pictures, as a fraction of its radius: a disc
stays visible from its edge."""
_PARALLEL = 1e-6
"""Weight, in the squared distance of two capsules, of the squared distances of the contact points
from the capsule centres. It adds 1e-5 of a radius to the distance at the ends of capsules of ten
radii, a tenth of usual depths. Its square root is the angle [rad] within which the contact of
nearly parallel capsules moves from one end to the other."""
_SPACING = 0.01
"""Size [m] of the narrowest bump or body that a contact point is sure to detect if no size is
given: size of the ground features that matter to feet and wheels."""
_INSIDE = 1e-9
"""Distance [m] between a centre and a box above which its direction gives the normal. Below it and
inside, the nearest face gives the normal."""


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """Contact point of two shapes, or midpoint of their nearest points, in the ground frame.

    Attributes:
        depth: penetration depth [m], negative for a gap.
        normal: (3, 1) unit vector out of the ground.
        lever: (3, 1) vector from the origin of the body's frame to the contact point [m].
        slope: derivative of the depth along the inward normal; 1 except on height fields and for
            nearly parallel capsules.
    """

    depth: SX
    normal: SX
    lever: SX
    slope: SX | float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class _Touch:
    """Forces and velocities at a contact point.

    Attributes:
        normal: normal force [N], never negative.
        elastic: force along the depth from the energy k d^(n + 1) / (n + 1) [N].
        along: elastic and damping force along the depth [N].
        rate: rate of the depth [m/s].
        slip: (3, 1) velocity of the body tangential to the ground [m/s].
        friction: (3, 1) friction force on the body [N].
        bend: (3, 1) rates of the bristles [m/s].
        spot: contact point.
    """

    normal: SX
    elastic: SX
    along: SX
    rate: SX
    slip: SX
    friction: SX
    bend: SX
    spot: Spot


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact(ForceElement):
    """Contact of a body and a ground at contact points: Hunt-Crossley normal force and friction.

    The normal force is k d^n max(0, 1 + c d') at the depth d > 0, else zero. A shape derives from
    this class: `ports` has the names of the two frames, `labels` has the suffixes of the contact
    points, and `spots` returns the contact points.

    Source: Hunt and Crossley 1975 for the normal force; Canudas de Wit et al. 1995 and Dupont et
    al. 2002 for the bristles.

    Attributes:
        stiffness: k [N/m^n].
        exponent: n, at least 1. 1.5 holds for spheres after Hertz.
        damping: c [s/m]. Zero if it and `restitution` are left out.
        restitution: coefficient of restitution, above 0 and at most 1, instead of the damping. It
            is exact at `impact_speed`, for any stiffness, exponent and mass.
        impact_speed: impact speed at which `restitution` holds [m/s].
        friction: coefficient mu.
        friction_law: "regularised": mu N v / sqrt(v^2 + width^2), which creeps instead of sticking;
            or "bristle": bristle states that make it stick.
        width: slip velocity over which regularised friction changes sign [m/s].
        bristle: deflection of the bristles at the friction limit mu N [m].
        bristle_time: time constant of the bristle damping, and of the relaxation of bristles
            without contact [s].
    """

    shape = ""

    ports: ClassVar[tuple[str, str]] = ("body", "ground")
    """Names of two frames: of the body, and of the ground, whose axes contact points refer to."""

    labels: ClassVar[tuple[str, ...]] = ("",)
    """Suffix of the output and state names of each contact point."""

    axes: ClassVar[str] = "xyz"
    """Axes of the ground along which bristles bend: only x and y if the normal is z."""

    stiffness: Scalar
    exponent: Scalar = 1.5
    damping: Scalar | None = None
    restitution: float | None = None
    impact_speed: float | None = None
    friction: Scalar = 0.0
    friction_law: str = "regularised"
    width: Scalar = 1e-3
    bristle: Scalar = 1e-4
    bristle_time: Scalar = 5e-3

    def __init_subclass__(cls, **kwargs: Any) -> None:
        for label in cls.labels:
            for name, unit in _OUTPUTS.items():
                setattr(cls, name + label, custom.output(unit))
            for axis in cls.axes:
                setattr(cls, f"bristle_{axis}{label}", custom.state("m", nominal=_NOMINAL))
        super(Contact, cls).__init_subclass__(**kwargs)

    def __post_init__(self) -> None:
        custom.Custom.__post_init__(self)
        scalars = ["stiffness", "exponent", "friction", "width", "bristle", "bristle_time"]
        self._normalise(*scalars, *(["damping"] if self.damping is not None else []))
        self._require_positive("stiffness", "width", "bristle", "bristle_time")
        self._require_magnitudes("friction", *(["damping"] if self.damping is not None else []))
        exponent = to_float(self.exponent)
        fault = "" if exponent is None else out_of_bounds(exponent, 1.0, None)
        if fault:
            raise DescriptionError(f"{self.name}: exponent is {exponent:g}; {fault}")
        if self.friction_law not in _LAWS:
            raise DescriptionError(
                f"{self.name}: friction_law is {quoted(self.friction_law)};"
                f" {did_you_mean(str(self.friction_law), _LAWS)}"
            )
        self._settle_restitution()

    def _settle_restitution(self) -> None:
        """Convert restitution and impact_speed to floats in place.

        Raise DescriptionError if invalid. They must be given together, without damping, and be in
        range.
        """
        given = [
            name for name in ("restitution", "impact_speed") if getattr(self, name) is not None
        ]
        if len(given) == 1 or (given and self.damping is not None):
            raise DescriptionError(
                f"{self.name}: {' and '.join(given)} {'is' if len(given) == 1 else 'are'} given"
                f" {'alone' if len(given) == 1 else 'beside damping'}; give restitution and"
                " impact_speed, or damping"
            )
        for name in given:
            value, highest = to_float(expression(getattr(self, name))), 1.0
            if name == "impact_speed":
                highest = math.inf
            if value is None or not 0 < value <= highest or not math.isfinite(value):
                raise DescriptionError(
                    f"{self.name}: {name} is {quoted(getattr(self, name))}; give a number above"
                    f" zero{'' if name == 'impact_speed' else ', at most 1'}"
                )
            object.__setattr__(self, name, value)

    # Properties.

    @property
    def damping_factor(self) -> Expression:
        """Damping c [s/m]: `damping`, or the value that results in `restitution`; else 0."""
        if self.restitution is not None and self.impact_speed is not None:
            return Number(damping_for(self.restitution, self.impact_speed))
        return expression(0.0 if self.damping is None else self.damping)

    @property
    def has_bristles(self) -> bool:
        """Whether friction has bristle states: friction is not 0 and friction_law is "bristle"."""
        return self.friction_law == "bristle" and self.friction != Number(0.0)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names bristle_AXIS + label of the bristle states. Empty without bristles."""
        return self.names_of("state") if self.has_bristles else ()

    def has(self, *methods: str) -> bool:
        """Return whether the class overrides one of the methods of `Custom` with these names.

        "dissipation" does not count if friction has bristles.
        """
        asked = [name for name in methods if not (name == "dissipation" and self.has_bristles)]
        return custom.Custom.has(self, *asked)

    def spots(self, motion: RelativeMotion, at: At) -> list[Spot]:
        """Return the contact point of each entry of `labels`, also without contact (depth < 0).

        Args:
            motion: motion of the body's frame relative to the ground's frame, in its axes.
            at: values of the parameters.
        """
        raise NotImplementedError

    # Equations.

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the wrenches ON the body and ON the ground, by frame name of `ports`.

        Each is in axes of its own frame, about its own origin [N, N m]. The ground gets the
        reaction, with the same lines of action through the contact points. All forces are zero
        without contact.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        body, ground = (getattr(at, port) for port in self.ports)
        motion = self._motion(at)
        force, on_body, on_ground = zeros(), zeros(), zeros()
        for touch in self._touches(at):
            own = touch.normal * touch.spot.normal + touch.friction
            force += own
            on_body += cross(touch.spot.lever, own)
            on_ground -= cross(motion.p + touch.spot.lever, own)
        return custom.between(ground, body, custom.FrameLoad(-force, on_ground), on_body)

    def energy(self, at: At) -> SX:
        """Return the elastic energy [J], zero without contact.

        It is the sum of k d^(n + 1) / (n + 1) over the contact points with d > 0.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        k, n = (to_sx(getattr(self, name), at.symbols) for name in ("stiffness", "exponent"))
        spots = self.spots(self._motion(at), at)
        return sum((k * _power(spot.depth, n + 1) / (n + 1) for spot in spots), SX(0))

    def dissipation(self, at: At) -> SX:
        """Return the power dissipated by normal damping and regularised friction [W].

        It is zero without contact, and undefined for friction with bristles (see `has`).

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return sum(
            (
                (touch.along - touch.elastic) * touch.rate - casadi.dot(touch.friction, touch.slip)
                for touch in self._touches(at)
            ),
            SX(0),
        )

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return the rate [m/s] of each bristle state, named bristle_AXIS followed by a label.

        AXIS is x, y or z in the axes of the ground. The label is that of the contact
        point, see `labels`. Empty without bristles.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        if not self.has_bristles:
            return {}
        return {
            f"bristle_{axis}{label}": touch.bend["xyz".index(axis)]
            for label, touch in zip(self.labels, self._touches(at), strict=True)
            for axis in self.axes
        }

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return four outputs of each contact point, whose names end with its label.

        normal_force and friction_force are magnitudes [N], zero without contact. depth [m] is
        negative for a gap. slip is the tangential speed [m/s], also without contact.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        found: dict[str, SX] = {}
        for label, touch in zip(self.labels, self._touches(at), strict=True):
            values = (
                touch.normal,
                custom.regular_length(touch.friction),
                touch.spot.depth,
                custom.regular_length(touch.slip),
            )
            found |= {name + label: value for name, value in zip(_OUTPUTS, values, strict=True)}
        return found

    def crossings(self, at: At) -> Mapping[str, SX | Approach]:
        """Return an event indicator "depth" + label of each contact point: its depth [m].

        Contact begins and ends at its zero. An offset of 1e-9 m counts touching shapes as in
        contact.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        motion = self._motion(at)
        return {
            f"depth{label}": Approach(spot.depth + _TOUCHING, *self.approach(motion, spot, at))
            for label, spot in zip(self.labels, self.spots(motion, at), strict=True)
        }

    def approach(self, motion: RelativeMotion, spot: Spot, at: At) -> tuple[SX | None, SX]:
        """Return the speed [m/s] and the pace [1/s] of the depth of a contact point.

        The speed bounds the speed of all points of the body; derived classes return None if no
        bound exists. The pace is the speed divided by the size of the obstacle, which is the
        distance of the contact point from the body's frame, at least 1 cm. See `custom.Approach`.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            spot: one of the contact points.
            at: values of the parameters.
        """
        reach = custom.regular_length(spot.lever)
        speed = custom.regular_length(motion.V) + reach * custom.regular_length(motion.w)
        return speed, speed / casadi.fmax(reach, _SPACING)

    # Helpers.

    def _motion(self, at: At) -> RelativeMotion:
        """Return the motion of the body's frame in the ground's frame, in axes of the ground."""
        body, ground = (getattr(at, port) for port in self.ports)
        found: RelativeMotion = ground.to(body)
        return found

    def _touches(self, at: At) -> list[_Touch]:
        """Return forces and velocities at each contact point, in the order of `labels`."""
        motion = self._motion(at)
        spots = self.spots(motion, at)
        return [self._touch(at, motion, *pair) for pair in zip(self.labels, spots, strict=True)]

    def _touch(self, at: At, motion: RelativeMotion, label: str, spot: Spot) -> _Touch:
        """Return forces and velocities at the contact point `spot`, in axes of the ground.

        `motion` is the motion of the body's frame in the ground's frame, and `label` the suffix of
        the point.
        """
        k, n, c, mu = (
            to_sx(value, at.symbols)
            for value in (self.stiffness, self.exponent, self.damping_factor, self.friction)
        )
        velocity = motion.V + cross(motion.w, spot.lever)
        speed = casadi.dot(spot.normal, velocity)
        slip = velocity - spot.normal * speed
        # the normal force does the work along the depth, whose rate is exact
        rate = -spot.slope * speed
        elastic = k * _power(spot.depth, n)
        along = elastic * casadi.fmax(1 + c * rate, 0)
        normal = spot.slope * along
        limit = mu * normal
        if self.has_bristles:
            friction, bend = self._bristles(at, label, spot, slip, limit)
        else:
            width = to_sx(self.width, at.symbols)
            friction, bend = -limit * slip / casadi.sqrt(casadi.dot(slip, slip) + width**2), zeros()
        return _Touch(normal, elastic, along, rate, slip, friction, bend, spot)

    def _bristles(self, at: At, label: str, spot: Spot, slip: SX, limit: SX) -> tuple[SX, SX]:
        """Return the friction on the body (3, 1) [N], and the rates of the bristles (3, 1) [m/s].

        With w the deflection as a fraction of its limit, w' = (v - s(w) abs(v) w) / bristle. s
        grows from 0 at abs(w) = 1/2 to 1 at abs(w) = 1, so that abs(w) stays below 1. The force is
        -limit (w + bristle_time w'), clamped to the limit. `slip` (3, 1) is v, `limit` is mu N, and
        `label` is the suffix of the contact point `spot`.
        """
        longest, time = (to_sx(x, at.symbols) for x in (self.bristle, self.bristle_time))
        bend = vector(
            getattr(at, f"bristle_{axis}{label}") if axis in self.axes else SX(0) for axis in "xyz"
        )
        w = (bend - spot.normal * casadi.dot(spot.normal, bend)) / longest
        speed = casadi.sqrt(casadi.dot(slip, slip) + _STILL**2) - _STILL
        slips = _smooth_step((casadi.dot(w, w) - _ELASTIC) / (1 - _ELASTIC))
        # bristles are as long as their deflection limit: above that gap no bristle bends
        reached = _smooth_step(1 + spot.depth / longest)
        own = reached * (slip - slips * speed * w)
        asked = w + time * own / longest
        friction = -limit * asked / casadi.sqrt(casadi.fmax(casadi.dot(asked, asked), 1))
        # bristles relax without contact, and so does a component along a rotating normal
        return friction, own - ((1 - reached) * bend + reached * (bend - longest * w)) / time


def damping_for(restitution: float, impact_speed: float) -> float:
    """Return the damping c [s/m] of the Hunt-Crossley force for a coefficient of restitution.

    m u du/dd = -k d^n (1 + c u) integrated over an impact from speed v to -e v gives
    c v (1 + e) = ln((1 + c v) / (1 - c v e)), independent of k, n and m.

    Source: Hunt and Crossley 1975, whose 3 (1 - e) / (2 v) is the limit for e near 1.

    Args:
        restitution: e, above 0 and at most 1.
        impact_speed: v [m/s].
    """
    e = restitution
    # the function is positive below the root and negative above, and the root is within the bounds
    low, high = 0.75 * (1 - e**2) / (1 + e**3), 1 / e
    while low < (middle := 0.5 * (low + high)) < high:
        value = (
            _log_remainder(middle) - _log_remainder(-e * middle) if e * middle < 1 else -math.inf
        )
        low, high = (middle, high) if value > 0 else (low, middle)
    return 0.0 if e == 1 else low / impact_speed


def _log_remainder(x: float) -> float:
    """Return x - ln(1 + x), accurate to rounding errors for small x."""
    if abs(x) > 0.1:  # x - log loses at most two digits; the series needs 18 terms
        return x - math.log1p(x)
    return sum((-x) ** k / k for k in range(2, 20))  # 0.1^20 is below rounding


def _power(depth: SX, exponent: SX) -> SX:
    """Return depth^exponent for a positive depth, else zero, with finite derivatives everywhere."""
    touches = depth > 0
    return casadi.if_else(touches, casadi.if_else(touches, depth, 1) ** exponent, 0)


def _smooth_step(u: SX) -> SX:
    """Return 0 for u <= 0, 1 for u >= 1, and 3 u^2 - 2 u^3 between."""
    u = casadi.fmin(casadi.fmax(u, 0), 1)
    return u**2 * (3 - 2 * u)


# Shapes on a plane: the x-y plane of a frame whose z axis points out of the ground.


class PlaneContact(Contact):
    """Contact of a shape made of spheres with the ground z < 0 of a frame."""

    ports = ("body", "plane")
    labels: ClassVar[tuple[str, ...]] = ()
    axes = "xy"

    body = custom.frame()
    plane = custom.frame()

    def centres(self, motion: RelativeMotion, at: At) -> list[SX]:
        """Return the (3, 1) centres of the spheres, in the frame of the body [m].

        Args:
            motion: motion of the body's frame relative to the plane.
            at: values of the parameters.
        """
        return [zeros()]

    def reach(self, at: At) -> SX:
        """Return the radius of the spheres [m]; zero for points.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(0)

    def approach(self, motion: RelativeMotion, spot: Spot, at: At) -> tuple[SX | None, SX]:
        """Return a bound of the speed of the body [m/s], and its angular speed as the pace [1/s].

        A plane has no size: a depth can fall and rise again only if the body rotates. See
        `Contact.approach`.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            spot: contact point, one of those of `spots`.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        reach = custom.regular_length(spot.lever)
        turn = custom.regular_length(motion.w)
        return custom.regular_length(motion.V) + reach * turn, turn

    def spots(self, motion: RelativeMotion, at: At) -> list[Spot]:
        """Return the lowest point of each sphere, with the vertical normal z of the plane.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        found, up = [], vector([SX(0), SX(0), SX(1)])
        for centre in self.centres(motion, at):
            arm = casadi.mtimes(motion.R, centre)
            depth = self.reach(at) - (motion.p + arm)[2]
            found.append(Spot(depth, up, arm - (self.reach(at) - depth / 2) * up))
        return found


class SpherePlaneContact(PlaneContact):
    """Contact of a sphere with a plane, or of a point if its radius is zero.

    Attributes:
        body: frame at the centre of the sphere.
        plane: frame whose plane z = 0 is the ground, with z out of the ground.
        radius: radius of the sphere [m].
    """

    labels = ("",)

    radius = custom.parameter("m", 0.0, min=0)

    def reach(self, at: At) -> SX:
        """Return the radius of the sphere [m].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.radius)

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"body": sphere to draw}; empty if the radius is zero.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        return _ball("body", at.radius)


class CapsulePlaneContact(PlaneContact):
    """Contact of a capsule with a plane at its two end spheres.

    Attributes:
        body: frame in the middle of the capsule, whose z is its axis.
        plane: frame whose plane z = 0 is the ground, with z out of the ground.
        radius: radius of the capsule [m].
        length: distance of the centres of the end spheres [m].
    """

    labels = ("_a", "_b")

    radius = custom.parameter("m", positive=True)
    length = custom.parameter("m", positive=True)

    def reach(self, at: At) -> SX:
        """Return the radius of the end spheres [m].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.radius)

    def centres(self, motion: RelativeMotion, at: At) -> list[SX]:
        """Return the centres (3, 1) [m] of the end spheres a (z < 0) and b (z > 0), in `body`.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return [vector([SX(0), SX(0), side * at.length / 2]) for side in (-1, 1)]

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"body": capsule to draw}.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        return {"body": Shape("capsule", (at.radius, at.length))}


class WheelPlaneContact(PlaneContact):
    """Contact of a wheel with a plane at the lowest point of its rim, which may be round.

    A wheel that lies flat has no single lowest point; the contact is then at one point of its rim.

    Attributes:
        body: frame at the centre of the wheel, whose y is its axle.
        plane: frame whose plane z = 0 is the ground, with z out of the ground.
        radius: radius of the centre circle of the rim [m].
        rim: radius of the rounding of the rim [m]; zero for a thin disc.
    """

    labels = ("",)

    radius = custom.parameter("m", positive=True)
    rim = custom.parameter("m", 0.0, min=0)

    def reach(self, at: At) -> SX:
        """Return the radius of the rounding of the rim [m].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.rim)

    def centres(self, motion: RelativeMotion, at: At) -> list[SX]:
        """Return the lowest point (3, 1) of the centre circle of the rim in the frame `body` [m].

        It moves along the circle while the wheel rotates.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        up = motion.R[2, :].T
        across = vector([up[0], SX(0), up[2]])
        return [-at.radius * across / custom.regular_length(across)]

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"body": ellipsoid to draw}, as wide as the rim.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        outer = at.radius + at.rim
        return {"body": Shape("ellipsoid", (outer, max(at.rim, _THIN * outer), outer))}


class BoxPlaneContact(PlaneContact):
    """Contact of a box with a plane at its eight corners.

    Attributes:
        body: frame in the middle of the box, along its sides.
        plane: frame whose plane z = 0 is the ground, with z out of the ground.
        size: sides along x, y, z [m].
    """

    labels = tuple(f"_{number}" for number in range(1, 9))

    size: Any = field(kw_only=True)

    def __post_init__(self) -> None:
        _take_size(self)
        Contact.__post_init__(self)

    def centres(self, motion: RelativeMotion, at: At) -> list[SX]:
        """Return the corners 1 to 8, (3, 1) each, in the frame `body` [m].

        Corner 1 has negative x, y and z. From corner to corner x changes sign first, then y, then
        z.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        half = _half_size(self, at)
        return [half * vector(map(SX, signs[::-1])) for signs in product((-1, 1), repeat=3)]

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"body": box to draw}; empty if a side has no value.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        return _cuboid("body", self.size, at)


def _take_size(box: Any) -> None:
    """Replace the field `size` of a box by three expressions; raise DescriptionError if invalid."""
    sides = three(box.size, f"{box.name}, size")
    for side in sides:
        value = to_float(side)
        if value is not None and value <= 0:
            raise DescriptionError(
                f"{box.name}: size has the side {value:g} m; give more than zero"
            )
    object.__setattr__(box, "size", sides)


def _ball(port: str, radius: float) -> Mapping[str, Shape]:
    """Return {port: sphere of this radius [m] to draw}; empty if the radius is zero."""
    return {port: Shape("sphere", (radius,))} if radius > 0 else {}


def _cuboid(port: str, size: Any, at: Any) -> Mapping[str, Shape]:
    """Return {port: box to draw} with the sides `size`; empty if one of them has no value.

    `at` has the values of parameters.
    """
    sides = [to_float(side, at.symbols) for side in size]
    known = tuple(side for side in sides if side is not None)
    return {port: Shape("box", known)} if len(known) == len(sides) else {}


def _clamped(value: SX, half: SX) -> SX:
    """Return `value` (1, 1) limited to the range from -half to half."""
    return casadi.fmin(casadi.fmax(value, -half), half)


def _half_size(box: Any, at: At) -> SX:
    """Return half the sides of a box along x, y, z, (3, 1) [m], at the parameters in `at`."""
    return vector(to_sx(side, at.symbols) for side in box.size) / 2


# Spheres and capsules on other shapes.


class SphereSphereContact(Contact):
    """Contact of two spheres.

    Attributes:
        a, b: frames at their centres.
        radius_a, radius_b: radii of the spheres [m].
    """

    ports = ("b", "a")

    a = custom.frame()
    b = custom.frame()
    radius_a = custom.parameter("m", positive=True)
    radius_b = custom.parameter("m", positive=True)

    def spots(self, motion: RelativeMotion, at: At) -> list[Spot]:
        """Return the contact point on the line of centres, midway between both surfaces.

        The depth is radius_a + radius_b less the distance of the centres. The normal points from a
        to b.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        depth = at.radius_a + at.radius_b - motion.length
        return [Spot(depth, motion.along, -(at.radius_b - depth / 2) * motion.along)]

    def approach(self, motion: RelativeMotion, spot: Spot, at: At) -> tuple[SX | None, SX]:
        """Return the relative speed of the centres [m/s], and it over the sum of radii [1/s].

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            spot: contact point, one of those of `spots`.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        speed = custom.regular_length(at.b.v - at.a.v)
        return speed, speed / (at.radius_a + at.radius_b)

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"a": sphere, "b": sphere} to draw.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        return {**_ball("a", at.radius_a), **_ball("b", at.radius_b)}


class SphereCapsuleContact(Contact):
    """Contact of a sphere with a capsule, at the nearest point of the capsule's axis.

    Attributes:
        sphere: frame at the centre of the sphere.
        capsule: frame in the middle of the capsule, whose z is its axis.
        radius: radius of the sphere [m].
        capsule_radius: radius of the capsule [m].
        length: distance of the centres of the end spheres of the capsule [m].
    """

    ports = ("sphere", "capsule")

    sphere = custom.frame()
    capsule = custom.frame()
    radius = custom.parameter("m", min=0)
    capsule_radius = custom.parameter("m", positive=True)
    length = custom.parameter("m", positive=True)

    def spots(self, motion: RelativeMotion, at: At) -> list[Spot]:
        """Return the contact point, midway between both surfaces.

        The normal points from the nearest point of the capsule axis to the centre of the sphere.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        along = _clamped(motion.p[2], at.length / 2)
        off = motion.p - vector([SX(0), SX(0), along])
        distance = custom.regular_length(off)
        depth = at.radius + at.capsule_radius - distance
        return [Spot(depth, off / distance, -(at.radius - depth / 2) * off / distance)]

    def approach(self, motion: RelativeMotion, spot: Spot, at: At) -> tuple[SX | None, SX]:
        """Return the speed of the sphere centre in the capsule frame [m/s], and a pace [1/s].

        The pace is this speed divided by the sum of the radii.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            spot: contact point, one of those of `spots`.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        speed = custom.regular_length(motion.V)
        return speed, speed / (at.radius + at.capsule_radius)

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"sphere": sphere, "capsule": capsule} to draw, without a sphere of radius 0.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        capsule = Shape("capsule", (at.capsule_radius, at.length))
        return {**_ball("sphere", at.radius), "capsule": capsule}


class CapsuleCapsuleContact(Contact):
    """Contact of two capsules, at the nearest points of their axes.

    The nearest points of parallel axes are not unique. The square of the distance therefore has the
    additional term e (s^2 + t^2), with the distances s and t of the points from the capsule centres
    and e = 1e-6. The points then move smoothly from one end to the other while the angle between
    the axes changes by about 1e-3 rad.

    Source: Ericson 2005, section 5.1.9, for the nearest points of two segments.

    Attributes:
        a, b: frames in the middle of the capsules, whose z is the axis.
        radius_a, radius_b: radii of the capsules [m].
        length_a, length_b: distances of the centres of the end spheres [m].
    """

    ports = ("b", "a")

    a = custom.frame()
    b = custom.frame()
    radius_a = custom.parameter("m", positive=True)
    length_a = custom.parameter("m", positive=True)
    radius_b = custom.parameter("m", positive=True)
    length_b = custom.parameter("m", positive=True)

    def spots(self, motion: RelativeMotion, at: At) -> list[Spot]:
        """Return the contact point, midway between both surfaces at the nearest points of the axes.

        The normal points from the nearest point of axis a to that of axis b.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        axis = motion.R[:, 2]
        cosine, weight = axis[2], 1 + _PARALLEL
        own, other = motion.p[2], casadi.dot(motion.p, axis)
        half_a, half_b = at.length_a / 2, at.length_b / 2
        # minimum of a convex function of s and t within the lengths
        s = _clamped((weight * own - cosine * other) / (weight**2 - cosine**2), half_a)
        t = _clamped((cosine * s - other) / weight, half_b)
        s = _clamped((own + cosine * t) / weight, half_a)
        off = motion.p + t * axis - vector([SX(0), SX(0), s])
        length = custom.regular_length(off)
        distance = casadi.sqrt(length**2 + _PARALLEL * (s**2 + t**2))
        depth, normal = at.radius_a + at.radius_b - distance, off / length
        lever = t * axis - (at.radius_b - depth / 2) * normal
        return [Spot(depth, normal, lever, length / distance)]

    def approach(self, motion: RelativeMotion, spot: Spot, at: At) -> tuple[SX | None, SX]:
        """Return a bound of the speed of the axis points of b in frame a [m/s], and a pace [1/s].

        The pace is this speed divided by the sum of the radii.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            spot: contact point, one of those of `spots`.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        turn = at.length_b / 2 * custom.regular_length(motion.w)
        speed = custom.regular_length(motion.V) + turn
        return speed, speed / (at.radius_a + at.radius_b)

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"a": capsule, "b": capsule} to draw.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        return {
            "a": Shape("capsule", (at.radius_a, at.length_a)),
            "b": Shape("capsule", (at.radius_b, at.length_b)),
        }


class SphereBoxContact(Contact):
    """Contact of a sphere with a box, at the nearest point of the box: face, edge or corner.

    A centre inside the box is pushed out through the nearest face.

    Attributes:
        sphere: frame at the centre of the sphere.
        box: frame in the middle of the box, along its sides.
        radius: radius of the sphere [m].
        size: sides of the box along x, y, z [m].
    """

    ports = ("sphere", "box")

    sphere = custom.frame()
    box = custom.frame()
    radius = custom.parameter("m", min=0)
    size: Any = field(kw_only=True)

    def __post_init__(self) -> None:
        _take_size(self)
        Contact.__post_init__(self)

    def spots(self, motion: RelativeMotion, at: At) -> list[Spot]:
        """Return the contact point, midway between box and sphere surface at the nearest point.

        The normal points from the box to the centre of the sphere. If the centre is inside the box,
        it is the normal of the nearest face.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        beyond = casadi.fabs(motion.p) - _half_size(self, at)
        outside = casadi.fmax(beyond, 0)
        square = casadi.dot(outside, outside)
        is_outside = square > _INSIDE**2
        distance = casadi.sqrt(casadi.if_else(is_outside, square, 1))
        # inside, the nearest face gives the normal; of several, the first in the order x, y, z
        nearest = casadi.mmax(beyond)
        x, y = (beyond[k] == nearest for k in (0, 1))
        face = vector([x, (1 - x) * y, (1 - x) * (1 - y)])
        side = casadi.if_else(motion.p < 0, -1, 1)
        normal = side * casadi.if_else(is_outside, outside / distance, face)
        depth = at.radius - casadi.if_else(is_outside, distance, nearest)
        return [Spot(depth, normal, -(at.radius - depth / 2) * normal)]

    def approach(self, motion: RelativeMotion, spot: Spot, at: At) -> tuple[SX | None, SX]:
        """Return the speed of the sphere centre in the box frame [m/s], and a pace [1/s].

        The pace is this speed divided by the radius plus half the shortest side.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            spot: contact point, one of those of `spots`.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        speed = custom.regular_length(motion.V)
        return speed, speed / (at.radius + casadi.mmin(_half_size(self, at)))

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"sphere": sphere, "box": box} to draw.

        A sphere of radius zero is left out, and so is a box with a side that has no value.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        return {**_ball("sphere", at.radius), **_cuboid("box", self.size, at)}


class HeightFieldContact(Contact):
    """Contact of a sphere, or a point if its radius is zero, with a ground z = h(x, y) of a frame.

    The depth is measured below the tangent plane under the centre,
    radius - (z - h) / sqrt(1 + |grad h|^2). It is exact on slopes, and accurate if the field bends
    little over the radius. The force is along the gradient of the depth, so that energy is exact.

    Attributes:
        body: frame at the centre of the sphere.
        ground: frame of x, y and z.
        height: h [m], a function of (x, y) made of CasADi operations, or a casadi.Function.
        radius: radius of the sphere [m].
        spacing: width of the narrowest bump [m], which steps do not miss. The default is the
            radius, or 1 cm for a point.
    """

    body = custom.frame()
    ground = custom.frame()
    height: Any = field(kw_only=True)
    radius = custom.parameter("m", 0.0, min=0)
    spacing: Scalar | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        Contact.__post_init__(self)
        if self.spacing is not None:
            self._normalise("spacing")
            self._require_positive("spacing")
        x, y = SX.sym("x"), SX.sym("y")
        try:
            value = SX(self.height(x, y))
        except Exception as error:
            raise DescriptionError(
                f"{self.name}: height cannot be written with CasADi symbols"
                f" ({error_text(error)}); give a function of (x, y) made of CasADi operations"
            ) from error
        if value.shape != (1, 1):
            raise DescriptionError(
                f"{self.name}: height has the shape {value.shape}; give one value for (x, y)"
            )
        graph = Function("height", [x, y], [value], {"allow_free": True})
        if any(graph.instruction_id(k) == casadi.OP_CALL for k in range(graph.n_instructions())):
            raise DescriptionError(
                f"{self.name}: height calls another Function, such as an interpolant, which models"
                " do not take; write it by operations, such as a sum over the points of a grid"
            )
        if value.is_constant() and not value.is_regular():
            raise DescriptionError(
                f"{self.name}: height is {float(value)} for symbols x and y; make it of CasADi"
                " operations on them"
            )
        strange = [s.name() for s in casadi.symvar(value) if s.name() not in ("x", "y")]
        if strange:
            raise DescriptionError(
                f"{self.name}: height holds the symbols {', '.join(strange)}; make it of x, y and"
                " numbers"
            )

    def approach(self, motion: RelativeMotion, spot: Spot, at: At) -> tuple[SX | None, SX]:
        """Return None, since bumps leave the speed of the depth unbounded, and the pace [1/s].

        The pace is the speed of the centre in the frame `ground` divided by `spacing`.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            spot: contact point, one of those of `spots`.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        size = casadi.if_else(at.radius > 0, at.radius, _SPACING)
        if self.spacing is not None:
            size = to_sx(self.spacing, at.symbols)
        return None, custom.regular_length(motion.V) / size

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Return {"body": sphere to draw}, empty for a point. The ground is not drawn.

        Args:
            at: values of the parameters as floats, by attribute.
        """
        return _ball("body", at.radius)

    def spots(self, motion: RelativeMotion, at: At) -> list[Spot]:
        """Return the contact point on the line through the centre along the gradient of the depth.

        The normal is the negative unit gradient. The slope is the length of the gradient.

        Args:
            motion: motion of the body's frame relative to the ground's frame.
            at: values of the component and motion of its ports, see `custom.At`.
        """
        c = SX.sym("c", 3)
        h = SX(self.height(c[0], c[1]))
        steep = casadi.gradient(h, c)
        depth = at.radius - (c[2] - h) / casadi.sqrt(1 + casadi.dot(steep, steep))
        fall = -casadi.gradient(depth, c)
        depth, fall = casadi.substitute([depth, fall], [c], [motion.p])
        slope = casadi.norm_2(fall)
        normal = fall / slope
        return [Spot(depth, normal, -(at.radius - depth / 2) * normal, slope)]
