"""Paul's method as a search: at every stage the simplest equation that some split offers."""

from __future__ import annotations

from collections.abc import Sequence as Steps

from mbs.components.motion import Motion
from mbs.errors import NoClosedForm
from mbs.loops.paul.candidate import Stage
from mbs.loops.paul.coefficients import ways
from mbs.loops.paul.eliminated import eliminated
from mbs.loops.paul.equation import PRODUCTS, equations
from mbs.loops.paul.feet import at_feet
from mbs.loops.paul.knowledge import Variable, beginning
from mbs.loops.paul.linear import linear
from mbs.loops.paul.one_unknown import one_unknown
from mbs.loops.paul.sums import sums
from mbs.loops.paul.two_unknowns import two_unknowns
from mbs.loops.sequence import Problem, Sequence, Step

_KERNELS = ((sums, linear, one_unknown), (eliminated, two_unknowns))
_CHOICES = 8
_SIMPLE = (Motion.REVOLUTE, Motion.PRISMATIC)


def paul(problem: Problem) -> Sequence:
    """The joints of a loop, one after the other, by equations of few unknowns.

    The loop is split in every way. Which equations hold, and what stands in them, is read off at
    the samples; the cheapest one is then built in symbols, its joints are known from there on, and
    the search begins again. Equations with one root come first, then those with two, with four.

    Source: Paul 1981, section 3.7; Khalil & Dombre 2002, section 4.4.

    Args:
        problem: the loop. Its symbols stay symbols.

    Returns:
        Sequence of the steps. Every posture that closes the loop is among its leaves, some of which
        may not close it.

    Raises:
        NoClosedForm: no equation known here gives the joints that are left; names them.
    """
    _require_simple(problem)
    knowledge = beginning(problem, at_feet(problem))
    loop, steps = ways(knowledge), list[Step]()
    while knowledge.unknown:
        stage = Stage(knowledge, loop, equations(knowledge))
        candidate = _cheapest(stage)
        if candidate is None and knowledge.sums:
            stage = Stage(knowledge, loop, equations(knowledge, PRODUCTS + 1))
            candidate = _cheapest(stage)
        if candidate is None:
            raise NoClosedForm(_refusal(stage, steps))
        step, variables = candidate
        steps.append(step)
        for variable in variables:
            knowledge = knowledge.with_joint(variable)
    return Sequence(problem.size, tuple(steps))


def _cheapest(stage: Stage) -> tuple[Step, tuple[Variable, ...]] | None:
    """The step of the fewest operations among the first of the simplest kind."""
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
    for joint in problem.ring.joints:
        if joint.motion not in _SIMPLE or joint.place is None:
            raise NoClosedForm(
                f"joint {joint.name} is {joint.motion.name.lower()}, and Paul's method knows"
                " revolute and prismatic joints"
            )


def _refusal(stage: Stage, steps: Steps[Step]) -> str:
    """Which joints are left, and what the simplest equations in them are like."""
    knowledge = stage.knowledge
    left = ", ".join(knowledge.ring.joints[k].name for k in knowledge.unknown)
    given = ", ".join(name for step in steps for name in step.names)
    after = f" once {given} are known" if given else ""
    return f"no equation gives {left}{after}: {_simplest(stage)}"


def _simplest(stage: Stage) -> str:
    if not stage.equations:
        return "every equation of every split of the loop has more than two unknowns"
    groups = dict.fromkeys(
        " and ".join(stage.term(variable) for variable in equation.variables)
        for equation in sorted(stage.equations, key=lambda e: (len(e.variables), e.cost))
    )
    shown = "; ".join(list(groups)[:3])
    return f"the simplest equations of all splits of the loop, in {shown}, fit no type of equation"
