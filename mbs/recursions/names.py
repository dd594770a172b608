"""SYMORO names of the quantities that the recursions compute.

The index of the element precedes the link number: W32 is the third element of the angular velocity
of link 2. From link 10 on, an underscore separates the two numbers: W3_12.

Source: Khalil & Creusot 1997, section 5.1; docs/notation.md lists them.
"""

from __future__ import annotations

from casadi import SX

from mbs.recursions.newton_euler import Dynamics


def newton_euler_names(dynamics: Dynamics) -> list[tuple[str, SX]]:
    """Return pairs (SYMORO name, scalar) of the intermediate results of a Newton-Euler recursion.

    Constants and single symbols are left out. The first letters of a name are W and WP (angular
    velocity and acceleration), U (its matrix), VP (acceleration), F and NO (force and moment of the
    link itself), E and N (force and moment that the joint transmits). Digits are element and link.

    Args:
        dynamics: results of `newton_euler`.
    """
    named: list[tuple[str, SX]] = []
    for j, motion in enumerate(dynamics.motions, 1):
        own, joint = dynamics.own[j - 1], dynamics.wrenches[j - 1]
        for name, matrix in (
            ("W", motion.w),
            ("WP", motion.wd),
            ("U", motion.rate.U),
            ("VP", motion.vd),
            ("F", own[0]),
            ("NO", own[1]),
            ("E", joint[0]),
            ("N", joint[1]),
        ):
            named.extend(_elements(name, matrix, j))
    return named


def _elements(name: str, matrix: SX, link: int) -> list[tuple[str, SX]]:
    """Return pairs (name, element) of a matrix of link number `link`, counted from 1.

    Constants and single symbols are left out.
    """
    rows, columns = matrix.shape
    named = []
    for column in range(columns):
        for row in range(rows):
            value = matrix[row, column]
            place = f"{row + 1}{column + 1}" if columns > 1 else f"{row + 1}"
            if not value.is_constant() and not value.is_symbolic():
                named.append((f"{name}{place}{'_' if link > 9 else ''}{link}", value))
    return named
