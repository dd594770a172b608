"""Plan that solves the loops of a mechanism joint by joint without iteration, stage by stage.

For each unsolved loop, `order_steps` forms the cyclic chain of its unknown joints, with the known
joints inside the fixed transforms between them. `mbs.closed_forms.kernels` finds a closed form if
one exists. `verify` tests a plan at configurations. `complete` returns joints that determine the
others. A `Posed` plan starts from the known pose of a frame.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.graph import JointEdge
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
from mbs.closed_forms.roots import LoopBranches, Roots
from mbs.closed_forms.spatial import (
    RigidLink,
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

# Steps of a plan, and the branches of a plan that result in a given configuration.


_NEAR = 1e-5
"""Largest difference of positions [rad or m] between a branch and its configuration: at 1e-12 of
closure, a configuration where two branches meet is accurate to the square root, 1e-6."""


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One loop or one coupling, solved in closed form for some of its unknown positions.

    Attributes:
        name: name of the cut joint or of the coupling.
        indices: indices in q of the solved positions. Indices from nq on belong to cut joints.
        labels: labels of the branches; one empty label for a single branch.
        values: Function of q (with the positions of cut joints) and p. Its output has one row per
            index and one column per branch. It uses only known positions.
        spin: index of the rod spin on which the branches depend, and the Function of q and p that
            computes it from a known quaternion. None if there is no such spin.
        chosen: index of the branch in which the system was assembled.
    """

    name: str
    indices: tuple[int, ...]
    labels: tuple[str, ...]
    values: Function
    spin: tuple[int, Function] | None = None
    chosen: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class LoopBlock:
    """Loops that only a numerical method solves, mostly several loops that share unknown joints.

    Attributes:
        name: names of the cut joints.
        indices: indices in q of the solved positions.
        solve: callable (all positions, p) -> all solutions. It uses only the known positions.
    """

    name: str
    indices: tuple[int, ...]
    solve: Callable[[Vector, Vector], Roots]


def branches_at(system: System, stages: Sequence[Stage], q: Vector, p: Vector) -> tuple[int, ...]:
    """Return the branch of each stage that results in a closed configuration.

    The tuple is shorter than `stages` if no sequence of branches results in it. The positions of
    cut joints are not in q. Later stages show whether these positions fit.

    Args:
        system: mechanism with the loops.
        stages: stages in their order of solution.
        q: (nq,) closed configuration.
        p: (np,) parameters.
    """
    return branches_from(system, stages, started_at(system, q), q, p)


def started_at(system: System, q: Vector, known: Collection[int] | None = None) -> Vector:
    """Return a vector of all positions, with known elements from q (nq,) and zeros elsewhere.

    Args:
        system: mechanism with the positions.
        q: (nq,) configuration.
        known: indices of the known positions. The default is the independent joints.
    """
    start = np.zeros(extent(system))
    given = independent_indices(system) if known is None else known
    indices = [k for k in given if k < system.nq]
    start[indices] = q[indices]
    return start


def branches_from(
    system: System, stages: Sequence[Stage], start: Vector, q: Vector, p: Vector
) -> tuple[int, ...]:
    """Return the branch of each stage that results in q, as far as branches agree with q.

    Args:
        system: mechanism with the loops.
        stages: stages in their order of solution.
        start: all positions. The known ones are equal to those of q. Spins are written into it.
        q: (nq,) closed configuration.
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
    """Yield all positions and the branch labels of each configuration; skip branches with NaN.

    Args:
        stages: stages in their order of solution.
        q: all positions. Only the known ones are used.
        p: (np,) parameters.
        branch: labels of the branches of earlier stages.
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
    """Whether positions `indices` of `reached` and q are equal, up to full rotations.

    Signs of quaternions and positions of cut joints do not count.
    """
    gap = difference(system, reached[: system.nq], q)
    return bool(np.all(np.abs(gap[[k for k in indices if k < system.nq]]) < _NEAR))


