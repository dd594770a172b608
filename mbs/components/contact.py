"""Contact in motion: shapes on planes, on height fields and on each other, with friction.

The laws are smooth, without events: a force that grows with the depth by which two shapes overlap,
and friction that follows the velocity with which they slide. A shape says where it touches, as
`Spot`s; what happens there is written once, in `Contact`.
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
from mbs.components.custom import Approach, Load, RelativeMotion
from mbs.components.forces import ForceElement
from mbs.components.shapes import Shape
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, out_of_bounds, to_float, to_sx
from mbs.spatial import cross, vector, zeros
from mbs.text import did_you_mean, error_text, quoted

_LAWS = ("regularised", "bristle")
_OUTPUTS = {"normal_force": "N", "friction_force": "N", "depth": "m", "slip": "m/s"}
_NOMINAL = 1e-4
"""Size of the bristle states [m] by which solvers measure their errors: the default `bristle`."""
_STILL = 1e-6
"""Speed [m/s] over which |v| is rounded at zero in the rate of bristles: far below what slides, and
quadratic there, so that what stands does not creep."""
_ELASTIC = 0.25
"""Square of the part of the friction limit up to which bristles bend without slipping at all."""
_TOUCHING = 1e-9
"""Gap [m] from which on shapes count as touching where steps end: a body that is placed exactly on
a plane is inside, whatever rounding does."""
_THIN = 0.03
"""Half the width of a wheel without a round rim in pictures, part of its radius: a disc that is
seen from its edge, too."""
_PARALLEL = 1e-6
"""Weight of the distances from the middles of capsules in the square of their distance. It adds
1e-5 of a radius to the distance at the ends of capsules of ten radii, a tenth of usual depths. Its
square root is the angle over which a capsule comes to rest on another one."""
_SPACING = 0.01
"""Size [m] of the narrowest bump or body that a point is sure to meet where no size is given: that
of the ground of feet and wheels."""
_INSIDE = 1e-9
"""Distance [m] of a centre from a box from which on its direction tells the normal; nearer, and
inside, the nearest face does."""


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """Where two shapes touch, or are nearest, seen from the ground and in its axes.

    Attributes:
        depth: by how much they overlap [m]; below zero for a gap.
        normal: (3, 1) unit vector, out of the ground.
        lever: (3, 1) from the origin of the body's frame to where the force acts [m].
        slope: how fast the depth falls along the normal; one but on height fields.
    """

    depth: SX
    normal: SX
    lever: SX
    slope: SX | float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class _Touch:
    """What happens at a spot.

    Attributes:
        normal: normal force [N], never below zero.
        elastic: the part of it along the depth that the energy k d^(n + 1) / (n + 1) gives [N].
        along: the whole along the depth [N].
        rate: of the depth [m/s].
        slip: (3, 1) velocity of the body along the ground [m/s].
        friction: (3, 1) force on the body [N].
        bend: (3, 1) rates of the bristles [m/s].
        spot: where.
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
    """A body against a ground, at one spot or several: Hunt and Crossley's force, and friction.

    The normal force is k d^n max(0, 1 + c d') at the depth d > 0, zero elsewhere. A shape derives
    from this class, names its two frames in `ports` and its spots in `labels`, and gives `spots`.

    Source: Hunt and Crossley 1975 for the normal force; Canudas de Wit et al. 1995 and Dupont et
    al. 2002 for the bristles.

    Attributes:
        stiffness: k [N/m^n].
        exponent: n, at least 1; 1.5 is that of spheres after Hertz.
        damping: c [s/m]; zero when it and `restitution` are left out.
        restitution: instead of it, speed after an impact / speed before, above 0, at most 1; it
            is exact at `impact_speed`, for any stiffness, exponent and mass.
        impact_speed: [m/s].
        friction: coefficient mu.
        friction_law: "regularised", mu N v / sqrt(v^2 + width^2), which creeps where it should
            stand; or "bristle", with states that make it stand.
        width: velocity over which regularised friction changes sign [m/s].
        bristle: how far bristles bend at the limit mu N [m].
        bristle_time: of their damping, and in which they relax without contact [s].
    """

    shape = ""

    ports: ClassVar[tuple[str, str]] = ("body", "ground")
    """The frame of what touches, and that in whose axes spots are given."""

    labels: ClassVar[tuple[str, ...]] = ("",)
    """What the names of the outputs and states of each spot end with."""

    axes: ClassVar[str] = "xyz"
    """Along which axes of the ground bristles bend: x and y alone where the normal is z."""

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
        """Check what an impact leaves, which is given by two numbers or by the damping."""
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

    # What it has.

    @property
    def damping_factor(self) -> Expression:
        """The damping c [s/m], as it is given or from the restitution."""
        if self.restitution is not None and self.impact_speed is not None:
            return Number(damping_for(self.restitution, self.impact_speed))
        return expression(0.0 if self.damping is None else self.damping)

    @property
    def has_bristles(self) -> bool:
        """Whether friction has states."""
        return self.friction_law == "bristle" and self.friction != Number(0.0)

    @property
    def state_names(self) -> tuple[str, ...]:
        """The bristles, where there are any."""
        return self.names_of("state") if self.has_bristles else ()

    def has(self, *methods: str) -> bool:
        """Whether it says something; bristles keep some work for a while, which is no heat."""
        asked = [name for name in methods if not (name == "dissipation" and self.has_bristles)]
        return custom.Custom.has(self, *asked)

    def spots(self, motion: RelativeMotion, at: Any) -> list[Spot]:
        """Where it touches, one spot for each label.

        Args:
            motion: how the frame of the body moves, seen from that of the ground.
            at: the parameters.
        """
        raise NotImplementedError

    # What it does.

    def loads(self, at: Any) -> Mapping[str, Load]:
        """Normal and friction forces on the body at every spot, and the opposite on the ground."""
        body, ground = (getattr(at, port) for port in self.ports)
        motion = self._motion(at)
        force, on_body, on_ground = zeros(), zeros(), zeros()
        for touch in self._touches(at):
            own = touch.normal * touch.spot.normal + touch.friction
            force += own
            on_body += cross(touch.spot.lever, own)
            on_ground -= cross(motion.p + touch.spot.lever, own)
        return custom.between(ground, body, custom.FrameLoad(-force, on_ground), on_body)

    def energy(self, at: Any) -> SX:
        """The sum of k d^(n + 1) / (n + 1)."""
        k, n = (to_sx(getattr(self, name), at.symbols) for name in ("stiffness", "exponent"))
        spots = self.spots(self._motion(at), at)
        return sum((k * _power(spot.depth, n + 1) / (n + 1) for spot in spots), SX(0))

    def dissipation(self, at: Any) -> SX:
        """What damping and regularised friction take."""
        return sum(
            (
                (touch.along - touch.elastic) * touch.rate - casadi.dot(touch.friction, touch.slip)
                for touch in self._touches(at)
            ),
            SX(0),
        )

    def rates(self, at: Any) -> Mapping[str, SX]:
        """How fast the bristles bend."""
        if not self.has_bristles:
            return {}
        return {
            f"bristle_{axis}{label}": touch.bend["xyz".index(axis)]
            for label, touch in zip(self.labels, self._touches(at), strict=True)
            for axis in self.axes
        }

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """Sizes of the forces, the depth, and how fast it slides, at every spot."""
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

    def crossings(self, at: Any) -> Mapping[str, SX | Approach]:
        """The depths: a spot begins and ends to touch where one is zero."""
        motion = self._motion(at)
        return {
            f"depth{label}": Approach(spot.depth + _TOUCHING, *self.approach(motion, spot, at))
            for label, spot in zip(self.labels, self.spots(motion, at), strict=True)
        }

    def approach(self, motion: RelativeMotion, spot: Spot, at: Any) -> tuple[SX | None, SX]:
        """Speed [m/s] and pace [1/s] of the depth of a spot, as `custom.Approach` has them.

        The speed is that of the whole body, and the size is the distance of the spot from its
        frame, at least 1 cm.

        Args:
            motion: of the frame of the body, seen from that of the ground.
            spot: one of its spots.
            at: the parameters.
        """
        reach = custom.regular_length(spot.lever)
        speed = custom.regular_length(motion.V) + reach * custom.regular_length(motion.w)
        return speed, speed / casadi.fmax(reach, _SPACING)

    # How it is computed.

    def _motion(self, at: Any) -> RelativeMotion:
        body, ground = (getattr(at, port) for port in self.ports)
        found: RelativeMotion = ground.to(body)
        return found

    def _touches(self, at: Any) -> list[_Touch]:
        motion = self._motion(at)
        spots = self.spots(motion, at)
        return [self._touch(at, motion, *pair) for pair in zip(self.labels, spots, strict=True)]

    def _touch(self, at: Any, motion: RelativeMotion, label: str, spot: Spot) -> _Touch:
        k, n, c, mu = (
            to_sx(value, at.symbols)
            for value in (self.stiffness, self.exponent, self.damping_factor, self.friction)
        )
        velocity = motion.V + cross(motion.w, spot.lever)
        speed = casadi.dot(spot.normal, velocity)
        slip = velocity - spot.normal * speed
        # the normal force does the work of the depth, whose rate is exact
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

    def _bristles(self, at: Any, label: str, spot: Spot, slip: SX, limit: SX) -> tuple[SX, SX]:
        """(3, 1) friction on the body, and (3, 1) rates of the bristles.

        With w the bend over that at the limit, w' = (v - s(w) |v| w) / bristle, s growing from 0
        where w is half the limit to 1 at the limit: w stays within it. The force is
        -limit (w + bristle_time w'), cut to the limit.
        """
        longest, time = (to_sx(x, at.symbols) for x in (self.bristle, self.bristle_time))
        bend = vector(
            getattr(at, f"bristle_{axis}{label}") if axis in self.axes else SX(0) for axis in "xyz"
        )
        w = (bend - spot.normal * casadi.dot(spot.normal, bend)) / longest
        speed = casadi.sqrt(casadi.dot(slip, slip) + _STILL**2) - _STILL
        slips = _smooth_step((casadi.dot(w, w) - _ELASTIC) / (1 - _ELASTIC))
        # bristles are as long as they bend: above that gap nothing bends them
        reached = _smooth_step(1 + spot.depth / longest)
        own = reached * (slip - slips * speed * w)
        asked = w + time * own / longest
        friction = -limit * asked / casadi.sqrt(casadi.fmax(casadi.dot(asked, asked), 1))
        # without contact they relax, and so does what is left along a normal that turns
        return friction, own - ((1 - reached) * bend + reached * (bend - longest * w)) / time


