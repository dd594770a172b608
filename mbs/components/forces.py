"""Force elements: components that exert forces on points or joints without constraining them.

A force element is added with its points or joints: `m.add(Spring("s", a.right, b, ...))`. Its law
is written in CasADi scalars; the recursions compute the motion of its points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.bodies import three
from mbs.components.component import Component, Point, SymbolTable, named_scalars
from mbs.components.custom import At, Custom, Friction, Load, OneWay, RelativeMotion, Stop
from mbs.components.joints import smooth_sign
from mbs.components.on_points import OnPair
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, to_float, to_sx
from mbs.spatial import cross, vector
from mbs.text import quoted

J = TypeVar("J", bound="JointForce")


@dataclass(frozen=True, slots=True)
class ForceElement(Custom):
    """Base of components that exert forces on others without constraining them."""


@dataclass(frozen=True, slots=True)
class PairForce(OnPair, ForceElement):
    """A force element between two points of two bodies.

    Attributes:
        a, b: two points. A body stands for its reference frame.
    """

    @property
    def frames(self) -> Mapping[str, Point]:
        """Map from "a" and "b" to the two attachment points."""
        return {"a": self.a, "b": self.b}


@dataclass(frozen=True, slots=True)
class CoordinateForce(ForceElement):
    """Base of force elements on x, a weighted sum of joint coordinates.

    The weights are moment arms: 1, or m/rad for the length of a tendon over a revolute joint.
    """

    @property
    def levers(self) -> tuple[tuple[str, Scalar], ...]:
        """Pairs (coordinate name, moment arm [m/rad or 1]).

        x is the sum of arm times coordinate.
        """
        raise NotImplementedError

    @property
    def coordinates(self) -> Mapping[str, tuple[tuple[str, Scalar], ...]]:
        """Map from the single port "x" to the pairs (coordinate name, moment arm) of `levers`."""
        return {"x": self.levers}

    def resistance(self, at: At) -> SX:
        """Return the effort (1, 1) against which x must be moved [N m or N].

        The element exerts the negative of this effort. The unit is N m if x is an angle, N if it is
        a length. `at.x` has the value q and the rate v of x.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        raise NotImplementedError

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"x": -resistance}: effort of the element along x [N m or N].

        The assembly applies this effort times its moment arm to each joint coordinate.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"x": -self.resistance(at)}


