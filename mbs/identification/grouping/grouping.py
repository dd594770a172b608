"""Linear relations between the columns of a regressor D, and groupings of its parameters.

A relation is a combination of columns that vanishes in every state. It eliminates one parameter,
which is added to other parameters.

Source: Gautier 1991.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.operations.graph import graph_of
from mbs.operations.text import PRODUCT, Infix
from mbs.solvers.rank import first_best

# Quotients of expressions, with common factors cancelled.


_DEPTH = 9


def quotient(value: SX, divisor: SX) -> SX:
    """Return the quotient of two scalar expressions with common factors cancelled.

    For example A^2 / A is A.

    Args:
        value: scalar numerator.
        divisor: scalar denominator.
    """
    above, below = _factors(value), _factors(divisor)
    rest: list[SX] = []
    for factor in above:
        same = (k for k, other in enumerate(below) if casadi.is_equal(factor, other, _DEPTH))
        index = next(same, None)
        if index is None:
            rest.append(factor)
        else:
            del below[index]
    return SX(prod(rest, start=SX(1)) / prod(below, start=SX(1)))


def _factors(value: SX) -> list[SX]:
    """Return factors of a scalar expression `value` that is a product; else the list [value]."""
    if value.is_op(casadi.OP_MUL):
        return _factors(value.dep(0)) + _factors(value.dep(1))
    if value.is_op(casadi.OP_SQ):
        return 2 * _factors(value.dep(0))
    if value.is_op(casadi.OP_NEG):
        return [SX(-1), *_factors(value.dep(0))]
    return [value]


Terms = Mapping[int, SX]
"""Coefficients of columns, by column index (0-based)."""

Sampled = Callable[[list[SX]], NDArray[np.float64]]
"""Function that evaluates n scalars at samples of the system parameters, as an array (samples,
n)."""

_CANCELLED = 1e-13
"""Largest remainder of two cancelling coefficients, or of the cancelling terms of one
coefficient: some hundred rounding errors of factors of about one."""
_ZERO = 1e-9
"""Smallest pivot, as a fraction of the largest coefficient of a relation. Division by a smaller
pivot would amplify rounding errors of 1e-13 to significant coefficients."""


@dataclass(frozen=True, slots=True, eq=False)
class Grouping:
    """Expression of every regressor column as a linear combination of the kept columns.

    Attributes:
        columns: for each column of the regressor, the coefficients of the kept columns by index.
    """

    columns: tuple[Terms, ...]

    @staticmethod
    def none(size: int) -> Grouping:
        """Return the grouping of `size` columns in which all columns are kept."""
        return Grouping(tuple({k: SX(1)} for k in range(size)))

    @property
    def kept(self) -> list[int]:
        """Indices of the kept columns."""
        return [k for k, terms in enumerate(self.columns) if k in terms]

    def reduced(self, terms: Terms) -> dict[int, SX]:
        """Return a linear combination of any columns as a combination of the kept columns.

        Args:
            terms: coefficients by column index.

        Returns:
            Coefficients by index of kept columns. Coefficients that cancel are left out.
        """
        total: dict[int, SX] = {}
        for column, coefficient in terms.items():
            for k, part in self.columns[column].items():
                _add_coefficient(total, k, coefficient * part)
        return total

    def replaced(self, dropped: int, terms: Terms) -> Grouping:
        """Return the grouping after a kept column is eliminated.

        Args:
            dropped: index of the kept column.
            terms: combination of other columns, by index, that equals this column.
        """
        equal = self.reduced(terms)
        columns = []
        for column in self.columns:
            if dropped in column:
                changed = {k: x for k, x in column.items() if k != dropped}
                for k, part in equal.items():
                    _add_coefficient(changed, k, column[dropped] * part)
                columns.append(changed)
            else:
                columns.append(dict(column))
        return Grouping(tuple(columns))


def related(
    grouping: Grouping, relation: Terms, ranks: Callable[[int], int], sampled: Sampled
) -> Grouping:
    """Return the grouping after a relation: a combination of columns that vanishes in all states.

    The kept column of highest rank is eliminated, among the columns whose coefficient is nonzero at
    every sample. Among equal ranks, it is the column with the largest coefficient, so that
    quotients stay small.

    Args:
        grouping: grouping from earlier relations.
        relation: coefficients of the combination.
        ranks: function from column index to rank; the highest rank is eliminated first.
        sampled: function that evaluates coefficients at samples, to decide whether they vanish.
    """
    rest = grouping.reduced(relation)
    if not rest:
        return grouping
    sizes = np.abs(sampled(list(rest.values())))
    least, most = (dict(zip(rest, f(sizes, axis=0), strict=True)) for f in (np.min, np.max))
    zero = _ZERO * max(1.0, float(np.max(sizes)))
    able = [k for k, size in least.items() if size > zero]
    if not able:
        return grouping
    highest = max(map(ranks, able))
    last = [k for k in able if ranks(k) == highest]
    pivot = last[first_best([float(least[k]) for k in last])]
    left = [k for k, size in most.items() if k != pivot and size > zero]
    return grouping.replaced(pivot, {k: -quotient(rest[k], rest[pivot]) for k in left})


def without_zeros(grouping: Grouping, sampled: Sampled) -> Grouping:
    """Return the grouping without coefficients whose symbolic terms cancel numerically.

    Args:
        grouping: grouping with symbolic coefficients.
        sampled: function that evaluates expressions at samples of the system parameters.
    """
    columns = []
    for terms in grouping.columns:
        written = {k: x for k, x in terms.items() if not x.is_constant()}
        sizes = np.max(np.abs(sampled(list(written.values()))), axis=0) if written else np.zeros(0)
        zero = {k for k, size in zip(written, sizes, strict=True) if size <= _CANCELLED}
        columns.append({k: x for k, x in terms.items() if k not in zero})
    return Grouping(tuple(columns))


def coefficients(grouping: Grouping) -> Iterable[tuple[int, int, SX]]:
    """Yield the nonzero coefficients of the base parameters: (kept column, column, coefficient).

    The base parameter of a kept column is the sum of coefficient times parameter over columns.

    Args:
        grouping: grouping of the columns.
    """
    for number, terms in enumerate(grouping.columns):
        for k, coefficient in terms.items():
            yield k, number, coefficient


def _add_coefficient(total: dict[int, SX], k: int, part: SX) -> None:
    """Add `part` to the coefficient total[k] in place; delete it if the sum is zero."""
    if part.is_zero():
        return
    if k not in total:
        total[k] = part
        return
    both = SX(total[k] + part)
    if both.is_constant() and total[k].is_constant():
        small = abs(float(both)) <= _CANCELLED * (abs(float(total[k])) + abs(float(part)))
        both = SX(0) if small else both
    if both.is_zero():
        del total[k]
    else:
        total[k] = both


# Grouping equations as text, with the names of the parameters.


def equation(name: str, terms: Mapping[str, SX]) -> str:
    """Return the equation of a grouped parameter, such as "XX2R = XX2 - YY2 + 0.25*M3".

    Args:
        name: name of the grouped parameter.
        terms: coefficients by parameter name; the kept parameter comes first.
    """
    text = ""
    for parameter, coefficient in terms.items():
        sign, factor = _sign_and_text(coefficient)
        term = parameter if factor == "1" else f"{factor}*{parameter}"
        lead = ("-" if sign == "-" else "") if not text else f" {sign} "
        text += lead + term
    return f"{name} = {text or '0'}"


def _sign_and_text(coefficient: SX) -> tuple[str, str]:
    """Return the sign ("+" or "-") of a coefficient and the text of its magnitude."""
    negative, size = _split_sign(coefficient)
    return "-" if negative else "+", _factor_text(size)


def _split_sign(value: SX) -> tuple[bool, SX]:
    """Return whether a coefficient `value` is written with a minus, and its value without it."""
    if value.is_constant():
        return float(value) < 0, SX(abs(float(value)))
    if value.is_op(casadi.OP_NEG):
        negative, size = _split_sign(value.dep(0))
        return not negative, size
    if value.is_op(casadi.OP_MUL):
        (left, first), (right, second) = _split_sign(value.dep(0)), _split_sign(value.dep(1))
        return left != right, first * second
    return False, value


class _FactorText(Infix):
    """Text of a factor, with abs for absolute values."""

    def _call_text(self, op: int) -> str:
        """Return the name of the function with CasADi operation `op`: abs for absolute values."""
        return "abs" if op == casadi.OP_FABS else super()._call_text(op)


def _factor_text(value: SX) -> str:
    """Return the text of a scalar expression `value`, in parentheses if it is a sum."""
    symbols = casadi.symvar(value)
    graph = graph_of(Function("value", [casadi.vertcat(SX(0, 1), *symbols)], [value], ["p"], ["y"]))
    return _FactorText(graph, {"p": [s.name() for s in symbols]}).text(graph.results[0][0], PRODUCT)


def table(rows: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield the lines of a text table of two columns, of which the first is padded to equal width.

    Args:
        rows: pairs (left, right) of texts.
    """
    width = max((len(left) for left, _ in rows), default=0)
    yield from (f"{left:<{width}}  {right}".rstrip() for left, right in rows)