# Test of a plan at configurations: the plan must reproduce them, and its branches must close all
# loops.
#
# Kernels use necessary conditions of closure. In loops that move only because of special dimensions
# these may not suffice. Then the plan is rejected, or a branch that never closes is dropped.


_MOVE = 0.2
"""Largest difference of a random start from the assembled configuration [rad or m]: enough to leave
accidental alignments, and in most cases not enough to reach another branch."""
_CHECKS, _TRIES, _SEED = 3, 8, 20260104
"""Number of tested configurations in addition to the assembled one, number of random starts to find
them, and seed of the random numbers."""


Start = Callable[[Vector], Vector]
"""Callable: configuration (nq,) -> all positions, of which a plan uses only the known ones."""


def verify(
    system: System, stages: Sequence[Stage], started: Start | None = None
) -> tuple[Stage, ...]:
    """Return the stages with the branches of the assembled configuration, tested at others too.

    Args:
        system: mechanism with the loops.
        stages: stages in their order of solution.
        started: callable from a configuration to the positions that the first stage starts from.
            The default uses the independent joints.

    Raises:
        NoClosedForm: the stages do not reproduce a closed configuration.
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
    """Return the stages without branches that close the loops at no tested start."""
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
    """Whether the loops close if stage `number` uses `branch` and all others the assembled branch.

    `start` are all positions before the first stage, p (np,) the parameters. True also if the
    positions have NaN.
    """
    reached = start.copy()
    for k, stage in enumerate(stages):
        values = np.array(stage.values(reached, p))
        reached[list(stage.indices)] = values[:, branch if k == number else stage.chosen]
    if not np.all(np.isfinite(reached)):
        return True
    return Closing(system, p).openness(reached[: system.nq]) < OPEN


def _only(stage: Stage, kept: Sequence[int]) -> Stage:
    """Return the stage with only the branches whose indices are in `kept`."""
    q, p = (casadi.SX.sym(name, stage.values.size1_in(k)) for k, name in enumerate("qp"))
    values = Function("ways", [q, p], [stage.values(q, p)[:, list(kept)]])
    labels = tuple(stage.labels[branch] for branch in kept)
    return replace(stage, labels=labels, values=values, chosen=kept.index(stage.chosen))


# Order in which the loops of a system can be solved, and the closed form of each loop.
#
# A loop that shares unknown joints with other loops is solved after them, when these joints are
# known.


def plan(system: System) -> tuple[Stage, ...]:
    """Return the loops and couplings of a system in an order of solution from independent joints.

    Args:
        system: assembled mechanism.

    Raises:
        NoClosedForm: a loop has no closed form. The message contains its name and the reason.
        ModelError: `system` is not a System.
    """
    require_system(system)

    def build() -> tuple[Stage, ...]:
        return plan_from(system, independent_indices(system)) if system.closure else ()

    stages: tuple[Stage, ...] = system.cached("closed form", build)
    return stages


def plan_from(system: System, known: Collection[int]) -> tuple[Stage, ...]:
    """Return the loops and couplings in an order of solution from given known positions.

    Args:
        system: assembled mechanism with loops.
        known: indices of the known positions.

    Raises:
        NoClosedForm: a loop has no closed form. The message contains its name and the reason.
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
    """State of a plan during its construction.

    Attributes:
        system: mechanism with the loops.
        q: symbols of all positions.
        values: same symbols, with a number for each position that turned out to be constant.
        known: indices of the known positions.
        steps: stages and blocks found so far, in their order of solution.
    """

    system: System
    q: SX
    values: SX
    known: set[int]
    steps: list[Stage | LoopBlock] = field(default_factory=list)

    def take(self, stage: Stage | LoopBlock) -> None:
        """Append a step and mark its positions as known.

        Args:
            stage: closed form of a loop, or numerical block.
        """
        self.steps.append(stage)
        self.known |= set(stage.indices)
        if isinstance(stage, Stage) and len(stage.labels) == 1:
            p = self.system.p
            found = constants(stage.values(self.q, p), self.q, p)
            for index, number in zip(stage.indices, found, strict=True):
                if number is not None:
                    self.values[index] = number

    def ring(self, number: int) -> Ring:
        """Return the cyclic chain of the unknown joints in a loop.

        Args:
            number: index of the cut joint of the loop.
        """
        return ring_of(self.system, number, self.known, self.values)


