"""Singular configurations of a frame: factors of the determinant of its Jacobian."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.jacobian_inverse import Selection, selection
from mbs.operations.graph import Graph, graph_of
from mbs.recursions.jacobian import random_samples
from mbs.recursions.square_jacobian import SquareJacobian
from mbs.solvers.block_triangular import Block

# Polynomials in variables, sines and cosines, from CasADi expressions, and their factors.
#
# Sines and cosines of sums of angles are expanded, even powers are reduced by s^2 + c^2 = 1, and a
# factor is printed with sums of angles if this is shorter.


Atom = tuple[Literal["x", "s", "c"], tuple[tuple[int, int], ...]]
"""Kind and argument: a variable "x", or sine "s" or cosine "c" of a sum of variables. The argument
lists (index of the variable, integer factor)."""
Monomial = tuple[tuple[Atom, int], ...]
Polynomial = dict[Monomial, Fraction]

_ROUNDING = Fraction(1, 10**13)
"""Relative size of a sum of two terms that counts as cancelled: some rounding errors of doubles,
1e-16 each."""
_CONSTANT_ROUNDING = 1e-15
"""Size relative to the largest constant below which a constant is a rounded zero, as cos(pi/2)."""
_MOST_NODES, _MOST_TERMS, _MOST_FACTORED = 200, 80, 30
"""Largest number of nodes of an expression, of terms of a polynomial, and of terms of a factored
polynomial: longer expressions take too long and are unreadable."""
_OTHER = {"s": "c", "c": "s"}


class NotTrigonometric(Exception):
    """The expression is not a polynomial in variables, sines and cosines, or is too long."""


def variable(number: int) -> Polynomial:
    """Return the polynomial that equals the variable with index `number`."""
    return {((("x", ((number, 1),)), 1),): Fraction(1)}


def total(a: Polynomial, b: Polynomial, sign: int = 1) -> Polynomial:
    """Return the polynomial a + sign b. Raise NotTrigonometric if it is too long."""
    result = dict(a)
    for monomial, coefficient in b.items():
        _add(result, monomial, sign * coefficient)
    return _require_few_terms({m: c for m, c in result.items() if c})


def product(a: Polynomial, b: Polynomial) -> Polynomial:
    """Return the product of two polynomials. Raise NotTrigonometric if it is too long.

    Args:
        a: first factor.
        b: second factor.
    """
    result: Polynomial = {}
    for m, x in a.items():
        for n, y in b.items():
            _add(result, _join(m, n), x * y)
    return _require_few_terms({m: c for m, c in result.items() if c})


def _add(result: Polynomial, monomial: Monomial, coefficient: Fraction) -> None:
    """Add coefficient times monomial to a polynomial, in place; rounding errors become zero."""
    before = result.get(monomial, Fraction(0))
    both = before + coefficient
    cancelled = abs(both) <= _ROUNDING * (abs(before) + abs(coefficient))
    result[monomial] = Fraction(0) if cancelled else both


def _join(m: Monomial, n: Monomial) -> Monomial:
    """Return the product of two monomials: exponents of equal atoms (sines, cosines) are added."""
    powers = dict(m)
    for atom, power in n:
        powers[atom] = powers.get(atom, 0) + power
    return tuple(sorted(powers.items()))


def _require_few_terms(polynomial: Polynomial) -> Polynomial:
    """Return a polynomial; raise NotTrigonometric if it has too many terms."""
    if len(polynomial) > _MOST_TERMS:
        raise NotTrigonometric
    return polynomial


def polynomial_of(expression: SX, variables: SX) -> Polynomial:
    """Return an expression as a polynomial in variables, their sines and cosines.

    Args:
        expression: scalar expression.
        variables: (n, 1) symbols.

    Raises:
        NotTrigonometric: the expression is not such a polynomial, or is too long.
    """
    graph = graph_of(Function("f", [variables], [casadi.densify(expression)], {"cse": True}))
    if len(graph.nodes) > _MOST_NODES:
        raise NotTrigonometric
    least = _CONSTANT_ROUNDING * max((abs(node.value) for node in graph.nodes), default=0.0)
    values: list[Polynomial] = []
    for number in range(len(graph.nodes)):
        values.append(lowered(_node_polynomial(graph, number, values, least), "s"))
    return values[graph.results[0][0]]


def _node_polynomial(
    graph: Graph, number: int, values: list[Polynomial], least: float
) -> Polynomial:
    """Return the polynomial of node `number` of an expression graph.

    Args:
        graph: expression graph.
        number: index of the node.
        values: polynomials of all earlier nodes.
        least: size below which a constant is zero.
    """
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
    """Return the polynomial of the CasADi operation `op`; raise NotTrigonometric if it is none."""
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
    """Return the constant polynomial; zero for a number up to `least`, its rounding error.

    Raise NotTrigonometric if the number is not finite.
    """
    if not math.isfinite(value):
        raise NotTrigonometric
    return {(): Fraction(repr(value))} if abs(value) > least else {}


def _sine_cosine(angle: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Return sine and cosine of a sum of variables, expanded by the addition theorems.

    Raise NotTrigonometric unless the factors are whole numbers from -4 to 4.
    """
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
    """Eliminate even powers of sines ("s") or of cosines ("c") by s^2 + c^2 = 1.

    Args:
        polynomial: polynomial to reduce.
        which: kind to eliminate.
    """
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
    """Return a polynomial with products of sines and cosines as functions of sums of angles."""
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
    """Return a sum of sines and cosines times the sine or cosine `atom`, again as a sum.

    The identities are such as 2 cos a cos b = cos(a - b) + cos(a + b).
    """
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
    """Return a + sign b of two integer combinations of angles, ((index, factor), ...)."""
    times = dict(a)
    for number, factor in b:
        times[number] = times.get(number, 0) + sign * factor
    return tuple(sorted((number, factor) for number, factor in times.items() if factor))


