"""The sign of a velocity, smoothed: the one law of dry friction without events."""

from __future__ import annotations

import casadi
from casadi import SX


def smooth_sign(v: SX, width: SX) -> SX:
    """tanh(v / width), and sign(v) for a width of zero; element by element.

    Args:
        v: velocities [rad/s or m/s].
        width: (1, 1) velocity over which the sign changes, a number or an expression; zero in its
            values needs no care, derivatives stay finite.
    """
    if width.is_zero():
        return casadi.sign(v)
    if width.is_constant():
        return casadi.tanh(v / width)
    vanishes = width == 0
    return casadi.if_else(vanishes, casadi.sign(v), casadi.tanh(v / (width + vanishes)))
