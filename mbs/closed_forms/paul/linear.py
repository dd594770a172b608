"""Steps from equations linear in lengths, cosines and sines, one per unknown: a single root.

Type 1 is X r = Y; type 3 is two equations X cos q + Y sin q = Z; more unknowns need more rows.

Source: Khalil & Dombre 2002, table 4.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.closed_forms.paul.equation import Equation, Key
from mbs.closed_forms.paul.one_unknown import Candidate, PaulStage, divided, unsteady
from mbs.closed_forms.paul.splits import Variable
from mbs.closed_forms.sequence import Found, SequenceStep, angle_of, step
from mbs.numbers import NONZERO
from mbs.solvers.rank import graded

Matrix = NDArray[np.float64]
Variables = tuple[Variable, ...]

DEPENDENT = 1e-5
"""Determinant at the samples below which rows are dependent: coefficients are of about one, a zero
is 1e-12 after closing, and a step that divides by less would lose five digits."""
_CHOICES = 8
_ROWS = {1: 24, 2: 16, 3: 10, 4: 9, 5: 8, 6: 8}


def linear(stage: PaulStage) -> Iterator[Candidate]:
    """Yield steps that solve as many linear equations as unknown lengths, cosines and sines.

    Args:
        stage: known quantities and equations.
    """
    rows = [equation for equation in stage.equations if equation.linear]
    for variables in dict.fromkeys(equation.variables for equation in rows):
        inside = [e for e in rows if set(e.variables) <= set(variables)]
        sums = any(not variable.single for variable in variables)
        order = 3.0 if sums else float(min(len(variables), 2))
        for chosen, rank in _best_rows(inside, variables):

            def build(
                chosen: tuple[Equation, ...] = chosen, v: Variables = variables
            ) -> SequenceStep:
                return _cramer_step(stage, chosen, v)

            yield Candidate((order, *rank), variables, build)


def columns(variables: Variables) -> list[tuple[Variable, str]]:
    """Return the unknown columns of linear equations, as pairs of variable and kind.

    Kind "r" is a length, "c" the cosine and "s" the sine of an angle.

    Args:
        variables: unknowns of the equations.
    """
    return [
        (variable, kind) for variable in variables for kind in ("r" if variable.prismatic else "cs")
    ]


def key_of(variable: Variable, equation: Equation) -> Key | None:
    """Return the key of the term of a variable alone; None if the variable is not in the equation.

    Args:
        variable: unknown.
        equation: equation.
    """
    if variable not in equation.variables:
        return None
    at = equation.variables.index(variable)
    return tuple(int(k == at) for k in range(len(equation.variables)))


def row_values(equation: Equation, variables: Variables) -> Matrix:
    """Return the numeric coefficients (samples, columns) of variables in a linear equation.

    Args:
        equation: equation.
        variables: unknowns, which define the `columns`.
    """
    values = []
    for variable, kind in columns(variables):
        key = key_of(variable, equation)
        G = np.zeros(1, dtype=complex) if key is None else equation.at(key)
        values.append(-G.imag if kind == "s" else G.real)
    return np.stack(np.broadcast_arrays(*values), axis=-1)


def row_factors(stage: PaulStage, equation: Equation, variables: Variables) -> list[SX]:
    """Return the symbolic coefficients of variables in a linear equation, then its constant.

    Args:
        stage: known quantities and equations.
        equation: equation.
        variables: unknowns, which define the `columns`.
    """
    factors = list[SX]()
    for variable in variables:
        key = key_of(variable, equation)
        if key is None:
            factors += [SX(0)] * (1 if variable.prismatic else 2)
            continue
        own = stage.factor(equation, key)
        factors += [own.X] if variable.prismatic else [own.X, own.Y]
    return [*factors, stage.factor(equation, (0,) * len(equation.variables)).X]


def _best_rows(
    rows: list[Equation], variables: Variables
) -> list[tuple[tuple[Equation, ...], tuple[float, ...]]]:
    """Return the best selections of rows that determine the variables, with their sort keys.

    A constant determinant is preferred, then low cost, then good conditioning.
    """
    width = len(columns(variables))
    first = sorted(rows, key=lambda e: e.cost)[: _ROWS.get(width, 0)]
    if len(first) < width:
        return []
    values = np.stack(
        np.broadcast_arrays(*(row_values(equation, variables) for equation in first)), axis=-2
    )
    norms = np.linalg.norm(values, axis=-1)
    choices = list[tuple[tuple[Equation, ...], tuple[float, ...]]]()
    for chosen in combinations(range(len(first)), width):
        det = np.linalg.det(values[:, chosen])
        size = np.maximum(np.prod(norms[:, chosen], axis=-1), NONZERO)
        if np.min(np.abs(det) / size) < DEPENDENT:
            continue
        cost = sum(first[k].cost for k in chosen)
        rank = (unsteady(det), float(cost), -graded(float(np.min(np.abs(det)))))
        choices.append((tuple(first[k] for k in chosen), rank))
    return sorted(choices, key=lambda choice: choice[1])[:_CHOICES]


def _cramer_step(
    stage: PaulStage, rows: tuple[Equation, ...], variables: Variables
) -> SequenceStep:
    """Return the step that solves the rows for the variables by Cramer's rule."""
    table = [row_factors(stage, row, variables) for row in rows]
    A = casadi.vertcat(*(casadi.horzcat(*row[:-1]) for row in table))
    b = casadi.vertcat(*(-row[-1] for row in table))
    named, equation = _equation_text(stage, table, variables)
    D, solved = _cramer(A, b)
    values, regular, at = dict[int, SX](), list[SX](), 0
    power = sum(row.row.power for row in rows) - sum(variable.prismatic for variable in variables)
    for variable in variables:
        index = stage.knowledge.index(variable)
        if variable.prismatic:
            values[index] = divided(solved[at], D)
        else:
            values[index] = angle_of(solved[at + 1] * D, solved[at] * D).value
        at += 1 if variable.prismatic else 2
    if not D.is_constant():
        regular.append(SX((D / stage.matrices.length**power) ** 2))
    kind = _type_name(variables)
    found = Found(values, (), tuple(regular), named)
    return step(stage.knowledge.problem, kind, equation, {}, found)


