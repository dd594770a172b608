"""Loops solved joint by joint without iteration: stages in the order in which they can be solved.

Of every loop that is left the ring of its unknown joints is taken, with what is known by then in
its gaps; `mbs.closed_forms.kernels` says whether it has a closed form. `verify` holds a plan
against configurations, `complete` says which joints may be known together, and a `Posed` plan
begins at a frame whose pose is known.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.graph import Edge
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.model_function import require_system
from mbs.assembly.tables import CoordinateCoupling
from mbs.closed_forms.kernels import closed_form
from mbs.closed_forms.ring import (
    constants,
    extent,
    independent_indices,
    loop_links,
    ring_of,
    spin_indices,
)
from mbs.closed_forms.roots import LoopBranches
from mbs.closed_forms.spatial import (
    Span,
    coupled_position,
    independent_links,
    point_on_links,
    prismatic_indices,
    spans,
    unit_quaternion,
)
from mbs.components import Fixed, PointOnLine, Rod
from mbs.components.constraints import Constraint
from mbs.errors import NoClosedForm
from mbs.loops.closing import OPEN, Closing, Vector, closure_parameters, difference
from mbs.recursions.chain import Ring, free_pose
from mbs.recursions.parts import PartsAt, part_rows
from mbs.recursions.route import relative_pose
from mbs.solvers.rank import null_space, rank
from mbs.spatial import Pose

# One step of a plan, and which of its branches lead to a configuration.


_NEAR = 1e-5
"""Difference of positions [rad or m] between a branch and a configuration that it leads to: closed
to 1e-12, a configuration is known to the square root, 1e-6, where two branches meet."""


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One loop, or one coupling, solved for some of its unknown positions.

    Attributes:
        name: of the cut joint or of the coupling.
        indices: indices in q of what it gives; beyond the end of q those of cut joints.
        labels: of the branches; one empty label where there is a single one.
        values: Function of q with the positions of cut joints, of which known ones are used, and
            p; one row an index, one column a branch.
        spin: place of the spin on which these depend, and Function of the same arguments that
            gives it where the quaternion is known; None where there is none.
        chosen: number of the branch in which the system was assembled.
    """

    name: str
    indices: tuple[int, ...]
    labels: tuple[str, ...]
    values: Function
    spin: tuple[int, Function] | None = None
    chosen: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Roots:
    """Every way to close the loops of a block, at one place.

    Attributes:
        values: (r, k) positions of the block, one row a root.
        proof: how they were found, as part of a sentence.
        complete: whether that proves that they are all.
    """

    values: Vector
    proof: str
    complete: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class LoopBlock:
    """Loops that only numbers solve, mostly several that share unknown joints.

    Attributes:
        name: of the cut joints.
        indices: indices in q of what it gives.
        solve: all roots, from all positions, of which known ones are used, and p.
    """

    name: str
    indices: tuple[int, ...]
    solve: Callable[[Vector, Vector], Roots]


def branches_at(system: System, stages: Sequence[Stage], q: Vector, p: Vector) -> tuple[int, ...]:
    """The branches of all stages that lead to the closed configuration q; as far as they do.

    What a stage gives of cut joints is not in q: whether it fits is seen in later stages.
    """
    return branches_from(system, stages, started_at(system, q), q, p)


def started_at(system: System, q: Vector, known: Collection[int] | None = None) -> Vector:
    """All positions, the known ones as in the configuration q and the others zero.

    Args:
        system: whose positions they are.
        q: (nq,) the configuration.
        known: their places, those of the independent joints when left out.
    """
    start = np.zeros(extent(system))
    given = independent_indices(system) if known is None else known
    indices = [k for k in given if k < system.nq]
    start[indices] = q[indices]
    return start


def branches_from(
    system: System, stages: Sequence[Stage], start: Vector, q: Vector, p: Vector
) -> tuple[int, ...]:
    """The branches of all stages that lead to the closed configuration q; as far as they do.

    Args:
        system: whose loops they are.
        stages: in their order.
        start: all positions, the known ones as in q; spins are written into it.
        q: (nq,) the configuration.
        p: (np,) parameters.
    """
    if not stages:
        return ()
    stage, longest = stages[0], tuple[int, ...]()
    if stage.spin:
        index, angle = stage.spin
        start[index] = float(angle(np.concatenate([q, start[system.nq :]]), p))
    values = np.array(stage.values(start, p))
    for branch in range(len(stage.labels)):
        reached = start.copy()
        reached[list(stage.indices)] = values[:, branch]
        if _agree(system, stage.indices, reached, q):
            branches = (branch, *branches_from(system, stages[1:], reached, q, p))
            longest = max(longest, branches, key=len)
            if len(longest) == len(stages):
                break
    return longest


