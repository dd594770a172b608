"""Identified bodies as drawings have them: mass, centre of mass and central inertia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from casadi import DM, Function

from mbs.assembly import System
from mbs.identification.bodies.physical_set import pseudo_inertias
from mbs.identification.regressors.columns import Column

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class BodyValues:
    """What moves with a link, in the frame of its first body.

    Attributes:
        name: of the body; several that are fixed to each other are joined by " + ".
        mass: [kg].
        centre: (3,) centre of mass in the frame of the body [m].
        inertia: (3, 3) about the centre of mass, in the axes of the frame [kg m2].
    """

    name: str
    mass: float
    centre: Array
    inertia: Array


def body_values(system: System, columns: Sequence[Column], values: Array) -> tuple[BodyValues, ...]:
    """Every body that moves, at the defaults of the symbols.

    Args:
        system: whose bodies they are.
        columns: with all ten inertial parameters of its links.
        values: (k,) of the columns, masses positive.
    """
    found = []
    for link, P in pseudo_inertias(columns, values).items():
        names = [row.name for row in system.bodies if row.link == link]
        first = names[0] if names else link
        T = _pose(system, first)
        R, p, mass = T[:3, :3], T[:3, 3], float(P[3, 3])
        centre = P[:3, 3] / mass
        second = R.T @ (P[:3, :3] - mass * np.outer(centre, centre)) @ R
        inertia = np.trace(second) * np.eye(3) - second
        name = " + ".join(names) or f"link {link}"
        found.append(BodyValues(name, mass, R.T @ (centre - p), inertia))
    return tuple(found)


def bodies_table(system: System, columns: Sequence[Column], values: Array) -> str:
    """The same in plain lines, kg, m and kg m2."""
    rows = body_values(system, columns, values)
    width = max([len("body"), *(len(row.name) for row in rows)])
    heads = ("mass", "x", "y", "z", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
    head = f"{'body':<{width}}" + "".join(f"{name:>11}" for name in heads)
    lines = ["Bodies in their own frames, inertia about the centre of mass [kg, m, kg m2]", head]
    for row in rows:
        J = row.inertia
        six = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
        numbers = (row.mass, *row.centre, *six)
        lines.append(f"{row.name:<{width}}" + "".join(f"{x:>11.4g}" for x in numbers))
    return "\n".join(lines)


def _pose(system: System, frame: str | int) -> Array:
    """(4, 4) of a frame seen from its link."""
    pose = system.frame(frame)[1].matrix
    at = Function("pose", [system.p], [pose])(DM(system.parameter_values()))
    return np.asarray(DM(at).full(), dtype=float)