def _wave(
    kind: Literal["s", "c"], angle: tuple[tuple[int, int], ...], coefficient: Fraction
) -> Polynomial:
    """Return the polynomial of coefficient times the sine ("s") or cosine ("c") of an angle.

    `angle` is an integer combination of variables, ((index, factor), ...). The sign of its first
    factor is made positive.
    """
    if not angle:
        return {(): coefficient} if kind == "c" else {}
    if angle[0][1] < 0:
        angle = tuple((number, -factor) for number, factor in angle)
        coefficient = -coefficient if kind == "s" else coefficient
    return {(((kind, angle), 1),): coefficient}


@dataclass(frozen=True, slots=True)
class Factored:
    """Product of a number and powers of polynomials.

    Attributes:
        number: rational coefficient.
        factors: pairs (polynomial, power).
    """

    number: Fraction
    factors: tuple[tuple[Polynomial, int], ...]


def factored(polynomial: Polynomial) -> Factored:
    """Return a polynomial as a product of factors, each in its shortest form.

    Raises:
        NotTrigonometric: the polynomial is too long.
    """
    if not polynomial:
        return Factored(Fraction(0), ())
    choices = [_factored(lowered(polynomial, which)) for which in ("s", "c")]
    best = min(choices, key=lambda found: sum(len(f) for f, _ in found.factors))
    return Factored(best.number, tuple((_shortest(f), power) for f, power in best.factors))


def _shortest(polynomial: Polynomial) -> Polynomial:
    """Return the polynomial, or its form with sums of angles if that has fewer terms."""
    summed = with_sums_of_angles(polynomial)
    return summed if len(summed) < len(polynomial) else polynomial


def _factored(polynomial: Polynomial) -> Factored:
    """Return a polynomial as a product of powers; raise NotTrigonometric if it is too long."""
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
    """Return the polynomial with given coefficients.

    `terms` maps from the exponents of the `atoms`, in their order, to the coefficient of the term.
    """
    return {
        tuple((atom, power) for atom, power in zip(atoms, powers, strict=True) if power): Fraction(
            str(coefficient)
        )
        for powers, coefficient in terms.items()
    }


# Polynomials in sines and cosines as CasADi expressions and as text.


def value(polynomial: Polynomial, variables: SX) -> SX:
    """Return a polynomial as a CasADi expression in `variables`."""
    result = SX(0)
    for monomial, coefficient in polynomial.items():
        term = SX(float(coefficient))
        for (kind, of), power in monomial:
            angle = SX(0)
            for number, factor in of:
                angle = angle + factor * variables[number]
            base = {"x": angle, "s": casadi.sin(angle), "c": casadi.cos(angle)}[kind]
            for _ in range(power):
                term = term * base
        result = result + term
    return result


def text(polynomial: Polynomial, names: list[str], name_of_angle: Callable[[Atom], str]) -> str:
    """Return a polynomial as text; a product has number, variables, cosines, sines in this order.

    Args:
        polynomial: polynomial to print.
        names: names of the variables.
        name_of_angle: callable that prints a sine or cosine.
    """
    written = ""
    for monomial, coefficient in polynomial.items():
        powers = sorted(monomial, key=lambda entry: (entry[0][0] != "x", entry[0]))
        parts = [
            (names[of[0][0]] if kind == "x" else name_of_angle((kind, of)))
            + (f"^{power}" if power > 1 else "")
            for (kind, of), power in powers
        ]
        size = abs(coefficient)
        if size != 1 or not parts:
            parts.insert(0, f"{float(size):.12g}")
        sign = "-" if coefficient < 0 else "+"
        if written:
            written += f" {sign} "
        elif sign == "-":
            written = "-"
        written += "*".join(parts)
    return written or "0"