@dataclass(frozen=True, slots=True)
class JointForce(CoordinateForce):
    """A force element along a joint coordinate.

    Attributes:
        joint: name of the coordinate: the joint, with a suffix if the joint has several.
    """

    joint: str

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if not isinstance(self.joint, str) or not self.joint:
            raise DescriptionError(
                f"{self.name}: joint is {quoted(self.joint)}; give the name of a coordinate, such"
                " as 'j1' or 'slide.s'"
            )

    @property
    def levers(self) -> tuple[tuple[str, Scalar], ...]:
        """The single pair (`joint`, 1): x is this joint coordinate."""
        return ((self.joint, Number(1.0)),)

    def limits(self, at: At) -> Mapping[str, tuple[SX | None, SX | None]]:
        """Return {"x": (lower, upper)} [rad or m]. None is an open side; {} without both fields.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        lower, upper = (getattr(self, side, None) for side in ("lower", "upper"))
        if lower is None and upper is None:
            return {}
        both = (None if x is None else to_sx(x, at.symbols) for x in (lower, upper))
        return {"x": (next(both), next(both))}

    def _take_limits(self) -> None:
        """Convert the fields lower and upper to expressions, in place; None stays.

        Raise DescriptionError if both are None or not in order.
        """
        sides = [name for name in ("lower", "upper") if getattr(self, name) is not None]
        if not sides:
            raise DescriptionError(
                f"{self.name}: a stop has neither lower nor upper; give one limit or both"
            )
        self._normalise(*sides)
        low, high = (to_float(getattr(self, s)) if s in sides else None for s in ("lower", "upper"))
        if low is not None and high is not None and low >= high:
            raise DescriptionError(
                f"{self.name}: lower is {low:g} and upper is {high:g}; give them in order"
            )

    def scoped(self: J, prefix: str) -> J:
        """Return a copy whose name, parameters and joint have the prefix "`prefix`.".

        Args:
            prefix: text before the names, without the dot.
        """
        return replace(Component.scoped(self, prefix), joint=f"{prefix}.{self.joint}")


# Constant forces and torques on a body.


@dataclass(frozen=True, slots=True)
class PointSource(ForceElement):
    """Base of constant forces and torques on one point.

    Attributes:
        point: point of a body. A body stands for its reference frame.
    """

    point: Any

    @property
    def frames(self) -> Mapping[str, Point]:
        """Map from "point" to the point of application."""
        return {"point": self.point}

    @property
    def follows(self) -> bool:
        """Whether the vector is constant in the axes of the point and rotates with the body."""
        return getattr(self, "axes", "world") == "body"

    def _take_vector(self, name: str) -> None:
        """Convert `point` to a Point and the field `name` to three expressions, in place.

        Raise DescriptionError if a value is invalid, all components are zero, or `axes` is unknown.
        """
        Component.__post_init__(self)
        self._take_point("point")
        object.__setattr__(self, name, three(getattr(self, name), f"{self.name}, {name}"))
        self._require_effect(name)
        self._require_axes()


@dataclass(frozen=True, slots=True)
class Force(PointSource):
    """A constant force at a point.

    Attributes:
        force: three components [N].
        axes: "world" for a direction fixed in space, "body" for a direction that rotates with the
            point.
    """

    force: Any
    axes: str = "world"

    def __post_init__(self) -> None:
        self._take_vector("force")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"point": force ON the body at the origin of the point, in axes of the point} [N].

        There is no moment about the origin of the point, and no reaction on another body.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"point": custom.force(_in_point_axes(self.force, self.follows, at), own_axes=True)}


@dataclass(frozen=True, slots=True)
class Torque(PointSource):
    """A constant torque on a body.

    Attributes:
        torque: three components [N m].
        axes: "world" for a direction fixed in space, "body" for a direction that rotates with the
            point.
    """

    torque: Any
    axes: str = "world"

    def __post_init__(self) -> None:
        self._take_vector("torque")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"point": torque ON the body, in axes of the point} [N m], without a reaction.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {
            "point": custom.torque(_in_point_axes(self.torque, self.follows, at), own_axes=True)
        }


def _in_point_axes(components: tuple[Expression, ...], follows: bool, at: At) -> SX:
    """Return a constant vector (3, 1) in axes of the point `at.point`.

    The given components are in axes of the point if `follows`, else in axes of the world.
    """
    value = vector(to_sx(component, at.symbols) for component in components)
    return value if follows else casadi.densify(casadi.mtimes(at.point.R.T, value))


# Forces along the line between two points: springs, dampers, attraction of two masses.
#
# Source: Haug 1989 for translational springs, dampers and actuators.


@dataclass(frozen=True, slots=True)
class LineForce(PairForce):
    """Base of tensions along the line from a to b, functions of the distance L and its rate.

    L is sqrt(d'd + (1e-12 m)^2) with the vector d from a to b. If the points coincide, the
    direction is undefined and the force is zero instead of NaN.
    """

    force = custom.output("N")

    def tension(self, length: SX, rate: SX, symbols: SymbolTable) -> SX:
        """Return the tension (1, 1) [N]; a negative tension pushes the points apart.

        Args:
            length: (1, 1) distance of the points a and b [m].
            rate: (1, 1) rate of the distance [m/s].
            symbols: CasADi symbol of each parameter, by name.
        """
        raise NotImplementedError

    def potential(self, length: SX, symbols: SymbolTable) -> SX:
        """Return the stored energy (1, 1) [J], whose derivative by `length` is the tension at rest.

        Args:
            length: (1, 1) distance of the points a and b [m].
            symbols: CasADi symbol of each parameter, by name.
        """
        raise NotImplementedError

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the forces ON the points "a" and "b": the tension [N], towards the other point.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return custom.pull(at.a, at.b, self._tension(at))

    def energy(self, at: At) -> SX:
        """Return `potential` [J] at the present distance of a and b.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return self.potential(at.a.to(at.b).length, at.symbols)

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"force": tension [N]}, positive if the points are pulled together.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"force": self._tension(at)}

    def _tension(self, at: At) -> SX:
        """Return the tension [N] at the present distance of a and b and its rate."""
        motion = at.a.to(at.b)
        return self.tension(motion.length, motion.rate, at.symbols)


@dataclass(frozen=True, slots=True)
class Spring(LineForce):
    """A spring with a parallel damper: tension k (L - L0) + c dL/dt.

    Attributes:
        stiffness: k [N/m].
        length: free length L0 [m].
        damping: c [N s/m].
    """

    shape = "coil"

    stiffness: Scalar
    length: Scalar = 0.0
    damping: Scalar = 0.0

    def __post_init__(self) -> None:
        PairForce.__post_init__(self)
        self._normalise("stiffness", "length", "damping")
        self._require_magnitudes("stiffness", "length", "damping")
        self._require_effect("stiffness", "damping")

    def tension(self, length: SX, rate: SX, symbols: SymbolTable) -> SX:
        """Return stiffness (length - free length) + damping rate [N].

        Negative if the spring pushes.

        Args:
            length: (1, 1) distance of the points a and b [m].
            rate: (1, 1) rate of the distance [m/s].
            symbols: CasADi symbol of each parameter, by name.
        """
        stretch = length - to_sx(self.length, symbols)
        return to_sx(self.stiffness, symbols) * stretch + to_sx(self.damping, symbols) * rate

    def potential(self, length: SX, symbols: SymbolTable) -> SX:
        """Return stiffness (length - free length)^2 / 2 [J].

        Args:
            length: (1, 1) distance of the points a and b [m].
            symbols: CasADi symbol of each parameter, by name.
        """
        stretch = length - to_sx(self.length, symbols)
        return 0.5 * to_sx(self.stiffness, symbols) * stretch**2


