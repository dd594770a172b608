"""A system whose links and joints have other inertial parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.tree import Link
from mbs.identification.regressors.columns import INERTIAL, Column
from mbs.spatial import Inertia, elements

_OF_THE_JOINT = ("Ia", "Fv", "Fs")


def with_parameters(system: System, columns: Sequence[Column], values: SX) -> System:
    """The same mechanism with these parameters, those of no column as they were.

    Masses of its bodies are no longer known. Offsets and motors of two joints stay away, since a
    system has none.

    Args:
        system: open or closed.
        columns: the parameters.
        values: (n, 1) numbers, or expressions of the symbols of the system.
    """
    given: dict[int, dict[str, SX]] = {}
    for column, value in zip(columns, elements(values), strict=True):
        if not column.other:
            given.setdefault(column.link - 1, {})[column.kind] = value
    links = tuple(_with(link, given.get(j, {})) for j, link in enumerate(system.tree.links))
    bodies = tuple(replace(row, mass=None) for row in system.bodies)
    return replace(system, tree=replace(system.tree, links=links), bodies=bodies, _cache={})


def _with(link: Link, values: Mapping[str, SX]) -> Link:
    ten = elements(link.inertia.parameters)
    ten = [values.get(name, old) for name, old in zip(INERTIAL, ten, strict=True)]
    rotor = link.rotor
    if rotor is not None and "Jm" in values:
        rotor = replace(rotor, inertia=values["Jm"])
    joint: dict[str, Any] = {name: values[name] for name in _OF_THE_JOINT if name in values}
    inertia = Inertia.from_parameters(casadi.vertcat(*ten))
    return replace(link, inertia=inertia, rotor=rotor, **joint)