def every_configuration(
    stages: Sequence[Stage], q: Vector, p: Vector, branch: tuple[str, ...] = ()
) -> Iterator[tuple[Vector, tuple[str, ...]]]:
    """All positions and the labels of the branch, one loop after the other; NaN ends a branch.

    Args:
        stages: in their order.
        q: all positions, of which the known ones count.
        p: (np,) parameters.
        branch: labels so far.
    """
    if not stages:
        yield q, branch
        return
    stage, rest = stages[0], stages[1:]
    values = np.array(stage.values(q, p))
    for column, label in enumerate(stage.labels):
        if np.all(np.isfinite(values[:, column])):
            longer = q.copy()
            longer[list(stage.indices)] = values[:, column]
            yield from every_configuration(rest, longer, p, branch + ((label,) if label else ()))


def _agree(system: System, indices: Sequence[int], reached: Vector, q: Vector) -> bool:
    """Whether the positions of the tree are those of q, up to whole turns and signs."""
    gap = difference(system, reached[: system.nq], q)
    return bool(np.all(np.abs(gap[[k for k in indices if k < system.nq]]) < _NEAR))


# A plan compared with configurations: it must give them back, and none of its branches may leave
# loops open.
#
# Kernels use what must hold where a loop closes. In loops that move by their special measures
# alone that may not be enough: such a plan is refused, and a branch that never closes is left out.


_MOVE = 0.2
"""Of a random start from the assembled configuration [rad or m]: off alignments that it may have by
accident, and mostly not across to another branch."""
_CHECKS, _TRIES, _SEED = 3, 8, 20260104
"""Configurations beside the assembled one that are compared, from so many random starts."""


Start = Callable[[Vector], Vector]
"""All positions from a configuration (nq,), of which the known ones count."""


def verify(
    system: System, stages: Sequence[Stage], started: Start | None = None
) -> tuple[Stage, ...]:
    """The stages with the branches of the assembled configuration, which hold at others as well.

    Args:
        system: whose loops they are.
        stages: in their order.
        started: where the stages start from; from the independent joints when left out.

    Raises:
        NoClosedForm: a loop does not close so.
    """
    start = started or (lambda configuration: started_at(system, configuration))
    p = closure_parameters(system)
    configuration = np.array(system.configuration)
    nearby = Closing(system, p).nearby(configuration, _MOVE, _TRIES, _SEED)
    configurations = [configuration, *islice(nearby, _CHECKS)]
    branches = [branches_from(system, stages, start(q), q, p) for q in configurations]
    shortest = min(branches, key=len)
    if len(shortest) < len(stages):
        raise NoClosedForm(
            f"{system.name}: the loop of {stages[len(shortest)].name} does not close as the"
            " directions of its axes suggest; use mbs.loops.solve without branch"
        )
    chosen = [
        replace(stage, chosen=branch) for stage, branch in zip(stages, branches[0], strict=True)
    ]
    starts = [start(q) for q in configurations]
    return tuple(_without_open_branches(system, chosen, starts, p))


def _without_open_branches(
    system: System, stages: Sequence[Stage], starts: Sequence[Vector], p: Vector
) -> list[Stage]:
    result = list[Stage]()
    for number, stage in enumerate(stages):
        kept = [
            branch
            for branch in range(len(stage.labels))
            if branch == stage.chosen
            or any(_may_close(system, stages, number, branch, start, p) for start in starts)
        ]
        result.append(stage if len(kept) == len(stage.labels) else _only(stage, kept))
    return result


def _may_close(
    system: System, stages: Sequence[Stage], number: int, branch: int, start: Vector, p: Vector
) -> bool:
    """Whether another branch of one stage closes the loops or ends, the others as chosen."""
    reached = start.copy()
    for k, stage in enumerate(stages):
        values = np.array(stage.values(reached, p))
        reached[list(stage.indices)] = values[:, branch if k == number else stage.chosen]
    if not np.all(np.isfinite(reached)):
        return True
    return Closing(system, p).openness(reached[: system.nq]) < OPEN


