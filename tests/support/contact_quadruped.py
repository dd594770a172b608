"""A quadruped on spheres: a trunk that moves freely, and four legs of two joints with springs."""

import mbs
from mbs.components import Body, Free, Revolute, SpherePlaneContact

LEG, FOOT = 0.2, 0.02
HIPS = {"fl": (0.2, 0.1), "fr": (0.2, -0.1), "hl": (-0.2, 0.1), "hr": (-0.2, -0.1)}
BENT = {"hip": 0.6, "knee": -1.2}
"""Configuration of a leg in which it stands [rad]."""
STRONG, DAMPED = 120.0, 3.0
"""Of the springs of the joints [N m/rad] and [N m s/rad], which stand in for a controller."""
LAW = {"stiffness": 2e5, "damping": 1.0, "friction": 0.7, "friction_law": "bristle"}
MASSES = {"trunk": 6.0, "upper": 0.5, "lower": 0.2}
INERTIAS = {
    "trunk": (0.03, 0.1, 0.11),
    "upper": (1.7e-3, 1.7e-3, 1e-4),
    "lower": (7e-4, 7e-4, 5e-5),
}


def quadruped(**law):
    """The system; its coordinates are those of `free`, and such as `fl_hip` and `fl_knee`."""
    m = mbs.Mechanism("quadruped", gravity=(0, 0, -9.81))
    trunk = m.add(Body("trunk", mass=MASSES["trunk"], inertia=INERTIAS["trunk"]))
    m.connect(m.world, Free("free"), trunk)
    for leg, (x, y) in HIPS.items():
        above = trunk.at(x, y)
        for part, joint in (("upper", "hip"), ("lower", "knee")):
            body = m.add(
                Body(
                    f"{leg}_{part}",
                    mass=MASSES[part],
                    com=(0, 0, -LEG / 2),
                    inertia=INERTIAS[part],
                )
            )
            spring = {"stiffness": STRONG, "rest": BENT[joint], "Fv": DAMPED}
            m.connect(above, Revolute(f"{leg}_{joint}", axis="y", **spring), body)
            above = body.at(0, 0, -LEG)
        m.add(SpherePlaneContact(f"{leg}_foot", above, m.world, radius=FOOT, **{**LAW, **law}))
    return m.assemble()


def start(height):
    """Positions with the trunk at a height [m] and bent legs."""
    legs = {f"{leg}_{joint}": angle for leg in HIPS for joint, angle in BENT.items()}
    return {"free.z": height, **legs}