@dataclass(frozen=True, slots=True)
class Damper(LineForce):
    """A damper: tension c dL/dt.

    Attributes:
        damping: c [N s/m].
    """

    damping: Scalar

    def __post_init__(self) -> None:
        PairForce.__post_init__(self)
        self._normalise("damping")
        self._require_magnitudes("damping")
        self._require_effect("damping")

    def tension(self, length: SX, rate: SX, symbols: SymbolTable) -> SX:
        """Return damping times the rate of the distance [N]. Positive: the points move apart.

        Args:
            length: (1, 1) distance of the points a and b [m].
            rate: (1, 1) rate of the distance [m/s].
            symbols: CasADi symbol of each parameter, by name.
        """
        return to_sx(self.damping, symbols) * rate

    def potential(self, length: SX, symbols: SymbolTable) -> SX:
        """Return zero: a damper stores no energy.

        Args:
            length: (1, 1) distance of the points a and b [m].
            symbols: CasADi symbol of each parameter, by name.
        """
        return SX(0)


@dataclass(frozen=True, slots=True)
class PointGravity(LineForce):
    """Inverse-square attraction between two points: tension mu / L^2.

    For the central gravity of a body of mass m: mu = G M m, between the two centres of mass.

    Attributes:
        strength: mu [N m^2]. If it is negative, the points repel each other, as equal charges do.
    """

    strength: Scalar

    def __post_init__(self) -> None:
        PairForce.__post_init__(self)
        self._normalise("strength")
        self._require_effect("strength")

    def tension(self, length: SX, rate: SX, symbols: SymbolTable) -> SX:
        """Return mu / length^2 [N], positive if the points attract each other.

        Args:
            length: (1, 1) distance of the points a and b [m].
            rate: (1, 1) rate of the distance [m/s].
            symbols: CasADi symbol of each parameter, by name.
        """
        return to_sx(self.strength, symbols) / length**2

    def potential(self, length: SX, symbols: SymbolTable) -> SX:
        """Return the potential energy -mu / length [J], which is zero at infinite distance.

        Args:
            length: (1, 1) distance of the points a and b [m].
            symbols: CasADi symbol of each parameter, by name.
        """
        return -to_sx(self.strength, symbols) / length


class SpringDamperSeries(ForceElement):
    """A spring in series with a damper between two points, a Maxwell element.

    With the distance L of the points and the state z, the elongation of the damper, the tension is
    T = stiffness (L - length - z), and damping dz/dt = T - parallel z. At a constant distance it
    relaxes with the time constant damping / (stiffness + parallel). With a spring parallel to the
    damper it is the standard linear solid: the node between the springs has no mass.

    Source: Haug 1989 for translational springs and dampers.

    Attributes:
        a, b: two points. A body stands for its reference frame.
        stiffness: stiffness of the spring in series [N/m].
        damping: damping of the damper [N s/m].
        length: free length of spring and damper together at z = 0 [m].
        elongation: initial elongation of the damper [m].
        parallel: stiffness of a spring parallel to the damper [N/m].
    """

    a = custom.frame()
    b = custom.frame()
    stiffness = custom.parameter("N/m", positive=True)
    damping = custom.parameter("N.s/m", positive=True)
    length = custom.parameter("m", 0.0, min=0)
    elongation = custom.state("m")
    force = custom.output("N")
    parallel = custom.parameter("N/m", 0.0, min=0)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"elongation": dz/dt [m/s]}, the damper force divided by `damping`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"elongation": self._damper_force(at) / at.damping}

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the forces ON the points "a" and "b": tension T [N], towards the other point.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return custom.pull(at.a, at.b, self._tension(at))

    def energy(self, at: At) -> SX:
        """Return the energy of both springs [J].

        It is stiffness (L - length - z)^2 / 2 + parallel z^2 / 2.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        stored = at.stiffness * self._stretch(at) ** 2 + at.parallel * at.elongation**2
        return SX(0.5 * stored)

    def dissipation(self, at: At) -> SX:
        """Return the power dissipated by the damper, damper force^2 / damping [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self._damper_force(at) ** 2 / at.damping)

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"force": tension T [N]}, positive if it pulls the points together.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"force": self._tension(at)}

    def _stretch(self, at: At) -> SX:
        """Return the elongation L - length - z of the series spring [m], negative if compressed."""
        return SX(at.a.to(at.b).length - at.length - at.elongation)

    def _tension(self, at: At) -> SX:
        """Return the tension T of the series spring [N].

        Positive values pull the points together.
        """
        return SX(at.stiffness * self._stretch(at))

    def _damper_force(self, at: At) -> SX:
        """Return the damper force T - parallel z [N] from the balance at the massless node."""
        return SX(self._tension(at) - at.parallel * at.elongation)


