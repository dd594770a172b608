"""Robots whose lengths and inertial parameters are symbols, as operations are counted on them.

A table row gives the Khalil-Kleinfinger parameters that are not zero: numbers for right angles, the
word "symbol" for lengths and general angles. Of the first link only the moment about its axis
takes part in the motion of a robot on a fixed base.
"""

from __future__ import annotations

from math import pi
from typing import Any

from mbs.components import Mechanism
from mbs.formats import from_dict, to_mechanism

Row = dict[str, Any]

TEN = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
_LENGTHS = {"alpha": "AL", "d": "D", "r": "RL"}
_UP, _DOWN = pi / 2, -pi / 2
_ANY = "symbol"
_GENERAL = {"alpha": _ANY, "d": _ANY, "r": _ANY}

ROBOTS: dict[str, list[Row]] = {
    "general 6R": [{}, *(_GENERAL for _ in range(5))],
    "PUMA 560": [
        {},
        {"alpha": _DOWN, "r": _ANY},
        {"d": _ANY, "r": _ANY},
        {"alpha": _UP, "d": _ANY, "r": _ANY},
        {"alpha": _DOWN},
        {"alpha": _UP},
    ],
    "RX90": [
        {},
        {"alpha": _UP},
        {"d": _ANY},
        {"alpha": _DOWN, "r": _ANY},
        {"alpha": _UP},
        {"alpha": _DOWN},
    ],
    "iiwa": [
        {},
        {"alpha": _DOWN},
        {"alpha": _UP, "r": _ANY},
        {"alpha": _UP},
        {"alpha": _DOWN, "r": _ANY},
        {"alpha": _DOWN},
        {"alpha": _UP},
    ],
    "Stanford": [
        {},
        {"alpha": _DOWN, "r": _ANY},
        {"alpha": _UP, "joint": "prismatic"},
        {},
        {"alpha": _DOWN},
        {"alpha": _UP},
    ],
    "SR400 tree": [
        {},
        {"alpha": _DOWN, "d": _ANY},
        {"d": _ANY},
        {"alpha": _DOWN, "d": _ANY, "r": _ANY},
        {"alpha": _UP},
        {"alpha": _DOWN},
        {"antecedent": 1, "alpha": _DOWN, "d": _ANY},
        {"antecedent": 7, "d": _ANY},
    ],
}


def symbolic_robot(name: str, *, base: bool) -> Mechanism:
    """A robot with symbols for its lengths and inertial parameters.

    Args:
        name: a key of ROBOTS.
        base: leave out what regrouping puts into other parameters: YY, MZ and M of a revolute
            link, the inertia of a prismatic one, all but ZZ of the first.
    """
    rows = ROBOTS[name]
    frames, bodies = [], []
    for j, row in enumerate(rows, 1):
        lengths = {k: f"{_LENGTHS[k]}{j}" for k, value in row.items() if value == _ANY}
        frames.append({"antecedent": j - 1, "joint": "revolute", **row, **lengths})
        kept = TEN if not base else _base_parameters(row, j)
        bodies.append({"frame": j, **{parameter: f"{parameter}{j}" for parameter in kept}})
    return to_mechanism(from_dict({"name": name, "frame": frames, "body": bodies}))


def _base_parameters(row: Row, j: int) -> tuple[str, ...]:
    if j == 1:
        return ("ZZ",)
    if row.get("joint") == "prismatic":
        return ("MX", "MY", "MZ", "M")
    return tuple(parameter for parameter in TEN if parameter not in ("YY", "MZ", "M"))
