"""Steps one after the other: a posture for every choice of their signs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence as Steps
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.loops.sequence.step import Step


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """A posture for one choice of all signs.

    Attributes:
        x: (n, 1) positions of the joints.
        real: (r, 1) every radicand on the way.
        regular: (e, 1) every quantity that must not vanish.
        coefficients: by name, those of every step.
    """

    x: SX
    real: SX
    regular: SX
    coefficients: dict[str, SX]


@dataclass(frozen=True, slots=True, eq=False)
class Sequence:
    """A solution of a loop in steps.

    Branch number b chooses the signs: sign number k, in the order of `signs`, is +1 where bit
    number k of b, counted from the highest, is zero.

    Attributes:
        size: number of joints.
        steps: in their order; together they give every joint.
    """

    size: int
    steps: Steps[Step]

    @property
    def signs(self) -> tuple[str, ...]:
        """The names of all signs, in the order of the steps."""
        return tuple(name for step in self.steps for name in step.signs)

    @property
    def branches(self) -> int:
        """How many choices of signs there are."""
        return int(2 ** len(self.signs))

    def choice(self, branch: int) -> tuple[int, ...]:
        """The signs, +1 or -1, of a branch."""
        count = len(self.signs)
        return tuple(-1 if branch >> (count - 1 - k) & 1 else 1 for k in range(count))

    def label(self, branch: int) -> str:
        """The signs of a branch by their names, such as "q3:+ q2:- q5:+"."""
        signs = zip(self.signs, self.choice(branch), strict=True)
        return " ".join(f"{name}:{'+' if sign > 0 else '-'}" for name, sign in signs)

    def leaf(self, given: SX, s: SX) -> Leaf:
        """The posture of one branch whose signs, (number of signs, 1), are expressions."""
        leaf, first = self._start(), 0
        for step in self.steps:
            chosen = s[first : first + len(step.signs)]
            leaf, first = _taken(leaf, step, given, chosen), first + len(step.signs)
        return self._cropped(leaf)

    def leaves(self, given: SX) -> list[Leaf]:
        """The postures of all branches, in their order; what branches share is computed once."""
        leaves = [self._start()]
        for step in self.steps:
            choices = list(itertools.product((1, -1), repeat=len(step.signs)))
            leaves = [
                _taken(leaf, step, given, SX(casadi.DM(choice)))
                for leaf in leaves
                for choice in choices
            ]
        return [self._cropped(leaf) for leaf in leaves]

    def _start(self) -> Leaf:
        return Leaf(SX(2 * self.size, 1), SX(0, 1), SX(0, 1), {})

    def _cropped(self, leaf: Leaf) -> Leaf:
        return Leaf(leaf.x[: self.size], leaf.real, leaf.regular, leaf.coefficients)


def _taken(leaf: Leaf, step: Step, given: SX, s: SX) -> Leaf:
    """The posture with one more step."""
    values, real, regular, coefficients = step.function(leaf.x, given, s)
    x = SX(leaf.x)
    x[list(step.places)] = values
    named = dict(zip(step.coefficients, casadi.vertsplit(coefficients), strict=True))
    return Leaf(
        x,
        casadi.vertcat(leaf.real, real),
        casadi.vertcat(leaf.regular, regular),
        leaf.coefficients | named,
    )