class SpringFrictionSeries(ForceElement):
    """A spring in series with dry friction between two points, a Jenkins element.

    With the distance L of the points and the elongation z of the friction, the tension is
    T = stiffness (L - length - z). The friction sticks while |T - parallel z| is below `friction`.
    It slides otherwise, with |T - parallel z| = friction. The element is independent of the rate: a
    cycle of amplitude X, without a parallel spring, dissipates the energy
    4 friction (X - friction / stiffness). Simulations and FMUs change between sticking and sliding
    at events.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        a, b: two points. A body stands for its reference frame.
        stiffness: stiffness of the spring in series [N/m].
        friction: force at which the friction slides [N].
        length: free length at z = 0 [m].
        parallel: stiffness of a spring parallel to the friction [N/m].
        elongation: mode, z while the friction sticks [m]. Simulations set it.
        direction: mode, direction of sliding: 1 if z increases, -1 if z decreases, 0 if the
            friction sticks. Simulations set it.
    """

    a = custom.frame()
    b = custom.frame()
    stiffness = custom.parameter("N/m", positive=True)
    friction = custom.parameter("N", positive=True)
    length = custom.parameter("m", 0.0, min=0)
    parallel = custom.parameter("N/m", 0.0, min=0)
    elongation = custom.mode()
    direction = custom.mode()
    force = custom.output("N")
    slip = custom.output("m")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the forces ON the points "a" and "b": tension T [N], towards the other point.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return custom.pull(at.a, at.b, self._tension(at))

    def energy(self, at: At) -> SX:
        """Return the energy of both springs, T^2 / (2 stiffness) + parallel z^2 / 2 [J].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        z = self._elongation(at)
        return SX(0.5 * (self._tension(at) ** 2 / at.stiffness + at.parallel * z**2))

    def dissipation(self, at: At) -> SX:
        """Return the friction power during sliding [W]; zero while the friction sticks.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        share = at.stiffness / (at.stiffness + at.parallel)
        return SX(at.friction * share * at.direction * at.a.to(at.b).rate)

    def events(self, at: At) -> Mapping[str, custom.Event]:
        """Return the events "longer" and "shorter" (sliding begins in a direction) and "sticks".

        Sliding begins if |T - parallel z| reaches `friction`, and ends if the rate of L changes
        sign.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        sticks, rate = at.direction == 0, at.a.to(at.b).rate
        force = self._tension(at) - at.parallel * at.elongation
        found = {}
        for label, sign in (("longer", 1), ("shorter", -1)):
            then = {
                "elongation": self._sliding(at, sign),
                "direction": casadi.if_else(sign * rate > 0, sign, 0),
            }
            when = casadi.if_else(sticks, at.friction - sign * force, at.friction)
            found[label] = custom.Event(when, then)
        turned = casadi.if_else(sticks, 1, at.direction * rate)
        stop = {"elongation": self._elongation(at), "direction": SX(0)}
        return {**found, "sticks": custom.Event(turned, stop)}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return "force": tension T [N], positive if it pulls, and "slip": elongation z [m].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"force": self._tension(at), "slip": self._elongation(at)}

    def _sliding(self, at: At, direction: SX | int) -> SX:
        """Return the elongation z [m] at which the friction slides.

        There T - parallel z is `direction` (1 or -1) times the friction force.
        """
        pull = at.stiffness * (at.a.to(at.b).length - at.length) - direction * at.friction
        return SX(pull / (at.stiffness + at.parallel))

    def _elongation(self, at: At) -> SX:
        """Return the elongation z of the friction [m].

        It is the stored value while the friction sticks, else that of sliding.
        """
        return SX(casadi.if_else(at.direction == 0, at.elongation, self._sliding(at, at.direction)))

    def _tension(self, at: At) -> SX:
        """Return the tension T = stiffness (L - length - z) [N], positive if it pulls."""
        return SX(at.stiffness * (at.a.to(at.b).length - at.length - self._elongation(at)))


# Bushings: elastic mounts between two frames.
#
# Source: Haug 1989 for forces between bodies. The angles are from the unit quaternion.


_HALF_REVOLUTION = 1e-12
"""Lower bound of 2 cos(theta / 2), which avoids a division by zero at half a revolution. Its
square, 1e-24, is below rounding at all other angles."""
_STRENGTHS = ("stiffness", "damping", "angular_stiffness", "angular_damping")


@dataclass(frozen=True, slots=True)
class Bushing(PairForce):
    """Springs and dampers along and about the three axes of frame a, relaxed if a and b coincide.

    The displacement p is the position of the origin of b in frame a. The angles are
    phi = 2 sin(theta / 2) u for a rotation by theta about u, which is the rotation vector for small
    theta. Forces and moments are exact derivatives of the energy p' K p / 2 + phi' K_phi phi / 2
    for rotations of less than half a revolution.

    Attributes:
        stiffness: K along the axes of a [N/m], three numbers or a common number.
        damping: damping along the axes of a [N s/m], three numbers or a common number.
        angular_stiffness: K_phi about the axes of a [N m/rad], three numbers or a common number.
        angular_damping: damping about the axes of a [N m s/rad], three numbers or a common number.
    """

    shape = "coil"

    force_x = custom.output("N")
    force_y = custom.output("N")
    force_z = custom.output("N")
    moment_x = custom.output("N.m")
    moment_y = custom.output("N.m")
    moment_z = custom.output("N.m")

    stiffness: Any = 0.0
    damping: Any = 0.0
    angular_stiffness: Any = 0.0
    angular_damping: Any = 0.0

    def __post_init__(self) -> None:
        PairForce.__post_init__(self)
        for name in _STRENGTHS:
            given = getattr(self, name)
            alike = isinstance(given, str) or not hasattr(given, "__iter__")
            values = three((given,) * 3 if alike else given, f"{self.name}, {name}")
            object.__setattr__(self, name, values)
        self._require_magnitudes(*_STRENGTHS)
        self._require_effect(*_STRENGTHS)

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the wrenches ON the frames "a" and "b", each about its origin and in its axes.

        The force pulls the origins together. The force on b acts at its origin, so that the
        reaction on a has an additional moment about the origin of a.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        motion, force, moment = self._load_at_b(at)
        on_a = custom.FrameLoad(force, moment + cross(motion.p, force))
        return custom.between(at.a, at.b, on_a, -moment)

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return the wrench ON the body of a about the origin of b, in axes of a.

        Names: force_x, force_y, force_z [N]; moment_x, moment_y, moment_z [N m].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        _, force, moment = self._load_at_b(at)
        values = (*casadi.vertsplit(force), *casadi.vertsplit(moment))
        return dict(zip(self.output_names, values, strict=True))

    def _load_at_b(self, at: At) -> tuple[RelativeMotion, SX, SX]:
        """Return the motion of b in a, and force [N] and moment [N m] ON a about the origin of b.

        All are in axes of a, (3, 1).
        """
        motion, symbols = at.a.to(at.b), at.symbols
        half, cosine = _half_turn(motion.R)
        w = motion.w
        rate = cosine * w + cross(w, half)
        force = self._elementwise_sum("stiffness", motion.p, "damping", motion.V, symbols)
        torque = self._elementwise_sum(
            "angular_stiffness", 2 * half, "angular_damping", rate, symbols
        )
        moment = cosine * torque + cross(half, torque)
        return motion, force, moment

    def energy(self, at: At) -> SX:
        """Return the energy p' K p / 2 + phi' K_phi phi / 2 [J], zero if the frames coincide.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        motion = at.a.to(at.b)
        half, _ = _half_turn(motion.R)
        total = SX(0)
        for name, x in (("stiffness", motion.p), ("angular_stiffness", 2 * half)):
            total += 0.5 * casadi.dot(x, self._vector(name, at.symbols) * x)
        return total

    def _elementwise_sum(self, one: str, x: SX, other: str, rate: SX, symbols: SymbolTable) -> SX:
        """Return the sum (3, 1) of the fields `one` times x and `other` times rate, elementwise.

        Each field has three values; `symbols` are the CasADi symbols of parameters by name.
        """
        return self._vector(one, symbols) * x + self._vector(other, symbols) * rate

    def _vector(self, name: str, symbols: SymbolTable) -> SX:
        """Return the three values of the field `name` as a column (3, 1), in CasADi `symbols`."""
        return vector(to_sx(value, symbols) for value in getattr(self, name))