def _type_name(variables: Variables) -> str:
    """Return the type of the equations: "linear" for several unknowns, else "type 1" or "type 3".

    Type 1 has a single length, type 3 a single angle.
    """
    if len(variables) > 1:
        return "linear"
    return "type 1" if variables[0].prismatic else "type 3"


def _cramer(A: SX, b: SX) -> tuple[SX, list[SX]]:
    """Return the determinant of A, and the solutions of A x = b times the determinant."""
    n = A.shape[0]
    numerators = []
    for k in range(n):
        changed = SX(A)
        changed[:, k] = b
        numerators.append(SX(casadi.det(changed)))
    return SX(casadi.det(A)), numerators


def _equation_text(
    stage: PaulStage, table: list[list[SX]], variables: Variables
) -> tuple[dict[str, SX], str]:
    """Return the named coefficients of linear equations, and the equations as text.

    `table` contains the symbolic coefficients of each equation.

    `variables` are the unknowns of the equations.
    """
    named, lines = dict[str, SX](), list[str]()
    for letter, row in zip(_letters(len(table)), table, strict=True):
        pieces, right = list[str](), "0"
        for (variable, kind), value in zip(columns(variables), row[:-1], strict=True):
            if not value.is_zero():
                name = {"c": "X", "s": "Y", "r": "W"}[kind] + stage.number(variable) + letter
                named[name] = value
                term = stage.term(variable)
                shown = {"c": f"cos({term})", "s": f"sin({term})", "r": term}[kind]
                pieces.append(f"{name} {shown}")
        if not row[-1].is_zero():
            right = f"Z{stage.number(variables[0])}{letter}"
            named[right] = -row[-1]
        lines.append(f"{' + '.join(pieces) or '0'} = {right}")
    return named, ", ".join(lines)


def _letters(count: int) -> list[str]:
    """Return `count` letters a, b, ... that distinguish the coefficients of several equations.

    A single equation has an empty letter.
    """
    return [""] if count == 1 else list("abcdefgh"[:count])