class Writer:
    """Printer of polynomials in the variables [q; p] of a system.

    If positions are named q1, q2, ..., sin(q2 + q3) is printed as S23.
    """

    def __init__(self, system: System) -> None:
        positions = [coordinate.name for coordinate in system.coordinates]
        self._positions = len(positions)
        self._names = [*positions, *(parameter.name for parameter in system.parameters)]
        taken = any(re.fullmatch(r"[SC]\d+", name) for name in self._names)
        self._short = [
            "" if taken or not re.fullmatch(r"q\d", name) else name[1:] for name in self._names
        ]

    def is_constant(self, polynomial: Polynomial) -> bool:
        """Return whether a polynomial is independent of all positions."""
        return all(
            number >= self._positions
            for monomial in polynomial
            for (_, of), _ in monomial
            for number, _ in of
        )

    def text(self, polynomial: Polynomial) -> str:
        """Return a polynomial as text."""
        return text(polynomial, self._names, self._angle)

    def _angle(self, atom: Atom) -> str:
        """Return the text of a sine or cosine: S23, or sin(q2 + q3)."""
        kind, of = atom
        if all(times == 1 and self._short[number] for number, times in of):
            return kind.upper() + "".join(self._short[number] for number, _ in of)
        written = ""
        for number, times in of:
            sign = " - " if times < 0 else " + "
            size = "" if abs(times) == 1 else f"{abs(times)}*"
            lead = sign if written else sign.strip().replace("+", "")
            written += f"{lead}{size}{self._names[number]}"
        return {"s": "sin", "c": "cos"}[kind] + f"({written})"


_FACTORED = 3
"""Largest size of a block whose determinant is factored: larger determinants are too long."""
_SAME = 1e-9
"""Tolerance between the product of the factors and the determinant, relative to the largest value:
rounding errors are smaller, while a wrong factor has a relative error of order one."""


@dataclass(frozen=True, slots=True, eq=False)
class SingularFactor:
    """Factor of the determinant; configurations at which it is zero are singular.

    Attributes:
        text: printed factor; S23 denotes sin(q2 + q3).
        power: exponent of the factor in the determinant.
        function: Function ``factor(q) -> value`` of the factor without the exponent.
    """

    text: str
    power: int
    function: Function

    def __str__(self) -> str:
        if self.power == 1:
            return self.text
        return f"({self.text})^{self.power}" if " " in self.text else f"{self.text}^{self.power}"


@dataclass(frozen=True, slots=True, eq=False)
class Singularities:
    """Determinant of a square submatrix of a Jacobian as a constant times factors.

    Attributes:
        constant: printed factor that is independent of the positions.
        factors: factors that depend on the positions; empty if no configuration is singular.
        determinant: Function ``determinant(q) -> det``.
    """

    constant: str
    factors: tuple[SingularFactor, ...]
    determinant: Function

    def __str__(self) -> str:
        return " * ".join([f"({self.constant})", *(f"({factor})" for factor in self.factors)])


def singularities(
    system: System,
    frame: str | int,
    rows: Sequence[int | str] | None = None,
    columns: Sequence[int | str] | None = None,
    *,
    expressed_in: str | int = "base",
    coordinates: str = "independent",
) -> Singularities:
    """Return the singular configurations of a frame, as factors of a determinant.

    It is the determinant of the Jacobian of the frame, or of a square submatrix.

    Each diagonal block of the block triangular Jacobian contributes its determinant. Determinants
    of blocks of up to three rows are factored as polynomials in sines and cosines. The determinant
    of a larger block is a single factor.

    Source: Khalil & Creusot 1997, section 4.6.

    Args:
        system: open or closed mechanism; q must close the loops.
        frame: name of a body or frame, or index of a link.
        rows: rows of [V; w], indices 0 to 5 or names "Vx" to "wz"; all six by default.
        columns: velocities, as many as rows, by 0-based index or name; by default the velocities
            that move the frame.
        expressed_in: frame whose axes the rows are expressed in.
        coordinates: velocities of a closed system, "independent" or "tree".

    Returns:
        constant and factors; constant "0" and no factors if every configuration is singular.

    Raises:
        ModelError: the frame, a row or a column is unknown, or the numbers of rows and columns
            differ.
    """
    chosen = selection(system, frame, rows, columns, expressed_in, coordinates)
    found: Singularities = system.cached(
        ("singularities", chosen), lambda: _singularities(system, chosen)
    )
    return found


