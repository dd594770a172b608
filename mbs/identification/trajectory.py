"""Exciting trajectories: Fourier series of joints within limits of positions, rates and efforts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, SX, Function, cos, mtimes, sin

from mbs.assembly import System
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.errors import ModelError
from mbs.identification.leading import (
    CLEAR,
    active_indices,
    configuration_of,
    is_explicit,
    leads_of,
    motion_function,
    positions,
    signed_leads,
)
from mbs.identification.record import FARTHEST_TURN
from mbs.identification.regressors import Column, regressor
from mbs.models._inverse_dynamics import inverse_dynamics
from mbs.models.geometry import transform
from mbs.numbers import has_boolean
from mbs.result import Result
from mbs.text import did_you_mean, quoted

# Periodic joint motions as finite Fourier series.


Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FourierSeries:
    """Periodic motion: q(t) = q0 + sum of a_k/(w k) sin(w k t) - b_k/(w k) cos(w k t).

    The angular frequency is w = 2 pi/period. Velocities and accelerations are exact derivatives.
    The motion is periodic, so that measured periods can be averaged.

    Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997, eq. 5.

    Attributes:
        period: period [s].
        middle: (m,) constant terms q0 of the joints [rad or m].
        sine: (m, harmonics) coefficients a_k [rad/s or m/s].
        cosine: (m, harmonics) coefficients b_k [rad/s or m/s].
    """

    period: float
    middle: Array
    sine: Array
    cosine: Array

    @property
    def harmonics(self) -> int:
        """Number of multiples of 1/period in the motion."""
        return int(self.sine.shape[1])

    def q(self, t: npt.ArrayLike) -> Array:
        """Return the positions (n, m) of the joints [rad or m], or (m,) for a scalar t.

        Args:
            t: (n,) instants [s], or one instant.

        Raises:
            ModelError: t is a symbol; use `law`.
        """
        return self.middle + self._sum(t, 0)

    def v(self, t: npt.ArrayLike) -> Array:
        """Return the velocities (n, m) of the joints [rad/s or m/s], or (m,) for a scalar t.

        Args:
            t: (n,) instants [s], or one instant.
        """
        return self._sum(t, 1)

    def a(self, t: npt.ArrayLike) -> Array:
        """Return the accelerations (n, m) of the joints [rad/s2 or m/s2], or (m,) for a scalar t.

        Args:
            t: (n,) instants [s], or one instant.
        """
        return self._sum(t, 2)

    def law(self, t: SX | MX, order: int = 0) -> SX | MX:
        """Return the positions (m, 1) or a time derivative as an expression of the time.

        Use it in controllers and prescribed motions.

        Args:
            t: symbol of the time [s].
            order: order of the time derivative: 0 for positions, 1 for velocities, 2 for
                accelerations.
        """
        w = 2 * np.pi / self.period * np.arange(1, self.harmonics + 1)
        turned = w ** (order - 1)
        a, b = (DM(x * turned) for x in (self.sine, self.cosine))
        angle: Any = DM(w) * t + order * np.pi / 2
        moved: SX | MX = mtimes(a, sin(angle)) - mtimes(b, cos(angle))
        return moved + DM(self.middle) if order == 0 else moved

    def _sum(self, t: npt.ArrayLike, order: int) -> Array:
        """Return the derivative of this order (n, m) at times t (n,); order 0 is q without q0."""
        if isinstance(t, SX | MX):
            raise ModelError("excitation: the time is a symbol; use law(t), which takes symbols")
        instants = np.asarray(t, dtype=float)
        terms = harmonic_terms(instants.ravel(), self.period, self.harmonics, order)
        values = terms @ np.hstack([self.sine, self.cosine]).T
        return np.asarray(values.reshape(*instants.shape, len(self.middle)), dtype=float)


def harmonic_terms(t: Array, period: float, harmonics: int, order: int) -> Array:
    """Return the matrix (n, 2 harmonics) from coefficients to a derivative of a Fourier series.

    The coefficients are a_1 .. a_H, b_1 .. b_H of `FourierSeries`, in this order.

    Args:
        t: (n,) instants [s].
        period: period [s].
        harmonics: number H of harmonics.
        order: 0 for q - q0, 1 for the velocity, 2 for the acceleration.
    """
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    sin, cos = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    pairs = {0: (sin / w, -cos / w), 1: (cos, sin), 2: (-w * sin, w * cos)}
    return np.hstack(pairs[order])


def resting_coefficients(period: float, harmonics: int) -> Array:
    """Return an orthonormal basis (2 harmonics, 2 harmonics - 2) of motions that start at rest.

    The columns are coefficients a_k, b_k. Velocity and acceleration are zero at the start and at
    the end of every period.

    Args:
        period: period [s].
        harmonics: number of harmonics, two or more.
    """
    w = np.asarray(2 * np.pi / period * np.arange(1, harmonics + 1), dtype=float)
    # v(0) is the sum of a_k and a(0) the sum of w_k b_k: one condition for each half
    halves = [_orthogonal_complement(condition) for condition in (w**0, w)]
    none = np.zeros((harmonics, harmonics - 1))
    return np.block([[halves[0], none], [none, halves[1]]])


def _orthogonal_complement(direction: Array) -> Array:
    """Return an orthonormal basis (n, n - 1) of the complement of a direction (n,).

    A Householder reflection is used because the basis from a singular value decomposition depends
    on the processor, and so would random motions in it.
    """
    unit = direction / np.sqrt(np.sum(direction * direction))
    v = unit.copy()
    v[0] += 1.0
    reflection = np.eye(len(v)) - np.outer(v, v) / v[0]
    across: Array = reflection[:, 1:]
    return across


def between_samples(samples: int, harmonics: int) -> float:
    """Return the fraction of a limit that samples must keep so that it holds at every instant.

    A trigonometric polynomial of degree n is at most 1/cos(pi n/N) times its largest value at N > 2
    n equally spaced instants of its period.

    Source: Ehlich & Zeller 1964.

    Args:
        samples: number N of samples in one period.
        harmonics: degree n.
    """
    return float(np.cos(np.pi * harmonics / samples))


# Limits of an exciting motion: ranges of joints, rates, efforts, and planes.


_SHARE = 0.2
"""Fraction of the distance from singularity (`leads`) of the assembled configuration that
motions must keep."""

Range = float | tuple[float, float] | None
"""Symmetric limit +-x as a number, a range (lower, upper), or None for no limit."""

Bound = float | Sequence[Range] | Mapping[str, Range] | None
"""Limits of the joints: one number +- for all joints, a sequence of ranges, or ranges by joint
name."""

RATE_UNITS = {"rad": "rad/s", "m": "m/s"}


@dataclass(frozen=True, slots=True)
class Plane:
    """Half-space constraint of a point of the robot: normal . x >= offset.

    Attributes:
        frame: frame of the point: a body, a named frame, or a link number.
        point: coordinates of the point in this frame [m].
        normal: normal of the plane in the base frame, of any length, towards the allowed side.
        offset: distance of the plane from the origin of the base along the normal [m].
    """

    frame: str | int
    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    offset: float

    def __post_init__(self) -> None:
        numbers = np.array([*self.point, *self.normal, self.offset], dtype=float)
        if numbers.shape != (7,) or not np.isfinite(numbers).all():
            raise ModelError(
                f"plane of {quoted(self.frame)}: point {quoted(self.point)}, normal"
                f" {quoted(self.normal)} and offset {quoted(self.offset)} are no seven finite"
                " numbers; give (x, y, z), (x, y, z) and a distance in m"
            )
        if not any(self.normal):
            raise ModelError(
                f"plane of {quoted(self.frame)}: the normal is zero; give the direction of the side"
                " that is allowed"
            )

    @property
    def unit_normal(self) -> Array:
        """Unit normal (3,)."""
        normal = np.array(self.normal, dtype=float)
        return np.asarray(normal / np.linalg.norm(normal), dtype=float)


@dataclass(frozen=True, slots=True)
class MotionLimit:
    """Range of one quantity during the motion.

    Attributes:
        quantity: position, velocity, acceleration, effort, plane or leading (distance from
            singular configurations of a closed system).
        name: name of the coordinate, or of the frame of the point.
        unit: unit of the quantity.
        lower: lower limit; -inf if there is no limit.
        upper: upper limit; inf if there is no limit.
    """

    quantity: str
    name: str
    unit: str
    lower: float
    upper: float

    @property
    def is_finite(self) -> bool:
        """Whether at least one end of the range is finite."""
        return bool(np.isfinite(self.lower) or np.isfinite(self.upper))


@dataclass(frozen=True, slots=True)
class Margin:
    """Extreme values of a quantity during a motion, compared with its limit.

    Attributes:
        limit: the limit.
        lowest: smallest value of the quantity.
        highest: largest value of the quantity.
    """

    limit: MotionLimit
    lowest: float
    highest: float

    @property
    def worst(self) -> float:
        """Distance to the nearer end of the range, negative outside, in the unit of the limit."""
        return float(min(self.lowest - self.limit.lower, self.limit.upper - self.highest))

    @property
    def part(self) -> float:
        """`worst` relative to the larger end of the range; absolute if one side is open."""
        ends = abs(self.limit.lower), abs(self.limit.upper)
        return self.worst / (max(ends) if np.isfinite(ends).all() else 1.0)


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of a motion.

    Attributes:
        position: position limits of the m independent joints, always finite.
        velocity: velocity limits of the independent joints.
        acceleration: acceleration limits of the independent joints.
        effort: effort limits of the independent joints.
        passive: pairs of coordinate index and position limit, for passive joints of a closed
            system.
        planes: half-space constraints of points.
        leading: lower limit of the distance of a closed system from singular configurations.
    """

    position: tuple[MotionLimit, ...]
    velocity: tuple[MotionLimit, ...]
    acceleration: tuple[MotionLimit, ...]
    effort: tuple[MotionLimit, ...]
    passive: tuple[tuple[int, MotionLimit], ...]
    planes: tuple[Plane, ...]
    leading: tuple[MotionLimit, ...] = ()

    @property
    def of_rates(self) -> tuple[MotionLimit, ...]:
        """Limits of positions, velocities and accelerations, each in the order of the joints."""
        return (*self.position, *self.velocity, *self.acceleration)

    @property
    def of_models(self) -> tuple[MotionLimit, ...]:
        """Limits of efforts, passive positions, planes and singularities, in this order."""
        planes = (
            MotionLimit("plane", str(plane.frame), "m", plane.offset, np.inf)
            for plane in self.planes
        )
        return (*self.effort, *(limit for _, limit in self.passive), *planes, *self.leading)


