"""The matrix U of a turning body, and its moment, on the fewest products.

Source: Balafoutis, Patel & Misra 1988 for the moment; Khalil & Creusot 1997, eq. 8-10.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX


@dataclass(frozen=True, slots=True, eq=False)
class RotationRate:
    """How acceleration changes over a turning body: U = skew(wd) + skew(w) skew(w).

    Attributes:
        U: (3, 3) [rad/s^2].
        spread: U33 - U22, U11 - U33 and U22 - U11.
    """

    U: SX
    spread: tuple[SX, SX, SX]


def rotation_rate(w: SX, wd: SX, across: SX | None = None, still: SX | None = None) -> RotationRate:
    """U on six products of the velocities, or on five.

    Args:
        w: (3, 1) angular velocity.
        wd: (3, 1) angular acceleration.
        across: x^2 + y^2 of w where it is known; y^2 then needs no product.
        still: (3, 1) part of wd that is not w x (0, 0, z), where z is the third element of w;
            then U13 and U23 are elements of it.
    """
    x, y, z = w[0], w[1], w[2]
    xx, zz, xy, xz, yz = x * x, z * z, x * y, x * z, y * z
    xy_square = xx + y * y if across is None or x.is_zero() or y.is_zero() else across
    xz_square, xz_difference = xx + zz, xx - zz
    yz_square = xy_square - xz_difference
    U13, U23 = (xz + wd[1], yz - wd[0]) if still is None else (still[1], -still[0])
    U = casadi.vertcat(
        casadi.horzcat(-yz_square, xy - wd[2], U13),
        casadi.horzcat(xy + wd[2], -xz_square, U23),
        casadi.horzcat(xz - wd[1], yz + wd[0], -xy_square),
    )
    return RotationRate(U, (xz_square - xy_square, xz_difference, yz_square - xz_square))


def moment_of_rotation(S: SX, rate: RotationRate) -> SX:
    """(3, 1) J wd + w x (J w), the skew part of U S: thirteen products when S[2, 2] is zero.

    Row x is (U S)_zy - (U S)_yz, the integral of y (U r)_z - z (U r)_y.

    Args:
        S: (3, 3) second moments of the body's mass.
        rate: of its rotation.
    """
    rows, U = [], rate.U
    for k in range(3):
        m, n = (k + 1) % 3, (k + 2) % 3
        row = U[n, k] * S[k, m] - U[m, k] * S[k, n] + rate.spread[k] * S[m, n]
        rows.append(row + _difference(U[n, m], S[m, m], U[m, n], S[n, n]))
    return casadi.vertcat(*rows)


def _difference(a: SX, first: SX, b: SX, second: SX) -> SX:
    """A first - b second; one product when a = b or a = -b."""
    if (a + b).is_zero():
        return a * (first + second)
    if (a - b).is_zero():
        return a * (first - second)
    return a * first - b * second
