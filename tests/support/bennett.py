"""Bennett's loop: four turns whose opposite links are equal, over-constrained and movable."""

import numpy as np
from support.random_trees import random_body

from mbs import Mechanism, Parameter
from mbs.components import Revolute

TWISTS = (0.9, 1.7)
STARTS = {"j0": 1.0, "j1": 2.0, "j2": -1.0, "j3": -2.0}


def bennett(driven=0, cut=3, twists=TWISTS, length=0.8, add=None):
    """Links 0 and 2 of one length and twist, 1 and 3 of the other; joint k after link k.

    `add(m, bodies)` may add more.
    """
    rng = np.random.default_rng(0)
    m = Mechanism("bennett")
    alpha, beta = twists
    ratio = np.sin(beta) / np.sin(alpha)
    long = f"{ratio} * {length.name}" if isinstance(length, Parameter) else ratio * length
    bodies = [m.world, *(m.add(random_body(rng, f"b{k}")) for k in range(1, 4))]
    for k in range(4):
        given = {"actuated": True} if k == driven else {}
        size, twist = ((length, alpha), (long, beta))[k % 2]
        joint = Revolute(f"j{k}", **given)
        m.connect(bodies[k].at(size, 0, 0, rotation=_tilt(twist)), joint, bodies[(k + 1) % 4].at())
        if k == cut:
            m.cut(joint)
    if add is not None:
        add(m, bodies)
    return m.assemble(guess={name: x for name, x in STARTS.items() if name != f"j{cut}"})


def _tilt(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])
