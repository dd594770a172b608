"""One step of a solution: an equation that gives some joints, and the signs of its roots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.loops.sequence.problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """Some joints of a loop, from the given and from the joints found before.

    Attributes:
        places: numbers in x of what it gives; beyond the joints those of further angles.
        names: of these, as they stand in the equation.
        kind: of the equation, such as "type 2" or "quartic".
        equation: as one reads it, in terms of the coefficients, such as
            "X3 cos(q3) + Y3 sin(q3) = Z3".
        signs: what tells its roots apart, each +1 or -1; empty where there is one root.
        coefficients: names of the coefficients in the equation.
        function: (x, given, s) -> (values, real, regular, coefficients). `values` has a row a
            place and is finite for every argument; `real` has a row a radicand, made free of
            units, and the root is real where none is negative; `regular` has a row a quantity
            free of units that vanishes where the step leaves a joint undetermined.
    """

    places: tuple[int, ...]
    names: tuple[str, ...]
    kind: str
    equation: str
    signs: tuple[str, ...]
    coefficients: tuple[str, ...]
    function: Function


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Expressions of x, given and signs that make up a step.

    Attributes:
        values: by place.
        real: radicands, free of units; negative where the root is not real.
        regular: free of units, zero where a joint is left undetermined.
        coefficients: by name.
    """

    values: Mapping[int, SX]
    real: Sequence[SX] = ()
    regular: Sequence[SX] = ()
    coefficients: Mapping[str, SX] | None = None


def step(problem: Problem, kind: str, equation: str, signs: Mapping[str, SX], found: Found) -> Step:
    """A step from the expressions that make it up.

    Args:
        problem: of which it solves a part.
        kind: of the equation.
        equation: as one reads it.
        signs: the symbol of each sign by its name.
        found: the expressions.
    """
    s = casadi.vertcat(*signs.values())
    coefficients = dict(found.coefficients or {})
    columns = (found.values.values(), found.real, found.regular, coefficients.values())
    outputs = [casadi.densify(SX(casadi.vertcat(*column))) for column in columns]
    function = Function("step", [problem.x, problem.given, SX(s)], outputs, {"cse": True})
    places = tuple(found.values)
    names = tuple(_name(problem, place) for place in places)
    return Step(places, names, kind, equation, tuple(signs), tuple(coefficients), function)


def _name(problem: Problem, place: int) -> str:
    names = {joint.place: joint.name for joint in problem.ring.joints}
    return names.get(place, str(problem.x[place]))
