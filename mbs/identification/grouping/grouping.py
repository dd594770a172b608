"""Columns of a regressor, and what is known of their linear relations.

D is the regressor. A relation says that some combination of its columns vanishes in every state;
it takes one parameter out and adds it to others.

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

# Quotients of expressions without the factors that both sides share.


_DEPTH = 9


def quotient(value: SX, divisor: SX) -> SX:
    """The quotient of two scalars, such as A for A^2 / A."""
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
    if value.is_op(casadi.OP_MUL):
        return _factors(value.dep(0)) + _factors(value.dep(1))
    if value.is_op(casadi.OP_SQ):
        return 2 * _factors(value.dep(0))
    if value.is_op(casadi.OP_NEG):
        return [SX(-1), *_factors(value.dep(0))]
    return [value]


Terms = Mapping[int, SX]
"""Coefficients of some of the columns, by their numbers from 0."""

Sampled = Callable[[list[SX]], NDArray[np.float64]]
"""(samples, n) values of n scalars at samples of the parameters of a system."""

_CANCELLED = 1e-13
"""What two coefficients may leave of each other, and symbols of a coefficient, when they cancel:
some hundred roundings of factors of about one."""
_ZERO = 1e-9
"""Part of the largest coefficient of a relation below which one is no pivot: division by it would
turn rounding, 1e-13, into coefficients that count."""


@dataclass(frozen=True, slots=True, eq=False)
class Grouping:
    """Every column as a combination of those that are kept.

    Attributes:
        columns: for each column of the regressor the coefficients of the kept ones.
    """

    columns: tuple[Terms, ...]

    @staticmethod
    def none(size: int) -> Grouping:
        """All of them kept."""
        return Grouping(tuple({k: SX(1)} for k in range(size)))

    @property
    def kept(self) -> list[int]:
        """Numbers of the kept columns."""
        return [k for k, terms in enumerate(self.columns) if k in terms]

    def reduced(self, terms: Terms) -> dict[int, SX]:
        """A combination of any columns as one of the kept columns."""
        total: dict[int, SX] = {}
        for column, coefficient in terms.items():
            for k, part in self.columns[column].items():
                _add(total, k, coefficient * part)
        return total

    def replaced(self, dropped: int, terms: Terms) -> Grouping:
        """The grouping once a kept column is known to equal a combination of other columns."""
        equal = self.reduced(terms)
        columns = []
        for column in self.columns:
            if dropped in column:
                changed = {k: x for k, x in column.items() if k != dropped}
                for k, part in equal.items():
                    _add(changed, k, column[dropped] * part)
                columns.append(changed)
            else:
                columns.append(dict(column))
        return Grouping(tuple(columns))


def related(
    grouping: Grouping, relation: Terms, ranks: Callable[[int], int], sampled: Sampled
) -> Grouping:
    """The grouping once a combination of columns is known to vanish.

    The column of highest rank that still is kept leaves, among those whose coefficient vanishes
    for no sample; among equals the one of the largest coefficient, so that no quotient is large.

    Args:
        grouping: what is known so far.
        relation: the combination.
        ranks: number of a column; the highest leaves first.
        sampled: values of coefficients, which say whether they vanish.
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
    """The grouping without coefficients whose symbols cancel, though they are still written."""
    columns = []
    for terms in grouping.columns:
        written = {k: x for k, x in terms.items() if not x.is_constant()}
        sizes = np.max(np.abs(sampled(list(written.values()))), axis=0) if written else np.zeros(0)
        zero = {k for k, size in zip(written, sizes, strict=True) if size <= _CANCELLED}
        columns.append({k: x for k, x in terms.items() if k not in zero})
    return Grouping(tuple(columns))


def coefficients(grouping: Grouping) -> Iterable[tuple[int, int, SX]]:
    """Kept column, any column, and how much of the second parameter the first one takes."""
    for number, terms in enumerate(grouping.columns):
        for k, coefficient in terms.items():
            yield k, number, coefficient


def _add(total: dict[int, SX], k: int, part: SX) -> None:
    """Add to one coefficient; numbers that cancel but for rounding leave none."""
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


