"""Drive lines: rotation of every flange, and reduction to a mechanism without flanges.

Connected flanges rotate together, and rigid gears between them multiply the angle, so that a rigid
group has one coordinate. It is the coordinate of a joint in the group, or else the angle of an
inertia, which becomes a revolute link on the base. Inertias are reflected to the coordinate by the
squares of the ratios. Elastic parts become forces on coordinates. The kinetic energy of a rotor
includes only its spin relative to its housing.

Source: Spong 1987, for this assumption.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

from casadi import SX

from mbs.assembly.component_instances import FlangeTurn, as_fast, number_or_sx
from mbs.components import (
    Component,
    Coupling,
    Description,
    IdealGear,
    Joint,
    Point,
    Prismatic,
    Revolute,
)
from mbs.components.bodies import Mount
from mbs.components.component import with_points
from mbs.components.custom import Custom, Flange
from mbs.components.drives import RigidPart, ShaftForce
from mbs.components.joints import Motion
from mbs.errors import AssemblyError
from mbs.expressions import Expression, Number, Scalar, expression, to_float, to_sx

# Checks of drive lines, and their errors.


def check_flanges(mechanism: Description, parts: Sequence[Custom]) -> None:
    """Raise if flanges are unconnected, or if rotating shafts are connected to sliding parts.

    Args:
        mechanism: components and connections of shafts.
        parts: components with flanges.

    Raises:
        AssemblyError: the message has the flange and the remedy.
    """
    joined: dict[Flange, list[Flange]] = {}
    for a, b in mechanism.shafts:
        joined.setdefault(a, []).append(b)
        joined.setdefault(b, []).append(a)
    for part in parts:
        loose = [flange for flange in part.flanges if flange not in joined]
        ends = isinstance(part, RigidPart) and len(loose) < len(part.flanges)
        if loose and not ends:
            raise AssemblyError(
                f"{mechanism.name}: {loose[0]} of {type(part).__name__} {part.name!r} is connected"
                " to nothing; connect it to another flange or leave the component out"
            )
    for flange in joined:
        if _is_translational(flange):
            _check_sliding(mechanism, flange, joined)


def _is_translational(flange: Flange) -> bool | None:
    """Whether a flange translates; None if it may translate or rotate."""
    owner = flange.owner
    if isinstance(owner, Custom):
        return owner.slides(flange)
    return isinstance(owner, Joint) and owner.freedoms[0].motion is Motion.PRISMATIC


def _check_sliding(
    mechanism: Description, start: Flange, joined: dict[Flange, list[Flange]]
) -> None:
    """Raise AssemblyError if a rotating flange is connected to the sliding flange `start`.

    `joined` maps each flange to the flanges that are connected to it.
    """
    seen, queue = {start}, deque([start])
    while queue:
        for other in joined[queue.popleft()]:
            if other in seen:
                continue
            if _is_translational(other) is False:
                kind = "joint" if isinstance(start.owner, Joint) else type(start.owner).__name__
                raise AssemblyError(
                    f"{mechanism.name}: {other} turns but {kind} {start.owner.name!r} slides; put"
                    " an IdealGear or ElasticGear between them, its flange_b on what slides and its"
                    " ratio in rad for 1 m"
                )
            seen.add(other)
            queue.append(other)


def _fixed_flanges(
    mechanism: Description,
    parts: Iterable[Custom],
    ties: Mapping[Key, list[tuple[Key, Expression]]],
) -> dict[Key, FlangeTurn]:
    """Return the rotations, all zero, of the flanges that are rigidly connected to the housing.

    `ties` are as returned by `_rigid_connections`.

    Raises:
        AssemblyError: a joint is connected to the housing.
    """
    turns: dict[Key, FlangeTurn] = {}
    for part in parts:
        queue = deque([flange.key for flange in part.flanges] if part.fixed else [])
        while queue:
            key = queue.popleft()
            if key in turns:
                continue
            owner = mechanism.components[key[0]]
            if isinstance(owner, Joint):
                raise AssemblyError(
                    f"{mechanism.name}: {type(owner).__name__} {owner.name!r} is connected to the"
                    f" {type(part).__name__} {part.name!r}, so that it cannot move; put a spring, a"
                    " brake or another part with a force between them, or take one of them away"
                )
            turns[key] = FlangeTurn("", _ZERO)
            queue.extend(other for other, _ in ties.get(key, ()))
    return turns


def ring_of_gears(
    mechanism: Description, key: tuple[str, str], first: Expression, second: Expression
) -> AssemblyError:
    """Return the error for rigid gears that drive one flange with two different ratios.

    Args:
        mechanism: mechanism with the gears.
        key: key of the flange.
        first: angle of the flange per angle of the coordinate, on one path.
        second: angle of the flange per angle of the coordinate, on another path.
    """
    return AssemblyError(
        f"{mechanism.name}: rigid gears drive {key[0]!r} in two ways, with the ratios {first} and"
        f" {second}, so that nothing can turn; take one of them away or make it elastic"
    )


def inertia_missing(mechanism: Description, flanges: Sequence[Flange]) -> AssemblyError:
    """Return the error for moving flanges whose acceleration no inertia determines.

    Args:
        mechanism: mechanism with the flanges.
        flanges: one or more flanges.
    """
    names = ", ".join(str(flange) for flange in flanges)
    verb, part = (
        ("slide", "SlidingMass") if _is_translational(flanges[0]) else ("turn", "ShaftInertia")
    )
    return AssemblyError(
        f"{mechanism.name}: {names} {verb} without any inertia and without a joint, so that their"
        f" acceleration is not determined; connect a {part} to them"
    )


def same_shaft(mechanism: Description, part: ShaftForce) -> AssemblyError:
    """Return the error for an elastic part between rigidly connected flanges.

    Args:
        mechanism: mechanism with the part.
        part: elastic part.
    """
    return AssemblyError(
        f"{mechanism.name}: both flanges of {type(part).__name__} {part.name!r} are on one rigid"
        " shaft, which it cannot twist; connect one of them to another shaft"
    )


Key = tuple[str, str]
"""Key of a flange: name of its component and its port."""

_ZERO, _ONE = Number(0.0), Number(1.0)
_ROUNDING = 1e-12
"""Relative difference of two ratios that count as equal: products of ratios round by 1e-15, and no
gear ratio is specified with twelve digits."""
_GOLDEN = (5**0.5 - 1) / 2
"""Golden ratio: its multiples modulo 1 are irregular."""


@dataclass(frozen=True, slots=True, eq=False)
class DriveLine:
    """A mechanism without flanges, and the rotations of the flanges.

    Attributes:
        mechanism: mechanism with joints, couplings and forces instead of drive lines.
        turns: rotation of every flange.
        parts: parts of the drive lines, in the order of their addition.
        links: name of the part whose angle is the coordinate, for each coordinate without a joint.
    """

    mechanism: Description
    turns: Mapping[Key, FlangeTurn]
    parts: tuple[Custom, ...]
    links: Mapping[str, str]


def drive_line(mechanism: Description) -> DriveLine:
    """Return a mechanism with its drive lines replaced by joints, couplings and forces.

    Args:
        mechanism: components and connections of shafts.

    Raises:
        AssemblyError: a flange is unconnected or connected to a flange of another kind, a shaft has
            no inertia, or gears lock each other.
    """
    parts = tuple(c for c in mechanism.components.values() if isinstance(c, Custom) and c.flanges)
    if not parts and not mechanism.shafts:
        return DriveLine(mechanism, {}, (), {})
    check_flanges(mechanism, parts)
    references, turns = _flange_rotations(mechanism, parts)
    changed: dict[str, Joint] = {}
    for name, reference in references.items():
        members = [part for part in parts if turns[part.flanges[0].key].coordinate == name]
        changed[name] = _group_joint(mechanism, name, reference, members, turns)
    links = {
        n: reference.owner.name
        for n, reference in references.items()
        if not isinstance(reference.owner, Joint)
    }
    return DriveLine(_lower(mechanism, changed, turns), turns, parts, links)


def _flange_rotations(
    mechanism: Description, parts: tuple[Custom, ...]
) -> tuple[dict[str, Flange], dict[Key, FlangeTurn]]:
    """Return the reference flange of each rigid group of flanges, and the rotation of every flange.

    The first dict has the names of the coordinates as keys, the second the keys of the flanges.

    `parts` are the components of the drive line.
    """
    ties = _rigid_connections(mechanism, parts)
    values = _generic(mechanism)
    references: dict[str, Flange] = {}
    turns = _fixed_flanges(mechanism, parts, ties)
    for name, reference in _candidates(mechanism, parts):
        if reference.key in turns:
            continue
        references[name] = reference
        turns[reference.key] = FlangeTurn(name, _ONE)
        queue = deque([reference.key])
        while queue:
            key = queue.popleft()
            for other, factor in ties.get(key, ()):
                turn = FlangeTurn(name, times(factor, turns[key].factor))
                if other not in turns:
                    turns[other] = turn
                    queue.append(other)
                elif not _equal(turns[other].factor, turn.factor, values):
                    raise ring_of_gears(mechanism, other, turns[other].factor, turn.factor)
    loose = [flange for part in parts for flange in part.flanges if flange.key not in turns]
    if loose:
        raise inertia_missing(mechanism, loose)
    return references, turns


def _generic(mechanism: Description) -> dict[str, float]:
    """Return a value of every parameter: its default, or an irregular number."""
    return {
        p.name: 1 + number * _GOLDEN % 1 if p.default is None else p.default
        for number, p in enumerate(mechanism.parameters(), start=1)
    }


def _candidates(mechanism: Description, parts: tuple[Custom, ...]) -> Iterator[tuple[str, Flange]]:
    """Yield names and flanges of possible coordinates of rigid groups, the best first.

    These are flanges of joints, then of parts with inertia, then of motors.
    """
    used = {flange.owner.name for pair in mechanism.shafts for flange in pair}
    joints = [joint for joint in mechanism.joints() if joint.name in used]
    for joint in sorted(joints, key=lambda joint: joint.actuated is False):
        yield joint.name, joint.flange
    for part in parts:
        if isinstance(part, RigidPart) and part.own_inertia != _ZERO:
            yield part.name, part.flange_a
    for part in parts:
        if part.drives and part.own_inertia != _ZERO:
            yield f"{part.name}.rotor", part.flanges[0]


def _rigid_connections(
    mechanism: Description, parts: tuple[Custom, ...]
) -> dict[Key, list[tuple[Key, Expression]]]:
    """Return for each flange the rigidly connected flanges and their angle ratios.

    The dict has the keys of flanges; its values are lists of (key, ratio). `parts` are components
    of the drive line.
    """
    ties: dict[Key, list[tuple[Key, Expression]]] = {}

    def tie(a: Flange, b: Flange, ratio: Expression) -> None:
        ties.setdefault(a.key, []).append((b.key, _ONE if ratio == _ONE else 1 / ratio))
        ties.setdefault(b.key, []).append((a.key, ratio))

    for a, b in mechanism.shafts:
        tie(a, b, _ONE)
    for part in parts:
        if isinstance(part, RigidPart):
            tie(part.flange_a, part.flange_b, _ONE)
        elif isinstance(part, IdealGear):
            tie(part.flange_a, part.flange_b, expression(part.ratio))
    return ties


def times(a: Scalar, b: Scalar) -> Expression:
    """Return the product of two factors; exact ones are left out and an exact zero gives zero.

    Args:
        a: number, parameter or expression.
        b: number, parameter or expression.
    """
    x, y = expression(a), expression(b)
    if _ZERO in (x, y):
        return _ZERO
    return y if x == _ONE else x if y == _ONE else x * y


def _plus(a: Expression, b: Expression) -> Expression:
    """Return a + b; the other term alone if one is exactly zero."""
    return b if a == _ZERO else a if b == _ZERO else a + b


def _equal(a: Expression, b: Expression, values: Mapping[str, float]) -> bool:
    """Whether two gear ratios a and b are equal at the parameter `values`, up to rounding.

    Expressions without value are compared as such.
    """
    x, y = to_float(a, values), to_float(b, values)
    if x is None or y is None:
        return a == b
    return abs(x - y) <= _ROUNDING * abs(x)


def _group_joint(
    mechanism: Description,
    name: str,
    reference: Flange,
    parts: Iterable[Custom],
    turns: Mapping[Key, FlangeTurn],
) -> Joint:
    """Return the joint of a rigid group of flanges, with the inertias and motors of the group.

    `name` is the name of its coordinate, `reference` the flange with this angle, `parts` are the
    components of the group and `turns` the rotations of all flanges.
    """
    devices = [part for part in parts if part.drives]
    total: Expression = _ZERO
    for part in parts:
        factor = turns[part.flanges[0].key].factor
        total = _plus(total, times(times(factor, factor), part.own_inertia))
    if not isinstance(reference.owner, Joint):
        kind = Prismatic if _is_translational(reference) else Revolute
        return kind(name, axis="z", actuated=bool(devices), Ia=total)
    joint = reference.owner
    if devices and joint.actuated is False:
        raise AssemblyError(
            f"{mechanism.name}: joint {name!r} is said to be actuated=False, but"
            f" {type(devices[0]).__name__} {devices[0].name!r} drives it; leave actuated out"
        )
    inertia = _plus(expression(joint.Ia), total)
    return replace(joint, actuated=joint.actuated or bool(devices), Ia=inertia)


def _lower(
    mechanism: Description, changed: Mapping[str, Joint], turns: Mapping[Key, FlangeTurn]
) -> Description:
    """Return the mechanism with the `changed` joints, couplings to further joints, and forces.

    `turns` are the rotations of all flanges.
    """
    result = _with_joints(mechanism, changed)
    joints = {joint.name: joint for joint in mechanism.joints()}
    for joint in joints.values():
        turn = turns.get((joint.name, ""))
        if turn is not None and turn.coordinate != joint.name:
            name = f"{turn.coordinate}-{joint.name}"
            row = (_ZERO, turn.factor)
            result.add(Coupling(name, joint.name, turn.coordinate, row))
    for force in mechanism.components.values():
        if isinstance(force, ShaftForce):
            result.components[force.name] = replace(
                force, levers=_moment_arms(mechanism, force, turns)
            )
    for name, joint in changed.items():
        if name not in joints:
            result.components.pop(name, None)
            shaft = result.add(Mount(f"{name}.shaft"))
            result.connect(result.world, joint, shaft)
    return result


def _with_joints(mechanism: Description, joints: Mapping[str, Joint]) -> Description:
    """Return a copy of the mechanism in which joints are replaced by those of the same name."""

    def point(old: Point) -> Point:
        is_joint = isinstance(old.owner, Joint)
        return replace(old, owner=joints.get(old.owner.name, old.owner)) if is_joint else old

    def component(old: Component) -> Component:
        if isinstance(old, Joint):
            return joints.get(old.name, old)
        return with_points(old, point)

    result = copy(mechanism)
    result.components = {name: component(c) for name, c in mechanism.components.items()}
    result.connections = [(point(a), point(b)) for a, b in mechanism.connections]
    result.frames = {name: point(p) for name, p in mechanism.frames.items()}
    result.shapes = [(point(p), shape) for p, shape in mechanism.shapes]
    return result


def _moment_arms(
    mechanism: Description, part: ShaftForce, turns: Mapping[Key, FlangeTurn]
) -> tuple[tuple[str, Expression], ...]:
    """Return the moment arms of a force between shafts, as pairs of coordinate and factor.

    Raises AssemblyError if both of its flanges are on one rigid shaft.

    `part` is the force and `turns` the rotation of each flange, by its key.
    """
    levers = []
    for flange, share in part.shares:
        turn = turns[flange.key]
        levers.append((turn.coordinate, times(share, turn.factor)))
    moving = tuple(lever for lever in levers if lever[0])
    if len({coordinate for coordinate, _ in levers}) < len(levers) or not moving:
        raise same_shaft(mechanism, part)
    return moving


# Tables of drive lines: coordinate of every rigid part, and motors.


@dataclass(frozen=True, slots=True)
class ShaftRow:
    """An inertia or a rigid gear of a drive line, and the coordinate that it rotates with.

    Attributes:
        name: name of the component.
        kind: ShaftInertia, SlidingMass, IdealGear, or DCMotor if its rotor has its own coordinate.
        coordinate: name of the coordinate that it rotates with.
        own: Whether the coordinate is its own, and not that of a joint or another inertia.
        factor: its angle (of a gear: the angle of flange_a) divided by the coordinate; a number, or
            an expression if it contains a symbol.
        slides: Whether it is a sliding mass.
    """

    name: str
    kind: str
    coordinate: str
    own: bool
    factor: float | SX
    slides: bool = False

    @property
    def sentence(self) -> str:
        """Description in a report: kind, name and rotation relative to the coordinate."""
        if self.own:
            return f"{self.kind} {self.name} has a coordinate of its own, {self.coordinate}."
        turns = f"turns {as_fast(self.factor, self.coordinate)}"
        if self.kind == IdealGear.__name__:
            return f"{self.kind} {self.name} is rigid: its flange_a {turns}."
        if self.slides:
            return (
                f"{self.kind} {self.name} slides{turns.removeprefix('turns')}, which has its mass."
            )
        return f"{self.kind} {self.name} {turns}, which has its inertia."


def shaft_rows(line: DriveLine, symbols: Mapping[str, SX]) -> tuple[ShaftRow, ...]:
    """Return a row for every inertia, rigid gear, and motor whose rotor has an own coordinate.

    Args:
        line: mechanism after its drive lines were replaced.
        symbols: CasADi symbol of every parameter.
    """
    rows = []
    for part in line.parts:
        turn = line.turns[part.flanges[0].key]
        own = line.links.get(turn.coordinate) == part.name
        if own or isinstance(part, (RigidPart, IdealGear)):
            factor = number_or_sx(to_sx(turn.factor, symbols))
            slides = _is_translational(part.flanges[0]) is True
            kind = type(part).__name__
            rows.append(ShaftRow(part.name, kind, turn.coordinate, own, factor, slides))
    return tuple(rows)
