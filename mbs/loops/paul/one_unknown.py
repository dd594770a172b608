"""One equation in one unknown: X cos q + Y sin q = Z, or a r^2 + b r + c = 0."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from casadi import SX

from mbs.loops.paul.candidate import Candidate, Stage, divided, unsteady
from mbs.loops.paul.equation import Equation
from mbs.loops.paul.knowledge import Variable
from mbs.loops.paul.terms import ZERO
from mbs.loops.sequence import Step, step
from mbs.loops.sequence.step import Found
from mbs.loops.sequence.two_roots import angle_of, cosine_root, square_root


def one_unknown(stage: Stage) -> Iterator[Candidate]:
    """Steps of type 2 and quadratic ones."""
    for equation in stage.equations:
        if len(equation.variables) != 1:
            continue
        if not equation.variables[0].slides and set(equation.parts) <= {(0,), (1,)}:
            yield _type_2(stage, equation)
        elif equation.variables[0].slides and (2,) in equation.parts:
            yield _quadratic(stage, equation)


def _type_2(stage: Stage, equation: Equation) -> Candidate:
    G, Z = equation.at((1,)), equation.at((0,))
    order = 4.0 if equation.variables[0].single else 5.0
    shifted = float(np.max(np.abs(Z)) > ZERO)
    rank = (order, shifted, unsteady(np.abs(G)), float(equation.cost), -float(np.min(np.abs(G))))

    def build() -> Step:
        variable = equation.variables[0]
        own, Z = stage.factor(equation, (1,)), -stage.factor(equation, (0,)).X
        return angle_step(stage, variable, (own.X, own.Y, Z), equation.row.power)

    return Candidate(rank, equation.variables, build)


def angle_step(
    stage: Stage,
    variable: Variable,
    XYZ: tuple[SX, SX, SX],
    power: int,
    kind: str = "type 2",
) -> Step:
    """The step that solves X cos q + Y sin q = Z, of which the unit is a power of a length."""
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
    found = _roots(stage.knowledge.place(variable), XYZ, sign, stage.ways.length**power)
    found = replace(found, coefficients=named)
    signs = {stage.knowledge.name(variable): sign}
    equation = f"{' + '.join(pieces)} = {right}"
    return step(stage.knowledge.problem, kind, equation, signs, found)


def _roots(place: int, XYZ: tuple[SX, SX, SX], sign: SX, scale: SX) -> Found:
    """Both roots; where Z is zero they are opposite, and always real."""
    X, Y, Z = XYZ
    if not Z.is_zero():
        root = cosine_root(X, Y, Z, sign, scale)
        return Found({place: root.value}, (root.real,), (root.regular,))
    root = angle_of(sign * X, -sign * Y, scale)
    return Found({place: root.value}, (), () if root.regular.is_constant() else (root.regular,))


def _quadratic(stage: Stage, equation: Equation) -> Candidate:
    order = (4.0, 1.0, unsteady(equation.at((2,)).real), float(equation.cost))

    def build() -> Step:
        return length_step(
            stage,
            equation.variables[0],
            [stage.factor(equation, (k,)).X for k in (2, 1, 0)],
        )

    return Candidate(order, equation.variables, build)


def length_step(stage: Stage, variable: Variable, abc: list[SX], kind: str = "quadratic") -> Step:
    """The step that solves a r^2 + b r + c = 0."""
    a, b, c = abc
    number, shown = stage.number(variable), stage.term(variable)
    middle = divided(b, 2 * a)
    sign = SX.sym("sign")
    root = square_root(middle * middle - divided(c, a), sign, stage.ways.length)
    named = {f"A{number}": a, f"B{number}": b, f"C{number}": c}
    named = {name: value for name, value in named.items() if not value.is_zero()}
    powers = {f"A{number}": f" {shown}^2", f"B{number}": f" {shown}", f"C{number}": ""}
    equation = " + ".join(name + powers[name] for name in named) + " = 0"
    regular = () if a.is_constant() else (SX(a * a),)
    found = Found(
        {stage.knowledge.place(variable): root.value - middle}, (root.real,), regular, named
    )
    signs = {stage.knowledge.name(variable): sign}
    return step(stage.knowledge.problem, kind, equation, signs, found)
