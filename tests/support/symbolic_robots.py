"""Robots of the literature with symbols for their lengths, as tables."""

from __future__ import annotations

import math

import mbs

_H = math.pi / 2
TABLES = {
    "general_6r": [{}, *({"alpha": "A", "d": "D", "r": "RL"} for _ in range(5))],
    "puma560": [
        {},
        {"alpha": -_H, "r": "RL"},
        {"d": "D", "r": "RL"},
        {"alpha": _H, "d": "D", "r": "RL"},
        {"alpha": -_H},
        {"alpha": _H},
    ],
    "rx90": [
        {},
        {"alpha": _H},
        {"d": "D"},
        {"alpha": -_H, "r": "RL"},
        {"alpha": _H},
        {"alpha": -_H},
    ],
    "stanford": [
        {},
        {"alpha": -_H, "r": "RL"},
        {"alpha": _H, "joint": "prismatic"},
        {},
        {"alpha": -_H},
        {"alpha": _H},
    ],
}


def symbolic_robot(name):
    """The System of a robot whose distances (and oblique angles) are parameters RL2, D3, ..."""
    frames, parameters = [], {}
    for j, row in enumerate(TABLES[name], 1):
        frame = {"antecedent": j - 1, "joint": "revolute"}
        for key, value in row.items():
            if key != "joint" and isinstance(value, str):
                value += str(j)
                parameters[value] = 0.3 + 0.07 * j
            frame[key] = value
        frames.append(frame)
    bodies = [{"frame": j, "M": 1} for j in range(1, len(frames) + 1)]
    return mbs.load(
        {"name": name, "parameters": parameters, "frame": frames, "body": bodies}
    ).assemble()


__all__ = ["TABLES", "symbolic_robot"]
