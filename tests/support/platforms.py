"""Platforms on legs, closed where all joints are at zero: plane ones anywhere in space."""

from __future__ import annotations

import numpy as np
from support.flat_loops import flat_joint, turn_about_z
from support.random_trees import random_body, random_rotation

from mbs.components import Mechanism


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
