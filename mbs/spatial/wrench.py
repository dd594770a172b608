"""A force and a moment about one point."""

from casadi import SX

Wrench = tuple[SX, SX]
"""Force (3, 1) and moment (3, 1) about the origin of a frame, in that frame [N, N m]."""


def add_wrenches(a: Wrench, b: Wrench) -> Wrench:
    """The sum of two wrenches about one point."""
    return a[0] + b[0], a[1] + b[1]
