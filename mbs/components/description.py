"""Description under construction: components and their connections."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, TypeVar, overload

from mbs.arguments import values_given
from mbs.components.bodies import (
    Mount,
    Mounting,
    RigidBody,
    World,
    mount_of,
    notes_on_degrees,
    three,
)
from mbs.components.component import (
    Component,
    Placement,
    Point,
    check_arguments,
    in_rotated_axes,
)
from mbs.components.couplings import Coupling
from mbs.components.custom import Custom, Flange, Signal
from mbs.components.drives import flange_pair
from mbs.components.forces import Force
from mbs.components.joints import Joint
from mbs.components.motion_joint import MotionJoint
from mbs.components.notes import ImportNote
from mbs.components.sensors import Sensor
from mbs.components.shapes import Shape
from mbs.deprecation import RenamedAttribute
from mbs.errors import AssemblyError, DescriptionError
from mbs.expressions import Parameter, Scalar, expression, parameters_of
from mbs.text import did_you_mean, quoted

# Nested mechanisms and handles to them.


@dataclass(frozen=True, slots=True)
class SubMechanism:
    """Handle to a nested mechanism: `arm["forearm"]` is its component, `arm.base` its ground."""

    outer: Description
    scope: str

    def __getitem__(self, name: str) -> Component:
        full = f"{self.scope}.{name}"
        if full not in self.outer.components:
            inside = sorted(n for n in self.outer.components if n.startswith(f"{self.scope}."))
            raise DescriptionError(f"{full!r} does not exist; the components are {inside}")
        return self.outer.components[full]

    def body(self, name: str) -> RigidBody:
        """Return the body `name` of the nested mechanism.

        Raise DescriptionError if it is no body.
        """
        component = self[name]
        if not isinstance(component, RigidBody):
            raise DescriptionError(
                f"{component.name} is a {type(component).__name__}, not a body; name a body"
            )
        return component

    def point(self, name: str) -> Point:
        """Return the named frame `name` of the nested mechanism, as a point.

        Raise DescriptionError if it does not exist.
        """
        full = f"{self.scope}.{name}"
        if full not in self.outer.frames:
            inside = sorted(n for n in self.outer.frames if n.startswith(f"{self.scope}."))
            raise DescriptionError(f"{full!r} is not a frame; the frames are {inside}")
        return self.outer.frames[full]

    @property
    def base(self) -> RigidBody:
        """Ground of the nested mechanism: massless body to be connected to the outer mechanism."""
        return self.body("world")


OUTER_WORLD = "outer_world"
"""Name of the frame in which gravity and the mount of the base are given."""
_SCOPE = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*", re.ASCII)


def place(outer: Description, inner: Description, name: str) -> SubMechanism:
    """Copy the components of a mechanism into another mechanism, with prefixed names.

    Args:
        outer: mechanism that gets the components, in place.
        inner: mechanism to copy.
        name: prefix of the names: body "b" becomes "name.b".

    Returns:
        handle to the copied components.

    Raises:
        DescriptionError: the name is taken, or is no valid prefix of the names of parameters.
    """
    scope = Component(name).name
    if inner is outer:
        raise DescriptionError(
            f"{outer.name}: a mechanism cannot be added to itself; add it to another one"
        )
    if any(inner.used_parameters()) and not _SCOPE.fullmatch(scope):
        raise DescriptionError(
            f"{outer.name}: {scope!r} cannot stand before the names of parameters; write"
            " add(mechanism, name=...) with letters, digits and underscores"
        )
    if any(taken == scope or taken.startswith(f"{scope}.") for taken in outer.components):
        raise DescriptionError(f"{outer.name}: two components are named {scope!r}; rename one")
    placed: dict[str, Component] = {}
    for component in inner.components.values():
        if component is inner.world:
            placed[component.name] = outer.add(Mount(f"{scope}.{component.name}"))
        else:
            placed[component.name] = outer.add(component.scoped(scope))
    outer.connections.extend(
        (on_placed(a, placed, scope), on_placed(b, placed, scope)) for a, b in inner.connections
    )
    outer.shafts.extend(
        (replace(a, owner=placed[a.owner.name]), replace(b, owner=placed[b.owner.name]))
        for a, b in inner.shafts
    )
    outer.wires.extend(
        (f"{scope}.{source}", replace(target, owner=placed[target.owner.name]))
        for source, target in inner.wires
    )
    for frame, point in _frames_of(inner).items():
        outer.frames[f"{scope}.{frame}"] = on_placed(point, placed, scope)
    outer.shapes.extend((on_placed(point, placed, scope), shape) for point, shape in inner.shapes)
    outer.cuts.extend(f"{scope}.{joint}" for joint in inner.cuts)
    outer.guess.update({f"{scope}.{name}": value for name, value in inner.guess.items()})
    used = {parameter.name for parameter in outer.used_parameters()}
    for symbol, value in inner.given_values().items():
        if (scoped := f"{scope}.{symbol}") in used:  # drop symbols of its gravity only
            outer.values[scoped] = replace(value, name=scoped)
    return SubMechanism(outer, scope)


def _frames_of(inner: Description) -> dict[str, Point]:
    """Return the named frames of a mechanism, with "outer_world" if its base is mounted.

    Raise DescriptionError if a frame has this name already.
    """
    if not inner.mount.steps:
        return inner.frames
    if OUTER_WORLD in inner.frames:
        raise DescriptionError(
            f"{inner.name}: the frame {OUTER_WORLD!r} has the name of the frame in which the mount"
            " is given; rename it"
        )
    return {**inner.frames, OUTER_WORLD: Point(inner.world, placement=inner.mount.inverse())}


def on_placed(point: Point, placed: Mapping[str, Component], scope: str) -> Point:
    """Return the copy of a point of a nested mechanism.

    Args:
        point: point of the original.
        placed: copies of the components, by original name; the owner of the point is replaced.
        scope: prefix of the parameters of its placement.
    """
    owner = placed[point.owner.name]
    return replace(point, owner=owner, placement=point.placement.scoped(scope))


C = TypeVar("C", bound=Component)


_ATTRIBUTES: Mapping[str, type] = MappingProxyType(
    {
        **dict.fromkeys(("name", "source"), str),
        **dict.fromkeys(("guess", "numbered", "components", "frames", "values"), dict),
        **dict.fromkeys(("cuts", "notes", "connections", "shafts", "wires", "shapes"), list),
        **{"world": World, "keep_order": bool, "_ports": set, "_counted": int},
        "mount": Placement,
    }
)
"""Attributes of a mechanism and their types."""
_NO_UNIT = "1"
"""Unit of a parameter whose unit is not given."""
_COMPENSATIONS = "_gravcomp", "_gravity"
"""Ends of the names of forces by which readers of files compensate the weight of bodies."""


class Description:
    """Components and connections of a mechanism under construction.

    `mbs.Mechanism` adds the assembly. Its docstring describes arguments and attributes.
    """

    has_fixed_attributes: ClassVar[bool] = True
    """Set in the body of each class to which users cannot add attributes by assignment."""

    def __init__(
        self,
        name: str,
        gravity: tuple[Scalar, ...] = (0.0, 0.0, -9.81),  # standard gravity [m/s^2]
        parameters: Mapping[str, float] | None = None,
        source: str = "",
        keep_order: bool = False,
        guess: Mapping[str, float] | None = None,
        mount: Mounting | None = None,
    ) -> None:
        self.name = Component(name).name
        self.source = source
        self.keep_order = keep_order
        self.cuts: list[str] = []
        self.guess = values_given(f"{self.name}: guess", guess, '"j1": 0.3', DescriptionError)
        self.notes: list[ImportNote] = []
        self.numbered: dict[int, str] = {}
        self.world = World(gravity=gravity)
        self.components: dict[str, Component] = {self.world.name: self.world}
        self.connections: list[tuple[Point, Point]] = []
        self._ports: set[tuple[str, str]] = set()  # ports in the first `_counted` connections
        self._counted = 0
        self.shafts: list[tuple[Flange, Flange]] = []
        self.wires: list[tuple[str, Signal]] = []
        self.frames: dict[str, Point] = {}
        self.shapes: list[tuple[Point, Shape]] = []
        self.values: dict[str, Parameter | float] = {}
        self.mount = Placement()
        given = values_given(f"{self.name}: parameters", parameters, '"L1": 0.3', DescriptionError)
        for symbol, value in given.items():
            self.values[symbol] = Parameter(symbol, value)
        if mount is not None:
            self.change_gravity(mount=mount)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute. A class that derives from Description may have attributes of its own.

        Raises:
            DescriptionError: the attribute does not exist, or the value has the wrong type.
        """
        is_fixed = vars(type(self)).get("has_fixed_attributes", False)
        if is_fixed and name not in _ATTRIBUTES and not hasattr(type(self), name):
            raise DescriptionError(
                f"{self.__dict__.get('name', 'mechanism')}: a mechanism has no attribute {name!r};"
                f" {did_you_mean(name, sorted(one for one in _ATTRIBUTES if one[0] != '_'))}"
            )
        if name == "gravity":
            raise DescriptionError(
                f"{self.name}: gravity cannot be set; give gravity= to Mechanism or mbs.load, or"
                " call change_gravity"
            )
        kind = _ATTRIBUTES.get(name, object)
        if not isinstance(value, kind):
            raise DescriptionError(
                f"{self.__dict__.get('name', 'mechanism')}: {name} is {quoted(value)}; give a"
                f" {kind.__name__}"
            )
        super().__setattr__(name, value)

    @property
    def gravity(self) -> tuple[Scalar, ...]:
        """Gravity acceleration in the axes of the world of this mechanism [m/s^2]."""
        return self.world.gravity

    def change_gravity(
        self, gravity: Sequence[Scalar] | None = None, mount: Mounting | None = None
    ) -> None:
        """Change the gravity acceleration, or mount the base in it.

        Args:
            gravity: gravity acceleration in the axes of the outer world [m/s^2]; unchanged if left
                out. A new gravity discards an earlier mount.
            mount: rotation of the base relative to the axes of the outer world, or a dict with its
                "position" and "rotation". No change if left out.

        Raises:
            DescriptionError: an argument is no vector or no mount, or forces that were read from a
                file compensate its gravity.
        """
        where = f"{self.name}, gravity"
        for component in self.components.values():
            if isinstance(component, Force) and component.name.endswith(_COMPENSATIONS):
                raise DescriptionError(
                    f"{where}: the force {component.name!r} compensates the gravity of the file;"
                    " change the gravity in the file"
                )
        vector = self.world.gravity if gravity is None else three(gravity, where)
        placed = self.mount if gravity is None else Placement()
        if mount is not None:
            place = f"{self.name}, mount"
            steps, rotation = mount_of(mount, place)
            placed = placed.then(*steps)
            if rotation is not None:
                vector = in_rotated_axes(tuple(map(expression, vector)), rotation, place)
            self.notes.extend(notes_on_degrees(steps))
        object.__setattr__(self.world, "gravity", tuple(vector))
        self.mount = placed

    @overload
    def add(self, component: C) -> C: ...

    @overload
    def add(self, component: Description, name: str | None = None) -> SubMechanism: ...

    def add(self, component: C | Description, name: str | None = None) -> C | SubMechanism:
        """Add a body, a joint, another component or a whole mechanism.

        The names of a nested mechanism are prefixed by its own name. It moves in the gravity of the
        outer mechanism, and its base is at the connected position. If it has a mount, it gets the
        frame "outer_world": `connect(outer.world, placed.point("outer_world"))` puts the base at
        its mount.

        Args:
            component: component or mechanism to add.
            name: name of a nested mechanism in this one. The default is its own name.

        Returns:
            The component, or a handle to the copied components of a mechanism.

        Raises:
            DescriptionError: the name is taken.
        """
        if isinstance(component, Description):
            return place(self, component, name or component.name)
        if not isinstance(component, Component):
            raise DescriptionError(
                f"{self.name}: {quoted(component)} is no component; add a body, a joint, a coupling"
                " or a mechanism"
            )
        self._require_use(component)
        if component.name in self.frames:
            raise DescriptionError(
                f"{self.name}: {component.name!r} is the name of a frame already; rename the"
                f" {type(component).__name__}"
            )
        taken = self.components.get(component.name)
        if taken is not None:
            raise DescriptionError(
                f"{self.name}: two components are named {component.name!r}"
                f" ({type(taken).__name__} and {type(component).__name__}); rename one"
            )
        self.components[component.name] = component
        return component

    def connect(
        self,
        a: Point | RigidBody | Flange,
        joint_or_point: Joint | MotionJoint | Point | RigidBody | Flange,
        b: Point | RigidBody | None = None,
    ) -> None:
        """Put a joint between two points, weld two points together, or connect two flanges.

        `connect(a, joint, b)` puts the joint's frame_a on a and its frame_b on b; `connect(a, b)`
        makes the two frames coincide. A frame of a joint is a point as well. Connected flanges
        rotate together. Joints and parts of drive lines are added automatically.

        Args:
            a: point, body (its reference frame) or flange.
            joint_or_point: joint between two points, or second point or flange.
            b: second point, if a joint is given.

        Raises:
            DescriptionError: a component is not in the mechanism, or the joint is connected
                already.
        """
        if isinstance(a, Flange) or isinstance(joint_or_point, Flange):
            self._join(flange_pair(self.name, a, joint_or_point, b))
            return
        if isinstance(joint_or_point, MotionJoint):
            if b is None:
                raise DescriptionError(
                    f"{self.name}: joint {joint_or_point.name!r} has nothing on its other side;"
                    " write connect(point, joint, point)"
                )
            placed, free = joint_or_point.between(self._point(a), self._point(b))
            self.add(placed)
            self.connect(a, free, b)
            return
        if isinstance(joint_or_point, Joint):
            if b is None:
                raise DescriptionError(
                    f"{self.name}: joint {joint_or_point.name!r} has nothing on its other side;"
                    " write connect(point, joint, point)"
                )
            before, after = self._point(a), self._point(b)
            if self.components.get(joint_or_point.name) is not joint_or_point:
                self.add(joint_or_point)
                for companion in joint_or_point.companions:
                    self.add(companion)
            self._weld(before, joint_or_point.frame_a)
            self._weld(joint_or_point.frame_b, after)
            return
        if b is not None:
            raise DescriptionError(
                f"{self.name}: {_display_text(joint_or_point)} stands where a joint belongs;"
                " write connect(point, joint, point)"
            )
        self._weld(self._point(a), self._point(joint_or_point))

    wire = RenamedAttribute("connect_signal")

    def connect_signal(self, source: Signal | str, target: Signal | str) -> None:
        """Connect an input of a component to an output, a state or a sensor reading.

        Components that are not in the mechanism yet are added.

        Args:
            source: output such as `controller.u`, or the name of a state or a sensor reading in
                results, such as "motor.i" or "encoder.q".
            target: input such as `motor.voltage`, or its name, such as "arm.motor.voltage" for a
                nested mechanism.

        Raises:
            DescriptionError: the source is no output, the target is no input, or a name is taken.
        """
        is_output = isinstance(source, Signal) and source.kind == "output"
        if not (isinstance(source, str) or is_output):
            raise DescriptionError(
                f"{self.name}: a wire comes from {_display_text(source)},"
                " which is no output; give an output of a component, or the name of a reading such"
                " as 'encoder.q'"
            )
        if isinstance(target, str):
            inputs = {
                f"{component.name}.{name}": Signal(component, name, "input")
                for component in self.components.values()
                if isinstance(component, Custom)
                for name in component.input_names
            }
            if target not in inputs:
                raise DescriptionError(
                    f"{self.name}: a wire leads to {quoted(target)}, which is no input;"
                    f" {did_you_mean(target, inputs) if inputs else 'no component here has one'}"
                )
            target = inputs[target]
        if not isinstance(target, Signal) or target.kind != "input":
            raise DescriptionError(
                f"{self.name}: a wire leads to {_display_text(target)},"
                " which is no input; give an input of a component, such as motor.voltage"
            )
        for signal in (source, target):
            owner = signal.owner if isinstance(signal, Signal) else None
            if owner is not None and self.components.get(owner.name) is not owner:
                self.add(owner)
        self.wires.append((str(source), target))

    def add_frame(self, name: str, point: Point | RigidBody) -> Point:
        """Give a point, such as a tool centre point, a name that models accept. Return the point.

        Args:
            name: name of the frame, unique in the mechanism.
            point: point, or body for its reference frame.

        Raises:
            DescriptionError: the name is taken, or the point is on no component of the mechanism.
        """
        if name in self.frames or name in self.components or name == "base":
            raise DescriptionError(
                f"{self.name}: the frame name {name!r} is taken; choose another name"
            )
        self.frames[Component(name).name] = self._point(point)
        return self.frames[name]

    def add_shape(self, point: Point | RigidBody, shape: Shape) -> None:
        """Add a shape that pictures show on a body. It has no effect on the equations.

        Args:
            point: centre of the shape, or the frame of its mesh.
            shape: shape to show.

        Raises:
            DescriptionError: `shape` is no Shape, or the point is on no component of the mechanism.
        """
        if not isinstance(shape, Shape):
            raise DescriptionError(f"{self.name}: {_display_text(shape)} is no shape; give a Shape")
        self.shapes.append((self._point(point), shape))

    def cut(self, joint: Joint) -> None:
        """Cut a loop at this joint, instead of at the joint that is chosen automatically.

        Args:
            joint: connected joint of a loop.

        Raises:
            DescriptionError: the argument is no joint, or the joint is not connected.
        """
        if not isinstance(joint, Joint):
            raise DescriptionError(
                f"{self.name}: {_display_text(joint)} is not a joint; give the joint itself, not"
                " its name"
            )
        if self.components.get(joint.name) is not joint:
            raise DescriptionError(
                f"{self.name}: joint {joint.name!r} is not connected; connect it before the cut"
            )
        self.cuts.append(joint.name)

    def _require_use(self, component: Component) -> None:
        """Raise DescriptionError if a component has no known type or results in no equation."""
        if isinstance(component, MotionJoint) and component.frame_a is None:
            raise DescriptionError(
                f"{self.name}: {type(component).__name__} {component.name!r} is added, but a joint"
                " is connected; write connect(point, joint, point)"
            )
        if isinstance(component, Custom):
            component.require_made()
            if component.lowered or component.has_equations:
                return
            remedy = (
                "write one of its methods loads, energy, rates, rows, velocity_rows, frictions,"
                " stops or outputs"
            )
        elif isinstance(component, Joint) and not (component.places or component.closes):
            remedy = "write its method closing_rows"
        elif isinstance(component, Sensor) and not component.reads:
            remedy = "derive it from Custom, whose outputs are what it reads"
        elif isinstance(component, (RigidBody, Joint, Coupling, Sensor)):
            return
        else:
            remedy = "derive it from Custom, and write what it does"
        raise DescriptionError(
            f"{self.name}: {type(component).__name__} {component.name!r} says nothing that"
            f" equations could use; {remedy}"
        )

    def __repr__(self) -> str:
        bodies, joints = len(list(self.bodies())), len(list(self.joints()))
        return f"<Description {self.name}: {bodies} bodies, {joints} joints>"

    def joints(self) -> Iterator[Joint]:
        """Return an iterator of all joints, in the order of addition."""
        return (c for c in self.components.values() if isinstance(c, Joint))

    def bodies(self) -> Iterator[RigidBody]:
        """Return an iterator of all bodies except the world, in the order of addition."""
        return (
            c for c in self.components.values() if isinstance(c, RigidBody) and c is not self.world
        )

    def couplings(self) -> Iterator[Coupling]:
        """Return an iterator of all couplings of joint coordinates, in the order of addition."""
        return (c for c in self.components.values() if isinstance(c, Coupling))

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the symbols that the components use, with values, in order of first use.

        Raises:
            AssemblyError: a value is given for a symbol that no component uses, or a symbol has two
                different values.
        """
        found: dict[str, Parameter] = {}
        for parameter in self.used_parameters():
            known = found.get(parameter.name)
            found[parameter.name] = parameter if known is None else self._merge(known, parameter)
        for name, value in self.given_values().items():
            if name not in found:
                known_names = ", ".join(found) or "none"
                raise AssemblyError(
                    f"{self.name}: parameter {name!r} is used by no component; the parameters are:"
                    f" {known_names}"
                )
            one = found[name]
            found[name] = Parameter(
                name,
                value.default,
                unit=one.unit if value.unit == _NO_UNIT else value.unit,
                description=value.description or one.description,
                min=one.min if value.min is None else value.min,
                max=one.max if value.max is None else value.max,
            )
        return tuple(found.values())

    def given_values(self) -> dict[str, Parameter]:
        """Return the values set in this mechanism by symbol, with units, descriptions and bounds.

        Raises:
            DescriptionError: an entry of `values` is no number, or a Parameter of another name.
        """
        found = {}
        for name, value in self.values.items():
            given = value if isinstance(value, Parameter) else Parameter(name, value)
            if given.name != name:
                raise DescriptionError(
                    f"{self.name}: values[{name!r}] is the parameter {given.name!r}; give it the"
                    " name of the symbol"
                )
            found[name] = given
        return found

    def _merge(self, known: Parameter, other: Parameter) -> Parameter:
        """Return one Parameter for two uses of a symbol, `known` and `other`.

        Raise AssemblyError if their values or bounds differ.
        """
        for what in ("default", "min", "max"):
            one, two = getattr(known, what), getattr(other, what)
            if None not in (one, two) and one != two:
                noun = {"default": "values", "min": "least values", "max": "greatest values"}[what]
                raise AssemblyError(
                    f"{self.name}: parameter {known.name} has the {noun} {one:g} and {two:g}; give"
                    " it one"
                )
        first, second = (other, known) if known.default is None else (known, other)
        low, high = (
            getattr(second, bound) if getattr(first, bound) is None else getattr(first, bound)
            for bound in ("min", "max")
        )
        unit = second.unit if first.unit == "1" else first.unit
        return replace(first, unit=unit, min=low, max=high)

    def used_parameters(self) -> Iterator[Parameter]:
        """Yield the symbols of components and placements, repeatedly if used repeatedly."""
        for component in self.components.values():
            for value in component.expressions():
                yield from parameters_of(value)
        points = [point for pair in self.connections for point in pair]
        points += [point for point, _ in self.shapes]
        placements = [point.placement for point in (*points, *self.frames.values())]
        for placement in (*placements, self.mount):
            for value in placement.expressions():
                yield from parameters_of(value)

    def _point(self, point: Point | RigidBody) -> Point:
        """Return a point, or the reference frame of a body, of the mechanism.

        Raise DescriptionError for other values, or if its owner was not added.
        """
        if isinstance(point, RigidBody):
            point = point.frame
        if not isinstance(point, Point):
            raise DescriptionError(
                f"{self.name}: {_display_text(point)} is not a point;"
                " give a body, body.at(...) or joint.frame_a"
            )
        if self.components.get(point.owner.name) is not point.owner:
            raise DescriptionError(
                f"{self.name}: {point.owner.name!r} is connected but is not part of the mechanism;"
                f" call add({point.owner.name}) first"
            )
        return point

    def _weld(self, a: Point, b: Point) -> None:
        """Make two frames coincide.

        Raise DescriptionError if a joint frame is connected already.
        """
        for point in (a, b):
            if isinstance(point.owner, Joint) and self._is_connected(point):
                raise DescriptionError(
                    f"{self.name}: frame_{point.port} of joint {point.owner.name!r} is connected"
                    " twice; use one joint for each connection"
                )
        self.connections.append((a, b))

    def _join(self, flanges: tuple[Flange, Flange]) -> None:
        """Connect two flanges, and add the components that have them."""
        for flange in flanges:
            if self.components.get(flange.owner.name) is not flange.owner:
                self.add(flange.owner)
        self.shafts.append(flanges)

    def _is_connected(self, point: Point) -> bool:
        """Return whether `point`, a frame of a joint, is connected.

        New connections are registered first.
        """
        if self._counted > len(self.connections):
            self._ports.clear()
            self._counted = 0
        for pair in self.connections[self._counted :]:
            self._ports.update((p.owner.name, p.port) for p in pair)
        self._counted = len(self.connections)
        return (point.owner.name, point.port) in self._ports


check_arguments(Description)


def _display_text(value: object) -> str:
    """Return the text of a value for messages: a component or signal by its name, else quoted."""
    if isinstance(value, Component):
        return f"{type(value).__name__} {value.name!r}"
    if isinstance(value, Signal):
        return f"the {value.kind} {value}"
    return quoted(value)
