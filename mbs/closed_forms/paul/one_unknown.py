"""Steps from one equation in one unknown: X cos q + Y sin q = Z, or a r^2 + b r + c = 0."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.closed_forms.paul.equation import Equation, Factor, Key, RingMatrices, factor
from mbs.closed_forms.paul.splits import KnownFrames, Variable
from mbs.closed_forms.sequence import (
    ZERO,
    Found,
    SequenceStep,
    angle_of,
    cosine_root,
    square_root,
    step,
)
from mbs.numbers import NONZERO

# Candidates for the next step at one stage of a search, and their text.


STEADY = 1e-9
"""Relative spread over the samples below which a quantity is constant: closing by iteration leaves
1e-12, and a quantity that depends on generic positions changes by about one."""


@dataclass(frozen=True, slots=True, eq=False)
class PaulStage:
    """Known quantities at one stage of a search, and the equations with few unknowns.

    Attributes:
        knowledge: known joints and sums.
        matrices: matrices of the known transforms of the loop.
        equations: equations that hold.
    """

    knowledge: KnownFrames
    matrices: RingMatrices
    equations: tuple[Equation, ...]

    def factor(self, equation: Equation, key: Key) -> Factor:
        """Return the coefficient of the monomial with exponents `key`, as an expression.

        Args:
            equation: equation of this stage.
            key: exponents of the product, one for each variable of the equation.
        """
        return factor(self.knowledge, self.matrices, equation, key)

    def number(self, variable: Variable) -> str:
        """Return the number that is part of the coefficient names of a variable."""
        return str(self.knowledge.index(variable) + 1)

    def term(self, variable: Variable) -> str:
        """Return the text of a variable in an equation, such as "q2+q3"."""
        if variable.single:
            return self.knowledge.name(variable)
        signed = [
            ("+" if sign > 0 else "-") + self.knowledge.ring.joints[k].name
            for k, sign in variable.members
        ]
        return "".join(signed).removeprefix("+")


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Possible next step.

    Attributes:
        rank: sort key; the lowest is tried first.
        variables: variables that the step solves.
        build: callable that builds the step.
    """

    rank: tuple[float, ...]
    variables: tuple[Variable, ...]
    build: Callable[[], SequenceStep]


def unsteady(values: NDArray[np.float64]) -> float:
    """Return 0.0 if a quantity is constant over the samples, else 1.0.

    Args:
        values: (samples,) values.
    """
    spread = float(np.max(values) - np.min(values))
    return float(spread > STEADY * float(np.max(np.abs(values))))


def divided(numerator: SX, denominator: SX) -> SX:
    """Return the ratio of two expressions, which is finite for a zero denominator.

    Args:
        numerator: expression.
        denominator: expression.
    """
    if denominator.is_constant():
        return SX(numerator / denominator)
    return SX(numerator * denominator / (denominator * denominator + NONZERO))


def one_unknown(stage: PaulStage) -> Iterator[Candidate]:
    """Yield steps that solve one equation in one unknown with two roots.

    These are X cos q + Y sin q = Z (type 2) and quadratic equations.

    Args:
        stage: known quantities and equations.
    """
    for equation in stage.equations:
        if len(equation.variables) != 1:
            continue
        if not equation.variables[0].prismatic and set(equation.parts) <= {(0,), (1,)}:
            yield _type_2(stage, equation)
        elif equation.variables[0].prismatic and (2,) in equation.parts:
            yield _quadratic(stage, equation)


def _type_2(stage: PaulStage, equation: Equation) -> Candidate:
    """Return the step of an equation X cos q + Y sin q = Z in one unknown angle."""
    G, Z = equation.at((1,)), equation.at((0,))
    # rank 4 or 5: after the linear equations (1 to 3), single joints before sums
    order = 4.0 if equation.variables[0].single else 5.0
    shifted = float(np.max(np.abs(Z)) > ZERO)
    rank = (order, shifted, unsteady(np.abs(G)), float(equation.cost), -float(np.min(np.abs(G))))

    def build() -> SequenceStep:
        variable = equation.variables[0]
        own, Z = stage.factor(equation, (1,)), -stage.factor(equation, (0,)).X
        return angle_step(stage, variable, (own.X, own.Y, Z), equation.row.power)

    return Candidate(rank, equation.variables, build)


