"""Platforms on legs, closed where all joints are at zero: plane ones anywhere in space."""

from __future__ import annotations

import numpy as np
from support.flat_loops import flat_joint, turn_about_z
from support.random_trees import random_body, random_rotation

from mbs import Mechanism
from mbs.components import (
    Free,
    Prismatic,
    Revolute,
    Rod,
    Spherical,
    Universal,
)


def planar_platform(seed, legs, driven=()):
    """A plane platform on legs of revolute and prismatic joints, its plane oblique.

    Args:
        seed: of points, directions and of the plane.
        legs: for each leg the letters of its joints from the ground on, such as "RPR".
        driven: for each leg the number of its driven joint, or None; no motors when left out.
    """
    rng = np.random.default_rng(seed)
    m = Mechanism(f"platform{seed}", gravity=(0.0, -9.81, 0.0))
    here = m.world.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng))
    platform = m.add(random_body(rng, "platform"))
    driven = driven or [None] * len(legs)
    for leg, (kinds, motor) in enumerate(zip(legs, driven, strict=True)):
        before, place, turned = here, np.zeros(3), np.eye(3)
        for k, kind in enumerate(kinds):
            point = np.array([*rng.uniform(-1, 1, 2), 0.0])
            turn = turn_about_z(rng.uniform(-3, 3))
            joint = flat_joint(rng, f"leg{leg}.j{k}", kind, k == motor)
            at = before.at(*(turned.T @ (point - place)), rotation=turned.T @ turn)
            if k == len(kinds) - 1:
                m.connect(at, joint, platform.at(*point, rotation=turn))
                break
            before = m.add(random_body(rng, f"leg{leg}.bar{k}"))
            m.connect(at, joint, before)
            place, turned = point, turn
    return m


def planar_linkage(seed, joints, driven=(), sliding=()):
    """Links of a plane that joints connect at random points, the plane oblique.

    Args:
        seed: of the points and of the plane.
        joints: for each the letters of the links that it connects; "O" is the ground.
        driven: those of them that have motors.
        sliding: those that are prismatic, in random directions; the others are revolute.
    """
    rng = np.random.default_rng(seed)
    m = Mechanism(f"linkage{seed}")
    here = m.world.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng))
    names = sorted({name for joint in joints for name in joint} - {"O"})
    frames = {name: m.add(random_body(rng, name)).at() for name in names} | {"O": here}
    for a, b in joints:
        point = (*rng.uniform(-1, 1, 2), 0.0)
        motor = True if a + b in driven else None
        kind, axis = (Prismatic, "x") if a + b in sliding else (Revolute, "z")
        turn = turn_about_z(rng.uniform(-3, 3)) if a + b in sliding else None
        joint = kind(f"{a}{b}", axis=axis, actuated=motor)
        m.connect(frames[a].at(*point, rotation=turn), joint, frames[b].at(*point, rotation=turn))
    return m


def hexapod(seed, leg, ends=None):
    """A platform on six legs with random ends, assembled where the legs reach.

    Args:
        seed: of the ends, the pose and the bodies.
        leg: its joints from the ground on: "UPS" and "SPS" with a driven slide, "RUS" and
            "R rod" with a driven crank on the ground.
        ends: of the legs on the ground and on the platform in its frame, (6, 3) each [m].
    """
    rng = np.random.default_rng(seed)
    m = Mechanism(f"hexapod{seed}", gravity=(0.0, 0.0, -9.81))
    a, b = ends or (rng.uniform(-1, 1, (6, 3)), rng.uniform(-0.6, 0.6, (6, 3)))
    platform = m.add(random_body(rng, "platform"))
    R, p = random_rotation(rng), np.array([*rng.uniform(-0.3, 0.3, 2), 1.5])
    if leg == "R rod":  # rods place nothing
        m.connect(m.world.at(*p, rotation=R), Free("free"), platform)
    for k in range(6):
        head = platform.at(*b[k], rotation=R.T)
        if leg in ("UPS", "SPS"):
            joint = Universal if leg == "UPS" else Spherical
            _telescope(m, rng, k, a[k], R @ b[k] + p, head, joint)
        else:
            _crank(m, rng, k, a[k], R @ b[k] + p, head, leg == "R rod")
    return m


def _telescope(m, rng, k, low, high, head, joint):
    turn = _onto(high - low)
    barrel, piston = (m.add(random_body(rng, f"{name}{k}")) for name in ("barrel", "piston"))
    m.connect(m.world.at(*low, rotation=turn), joint(f"foot{k}"), barrel)
    slide = Prismatic(f"leg{k}", axis="z", actuated=True)
    m.connect(barrel.at(0, 0, float(np.linalg.norm(high - low))), slide, piston)
    m.connect(piston, Spherical(f"head{k}"), head.at(rotation=turn))


def _crank(m, rng, k, low, high, head, rod):
    turn = random_rotation(rng)
    crank = m.add(random_body(rng, f"crank{k}"))
    elbow = low + turn @ [0.3, 0, 0]
    m.connect(m.world.at(*low, rotation=turn), Revolute(f"motor{k}", actuated=True), crank)
    length = float(np.linalg.norm(high - elbow))
    if rod:
        m.connect(crank.at(0.3, 0, 0), Rod(f"rod{k}", length=length), head)
        return
    bar = m.add(random_body(rng, f"bar{k}"))
    along = _onto(high - elbow)
    m.connect(crank.at(0.3, 0, 0, rotation=turn.T @ along), Universal(f"elbow{k}"), bar)
    m.connect(bar.at(0, 0, length), Spherical(f"head{k}"), head)


def _onto(direction):
    """A rotation whose z axis is along the direction."""
    z = direction / np.linalg.norm(direction)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
