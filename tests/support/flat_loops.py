"""Loops of turns and slides in a plane anywhere in space, closed where all joints are at zero."""

from __future__ import annotations

import numpy as np
from support.random_trees import random_body, random_rotation

from mbs import Mechanism
from mbs.components import Prismatic, Revolute


def flat_loop(seed, kinds, active, closing=None, tilted=True):
    """A loop of joints j0, j1, .. in a plane; the last one closes it.

    Args:
        seed: of points, directions and of the plane.
        kinds: a letter for each joint, "R" or "P".
        active: numbers of the driven joints.
        closing: joint type that takes the place of the last turn, about or at the same point.
        tilted: whether the plane is oblique.
    """
    rng = np.random.default_rng(seed)
    m = Mechanism(f"flat{seed}", gravity=(0.0, -9.81, 0.0))
    R = random_rotation(rng) if tilted else np.eye(3)
    points = [np.array([*rng.uniform(-1, 1, 2), 0.0]) for _ in kinds]
    turns = [turn_about_z(rng.uniform(-3, 3)) for _ in kinds]
    place, turned = np.zeros(3), np.eye(3)
    here = m.world.at(*rng.uniform(-1, 1, 3), rotation=R)
    before, n = here, len(kinds)
    for k, kind in enumerate(kinds):
        at = before.at(*(turned.T @ (points[k] - place)), rotation=turned.T @ turns[k])
        joint = flat_joint(rng, f"j{k}", kind, k in active)
        if k < n - 1:
            body = m.add(random_body(rng, f"bar{k}"))
            m.connect(at, joint, body)
            before, place, turned = body, points[k], turns[k]
        else:
            joint = joint if closing is None else closing(f"j{k}")
            m.connect(at, joint, here.at(*points[k], rotation=turns[k]))
            m.cut(joint)
    return m


def turn_about_z(angle):
    """The rotation about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def flat_joint(rng, name, kind, driven):
    """A revolute joint about z, either way round, or a prismatic one across it."""
    if kind == "R":
        axis = "z" if rng.uniform() < 0.5 else "-z"
        return Revolute(name, axis=axis, actuated=driven or None)
    angle = rng.uniform(-3, 3)
    axis = (float(np.cos(angle)), float(np.sin(angle)), 0.0)
    return Prismatic(name, axis=axis, actuated=driven or None)
