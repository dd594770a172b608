"""A pole on a cart, which alone is driven."""

from __future__ import annotations

from math import pi

from mbs.mechanism import Mechanism
from mbs.robots.rows import cuboid, frame, robot

_SOURCE = "Textbook system; values of Barto, Sutton & Anderson 1983, without friction"


def cart_pole() -> Mechanism:
    """Cart with a pole: cart position q1 along x of the base, pole angle q2 from upright.

    Only the cart is driven. A positive q2 tips the pole towards positive q1.

    Source: Barto, Sutton & Anderson 1983: cart of 1 kg, pole of 0.1 kg and 1 m length. The pole is
    0.02 m thick, which is illustrative, and there is no friction.
    """
    half = pi / 2
    frames = [
        frame(0, "prismatic", gamma=half, alpha=half, theta=half, actuated=True),
        frame(1, alpha=half, actuated=False),
    ]
    bodies = [
        cuboid(1, 1, (0.1, 0.1, 0.2), (0, 0, 0), name="cart"),
        cuboid(2, 0.1, (1, 0.02, 0.02), (0.5, 0, 0), name="pole"),
    ]
    return robot("cart_pole", _SOURCE, frames, bodies)
