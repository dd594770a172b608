"""Robots whose lengths and inertial parameters are symbols, as operations are counted on them.

A table row gives the Khalil-Kleinfinger parameters that are not zero: numbers for right angles, the
word "symbol" for lengths and general angles. Of the first link only the moment about its axis
takes part in the motion of a robot on a fixed base.
"""

from __future__ import annotations

from math import pi
from typing import Any

from mbs import Mechanism
from mbs.formats import from_dict, to_mechanism

Row = dict[str, Any]

TEN = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
_SYMBOLS = {"alpha": "AL", "d": "D", "r": "RL"}
_UP, _DOWN = pi / 2, -pi / 2
_ANY = "symbol"
_GENERAL = {"alpha": _ANY, "d": _ANY, "r": _ANY}

ROBOTS: dict[str, list[Row]] = {
    "general_6r": [{}, *(_GENERAL for _ in range(5))],
    "puma560": [
        {},
        {"alpha": _DOWN, "r": _ANY},
        {"d": _ANY, "r": _ANY},
        {"alpha": _UP, "d": _ANY, "r": _ANY},
        {"alpha": _DOWN},
        {"alpha": _UP},
    ],
    "rx90": [
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
    "stanford": [
        {},
        {"alpha": _DOWN, "r": _ANY},
        {"alpha": _UP, "joint": "prismatic"},
        {},
        {"alpha": _DOWN},
        {"alpha": _UP},
    ],
    "sr400_tree": [
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


def symbolic_robot(name: str, inertia: str = "full") -> Mechanism:
    """A robot with symbols for its lengths, oblique angles and inertial parameters.

    Args:
        name: a key of ROBOTS.
        inertia: "full" for all ten parameters of every link; "base" to leave out what regrouping
            puts into others: YY, MZ and M of a revolute link, the inertia of a prismatic one, all
            but ZZ of the first; "none" for a mass of 1 kg at every origin.
    """
    frames, bodies, values = [], [], {}
    for j, row in enumerate(ROBOTS[name], 1):
        symbols = {k: f"{_SYMBOLS[k]}{j}" for k, value in row.items() if value == _ANY}
        values.update({symbol: 0.3 + 0.07 * j for symbol in symbols.values()})
        frames.append({"antecedent": j - 1, "joint": "revolute", **row, **symbols})
        bodies.append({"frame": j, **_inertia(row, j, inertia)})
    table = {"name": name, "parameters": values, "frame": frames, "body": bodies}
    return to_mechanism(from_dict(table))


def _inertia(row: Row, j: int, inertia: str) -> Row:
    if inertia == "none":
        return {"M": 1}
    if inertia == "full":
        kept = TEN
    elif j == 1:
        kept = ("ZZ",)
    elif row.get("joint") == "prismatic":
        kept = ("MX", "MY", "MZ", "M")
    else:
        kept = tuple(parameter for parameter in TEN if parameter not in ("YY", "MZ", "M"))
    return {parameter: f"{parameter}{j}" for parameter in kept}