def damping_for(restitution: float, impact_speed: float) -> float:
    """The damping c [s/m] of Hunt and Crossley's force that leaves a part of the impact speed.

    m u du/dd = -k d^n (1 + c u) integrated over an impact from speed v to -e v gives
    c v (1 + e) = ln((1 + c v) / (1 - c v e)), whatever k, n and m are.

    Source: Hunt and Crossley 1975, whose 3 (1 - e) / (2 v) is its limit where e is near one.

    Args:
        restitution: e, above 0 and at most 1.
        impact_speed: v [m/s].
    """
    e = restitution
    # positive below the root, negative above; the root is within these bounds
    low, high = 0.75 * (1 - e**2) / (1 + e**3), 1 / e
    while low < (middle := 0.5 * (low + high)) < high:
        value = _bend(middle) - _bend(-e * middle) if e * middle < 1 else -math.inf
        low, high = (middle, high) if value > 0 else (low, middle)
    return 0.0 if e == 1 else low / impact_speed


def _bend(x: float) -> float:
    """X - ln(1 + x), to rounding where x is small."""
    if abs(x) > 0.1:  # the difference loses two digits there, the series needs 18 terms
        return x - math.log1p(x)
    return sum((-x) ** k / k for k in range(2, 20))  # 0.1^20 is below rounding


