"""Paul's method as a search: at each stage, the simplest equation of all splits is solved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import casadi
import numpy as np
from casadi import SX

from mbs.closed_forms.paul.eliminated import eliminated
from mbs.closed_forms.paul.equation import PRODUCTS, equations, ring_matrices
from mbs.closed_forms.paul.linear import linear
from mbs.closed_forms.paul.one_unknown import Candidate, PaulStage, one_unknown
from mbs.closed_forms.paul.splits import KnownFrames, Variable, nothing_known
from mbs.closed_forms.paul.two_unknowns import two_unknowns
from mbs.closed_forms.sequence import ZERO, Found, Problem, SequenceStep, StepSequence, step
from mbs.components.joints import Motion
from mbs.errors import NoClosedForm
from mbs.recursions.chain import Gap, Ring
from mbs.spatial import Pose, vector

# Last unknown angle of a known sum.


def sums(stage: PaulStage) -> Iterator[Candidate]:
    """Yield steps that determine a single angle from known sums of angles.

    Known angles, or another known sum, are subtracted from a known sum.

    Args:
        stage: known quantities and equations.

    A step is an explicit formula for one or more unknown joint positions.
    """
    for rest, value, text in _isolated_angles(stage):

        def build(rest: Variable = rest, value: SX = value, text: str = text) -> SequenceStep:
            turns = casadi.floor((value + casadi.pi) / (2 * casadi.pi))
            found = Found({stage.knowledge.index(rest): SX(value - 2 * casadi.pi * turns)})
            return step(stage.knowledge.problem, "sum", text, {}, found)

        yield Candidate((0.0,), (rest,), build)


def _isolated_angles(stage: PaulStage) -> Iterator[tuple[Variable, SX, str]]:
    """Yield each single angle that known sums determine, its value, and the equation.

    `stage` contains the known sums of angles. The equation is text, such as "q2+q3 = x6".
    """
    knowledge = stage.knowledge
    opened = [
        (rest, value, f"{stage.term(whole)} = {knowledge.problem.x[index]}")
        for (rest, value, _), (whole, index) in zip(
            knowledge.open_sums(), knowledge.sums, strict=True
        )
    ]
    yield from (own for own in opened if own[0].single)
    for (first, a, text), (second, b, other) in combinations(opened, 2):
        for sense in (1, -1):
            rest = _combined_signs(first, second, sense)
            if len(rest) == 1:
                ((k, sign),) = rest.items()
                value = SX(a + sense * b) / sign
                yield _joint_variable(knowledge, k), value, f"{text}, {other}"


def _joint_variable(knowledge: KnownFrames, k: int) -> Variable:
    """Return the variable of joint k: its angle or its displacement."""
    return Variable(not knowledge.ring.joints[k].is_rotational, ((k, 1),))


def _combined_signs(first: Variable, second: Variable, sense: int) -> dict[int, int]:
    """Return the signs of the joints in the sum first + sense * second, by joint index.

    Empty if a coefficient is not 1 or -1.
    """
    total = dict(first.members)
    for k, sign in second.members:
        total[k] = total.get(k, 0) + sense * sign
    return (
        {k: sign for k, sign in total.items() if sign in (1, -1)}
        if _has_unit_coefficients(total)
        else {}
    )


def _has_unit_coefficients(total: dict[int, int]) -> bool:
    """Whether all values of `total`, coefficients by joint index, are -1, 0 or 1."""
    return all(abs(sign) <= 1 for sign in total.values())


# Frame origins of a loop where neighbouring axes are nearest to each other.
#
# Intersections of axes are then frame origins, for any description of the loop.
#
# Source: Khalil & Kleinfinger 1986, whose frames have these origins.


def at_feet(problem: Problem) -> Ring:
    """Return the loop of a problem, with the frame of each revolute joint moved along its axis.

    The new origin is the foot of the common normal with the next axis. The first transform of the
    loop, which contains the known pose, is not used for this.

    Args:
        problem: loop and samples.
    """
    ring = problem.ring
    for k in range(len(ring.joints) - 1):
        here, after = ring.joints[k], ring.joints[k + 1]
        if here.is_rotational and after.is_rotational and not ring.gaps[k + 1].pivots:
            ring = _with_moved_frame(problem, ring, k)
    return ring


def _with_moved_frame(problem: Problem, ring: Ring, k: int) -> Ring:
    """Return the loop with the origin of joint k at the foot of the normal to the next axis.

    The same object is returned if the axes are parallel or the origin is there already.

    `problem` gives the samples at which the axes of `ring` are compared.
    """
    pose = ring.gaps[k + 1].pose
    axis, cosine = pose.R[:, 2], pose.R[2, 2]
    sine2 = axis[0] ** 2 + axis[1] ** 2
    across = pose.p[2] * sine2 - (pose.p[0] * axis[0] + pose.p[1] * axis[1]) * cosine
    values = np.array(problem.at_samples(casadi.vertcat(sine2, across)))
    if np.max(np.abs(values[:, 1])) < ZERO or np.min(np.abs(values[:, 0])) < ZERO:
        return ring
    along = SX(across / sine2)
    to, back = (Gap(Pose.translation(vector([0, 0, sign * along]))) for sign in (1, -1))
    gaps = list(ring.gaps)
    gaps[k] = to.after(gaps[k])
    gaps[k + 1] = gaps[k + 1].after(back)
    return replace(ring, gaps=tuple(gaps))


_KERNELS = ((sums, linear, one_unknown), (eliminated, two_unknowns))
_CHOICES = 8
_SIMPLE = (Motion.REVOLUTE, Motion.PRISMATIC)


def paul(problem: Problem) -> StepSequence:
    """Return a solution of a loop, joint by joint, from equations with few unknowns.

    All splits of the loop are considered. The samples show which equations hold and which terms
    they have. The cheapest equation is built symbolically, its joints become known, and the search
    starts again. Equations with one root come first, then those with two roots, then with four.

    Source: Paul 1981, section 3.7; Khalil & Dombre 2002, section 4.4.

    Args:
        problem: loop with its symbols, which are kept.

    Returns:
        Steps. All configurations that close the loop are among its leaves. Some of
        the leaves may not close it.

    Raises:
        NoClosedForm: no supported equation solves the remaining joints. The message names them.
    """
    _require_simple(problem)
    knowledge = nothing_known(problem, at_feet(problem))
    loop, steps = ring_matrices(knowledge.ring), list[SequenceStep]()
    while knowledge.unknown:
        stage = PaulStage(knowledge, loop, equations(knowledge))
        candidate = _cheapest(stage)
        if candidate is None and knowledge.sums:
            stage = PaulStage(knowledge, loop, equations(knowledge, PRODUCTS + 1))
            candidate = _cheapest(stage)
        if candidate is None:
            raise NoClosedForm(_refusal(stage, steps))
        step, variables = candidate
        steps.append(step)
        for variable in variables:
            knowledge = knowledge.with_joint(variable)
    return StepSequence(problem.size, tuple(steps))


def _cheapest(stage: PaulStage) -> tuple[SequenceStep, tuple[Variable, ...]] | None:
    """Return the step with the fewest operations among the candidates of the lowest rank.

    The second result is the variables that it solves. None if there is no candidate.

    `stage` contains the known quantities and the equations.
    """
    for kernels in _KERNELS:
        every = [
            candidate
            for kernel in kernels
            for candidate in kernel(stage)
            if all(stage.knowledge.can_hold(variable) for variable in candidate.variables)
        ]
        if every:
            every.sort(key=lambda candidate: candidate.rank)
            equal = [own for own in every if own.rank[:2] == every[0].rank[:2]][:_CHOICES]
            built = [(own.build(), own.variables) for own in equal]
            return min(built, key=lambda own: own[0].function.n_instructions())
    return None


def _require_simple(problem: Problem) -> None:
    """Raise NoClosedForm for a joint that is not revolute or prismatic, or has no index."""
    for joint in problem.ring.joints:
        if joint.motion not in _SIMPLE or joint.index is None:
            raise NoClosedForm(
                f"joint {joint.name} is {joint.motion.name.lower()}, and Paul's method knows"
                " revolute and prismatic joints"
            )


def _refusal(stage: PaulStage, steps: Sequence[SequenceStep]) -> str:
    """Return an error message with the unsolved joints and the equations that contain them.

    `stage` is the last stage of the search, `steps` the steps that were found.
    """
    knowledge = stage.knowledge
    left = ", ".join(knowledge.ring.joints[k].name for k in knowledge.unknown)
    given = ", ".join(name for step in steps for name in step.names)
    after = f" once {given} are known" if given else ""
    return f"no equation gives {left}{after}: {_simplest_text(stage)}"


def _simplest_text(stage: PaulStage) -> str:
    """Return text with the unknowns of the simplest equations that no solution type fits."""
    if not stage.equations:
        return "every equation of every split of the loop has more than two unknowns"
    groups = dict.fromkeys(
        " and ".join(stage.term(variable) for variable in equation.variables)
        for equation in sorted(stage.equations, key=lambda e: (len(e.variables), e.cost))
    )
    shown = "; ".join(list(groups)[:3])
    return f"the simplest equations of all splits of the loop, in {shown}, fit no type of equation"
