"""The loops of a system in the order in which they can be solved, and how each of them closes.

A loop that shares unknown joints with others waits until these have been solved: their positions
are known then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.system import CoordinateCoupling
from mbs.components import PointOnLine, Rod
from mbs.components.constraints import Constraint
from mbs.errors import NoClosedForm
from mbs.loops.closed_form.coupling import coupled
from mbs.loops.closed_form.dispatch import closed_form
from mbs.loops.closed_form.ring import loop_links, ring_of
from mbs.loops.closed_form.root import Root
from mbs.loops.closing import Closing, Vector, closure_parameters

_NEAR = 1e-5
_SEED = 20260104
_MOVE = 0.2
_TRIES = 8
_CHECKS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One loop, or one coupling, solved for its unknown positions.

    Attributes:
        name: of the cut joint or of the coupling.
        places: numbers in q of what it gives.
        labels: of the ways to close it; one empty label where there is a single way.
        values: Function of q (nq, 1), of which known positions are used, and p; one row a
            place, one column a way.
        chosen: number of the way in which the system was assembled.
    """

    name: str
    places: tuple[int, ...]
    labels: tuple[str, ...]
    values: Function
    chosen: int = 0

    def way_at(self, system: System, q: Vector, p: Vector) -> int | None:
        """Which way leads to the closed posture q; None when none does."""
        values = np.array(self.values(q, p))
        turns = [system.coordinates[k].unit == "rad" for k in self.places]
        for way in range(len(self.labels)):
            gap = values[:, way] - q[list(self.places)]
            gap[turns] = np.remainder(gap[turns] + np.pi, 2 * np.pi) - np.pi
            if np.all(np.abs(gap) < _NEAR):
                return way
        return None


def plan(system: System) -> tuple[Stage, ...]:
    """The loops and couplings of a system in an order in which each follows from those before.

    Raises:
        NoClosedForm: says which loop has none, and why.
        ModelError: `system` is not a System.
    """
    require_system(system)
    stages: tuple[Stage, ...] = system.cached("closed form", lambda: _verified(system))
    return stages


def _verified(system: System) -> tuple[Stage, ...]:
    """The plan with the ways of the assembled posture, seen to hold at others as well."""
    if system.closure is None:
        return ()
    p = closure_parameters(system)
    posture = np.array(system.posture)
    postures = [posture, *_nearby(system, posture, p)]
    stages = []
    for stage in _ordered(system):
        ways = [stage.way_at(system, q, p) for q in postures]
        first = ways[0]
        if first is None or None in ways:
            raise NoClosedForm(
                f"{system.name}: the loop of {stage.name} does not close as the directions of its"
                " axes suggest; use mbs.loops.solve without branch"
            )
        stages.append(_chosen(stage, first))
    return tuple(stages)


def _chosen(stage: Stage, way: int) -> Stage:
    return Stage(stage.name, stage.places, stage.labels, stage.values, way)


def _nearby(system: System, posture: Vector, p: Vector) -> list[Vector]:
    rng, found = np.random.default_rng(_SEED), list[Vector]()
    for _ in range(_TRIES):
        closed = Closing(system, p).nearest(posture + rng.uniform(-_MOVE, _MOVE, posture.shape))
        if closed.is_closed:
            found.append(closed.q)
        if len(found) == _CHECKS:
            break
    return found


def _ordered(system: System) -> list[Stage]:
    if system.nq != system.nv:
        raise NoClosedForm(
            f"{system.name}: a joint of the tree has a quaternion, which no closed form gives; use"
            " mbs.loops.solve without branch"
        )
    known, q = set(system.active), SX.sym("q", system.nq)
    pending = list(range(len(system.cuts) + len(system.couplings)))
    stages, reasons = list[Stage](), dict[int, str]()
    while pending:
        before, waiting = len(stages), list[int]()
        for number in pending:
            outcome = _attempt(system, number, known, q)
            while isinstance(outcome, Stage):
                stages.append(outcome)
                known |= set(outcome.places)
                outcome = _attempt(system, number, known, q)
            if outcome is not None:
                waiting.append(number)
                reasons[number] = outcome
        if waiting and len(stages) == before:
            raise NoClosedForm(_refusal(system, waiting, reasons))
        pending = waiting
    _require_all(system, known)
    return stages


def _attempt(system: System, number: int, known: set[int], q: SX) -> Stage | str | None:
    """A loop, or a coupling, solved with what is known; why not; None where nothing is unknown."""
    if number >= len(system.cuts):
        coupling = system.couplings[number - len(system.cuts)]
        return _coupling_stage(system, coupling, known, q)
    cut = system.cuts[number]
    back, out = loop_links(system, cut)
    if all(system.tree.links[k].q.start in known for k in (*back, *out)):
        return None
    joint = cut.edge.joint
    if isinstance(joint, Constraint) and not isinstance(joint, (PointOnLine, Rod)):
        return f"a {type(joint).__name__} closes it"
    root = closed_form(ring_of(system, cut, known, q), q, system.p)
    return root if isinstance(root, str) else _stage(system, joint.name, root, q)


def _coupling_stage(
    system: System, coupling: CoordinateCoupling, known: set[int], q: SX
) -> Stage | str | None:
    if {coupling.driven, coupling.driver} <= known:
        return None
    root = coupled(coupling, known, q)
    return root if isinstance(root, str) else _stage(system, coupling.name, root, q)


def _stage(system: System, name: str, root: Root, q: SX) -> Stage:
    ways = list(root.ways.values())
    places = tuple(sorted(ways[0]))
    columns = [casadi.vertcat(*(way[place] for place in places)) for way in ways]
    values = Function("ways", [q, system.p], [casadi.densify(casadi.horzcat(*columns))])
    return Stage(name, places, tuple(root.ways), values)


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