def _only(stage: Stage, kept: Sequence[int]) -> Stage:
    """The stage with these branches alone."""
    q, p = (casadi.SX.sym(name, stage.values.size1_in(k)) for k, name in enumerate("qp"))
    values = Function("ways", [q, p], [stage.values(q, p)[:, list(kept)]])
    labels = tuple(stage.labels[branch] for branch in kept)
    return replace(stage, labels=labels, values=values, chosen=kept.index(stage.chosen))


# The loops of a system in the order in which they can be solved, and how each of them closes.
#
# A loop that shares unknown joints with others waits until these have been solved: their
# positions are known then.


def plan(system: System) -> tuple[Stage, ...]:
    """The loops and couplings of a system in an order in which each follows from those before.

    Raises:
        NoClosedForm: says which loop has none, and why.
        ModelError: `system` is not a System.
    """
    require_system(system)

    def build() -> tuple[Stage, ...]:
        return plan_from(system, independent_indices(system)) if system.closure else ()

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
        stages = order_stages(system, known, q)
        return verify(
            system, stages, lambda configuration: started_at(system, configuration, known)
        )

    stages: tuple[Stage, ...] = system.cached(("closed form from", *sorted(known)), build)
    return stages


@dataclass(slots=True)
class PlanWork:
    """What of a plan is solved so far.

    Attributes:
        system: whose loops they are.
        q: symbols of all positions.
        values: the same, with numbers for positions that turned out not to change.
        known: places of what is known.
        steps: in their order.
    """

    system: System
    q: SX
    values: SX
    known: set[int]
    steps: list[Stage | LoopBlock] = field(default_factory=list)

    def take(self, stage: Stage | LoopBlock) -> None:
        """Count what a step gives as known."""
        self.steps.append(stage)
        self.known |= set(stage.indices)
        if isinstance(stage, Stage) and len(stage.labels) == 1:
            p = self.system.p
            found = constants(stage.values(self.q, p), self.q, p)
            for index, number in zip(stage.indices, found, strict=True):
                if number is not None:
                    self.values[index] = number

    def ring(self, number: int) -> Ring:
        """The loop of a cut joint."""
        return ring_of(self.system, number, self.known, self.values)


def order_stages(system: System, known: Collection[int], q: SX) -> list[Stage]:
    """The stages in their order, not yet compared with configurations.

    Args:
        system: whose loops they are.
        known: places of the positions that are known.
        q: symbols of all positions.

    Raises:
        NoClosedForm: a loop cannot be solved, or no loop gives a position.
    """
    steps = order_steps(system, known, q, lambda work, waiting: None)
    return [step for step in steps if isinstance(step, Stage)]


Blocks = Callable[["PlanWork", Sequence[int]], LoopBlock | None]
"""A block among the loops that wait, by their numbers; None where there is none."""


def order_steps(
    system: System, known: Collection[int], q: SX, blocks: Blocks
) -> list[Stage | LoopBlock]:
    """Stages, and blocks where none of the loops that are left can be solved by itself.

    Args:
        system: whose loops they are.
        known: places of the positions that are known.
        q: symbols of all positions.
        blocks: finds a block.

    Raises:
        NoClosedForm: a loop cannot be solved, or no loop gives a position.
    """
    work = PlanWork(system, q, SX(q), set(known))
    binding = [part for part in system.parts if part.element.has("rows")]
    pending = list(range(len(system.cuts) + len(system.couplings) + len(binding)))
    reasons = dict[int, str]()
    while pending:
        before, waiting = len(work.steps), list[int]()
        for number in pending:
            outcome = _attempt(work, number)
            while isinstance(outcome, Stage):
                work.take(outcome)
                outcome = _attempt(work, number)
            if outcome is not None:
                waiting.append(number)
                reasons[number] = outcome
        if waiting and len(work.steps) == before:
            undetermined = _point_stage(work, waiting) or blocks(work, waiting)
            if undetermined is None:
                raise NoClosedForm(_refusal(system, waiting, reasons))
            work.take(undetermined)
        pending = waiting
    _require_all(system, work.known)
    return work.steps


