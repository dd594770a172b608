"""The assembled mechanism: immutable, with tables from which all models are built."""

from __future__ import annotations

import io
import math
import pickle
import sys
import threading
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from types import FunctionType
from typing import TYPE_CHECKING, Any

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly.degrees import like_degrees
from mbs.assembly.drive_line import ShaftRow
from mbs.assembly.inertias import inertia_notes
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.parameter_bounds import BoundedField, Bounds
from mbs.assembly.parts import AttachedPart, Quantity
from mbs.assembly.tables import (
    AttachedSensor,
    Balance,
    BodyRow,
    Closure,
    Coordinate,
    CoordinateCoupling,
    JointRow,
    LinkRow,
    LoopRow,
    ShapeRow,
    link_rows,
)
from mbs.assembly.tree import Tree, position_rate
from mbs.assembly.variable_names import EFFORTS, GUESSES, VELOCITIES, by_coordinate
from mbs.components import Component
from mbs.components.bodies import RigidBody
from mbs.errors import MbsError, ModelError
from mbs.expressions import Parameter, out_of_bounds
from mbs.files import PathLike
from mbs.numbers import is_vector, numbers_given
from mbs.spatial import Pose
from mbs.text import did_you_mean, listed, quoted, without_values

if TYPE_CHECKING:
    from mbs.view.diagram import Diagram


# Pickles of objects with SX: all expressions are stored as one serialized Function.


Packed = tuple[bytes, tuple[str, ...], str]
"""Pickle bytes, names of symbols, and the serialized Function of all expressions."""


def packed(state: Any) -> Packed:
    """Return a serializable form of an object made of plain data, Functions and SX.

    Args:
        state: object to pack, with any number of SX.
    """
    return _pack(state)[0]


def unpacked(data: bytes, names: Sequence[str], graphs: str) -> Any:
    """Return the object packed by `packed`; its symbols are new, with their old names."""
    found = Function.deserialize(graphs).call([SX.sym(name) for name in names])
    return _Unpickler(io.BytesIO(data), found).load()


def content_of(state: Any) -> Packed | None:
    """Return a key of an object across processes, equal for equal content.

    None if the object contains user-defined classes or functions: a pickle has only their names,
    while their code may change. None also if it cannot be pickled or contains machine code without
    source.
    """
    try:
        found, names_alone = _pack(state)
        return None if names_alone else found
    except (AttributeError, NotImplementedError, RuntimeError, TypeError, pickle.PicklingError):
        return None


def _pack(state: Any) -> tuple[Packed, bool]:
    """Return a packed object, and whether it refers to user-defined code by name."""
    buffer = io.BytesIO()
    pickler = _Pickler(buffer)
    pickler.dump(state)
    graphs = pickler.graphs
    # at least one symbol: without symbols, numbers would be returned as DM
    symbols = casadi.symvar(casadi.veccat(SX.sym("any"), *graphs))
    names = tuple(symbol.name() for symbol in symbols)
    text = Function("graphs", symbols, graphs).serialize()
    return (buffer.getvalue(), names, text), pickler.names_alone


_KNOWN = frozenset({"mbs", "casadi", "numpy", *sys.stdlib_module_names})
"""Packages whose classes have the same meaning in every process with the same version."""


class _Pickler(pickle.Pickler):
    def __init__(self, buffer: io.BytesIO) -> None:
        super().__init__(buffer, protocol=pickle.HIGHEST_PROTOCOL)
        self.graphs: list[SX] = []
        self.names_alone = False

    def persistent_id(self, obj: Any) -> int | None:
        if not isinstance(obj, SX):
            return None
        self.graphs.append(obj)
        return len(self.graphs) - 1

    def reducer_override(self, obj: Any) -> Any:
        if isinstance(obj, (type, FunctionType)) and obj.__module__.split(".")[0] not in _KNOWN:
            self.names_alone = True
        if isinstance(obj, Function):  # a user-defined Callback is pickled by its name
            parts = (obj, *obj.find_functions())
            self.names_alone |= any(part.class_name() == "CallbackInternal" for part in parts)
        return NotImplemented


