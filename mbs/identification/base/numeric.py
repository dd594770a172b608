"""Grouping by the rank of the regressor in random states, and the check of the rules by it.

Source: Gautier 1991.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.identification.base.check import Check
from mbs.identification.base.grouping import Grouping
from mbs.identification.base.rank import Dependence, dependence, plain
from mbs.identification.base.sampled_regressor import sampled_regressor
from mbs.identification.base.states import random_states
from mbs.identification.base.text import equation
from mbs.identification.regressors.columns import Column

Array = NDArray[np.float64]

_ZERO = 1e-8
_EXACT = 1e-7
"""Largest error of a grouped regressor that is rounding, by the longest column."""
_NARROW = 1e4
"""A smaller gap of the singular values leaves the rank in doubt."""
_PREFERRED = ("ZZ", "XX", "XY", "XZ", "YZ", "MX", "MY", "YY", "MZ", "M")
"""Inertial parameters of a link in the order in which they are kept."""


@dataclass(frozen=True, slots=True, eq=False)
class RegressorSample:
    """The regressor of a system in many random states.

    Attributes:
        columns: its parameters.
        W: (rows, columns).
    """

    columns: tuple[Column, ...]
    W: Array

    @staticmethod
    def of(
        system: System, columns: Sequence[Column], p: Array, seed: int, *, base_moves: bool = False
    ) -> RegressorSample:
        """At least three rows for every column."""
        count = 8 + -(-3 * len(columns) // max(len(system.active), 1))
        states = random_states(system, p, count, seed)
        states = states.on_moving_base(seed) if base_moves else states
        return RegressorSample(tuple(columns), sampled_regressor(system, columns, states, p))


def preferred_order(columns: Sequence[Column], first: Sequence[int] = ()) -> list[int]:
    """Numbers of the columns, those that should be kept first: near the base, YY MZ M last.

    With this order QR keeps the parameters that the rules of trees keep.
    """
    known = {kind: k for k, kind in enumerate(_PREFERRED)}
    rest = [k for k in range(len(columns)) if k not in first]
    rest.sort(key=lambda k: (columns[k].link, known.get(columns[k].kind, len(known)), k))
    return [*first, *rest]


def grouped_by_rank(sample: RegressorSample, order: Sequence[int]) -> tuple[Grouping, Check]:
    """The independent columns in this order, and the others in terms of them."""
    found = dependence(sample.W, order)
    grouping = applied(Grouping.none(len(sample.columns)), found)
    text = f"the regressor in random states has the rank {len(found.independent)}" + _gap(found)
    check = Check(
        len(found.independent), True, (), True, found.residual, found.gap, _sentence(text)
    )
    return grouping, check


def applied(
    grouping: Grouping, found: Dependence, numbers: Sequence[int] | None = None
) -> Grouping:
    """The grouping with dependent columns taken out.

    Args:
        grouping: so far.
        found: dependence of some of its columns.
        numbers: of these columns, all of them when left out.
    """
    numbers = range(len(grouping.columns)) if numbers is None else numbers
    for k, column in enumerate(found.dependent):
        terms = zip(found.independent, found.factors[:, k], strict=True)
        grouping = grouping.replaced(
            numbers[column], {numbers[i]: SX(plain(x)) for i, x in terms if abs(x) > _ZERO}
        )
    return grouping


def checked(
    sample: RegressorSample, grouping: Grouping, beta: Array, order: Sequence[int]
) -> Check:
    """What random states say of a grouping.

    Args:
        sample: of the regressor.
        grouping: by rules.
        beta: (kept, columns) its coefficients in numbers.
        order: of preference.
    """
    kept, W = grouping.kept, sample.W
    longest = float(np.max(np.linalg.norm(W, axis=0), initial=1e-300))
    errors = np.linalg.norm(W - W[:, kept] @ beta, axis=0) / longest
    error = float(np.max(errors, initial=0.0))
    full = dependence(W, order)
    rank = len(full.independent)
    found = remainder(sample, grouping, order)
    exact = error < _EXACT
    relations = relation_texts(sample.columns, kept, found) if exact else ()
    agrees = exact and rank == len(kept)
    text = _verdict(len(kept), rank, relations) if exact else _inexact(error)
    return Check(rank, agrees, relations, False, error, full.gap, _sentence(text + _gap(full)))


def remainder(sample: RegressorSample, grouping: Grouping, order: Sequence[int]) -> Dependence:
    """The dependence of the kept columns."""
    kept = grouping.kept
    return dependence(sample.W[:, kept], [kept.index(k) for k in order if k in kept])


def relation_texts(
    columns: Sequence[Column], kept: Sequence[int], found: Dependence
) -> tuple[str, ...]:
    """Dependent columns as equations, D(XX1) = ... of the effects of parameters."""
    lines = []
    for k, column in enumerate(found.dependent):
        pairs = zip(found.independent, found.factors[:, k], strict=True)
        terms = {f"D({columns[kept[i]].name})": SX(plain(x)) for i, x in pairs if abs(x) > _ZERO}
        lines.append(equation(f"D({columns[kept[column]].name})", terms))
    return tuple(lines)


def _inexact(error: float) -> str:
    return (
        f"the rules are not exact: the grouped regressor differs by {error:.2g} of its longest"
        " column"
    )


def _verdict(count: int, rank: int, relations: Sequence[str]) -> str:
    if count == rank:
        return f"the rules keep {count} parameters, which is the rank of the regressor"
    told = "; ".join(relations)
    return f"the rules keep {count} parameters, but the regressor has the rank {rank}: {told}"


def _gap(found: Dependence) -> str:
    if np.isinf(found.gap):
        return ""
    doubt = ", so narrow that the rank is in doubt" if found.gap < _NARROW else ""
    return f" (gap of the singular values {found.gap:.1e}{doubt})"


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]