def _power(depth: SX, exponent: SX) -> SX:
    """The depth to a power where it is positive, else zero, with finite derivatives everywhere."""
    touches = depth > 0
    return casadi.if_else(touches, casadi.if_else(touches, depth, 1) ** exponent, 0)


def _smooth_step(u: SX) -> SX:
    """0 up to zero, 1 from one on, with a continuous slope."""
    u = casadi.fmin(casadi.fmax(u, 0), 1)
    return u**2 * (3 - 2 * u)


# Shapes on a plane: that of x and y of a frame, whose z points out of the ground.


class PlaneContact(Contact):
    """A shape made of spheres, on the ground z < 0 of a frame."""

    ports = ("body", "plane")
    labels: ClassVar[tuple[str, ...]] = ()
    axes = "xy"

    body = custom.frame()
    plane = custom.frame()

    def centres(self, motion: RelativeMotion, at: Any) -> list[SX]:
        """(3, 1) centres of the spheres, in the frame of the body [m].

        Args:
            motion: of that frame, seen from the plane.
            at: the parameters.
        """
        return [zeros()]

    def reach(self, at: Any) -> SX:
        """Radius of the spheres [m]."""
        return SX(0)

    def approach(self, motion: RelativeMotion, spot: Spot, at: Any) -> tuple[SX | None, SX]:
        """The whole speed; a plane has no size, so that only a turn shortens an approach."""
        reach = custom.regular_length(spot.lever)
        turn = custom.regular_length(motion.w)
        return custom.regular_length(motion.V) + reach * turn, turn

    def spots(self, motion: RelativeMotion, at: Any) -> list[Spot]:
        """The lowest point of every sphere."""
        found, up = [], vector([SX(0), SX(0), SX(1)])
        for centre in self.centres(motion, at):
            arm = casadi.mtimes(motion.R, centre)
            depth = self.reach(at) - (motion.p + arm)[2]
            found.append(Spot(depth, up, arm - (self.reach(at) - depth / 2) * up))
        return found