class _Unpickler(pickle.Unpickler):
    def __init__(self, buffer: io.BytesIO, graphs: list[SX]) -> None:
        super().__init__(buffer)
        self._graphs = graphs

    def persistent_load(self, pid: Any) -> Any:
        return self._graphs[pid]


# Report of the assembled system.


def report(system: System) -> str:
    """Return the report: tree, cut joints, mobility, dropped rows, parameters, components."""
    every = [*_tree(system), *_loops(system), *_parameters(system), *_acting(system)]
    return "\n".join([*every, *_degrees(system)])


def _degrees(system: System) -> list[str]:
    """Return a note on guesses that look like degrees. An open system is assembled at its guess."""
    names = [coordinate.name for coordinate in system.coordinates]
    given = dict(zip(names, system.configuration, strict=True))
    if system.closure is not None:
        given = dict(system.closure.guess)
    note = like_degrees([*system.coordinates, *system.cut_coordinates], given)
    return [f"Note: {note}."] if note else []


def _tree(system: System) -> list[str]:
    links = system.tree.links
    without = {
        row.coordinate: f"a {'slide' if row.slides else 'shaft'} of a drive line"
        for row in system.shafts
        if row.own
    }
    lines = [
        f"{system.name}: {_count(len(links), 'moving link')} in a tree,"
        f" {_count(system.nq, 'position')} q and {_count(system.nv, 'velocity')} v."
    ]
    for number, link in enumerate(links, start=1):
        bodies = [row.name for row in system.bodies if row.link == number]
        before = "the base" if link.antecedent < 0 else f"link {link.antecedent + 1}"
        what = ", ".join(bodies) if bodies else without.get(link.name, "a frame without a body")
        lines.append(
            f"  link {number}: {link.motion.value} {link.name} from {before} carries {what}"
        )
    return lines


def followed(joints: Sequence[str]) -> str:
    """Return the text of a coupling, such as "j2 follows j1"."""
    driven, *others = joints
    return f"{driven} follows {' and '.join(others)}"


def _loops(system: System) -> list[str]:
    if system.closure is None:
        return ["No loop: every coordinate is independent."]
    closure = system.closure
    parts = {part.name: type(part.element).__name__ for part in system.parts}
    lines = []
    for loop in system.loops:
        if loop.closing == "coupling":
            lines.append(f"Coupling {loop.name}: {followed(loop.joints)}.")
            continue
        kept = len(loop.rows) - len(loop.dropped)
        if loop.name in parts:
            lines.append(
                f"{parts[loop.name]} {loop.name} binds {listed(loop.joints)}: {kept} of"
                f" {_count(len(loop.rows), 'row')} {'is' if kept == 1 else 'are'} independent."
            )
            continue
        if loop.closing in ("balance", "damped balance"):
            what = "the velocities of " if loop.closing == "damped balance" else ""
            lines.append(
                f"The balance of forces gives {what}{listed(loop.joints)}, which move no mass:"
                f" {kept} of"
                f" {_count(len(loop.rows), 'row')} {'is' if kept == 1 else 'are'} independent."
            )
            continue
        lines.append(
            f"1 loop cut at {loop.name} ({loop.closing}), through {', '.join(loop.joints)}:"
            f" {kept} of {len(loop.rows)} rows are independent."
        )
        if loop.dropped:
            lines.append(
                f"  Dropped, since the others imply them: {', '.join(loop.dropped)};"
                " the cut forces along them are not unique."
            )
        else:
            lines.append("  The cut forces are unique.")
    active = ", ".join(system.speeds[k].name for k in closure.active) or "none"
    lines.append(
        f"Mobility {closure.mobility} (Gruebler-Kutzbach counts {closure.gruebler});"
        f" independent: {active}."
    )
    if closure.motors != closure.active:
        motors = ", ".join(system.speeds[k].name for k in closure.motors)
        lines.append(f"Driven by {_count(len(closure.motors), 'effort')}: {motors}.")
    if len(closure.motors) > closure.mobility:
        lines.append("  They are more than the mobility: which of them carries a load is a choice.")
    lines.append(f"The loops close to {closure.residual:.1e} at the assembled configuration.")
    return [*lines, *_configuration(system, closure)]


