"""Random tables whose rows have the angles and distances at which terms vanish."""

from __future__ import annotations

from math import pi

import numpy as np

QUARTERS = (pi / 2, -pi / 2)
DISTANCES = (0.0, 0.0, 0.3, -0.4, 0.25)


def special_table(pick, shape, seed=0):
    """A table of two to six rows, as `mbs.load` takes it.

    Args:
        pick: takes one of a sequence, at random.
        shape: "tree" has any antecedents and axes; "runs" many parallel axes, in branches; "fan"
            a first row on the base and most others on it.
        seed: of the bodies and of gravity.
    """
    rng = np.random.default_rng(seed)
    size = pick((2, 3, 4, 5, 6))
    rows = [_row(pick, j, shape) for j in range(size)]
    return {
        "name": "special",
        "gravity": [float(x) for x in rng.uniform(-10, 10, 3)],
        "frame": rows,
        "body": [_body(rng, j + 1) for j in range(size)],
    }


def _row(pick, j, shape):
    antecedents = {"tree": tuple(range(j + 1)), "runs": (j, j, max(j - 1, 0), min(j, 1))}
    first_turns = j == 0 and shape != "tree"
    return {
        "antecedent": pick(antecedents.get(shape, (min(j, 1), min(j, 1), j))),
        "joint": pick(
            ("revolute",) * (1 if first_turns else 5) + ("prismatic",) * (not first_turns)
        ),
        "gamma": pick((0.0, 0.0, pi, -pi, *QUARTERS, 0.4)),
        "b": pick(DISTANCES),
        "alpha": pick(_tilts(j, shape)),
        "d": pick(DISTANCES),
        "theta": pick((0.0, pi, pi / 2, 0.3)),
        "r": pick(DISTANCES),
    }


def _tilts(j, shape):
    if shape == "tree":
        return (0.0, 0.0, pi, -pi, *QUARTERS, 0.7)
    if shape == "fan" or j == 1:
        return (0.0, *QUARTERS, *QUARTERS, 0.7)
    return (0.0, 0.0, 0.0, 0.0, pi)


def _body(rng, frame):
    """A body with as many zeros as its shape has by chance, and a positive inertia."""
    m, com = rng.uniform(0.5, 3), rng.uniform(-0.3, 0.3, 3) * (rng.random(3) < 0.6)
    spread = (
        rng.uniform(0.1, 0.4, (3, 3)) if rng.random() < 0.6 else np.diag(rng.uniform(0.1, 0.4, 3))
    )
    second = spread @ spread.T + m * np.outer(com, com)
    J = np.trace(second) * np.eye(3) - second + 0.01 * np.eye(3)
    numbers = (*J[np.triu_indices(3)], *(m * com), m, 0.05 * (rng.random() < 0.3))
    keys = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M", "Ia")
    return {"frame": frame, **{k: float(x) for k, x in zip(keys, numbers, strict=True)}}