class SpherePlaneContact(PlaneContact):
    """A sphere on a plane; a point where its radius is zero.

    Attributes:
        body: frame at the centre of the sphere.
        plane: frame whose plane z = 0 is the ground, and its z the way out of it.
        radius: [m].
    """

    labels = ("",)

    radius = custom.parameter("m", 0.0, min=0)

    def reach(self, at: Any) -> SX:
        """The radius."""
        return SX(at.radius)

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """The sphere."""
        return _ball("body", at.radius)


class CapsulePlaneContact(PlaneContact):
    """A capsule on a plane, by its two end spheres, which share the load as it asks.

    Attributes:
        body: frame in the middle of the capsule, whose z is its axis.
        plane: frame whose plane z = 0 is the ground, and its z the way out of it.
        radius: [m].
        length: between the centres of the end spheres [m].
    """

    labels = ("_a", "_b")

    radius = custom.parameter("m", positive=True)
    length = custom.parameter("m", positive=True)

    def reach(self, at: Any) -> SX:
        """The radius."""
        return SX(at.radius)

    def centres(self, motion: RelativeMotion, at: Any) -> list[SX]:
        """The ends a, at z < 0, and b."""
        return [vector([SX(0), SX(0), side * at.length / 2]) for side in (-1, 1)]

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """The capsule."""
        return {"body": Shape("capsule", (at.radius, at.length))}


