"""The Whipple bicycle: four rigid bodies, and two discs that roll without slipping."""

from __future__ import annotations

import math

from mbs.components import (
    Body,
    Prismatic,
    Revolute,
    RigidBody,
    RollingDisc,
)
from mbs.mechanism import Mechanism

_BASE, _TRAIL, _TILT = 1.02, 0.08, math.pi / 10
_REAR, _FRONT = 0.3, 0.35


def whipple_bicycle() -> Mechanism:
    """Whipple bicycle with a rigid rider, upright on the plane z = 0.

    The x axis points ahead and z downwards. The wheels are discs that roll without slipping. The
    rear frame moves by x, y, z, yaw, lean and pitch at the rear hub. The front frame steers about
    an axis that is tilted by 18 degrees and meets the ground 0.08 m ahead of the front contact
    point; this distance is the trail. The joints lean, steer and rear_spin are actuated. At the
    forward speed V straight ahead, the rear wheel rotates at -V / 0.3 rad/s. The weave mode becomes
    stable at 4.29 m/s, and the capsize mode unstable at 6.02 m/s.

    Source: Meijaard, Papadopoulos, Ruina & Schwab 2007, table 1.
    """
    m = Mechanism(
        "whipple_bicycle",
        gravity=(0, 0, 9.81),
        source="Meijaard, Papadopoulos, Ruina and Schwab 2007, table 1",
        guess={"z": -_REAR},
    )
    rear_frame, front_frame = m.add(_rear_frame()), m.add(_front_frame())
    rear_wheel = m.add(_wheel("rear_wheel", 2.0, 0.0603, 0.12))
    front_wheel = m.add(_wheel("front_wheel", 3.0, 0.1405, 0.28))
    before: RigidBody = m.world
    for joint in _base_joints():
        after = (
            rear_frame if joint.name == "pitch" else m.add(Body(f"{joint.name}_carrier", mass=0))
        )
        m.connect(before, joint, after)
        before = after
    axis = (math.sin(_TILT), 0.0, math.cos(_TILT))
    steer_foot = (_BASE + _TRAIL, 0.0, _REAR)
    m.connect(rear_frame.at(*steer_foot), Revolute("steer", axis=axis, actuated=True), front_frame)
    m.connect(rear_frame, Revolute("rear_spin", axis="y", actuated=True), rear_wheel)
    front_hub = front_frame.at(-_TRAIL, 0.0, -_FRONT)
    m.connect(front_hub, Revolute("front_spin", axis="y", actuated=False), front_wheel)
    for name, wheel, radius in (("rear", rear_wheel, _REAR), ("front", front_wheel, _FRONT)):
        m.connect(m.world, RollingDisc(f"{name}_contact", radius=radius, normal="-z"), wheel)
    return m


def _base_joints() -> list[Prismatic | Revolute]:
    """Return the joints of the rear hub in series: x, y, z, yaw, lean (actuated) and pitch."""
    slides = [Prismatic(axis, axis=axis, actuated=False) for axis in "xyz"]
    return [
        *slides,
        Revolute("yaw", axis="z", actuated=False),
        Revolute("lean", axis="x", actuated=True),
        Revolute("pitch", axis="y", actuated=False),
    ]


def _rear_frame() -> Body:
    """Return the rear frame with the rider; its reference frame is at the rear hub."""
    return Body(
        "rear_frame",
        mass=85.0,
        com=(0.3, 0.0, -0.9 + _REAR),
        inertia=((9.2, 0.0, 2.4), (0.0, 11.0, 0.0), (2.4, 0.0, 2.8)),
    )


def _front_frame() -> Body:
    """Return handlebar and fork, with the origin where the steering axis meets the ground."""
    return Body(
        "front_frame",
        mass=4.0,
        com=(0.9 - _BASE - _TRAIL, 0.0, -0.7),
        inertia=((0.05892, 0.0, -0.00756), (0.0, 0.06, 0.0), (-0.00756, 0.0, 0.00708)),
    )


def _wheel(name: str, mass: float, across: float, spin: float) -> Body:
    """Return a wheel with its axle along y.

    `mass` is in kg; `across` and `spin` are the moments of inertia about a diameter and about the
    axle [kg m^2].
    """
    return Body(name, mass=mass, inertia=(across, spin, across))
