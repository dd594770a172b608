"""Polynomials in sines and cosines as CasADi expressions and as text."""

from __future__ import annotations

import re
from collections.abc import Callable

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.models.trigonometric import Atom, Polynomial


def value(polynomial: Polynomial, variables: SX) -> SX:
    """The polynomial as a CasADi expression."""
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
    """The polynomial as one reads it; products by number, length, sine and cosine in this order.

    Args:
        polynomial: what to write.
        names: of the variables.
        name_of_angle: writes a sine or cosine.
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
    """Names of the variables [q; p] of a system, and of sines and cosines of their sums."""

    def __init__(self, system: System) -> None:
        positions = [coordinate.name for coordinate in system.coordinates]
        self._positions = len(positions)
        self._names = [*positions, *(parameter.name for parameter in system.parameters)]
        taken = any(re.fullmatch(r"[SC]\d+", name) for name in self._names)
        self._short = [
            "" if taken or not re.fullmatch(r"q\d", name) else name[1:] for name in self._names
        ]

    def is_constant(self, polynomial: Polynomial) -> bool:
        """Whether no position is in it."""
        return all(
            number >= self._positions
            for monomial in polynomial
            for (_, of), _ in monomial
            for number, _ in of
        )

    def text(self, polynomial: Polynomial) -> str:
        """The polynomial as one reads it."""
        return text(polynomial, self._names, self._angle)

    def _angle(self, atom: Atom) -> str:
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