def order_stages(system: System, known: Collection[int], q: SX) -> list[Stage]:
    """Return the stages in their order of solution, without a test at configurations.

    Args:
        system: mechanism with the loops.
        known: indices of the known positions.
        q: symbols of all positions.

    Raises:
        NoClosedForm: a loop has no closed form, or no loop determines a position.
    """
    steps = order_steps(system, known, q, lambda work, waiting: None)
    return [step for step in steps if isinstance(step, Stage)]


Blocks = Callable[["PlanWork", Sequence[int]], LoopBlock | None]
"""Callable: (state of the plan, indices of unsolved loops) -> block of some of them, or None."""


def order_steps(
    system: System, known: Collection[int], q: SX, blocks: Blocks
) -> list[Stage | LoopBlock]:
    """Return the stages in order, and a block whenever no remaining loop can be solved by itself.

    Args:
        system: mechanism with the loops.
        known: indices of the known positions.
        q: symbols of all positions.
        blocks: callable that finds a block among the unsolved loops.

    Raises:
        NoClosedForm: a loop can be solved neither alone nor in a block, or no loop determines a
            position.
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
    """Return the closed form of a loop, coupling or component, or the reason why there is none.

    None if all its positions are known already.

    Args:
        work: state of the plan.
        number: index among cut joints, then couplings, then components with constraints.
    """
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
    """Return a stage of prismatic displacements that links of several loops determine, or None."""
    system, groups = work.system, dict[frozenset[int], dict[int, RigidLink]]()
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
    """Whether a loop is closed by a constraint other than a rod or a point on a line.

    Args:
        system: mechanism with loops.
        number: index of the cut joint of the loop.
    """
    joint = system.cuts[number].edge.joint
    return isinstance(joint, Constraint) and not isinstance(joint, (PointOnLine, Rod))


def _bound_by_part(work: PlanWork, number: int) -> str | None:
    """Return why a component with constraint rows has no closed form; None if all is known."""
    binding = [part for part in work.system.parts if part.element.has("rows")]
    part = binding[number]
    q = SX.sym("q", work.system.nq)
    rows = dict(part_rows(PartsAt(work.system, q)))[part.name]
    depends = casadi.which_depends(casadi.vertcat(*(row.value for _, row in rows)), q, 1, False)
    if all(k in work.known for k, felt in enumerate(depends) if felt):
        return None
    return f"the rows of a {type(part.element).__name__} bind it"


def _coupling_stage(work: PlanWork, coupling: CoordinateCoupling) -> Stage | str | None:
    """Return the stage of a coupling, why it has none, or None if all its positions are known."""
    if work.known.issuperset(coupling.coordinates):
        return None
    root = coupled_position(coupling, work.known, work.q)
    return root if isinstance(root, str) else _stage(work, coupling.name, root)


def _stage(work: PlanWork, name: str, root: LoopBranches) -> Stage:
    """Return a stage from the closed form `root` of the loop or coupling `name`."""
    arguments, branches = [work.q, work.system.p], list(root.branches.values())
    indices = tuple(sorted(branches[0]))
    columns = [casadi.vertcat(*(branch[index] for index in indices)) for branch in branches]
    values = Function("ways", arguments, [casadi.densify(casadi.horzcat(*columns))])
    if root.spin is None:
        return Stage(name, indices, tuple(root.branches), values)
    angle = Function("spin", arguments, [root.spin.angle])
    return Stage(name, indices, tuple(root.branches), values, (root.spin.index, angle))


def _refusal(system: System, waiting: Sequence[int], reasons: dict[int, str]) -> str:
    """Return the error message for loops without closed form.

    Args:
        system: mechanism with loops.
        waiting: indices of the unsolved loops, couplings and components.
        reasons: reason for each of them.
    """
    names = [cut.edge.joint.name for cut in system.cuts]
    names += [coupling.name for coupling in system.couplings]
    names += [part.name for part in system.parts if part.element.has("rows")]
    first = waiting[0]
    return (
        f"{system.name}: the loop of {names[first]} has no closed form known here,"
        f" {reasons[first]}; use mbs.loops.solve without branch"
    )


def _require_all(system: System, known: set[int]) -> None:
    """Raise NoClosedForm if a position of q is not known (`known` are indices in q)."""
    for k, coordinate in enumerate(system.coordinates):
        if k not in known:
            raise NoClosedForm(
                f"{system.name}: no loop gives {coordinate.name}; use mbs.loops.solve without"
                " branch"
            )


# Sets of joints that determine all other positions.


_LOOSE = 1e-6
"""Relative singular value below which rows of an orthonormal basis of motions are dependent:
closing to 1e-12 leaves an error of 1e-12 times the condition number of the loops in the rows."""
_KNOWN_TRIES, _KNOWN_SEED = 8, 20260106
"""Number of random starts of `regular_configuration`, at most `_MOVE` from assembly, and seed."""


@dataclass(frozen=True, slots=True)
class Known:
    """Positions that determine all other positions.

    Attributes:
        independent: given joints that are independent of each other.
        dependent: given joints that depend on the independent ones.
        undetermined: further independent joints that the given joints do not determine.
    """

    independent: tuple[int, ...]
    dependent: tuple[int, ...] = ()
    undetermined: tuple[int, ...] = ()

    @property
    def indices(self) -> tuple[int, ...]:
        """Indices in q of the positions that are known at the start."""
        return self.independent + self.undetermined


def complete(system: System, given: Sequence[int]) -> Known:
    """Split given joints into independent and dependent joints, and add joints that are missing.

    Together, the independent and the added joints determine all positions.

    Args:
        system: assembled mechanism.
        given: indices in q of revolute and prismatic joints.

    Raises:
        NoClosedForm: a spherical joint or a free body keeps some, but not all of its freedoms.
    """
    free = null_space(
        Closing(system, closure_parameters(system)).rows(regular_configuration(system))[1]
    )
    independent = _raising(free, given, ())
    dependent = tuple(k for k in given if k not in independent)
    return Known(independent, dependent, undetermined_beside(system, free, independent))


def undetermined_beside(system: System, free: Vector, first: tuple[int, ...]) -> tuple[int, ...]:
    """Return indices in q of further joints that, with known joints, determine all positions.

    Motors are preferred, then other revolute and prismatic joints, then joints of several freedoms.

    Args:
        system: assembled mechanism.
        free: (nq, m) basis of the directions in which the positions can move.
        first: indices in q of independent known positions.

    Raises:
        NoClosedForm: a spherical joint or a free body keeps some, but not all of its freedoms.
    """
    simple = [link for link in system.tree.links if link.motion.nq == 1]
    motors = [link.q.start for link in simple if link.v.start in system.chosen_coordinates]
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
    """Return the increase of the rank of the rows of `free` if rows `indices` join rows `taken`."""
    return rank(free[[*taken, *indices]], _LOOSE) - (
        rank(free[list(taken)], _LOOSE) if taken else 0
    )


def regular_configuration(system: System) -> Vector:
    """Return a closed configuration (nq,) near the assembled one, without accidental alignments.

    Args:
        system: mechanism with closed loops.
    """
    configuration = np.array(system.configuration)
    closing = Closing(system, closure_parameters(system))
    return next(closing.nearby(configuration, _MOVE, _KNOWN_TRIES, _KNOWN_SEED), configuration)


def _raising(free: Vector, candidates: Sequence[int], first: tuple[int, ...]) -> tuple[int, ...]:
    """Return the candidates that are independent of joints `first` and of each other, in order.

    Args:
        free: (nq, m) basis of the directions in which the positions can move.
        candidates: indices in q.
        first: indices in q of independent joints.
    """
    taken = list(first)
    for k in candidates:
        if k not in taken and _gain(free, tuple(taken), (k,)):
            taken.append(k)
    return tuple(taken[len(first) :])


# Closed forms from the known pose of one frame.
#
# The path from the base through the tree to the frame, and back by its pose, is one more loop.


_POSE = 7


@dataclass(frozen=True, slots=True, eq=False)
class Posed:
    """Plan that starts from the pose of a frame.

    Attributes:
        stages: stages in their order of solution.
        size: number of positions, with the seven of the pose (p, quaternion) as the last ones.
        undetermined: indices in q of independent joints that the pose does not determine.
    """

    stages: tuple[Stage, ...]
    size: int
    undetermined: tuple[int, ...]

    def started(self, T: Vector, q: Vector) -> Vector:
        """Return all positions at the start of the plan.

        Args:
            T: (4, 4) pose of the frame.
            q: (nq,) configuration, of which only the undetermined joints count.
        """
        start = np.zeros(self.size)
        start[list(self.undetermined)] = q[list(self.undetermined)]
        start[-_POSE:-4] = T[:3, 3]
        start[-4:] = _quaternion(T[:3, :3])
        return start


def plan_to(system: System, frame: str | int) -> Posed:
    """Return the plan that computes all positions from the pose of a frame.

    Args:
        system: assembled mechanism with loops.
        frame: name of a body, name of a frame, or index of a link.

    Raises:
        NoClosedForm: a loop has no closed form. The message contains its name and the reason.
        ModelError: the system has no such frame.
    """
    made: Posed = system.cached(("closed form to", frame), lambda: _plan_to(system, frame))
    return made


def _plan_to(system: System, frame: str | int) -> Posed:
    """Return the plan from the pose of a frame to all positions; implementation of `plan_to`."""
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
    """Stages that compute all positions from known positions and the pose of a link.

    Attributes:
        stages: stages in their order of solution.
        extent: number of positions, with the seven of the pose (p, quaternion) as the last ones.
        chosen: branch of each stage in which the system was assembled.
    """

    stages: list[Stage]
    extent: int
    chosen: tuple[int, ...]


def posed_stages(system: System, link: int, known: Collection[int]) -> PosedStages | None:
    """Return stages from known positions and the pose of a link; None if the loops have none.

    Args:
        system: assembled mechanism with loops.
        link: index of the link whose pose in the frame of the base link is known.
        known: indices in q of the known positions.
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
    """Return a rigid cut joint between frame `pose` of a link and frame `goal` of the base."""
    joint = JointEdge(Fixed("pose"), 0, 0, Pose.identity(), Pose.identity(), None)
    return Cut(joint, -1, link, goal, pose, True)


def _pose_locked(system: System, at: Function, p: Vector) -> tuple[int, ...]:
    """Return indices in q of independent joints that can move while the frame is at rest.

    `at` is the Function of the pose and its slope, p (np,) are the parameters.
    """
    q = regular_configuration(system)
    rows = np.vstack([Closing(system, p).rows(q)[1], np.array(at(q, p)[1])])
    return undetermined_beside(system, null_space(rows), ())


def _pose_and_slope(system: System, frame: str | int) -> Function:
    """Return ``pose(q, p) -> T, dT``: pose (4, 4) of a frame in the base, and its derivative."""
    q = SX.sym("q", system.nq)
    T = relative_pose(system.tree, q, system.frame("base"), system.frame(frame)).matrix
    slope = casadi.jacobian(casadi.vec(T), q)
    return Function("pose", [q, system.p], [casadi.densify(T), casadi.densify(slope)])


def _quaternion(R: Vector) -> Vector:
    """Return the unit quaternion (4,) of a rotation matrix (3, 3)."""
    matrix = SX.sym("R", 3, 3)
    return np.array(Function("quaternion", [matrix], [unit_quaternion(matrix)])(DM(R))).ravel()
