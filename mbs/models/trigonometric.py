"""Polynomials in sines, cosines and lengths, read from CasADi expressions and factored.

An angle that is a sum is opened into sines and cosines of its parts, powers are lowered by
s^2 + c^2 = 1, and a factor is written with sums of angles where that makes it shorter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import casadi
from casadi import SX, Function

from mbs.operations.graph import Graph, graph_of

Atom = tuple[Literal["x", "s", "c"], tuple[tuple[int, int], ...]]
"""A variable, or sine or cosine of a sum of variables, each with an integer factor."""
Monomial = tuple[tuple[Atom, int], ...]
Polynomial = dict[Monomial, Fraction]

_ROUNDING = Fraction(1, 10**13)
_CONSTANT_ROUNDING = 1e-15
_MOST_NODES = 200
_MOST_TERMS = 80
_MOST_FACTORED = 30
_OTHER = {"s": "c", "c": "s"}


class NotTrigonometric(Exception):
    """The expression is no polynomial of this kind, or too long a one."""


def variable(number: int) -> Polynomial:
    """The polynomial that is one variable."""
    return {((("x", ((number, 1),)), 1),): Fraction(1)}


def total(a: Polynomial, b: Polynomial, sign: int = 1) -> Polynomial:
    """The sum a + sign b."""
    result = dict(a)
    for monomial, coefficient in b.items():
        _add(result, monomial, sign * coefficient)
    return _within_reason({m: c for m, c in result.items() if c})


def product(a: Polynomial, b: Polynomial) -> Polynomial:
    """The product of two polynomials."""
    result: Polynomial = {}
    for m, x in a.items():
        for n, y in b.items():
            _add(result, _joined(m, n), x * y)
    return _within_reason({m: c for m, c in result.items() if c})


def _add(result: Polynomial, monomial: Monomial, coefficient: Fraction) -> None:
    """One term more; zero where two cancel but for the rounding of the numbers they come from."""
    before = result.get(monomial, Fraction(0))
    both = before + coefficient
    cancelled = abs(both) <= _ROUNDING * (abs(before) + abs(coefficient))
    result[monomial] = Fraction(0) if cancelled else both


def _joined(m: Monomial, n: Monomial) -> Monomial:
    powers = dict(m)
    for atom, power in n:
        powers[atom] = powers.get(atom, 0) + power
    return tuple(sorted(powers.items()))


def _within_reason(polynomial: Polynomial) -> Polynomial:
    if len(polynomial) > _MOST_TERMS:
        raise NotTrigonometric
    return polynomial


def polynomial_of(expression: SX, variables: SX) -> Polynomial:
    """An expression as a polynomial in variables, their sines and cosines.

    Raises:
        NotTrigonometric: it is something else, or too long.
    """
    graph = graph_of(Function("f", [variables], [casadi.densify(expression)], {"cse": True}))
    if len(graph.nodes) > _MOST_NODES:
        raise NotTrigonometric
    least = _CONSTANT_ROUNDING * max((abs(node.value) for node in graph.nodes), default=0.0)
    values: list[Polynomial] = []
    for number in range(len(graph.nodes)):
        values.append(lowered(_value(graph, number, values, least), "s"))
    return values[graph.results[0][0]]


def _value(graph: Graph, number: int, values: list[Polynomial], least: float) -> Polynomial:
    node = graph.nodes[number]
    operands = [values[k] for k in graph.operands(number)]
    match node.op:
        case casadi.OP_INPUT:
            return variable(node.args[1])
        case casadi.OP_CONST:
            return _constant(node.value, least)
        case casadi.OP_NEG:
            return product({(): Fraction(-1)}, operands[0])
        case casadi.OP_SQ:
            return product(operands[0], operands[0])
        case casadi.OP_TWICE:
            return total(operands[0], operands[0])
    return _operation(node.op, operands)


def _operation(op: int, operands: list[Polynomial]) -> Polynomial:
    two: dict[int, Callable[[Polynomial, Polynomial], Polynomial]] = {
        casadi.OP_ADD: total,
        casadi.OP_SUB: lambda a, b: total(a, b, -1),
        casadi.OP_MUL: product,
    }
    if op in two:
        return two[op](operands[0], operands[1])
    if op in (casadi.OP_SIN, casadi.OP_COS):
        s, c = _sine_cosine(operands[0])
        return s if op == casadi.OP_SIN else c
    raise NotTrigonometric


def _constant(value: float, least: float) -> Polynomial:
    """A number; zero when it is what numbers as large as the others of the graph left of it."""
    if not math.isfinite(value):
        raise NotTrigonometric
    return {(): Fraction(repr(value))} if abs(value) > least else {}


def _sine_cosine(angle: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Sine and cosine of a sum of variables, opened."""
    s: Polynomial = {}
    c: Polynomial = {(): Fraction(1)}
    for monomial, times in angle.items():
        if len(monomial) != 1 or monomial[0][0][0] != "x" or monomial[0][1] != 1:
            raise NotTrigonometric
        if times.denominator != 1 or abs(times) > 4:
            raise NotTrigonometric
        of = monomial[0][0][1]
        sine: Polynomial = {((("s", of), 1),): Fraction(1 if times > 0 else -1)}
        cosine: Polynomial = {((("c", of), 1),): Fraction(1)}
        for _ in range(abs(int(times))):
            s, c = (
                total(product(s, cosine), product(c, sine)),
                total(product(c, cosine), product(s, sine), -1),
            )
    return s, c


