"""Random closed mechanisms: a random tree, and a joint that closes a loop at a random
configuration."""

from __future__ import annotations

import numpy as np
from support.random_trees import random_body, random_rotation, random_tree

import mbs.models
from mbs import Mechanism
from mbs.components import (
    Cylindrical,
    Fixed,
    Planar,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)

CLOSING = {
    "revolute": (Revolute, 5),
    "prismatic": (Prismatic, 5),
    "cylindrical": (Cylindrical, 4),
    "universal": (Universal, 4),
    "planar": (Planar, 3),
    "spherical": (Spherical, 3),
    "fixed": (Fixed, 6),
}


def closed_chain(seed, closing, n=8):
    """A spatial loop of n revolute and prismatic joints, closed by a joint of the given kind.

    Returns:
        The mechanism and the positions at which its loop is closed.
    """
    rng = np.random.default_rng(seed)
    kinds = ("revolute", "revolute", "prismatic")
    twin = random_tree(seed, n=n, kinds=kinds, serial=True)
    tree = twin.mechanism.assemble()
    q = rng.uniform(-0.6, 0.6, n)
    T = np.array(mbs.models.transform(tree, f"body{n - 1}")(q))
    mechanism = twin.mechanism
    joint = CLOSING[closing][0]("closing")
    last = mechanism.components[f"body{n - 1}"]
    a = mechanism.world.at(*T[:3, 3], rotation=T[:3, :3])
    mechanism.connect(a, joint, last)
    mechanism.cut(joint)
    return mechanism, {f"j{k}": float(x) for k, x in enumerate(q)}


def planar_loop(seed, links=4, dyads=1):
    """A random planar chain of bars on the ground, closed by revolute joints that fit.

    Returns:
        The mechanism and the positions at which it is closed.
    """
    rng = np.random.default_rng(seed)
    mechanism = Mechanism(f"planar{seed}", gravity=(0.0, -9.81, 0.0))
    angles = np.cumsum(rng.uniform(0.3, 1.4, links))
    lengths = rng.uniform(0.3, 1.0, links)
    before, point, guess = mechanism.world, np.zeros(2), {}
    turned = 0.0
    for k in range(links):
        body = mechanism.add(random_body(rng, f"bar{k}"))
        mechanism.connect(before if k == 0 else before.at(lengths[k - 1]), Revolute(f"j{k}"), body)
        guess[f"j{k}"] = float(angles[k] - turned)
        turned = angles[k]
        point = point + lengths[k] * np.array([np.cos(angles[k]), np.sin(angles[k])])
        before = body
    mechanism.connect(mechanism.world.at(*point, 0.0), Revolute("closing"), before.at(lengths[-1]))
    return mechanism, guess


__all__ = ["CLOSING", "closed_chain", "planar_loop", "random_rotation"]