def _half_turn(R: SX) -> tuple[SX, SX]:
    """Return sin(theta / 2) u (3, 1) and cos(theta / 2) of the rotation R by theta about u."""
    cosine = 0.5 * casadi.sqrt(1 + casadi.trace(R) + _HALF_REVOLUTION**2)
    axis = vector([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return axis / (4 * cosine), cosine


# Forces along a coordinate of a joint: stops at its limits, friction that depends on velocity.


@dataclass(frozen=True, slots=True, kw_only=True)
class JointStop(JointForce):
    """Elastic stops: no force between the limits, springs and dampers beyond them.

    Over the first `width` beyond a limit the stiffness grows from zero to its full value, so that
    the force of the spring and its first two derivatives are continuous. The damping force is at
    most as large as the spring force, so that a stop never pulls.

    Source: Modelica Association 2023, `ElastoGap`, for the limit of the damper.

    Attributes:
        lower: lower limit [rad or m]. None for no stop on that side.
        upper: upper limit [rad or m]. None for no stop on that side.
        stiffness: stiffness beyond the limits [N m/rad or N/m].
        damping: damping beyond the limits [N m s/rad or N s/m], which grows over the same width.
        width: depth over which the stiffness grows [rad or m].
    """

    lower: Scalar | None = None
    upper: Scalar | None = None
    stiffness: Scalar
    damping: Scalar = 0.0
    width: Scalar

    effort = custom.output(custom.EFFORT)

    def __post_init__(self) -> None:
        JointForce.__post_init__(self)
        self._take_limits()
        self._normalise("stiffness", "damping", "width")
        self._require_magnitudes("damping")
        self._require_positive("stiffness", "width")

    @property
    def needs_position(self) -> bool:
        """True: the depth beyond a limit depends on the position, not only on the rate."""
        return True

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"effort": effort ON the joint [N m or N]}: negative at the upper limit.

        It is positive at the lower limit and zero between the limits.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"effort": -self.resistance(at)}

    def resistance(self, at: At) -> SX:
        """Return the effort against which the joint is moved: positive beyond the upper limit.

        It is negative beyond the lower limit and zero between the limits. Its size is stiffness
        times the ramp of the depth (see `smooth_ramp`) plus the damping effort, limited to that of
        the spring.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        stiffness, damping = to_sx(self.stiffness, at.symbols), to_sx(self.damping, at.symbols)
        total = SX(0)
        for sign, depth, width in self._stop_depths(at.x.q, at.symbols):
            share, ramp, _ = smooth_ramp(depth, width)
            spring = stiffness * ramp
            total += sign * spring + one_sided_damping(damping * share * at.x.v, spring)
        return total

    def energy(self, at: At) -> SX:
        """Return the energy of the stop springs [J]; zero between the limits.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        stiffness = to_sx(self.stiffness, at.symbols)
        areas = (
            smooth_ramp(depth, width)[2]
            for _, depth, width in self._stop_depths(at.x.q, at.symbols)
        )
        return stiffness * sum(areas, SX(0))

    def _stop_depths(self, q: SX, symbols: SymbolTable) -> list[tuple[float, SX, SX]]:
        """Return (sign, depth beyond the limit, width) [1, rad or m] of each stop at position q.

        The sign is 1 for the upper and -1 for the lower limit. The depth is negative within the
        limits.
        """
        width = to_sx(self.width, symbols)
        sides = []
        if self.upper is not None:
            sides.append((1.0, q - to_sx(self.upper, symbols), width))
        if self.lower is not None:
            sides.append((-1.0, to_sx(self.lower, symbols) - q, width))
        return sides


