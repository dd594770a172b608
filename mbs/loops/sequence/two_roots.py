"""Equations with two roots, by the sign of one of them: X cos t + Y sin t = Z, a r^2 + b r + c = 0.

Both give a finite number for every argument: where the roots are not real, the point of the fold
between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

_TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Root:
    """A root and what tells whether it may be used.

    Attributes:
        value: the angle in (-pi, pi] [rad], or the number.
        real: radicand, free of units; the root is real where it is not negative.
        regular: free of units; zero where every number is a root, or none.
    """

    value: SX
    real: SX
    regular: SX


def cosine_root(X: SX, Y: SX, Z: SX, sign: SX, scale: SX | float = 1.0) -> Root:
    """The root of X cos t + Y sin t = Z on one side of the direction (X, Y).

    Source: Khalil & Creusot 1997, section 3.3, equation of type 2.

    Args:
        X: factor of cos t.
        Y: factor of sin t.
        Z: the right side.
        sign: +1 for the root at a positive angle from that direction, -1 for the other.
        scale: of the size of what the coefficients are sums of, in their unit.
    """
    size = X * X + Y * Y
    radicand = size - Z * Z
    W = sign * casadi.sqrt(casadi.fmax(radicand, _TINY))
    angle = casadi.atan2(Y * Z + X * W, X * Z - Y * W)
    return Root(SX(angle), SX(radicand / (size + Z * Z + _TINY)), SX(size / (scale * scale)))


def angle_of(s: SX, c: SX, scale: SX | float = 1.0) -> Root:
    """The angle whose sine and cosine are s and c times one positive factor."""
    return Root(SX(casadi.atan2(s, c)), SX(1), SX((s * s + c * c) / (scale * scale)))


def square_root(square: SX, sign: SX, scale: SX | float = 1.0) -> Root:
    """The root of r^2 = square of the given sign; scale is of the size of r, in its unit."""
    value = sign * casadi.sqrt(casadi.fmax(square, _TINY))
    return Root(SX(value), SX(square / (scale * scale)), SX(1))
