"""An assembled robot as plain data: frames, inertial parameters, loops, symbols."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from casadi import SX

    from mbs.assembly import System

GEOMETRY = ("gamma", "b", "alpha", "d", "theta", "r")
TEN = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
DRIVE = ("Ia", "Fv", "Fs", "stiffness")

Scalar = float | str
"""Number, or text of an expression of symbols."""


def description_data(system: System) -> dict[str, Any]:
    """Return an assembled system as numbers, texts, lists and dicts that can be converted to JSON.

    Units are SI units and radians. Expressions of symbols without value are texts.

    Args:
        system: open or closed system.
    """
    scalar = _scalars(system)
    closure = system.closure
    return {
        "name": system.name,
        "source": system.source,
        "closed": system.is_closed,
        "nq": system.nq,
        "nv": system.nv,
        "gravity": [scalar(system.tree.gravity[k]) for k in range(3)],
        "links": _links(system, scalar),
        "inertia": _inertia(system, scalar),
        "coordinates": _coordinates(system),
        "independent": [system.velocity_coordinates[k].name for k in system.independent],
        "frames": {name: link + 1 for name, (link, _) in system.frames.items()},
        "loops": _loops(system),
        "closure_residual": None if closure is None else closure.residual,
        "symbols": [
            {"name": p.name, "value": p.default, "unit": p.unit, "description": p.description}
            for p in system.parameters
        ],
        "report": system.report(),
    }


def _coordinates(system: System) -> list[dict[str, Any]]:
    """Return name, unit, limits and assembled position of each coordinate."""
    return [
        {
            "name": c.name,
            "kind": c.kind,
            "unit": c.unit,
            "actuated": c.actuated,
            "limits": c.limits,
            "configuration": value,
        }
        for c, value in zip(system.coordinates, system.configuration, strict=True)
    ]


def _loops(system: System) -> list[dict[str, Any]]:
    """Return name, joints and number of closure equations of each loop."""
    return [
        {
            "name": loop.name,
            "closing": loop.closing,
            "joints": loop.joints,
            "rows": len(loop.rows),
            "dropped": loop.dropped,
        }
        for loop in system.loops
    ]


def _links(system: System, scalar: Callable[[SX], Scalar]) -> list[dict[str, Any]]:
    """Return the frame of each link: Khalil parameters, motion, antecedent and bodies."""
    rows = []
    for link, row in zip(system.tree.links, system.links, strict=True):
        placed = zip(GEOMETRY, map(scalar, link.placement.parameters), strict=True)
        bodies = [body.name for body in system.bodies if body.link == row.number]
        rows.append(
            {
                "number": row.number,
                "name": row.name,
                "antecedent": row.antecedent,
                "motion": row.motion,
                **dict(placed),
                "via": [
                    dict(zip(GEOMETRY, map(scalar, f.parameters), strict=True)) for f in link.via
                ],
                "bodies": bodies,
            }
        )
    return rows


def _inertia(system: System, scalar: Callable[[SX], Scalar]) -> list[dict[str, Any]]:
    """Return the ten inertial parameters and the drive parameters of each link."""
    rows = []
    for number, link in enumerate(system.tree.links, start=1):
        ten = link.inertia.parameters
        values = {name: scalar(ten[k]) for k, name in enumerate(TEN)}
        values |= {name: scalar(getattr(link, name)) for name in DRIVE}
        rows.append({"link": number, **values})
    return rows


def _scalars(system: System) -> Callable[[SX], Scalar]:
    """Return the function that converts a scalar SX to a number or to the text of an expression."""
    from mbs.export.robot_tables import text_function

    text = text_function(system)
    return lambda value: float(value) if value.is_constant() else text(value)