def angle_step(
    stage: PaulStage,
    variable: Variable,
    XYZ: tuple[SX, SX, SX],
    power: int,
    kind: str = "type 2",
) -> SequenceStep:
    """Return the step of X cos q + Y sin q = Z.

    Args:
        stage: known quantities and equations.
        variable: angle q, or sum of angles.
        XYZ: coefficients.
        power: power of a length that is the unit of the coefficients.
        kind: type of the equation.
    """
    X, Y, Z = XYZ
    number, shown = stage.number(variable), stage.term(variable)
    names = {f"X{number}": X, f"Y{number}": Y, f"Z{number}": Z}
    named = {name: value for name, value in names.items() if not value.is_zero()}
    pieces = [
        f"{name} {function}({shown})"
        for name, function in ((f"X{number}", "cos"), (f"Y{number}", "sin"))
        if name in named
    ]
    right = f"Z{number}" if f"Z{number}" in named else "0"
    sign = SX.sym("sign")
    found = _roots(stage.knowledge.index(variable), XYZ, sign, stage.matrices.length**power)
    found = replace(found, coefficients=named)
    signs = {stage.knowledge.name(variable): sign}
    equation = f"{' + '.join(pieces)} = {right}"
    return step(stage.knowledge.problem, kind, equation, signs, found)


def _roots(index: int, XYZ: tuple[SX, SX, SX], sign: SX, scale: SX) -> Found:
    """Return the roots of X cos q + Y sin q = Z; for Z = 0 they are opposite and always real.

    `index` is that of q in x, `scale` the typical size of the coefficients.
    """
    X, Y, Z = XYZ
    if not Z.is_zero():
        root = cosine_root(X, Y, Z, sign, scale)
        return Found({index: root.value}, (root.real,), (root.regular,))
    root = angle_of(sign * X, -sign * Y, scale)
    return Found({index: root.value}, (), () if root.regular.is_constant() else (root.regular,))


def _quadratic(stage: PaulStage, equation: Equation) -> Candidate:
    """Return the step of a quadratic equation in one unknown length."""
    order = (4.0, 1.0, unsteady(equation.at((2,)).real), float(equation.cost))

    def build() -> SequenceStep:
        return length_step(
            stage,
            equation.variables[0],
            [stage.factor(equation, (k,)).X for k in (2, 1, 0)],
        )

    return Candidate(order, equation.variables, build)


def length_step(
    stage: PaulStage, variable: Variable, abc: list[SX], kind: str = "quadratic"
) -> SequenceStep:
    """Return the step that solves a r^2 + b r + c = 0.

    Args:
        stage: known quantities and equations.
        variable: prismatic displacement r.
        abc: coefficients.
        kind: type of the equation.
    """
    a, b, c = abc
    number, shown = stage.number(variable), stage.term(variable)
    middle = divided(b, 2 * a)
    sign = SX.sym("sign")
    root = square_root(middle * middle - divided(c, a), sign, stage.matrices.length)
    named = {f"A{number}": a, f"B{number}": b, f"C{number}": c}
    named = {name: value for name, value in named.items() if not value.is_zero()}
    powers = {f"A{number}": f" {shown}^2", f"B{number}": f" {shown}", f"C{number}": ""}
    equation = " + ".join(name + powers[name] for name in named) + " = 0"
    regular = () if a.is_constant() else (SX(a * a),)
    found = Found(
        {stage.knowledge.index(variable): root.value - middle}, (root.real,), regular, named
    )
    signs = {stage.knowledge.name(variable): sign}
    return step(stage.knowledge.problem, kind, equation, signs, found)