def lowered(polynomial: Polynomial, which: Literal["s", "c"]) -> Polynomial:
    """The same with no square of a sine ("s"), or of a cosine ("c"), left in it."""
    result: Polynomial = {}
    for monomial, coefficient in polynomial.items():
        term: Polynomial = {(): coefficient}
        for atom, power in monomial:
            kind, of = atom
            if kind == which:
                other: Atom = (_OTHER[kind], of)  # type: ignore[assignment]
                square: Polynomial = {(): Fraction(1), ((other, 2),): Fraction(-1)}
                for _ in range(power // 2):
                    term = product(term, square)
                power %= 2
            if power:
                term = product(term, {((atom, power),): Fraction(1)})
        result = total(result, term)
    return result


def with_sums_of_angles(polynomial: Polynomial) -> Polynomial:
    """Products of sines and cosines as sums of sines and cosines of sums of angles."""
    result: Polynomial = {}
    for monomial, coefficient in polynomial.items():
        rest = tuple((atom, power) for atom, power in monomial if atom[0] == "x")
        waves: Polynomial = {(): Fraction(1)}
        for atom, power in monomial:
            for _ in range(power if atom[0] != "x" else 0):
                waves = _times_wave(waves, atom)
        result = total(result, product({rest: coefficient}, waves))
    return result


def _times_wave(waves: Polynomial, atom: Atom) -> Polynomial:
    """A sum of sines and cosines times one more: 2 cos a cos b = cos(a - b) + cos(a + b)."""
    result: Polynomial = {}
    for monomial, coefficient in waves.items():
        if not monomial:
            result = total(result, {((atom, 1),): coefficient})
            continue
        ((kind, a), _), (other, b) = monomial[0], atom
        if (kind, other) == ("c", "s"):
            (kind, a), (other, b) = (other, b), (kind, a)
        minus, plus = _sum_of(a, b, -1), _sum_of(a, b, 1)
        half = coefficient / 2
        if kind == "s" and other == "c":
            parts = [_wave("s", plus, half), _wave("s", minus, half)]
        else:
            sign = 1 if kind == "c" else -1
            parts = [_wave("c", minus, half), _wave("c", plus, sign * half)]
        for part in parts:
            result = total(result, part)
    return result


def _sum_of(
    a: Iterable[tuple[int, int]], b: Iterable[tuple[int, int]], sign: int
) -> tuple[tuple[int, int], ...]:
    times = dict(a)
    for number, factor in b:
        times[number] = times.get(number, 0) + sign * factor
    return tuple(sorted((number, factor) for number, factor in times.items() if factor))


def _wave(
    kind: Literal["s", "c"], angle: tuple[tuple[int, int], ...], coefficient: Fraction
) -> Polynomial:
    if not angle:
        return {(): coefficient} if kind == "c" else {}
    if angle[0][1] < 0:
        angle = tuple((number, -factor) for number, factor in angle)
        coefficient = -coefficient if kind == "s" else coefficient
    return {(((kind, angle), 1),): coefficient}


@dataclass(frozen=True, slots=True)
class Factored:
    """A number times powers of polynomials."""

    number: Fraction
    factors: tuple[tuple[Polynomial, int], ...]


def factored(polynomial: Polynomial) -> Factored:
    """The factors of a polynomial, each in its shortest writing.

    Raises:
        NotTrigonometric: it is too long to be factored in a moment.
    """
    if not polynomial:
        return Factored(Fraction(0), ())
    choices = [_factor(lowered(polynomial, which)) for which in ("s", "c")]
    best = min(choices, key=lambda found: sum(len(f) for f, _ in found.factors))
    return Factored(best.number, tuple((_shortest(f), power) for f, power in best.factors))


def _shortest(polynomial: Polynomial) -> Polynomial:
    summed = with_sums_of_angles(polynomial)
    return summed if len(summed) < len(polynomial) else polynomial


def _factor(polynomial: Polynomial) -> Factored:
    if len(polynomial) == 1:
        ((monomial, coefficient),) = polynomial.items()
        return Factored(
            coefficient, tuple(({((atom, 1),): Fraction(1)}, power) for atom, power in monomial)
        )
    if len(polynomial) > _MOST_FACTORED:
        raise NotTrigonometric
    import sympy

    atoms = sorted({atom for monomial in polynomial for atom, _ in monomial})
    symbols = sympy.symbols(f"x0:{len(atoms)}")
    terms = {
        tuple(dict(monomial).get(atom, 0) for atom in atoms): sympy.Rational(
            coefficient.numerator, coefficient.denominator
        )
        for monomial, coefficient in polynomial.items()
    }
    number, parts = sympy.Poly.from_dict(terms, *symbols).factor_list()
    return Factored(
        Fraction(int(number.p), int(number.q)),
        tuple((_from_powers(part.as_dict(), atoms), int(power)) for part, power in parts),
    )


def _from_powers(terms: Mapping[tuple[int, ...], object], atoms: list[Atom]) -> Polynomial:
    return {
        tuple((atom, power) for atom, power in zip(atoms, powers, strict=True) if power): Fraction(
            str(coefficient)
        )
        for powers, coefficient in terms.items()
    }