def smooth_ramp(depth: SX, width: SX) -> tuple[SX, SX, SX]:
    """Return a slope that rises smoothly from 0 to 1 over a width, and its first two integrals.

    With u = depth / width between 0 and 1 the slope is 3 u^2 - 2 u^3. Beyond the width the first
    integral is depth - width / 2. All are zero for a negative depth.

    Args:
        depth: (1, 1) depth, such as the distance beyond a limit.
        width: (1, 1) depth over which the slope rises, above zero.
    """
    u = casadi.fmin(casadi.fmax(depth / width, 0), 1)
    beyond = casadi.fmax(depth - width, 0)
    slope = u**2 * (3 - 2 * u)
    ramped = width * u**3 * (1 - u / 2) + beyond
    # u^4 / 4 - u^5 / 10 is the integral of the ramp u^3 - u^4 / 2
    area = width**2 * u**4 * (0.25 - 0.1 * u) + 0.5 * beyond * (beyond + width)
    return slope, ramped, area


def one_sided_damping(damper: SX, spring: SX) -> SX:
    """Return the effort of a damper, limited to the effort of the spring parallel to it.

    The sum of both is between zero and twice the spring effort: a contact never pulls.

    Source: Modelica Association 2023, `ElastoGap` and `ElastoBacklash`.

    Args:
        damper: (1, 1) effort of the damper without the limit.
        spring: (1, 1) effort of the spring, not negative.
    """
    if damper.is_zero():
        return damper
    return casadi.fmin(casadi.fmax(damper, -spring), spring)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointFriction(JointForce):
    """Coulomb, Stribeck and viscous friction on a joint.

    The effort is (coulomb + stribeck exp(-(v / velocity)^2)) tanh(v / width) + viscous v.

    Attributes:
        coulomb: Coulomb friction during sliding [N m or N].
        stribeck: additional Coulomb friction at rest [N m or N].
        velocity: velocity at which the additional friction has fallen to 1/e [rad/s or m/s].
        viscous: viscous friction [N m s/rad or N s/m].
        width: velocity over which Coulomb friction changes sign [rad/s or m/s].
    """

    coulomb: Scalar = 0.0
    stribeck: Scalar = 0.0
    velocity: Scalar = 0.1
    viscous: Scalar = 0.0
    width: Scalar = 1e-3

    effort = custom.output(custom.EFFORT)

    def __post_init__(self) -> None:
        JointForce.__post_init__(self)
        self._normalise("coulomb", "stribeck", "velocity", "viscous", "width")
        self._require_magnitudes("coulomb", "stribeck", "viscous")
        self._require_positive("velocity", "width")
        self._require_effect("coulomb", "stribeck", "viscous")

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"effort": friction effort ON the joint [N m or N]}, opposed to its velocity.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"effort": -self.resistance(at)}

    def resistance(self, at: At) -> SX:
        """Return the friction effort (1, 1) of the class docstring; its sign is that of v.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        v, symbols = at.x.v, at.symbols
        coulomb = to_sx(self.coulomb, symbols)
        if self.stribeck != Number(0.0):
            falling = casadi.exp(-((v / to_sx(self.velocity, symbols)) ** 2))
            coulomb = coulomb + to_sx(self.stribeck, symbols) * falling
        total: SX = to_sx(self.viscous, symbols) * v
        return total + coulomb * smooth_sign(v, to_sx(self.width, symbols))

    def dissipation(self, at: At) -> SX:
        """Return the friction power: resistance times velocity [W], never negative.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self.resistance(at) * at.x.v)


