"""Locking of joints, and change of a root between fixed and free."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mbs.components.bodies import RigidBody
from mbs.components.component import (
    Component,
    ElementaryRotation,
    FixedRotation,
    Placement,
    Point,
    Step,
    Translation,
    angle_expression,
    with_points,
)
from mbs.components.constraints import Constraint
from mbs.components.couplings import Coupling
from mbs.components.custom import Custom
from mbs.components.forces import CoordinateForce
from mbs.components.joints import Fixed, Free, Freedom, Joint, Motion
from mbs.components.on_points import OnPoints
from mbs.components.sensors import OnJoint
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, to_float
from mbs.spatial import align_z, nearest_rotation
from mbs.text import did_you_mean, quoted

if TYPE_CHECKING:
    from mbs.components.description import Description

_AGREE = 1e-9
"""Tolerance of a coupling between two locked joints [rad or m]: files have 10 digits."""


@dataclass(slots=True)
class _Locks:
    """Positions of the locked joints, with the joints that couplings lock with them.

    Attributes:
        mechanism: mechanism that has the joints.
        positions: one expression per element of q, by joint.
        values: value of each locked coordinate.
        gone: names of couplings whose coordinates are all locked.
        changed: couplings of more than two coordinates, reduced to their unlocked coordinates.
    """

    mechanism: Description
    positions: dict[str, tuple[Expression, ...]] = field(default_factory=dict)
    values: dict[str, Expression] = field(default_factory=dict)
    gone: set[str] = field(default_factory=set)
    changed: dict[str, Coupling] = field(default_factory=dict)

    def add(self, name: str, given: Any) -> None:
        """Record the position `given` of the joint `name`.

        It is a number, or one number per element of its q: angles in rad, lengths in m, quaternions
        w, x, y, z. Raise DescriptionError if the number of values differs or the joint does not
        exist.
        """
        joint = self._joint(name)
        where = f"{self.mechanism.name}: lock of {name}"
        many = given if np.ndim(given) else (given,)
        count = sum(freedom.motion.nq for freedom in joint.freedoms)
        if isinstance(given, Mapping) or len(many) != count:
            raise DescriptionError(
                f"{where}: {quoted(given)} is not its position; give {count} number(s)"
            )
        position = tuple(expression(value, where) for value in many)
        self.positions[name] = position
        at = 0
        for freedom in joint.freedoms:
            if freedom.motion.nq == 1:
                self.values[freedom.coordinate_of(name)] = position[at]
            at += freedom.motion.nq

    def _joint(self, name: str) -> Joint:
        """Return the joint `name`; raise DescriptionError if it does not exist or cannot move."""
        joints = {
            joint.name: joint
            for joint in self.mechanism.joints()
            if not isinstance(joint, (Fixed, Constraint))
        }
        if name not in joints:
            raise DescriptionError(
                f"{self.mechanism.name}: {quoted(name)} is no joint that could be locked;"
                f" {did_you_mean(name, joints)}"
            )
        return joints[name]

    def follow_couplings(self) -> None:
        """Lock the joints whose positions follow from locked joints by couplings, repeatedly.

        Couplings without unlocked coordinates are recorded in `gone`, reduced couplings in
        `changed`. Raise DescriptionError if a coupling contradicts the locked positions.
        """
        pending = list(self.mechanism.couplings())
        while True:
            touched = [c for c in pending if set(c.coordinates) & self.values.keys()]
            if not touched:
                return
            for coupling in touched:
                pending.remove(coupling)
                left = self._in_free_coordinates(coupling)
                if set(left.coordinates) & self.values.keys():
                    self._lock_coupled(left)
                    self.gone.add(left.name)
                else:  # it couples only free joints, so far
                    self.changed[left.name] = left
                    pending.append(left)

    def _in_free_coordinates(self, coupling: Coupling) -> Coupling:
        """Return a coupling of its unlocked coordinates, with the locked ones in its constant term.

        A coupling of two coordinates is returned unchanged.
        """
        if not coupling.others:
            return coupling
        offset = sum(
            (factor * self.values[name] for name, factor in coupling.others if name in self.values),
            start=Number(0.0),
        )
        free = [(name, factor) for name, factor in coupling.others if name not in self.values]
        first, *rest = coupling.coefficients or (0.0,)
        left = replace(coupling, coefficients=(first + offset, *rest), others=tuple(free))
        locked = self.values.get(left.driver)
        if free and locked is not None:  # the next coordinate drives
            (driver, factor), *free = free
            terms = (_polynomial(left, locked), factor)
            left = replace(left, driver=driver, coefficients=terms, others=tuple(free))
        locked = self.values.get(left.driven)
        if free and locked is not None:  # the driver becomes driven
            constant, factor = self._linear(left)
            shares = [(name, expression(value) * -1.0 / factor) for name, value in free]
            (driver, share), *shares = shares
            terms = ((locked - constant) / factor, share)
            left = replace(
                left, driven=left.driver, driver=driver, coefficients=terms, others=tuple(shares)
            )
        return left

    def _linear(self, coupling: Coupling) -> tuple[Expression, Expression]:
        """Return (offset, factor) of a coupling driven = offset + factor driver.

        Raise DescriptionError if its polynomial is not linear or its factor is zero.
        """
        terms = [expression(c) for c in coupling.coefficients]
        offset, factor = (*terms, Number(0.0), Number(0.0))[:2]
        if len(terms) > 2 or to_float(factor) == 0:
            raise DescriptionError(
                f"{self.mechanism.name}: {coupling.name} does not tell where {coupling.driver} is"
                f" when {coupling.driven} is locked; lock {coupling.driver}"
            )
        return offset, factor

    def _lock_coupled(self, coupling: Coupling) -> None:
        """Lock the unlocked coordinate of a coupling of two coordinates.

        Raise DescriptionError if both are locked and disagree.
        """
        driver, driven = (self.values.get(name) for name in (coupling.driver, coupling.driven))
        if driver is None:
            assert driven is not None
            self._add_coupled(coupling, coupling.driver, self._driver(coupling, driven))
            return
        value = _polynomial(coupling, driver)
        if driven is None:
            self._add_coupled(coupling, coupling.driven, value)
            return
        one, other = to_float(value), to_float(driven)
        if one is None or other is None or not math.isclose(one, other, abs_tol=_AGREE):
            raise DescriptionError(
                f"{self.mechanism.name}: {coupling.name} puts {coupling.driven} at {value}, but it"
                f" is locked at {driven}; lock one of the two"
            )

    def _driver(self, coupling: Coupling, driven: Expression) -> Expression:
        """Return the position of the driver of a linear coupling at the position `driven`."""
        offset, factor = self._linear(coupling)
        return (driven - offset) / factor

    def _add_coupled(self, coupling: Coupling, coordinate: str, value: Expression) -> None:
        """Lock the joint of a coordinate at `value`, as `coupling` requires.

        Raise DescriptionError if the joint has several coordinates.
        """
        joint = self.mechanism.components.get(coordinate)
        if not isinstance(joint, Joint):
            raise DescriptionError(
                f"{self.mechanism.name}: {coupling.name} ties {coordinate} to a locked joint; lock"
                " its joint as well"
            )
        self.add(coordinate, value)


def _polynomial(coupling: Coupling, driver: Expression) -> Expression:
    """Return the driven position of a coupling at the position `driver`.

    It is a Number if it has a value.
    """
    value = expression(0.0)
    for coefficient in reversed(coupling.coefficients):
        value = value * driver + expression(coefficient)
    number = to_float(value)
    return value if number is None else Number(number)


def lock(mechanism: Description, positions: Mapping[str, Any]) -> None:
    """Replace joints of a mechanism by welds at given positions, in place; see `Mechanism.lock`.

    Args:
        mechanism: mechanism to change. Joints that couplings tie to locked joints are welded too.
        positions: position by joint name [rad or m]; a sequence for joints with several
            coordinates.

    Raises:
        DescriptionError: a joint or position is invalid, or another component uses the joint.
    """
    locks = _Locks(mechanism)
    for name, given in positions.items():
        locks.add(name, given)
    locks.follow_couplings()
    _require_free_of_others(mechanism, locks)
    welds = {name: Fixed(name) for name in locks.positions}
    steps = {name: _steps(mechanism, name, values) for name, values in locks.positions.items()}

    def reattach(point: Point) -> Point:
        name = point.owner.name
        if name not in welds:
            return point
        # Both frames of the weld are the joint's frame_a; its frame_b follows from the position.
        before = steps[name] if point.port == "b" else ()
        return replace(
            point, owner=welds[name], placement=Placement((*before, *point.placement.steps))
        )

    kept: dict[str, Component] = {}
    for name, component in mechanism.components.items():
        if name in locks.gone or _acts_on(component, locks.values):
            continue
        if isinstance(component, OnPoints):
            component = with_points(component, reattach)
        kept[name] = welds.get(name) or locks.changed.get(name) or component
    mechanism.components = kept
    mechanism.connections = [(reattach(a), reattach(b)) for a, b in mechanism.connections]
    mechanism.frames = {name: reattach(point) for name, point in mechanism.frames.items()}
    mechanism.shapes = [(reattach(point), shape) for point, shape in mechanism.shapes]
    mechanism.cuts = [name for name in mechanism.cuts if name not in welds]
    mechanism.guess = {
        name: value
        for name, value in mechanism.guess.items()
        if not any(name == joint or name.startswith(f"{joint}.") for joint in welds)
    }


def _acts_on(component: Component, coordinates: Mapping[str, Expression]) -> bool:
    """Return whether a component is a force element whose coordinates are all locked.

    It then has no effect. `coordinates` has the locked coordinates as keys.
    """
    return isinstance(component, CoordinateForce) and all(
        name in coordinates for name, _ in component.levers
    )


def _require_free_of_others(mechanism: Description, locks: _Locks) -> None:
    """Raise DescriptionError if a drive line, a sensor or a component uses a joint to lock.

    A force element on locked coordinates only is allowed.
    """
    driven = {flange.owner.name for pair in mechanism.shafts for flange in pair}
    for name in locks.positions:
        if name in driven:
            raise DescriptionError(
                f"{mechanism.name}: {name} is driven by a drive line; take the drive line away"
                " before the joint is locked"
            )
    for component in mechanism.components.values():
        if isinstance(component, Custom) and not _acts_on(component, locks.values):
            names = [name for levers in component.coordinates.values() for name, _ in levers]
            locked = [name for name in names if name in locks.values]
            if locked and isinstance(component, CoordinateForce):
                raise DescriptionError(
                    f"{mechanism.name}: {component.name} acts along {', '.join(names)} together;"
                    f" lock all of them, or take it away before {locked[0]} is locked"
                )
            if locked:
                raise DescriptionError(
                    f"{mechanism.name}: {component.name} knows the coordinate {locked[0]}, which is"
                    " to be locked; take the component away first"
                )
        if isinstance(component, OnJoint) and (
            component.joint in locks.positions or component.joint in locks.values
        ):
            raise DescriptionError(
                f"{mechanism.name}: {component.name} reads the joint {component.joint}, which is"
                " to be locked; take the sensor away first"
            )


def _steps(mechanism: Description, name: str, values: Sequence[Expression]) -> tuple[Step, ...]:
    """Return the displacement steps from frame_a to frame_b of the joint `name`.

    `values` is its position, one expression per element of q.
    """
    joint = mechanism.components[name]
    assert isinstance(joint, Joint)
    steps: list[Step] = []
    at = 0
    for freedom in joint.freedoms:
        own = values[at : at + freedom.motion.nq]
        at += freedom.motion.nq
        steps.extend(_freedom_steps(f"{mechanism.name}: lock of {name}", freedom, own))
    return tuple(steps)


def _freedom_steps(where: str, freedom: Freedom, values: Sequence[Expression]) -> Iterable[Step]:
    """Return the displacement steps of the elementary motion `freedom` at its position `values`.

    `where` is named in error messages.
    """
    match freedom.motion:
        case Motion.PRISMATIC:
            return [
                Translation(*(values[0] * part if part else Number(0.0) for part in freedom.axis))
            ]
        case Motion.REVOLUTE:
            return _axis_rotation(freedom.axis, angle_expression(values[0], where))
        case Motion.SPHERICAL:
            return [_orientation(where, values)]
    return [Translation(*values[:3]), _orientation(where, values[3:])]


def _axis_rotation(axis: Sequence[float], angle: Expression) -> list[Step]:
    """Return the steps of a rotation by `angle` [rad] about a unit vector."""
    for letter, part in zip("xyz", axis, strict=True):
        if abs(part) == 1:
            return [ElementaryRotation(letter, angle if part > 0 else -angle)]
    R_axis = align_z((axis[0], axis[1], axis[2]))
    R = [[float(R_axis[row, column]) for column in range(3)] for row in range(3)]
    back = [list(column) for column in zip(*R, strict=True)]
    return [
        FixedRotation(nearest_rotation(R)),
        ElementaryRotation("z", angle),
        FixedRotation(nearest_rotation(back)),
    ]


def _orientation(where: str, values: Sequence[Scalar]) -> FixedRotation:
    """Return the rotation of a unit quaternion (w, x, y, z).

    Raise DescriptionError, with the name `where`, if its length is not 1.
    """
    numbers = [to_float(expression(value)) for value in values]
    length = math.nan if None in numbers else math.hypot(*(n or 0.0 for n in numbers))
    if not abs(length - 1) < 1e-6:  # quaternions in files have about six digits
        raise DescriptionError(
            f"{where}: the quaternion {quoted([str(v) for v in values])} is not numbers of unit"
            " length; divide it by its length"
        )
    w, x, y, z = ((n or 0.0) / length for n in numbers)
    R = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return FixedRotation(nearest_rotation(R))


# Root: connection to the world, by a weld or by a Free joint.


Base = Literal["fixed", "free"]
"""Connection of the root: a weld to the world, or a Free joint."""

FREE_JOINT = "root_joint"
"""Name of the joint of a free root, as in pinocchio; coordinates root_joint.x, .qw and so on."""


def free_root(mechanism: Description) -> None:
    """Replace the weld of a body to the world by a Free joint, unless a Free joint exists.

    Args:
        mechanism: mechanism, changed in place.

    Raises:
        DescriptionError: the mechanism is not connected to the world by exactly one weld of a body.
    """
    if _free_joints(mechanism):
        return
    world = mechanism.world
    welds = [pair for pair in mechanism.connections if any(p.owner is world for p in pair)]
    bodies = [point.owner for pair in welds for point in pair if point.owner is not world]
    if len(welds) != 1 or not isinstance(bodies[0], RigidBody):
        what = ", ".join(body.name for body in bodies[:5]) or "nothing"
        raise DescriptionError(
            f"{mechanism.name}: its base cannot be free, since no body of its own is the only thing"
            f" that the world holds (it holds {what}); describe a body for the base, with its"
            " inertia, and weld it to the world"
        )
    a, b = welds[0] if welds[0][0].owner is world else welds[0][::-1]
    mechanism.connections.remove(welds[0])
    mechanism.connect(a, Free(FREE_JOINT, actuated=False), b)


def fix_root(mechanism: Description) -> None:
    """Weld the Free joints on the world of a mechanism, in place.

    They are welded at their positions in `guess`, zero by default.
    """
    positions = {}
    for joint, forward in _free_joints(mechanism):
        names = ("x", "y", "z", "qw", "qx", "qy", "qz")
        zero = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        values = [mechanism.guess.get(f"{joint}.{k}", v) for k, v in zip(names, zero, strict=True)]
        positions[joint] = values if forward else _inverse(values)
    lock(mechanism, positions)


def _inverse(values: Sequence[float]) -> list[float]:
    """Return the inverse of a displacement (x, y, z, qw, qx, qy, qz), in the same form."""
    R = np.array(_orientation("", [Number(v) for v in values[3:]]).rows)
    p = -R.T @ np.array(values[:3])
    w, x, y, z = values[3:]
    return [*map(float, p), w, -x, -y, -z]


def _free_joints(mechanism: Description) -> list[tuple[str, bool]]:
    """Return (name, flag) of each Free joint that has a frame fixed to the world.

    The flag is True if this frame is frame_a, False if it is frame_b.
    """
    neighbours: dict[str, list[str]] = {}
    for a, b in mechanism.connections:
        if all(isinstance(p.owner, (RigidBody, Fixed)) for p in (a, b)):
            neighbours.setdefault(a.owner.name, []).append(b.owner.name)
            neighbours.setdefault(b.owner.name, []).append(a.owner.name)
    grounded, pending = {mechanism.world.name}, [mechanism.world.name]
    while pending:
        for name in neighbours.get(pending.pop(), ()):
            if name not in grounded:
                grounded.add(name)
                pending.append(name)
    found = {}
    for a, b in mechanism.connections:
        for point, other in ((a, b), (b, a)):
            if isinstance(point.owner, Free) and other.owner.name in grounded:
                found[point.owner.name] = point.port == "a"
    return list(found.items())