_SHOWN_POSITIONS, _SHOWN_MODES = 12, 3
"""Maximum number of positions of a configuration, and of other configurations, in a report."""


def _configuration(system: System, closure: Closure) -> list[str]:
    """Return the lines of the assembled configuration, unmet guesses and other assembly modes."""

    def shown(q: Sequence[float]) -> str:
        pairs = zip(system.coordinates, q, strict=True)
        texts = [f"{c.name} = {x:.5g}" for c, x in pairs]
        more = ", ..." if len(texts) > _SHOWN_POSITIONS else ""
        return ", ".join(texts[:_SHOWN_POSITIONS]) + more

    lines = [f"Assembled at {shown(system.configuration)}."]
    at = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    at |= dict(closure.at_cut)
    missed = [(name, x) for name, x in closure.guess if abs(at[name] - x) > _GUESSED]
    if missed:
        guesses = ", ".join(f"{name} = {x:.5g}" for name, x in missed[:_SHOWN_POSITIONS])
        lines.append(f"  Guesses that are not met: {guesses}.")
    lines += [f"  Another configuration: {shown(q)}." for q in closure.others[:_SHOWN_MODES]]
    if closure.meets:
        lines.append(
            "  The configuration next to the guess is singular: branches of motion meet there. The"
            " mechanism is assembled beside it, on the branch nearest to the guess. Guess more"
            " positions to choose another branch."
        )
    if closure.dead:
        names = ", ".join(system.speeds[k].name for k in closure.active)
        lines.append(
            f"  The configuration is a dead centre of {names}: the other joints do not follow"
            f" from {names} there, and models in independent joints have no value. Guess another"
            " position, or name other independent joints (assemble(active=...))."
        )
    return lines


_GUESSED = 1e-9
"""Difference from a guess that counts as met [rad or m]: closing keeps locked positions."""


def _parameters(system: System) -> list[str]:
    if not system.parameters:
        return []
    values = ", ".join(
        f"{p.name} = {'no value' if p.default is None else format(p.default, 'g')}"
        for p in system.parameters
    )
    return [f"Parameters: {values}."]


def _acting(system: System) -> list[str]:
    """Return a sentence for each part of drive lines, force element and sensor."""
    driving = {device.name for device in system.devices}
    return [
        *(row.sentence for row in system.shafts if row.name not in driving),
        *(
            part.sentence
            for part in system.parts
            if not part.element.drives and not part.binds_alone  # listed among the loops
        ),
        *(device.sentence for device in system.devices),
        *(sensor.sentence for sensor in system.sensors),
    ]


def _count(number: int, noun: str) -> str:
    plural = noun[:-1] + "ies" if noun.endswith("y") else noun + "s"
    return f"{number} {noun if number == 1 else plural}"


_BUILDING = threading.RLock()
"""Lock of the cache, so that two threads that request the same model get the same Function."""