def _attempt(work: PlanWork, number: int) -> Stage | str | None:
    """A loop, or a coupling, solved with what is known; why not; None where nothing is unknown."""
    system = work.system
    if number >= len(system.cuts) + len(system.couplings):
        return _bound_by_part(work, number - len(system.cuts) - len(system.couplings))
    if number >= len(system.cuts):
        return _coupling_stage(work, system.couplings[number - len(system.cuts)])
    cut = system.cuts[number]
    back, out = loop_links(system, cut)
    if all(system.tree.links[k].q.start in work.known for k in (*back, *out)):
        return None
    joint = cut.edge.joint
    if is_bound(system, number):
        return f"a {type(joint).__name__} closes it"
    root = closed_form(work.ring(number), work.q, system.p)
    return root if isinstance(root, str) else _stage(work, joint.name, root)


def _point_stage(work: PlanWork, waiting: Sequence[int]) -> Stage | None:
    """Slides that several loops share and the rigid links in these hold, if there are such."""
    system, groups = work.system, dict[frozenset[int], dict[int, Span]]()
    for number in waiting:
        if number < len(system.cuts) and not is_bound(system, number):
            for span in spans(work.ring(number), work.q, system.p):
                indices = prismatic_indices(span)
                if indices:
                    groups.setdefault(indices, {}).setdefault(number, span)
    for found in groups.values():
        numbers = independent_links(found, work.q, system.p)
        if numbers:
            name = system.cuts[numbers[-1]].edge.joint.name
            return _stage(work, name, point_on_links(name, [found[k] for k in numbers]))
    return None


def is_bound(system: System, number: int) -> bool:
    """Whether a loop has joints other than revolute, prismatic and spherical."""
    joint = system.cuts[number].edge.joint
    return isinstance(joint, Constraint) and not isinstance(joint, (PointOnLine, Rod))


def _bound_by_part(work: PlanWork, number: int) -> str | None:
    """Why the rows of a component have no closed form; None where nothing in them is unknown."""
    binding = [part for part in work.system.parts if part.element.has("rows")]
    part = binding[number]
    q = SX.sym("q", work.system.nq)
    rows = dict(part_rows(PartsAt(work.system, q)))[part.name]
    depends = casadi.which_depends(casadi.vertcat(*(row.value for _, row in rows)), q, 1, False)
    if all(k in work.known for k, felt in enumerate(depends) if felt):
        return None
    return f"the rows of a {type(part.element).__name__} bind it"


def _coupling_stage(work: PlanWork, coupling: CoordinateCoupling) -> Stage | str | None:
    if work.known.issuperset(coupling.coordinates):
        return None
    root = coupled_position(coupling, work.known, work.q)
    return root if isinstance(root, str) else _stage(work, coupling.name, root)


def _stage(work: PlanWork, name: str, root: LoopBranches) -> Stage:
    arguments, branches = [work.q, work.system.p], list(root.branches.values())
    indices = tuple(sorted(branches[0]))
    columns = [casadi.vertcat(*(branch[index] for index in indices)) for branch in branches]
    values = Function("ways", arguments, [casadi.densify(casadi.horzcat(*columns))])
    if root.spin is None:
        return Stage(name, indices, tuple(root.branches), values)
    angle = Function("spin", arguments, [root.spin.angle])
    return Stage(name, indices, tuple(root.branches), values, (root.spin.index, angle))


def _refusal(system: System, waiting: Sequence[int], reasons: dict[int, str]) -> str:
    names = [cut.edge.joint.name for cut in system.cuts]
    names += [coupling.name for coupling in system.couplings]
    names += [part.name for part in system.parts if part.element.has("rows")]
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


# Joints whose positions may be known together, and those that complete them.


_LOOSE = 1e-6
"""Rows of orthonormal directions of motion with singular values below this part of the largest do
not move by themselves: closing leaves 1e-12 times the condition of the loops in them."""
_KNOWN_TRIES, _KNOWN_SEED = 8, 20260106
"""Random starts of `regular_configuration`, each `_MOVE` from the assembled one at most."""