class WheelPlaneContact(PlaneContact):
    """A wheel on a plane, by the lowest point of its rim, which may be round.

    Flat on the plane it has no single lowest point; it then stands on one of its rim.

    Attributes:
        body: frame at the centre of the wheel, whose y is its axle.
        plane: frame whose plane z = 0 is the ground, and its z the way out of it.
        radius: of the circle in the middle of the rim [m].
        rim: radius of the round of the rim [m]; a thin disc where it is zero.
    """

    labels = ("",)

    radius = custom.parameter("m", positive=True)
    rim = custom.parameter("m", 0.0, min=0)

    def reach(self, at: Any) -> SX:
        """That of the round of the rim."""
        return SX(at.rim)

    def centres(self, motion: RelativeMotion, at: Any) -> list[SX]:
        """The lowest point of the circle: it is not one of the body, but its height moves alike."""
        up = motion.R[2, :].T
        across = vector([up[0], SX(0), up[2]])
        return [-at.radius * across / custom.regular_length(across)]

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """A disc that bulges, as wide as its rim."""
        outer = at.radius + at.rim
        return {"body": Shape("ellipsoid", (outer, max(at.rim, _THIN * outer), outer))}


class BoxPlaneContact(PlaneContact):
    """A box on a plane, by its eight corners.

    Attributes:
        body: frame in the middle of the box, along its sides.
        plane: frame whose plane z = 0 is the ground, and its z the way out of it.
        size: sides along x, y, z [m].
    """

    labels = tuple(f"_{number}" for number in range(1, 9))

    size: Any = field(kw_only=True)

    def __post_init__(self) -> None:
        _take_size(self)
        Contact.__post_init__(self)

    def centres(self, motion: RelativeMotion, at: Any) -> list[SX]:
        """The corners 1 to 8: x changes its sign first, then y, then z, all negative at first."""
        half = _half_size(self, at)
        return [half * vector(map(SX, signs[::-1])) for signs in product((-1, 1), repeat=3)]

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """The box."""
        return _cuboid("body", self.size, at)


def _take_size(box: Any) -> None:
    """Turn the three sides that a user gave into expressions."""
    sides = three(box.size, f"{box.name}, size")
    for side in sides:
        value = to_float(side)
        if value is not None and value <= 0:
            raise DescriptionError(
                f"{box.name}: size has the side {value:g} m; give more than zero"
            )
    object.__setattr__(box, "size", sides)


def _ball(port: str, radius: float) -> Mapping[str, Shape]:
    """A sphere, none for a point."""
    return {port: Shape("sphere", (radius,))} if radius > 0 else {}


def _cuboid(port: str, size: Any, at: Any) -> Mapping[str, Shape]:
    """A box, none where a side has no value."""
    sides = [to_float(side, at.symbols) for side in size]
    known = tuple(side for side in sides if side is not None)
    return {port: Shape("box", known)} if len(known) == len(sides) else {}


def _within(value: SX, half: SX) -> SX:
    """A distance from the middle of a segment, at most half its length."""
    return casadi.fmin(casadi.fmax(value, -half), half)


def _half_size(box: Any, at: Any) -> SX:
    return vector(to_sx(side, at.symbols) for side in box.size) / 2


# A sphere on other shapes.


