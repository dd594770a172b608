"""Small robots and random trees as tables, for the counts of base parameters."""

from __future__ import annotations

from math import pi

import numpy as np

import mbs
from mbs.spatial.inertia import TEN_PARAMETERS

HALF = pi / 2
GRAVITIES = ((0, 0, -9.81), (0, -9.81, 0), (3.0, -4.0, -7.0), (9.81, 0, 0), (0, 0, 0))


def row(antecedent, joint="revolute", **values):
    """A row of a table."""
    zeros = dict.fromkeys(("gamma", "b", "alpha", "d", "theta", "r"), 0.0)
    return {"antecedent": antecedent, "joint": joint, **zeros, **values}


def bodies(count, rng=None):
    """Ten parameters and a rotor for every frame; random numbers that need belong to no body."""
    rng = rng or np.random.default_rng(count)
    names = (*TEN_PARAMETERS, "Ia", "Fv", "Fs")
    return [
        {
            "frame": j,
            "grouped": True,
            **{name: float(x) for name, x in zip(names, rng.uniform(0.1, 1, 13), strict=True)},
        }
        for j in range(1, count + 1)
    ]


def table(name, frames, gravity=(0, 0, -9.81), rng=None, **values):
    """The table of some rows, each with a body."""
    links = len(frames) - 2 * len(values.get("loop", ()))
    return {
        "name": name,
        "frame": frames,
        "body": bodies(links, rng),
        "gravity": list(gravity),
        **values,
    }


def system(name, frames, gravity=(0, 0, -9.81), **values):
    """The assembled robot of some rows."""
    return mbs.load(table(name, frames, gravity, **values)).assemble()


def random_table(seed):
    """A tree of two to five links: branches, prismatic joints, odd angles, five gravities."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    frames = []
    for j in range(count):
        chain = rng.random() > 0.3
        antecedent = j if chain or j == 0 else int(rng.integers(0, j + 1))
        joint = "prismatic" if rng.random() < 0.3 else "revolute"
        frames.append(row(antecedent, joint, **_placement(rng, branch=antecedent != j)))
    gravity = GRAVITIES[int(rng.integers(len(GRAVITIES)))]
    return table(f"random{seed}", frames, gravity, rng)


def _placement(rng, branch):
    angles = (0.0, 0.0, HALF, -HALF, 0.7)
    lengths = (0.0, 0.0, 0.3, -0.45)
    values = {
        "alpha": angles[rng.integers(5)],
        "d": lengths[rng.integers(4)],
        "theta": angles[rng.integers(5)],
        "r": lengths[rng.integers(4)],
    }
    if branch:
        values |= {"gamma": angles[rng.integers(5)], "b": lengths[rng.integers(4)]}
    return values
