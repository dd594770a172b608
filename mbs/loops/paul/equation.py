"""Equations of a split loop that have few unknowns, by their terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.loops.paul.knowledge import Knowledge, Members, Variable
from mbs.loops.paul.splits import splits
from mbs.loops.paul.terms import MOST_VARIABLES, ZERO, Row, Values, simple_rows

Key = tuple[int, ...]

PRODUCTS = 2
"""The most variables of an equation with products of them."""

_ALIKE = 2
"""How many equations are kept that are multiples of each other: which of them is cheapest is seen
once steps are built of them."""

_WEIGHT = (0, 3, 2, 2, 2, 2, 1, 1, 1, 4, 4, 4, 6, 6, 6)


@dataclass(frozen=True, slots=True)
class Source:
    """A term of the joints.

    Attributes:
        term: number of each joint and its power, of an angle the multiple.
        known: number of each known sum that is taken out of it, and its multiple.
        conjugate: whether what is left of the angles stands with the opposite sign.
    """

    term: Members
    known: tuple[tuple[int, int], ...] = ()
    conjugate: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """What stands with one product of variables.

    Attributes:
        values: (samples) G of Re(G e^i(angle)) times the slides; real where there is no angle.
        sources: what it is the sum of.
    """

    values: Values
    sources: tuple[Source, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    """The sum of the parts is zero.

    Attributes:
        row: where it comes from.
        variables: its unknowns.
        parts: by the power of each variable, of angles the multiple; none stands twice, as its
            conjugate.
        patterns: every term of joints in it.
        cost: of its coefficients, by estimate.
    """

    row: Row
    variables: tuple[Variable, ...]
    parts: Mapping[Key, Part]
    patterns: frozenset[Members]
    cost: int

    @property
    def linear(self) -> bool:
        """Whether it is one in the cosines, the sines and the lengths of its variables."""
        return all(sum(abs(power) for power in key) <= 1 for key in self.parts)

    def at(self, key: Key) -> Values:
        """The values of a part; zero where there is none."""
        part = self.parts.get(key)
        return np.zeros(1, dtype=complex) if part is None else part.values


def equations(knowledge: Knowledge, most: int = PRODUCTS) -> tuple[Equation, ...]:
    """The equations of all splits with few unknowns, the cheapest of those that are equal.

    Args:
        knowledge: what is known.
        most: variables of an equation with products of them, before known sums are taken out.
    """
    slides = frozenset(k for k, joint in enumerate(knowledge.ring.joints) if not joint.turns)
    sums = [(known.members, at) for known, _, at in knowledge.open_sums()]
    found = dict[object, list[Equation]]()
    for split in splits(knowledge):
        for row, terms in simple_rows(split, slides, most):
            new = _equation(row, terms, slides, sums)
            if new is not None:
                found.setdefault(_mark(new), []).append(new)
    return tuple(
        equation
        for equal in found.values()
        for equation in sorted(equal, key=lambda own: own.cost)[:_ALIKE]
    )


def _mark(equation: Equation) -> object:
    """The same for equations that are multiples of each other."""
    keys = sorted(equation.parts)
    samples = max(len(part.values) for part in equation.parts.values())
    table = np.stack([np.broadcast_to(equation.parts[key].values, samples) for key in keys])
    size = np.linalg.norm(table, axis=0)
    table /= np.where(size > 0, size, 1.0) * np.where(_leading(table) < 0, -1.0, 1.0)
    return equation.variables, tuple(keys), (np.round(table, 6) + 0.0).tobytes()  # -0.0 is 0.0


def _leading(table: Values) -> NDArray[np.float64]:
    """At each sample a number that changes sign with the column and is not small."""
    parts = np.concatenate([table.real, table.imag])
    largest = np.max(np.abs(parts), axis=0)
    first = np.argmax(np.abs(parts) > 0.3 * largest, axis=0)
    leading: NDArray[np.float64] = np.take_along_axis(parts, first[None], axis=0)[0]
    return leading


def _equation(
    row: Row,
    terms: Mapping[Members, Values],
    slides: frozenset[int],
    sums: list[tuple[Members, NDArray[np.float64]]],
) -> Equation | None:
    """The equation with its variables, if they are few."""
    reduced = dict[Members, tuple[Values, list[Source]]]()
    for term, given in terms.items():
        turns = any(k not in slides for k, _ in term)
        rest, source, values = _folded(term, given * (2 if turns else 1), slides, sums)
        before = reduced.get(rest)
        if before is None:
            reduced[rest] = values, [source]
        else:
            reduced[rest] = before[0] + values, [*before[1], source]
    if sums:
        reduced = {term: own for term, own in reduced.items() if np.max(np.abs(own[0])) > ZERO}
    variables = _variables([*reduced], slides)
    if not variables or len(variables) > MOST_VARIABLES:
        return None
    parts = {
        _key(term, variables): Part(values, tuple(sources))
        for term, (values, sources) in reduced.items()
    }
    if len(parts) < len(reduced):
        return None
    cost = _WEIGHT[row.element] + sum(len(part.sources) for part in parts.values())
    equation = Equation(row, variables, parts, frozenset(terms), cost)
    return equation if len(variables) <= PRODUCTS or equation.linear else None


def _folded(
    term: Members,
    values: Values,
    slides: frozenset[int],
    sums: list[tuple[Members, NDArray[np.float64]]],
) -> tuple[Members, Source, Values]:
    """What is left of a term when the known sums of angles are taken out of it."""
    rest, known = term, list[tuple[int, int]]()
    for number, (members, at) in enumerate(sums):
        powers = dict(rest)
        way = powers.get(members[0][0], 0) if members else 0
        if way and all(powers.get(k, 0) == way * sign for k, sign in members):
            rest = tuple(member for member in rest if member[0] not in dict(members))
            values = values * np.exp(1j * way * at)
            known.append((number, way))
    if not known:
        return term, Source(term), values
    leading = next((e for k, e in rest if k not in slides), 0)
    if leading < 0:
        rest = tuple((k, e if k in slides else -e) for k, e in rest)
        values = values.conj()
    elif leading == 0:
        values = values.real.astype(complex)
    return rest, Source(term, tuple(known), leading < 0), values


def _variables(terms: list[Members], slides: frozenset[int]) -> tuple[Variable, ...]:
    """The joints, those put together whose angles always come with the same ratio."""
    columns = dict[int, list[int]]()
    for number, term in enumerate(terms):
        for k, power in term:
            columns.setdefault(k, [0] * len(terms))[number] = power
    groups = list[tuple[list[int], Variable]]()
    for k in sorted(columns):
        column = columns[k]
        for at, (leader, variable) in enumerate(groups):
            ratio = 1 if leader == column else -1 if leader == [-e for e in column] else 0
            if ratio and k not in slides and not variable.slides:
                groups[at] = (leader, Variable(False, (*variable.members, (k, ratio))))
                break
        else:
            groups.append((column, Variable(k in slides, ((k, 1),))))
    return tuple(variable for _, variable in groups)


def _key(term: Members, variables: tuple[Variable, ...]) -> Key:
    powers = dict(term)
    return tuple(powers.get(variable.members[0][0], 0) for variable in variables)