class SphereSphereContact(Contact):
    """Two spheres.

    Attributes:
        a, b: frames at their centres.
        radius_a, radius_b: [m].
    """

    ports = ("b", "a")

    a = custom.frame()
    b = custom.frame()
    radius_a = custom.parameter("m", positive=True)
    radius_b = custom.parameter("m", positive=True)

    def spots(self, motion: RelativeMotion, at: Any) -> list[Spot]:
        """On the line between the centres, in the middle of the overlap."""
        depth = at.radius_a + at.radius_b - motion.length
        return [Spot(depth, motion.along, -(at.radius_b - depth / 2) * motion.along)]

    def approach(self, motion: RelativeMotion, spot: Spot, at: Any) -> tuple[SX | None, SX]:
        """The relative speed of the centres; the size is the sum of the radii."""
        speed = custom.regular_length(at.b.v - at.a.v)
        return speed, speed / (at.radius_a + at.radius_b)

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Both spheres."""
        return {**_ball("a", at.radius_a), **_ball("b", at.radius_b)}


class SphereCapsuleContact(Contact):
    """A sphere and a capsule, at the point of its axis that is nearest.

    Attributes:
        sphere: frame at its centre.
        capsule: frame in the middle of the capsule, whose z is its axis.
        radius: of the sphere [m].
        capsule_radius: of the capsule [m].
        length: between the centres of its end spheres [m].
    """

    ports = ("sphere", "capsule")

    sphere = custom.frame()
    capsule = custom.frame()
    radius = custom.parameter("m", min=0)
    capsule_radius = custom.parameter("m", positive=True)
    length = custom.parameter("m", positive=True)

    def spots(self, motion: RelativeMotion, at: Any) -> list[Spot]:
        """From the nearest point of the axis to the centre."""
        along = _within(motion.p[2], at.length / 2)
        off = motion.p - vector([SX(0), SX(0), along])
        distance = custom.regular_length(off)
        depth = at.radius + at.capsule_radius - distance
        return [Spot(depth, off / distance, -(at.radius - depth / 2) * off / distance)]

    def approach(self, motion: RelativeMotion, spot: Spot, at: Any) -> tuple[SX | None, SX]:
        """The speed of the centre, seen from the capsule; the size is the sum of the radii."""
        speed = custom.regular_length(motion.V)
        return speed, speed / (at.radius + at.capsule_radius)

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """The sphere and the capsule."""
        capsule = Shape("capsule", (at.capsule_radius, at.length))
        return {**_ball("sphere", at.radius), "capsule": capsule}


class CapsuleCapsuleContact(Contact):
    """Two capsules, at the points of their axes that are nearest.

    Of axes that are parallel no points are nearest. The square of the distance therefore has the
    term e (s^2 + t^2) of the distances s and t of the points from the middles, e = 1e-6: the points
    move smoothly from one end to the other while the angle of the axes changes by some 1e-3 rad.

    Source: Ericson 2005, section 5.1.9, for the nearest points of two segments.

    Attributes:
        a, b: frames in the middle of the capsules, whose z is the axis.
        radius_a, radius_b: [m].
        length_a, length_b: between the centres of the end spheres [m].
    """

    ports = ("b", "a")

    a = custom.frame()
    b = custom.frame()
    radius_a = custom.parameter("m", positive=True)
    length_a = custom.parameter("m", positive=True)
    radius_b = custom.parameter("m", positive=True)
    length_b = custom.parameter("m", positive=True)

    def spots(self, motion: RelativeMotion, at: Any) -> list[Spot]:
        """Between the nearest points, in the middle of the overlap."""
        axis = motion.R[:, 2]
        cosine, weight = axis[2], 1 + _PARALLEL
        own, other = motion.p[2], casadi.dot(motion.p, axis)
        half_a, half_b = at.length_a / 2, at.length_b / 2
        # the minimum of a convex function of s and t within the lengths
        s = _within((weight * own - cosine * other) / (weight**2 - cosine**2), half_a)
        t = _within((cosine * s - other) / weight, half_b)
        s = _within((own + cosine * t) / weight, half_a)
        off = motion.p + t * axis - vector([SX(0), SX(0), s])
        length = custom.regular_length(off)
        distance = casadi.sqrt(length**2 + _PARALLEL * (s**2 + t**2))
        depth, normal = at.radius_a + at.radius_b - distance, off / length
        lever = t * axis - (at.radius_b - depth / 2) * normal
        return [Spot(depth, normal, lever, length / distance)]

    def approach(self, motion: RelativeMotion, spot: Spot, at: Any) -> tuple[SX | None, SX]:
        """The speed of the ends of b, seen from a; the size is the sum of the radii."""
        turn = at.length_b / 2 * custom.regular_length(motion.w)
        speed = custom.regular_length(motion.V) + turn
        return speed, speed / (at.radius_a + at.radius_b)

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """Both capsules."""
        return {
            "a": Shape("capsule", (at.radius_a, at.length_a)),
            "b": Shape("capsule", (at.radius_b, at.length_b)),
        }


class SphereBoxContact(Contact):
    """A sphere and a box: its nearest point, on a face, an edge or a corner.

    A centre inside the box is pushed out through the nearest face.

    Attributes:
        sphere: frame at its centre.
        box: frame in the middle of the box, along its sides.
        radius: of the sphere [m].
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

    def spots(self, motion: RelativeMotion, at: Any) -> list[Spot]:
        """From the nearest point of the box to the centre."""
        beyond = casadi.fabs(motion.p) - _half_size(self, at)
        outside = casadi.fmax(beyond, 0)
        square = casadi.dot(outside, outside)
        is_outside = square > _INSIDE**2
        distance = casadi.sqrt(casadi.if_else(is_outside, square, 1))
        # inside, the face whose plane is nearest, the first of several
        nearest = casadi.mmax(beyond)
        x, y = (beyond[k] == nearest for k in (0, 1))
        face = vector([x, (1 - x) * y, (1 - x) * (1 - y)])
        side = casadi.if_else(motion.p < 0, -1, 1)
        normal = side * casadi.if_else(is_outside, outside / distance, face)
        depth = at.radius - casadi.if_else(is_outside, distance, nearest)
        return [Spot(depth, normal, -(at.radius - depth / 2) * normal)]

    def approach(self, motion: RelativeMotion, spot: Spot, at: Any) -> tuple[SX | None, SX]:
        """The speed of the centre, seen from the box; the size is that of its shortest side."""
        speed = custom.regular_length(motion.V)
        return speed, speed / (at.radius + casadi.mmin(_half_size(self, at)))

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """The sphere and the box."""
        return {**_ball("sphere", at.radius), **_cuboid("box", self.size, at)}