# Comparison of the symbolic grouping with the rank of sampled regressors.


@dataclass(frozen=True, slots=True)
class Check:
    """Numeric check of a set of base parameters at random states.

    Attributes:
        rank: rank of the regressor at random states.
        agrees: whether the symbolic rules alone keep this number of parameters.
        relations: relations that the rules missed, as equations between columns of the regressor.
        applied: whether these relations were applied.
        error: largest difference between a column of the full and the grouped regressor, relative
            to the longest column of the full regressor.
        gap: ratio of successive singular values at the rank.
        text: summary in one or two sentences.
    """

    rank: int
    agrees: bool
    relations: tuple[str, ...]
    applied: bool
    error: float
    gap: float
    text: str


# Numeric samples of the symbols of a system; a property that holds for all samples is structural.


Array = NDArray[np.float64]

_SEED = 20260411
_SPREAD = 0.05
"""Relative and absolute distance of samples from the default values: far above rounding errors,
and so small that loops that close at the default values also close at the samples."""
_TRIES = 40


def default_parameters(system: System) -> Array:
    """Return the default values (np,) of the parameters of a system.

    Parameters without default value have random values between 0.4 and 1.

    Args:
        system: open or closed.
    """
    # between 0.4 and 1: typical lengths and masses of a robot, none near zero
    free = 0.4 + 0.6 * np.random.default_rng(_SEED).random(len(system.parameters))
    defaults = np.array(system.p_default, dtype=float)
    return np.where(np.isnan(defaults), free, defaults)


