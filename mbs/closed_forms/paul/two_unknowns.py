"""Steps from two equations in two unknowns; an angle is eliminated. Types 4 to 8, and quartics.

Both have the form Re(k_i h(y) e^iq) + B_i(y) = 0 with two numbers k_i. They determine w = h e^iq as
a function of y. The condition |w|^2 = |h|^2 is an equation in y alone: of type 2 or quadratic, or a
quartic. Then q is solved from two equations of type 3.

Source: Khalil & Dombre 2002, table 4.1; the product h(y) as in Pieper 1968.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import casadi
import numpy as np
from casadi import SX

from mbs.closed_forms.paul.equation import Equation, Key
from mbs.closed_forms.paul.one_unknown import (
    Candidate,
    PaulStage,
    angle_step,
    length_step,
    unsteady,
)
from mbs.closed_forms.paul.splits import Variable
from mbs.closed_forms.sequence import Found, SequenceStep, real_quartic, step, trigonometric_quartic

_SMALL = 1e-7
"""Largest factor and relative coefficient that counts as zero, for equations with coefficients of
about one: products of several factors magnify the 1e-12 to which the samples close."""
_VANISHES = 1e-14
"""Largest coefficient of a resultant below which all its coefficients are rounding: they are sums
of products of factors of about one. Above it, `_SMALL` decides."""
_PARALLEL = 1e-5
"""Imaginary part of the ratio of two factors of about one, below which they are parallel and
nothing can be eliminated: a step that divides by less would lose five digits."""
_ROWS = 8

Numbers = list[Any]
Complex = tuple[Any, Any]


@dataclass(frozen=True, slots=True, eq=False)
class _Form:
    """Equation in the form Re(G(y) e^iq) + B(y) = 0.

    Attributes:
        G: complex factors (real, imaginary) of e^-iy, 1, e^iy, or of 1, r, r^2.
        B: factors of 1, cos y, sin y, or of 1, r, r^2.
    """

    G: list[Complex]
    B: Numbers


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """Two equations, their remaining unknown y and their eliminated unknown q.

    Attributes:
        rows: equations.
        stays: index of the remaining unknown among the variables.
        power: index of a factor of G that is not zero.
    """

    rows: tuple[Equation, Equation]
    stays: int
    power: int

    @property
    def variable(self) -> Variable:
        """Remaining unknown."""
        return self.rows[0].variables[self.stays]


def two_unknowns(stage: PaulStage) -> Iterator[Candidate]:
    """Yield steps that solve one of two unknowns from two equations in both.

    Args:
        stage: known quantities and equations.
    """
    groups = dict[tuple[Variable, ...], list[Equation]]()
    for equation in stage.equations:
        if len(equation.variables) == 2:
            groups.setdefault(equation.variables, []).append(equation)
    for variables, rows in groups.items():
        for stays in (0, 1):
            if variables[1 - stays].prismatic:
                continue
            fit = [row for row in rows if _fits(row, stays)]
            fit = sorted(fit, key=lambda row: row.cost)[:_ROWS]
            for first, second in combinations(fit, 2):
                candidate = _candidate(stage, (first, second), stays)
                if candidate is not None:
                    yield candidate


def _fits(row: Equation, stays: int) -> bool:
    """Whether an equation is linear in the variable to eliminate and of low degree in the other.

    `stays` is the index (0 or 1) of the variable that remains.
    """
    most = 2 if row.variables[stays].prismatic else 1
    return any(key[1 - stays] for key in row.parts) and all(
        abs(key[1 - stays]) <= 1 and abs(key[stays]) <= most for key in row.parts
    )


def _candidate(stage: PaulStage, rows: tuple[Equation, Equation], stays: int) -> Candidate | None:
    """Return the step of two equations with variable `stays` (0 or 1); None if it is impossible.

    `rows` are the two equations; the other variable is eliminated.
    """
    forms = [_form_of_values(row, stays) for row in rows]
    power = _common_power(forms)
    if power is None:
        return None
    F = np.array(np.broadcast_arrays(*_resultant(forms, power, rows[0].variables[stays].prismatic)))
    size = np.max(np.abs(F), axis=0)
    if np.min(size) < _VANISHES:
        return None
    shares = np.max(np.abs(F) / size, axis=1) > _SMALL
    if not np.any(shares[1:]):
        return None
    quartic = bool(np.any(shares[3:]))
    pair = _Pair(rows, stays, power)
    leading = np.sum(F[1:] ** 2, axis=0)
    cost = float(sum(row.cost for row in rows))
    sums = 0.0 if pair.variable.single else 0.5
    # rank 6 to 7.5, after single equations: quadratics before quartics, joints before sums of
    # joints
    rank = (6.0 + quartic + sums, unsteady(leading), cost)
    return Candidate(rank, (pair.variable,), lambda: _pair_step(stage, pair, shares))


def _common_power(forms: Sequence[_Form]) -> int | None:
    """Return the index of a factor of G from which the other unknown follows in both forms.

    None if the factors are dependent, or do not have one ratio.
    """
    first, second = (np.array([re + 1j * im for re, im in _spread(form.G)]) for form in forms)
    sizes = np.min(np.abs(first), axis=1)
    power = 1 if len(sizes) == 3 and sizes[1] > _SMALL else int(np.argmax(sizes))
    if sizes[power] < _SMALL:
        return None
    ratio = second[power] / first[power]
    if np.min(np.abs(ratio.imag)) < _PARALLEL or np.max(np.abs(second - ratio * first)) > _SMALL:
        return None
    return power


def _spread(G: list[Complex]) -> list[Complex]:
    """Return the pairs (real, imaginary) of arrays in G, broadcast to one shape."""
    arrays = np.broadcast_arrays(*(part for pair in G for part in pair))
    return [(arrays[2 * k], arrays[2 * k + 1]) for k in range(len(G))]


def _form_of_values(row: Equation, stays: int) -> _Form:
    """Return an equation `row` as Re(G(y) e^iq) + B(y) = 0 with numeric coefficients.

    `stays` is the index (0 or 1) of the variable y that remains; q is eliminated.
    """

    def part(key: Key) -> Complex:
        values = row.at(key)
        return values.real, -values.imag

    return _form(row, stays, part)


def _form(row: Equation, stays: int, part: Callable[[Key], Complex]) -> _Form:
    """Return an equation as Re(G(y) e^iq) + B(y) = 0, in the remaining unknown y and the other, q.

    `stays` is the index (0 or 1) of the variable y that remains.

    `part` maps the exponents of a product of the variables to its coefficients X and Y.
    """
    prismatic = row.variables[stays].prismatic

    def key(y: int, q: int) -> Key:
        return (y, q) if stays == 0 else (q, y)

    def G(y: int) -> Complex:
        conjugate = stays == 0 and y < 0
        X, Y = part(key(-y, -1) if conjugate else key(y, 1))
        if conjugate:
            return X, Y
        return X, -Y

    if prismatic:
        return _Form([G(y) for y in (0, 1, 2)], [part(key(y, 0))[0] for y in (0, 1, 2)])
    X, Y = part(key(1, 0))
    return _Form([G(y) for y in (-1, 0, 1)], [part(key(0, 0))[0], X, Y])


def _resultant(forms: Sequence[_Form], power: int, prismatic: bool) -> Numbers:
    """Return the coefficients of the equation in y alone: of 1, y .. y^4, or 1, c, s, c2, s2.

    `power` is the index of the factor by which the other unknown is eliminated.

    `forms` are the two equations, `prismatic` whether y is a length; c and s are cosine and sine of
    y, c2 and s2 of 2 y.
    """
    (x, y), (u, v) = forms[0].G[power], forms[1].G[power]
    n, a, b = x * x + y * y, u * x + v * y, v * x - u * y
    other = [a * one - n * two for one, two in zip(forms[0].B, forms[1].B, strict=True)]
    squares = [_squared(forms[0].B, prismatic), _squared(other, prismatic)]
    size = _squared_magnitude(forms[0].G, prismatic)
    return [
        b * b * one + two - b * b * three for one, two, three in zip(*squares, size, strict=True)
    ]


def _squared(B: Numbers, prismatic: bool) -> Numbers:
    """Return the coefficients of the square of B[0] + B[1] y + B[2] y^2 of a length y.

    For an angle, B multiplies 1, cos y, sin y, and the result multiplies 1, c, s, c2, s2.

    `prismatic` is whether y is a length; c2 and s2 are cos 2y and sin 2y.
    """
    z, x, y = B
    if prismatic:
        return [z * z, 2 * z * x, x * x + 2 * z * y, 2 * x * y, y * y]
    return [z * z + (x * x + y * y) / 2, 2 * z * x, 2 * z * y, (x * x - y * y) / 2, x * y]


def _squared_magnitude(G: list[Complex], prismatic: bool) -> Numbers:
    """Return the coefficients of the squared magnitude of the complex form G in y.

    They have the order of `_squared`.

    `prismatic` is whether y is a length.
    """
    if prismatic:
        parts = [_squared([part[k] for part in G], True) for k in (0, 1)]
        return [one + two for one, two in zip(*parts, strict=True)]
    (a, b), (c, d), (e, f) = G
    first = (c * a + d * b + e * c + f * d, d * a - c * b + f * c - e * d)
    second = (e * a + f * b, f * a - e * b)
    constant = a * a + b * b + c * c + d * d + e * e + f * f
    return [constant, 2 * first[0], -2 * first[1], 2 * second[0], -2 * second[1]]


def _pair_step(stage: PaulStage, pair: _Pair, shares: Any) -> SequenceStep:
    """Return the step of a pair of equations; `shares` masks the nonzero coefficients."""

    def forms(row: Equation) -> _Form:
        def part(key: Key) -> Complex:
            own = stage.factor(row, key)
            return own.X, own.Y

        return _form(row, pair.stays, part)

    prismatic = pair.variable.prismatic
    F = _resultant([forms(row) for row in pair.rows], pair.power, prismatic)
    F = [SX(value) if share else SX(0) for value, share in zip(F, shares, strict=True)]
    powers = [row.row.power for row in pair.rows]
    unit = 4 * powers[0] + 2 * powers[1] - (4 * pair.power if prismatic else 0)
    if np.any(shares[3:]):
        return _quartic_step(stage, pair.variable, F, unit)
    if prismatic:
        return length_step(stage, pair.variable, F[2::-1], _type_name(pair))
    return angle_step(stage, pair.variable, (F[1], F[2], -F[0]), unit, _type_name(pair))


def _type_name(pair: _Pair) -> str:
    """Return the type of a pair of equations in the table of Khalil: "type 4" to "type 8"."""
    goes = 1 - pair.stays
    factors = {abs(key[pair.stays]) for row in pair.rows for key in row.parts if key[goes]}
    if pair.variable.prismatic:
        return "type 4" if factors == {1} else "type 5"
    if factors != {0}:
        return "type 8"
    own = [part.values for row in pair.rows for key, part in row.parts.items() if key[goes]]
    plain = all(np.max(np.abs(G.real)) * np.max(np.abs(G.imag)) < _SMALL for G in own)
    return "type 6" if plain else "type 7"


def _quartic_step(stage: PaulStage, variable: Variable, F: list[SX], unit: int) -> SequenceStep:
    """Return the step of a quartic with coefficients F and four roots.

    `unit` is the power of a length that is the unit of F.

    `variable` is the unknown.
    """
    number, shown = stage.number(variable), stage.term(variable)
    signs = SX.sym("sign", 2)
    scale = stage.matrices.length**unit if unit else SX(1)
    if variable.prismatic:
        root = real_quartic(casadi.vertcat(*F[::-1]), signs, stage.matrices.length, scale)
        pieces = ["", f" {shown}", f" {shown}^2", f" {shown}^3", f" {shown}^4"]
    else:
        ordered = casadi.vertcat(F[3], F[4], F[1], F[2], F[0])
        root = trigonometric_quartic(ordered, signs, scale)
        angles = (f"({shown})", f"(2 ({shown}))" if not variable.single else f"(2 {shown})")
        pieces = ["", *(f" {f}{angle}" for angle in angles for f in ("cos", "sin"))]
    names = [f"{letter}{number}" for letter in "ABCDE"]
    named = {n: value for n, value in zip(names, F, strict=True) if not value.is_zero()}
    text = [n + piece for n, piece in zip(names, pieces, strict=True) if n in named]
    found = Found(
        {stage.knowledge.index(variable): root.value}, (root.real,), (root.regular,), named
    )
    name = stage.knowledge.name(variable)
    symbols = {f"{name}a": SX(signs[0]), f"{name}b": SX(signs[1])}
    equation = f"{' + '.join(text[::-1])} = 0"
    return step(stage.knowledge.problem, "quartic", equation, symbols, found)