@dataclass(frozen=True, slots=True, eq=False)
class System:
    """An assembled mechanism, from which models are built.

    Attributes:
        name: name of the mechanism.
        source: origin of its data.
        tree: links with frames and inertias.
        cuts: joints that are cut to open the loops.
        couplings: relations between coordinates.
        parameters: parameters in the order of the input p of the Functions.
        p: (np, 1) symbols of the parameters.
        coordinates: elements of q.
        speeds: elements of v, and of efforts and accelerations.
        cut_coordinates: coordinates of cut joints, which are not in q.
        bodies: moving bodies of the description, in the order of external wrenches.
        frames: link (-1 for the base) and pose in the link's frame of each named frame.
        named_frames: names of the frames that were added by `add_frame`.
        loops: one row for each loop or coupling.
        configuration: a position q that closes the loops, or all zero.
        closure: constraints of the loops on velocities. None for an open chain.
        parts: force elements, drives and all other equation-based components.
        joints: all joints and constraints, in the tree and cut.
        sensors: sensors on points and joints.
        shafts: inertias and rigid gears of drive lines, and the coordinates that they rotate with.
        z: (nz, 1) symbols of the states of parts.
        u: (nu, 1) symbols of the inputs of parts.
        bounds: least and greatest value of the parameters with a bound, by name.
        bounded: fields of components that are computed from parameters and have bounds.
        described: components with parameters, as described.
        numbered: name of the body of each numbered frame of the source table. Empty if the numbers
            are those of the links.
        shapes: shapes of the links and the base, for pictures.
        nodes: index in q and index in v of the massless coordinates that force balances determine.
        balances: force balances of the nodes. Balances of positions come first.
    """

    name: str
    source: str
    tree: Tree
    cuts: tuple[Cut, ...]
    couplings: tuple[CoordinateCoupling, ...]
    parameters: tuple[Parameter, ...]
    p: SX
    coordinates: tuple[Coordinate, ...]
    speeds: tuple[Coordinate, ...]
    cut_coordinates: tuple[Coordinate, ...]
    bodies: tuple[BodyRow, ...]
    frames: Mapping[str, tuple[int, Pose]]
    named_frames: tuple[str, ...]
    loops: tuple[LoopRow, ...]
    configuration: tuple[float, ...]
    closure: Closure | None = None
    parts: tuple[AttachedPart, ...] = ()
    joints: tuple[JointRow, ...] = ()
    sensors: tuple[AttachedSensor, ...] = ()
    shafts: tuple[ShaftRow, ...] = ()
    z: SX = field(default_factory=lambda: SX(0, 1))
    u: SX = field(default_factory=lambda: SX(0, 1))
    bounds: Mapping[str, Bounds] = field(default_factory=dict)
    bounded: tuple[BoundedField, ...] = ()
    described: tuple[Component, ...] = ()
    numbered: Mapping[int, str] = field(default_factory=dict)
    shapes: tuple[ShapeRow, ...] = ()
    nodes: tuple[tuple[int, int], ...] = ()
    balances: tuple[Balance, ...] = ()
    _cache: dict[Any, Any] = field(default_factory=dict, repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle everything except the models, which are built again.

        Raises:
            ModelError: another process cannot import the class of a component.
        """
        try:
            return _unpickle, packed(self._described())
        except (AttributeError, pickle.PicklingError) as error:
            raise ModelError(
                f"{self.name}: the system cannot be pickled, since another process cannot import"
                f" the class of a component ({error}); define the class by a class statement at"
                " the top of a module"
            ) from error

    def _described(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "_cache"}

    def __repr__(self) -> str:
        kind = "closed" if self.is_closed else "open"
        size = f"{len(self.tree.links)} links, nq={self.nq}, nv={self.nv}"
        return f"<System {self.name}: {kind}, {size}>"

    @property
    def nq(self) -> int:
        """Number of positions."""
        return self.tree.nq

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return self.tree.nv

    @property
    def devices(self) -> tuple[AttachedPart, ...]:
        """Components that drive shafts: motors and imposed torques."""
        return tuple(part for part in self.parts if part.element.drives)

    @property
    def states(self) -> tuple[Quantity, ...]:
        """Name and unit of the elements of z, the states of parts."""
        return tuple(row for part in self.parts for row in part.state_quantities)

    @property
    def inputs(self) -> tuple[Quantity, ...]:
        """Name and unit of the elements of u, the inputs of parts."""
        return tuple(row for part in self.parts for row in part.input_quantities)

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Name and unit of the outputs of parts: forces, speeds and so on."""
        return tuple(row for part in self.parts for row in part.output_quantities)

    @property
    def z_start(self) -> list[float]:
        """Initial values of z from the components."""
        return [getattr(part.element, name) for part in self.parts for name in part.states]

    @property
    def u_default(self) -> list[float]:
        """Default values of u."""
        return [
            float(part.element.declared[name].default)
            for part in self.parts
            for name, given in part.inputs.items()
            if isinstance(given, SX)
        ]

    @property
    def links(self) -> tuple[LinkRow, ...]:
        """Links of the tree and Khalil parameters of their frames."""
        return link_rows(self.tree)

    @property
    def is_closed(self) -> bool:
        """Whether loops or couplings constrain the coordinates."""
        return self.closure is not None

    @property
    def active(self) -> tuple[int, ...]:
        """Indices of the independent velocities: all of them in an open chain.

        Models of a closed system are functions of these velocities. `actuated` has the velocities
        with motors.
        """
        return self.closure.active if self.closure else tuple(range(self.nv))

    @property
    def actuated(self) -> tuple[int, ...]:
        """Indices of the velocities whose joints have motors."""
        return tuple(k for k, speed in enumerate(self.speeds) if speed.actuated)

    @property
    def free(self) -> tuple[int, ...]:
        """Indices of the velocities whose positions may be chosen, see `Closure.free`."""
        return self.closure.free if self.closure else tuple(range(self.nv))

    @property
    def node_frictions(self) -> frozenset[str]:
        """Names of the components whose dry friction acts on massless nodes."""
        return frozenset(name for balance in self.balances for name in balance.frictions)

    @property
    def motors(self) -> tuple[int, ...]:
        """Indices of the velocities whose efforts are in direct and inverse dynamics.

        They are the independent velocities, unless there are more motors or dependent motors.
        """
        return self.closure.motors if self.closure else tuple(range(self.nv))

    @property
    def symbol_table(self) -> dict[str, SX]:
        """Symbol of every parameter by name."""
        return {parameter.name: self.p[k] for k, parameter in enumerate(self.parameters)}

    @property
    def p_default(self) -> list[float]:
        """Default values of the parameters; NaN for a parameter without value."""
        return [float("nan") if p.default is None else p.default for p in self.parameters]

    def report(self) -> str:
        """Return a description of the assembled system in plain sentences."""
        return report(self)

    def draw(self, path: PathLike | None = None) -> Diagram:
        """Return a diagram of bodies, joints of the tree, and cut joints.

        Args:
            path: .svg file to write in addition.

        Raises:
            ExportError: the file cannot be written.
        """
        from mbs.view.diagram import drawn

        return drawn(self, path)

    def qdot(self, q: Any, v: Any) -> Any:
        """Return the time derivative of q, (nq, 1). It differs from v for quaternions only.

        Args:
            q: (nq, 1) positions, as SX, MX, DM or numpy.
            v: (nv, 1) velocities.
        """
        rate: Function = self.cached("qdot", self._rate_function)
        return rate(q, v)

    def _rate_function(self) -> Function:
        q, v = SX.sym("q", self.nq), SX.sym("v", self.nv)
        rate = casadi.densify(position_rate(self.tree, q, v))
        return Function("qdot", [q, v], [rate], ["q", "v"], ["qdot"])

    def cached(self, key: Any, build: Callable[[], Any]) -> Any:
        """Return the cached value of `build()` for a key; build it at the first request."""
        with _BUILDING:
            if key not in self._cache:
                self._cache[key] = build()
            return self._cache[key]

    def content(self) -> Packed | None:
        """Return a key of the system across processes; None if it contains user-defined code."""

        def build() -> Packed | None:
            found = content_of(self._described())
            # equal texts may be one object or two, which pickles show; unpacking makes this
            # reproducible
            return found and packed(unpacked(*found))

        content: Packed | None = self.cached("content", build)
        return content

    def recent(self, kind: str, key: Any, build: Callable[[], Any], most: int) -> Any:
        """Return the value of `build()` for a key, with a cache of the last values of a kind.

        Args:
            kind: kind of cached values.
            key: key of the value within the kind.
            build: function that computes a value that is not in the cache.
            most: maximum number of cached values of the kind.
        """
        with _BUILDING:
            kept: dict[Any, Any] = self._cache.setdefault(("recent", kind), {})
            value = kept.pop(key) if key in kept else build()
            kept[key] = value  # most recent
            while len(kept) > most:
                del kept[next(iter(kept))]
            return value

    def frame(self, name: str | int) -> tuple[int, Pose]:
        """Return link and pose of a frame by name, or of link number 1, 2, ... (0 is the base).

        If the mechanism was made from a table, a number is that of a frame of the table, which also
        counts fixed frames.

        Raises:
            ModelError: there is no such frame.
        """
        if isinstance(name, (int, np.integer)) and not isinstance(name, bool):
            if self.numbered:
                return self._numbered_frame(int(name))
            if 0 <= name <= len(self.tree.links):
                return int(name) - 1, Pose.identity()
            raise ModelError(
                f"{self.name}: there is no link {name}; the links are 1 to {len(self.tree.links)},"
                " and 0 is the base"
            )
        if not isinstance(name, str):
            raise ModelError(
                f"{self.name}: {quoted(name)} names no frame; give a text or the number of a link"
            )
        if name in self.frames:
            return self.frames[name]
        raise ModelError(
            f"{self.name}: there is no frame {name!r}; " + did_you_mean(name, self.frames)
        )

    def _numbered_frame(self, number: int) -> tuple[int, Pose]:
        if number == 0:
            return self.frames["base"]
        if number not in self.numbered:
            known = ", ".join(map(str, self.numbered))
            raise ModelError(
                f"{self.name}: no body has the frame {number} of the table; the frames are {known},"
                " and 0 is the base"
            )
        return self.frames[self.numbered[number]]

    def position(self, values: Mapping[str, float] | Sequence[float] | None) -> list[float]:
        """Return positions q from values by coordinate name; others are as assembled.

        Names of variables of FMUs, such as j1.q, are accepted instead of j1.

        Raises:
            ModelError: a name is unknown, or a sequence has the wrong length.
        """
        start, given = list(self.configuration), self.plain_names(values, GUESSES)
        return self._fill(given, self.coordinates, start, "position")

    def positions_at_cuts(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the given joint positions that belong to cut joints, with the same names.

        Args:
            values: joint positions by coordinate name [rad or m]. Other joints are left out.

        Raises:
            ModelError: a position of a cut joint is no finite number.
        """
        names = [coordinate.name for coordinate in self.cut_coordinates]
        found = {name: value for name, value in values.items() if name in names}
        return {name: self._number(value, f"position of {name}") for name, value in found.items()}

    def velocity(self, values: Mapping[str, float] | Sequence[float] | None) -> list[float]:
        """Return velocities v from values by name, others zero; errors as for `position`."""
        given = self.plain_names(values, VELOCITIES)
        return self._fill(given, self.speeds, [0.0] * self.nv, "velocity")

    def effort(self, values: Mapping[str, float] | Sequence[float] | None) -> list[float]:
        """Return joint efforts tau from values by name, others zero; errors as for `position`."""
        given = self.plain_names(values, EFFORTS)
        return self._fill(given, self.speeds, [0.0] * self.nv, "effort")

    def plain_names(self, values: Any, kinds: Collection[str]) -> Any:
        """Return values by coordinate name, such as j1, for names such as j1.q.

        Args:
            values: values by name; other types are returned unchanged.
            kinds: accepted ends of names, such as ("q",).

        Raises:
            ModelError: a value is given by both names, or the name is of another quantity.
        """
        if not isinstance(values, Mapping):
            return values
        rows = (*self.coordinates, *self.cut_coordinates, *self.speeds)
        return by_coordinate(self.name, values, {row.name for row in rows}, kinds)

    def _fill(
        self,
        values: Mapping[str, float] | Sequence[float] | None,
        coordinates: Sequence[Coordinate],
        start: list[float],
        what: str,
    ) -> list[float]:
        names = [coordinate.name for coordinate in coordinates]
        if values is None:
            return start
        if not isinstance(values, Mapping):
            given = self._numbers(values, what)
            if len(given) != len(names):
                raise ModelError(
                    f"{self.name}: the {what} has {len(given)} values, the system has"
                    f" {len(names)}: {', '.join(names)}"
                )
            return given
        for name, value in values.items():
            if name in [coordinate.name for coordinate in self.cut_coordinates]:
                remedy = ", or give it as a guess" if what == "position" else ""
                raise ModelError(
                    f"{self.name}: {name} has no {what} of its own, since its joint was cut to open"
                    f" a loop; name another joint, or cut another one with m.cut(joint){remedy}"
                )
            if name not in names:
                raise ModelError(
                    f"{self.name}: there is no coordinate {name!r}; " + did_you_mean(name, names)
                )
            start[names.index(name)] = self._number(value, f"{what} of {name}")
        return start

    def _numbers(self, values: Any, what: str) -> list[float]:
        if isinstance(values, (list, tuple)):  # numpy cannot convert lists of (1, 1) DM
            values = [float(x) if isinstance(x, DM) and x.numel() == 1 else x for x in values]
        array = numbers_given(values)
        if isinstance(array, str):
            raise ModelError(f"{self.name}: the {what} {array}")
        if not is_vector(array.shape):
            raise ModelError(
                f"{self.name}: the {what} has the shape {array.shape}; give a list, or an array of"
                " one dimension"
            )
        if not np.isfinite(array).all():
            raise ModelError(
                f"{self.name}: the {what} is {quoted(values)}; give a finite number for each"
                " coordinate"
            )
        return [float(x) for x in array.ravel()]

    def _number(self, value: Any, what: str) -> float:
        numbers = self._numbers(value, what)
        if len(numbers) != 1:
            raise ModelError(f"{self.name}: the {what} has {len(numbers)} values; give one number")
        return numbers[0]

    def parameter_values(
        self, values: Mapping[str, float] | None = None, needed: Container[str] | None = None
    ) -> list[float]:
        """Return parameters p from values by name, others at their defaults.

        Args:
            values: values by name.
            needed: names of parameters that must have a value, by default all. Other parameters
                without value are NaN.

        Raises:
            ModelError: a name is unknown, a parameter has no value, or a value is out of its bounds
                or rejected by a component.
        """
        names = [parameter.name for parameter in self.parameters]
        if values is not None and not isinstance(values, Mapping):
            raise ModelError(
                f"{self.name}: the parameters are {quoted(values)}; give a dict of names to values"
            )
        given = dict(values or {})
        for name in given:
            if name not in names:
                raise ModelError(
                    f"{self.name}: there is no parameter {name!r}; " + did_you_mean(name, names)
                )
        defaults = {parameter.name: parameter.default for parameter in self.parameters}
        missing = [
            name
            for name, default in defaults.items()
            if given.get(name, default) is None and (needed is None or name in needed)
        ]
        if missing:
            raise ModelError(f"{self.name}: {without_values(missing)}")
        result = []
        for parameter in self.parameters:
            name = parameter.name
            value = given.get(name, parameter.default)
            if value is not None and name in given:
                value = self._number(value, f"parameter {name}")
            result.append(math.nan if value is None else value)
        if given and (fault := self.parameter_fault(result)):
            raise ModelError(f"{self.name}: {fault}")
        return result

    def parameter_fault(self, p: Iterable[float]) -> str:
        """Return the reason and remedy of invalid parameter values; empty if they are valid.

        Args:
            p: (np,) values; NaN for a missing value.
        """
        values = {
            parameter.name: float(value)
            for parameter, value in zip(self.parameters, p, strict=True)
            if not math.isnan(value)
        }
        links = {row.name: row.link - 1 for row in self.bodies}
        for component in self.described:
            try:
                checked = component.check_values(values)
                if isinstance(checked, RigidBody):
                    inertia_notes(self.tree, [(checked, links.get(checked.name, -1))])
            except MbsError as error:
                return str(error)
        for name, value in values.items():
            if fault := out_of_bounds(value, *self.bounds.get(name, (None, None))):
                return f"parameter {name} is {value:.6g}; {fault}"
        return ""


def _unpickle(*parts: Any) -> System:
    return System(**unpacked(*parts))