# Tendons over joints, without a path in space.


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedTendon(CoordinateForce):
    """A tendon whose length x is a weighted sum of joint positions; the weights are moment arms.

    It pulls and pushes with the tension
    stiffness (x - length) + damping dx/dt + friction tanh(dx/dt / width).
    The effort on every joint is the negative tension times its moment arm. With two lengths the
    spring is slack between them.

    Attributes:
        levers: pairs of the name of a coordinate and its moment arm [m/rad or 1].
        stiffness: stiffness [N/m].
        length: length at which the spring is relaxed [m], or (lower, upper) between which it is
            slack.
        damping: damping [N s/m].
        friction: Coulomb friction [N].
        width: rate of the length over which Coulomb friction changes sign [m/s].
    """

    levers: tuple[tuple[str, Scalar], ...]
    stiffness: Scalar = 0.0
    length: Any = 0.0
    damping: Scalar = 0.0
    friction: Scalar = 0.0
    width: Scalar = 1e-3

    tension = custom.output("N")

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        object.__setattr__(self, "levers", self._checked_levers())
        alike = isinstance(self.length, str) or not hasattr(self.length, "__iter__")
        given = (self.length,) * 2 if alike else tuple(self.length)
        if len(given) != 2:
            raise DescriptionError(
                f"{self.name}: length {quoted(self.length)} is neither one length nor two; give a"
                " number or (lower, upper)"
            )
        ends = tuple(expression(value, f"{self.name}, length") for value in given)
        low, high = (to_float(end) for end in ends)
        if low is not None and high is not None and low > high:
            raise DescriptionError(
                f"{self.name}: length is ({low:g}, {high:g}); give the smaller one first"
            )
        object.__setattr__(self, "length", ends)
        self._normalise("stiffness", "damping", "friction", "width")
        self._require_magnitudes("stiffness", "damping", "friction")
        self._require_positive("width")
        self._require_effect("stiffness", "damping", "friction")

    @property
    def needs_position(self) -> bool:
        """True: the length x is a sum of joint positions, not only of rates."""
        return True

    def scoped(self, prefix: str) -> FixedTendon:
        """Return a copy whose name, parameters and coordinates have the prefix "`prefix`.".

        Args:
            prefix: text before the names, without the dot.
        """
        inner = Component.scoped(self, prefix)
        return replace(inner, levers=tuple((f"{prefix}.{n}", c) for n, c in inner.levers))

    def resistance(self, at: At) -> SX:
        """Return the tension of the class docstring [N]; negative if the tendon pushes.

        Damping and friction also act while the spring is slack.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        x, rate, symbols = at.x.q, at.x.v, at.symbols
        total = to_sx(self.stiffness, symbols) * self._stretch(x, symbols)
        total += to_sx(self.damping, symbols) * rate
        if self.friction != Number(0.0):
            width = to_sx(self.width, symbols)
            total += to_sx(self.friction, symbols) * smooth_sign(rate, width)
        return total

    def energy(self, at: At) -> SX:
        """Return stiffness times stretch^2 / 2 [J]; zero while the spring is slack.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return 0.5 * to_sx(self.stiffness, at.symbols) * self._stretch(at.x.q, at.symbols) ** 2

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"tension": tension [N]}, negative if the tendon pushes.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"tension": self.resistance(at)}

    def _stretch(self, x: SX, symbols: SymbolTable) -> SX:
        """Return the elongation of the spring [m] at the length x: negative below `length`.

        With two lengths it is zero between them.
        """
        low, high = (to_sx(end, symbols) for end in self.length)
        if self.length[0] == self.length[1]:
            return x - low
        return casadi.fmax(x - high, 0) + casadi.fmin(x - low, 0)

    def _checked_levers(self) -> tuple[tuple[str, Expression], ...]:
        """Return `levers` as pairs (coordinate name, moment arm).

        Raise DescriptionError for other forms, or if a name is repeated.
        """
        pairs = named_scalars(self.levers) or []
        if not pairs or len({name for name, _ in pairs}) < len(pairs):
            raise DescriptionError(
                f"{self.name}: levers {quoted(self.levers)} are not pairs of a coordinate and a"
                " lever, each coordinate once; give them such as (('j1', 0.02), ('j2', -0.01))"
            )
        return tuple((n, expression(c, f"{self.name}, lever of {n}")) for n, c in pairs)