def _singularities(system: System, chosen: Selection) -> Singularities:
    """Return the factors of the determinant of a selected square Jacobian."""
    q, square = chosen.of(system)
    whole = chosen.determinant(system)
    if square.blocks is None:
        return Singularities("0", (), whole)
    constant, factors = _constant_and_factors(system, chosen, square, q)
    return Singularities(constant, tuple(factors), whole)


def _constant_and_factors(
    system: System, chosen: Selection, square: SquareJacobian, q: SX
) -> tuple[str, list[SingularFactor]]:
    """Return the constant factor of a determinant as text, and its factors that depend on q.

    The determinant is that of the Jacobian `square` of the selection `chosen`, at the symbols `q`.
    """
    writer, variables = Writer(system), casadi.vertcat(q, system.p)
    number = Fraction(square.sign)
    powers: dict[str, int] = {}
    constants: dict[str, int] = {}
    values: dict[str, SX] = {}
    assert square.blocks is not None
    for block, det in zip(square.blocks, square.determinants(), strict=True):
        parts = _block_factors(system, block, det, variables)
        if parts is None:
            label = _label(chosen, block)
            powers[label], values[label] = 1, det
            continue
        number *= parts.number
        for part, power in parts.factors:
            polynomial, scale = _scale(part)
            number *= scale**power
            written = writer.text(polynomial)
            found = constants if writer.is_constant(polynomial) else powers
            found[written] = found.get(written, 0) + power
            values[written] = value(polynomial, variables)
    factors = [
        SingularFactor(written, power, _factor(system, chosen, k, q, values[written]))
        for k, (written, power) in enumerate(powers.items())
    ]
    return _product_text(number, constants), factors


def _block_factors(system: System, block: Block, det: SX, variables: SX) -> Factored | None:
    """Return the factors of the determinant of a block in `variables`, checked at random points.

    None if the block is too large or the check fails.
    """
    if block.size > _FACTORED:
        return None
    try:
        parts = factored(polynomial_of(det, variables))
    except NotTrigonometric:
        return None
    back = SX(float(parts.number))
    for polynomial, power in parts.factors:
        back = back * value(polynomial, variables) ** power
    f = Function("f", [variables], [det, back])
    samples = random_samples(system.tree, len(system.parameters))
    pairs = [tuple(map(float, f(np.concatenate(sample)))) for sample in samples]
    allowed = _SAME * max(abs(a) for a, _ in pairs)
    return parts if all(abs(a - b) <= allowed for a, b in pairs) else None


def _scale(polynomial: Polynomial) -> tuple[Polynomial, Fraction]:
    """Return a polynomial with a positive first coefficient and coefficients up to 12.

    The second result is the scale by which it was divided.
    """
    first = next(iter(polynomial.values()))
    largest = max(abs(coefficient) for coefficient in polynomial.values())
    scale = Fraction(1)
    if largest > 12:
        scale = Fraction(10) ** math.ceil(math.log10(largest))
    scale = -scale if first < 0 else scale
    return {monomial: c / scale for monomial, c in polynomial.items()}, scale


def _product_text(number: Fraction, constants: dict[str, int]) -> str:
    """Return the text of `number` times powers of constant expressions.

    `constants` maps from the text of an expression to its exponent.
    """
    if not constants:
        return f"{float(number):.12g}"
    sign = "-" if number < 0 else ""
    parts = [] if abs(number) == 1 else [f"{float(abs(number)):.12g}"]
    for written, power in constants.items():
        closed = f"({written})" if " " in written else written
        parts.append(closed + (f"^{power}" if power > 1 else ""))
    return sign + "*".join(parts)


def _label(chosen: Selection, block: Block) -> str:
    """Return a description of a block of the selected Jacobian that is not factored."""
    names = ", ".join(chosen.names[column] for column in block.columns)
    return f"determinant of the {block.size} x {block.size} block of {names}"


def _factor(system: System, chosen: Selection, number: int, q: SX, expression: SX) -> Function:
    """Return ``singular_factor(q) -> value``, the Function of factor `number` of a determinant.

    `expression` is the factor at the symbols `q`; `chosen` selects the Jacobian.
    """

    def build() -> tuple[Named, Named]:
        return [("q", q)], [("value", expression)]

    return model_function(system, ("singular_factor", chosen, number), build)
