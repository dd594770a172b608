"""A wrist of bevel gears: two motors beside each other pitch and roll the tool."""

from __future__ import annotations

from mbs.components import Body, Gear, Revolute
from mbs.mechanism import Mechanism

_SOURCE = "Textbook mechanism; ratio, masses and inertias are illustrative"


def differential_wrist(ratio: float = 1.0) -> Mechanism:
    """Wrist of bevel gears: two motors q1 and q2 together pitch and roll the tool.

    The motors rotate two side gears about y. The carrier rotates about y by `pitch`. The tool
    rotates on the carrier about x by `roll`, and its bevel gear meshes with both side gears, which
    rotate by mesh1 and mesh2 on the carrier: roll = ratio mesh1 = -ratio mesh2. Hence pitch = (q1 +
    q2) / 2 and roll = ratio (q1 - q2) / 2. The axes of motors and carrier coincide: in each loop
    that a motor closes, only the rotation about this axis is an independent condition. Ratio,
    masses and inertias are illustrative.

    Args:
        ratio: number of teeth of a side gear divided by that of the gear of the tool.
    """
    m = Mechanism("differential_wrist", source=_SOURCE, guess={"pitch": 0.0})
    carrier = m.add(Body("carrier", mass=1.2, com=(0.02, 0, 0), inertia=(2e-3, 2e-3, 2.5e-3)))
    tool = m.add(Body("tool", mass=0.8, com=(0.12, 0, 0.01), inertia=(6e-4, 3e-3, 3e-3)))
    m.connect(m.world, Revolute("pitch", axis="y", actuated=False), carrier)
    m.connect(carrier, Revolute("roll", axis="x", actuated=False), tool)
    for k, sign in ((1, 1), (2, -1)):
        gear = m.add(Body(f"gear{k}", mass=0.3, inertia=(1e-4, 2e-4, 1e-4)))
        m.connect(carrier.at(0, 0.05 * sign), Revolute(f"mesh{k}", axis="y", actuated=False), gear)
        motor = Revolute(f"q{k}", axis="y", actuated=True, Ia=5e-3)
        m.connect(m.world.at(0, 0.05 * sign), motor, gear)
        m.add(Gear(f"teeth{k}", driven="roll", driver=f"mesh{k}", ratio=sign * ratio))
    return m