@dataclass(frozen=True, slots=True)
class Known:
    """Positions from which all others follow.

    Attributes:
        independent: those of the given joints that do not depend on each other.
        dependent: the others of them.
        undetermined: independent joints that nothing given determines.
    """

    independent: tuple[int, ...]
    dependent: tuple[int, ...] = ()
    undetermined: tuple[int, ...] = ()

    @property
    def indices(self) -> tuple[int, ...]:
        """What is known of q at the start."""
        return self.independent + self.undetermined


def complete(system: System, given: Sequence[int]) -> Known:
    """The given joints, and independent joints that the loops leave free beside them.

    Args:
        system: the assembled mechanism.
        given: indices in q of revolute and prismatic joints.

    Raises:
        NoClosedForm: spherical joints or free bodies beside them move in some of their ways only.
    """
    free = null_space(
        Closing(system, closure_parameters(system)).rows(regular_configuration(system))[1]
    )
    independent = _raising(free, given, ())
    dependent = tuple(k for k in given if k not in independent)
    return Known(independent, dependent, undetermined_beside(system, free, independent))


def undetermined_beside(system: System, free: Vector, first: tuple[int, ...]) -> tuple[int, ...]:
    """Joints that determine the rest: motors, other revolute and prismatic, then spherical ones.

    Args:
        system: the assembled mechanism.
        free: (nq, m) directions in which the positions can move.
        first: indices in q of what is known, independent.

    Raises:
        NoClosedForm: spherical joints or free bodies move in some of their ways only.
    """
    simple = [link for link in system.tree.links if link.motion.nq == 1]
    motors = [link.q.start for link in simple if link.v.start in system.free]
    others = [link.q.start for link in simple if link.q.start not in motors]
    undetermined = _raising(free, [*motors, *others], first)
    left = free.shape[1] - len(first) - len(undetermined) - len(spin_indices(system))
    loose = [link for link in system.tree.links if link.motion.nq > 1]
    for link in loose:
        indices = tuple(range(link.q.start, link.q.stop))
        if _gain(free, (*first, *undetermined), indices) == link.motion.nv:
            undetermined, left = (*undetermined, *indices), left - link.motion.nv
    if left > 0:
        names = ", ".join(link.name for link in loose)
        raise NoClosedForm(
            f"{system.name}: {names or 'a joint'} can move while all revolute and prismatic joints"
            " stay, in a way that no position tells; use mbs.loops.working_modes"
        )
    return undetermined


def _gain(free: Vector, taken: tuple[int, ...], indices: tuple[int, ...]) -> int:
    """How many more directions the positions tell."""
    return rank(free[[*taken, *indices]], _LOOSE) - (
        rank(free[list(taken)], _LOOSE) if taken else 0
    )


def regular_configuration(system: System) -> Vector:
    """A closed configuration near the assembled one, where nothing is aligned by accident."""
    configuration = np.array(system.configuration)
    closing = Closing(system, closure_parameters(system))
    return next(closing.nearby(configuration, _MOVE, _KNOWN_TRIES, _KNOWN_SEED), configuration)


def _raising(free: Vector, candidates: Sequence[int], first: tuple[int, ...]) -> tuple[int, ...]:
    """Of the candidates, in their order, those that are independent of what is there already."""
    taken = list(first)
    for k in candidates:
        if k not in taken and _gain(free, tuple(taken), (k,)):
            taken.append(k)
    return tuple(taken[len(first) :])


# The loops of a system solved where the pose of one frame is known.
#
# From the base through the tree to the frame, and back by its pose, leads one more loop.


_POSE = 7


@dataclass(frozen=True, slots=True, eq=False)
class Posed:
    """A plan that starts from the pose of a frame.

    Attributes:
        stages: in their order.
        size: how many positions there are, seven of the pose at their end.
        undetermined: indices in q of independent joints that the pose does not determine.
    """

    stages: tuple[Stage, ...]
    size: int
    undetermined: tuple[int, ...]

    def started(self, T: Vector, q: Vector) -> Vector:
        """All positions, with those of the pose T (4, 4) and, as in q (nq,), the undetermined."""
        start = np.zeros(self.size)
        start[list(self.undetermined)] = q[list(self.undetermined)]
        start[-_POSE:-4] = T[:3, 3]
        start[-4:] = _quaternion(T[:3, :3])
        return start


