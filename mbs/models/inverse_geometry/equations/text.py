"""The closed form of a robot as a sheet to read: joint after joint, its equation and its roots."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.loops.sequence import Problem, Sequence, Step
from mbs.models.inverse_geometry.chain import Chain, chain
from mbs.models.inverse_geometry.equations.closed_form import sequence_of
from mbs.models.inverse_geometry.equations.expression_text import expression_lines
from mbs.operations import simplify
from mbs.operations.graph import graph_of

_WIDTH = 100
_PASSES = ("drop", "fold", "angles", "pythagoras")

_MEANING = {
    "type 2": "+ the root at a positive angle from the direction (X, Y), - the other",
}
"""Of the sign of a step with one, by its kind."""


def text(
    system: System,
    method: str = "auto",
    frame: str | int | None = None,
    locked: Mapping[str, float] | None = None,
) -> str:
    """The closed form of the inverse geometric model, to be read.

    For every step: the joints that it gives, the type of its equation, the equation, what its
    signs choose between, and the coefficients, in terms of the joints found before, of the
    elements T11 .. T34 of the pose and of the parameters. S1, C1, S12 are the sine and cosine of
    q1 and the sine of q1 + q2.

    Args:
        system: whose model it is.
        method: "pieper", "paul", or "auto" for the cheaper of them.
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        locked: positions of joints that stay where they are, by name [rad or m].

    Raises:
        NoClosedForm: no closed form is known; the message says what stood in the way.
        ModelError: there is no such method, frame or joint, or more than six joints are free.
    """
    way = chain(system, frame, locked)
    sequence, problem = sequence_of(way, method), way.problem()
    lines = [*_head(way, sequence)]
    for number, one in enumerate(sequence.steps, 1):
        lines += ["", *_sheet(number, one, problem)]
    return "\n".join([*lines, "", *_branches(sequence)]) + "\n"


def _head(way: Chain, sequence: Sequence) -> Iterator[str]:
    system = way.system
    yield f"Inverse geometric model of {system.name}: {', '.join(way.names)} from the pose T of"
    yield f"frame {way.frame!r} in the base; units are SI and radians"
    held = ", ".join(f"{name} = {value:.12g}" for name, value in way.locked.items())
    if held:
        yield f"locked: {held}"
    if system.parameters:
        yield f"parameters: {', '.join(parameter.name for parameter in system.parameters)}"
    yield f"steps: {len(sequence.steps)}, branches: {sequence.branches}"


def _sheet(number: int, one: Step, problem: Problem) -> Iterator[str]:
    yield f"{number}. {', '.join(one.names)}: {one.kind}"
    yield f"   {one.equation}"
    for name in one.signs:
        meaning = _MEANING.get(one.kind) if len(one.signs) == 1 else None
        yield f"   sign {name}: {meaning or '+ or -, a root each'}"
    if not one.coefficients:
        return
    s = casadi.vertcat(*(SX.sym(f"sign_{name}") for name in one.signs))
    values = one.function(problem.x, problem.given, SX(s))[3]
    inputs = {"x": problem.x, "given": problem.given, "s": SX(s)}
    function = Function("coefficients", [*inputs.values()], [values], [*inputs], ["c"])
    graph = graph_of(simplify(function, _PASSES, ()))
    names = {key: [str(value[k]) for k in range(value.numel())] for key, value in inputs.items()}
    for line in expression_lines(graph, names, one.coefficients, f"W{number}_"):
        yield from textwrap.wrap(
            line, _WIDTH, initial_indent="   ", subsequent_indent=" " * 7, break_long_words=False
        )


def _branches(sequence: Sequence) -> Iterator[str]:
    if sequence.branches == 1:
        yield "There is one branch."
        return
    width = len(str(sequence.branches - 1))
    for number in range(sequence.branches):
        yield f"branch {number:{width}d}: {sequence.label(number)}"