def limits_of(
    system: System,
    position: Bound = None,
    *,
    velocity: Bound = None,
    acceleration: Bound = None,
    effort: Bound = None,
    planes: Sequence[Plane] = (),
) -> MotionLimits:
    """Return the limits of a motion of the independent joints; by default the limits of the joints.

    Args:
        system: open or closed.
        position: limits of positions [rad or m]: a number +- for all joints, a sequence of ranges,
            or a dict from joint name to range, which may contain passive joints.
        velocity: limits of velocities in the same form [rad/s or m/s].
        acceleration: limits of accelerations in the same form [rad/s2 or m/s2].
        effort: limits of efforts in the same form [N m or N].
        planes: half-space constraints of points of the robot.

    Raises:
        ModelError: the number of limits differs from the number of independent joints, a range is
            empty, a name is not a joint, or an independent joint has no position range.
    """
    indices = active_indices(system)
    joints = [system.coordinates[k] for k in indices]
    rates = [RATE_UNITS[joint.unit] for joint in joints]
    free: dict[str, Range] = dict.fromkeys((joint.name for joint in joints), None)
    motors = {row.name: row for row in system.velocity_coordinates}

    def rows(
        quantity: str, bound: Bound, units: Sequence[str], known: Mapping[str, Range] = free
    ) -> tuple[MotionLimit, ...]:
        pairs = _joint_ranges(system, quantity, bound, known)
        return tuple(MotionLimit(quantity, *row) for row in _join(list(known), units, pairs))

    own, others = _position_limits(system, position, indices)
    positions = rows("position", own, [joint.unit for joint in joints])
    for limit in positions:
        if not (np.isfinite(limit.lower) and np.isfinite(limit.upper)):
            raise ModelError(
                f"{system.name}: joint {limit.name} has no range of positions; give position="
                " with (lower, upper) for each independent joint"
            )
        widest = max(-limit.lower, limit.upper)
        if limit.unit == "rad" and widest > FARTHEST_TURN:
            raise ModelError(
                f"{system.name}: the position of {limit.name} may go to {widest:.4g} rad, more than"
                " two turns of a joint; convert degrees by numpy.radians"
            )
    return MotionLimits(
        positions,
        rows(
            "velocity",
            velocity,
            rates,
            {name: _described_range(motors[name].limits) for name in free},
        ),
        rows("acceleration", acceleration, [ACCELERATION_UNIT[unit] for unit in rates]),
        rows(
            "effort",
            effort,
            [EFFORT_UNIT[unit] for unit in rates],
            {name: _described_range(motors[name].effort) for name in free},
        ),
        others,
        tuple(planes),
        _singularity_limit(system),
    )