# Contacts along a joint coordinate: rigid stops, and Coulomb friction with sticking.
#
# A contact locks and releases the coordinate during the motion. Simulations change its state at
# events. Smooth models, such as inverse dynamics, do not contain these contacts.


@dataclass(frozen=True, slots=True, kw_only=True)
class JointContact(JointForce):
    """Base of elements that may lock a joint coordinate, in simulations only."""

    loads = Custom.loads  # no loads in smooth models


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidStop(JointContact):
    """Rigid limits of a coordinate, with impacts and contact.

    An impact with velocity v rebounds with -restitution v. If the rebound is slower than
    `rest_speed`, the coordinate stays at the limit until a force moves it away.

    Attributes:
        lower: lower limit [rad or m]. None for no stop on that side.
        upper: upper limit [rad or m]. None for no stop on that side.
        restitution: Newton's coefficient of restitution, between 0 and 1.
        rest_speed: speed of the slowest rebound [rad/s or m/s].
    """

    lower: Scalar | None = None
    upper: Scalar | None = None
    restitution: Scalar = 0.0
    rest_speed: Scalar = 1e-4

    def __post_init__(self) -> None:
        JointForce.__post_init__(self)
        self._take_limits()
        self._normalise("restitution", "rest_speed")
        self._require_magnitudes("restitution")
        self._require_positive("rest_speed")
        restitution = to_float(self.restitution)
        if restitution is not None and restitution > 1:
            raise DescriptionError(
                f"{self.name}: restitution is {restitution:g}, an impact that gives energy; give a"
                " number between 0 and 1"
            )

    @property
    def needs_position(self) -> bool:
        """True: the limits are limits of a position."""
        return True

    def stops(self, at: At) -> Mapping[str, Stop | OneWay]:
        """Return {"": Stop} that keeps the coordinate between lower and upper [rad or m].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        lower, upper = self.limits(at)["x"]
        e, slowest = (to_sx(x, at.symbols) for x in (self.restitution, self.rest_speed))
        return {"": Stop(at.x.q, lower, upper, restitution=e, rest_speed=slowest)}


@dataclass(frozen=True, slots=True, kw_only=True)
class CoulombFriction(JointContact):
    """Coulomb friction with sticking: the coordinate sticks up to a largest effort, then slides.

    Attributes:
        sliding: friction during sliding [N m or N].
        sticking: largest effort during sticking [N m or N], at least `sliding`, which is the
            default.
    """

    sliding: Scalar
    sticking: Scalar | None = None

    def __post_init__(self) -> None:
        JointForce.__post_init__(self)
        if self.sticking is None:
            object.__setattr__(self, "sticking", self.sliding)
        self._normalise("sliding", "sticking")
        self._require_magnitudes("sliding", "sticking")
        assert self.sticking is not None
        low, high = to_float(self.sliding), to_float(self.sticking)
        if low is not None and high is not None and high < low:
            raise DescriptionError(
                f"{self.name}: sticking is {high:g} and sliding is {low:g}; at rest Coulomb"
                " friction"
                " holds at least as much, so give sticking >= sliding"
            )
        if self.sticking == Number(0.0):
            raise DescriptionError(
                f"{self.name}: sliding and sticking are zero, so that the CoulombFriction does"
                " nothing; give a strength or leave it out"
            )

    def frictions(self, at: At) -> Mapping[str, Friction]:
        """Return {"": Friction} whose slip is the velocity of the coordinate [rad/s or m/s].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        assert self.sticking is not None
        sliding, sticking = (to_sx(x, at.symbols) for x in (self.sliding, self.sticking))
        return {"": Friction(at.x.v, sliding, sticking)}
