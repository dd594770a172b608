"""How well a random tree in base parameters agrees with the tree, by Newton and Euler in numpy."""

from __future__ import annotations

import copy

import numpy as np
from support.base_robots import random_table
from support.plain_newton_euler import plain_efforts

import mbs
from mbs.identification import base_parameters
from mbs.spatial.inertia import TEN_PARAMETERS

KINDS = (*TEN_PARAMETERS, "Ia")
STATES = 4


def grouped_tree(seed):
    """Base parameters of a random tree, largest error of its efforts, and whether it has weight.

    The error is by one more than the largest effort of its state.
    """
    rows = random_table(seed)
    base = base_parameters(mbs.load(rows).assemble())
    grouped, rng = in_base_parameters(base, rows), np.random.default_rng(seed)
    errors = []
    for _ in range(STATES):
        state = rng.uniform(-3, 3, (3, len(rows["frame"])))
        full = plain_efforts(rows, *state)
        error = np.abs(plain_efforts(grouped, *state) - full).max()
        errors.append(error / (1 + np.abs(full).max()))
    return base, max(errors), any(rows["gravity"])


def in_base_parameters(base, rows):
    """The table with eliminated parameters zero and the others grouped."""
    grouped = copy.deepcopy(rows)
    K = [rows["body"][c.link - 1][c.kind] for c in base.columns]
    for body in grouped["body"]:
        body.update(dict.fromkeys((*KINDS, "Fv", "Fs"), 0.0))
    for column, value in zip(base.kept, base.matrix @ K, strict=True):
        grouped["body"][column.link - 1][column.kind] = value
    return grouped
