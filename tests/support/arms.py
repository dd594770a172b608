"""Serial arms with random lengths and twists; the same seed makes the same arm."""

from __future__ import annotations

import numpy as np

from mbs.robots.rows import frame, robot


def general_6r(seed):
    """Six revolute joints, no two axes parallel or meeting."""
    return _assembled("general_6r", _rows(_rng(1, seed), "RRRRRR"))


def general_5r(seed):
    """Five revolute joints."""
    return _assembled("general_5r", _rows(_rng(2, seed), "RRRRR"))


def general_7r(seed):
    """Seven revolute joints, one more than a pose needs."""
    return _assembled("general_7r", _rows(_rng(9, seed), "RRRRRRR"))


def human_like_arm():
    """Seven revolute joints: a spherical shoulder, an elbow, a spherical wrist."""
    quarter = np.pi / 2
    twists = [0.0, -quarter, quarter, quarter, -quarter, -quarter, quarter]
    along = [0.34, 0.0, 0.4, 0.0, 0.4, 0.0, 0.0]
    rows = [frame(k, "revolute", alpha=twists[k], d=0.0, theta=0.0, r=along[k]) for k in range(7)]
    return _assembled("human_like_arm", [*rows, {"r": 0.126}])


def spherical(first, seed):
    """Six revolute joints, of which the axes of joints first, first + 1, first + 2 meet."""
    rows = _rows(_rng(3, 10 * seed + first), "RRRRRR")
    for row in rows[first : first + 2]:
        row["d"] = 0.0
    rows[first]["r"] = 0.0
    return _assembled(f"spherical_{first}", rows)


def three_parallel(first, seed):
    """Six revolute joints; the axes of joints first, first + 1, first + 2 are parallel."""
    rows = _rows(_rng(4, 10 * seed + first), "RRRRRR")
    for row in rows[first : first + 2]:
        row["alpha"] = 0.0
    return _assembled(f"parallel_{first}", rows)


def slides_and_turns(kinds, seed):
    """An arm whose joints are given by a letter each: P slides, R turns."""
    number = int("".join("1" if kind == "P" else "0" for kind in kinds), 2)
    return _assembled(kinds.lower(), _rows(_rng(5, 1000 * seed + number), kinds))


def placements(count):
    """All orders, such as PRPRPR, of six joints of which some slide."""
    words = (format(number, "06b") for number in range(64))
    return [w.replace("1", "P").replace("0", "R") for w in words if w.count("1") == count]


def _rng(family, seed):
    return np.random.default_rng((20260105, family, seed))


def _rows(rng, kinds):
    """Rows of Khalil & Kleinfinger with angles that are far from 0, 90 and 180 degrees."""
    rows = []
    for kind in kinds:
        alpha = rng.choice((-1, 1)) * (rng.uniform(0.35, 1.3) + rng.choice((0, np.pi / 2)))
        values = {
            "alpha": float(alpha),
            "d": float(rng.uniform(0.1, 0.6)),
            "theta": float(rng.uniform(-3, 3)),
            "r": float(rng.uniform(-0.4, 0.4)),
        }
        rows.append(frame(len(rows), {"R": "revolute", "P": "prismatic"}[kind], **values))
    rows[0] |= {"gamma": float(rng.uniform(-3, 3)), "b": float(rng.uniform(-0.5, 0.5))}
    hand = {name: float(rng.uniform(-0.4, 0.4)) for name in ("b", "d", "r")}
    hand |= {name: float(rng.uniform(-3, 3)) for name in ("gamma", "alpha", "theta")}
    return [*rows, hand]


def _assembled(name, rows):
    *frames, hand = rows
    mechanism = robot(name, "random", frames, [])
    mechanism.add_frame("tool", list(mechanism.bodies())[-1].at_khalil(**hand))
    return mechanism.assemble()