def plan_to(system: System, frame: str | int) -> Posed:
    """The plan for a frame whose pose is known.

    Args:
        system: the assembled mechanism, with loops.
        frame: a body, a named frame, or the number of a link.

    Raises:
        NoClosedForm: says which loop has none, and why.
        ModelError: there is no such frame.
    """
    made: Posed = system.cached(("closed form to", frame), lambda: _plan_to(system, frame))
    return made


def _plan_to(system: System, frame: str | int) -> Posed:
    number, pose = system.frame(frame)
    welded = replace(system, cuts=(*system.cuts, _weld(number, pose, Pose.identity())), _cache={})
    first = extent(welded)
    q = SX.sym("q", first + _POSE)
    goal = system.frame("base")[1] @ free_pose(q[first:])
    cuts = (*system.cuts, _weld(number, pose, goal))
    welded = replace(system, cuts=cuts, _cache={})
    at = _pose_and_slope(system, frame)
    p = closure_parameters(system)
    undetermined = _pose_locked(system, at, p)
    known = {*undetermined, *spin_indices(welded).values(), *range(first, first + _POSE)}
    plan = Posed(tuple(order_stages(welded, known, q)), first + _POSE, undetermined)

    def started(configuration: Vector) -> Vector:
        return plan.started(np.array(at(configuration, p)[0]), configuration)

    return replace(plan, stages=verify(system, plan.stages, started))


@dataclass(frozen=True, slots=True, eq=False)
class PosedStages:
    """Stages that give the rest from some positions and the pose of a link.

    Attributes:
        stages: in their order.
        extent: how many positions there are, seven of the pose at their end.
        chosen: the branch of each stage in which the system was assembled.
    """

    stages: list[Stage]
    extent: int
    chosen: tuple[int, ...]


def posed_stages(system: System, link: int, known: Collection[int]) -> PosedStages | None:
    """How the loops follow from known positions and the pose of a link; None where they do not.

    Args:
        system: the assembled mechanism, with loops.
        link: whose pose in the base link's frame is known.
        known: indices in q.
    """
    weld = _weld(link, Pose.identity(), Pose.identity())
    first = extent(replace(system, cuts=(*system.cuts, weld), _cache={}))
    q = SX.sym("q", first + _POSE)
    cuts = (*system.cuts, _weld(link, Pose.identity(), free_pose(q[first:])))
    welded = replace(system, cuts=cuts, _cache={})
    places = {*known, *spin_indices(welded).values(), *range(first, first + _POSE)}
    try:
        stages = order_stages(welded, places, q)
    except NoClosedForm:
        return None
    configuration, p = np.array(system.configuration), closure_parameters(system)
    symbols = SX.sym("q", system.nq)
    at = relative_pose(system.tree, symbols, (-1, Pose.identity()), (link, Pose.identity()))
    T = np.array(
        Function("pose", [symbols, system.p], [casadi.densify(at.matrix)])(configuration, p)
    )
    start = np.zeros(first + _POSE)
    start[list(known)] = configuration[list(known)]
    start[first : first + 3], start[first + 3 :] = T[:3, 3], _quaternion(T[:3, :3])
    chosen = branches_from(system, stages, start, configuration, p)
    return PosedStages(stages, first + _POSE, chosen) if len(chosen) == len(stages) else None


def _weld(link: int, pose: Pose, goal: Pose) -> Cut:
    joint = Edge(Fixed("pose"), 0, 0, Pose.identity(), Pose.identity(), None)
    return Cut(joint, -1, link, goal, pose, True)


def _pose_locked(system: System, at: Function, p: Vector) -> tuple[int, ...]:
    """Independent joints that move while the frame stays."""
    q = regular_configuration(system)
    rows = np.vstack([Closing(system, p).rows(q)[1], np.array(at(q, p)[1])])
    return undetermined_beside(system, null_space(rows), ())


def _pose_and_slope(system: System, frame: str | int) -> Function:
    q = SX.sym("q", system.nq)
    T = relative_pose(system.tree, q, system.frame("base"), system.frame(frame)).matrix
    slope = casadi.jacobian(casadi.vec(T), q)
    return Function("pose", [q, system.p], [casadi.densify(T), casadi.densify(slope)])


def _quaternion(R: Vector) -> Vector:
    matrix = SX.sym("R", 3, 3)
    return np.array(Function("quaternion", [matrix], [unit_quaternion(matrix)])(DM(R))).ravel()
