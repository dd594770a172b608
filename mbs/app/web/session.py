"""What one visitor has in the app: the robot, its history, and the configuration it stands in."""

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
from mbs.loops import Mode, modes
from mbs.loops.closing import Closing, closure_parameters, follow_configuration
from mbs.loops.function import independent_names

# Configurations of the picture: joints that can be moved by hand, the others following.


Vector = tuple[float, ...]

_FULL_TURN = math.pi
_SAME = 1e-6
"""Difference of positions [rad or m] below which two configurations are one, and length of a part
of a quaternion that has no direction: sliders move in steps a thousand times as large."""
_MOST_MODES = 64


@dataclass(frozen=True, slots=True)
class Handle:
    """A coordinate that can be moved by hand.

    Attributes:
        name: of the coordinate.
        index: in q.
        unit: rad, m, or 1 for the parts of a quaternion.
        low, high: ends of its slider.
        limited: whether they are limits of the joint.
    """

    name: str
    index: int
    unit: str
    low: float
    high: float
    limited: bool


def handles(system: System) -> tuple[Handle, ...]:
    """The coordinates that can be moved: all of an open chain, the independent ones of loops."""
    chosen = set(independent_names(system)) if system.is_closed else None
    reach = _reach(system)
    return tuple(
        _handle(system, index, reach)
        for index, coordinate in enumerate(system.coordinates)
        if chosen is None or coordinate.name in chosen
    )


def _handle(system: System, index: int, reach: float) -> Handle:
    c = system.coordinates[index]
    if c.limits is not None:
        return Handle(c.name, index, c.unit, c.limits[0], c.limits[1], True)
    half = {"rad": _FULL_TURN, "m": reach}.get(c.unit, 1.0)
    middle = system.configuration[index] if c.unit == "m" else 0.0
    return Handle(c.name, index, c.unit, middle - half, middle + half, False)


def _reach(system: System) -> float:
    """A length of the size of the mechanism [m], 1 where nothing tells it."""
    lengths = [
        abs(value)
        for link in system.links
        for value in (_number(link.b), _number(link.d), _number(link.r))
    ]
    return sum(lengths) / 2 or 1.0


def _number(value: object) -> float:
    return float(value) if isinstance(value, (int, float)) else 0.0


