"""Groupings in numbers, and their check at other values of the symbols than their defaults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.identification.base.check import Check
from mbs.identification.base.grouping import Grouping, coefficients
from mbs.identification.base.numeric import RegressorSample, checked
from mbs.identification.base.samples import parameter_samples
from mbs.identification.base.structure import Structure
from mbs.identification.regressors.columns import Column

_SEED = 20260412


def numbers_at(
    system: System, columns: Sequence[Column], grouping: Grouping, p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(kept, columns) the coefficients of a grouping at values p (np,) of the symbols."""
    rows = {k: row for row, k in enumerate(grouping.kept)}
    B = SX(len(rows), len(columns))
    for k, column, x in coefficients(grouping):
        B[rows[k], column] = x
    return np.array(Function("B", [system.p], [casadi.densify(B)])(p))


def checked_elsewhere(
    system: System,
    columns: Sequence[Column],
    grouping: Grouping,
    order: Sequence[int],
    structure: Structure,
) -> Check | None:
    """What states at other values of the symbols say against a grouping; None when nothing.

    Args:
        system: open, with symbols.
        columns: its parameters.
        grouping: by rules.
        order: of preference.
        structure: of its tree.
    """
    p = parameter_samples(system, system.p)[1]
    sample = RegressorSample.of(system, columns, p, _SEED, base_moves=structure.base_moves)
    check = checked(sample, grouping, numbers_at(system, columns, grouping, p), order)
    if check.agrees:
        return None
    told = f"At other values of the symbols than their defaults: {check.text}; nothing is applied"
    return replace(check, text=told)