def parameter_samples(system: System, value: SX) -> list[Array]:
    """Return samples (np,) of the parameters: default values, then up to three samples near them.

    Only the default values are returned if the expression does not depend on symbols.

    Args:
        system: system of the parameters.
        value: expression that must be finite at every sample.
    """
    first = default_parameters(system)
    if not casadi.symvar(value):
        return [first]
    rng = np.random.default_rng(_SEED)
    at = Function("value", [system.p], [casadi.densify(value)])
    found, reach = [first], _SPREAD
    for _ in range(_TRIES):
        trial = first * (1 + rng.uniform(-reach, reach, first.shape))
        trial += rng.uniform(-reach, reach, first.shape)
        if at(trial).is_regular():
            found.append(trial)
        reach *= 1.0 if at(trial).is_regular() else 0.5
        if len(found) == 4:
            break
    return found


def sampler(system: System) -> Sampled:
    """Return a function from n scalar expressions to their values (samples, n).

    The samples are those of `parameter_samples`; constant expressions have one sample.

    Args:
        system: system of the parameters.
    """

    def sampled(values: list[SX]) -> Array:
        column = casadi.vertcat(*values)
        if column.is_constant():
            return np.array(casadi.DM(column)).reshape(1, -1)
        at = Function("coefficients", [system.p], [casadi.densify(column)])
        return np.array([np.array(at(p)).ravel() for p in parameter_samples(system, column)])

    return sampled
