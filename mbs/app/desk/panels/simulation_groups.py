"""The signals of a result in the groups that plots show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.result import Result

Array = NDArray[np.float64]
Charts = dict[str, dict[str, Array]]
"""Unit of a chart to its signals by name."""

_ENERGIES = ("kinetic_energy", "potential_energy")
_CLOSURE = "closure_residual"
_KINDS = {"q": "Positions", "v": "Velocities", "a": "Accelerations", "tau": "Efforts"}


def groups_of(system: System, result: Result) -> dict[str, Charts]:
    """The charts of every group: positions, velocities, and so on; each unit has a chart.

    Args:
        system: that moved.
        result: its motion.

    Returns:
        title of a group to its charts; groups without signals are left out.
    """
    joints = {f"{c.name}.{kind}" for c in (*system.coordinates, *system.speeds) for kind in _KINDS}
    groups: dict[str, Charts] = {title: {} for title in _KINDS.values()}
    groups |= {"Energy": {}, "Closure": {}, "Others": {}}
    for name, unit in result.units.items():
        title, label = _place(name, joints)
        groups[title].setdefault(unit, {})[label] = result[name]
    total = sum((result[name] for name in _ENERGIES), np.zeros(len(result)))
    groups["Energy"].setdefault("J", {})["total"] = total
    if not system.is_closed:
        del groups["Closure"]
    return {title: charts for title, charts in groups.items() if charts}


def _place(name: str, joints: set[str]) -> tuple[str, str]:
    """The group of a signal and what its line is called there."""
    if name in joints:
        stem, _, kind = name.rpartition(".")
        return _KINDS[kind], stem
    if name in _ENERGIES:
        return "Energy", name.removesuffix("_energy")
    return ("Closure", "largest row") if name == _CLOSURE else ("Others", name)
