"""Ways to go on at one stage of a search, and how they are told in text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.loops.paul.coefficients import Factor, Ways, factor
from mbs.loops.paul.equation import Equation, Key
from mbs.loops.paul.knowledge import Knowledge, Variable
from mbs.loops.sequence import Step

STEADY = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """What is known, and the equations in few unknowns that are left.

    Attributes:
        knowledge: what is known.
        ways: the gaps of the loop.
        equations: that hold.
    """

    knowledge: Knowledge
    ways: Ways
    equations: tuple[Equation, ...]

    def factor(self, equation: Equation, key: Key) -> Factor:
        """What stands with a product of the variables of an equation."""
        return factor(self.knowledge, self.ways, equation, key)

    def number(self, variable: Variable) -> str:
        """What tells the coefficients of a variable from others."""
        return str(self.knowledge.place(variable) + 1)

    def term(self, variable: Variable) -> str:
        """The variable as an equation shows it."""
        if variable.single:
            return self.knowledge.name(variable)
        signed = [
            ("+" if sign > 0 else "-") + self.knowledge.ring.joints[k].name
            for k, sign in variable.members
        ]
        return "".join(signed).removeprefix("+")


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A step that could be taken.

    Attributes:
        rank: the lowest is taken first.
        variables: that it gives.
        build: of the step.
    """

    rank: tuple[float, ...]
    variables: tuple[Variable, ...]
    build: Callable[[], Step]


def unsteady(values: NDArray[np.float64]) -> float:
    """0 where a quantity is the same at all samples, else 1."""
    spread = float(np.max(values) - np.min(values))
    return float(spread > STEADY * float(np.max(np.abs(values))))


def divided(numerator: SX, denominator: SX) -> SX:
    """The ratio; finite where the denominator is zero."""
    if denominator.is_constant():
        return SX(numerator / denominator)
    return SX(numerator * denominator / (denominator * denominator + 1e-300))
