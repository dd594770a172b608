"""Singular postures of a frame: the determinant of its Jacobian as a product of factors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.square_selection import Selection, selection
from mbs.models.trigonometric import (
    Factored,
    NotTrigonometric,
    Polynomial,
    factored,
    polynomial_of,
)
from mbs.models.trigonometric_text import Writer, value
from mbs.recursions.square_jacobian import SquareJacobian
from mbs.recursions.survey import random_samples
from mbs.solvers.block_triangular import Block

_FACTORED = 3
"""Largest block whose determinant is factored."""
_SAME = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class SingularFactor:
    """A factor of the determinant: the posture is singular where it is zero.

    Attributes:
        text: the factor as one reads it; S23 is sin(q2 + q3).
        power: how often it is a factor.
        function: ``factor(q) -> value``.
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
    """The determinant of a square part of a Jacobian is the constant times the factors.

    Attributes:
        constant: the factor that depends on no position, as one reads it.
        factors: the others; none when no posture is singular.
        determinant: ``determinant(q) -> det``.
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
    """Where a frame loses a direction of motion: the determinant in factors.

    Every diagonal block of the Jacobian gives a factor. Those of blocks of up to three rows are
    factored further, as polynomials in sines and cosines; that of a larger block stays whole.

    Source: Khalil & Creusot 1997, section 4.6.

    Args:
        system: open or closed; q must close the loops.
        frame: a body, a named frame, or the number of a link.
        rows: of [V; w], numbers 0 to 5 or "Vx" to "wz"; all six when left out.
        columns: numbers (from 0) or names of velocities, as many; those that move the frame when
            left out.
        expressed_in: the frame in whose axes the rows are.
        coordinates: of a closed system, "independent" or "tree".

    Returns:
        The factors; a constant "0" and no factor when every posture is singular.

    Raises:
        ModelError: no such frame, row or column, or not as many rows as columns.
    """
    chosen = selection(system, frame, rows, columns, expressed_in, coordinates)
    found: Singularities = system.cached(
        ("singularities", chosen), lambda: _singularities(system, chosen)
    )
    return found


def _singularities(system: System, chosen: Selection) -> Singularities:
    q, square = chosen.of(system)
    whole = chosen.determinant(system)
    if square.blocks is None:
        return Singularities("0", (), whole)
    constant, factors = _constant_and_factors(system, chosen, square, q)
    return Singularities(constant, tuple(factors), whole)


def _constant_and_factors(
    system: System, chosen: Selection, square: SquareJacobian, q: SX
) -> tuple[str, list[SingularFactor]]:
    writer, variables = Writer(system), casadi.vertcat(q, system.p)
    number = Fraction(square.sign)
    powers: dict[str, int] = {}
    constants: dict[str, int] = {}
    values: dict[str, SX] = {}
    assert square.blocks is not None
    for block, det in zip(square.blocks, square.determinants(), strict=True):
        parts = _parts(system, block, det, variables)
        if parts is None:
            label = _label(chosen, block)
            powers[label], values[label] = 1, det
            continue
        number *= parts.number
        for part, power in parts.factors:
            polynomial, scale = _scaled(part)
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


def _parts(system: System, block: Block, det: SX, variables: SX) -> Factored | None:
    """The factors of a block's determinant; None where it is not factored."""
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


def _scaled(polynomial: Polynomial) -> tuple[Polynomial, Fraction]:
    """The polynomial with a positive first term and coefficients of usual size, and its scale."""
    first = next(iter(polynomial.values()))
    largest = max(abs(coefficient) for coefficient in polynomial.values())
    scale = Fraction(1)
    if largest > 12:
        scale = Fraction(10) ** math.ceil(math.log10(largest))
    scale = -scale if first < 0 else scale
    return {monomial: c / scale for monomial, c in polynomial.items()}, scale


def _product_text(number: Fraction, constants: dict[str, int]) -> str:
    if not constants:
        return f"{float(number):.12g}"
    sign = "-" if number < 0 else ""
    parts = [] if abs(number) == 1 else [f"{float(abs(number)):.12g}"]
    for written, power in constants.items():
        closed = f"({written})" if " " in written else written
        parts.append(closed + (f"^{power}" if power > 1 else ""))
    return sign + "*".join(parts)


def _label(chosen: Selection, block: Block) -> str:
    names = ", ".join(chosen.names[column] for column in block.columns)
    return f"determinant of the {block.size} x {block.size} block of {names}"


def _factor(system: System, chosen: Selection, number: int, q: SX, expression: SX) -> Function:
    def build() -> tuple[Named, Named]:
        return [("q", q)], [("value", expression)]

    return model_function(system, ("singular_factor", chosen, number), build)
