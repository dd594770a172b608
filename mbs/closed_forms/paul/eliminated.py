"""Steps of type 2 from several linear equations, with other unknowns eliminated.

For k + 1 equations that are linear in k columns of other unknowns, the determinant is free of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import casadi
import numpy as np
from casadi import SX

from mbs.closed_forms.paul.equation import Equation
from mbs.closed_forms.paul.linear import (
    DEPENDENT,
    Matrix,
    Variables,
    columns,
    row_factors,
    row_values,
)
from mbs.closed_forms.paul.one_unknown import Candidate, PaulStage, angle_step, unsteady
from mbs.closed_forms.paul.splits import Variable
from mbs.closed_forms.sequence import SequenceStep

_MOST = 2
_ROWS = 8


def eliminated(stage: PaulStage) -> Iterator[Candidate]:
    """Yield steps of type 2 (X cos q + Y sin q = Z) from several linear equations.

    Args:
        stage: known quantities and equations.
    """
    rows = [equation for equation in stage.equations if equation.linear]
    for variables in dict.fromkeys(e.variables for e in rows if len(e.variables) > 1):
        inside = sorted(
            (e for e in rows if set(e.variables) <= set(variables)), key=lambda e: e.cost
        )[:_ROWS]
        for variable in variables:
            others = tuple(v for v in variables if v is not variable)
            if variable.prismatic or len(columns(others)) > _MOST:
                continue
            yield from _steps_for(stage, inside, variable, others)


def _steps_for(
    stage: PaulStage, rows: list[Equation], variable: Variable, others: Variables
) -> Iterator[Candidate]:
    """Yield steps that solve `variable` from `rows`, with the variables `others` eliminated."""
    width = len(columns(others))
    for chosen in combinations(rows, width + 1):
        K = _stack(chosen, others)
        minors = _minors(K)
        if np.min(np.max(np.abs(minors), axis=-1)) < DEPENDENT or np.any(
            np.max(np.abs(minors), axis=0) < DEPENDENT
        ):
            continue
        own = _stack(chosen, (variable,))
        XY = np.einsum("...k,...kc->...c", minors, own)
        size = np.linalg.norm(XY, axis=-1)
        if np.min(size) < DEPENDENT:
            continue
        cost = float(sum(row.cost for row in chosen))

        def build(chosen: tuple[Equation, ...] = chosen) -> SequenceStep:
            return _determinant_step(stage, chosen, variable, others)

        # rank between equations in one unknown (4, 5) and pairs of equations (6)
        order = 5.5 if variable.single else 5.7
        yield Candidate((order, unsteady(size), cost), (variable,), build)


def _stack(rows: tuple[Equation, ...], variables: Variables) -> Matrix:
    """Return the coefficients of variables in several equations, (samples, rows, columns)."""
    return np.stack(np.broadcast_arrays(*(row_values(row, variables) for row in rows)), axis=-2)


def _minors(K: Matrix) -> Matrix:
    """Return cofactors (samples, k + 1) of a further column appended to K (samples, k + 1, k)."""
    count = K.shape[-2]
    values = [(-1) ** row * np.linalg.det(np.delete(K, row, axis=-2)) for row in range(count)]
    return np.stack(values, axis=-1)


def _determinant_step(
    stage: PaulStage, rows: tuple[Equation, ...], variable: Variable, others: Variables
) -> SequenceStep:
    """Return the step of X cos q + Y sin q = Z, whose coefficients are determinants.

    The determinants eliminate the variables `others` from the equations `rows`.
    """
    K = [row_factors(stage, row, others)[:-1] for row in rows]
    own = [row_factors(stage, row, (variable,)) for row in rows]
    X, Y, Z = (
        casadi.det(casadi.vertcat(*(casadi.horzcat(*k, o[c]) for k, o in zip(K, own, strict=True))))
        for c in range(3)
    )
    prismatic = sum(v.prismatic for v in others)
    power = sum(row.row.power for row in rows) - prismatic
    return angle_step(stage, variable, (SX(X), SX(Y), SX(-Z)), power)
