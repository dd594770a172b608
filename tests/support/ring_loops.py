"""Loops of any joints in any order, closed where all joints are at zero."""

from __future__ import annotations

from functools import partial

import numpy as np
from support.random_trees import random_body, random_rotation

from mbs import Mechanism
from mbs.components import (
    Cylindrical,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)

KINDS = {
    "R": Revolute,
    "P": Prismatic,
    "X": partial(Prismatic, axis="x"),
    "C": Cylindrical,
    "U": Universal,
    "S": Spherical,
}
MADE_OF = {"V": "RR", "W": "RRR"}


def ring_loop(seed, kinds, active=(0,), cut=None, parallel=()):
    """A loop of the joints j0, j1, .. with random places, about random axes.

    Args:
        seed: of all places.
        kinds: a letter for each joint: R, P, C, U, S; X is a slide across the z axis of its
            place; V and W are two and three turns with bodies between them whose axes meet.
        active: numbers of the driven joints.
        cut: number of the joint that closes the loop; the assembly chooses when left out.
        parallel: pairs of joints of which the second is oriented as the first.
    """
    rng = np.random.default_rng(seed)
    letters, places = _expanded(rng, kinds)
    turns = [random_rotation(rng) for _ in letters]
    for first, second in parallel:
        turns[second] = turns[first]
    return _closed(f"ring{seed}_{kinds}", rng, letters, places, turns, active, cut)


def line_symmetric_loop(seed):
    """Six revolute joints, three of them the images of the others about a line: it moves.

    Source: Bricard 1897.
    """
    rng = np.random.default_rng(seed)
    image = np.diag([-1.0, -1.0, 1.0])
    half = [(rng.uniform(-1, 1, 3), random_rotation(rng)) for _ in range(3)]
    places = [*half, *((image @ place, image @ turn) for place, turn in half)]
    return _closed(f"symmetric{seed}", rng, "R" * 6, *zip(*places, strict=True), (0,), None)


def _closed(name, rng, letters, places, turns, active, cut):
    m = Mechanism(name)
    bodies = [m.world, *(m.add(random_body(rng, f"body{k}")) for k in range(1, len(letters)))]
    homes = [(np.zeros(3), np.eye(3))]
    homes += [(rng.uniform(-1, 1, 3), random_rotation(rng)) for _ in bodies[1:]]

    def at(k, place, turn):
        (p, R), body = homes[k % len(bodies)], bodies[k % len(bodies)]
        return body.at(*(R.T @ (place - p)), rotation=R.T @ turn)

    for k, letter in enumerate(letters):
        given = {"actuated": True} if k in active else {}
        joint = KINDS[letter](f"j{k}", **given)
        m.connect(at(k, places[k], turns[k]), joint, at(k + 1, places[k], turns[k]))
        if k == cut:
            m.cut(joint)
    return m


def _expanded(rng, kinds):
    letters, places = [], []
    for kind in kinds:
        place = rng.uniform(-1, 1, 3)
        for letter in MADE_OF.get(kind, kind):
            letters.append(letter)
            places.append(place)
    return letters, places
