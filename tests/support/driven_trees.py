"""Random trees whose joints have springs, rotor inertia and rotors, some of them run backwards."""

from __future__ import annotations

import numpy as np
from support.random_trees import random_body, random_rotation

from mbs import Mechanism
from mbs.components import (
    Free,
    Prismatic,
    Revolute,
    Rotor,
    Spherical,
)

KINDS = ("revolute", "prismatic", "spherical", "free")


def driven_tree(seed, n=4, kinds=KINDS, backward=KINDS):
    """A mechanism of n joints; every second one is connected from the outer body to the inner.

    Only joints of the kinds in `backward` are.
    """
    rng = np.random.default_rng(seed)
    mechanism = Mechanism(f"driven{seed}", gravity=tuple(rng.uniform(-10, 10, 3)))
    bodies = [mechanism.world]
    for k in range(n):
        body = mechanism.add(random_body(rng, f"body{k}"))
        kind = kinds[int(rng.integers(len(kinds)))]
        joint = _joint(rng, kind, f"j{k}")
        free = isinstance(joint, Free)
        before = bodies[0 if free else int(rng.integers(len(bodies)))]
        inner = before.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng))
        outer = body.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng))
        mechanism.connect(
            *((outer, joint, inner) if k % 2 and kind in backward else (inner, joint, outer))
        )
        bodies.append(body)
    return mechanism


def random_rotor(rng, axis=None):
    return Rotor(inertia=rng.uniform(0.01, 0.05), ratio=rng.uniform(-10, 10), axis=axis)


def _joint(rng, kind, name):
    if kind == "spherical":
        return Spherical(name, Ia=rng.uniform(0, 0.2))
    if kind == "free":
        return Free(name)
    one_axis = Revolute if kind == "revolute" else Prismatic
    return one_axis(
        name,
        axis=tuple(rng.standard_normal(3)),
        stiffness=rng.uniform(1, 5),
        rest=rng.uniform(-1, 1),
        Ia=rng.uniform(0, 0.2),
        rotor=random_rotor(rng, None if rng.integers(2) else tuple(rng.standard_normal(3))),
    )