class HeightFieldContact(Contact):
    """A sphere on a ground z = h(x, y) of a frame; a point where its radius is zero.

    The depth is that below the tangent plane under the centre,
    radius - (z - h) / sqrt(1 + |grad h|^2): exact on slopes, and else where the field bends little
    over the radius. The force is along its gradient, so that its energy is exact.

    Attributes:
        body: frame at the centre of the sphere.
        ground: frame of x, y and z.
        height: h, a function of (x, y) made of CasADi operations, or a casadi.Function [m].
        radius: [m].
        spacing: width of the narrowest bump [m], which no step passes over; the radius when left
            out, 1 cm for a point.
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

    def approach(self, motion: RelativeMotion, spot: Spot, at: Any) -> tuple[SX | None, SX]:
        """The speed over the ground has no bound for the depth, which a bump may change at once."""
        size = casadi.if_else(at.radius > 0, at.radius, _SPACING)
        if self.spacing is not None:
            size = to_sx(self.spacing, at.symbols)
        return None, custom.regular_length(motion.V) / size

    def figures(self, at: Any) -> Mapping[str, Shape]:
        """The sphere; the ground is not drawn."""
        return _ball("body", at.radius)

    def spots(self, motion: RelativeMotion, at: Any) -> list[Spot]:
        """Under the centre, along the gradient of the depth."""
        c = SX.sym("c", 3)
        h = SX(self.height(c[0], c[1]))
        steep = casadi.gradient(h, c)
        depth = at.radius - (c[2] - h) / casadi.sqrt(1 + casadi.dot(steep, steep))
        fall = -casadi.gradient(depth, c)
        depth, fall = casadi.substitute([depth, fall], [c], [motion.p])
        slope = casadi.norm_2(fall)
        normal = fall / slope
        return [Spot(depth, normal, -(at.radius - depth / 2) * normal, slope)]