def _described_range(described: tuple[float, float] | None) -> Range:
    """Return the range of a joint as described, or None if both ends are infinite."""
    return None if described is None or np.isinf(described).all() else described


def _singularity_limit(system: System) -> tuple[MotionLimit, ...]:
    """Return the limit of the distance from singular configurations; empty for an open system.

    It is reduced if the assembled configuration itself is close to a singular one.
    """
    if not system.is_closed:
        return ()
    least = min(CLEAR, _SHARE * float(leads_of(system, np.array([system.configuration]))[0]))
    return (MotionLimit("leading", system.name, "1", least, np.inf),)


def _position_limits(
    system: System, bound: Bound, indices: Sequence[int]
) -> tuple[Bound, tuple[tuple[int, MotionLimit], ...]]:
    """Return the position limits of independent joints, and of passive joints by index in q.

    `bound` are the limits of the user and `indices` the indices in q of the independent joints.
    """
    ranges: dict[str, Range] = {c.name: c.limits for c in system.coordinates}
    known = [c.name for c in system.coordinates if c.unit in RATE_UNITS]
    if isinstance(bound, Mapping):
        _check_names(system, "position", bound, known)
        ranges |= bound
    passive = []
    for k, c in enumerate(system.coordinates):
        if k not in indices and ranges[c.name] is not None:
            lower, upper = _joint_range(system, "position", ranges[c.name], c.name)
            passive.append((k, MotionLimit("position", c.name, c.unit, lower, upper)))
    if bound is None or isinstance(bound, Mapping):
        bound = [ranges[system.coordinates[k].name] for k in indices]
    return bound, tuple(passive)


