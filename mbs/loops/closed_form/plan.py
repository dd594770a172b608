"""The loops of a system in the order in which they can be solved, and how each of them closes.

A loop that shares unknown joints with others waits until these have been solved: their positions
are known then.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.coordinate_coupling import CoordinateCoupling
from mbs.assembly.model_function import require_system
from mbs.components import PointOnLine, Rod
from mbs.components.constraints import Constraint
from mbs.errors import NoClosedForm
from mbs.loops.closed_form.coupling import coupled
from mbs.loops.closed_form.dispatch import closed_form
from mbs.loops.closed_form.distance import Span, spans
from mbs.loops.closed_form.places import extent, independent_places
from mbs.loops.closed_form.ring import Ring, loop_links, ring_of
from mbs.loops.closed_form.root import Root
from mbs.loops.closed_form.stage import Stage, started_at
from mbs.loops.closed_form.survey import constants
from mbs.loops.closed_form.trilateration import (
    held_point,
    independent_links,
    slid_places,
)
from mbs.loops.closed_form.verified import verified


def plan(system: System) -> tuple[Stage, ...]:
    """The loops and couplings of a system in an order in which each follows from those before.

    Raises:
        NoClosedForm: says which loop has none, and why.
        ModelError: `system` is not a System.
    """
    require_system(system)

    def build() -> tuple[Stage, ...]:
        return plan_from(system, independent_places(system)) if system.closure else ()

    stages: tuple[Stage, ...] = system.cached("closed form", build)
    return stages


def plan_from(system: System, known: Collection[int]) -> tuple[Stage, ...]:
    """The loops and couplings in an order in which each follows from what is known.

    Args:
        system: the assembled mechanism, with loops.
        known: places of the positions that are known.

    Raises:
        NoClosedForm: says which loop has none, and why.
    """

    def build() -> tuple[Stage, ...]:
        q = SX.sym("q", extent(system))
        stages = ordered(system, known, q)
        return verified(system, stages, lambda posture: started_at(system, posture, known))

    stages: tuple[Stage, ...] = system.cached(("closed form from", *sorted(known)), build)
    return stages


@dataclass(slots=True)
class _Work:
    """What is solved so far.

    Attributes:
        system: whose loops they are.
        q: symbols of all positions.
        values: the same, with numbers for positions that turned out not to change.
        known: places of what is known.
        stages: in their order.
    """

    system: System
    q: SX
    values: SX
    known: set[int]
    stages: list[Stage] = field(default_factory=list)

    def take(self, stage: Stage) -> None:
        """Count what a stage gives as known."""
        self.stages.append(stage)
        self.known |= set(stage.places)
        if len(stage.labels) == 1:
            p = self.system.p
            found = constants(stage.values(self.q, p), self.q, p)
            for place, number in zip(stage.places, found, strict=True):
                if number is not None:
                    self.values[place] = number

    def ring(self, number: int) -> Ring:
        """The loop of a cut joint."""
        return ring_of(self.system, number, self.known, self.values)


def ordered(system: System, known: Collection[int], q: SX) -> list[Stage]:
    """The stages in their order, not yet held against postures.

    Args:
        system: whose loops they are.
        known: places of the positions that are known.
        q: symbols of all positions.

    Raises:
        NoClosedForm: a loop cannot be solved, or no loop gives a position.
    """
    work = _Work(system, q, SX(q), set(known))
    pending = list(range(len(system.cuts) + len(system.couplings)))
    reasons = dict[int, str]()
    while pending:
        before, waiting = len(work.stages), list[int]()
        for number in pending:
            outcome = _attempt(work, number)
            while isinstance(outcome, Stage):
                work.take(outcome)
                outcome = _attempt(work, number)
            if outcome is not None:
                waiting.append(number)
                reasons[number] = outcome
        if waiting and len(work.stages) == before:
            held = _held(work, waiting)
            if held is None:
                raise NoClosedForm(_refusal(system, waiting, reasons))
            work.take(held)
        pending = waiting
    _require_all(system, work.known)
    return work.stages


def _attempt(work: _Work, number: int) -> Stage | str | None:
    """A loop, or a coupling, solved with what is known; why not; None where nothing is unknown."""
    system = work.system
    if number >= len(system.cuts):
        return _coupling_stage(work, system.couplings[number - len(system.cuts)])
    cut = system.cuts[number]
    back, out = loop_links(system, cut)
    if all(system.tree.links[k].q.start in work.known for k in (*back, *out)):
        return None
    joint = cut.edge.joint
    if _is_bound(system, number):
        return f"a {type(joint).__name__} closes it"
    root = closed_form(work.ring(number), work.q, system.p)
    return root if isinstance(root, str) else _stage(work, joint.name, root)


def _held(work: _Work, waiting: Sequence[int]) -> Stage | None:
    """Slides that several loops share and the rigid links in these hold, if there are such."""
    system, groups = work.system, dict[frozenset[int], dict[int, Span]]()
    for number in waiting:
        if number < len(system.cuts) and not _is_bound(system, number):
            for span in spans(work.ring(number), work.q, system.p):
                places = slid_places(span)
                if places:
                    groups.setdefault(places, {}).setdefault(number, span)
    for found in groups.values():
        numbers = independent_links(found, work.q, system.p)
        if numbers:
            name = system.cuts[numbers[-1]].edge.joint.name
            return _stage(work, name, held_point(name, [found[k] for k in numbers]))
    return None


def _is_bound(system: System, number: int) -> bool:
    """Whether a loop is closed by what is not made of turns, slides and balls."""
    joint = system.cuts[number].edge.joint
    return isinstance(joint, Constraint) and not isinstance(joint, (PointOnLine, Rod))


def _coupling_stage(work: _Work, coupling: CoordinateCoupling) -> Stage | str | None:
    if {coupling.driven, coupling.driver} <= work.known:
        return None
    root = coupled(coupling, work.known, work.q)
    return root if isinstance(root, str) else _stage(work, coupling.name, root)


def _stage(work: _Work, name: str, root: Root) -> Stage:
    arguments, ways = [work.q, work.system.p], list(root.ways.values())
    places = tuple(sorted(ways[0]))
    columns = [casadi.vertcat(*(way[place] for place in places)) for way in ways]
    values = Function("ways", arguments, [casadi.densify(casadi.horzcat(*columns))])
    if root.spun is None:
        return Stage(name, places, tuple(root.ways), values)
    angle = Function("spin", arguments, [root.spun.angle])
    return Stage(name, places, tuple(root.ways), values, (root.spun.place, angle))


def _refusal(system: System, waiting: Sequence[int], reasons: dict[int, str]) -> str:
    names = [cut.edge.joint.name for cut in system.cuts]
    names += [coupling.name for coupling in system.couplings]
    first = waiting[0]
    return (
        f"{system.name}: the loop of {names[first]} has no closed form known here,"
        f" {reasons[first]}; use mbs.loops.solve without branch"
    )


def _require_all(system: System, known: set[int]) -> None:
    for k, coordinate in enumerate(system.coordinates):
        if k not in known:
            raise NoClosedForm(
                f"{system.name}: no loop gives {coordinate.name}; use mbs.loops.solve without"
                " branch"
            )