def moved(system: System, q: Sequence[float], index: int, value: float) -> Vector:
    """The configuration with one coordinate elsewhere and the loops closed near the old one.

    Args:
        system: the mechanism.
        q: (nq,) present configuration [rad or m].
        index: of the coordinate in q.
        value: where it is to be.

    Raises:
        LoopError: the loops cannot be closed there.
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
    return tuple(handle.index for handle in handles(system))


def _unit(system: System, q: list[float], index: int) -> Vector:
    """The configuration with quaternions of unit length, the moved part kept if it can be."""
    for part in quaternion_slices(system.tree):
        values = np.array(q[part])
        if part.start <= index < part.stop:
            values = _with_part(values, index - part.start)
        norm = float(np.linalg.norm(values))
        q[part] = [float(x) for x in (values / norm if norm > _SAME else [1.0, 0.0, 0.0, 0.0])]
    return tuple(q)


def _with_part(values: NDArray[np.float64], kept: int) -> NDArray[np.float64]:
    """The quaternion whose other parts are scaled so that its length is one."""
    values = values.copy()
    values[kept] = min(max(values[kept], -1.0), 1.0)
    others = [k for k in range(4) if k != kept]
    rest, wanted = float(np.linalg.norm(values[others])), math.sqrt(1.0 - values[kept] ** 2)
    values[others] = values[others] * (wanted / rest) if rest > _SAME else 0.0
    if rest <= _SAME:
        values[others[0]] = wanted
    return values


def carried(old: System | None, q: Sequence[float], new: System) -> Vector:
    """The configuration of a changed mechanism nearest to that of the old one.

    It is the assembled one where the mechanism is another, or cannot be closed there.
    """
    names = [c.name for c in new.coordinates]
    if old is None or [c.name for c in old.coordinates] != names:
        return new.configuration
    if not new.is_closed:
        return tuple(q)
    closed = Closing(new, closure_parameters(new), _held(new)).nearest(np.array(q))
    return tuple(float(x) for x in closed.q) if closed.is_closed else new.configuration


def assembly_modes(system: System, q: Sequence[float]) -> tuple[Mode, ...] | str:
    """Every way to assemble the mechanism with its independent joints as in q.

    Returns:
        the modes, or a sentence why they are not known.
    """
    if not system.is_closed:
        return ()
    known = {handle.name: q[handle.index] for handle in handles(system)}
    try:
        found = modes(system, known)
    except NoClosedForm:
        return "its loops are closed by iteration, so that its assembly modes cannot be listed"
    except LoopError as error:
        return str(error)
    if not found.complete:
        return f"not all of its assembly modes are known: {found.proof}"
    return tuple(found[:_MOST_MODES])


def mode_of(found: Sequence[Mode], q: Sequence[float]) -> int | None:
    """The number of the mode that a configuration is in, angles being alike after a whole turn."""
    for k, mode in enumerate(found):
        apart = np.subtract(mode.q, q)
        turned = np.abs((apart + math.pi) % (2 * math.pi) - math.pi)
        if float(np.max(np.minimum(np.abs(apart), turned), initial=0.0)) < _SAME:
            return k
    return None


_LONGEST_HISTORY = 200


@dataclass(slots=True)
class Session:
    """The state of one browser tab, in the memory of the server only.

    Attributes:
        document: as typed last, perhaps with mistakes.
        good: the last document that could be assembled.
        system: of `good`; None until the first is assembled.
        tables: what of `good` is shown in the grids.
        q: (nq,) present configuration of `system` [rad or m].
        refusal: why `document` could not be assembled, "" if it could.
        robot: number of the opened robot. Edits of a robot keep it.
        past: documents before the present one with the numbers of their robots, the oldest first.
        future: documents that were undone, with the same numbers, the next one last.
        shown: roles of the picture that were switched, by name.
        notes: what panels keep for a reload, by names of their own.
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
        """The same in another tab: what is changed there stays as it is here."""
        return replace(
            self,
            past=list(self.past),
            future=list(self.future),
            shown=dict(self.shown),
            notes=deepcopy(self.notes),
        )

    def change(self, document: Document) -> None:
        """Put another document in the place of the present one, which can be had back."""
        if document == self.document:
            return
        self._keep()
        self.document = document

    def open(self, document: Document) -> None:
        """Put another robot in the place of the present one, which can be had back.

        The new robot starts in the configuration of its own description.
        """
        self._keep()
        self._enter(document, max([self.robot, *(robot for _, robot in self.past)]) + 1)

    def _keep(self) -> None:
        """Remember the present document."""
        self.past.append((self.document, self.robot))
        del self.past[:-_LONGEST_HISTORY]
        self.future.clear()

    def _enter(self, document: Document, robot: int) -> None:
        """Take a document; of another robot nothing is carried over."""
        self.document = document
        if robot != self.robot:
            self.robot, self.good, self.system, self.tables = robot, None, None, None
            self.q, self.refusal = (), ""

    def undo(self) -> bool:
        """Take back the last change; whether there was one."""
        if not self.past:
            return False
        self.future.append((self.document, self.robot))
        self._enter(*self.past.pop())
        return True

    def redo(self) -> bool:
        """Make the last change that was taken back again; whether there was one."""
        if not self.future:
            return False
        self.past.append((self.document, self.robot))
        self._enter(*self.future.pop())
        return True

    def settle(self, document: Document, q: Vector) -> None:
        """Take an assembled document as the one that is shown, in the configuration q (nq,)."""
        self.good, self.system, self.tables = document, document.system(), document.shown()
        self.q, self.refusal = q, ""

    @property
    def shown_tables(self) -> Tables:
        """What the grids show: the cells as typed, or the links of a composed mechanism."""
        known = self.tables is not None and self.document == self.good
        return self.tables if known and self.tables is not None else self.document.tables

    def require_system(self) -> System:
        """The system of the document as typed.

        Raises:
            MbsError: a cell is wrong, or the mechanism cannot be assembled; the sentence says why.
        """
        if self.document == self.good and self.system is not None:
            return self.system
        for problem in self.document.problems:
            raise DescriptionError(problem.sentence)
        raise MbsError(self.refusal or f"{self.document.name}: it is still being assembled")