# Grouping equations as text, in the names of the parameters.


def equation(name: str, terms: Mapping[str, SX]) -> str:
    """One grouped parameter, such as "XX2R = XX2 - YY2 + 0.25*M3".

    Args:
        name: of the grouped parameter.
        terms: coefficients of the parameters in it, its own first.
    """
    text = ""
    for parameter, coefficient in terms.items():
        sign, factor = _sign(coefficient)
        term = parameter if factor == "1" else f"{factor}*{parameter}"
        lead = ("-" if sign == "-" else "") if not text else f" {sign} "
        text += lead + term
    return f"{name} = {text or '0'}"


def _sign(coefficient: SX) -> tuple[str, str]:
    """The sign of a coefficient and the text of its size, a factor."""
    negative, size = _split(coefficient)
    return "-" if negative else "+", _factor(size)


def _split(value: SX) -> tuple[bool, SX]:
    """Whether a factor is negative as it is written, and the rest of it."""
    if value.is_constant():
        return float(value) < 0, SX(abs(float(value)))
    if value.is_op(casadi.OP_NEG):
        negative, size = _split(value.dep(0))
        return not negative, size
    if value.is_op(casadi.OP_MUL):
        (left, first), (right, second) = _split(value.dep(0)), _split(value.dep(1))
        return left != right, first * second
    return False, value


class _FactorText(Infix):
    """A factor, absolute values as in mathematics."""

    def _call_text(self, op: int) -> str:
        return "abs" if op == casadi.OP_FABS else super()._call_text(op)


def _factor(value: SX) -> str:
    """An expression of numbers and symbols, in brackets where it is a sum."""
    symbols = casadi.symvar(value)
    graph = graph_of(Function("value", [casadi.vertcat(SX(0, 1), *symbols)], [value], ["p"], ["y"]))
    return _FactorText(graph, {"p": [s.name() for s in symbols]}).text(graph.results[0][0], PRODUCT)


def table(rows: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Lines of two columns, the first one as wide as its longest entry."""
    width = max((len(left) for left, _ in rows), default=0)
    yield from (f"{left:<{width}}  {right}".rstrip() for left, right in rows)


# Whether grouping by rules leaves as many parameters as sampled regressors have rank.


@dataclass(frozen=True, slots=True)
class Check:
    """What random states say about a set of base parameters.

    Attributes:
        rank: of the regressor in random states.
        agrees: whether the rules alone kept as many parameters.
        relations: what the rules did not find, as equations between columns of the regressor.
        applied: whether these relations took parameters out of the set.
        error: largest difference between the full and the grouped regressor, by the longest
            column of the full one.
        gap: of the singular values at the rank.
        text: the same in one or two sentences.
    """

    rank: int
    agrees: bool
    relations: tuple[str, ...]
    applied: bool
    error: float
    gap: float
    text: str


# Numbers for the symbols of a system: what holds for several of them holds by structure.


Array = NDArray[np.float64]

_SEED = 20260411
_SPREAD = 0.05
"""Relative and absolute difference of samples from the defaults: far above rounding, and so near
that loops that close with the defaults close with them."""
_TRIES = 40


def default_parameters(system: System) -> Array:
    """(np,) values of the parameters, an irregular number for each that has none."""
    # between 0.4 and 1: lengths and masses as of a robot, none near zero
    free = 0.4 + 0.6 * np.random.default_rng(_SEED).random(len(system.parameters))
    defaults = np.array(system.p_default, dtype=float)
    return np.where(np.isnan(defaults), free, defaults)


def parameter_samples(system: System, value: SX) -> list[Array]:
    """Values of the parameters: the defaults, then some near them where the value depends on them.

    Args:
        system: whose parameters they are.
        value: expression that must have a number at every sample.
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
    """What evaluates scalars at samples of the parameters of a system."""

    def sampled(values: list[SX]) -> Array:
        column = casadi.vertcat(*values)
        if column.is_constant():
            return np.array(casadi.DM(column)).reshape(1, -1)
        at = Function("coefficients", [system.p], [casadi.densify(column)])
        return np.array([np.array(at(p)).ravel() for p in parameter_samples(system, column)])

    return sampled
