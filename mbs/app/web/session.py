"""State of a visitor of the app: the robot, its history and its present configuration."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import Tables
from mbs.assembly import System
from mbs.assembly.tree import quaternion_slices
from mbs.errors import DescriptionError, LoopError, MbsError, NoClosedForm, Unclosable
from mbs.loops import Mode, assembly_modes
from mbs.loops._function import independent_names
from mbs.loops.closing import Closing, closure_parameters, follow_configuration

# Configurations of the picture: coordinates that the user moves, and the dependent coordinates.


Vector = tuple[float, ...]

_FULL_TURN = math.pi
_SAME = 1e-6
"""Difference of positions [rad or m] below which two configurations are equal, and length of a
partial quaternion below which it has no direction. The steps of sliders are a thousand times as
large."""
_MOST_MODES = 64


@dataclass(frozen=True, slots=True)
class Handle:
    """Coordinate that the user can move by a slider.

    Attributes:
        name: name of the coordinate.
        index: index in q.
        unit: rad, m, or 1 for the elements of a quaternion.
        low, high: ends of the slider.
        limited: whether the ends are limits of the joint.
    """

    name: str
    index: int
    unit: str
    low: float
    high: float
    limited: bool


def handles(system: System) -> tuple[Handle, ...]:
    """Return the coordinates that sliders can move: all of an open chain, or the independent ones.

    Args:
        system: the mechanism.
    """
    chosen = set(independent_names(system)) if system.is_closed else None
    reach = _reach(system)
    return tuple(
        _handle(system, index, reach)
        for index, coordinate in enumerate(system.coordinates)
        if chosen is None or coordinate.name in chosen
    )


def _handle(system: System, index: int, reach: float) -> Handle:
    """Return the slider of a coordinate: its limits, or a usual range.

    `reach` is the size of the mechanism [m].
    """
    c = system.coordinates[index]
    if c.limits is not None:
        return Handle(c.name, index, c.unit, c.limits[0], c.limits[1], True)
    half = {"rad": _FULL_TURN, "m": reach}.get(c.unit, 1.0)
    middle = system.configuration[index] if c.unit == "m" else 0.0
    return Handle(c.name, index, c.unit, middle - half, middle + half, False)


def _reach(system: System) -> float:
    """Return the approximate size of the mechanism [m]; 1 if it is unknown."""
    lengths = [
        abs(value)
        for link in system.links
        for value in (_number(link.b), _number(link.d), _number(link.r))
    ]
    return sum(lengths) / 2 or 1.0


def _number(value: object) -> float:
    """Return a value as float, 0 if it is an expression."""
    return float(value) if isinstance(value, (int, float)) else 0.0


def moved(system: System, q: Sequence[float], index: int, value: float) -> Vector:
    """Return the configuration with one coordinate changed and the loops closed nearby.

    Args:
        system: the mechanism.
        q: (nq,) present configuration [rad or m].
        index: index of the coordinate in q.
        value: new value of the coordinate.

    Raises:
        Unclosable: the loops cannot be closed with this value.
    """
    target = list(q)
    target[index] = value
    if not system.is_closed:
        return _unit(system, target, index)
    p = closure_parameters(system)
    try:
        found = follow_configuration(
            replace(system, configuration=tuple(q)), np.array(target), _held(system), p
        )
    except Unclosable as error:
        name = system.coordinates[index].name
        end = re.search(rf"ends near .*?\b{re.escape(name)} = (\S+?)[,;]", str(error))
        until = f"; on this branch it ends near {end[1]}" if end else ""
        raise Unclosable(
            f"{system.name}: the loop cannot be closed with {name} = {value:.4g}{until}"
        ) from None
    return tuple(float(x) for x in found)


def _held(system: System) -> tuple[int, ...]:
    """Return the indices in q of the coordinates that the user can move."""
    return tuple(handle.index for handle in handles(system))


def _unit(system: System, q: list[float], index: int) -> Vector:
    """Return a configuration with unit quaternions; the element `index` is kept if possible."""
    for part in quaternion_slices(system.tree):
        values = np.array(q[part])
        if part.start <= index < part.stop:
            values = _with_part(values, index - part.start)
        norm = float(np.linalg.norm(values))
        q[part] = [float(x) for x in (values / norm if norm > _SAME else [1.0, 0.0, 0.0, 0.0])]
    return tuple(q)


def _with_part(values: NDArray[np.float64], kept: int) -> NDArray[np.float64]:
    """Return the unit quaternion (4,) with one element kept and the other elements scaled."""
    values = values.copy()
    values[kept] = min(max(values[kept], -1.0), 1.0)
    others = [k for k in range(4) if k != kept]
    rest, wanted = float(np.linalg.norm(values[others])), math.sqrt(1.0 - values[kept] ** 2)
    values[others] = values[others] * (wanted / rest) if rest > _SAME else 0.0
    if rest <= _SAME:
        values[others[0]] = wanted
    return values


def carried(old: System | None, q: Sequence[float], new: System) -> Vector:
    """Return the configuration of a changed mechanism that is nearest to the present one.

    It is the assembled configuration if the coordinates differ or the loops cannot be closed.

    Args:
        old: mechanism before the change, or None.
        q: (nq,) its configuration [rad or m].
        new: mechanism after the change.
    """
    names = [c.name for c in new.coordinates]
    if old is None or [c.name for c in old.coordinates] != names:
        return new.configuration
    if not new.is_closed:
        return tuple(q)
    closed = Closing(new, closure_parameters(new), _held(new)).nearest(np.array(q))
    return tuple(float(x) for x in closed.q) if closed.is_closed else new.configuration


def listed_modes(system: System, q: Sequence[float]) -> tuple[Mode, ...] | str:
    """Find all assembly modes of the mechanism with its independent joints as in q.

    Args:
        system: the mechanism.
        q: (nq,) configuration [rad or m].

    Returns:
        The modes, at most 64, or a text that explains why they are not known. Empty without loops.
    """
    if not system.is_closed:
        return ()
    known = {handle.name: q[handle.index] for handle in handles(system)}
    try:
        found = assembly_modes(system, known)
    except NoClosedForm:
        return "its loops are closed by iteration, so that its assembly modes cannot be listed"
    except LoopError as error:
        return str(error)
    if not found.complete:
        return f"not all of its assembly modes are known: {found.proof}"
    return tuple(found[:_MOST_MODES])


def mode_of(found: Sequence[Mode], q: Sequence[float]) -> int | None:
    """Return the index of the assembly mode of a configuration, angles modulo 2 pi.

    None if no mode has this configuration.

    Args:
        found: assembly modes.
        q: (nq,) configuration [rad or m].
    """
    for k, mode in enumerate(found):
        apart = np.subtract(mode.q, q)
        turned = np.abs((apart + math.pi) % (2 * math.pi) - math.pi)
        if float(np.max(np.minimum(np.abs(apart), turned), initial=0.0)) < _SAME:
            return k
    return None


_LONGEST_HISTORY = 200


@dataclass(slots=True)
class Session:
    """State of a browser tab, kept in the memory of the server only.

    Attributes:
        document: description as last typed, possibly with errors.
        good: last description that could be assembled.
        system: system of `good`; None until the first assembly.
        tables: tables of `good` as displayed in the grids.
        q: (nq,) present configuration of `system` [rad or m].
        refusal: reason why `document` could not be assembled; "" if it could.
        robot: number of the opened robot; edits do not change it.
        past: previous documents with the numbers of their robots, oldest first.
        future: undone documents with the numbers of their robots, the next one last.
        shown: visibility of kinds of picture elements that the user switched, by name.
        notes: state that panels keep for a reload, by their own names.
    """

    document: Document
    good: Document | None = None
    system: System | None = None
    tables: Tables | None = None
    q: Vector = ()
    refusal: str = ""
    robot: int = 0
    past: list[tuple[Document, int]] = field(default_factory=list)
    future: list[tuple[Document, int]] = field(default_factory=list)
    shown: dict[str, bool] = field(default_factory=dict)
    notes: dict[str, object] = field(default_factory=dict)

    def doubled(self) -> Session:
        """Return an independent copy of the session for another browser tab."""
        return replace(
            self,
            past=list(self.past),
            future=list(self.future),
            shown=dict(self.shown),
            notes=deepcopy(self.notes),
        )

    def change(self, document: Document) -> None:
        """Replace the present document by another document of the same robot; undo restores it.

        Args:
            document: new document.
        """
        if document == self.document:
            return
        self._keep()
        self.document = document

    def open(self, document: Document) -> None:
        """Replace the present robot; undo restores it.

        The new robot starts in the configuration of its own description.

        Args:
            document: document of the new robot.
        """
        self._keep()
        self._enter(document, max([self.robot, *(robot for _, robot in self.past)]) + 1)

    def _keep(self) -> None:
        """Add the present document to the history, and forget undone documents."""
        self.past.append((self.document, self.robot))
        del self.past[:-_LONGEST_HISTORY]
        self.future.clear()

    def _enter(self, document: Document, robot: int) -> None:
        """Set the document.

        The state of the present robot is reset if `robot` is another number.
        """
        self.document = document
        if robot != self.robot:
            self.robot, self.good, self.system, self.tables = robot, None, None, None
            self.q, self.refusal = (), ""

    def undo(self) -> bool:
        """Undo the last change; return False if there is none."""
        if not self.past:
            return False
        self.future.append((self.document, self.robot))
        self._enter(*self.past.pop())
        return True

    def redo(self) -> bool:
        """Redo the last change that was undone; return False if there is none."""
        if not self.future:
            return False
        self.past.append((self.document, self.robot))
        self._enter(*self.future.pop())
        return True

    def settle(self, document: Document, q: Vector) -> None:
        """Set the document that was assembled and its configuration, for display.

        Args:
            document: document that can be assembled.
            q: (nq,) configuration [rad or m].
        """
        self.good, self.system, self.tables = document, document.system(), document.shown()
        self.q, self.refusal = q, ""

    @property
    def shown_tables(self) -> Tables:
        """Tables to display: the cells as typed, or the links of an assembled mechanism."""
        known = self.tables is not None and self.document == self.good
        return self.tables if known and self.tables is not None else self.document.tables

    def require_system(self) -> System:
        """Return the system of the document as typed.

        Raises:
            MbsError: a cell has an error, the mechanism cannot be assembled, or the assembly has
                not ended yet.
        """
        if self.document == self.good and self.system is not None:
            return self.system
        for problem in self.document.problems:
            raise DescriptionError(problem.sentence)
        raise MbsError(self.refusal or f"{self.document.name}: it is still being assembled")