def _check_names(system: System, what: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    """Raise ModelError if a key of `given` is not in `known`; `what` is the kind of limit."""
    for name in given:
        if name not in known:
            raise ModelError(
                f"{system.name}: the {what} names {quoted(name)}, which is none of its joints;"
                f" {did_you_mean(name, known)}"
            )


def _join(
    names: Sequence[str], units: Sequence[str], pairs: Sequence[tuple[float, float]]
) -> list[tuple[str, str, float, float]]:
    """Return tuples (name, unit, lower, upper) of quantities, from `pairs` (lower, upper)."""
    rows = zip(names, units, pairs, strict=True)
    return [(name, unit, lower, upper) for name, unit, (lower, upper) in rows]


def _joint_ranges(
    system: System, quantity: str, bound: Bound, described: Mapping[str, Range]
) -> list[tuple[float, float]]:
    """Return (lower, upper) of each joint in `described`, a dict from joint name to default range.

    `bound` are the limits of the user for this quantity, in any accepted form.
    """
    names = list(described)
    if bound is None or isinstance(bound, Mapping):
        given = bound or {}
        _check_names(system, quantity, given, names)
        bound = [given.get(name, described[name]) for name in names]
    if isinstance(bound, str):
        raise ModelError(
            f"{system.name}: {quantity} is {quoted(bound)}; give a number, a range for each joint,"
            " or a dict by joint"
        )
    values = bound if isinstance(bound, Sequence | np.ndarray) else [bound] * len(names)
    if len(values) != len(names):
        raise ModelError(
            f"{system.name}: {quantity} has {len(values)} limits for {len(names)} independent"
            f" joints: {', '.join(names)}; give one for each"
        )
    return [_joint_range(system, quantity, x, name) for x, name in zip(values, names, strict=True)]


def _joint_range(system: System, quantity: str, value: Range, name: str) -> tuple[float, float]:
    """Return the lower and upper limit of one quantity of the joint `name`.

    A number is symmetric, None is unlimited. Raises ModelError for an empty or infinite range.

    `value` is the limit of the user, `quantity` its name in messages.
    """
    if value is None:
        return -np.inf, np.inf
    ends = np.asarray(value, dtype=float).ravel()
    lower, upper = (-ends[0], ends[0]) if ends.size == 1 else (ends[0], ends[-1])
    finite = np.isfinite(ends).all() and not has_boolean(value)
    if ends.size > 2 or not lower < upper or not finite:
        raise ModelError(
            f"{system.name}: the limit of the {quantity} of {name} is {quoted(value)}; give a"
            " positive number, or finite (lower, upper) with lower < upper, or None"
        )
    if quantity in ("velocity", "acceleration") and not lower < 0 < upper:
        raise ModelError(
            f"{system.name}: the {quantity} of {name} is between {lower:g} and {upper:g}; a motion"
            " that starts and ends at rest needs zero inside"
        )
    return float(lower), float(upper)


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Periodic motion of the independent joints that starts at rest.

    Attributes:
        system: system that moves.
        columns: parameters for which the motion was optimised.
        series: Fourier series of the independent joints.
        condition: condition number of the regressor over one period, in SI units.
        scaled_condition: condition number with columns of unit length.
        margins: margins to all limits, including quantities without a limit.
        objective: criterion that was minimised.
        status: return status of the solver.
        steps: number of iterations of the last optimisation.
    """

    system: System
    columns: tuple[Column, ...]
    series: FourierSeries
    condition: float
    scaled_condition: float
    margins: tuple[Margin, ...]
    objective: str = ""
    status: str = ""
    steps: int = 0

    def __repr__(self) -> str:
        return (
            f"<Trajectory {self.system.name}: {self.series.period:g} s, {len(self.columns)}"
            f" columns, condition {self.condition:.3g}>"
        )

    def q(self, t: npt.ArrayLike) -> Array:
        """Return the positions (n, m) of the independent joints [rad or m], or (m,) for a scalar t.

        Args:
            t: (n,) instants [s], or one instant.
        """
        return self.series.q(t)

    def v(self, t: npt.ArrayLike) -> Array:
        """Return the velocities (n, m) of the independent joints, or (m,) for a scalar t.

        They are in rad/s or m/s.

        Args:
            t: (n,) instants [s], or one instant.
        """
        return self.series.v(t)

    def a(self, t: npt.ArrayLike) -> Array:
        """Return the accelerations (n, m) of the independent joints, or (m,) for a scalar t.

        They are in rad/s2 or m/s2.

        Args:
            t: (n,) instants [s], or one instant.
        """
        return self.series.a(t)

    def law(self, t: SX | MX, order: int = 0) -> SX | MX:
        """Return the positions (m, 1) of the independent joints as an expression of the time.

        Args:
            t: symbol of the time [s].
            order: order of the time derivative: 0 for positions, 1 for velocities, 2 for
                accelerations.
        """
        return self.series.law(t, order)

    def configuration(self, t: npt.ArrayLike) -> Array:
        """Return the positions (n, nq) of all joints of the tree, or (nq,) for a scalar t.

        The loops are closed; rows are NaN if they cannot close.

        Args:
            t: (n,) instants [s], or one instant.
        """
        instants = np.asarray(t, dtype=float)
        q = positions(self.system, self.series.q(instants.ravel()))
        return np.asarray(q.reshape(*instants.shape, self.system.nq), dtype=float)

    def table(self, rate: float, periods: int = 1) -> Result:
        """Return a table of positions, velocities and accelerations for a controller.

        Args:
            rate: number of rows per second [1/s].
            periods: number of repetitions of the motion.

        Returns:
            Result with columns such as "j1.q", "j1.v" and "j1.a" of the independent joints. The
            last row is the end of the last period.

        Raises:
            ModelError: the rate or the number of periods is not positive.
        """
        if not rate > 0 or periods < 1:
            raise ModelError(
                f"trajectory: {rate:g} rows in a second for {periods} periods; give a positive rate"
                " and one period or more"
            )
        span = periods * self.series.period
        time = np.linspace(0.0, span, round(span * rate) + 1)
        values = np.hstack([self.q(time), self.v(time), self.a(time)])
        joints = [self.system.coordinates[k] for k in active_indices(self.system)]
        rates = [RATE_UNITS[joint.unit] for joint in joints]
        units = {f"{joint.name}.q": joint.unit for joint in joints}
        units |= {f"{j.name}.v": unit for j, unit in zip(joints, rates, strict=True)}
        units |= {
            f"{j.name}.a": ACCELERATION_UNIT[unit] for j, unit in zip(joints, rates, strict=True)
        }
        return Result(time, values, units, f"excitation of {self.system.name}")

    def worst(self, quantity: str) -> Margin:
        """Return the smallest relative margin of a kind of limit.

        Args:
            quantity: position, velocity, acceleration, effort, plane or leading, as in
                `MotionLimit`.

        Raises:
            ModelError: no such quantity is limited.
        """
        found = [m for m in self.margins if m.limit.quantity == quantity and m.limit.is_finite]
        if not found:
            raise ModelError(f"trajectory: no {quantity} of {self.system.name} is limited")
        return min(found, key=lambda margin: margin.part)

    def text(self) -> str:
        """Return condition numbers, solver status and the ranges of limited quantities as text."""
        lines = [
            f"{self.system.name}: {self.series.period:g} s, {self.series.harmonics} harmonics,"
            f" {len(self.columns)} columns",
            f"Condition number: {self.condition:.4g}; with columns of length one"
            f" {self.scaled_condition:.4g}",
            f"Objective {self.objective}: {self.status} after {self.steps} steps",
            "quantity      name       lowest    highest      limits                margin",
        ]
        lines += [_margin_line(margin) for margin in self.margins if margin.limit.is_finite]
        return "\n".join(lines)


def _margin_line(margin: Margin) -> str:
    """Return one line of the table of margins."""
    limit = margin.limit
    ends = f"{limit.lower:9.4g} .. {limit.upper:<9.4g}"
    return (
        f"{limit.quantity:<13} {limit.name:<8} {margin.lowest:9.4f} {margin.highest:10.4f}"
        f"   {ends} {margin.worst:9.2g} {limit.unit}"
    )


# Observations and limited quantities of a system at one instant of a motion.


def instant(system: System, columns: Sequence[Column], limits: MotionLimits) -> Function:
    """``instant(q_a, v_a, a_a) -> D, bounded``: regressor and limited quantities at one instant.

    Positions of the passive joints of a closed system are computed in closed form if one exists,
    otherwise by continuation from the assembled configuration.

    Args:
        system: open or closed, at the default values of its parameters.
        columns: parameters of the system, with any names.
        limits: limits of the motion; the quantities of `of_models` are computed.

    Returns:
        Function of positions, velocities and accelerations (m, 1) of the independent joints. D (k,
        m) is the transposed regressor; bounded is (r, 1).

    Raises:
        ModelError: a column is not a parameter of the system, or the frame of a plane is unknown.
    """
    m = len(system.independent)
    q_a, v_a, a_a = (MX.sym(name, m) for name in ("q_a", "v_a", "a_a"))
    q = configuration_of(system, q_a)
    D = motion_function(regressor(system, columns))(q, v_a, a_a)
    bounded = [*_efforts(system, limits, q, v_a, a_a), *(q[k] for k, _ in limits.passive)]
    for plane in limits.planes:
        T = motion_function(transform(system, plane.frame))(q)
        bounded.append(casadi.dot(DM(plane.unit_normal), (T @ DM([*plane.point, 1.0]))[:3]))
    if limits.leading:
        bounded.append(signed_leads(system)(q))
    outputs = [D.T, casadi.vertcat(MX(0, 1), *bounded)]
    names = ["q_a", "v_a", "a_a"], ["D", "bounded"]
    function = Function("instant", [q_a, v_a, a_a], outputs, *names)
    return function.expand() if is_explicit(system) else function


def _efforts(system: System, limits: MotionLimits, q: MX, v_a: MX, a_a: MX) -> list[MX]:
    """Return the effort of each independent joint at one instant; zeros if no effort is limited.

    q (nq, 1) closes the loops; v_a and a_a (m, 1) are of the independent joints. Raises ModelError
    if motors are at other joints.
    """
    if not any(limit.is_finite for limit in limits.effort):
        return [MX(0) for _ in limits.effort]
    if system.motors != system.independent:
        raise ModelError(
            f"{system.name}: limits of efforts are given and its motors are not its independent"
            " joints, so that they share efforts in many ways; leave the limits of efforts out"
        )
    tau = motion_function(inverse_dynamics(system))(q, v_a, a_a)
    return [tau[k] for k in range(len(limits.effort))]
