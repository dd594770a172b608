"""What the documentation of an FMU says of a mechanism: its drawing and its tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.joint_rows import JointRow
from mbs.assembly.tables import LinkRow
from mbs.assembly.tree import Link
from mbs.export.fmu.about import About, PageTable
from mbs.spatial.inertia import TEN_PARAMETERS
from mbs.view.drawing import drawing

_LONGEST = 24
"""Letters of an expression that a cell of a table holds."""


def about(system: System) -> About:
    """The drawing at the assembled posture, and tables of joints, links, bodies and loops.

    Args:
        system: open or closed; every symbol has a value.
    """
    tables = (
        _joints(system),
        _geometry(system),
        _inertias(system),
        _bodies(system),
        _loops(system),
    )
    return About(tuple(table for table in tables if table.rows), drawing(system))


def _joints(system: System) -> PageTable:
    return PageTable(
        "Joints",
        ("joint", "kind", "between", "coordinates", "driven", "limits"),
        tuple(_joint(system, row) for row in system.joints),
        "A closing joint was cut to open a loop; its coordinates are not among the positions.",
    )


def _joint(system: System, row: JointRow) -> tuple[str, ...]:
    own = [c for c in (*system.coordinates, *system.cut_coordinates) if c.joint == row.name]
    limits = ", ".join(
        f"{c.limits[0]:g} .. {c.limits[1]:g} {c.unit}" for c in own if c.limits is not None
    )
    return (
        row.name,
        f"{row.kind}, closing" if row.cut else row.kind,
        f"{_place(row.frame_a[0])} and {_place(row.frame_b[0])}",
        ", ".join(f"{c.name} [{c.unit}]" for c in own),
        "yes" if any(c.actuated for c in own) else "no",
        limits,
    )


def _place(link: int) -> str:
    return "base" if link < 0 else f"link {link + 1}"


def _geometry(system: System) -> PageTable:
    return PageTable(
        "Placement of the links",
        ("link", "moved by", "on", "γ [rad]", "b [m]", "α [rad]", "d [m]", "θ [rad]", "r [m]"),
        tuple(placement for row in system.links for placement in _placements(system, row)),
        "Parameters of Khalil and Kleinfinger at the zero of the coordinate, which is added to θ"
        " or r. A fixed frame on the way to link 4 is numbered 4.1.",
    )


def _placements(system: System, row: LinkRow) -> Iterator[tuple[str, ...]]:
    """The fixed frames that lead to a link, then the link."""
    before = _place(row.antecedent - 1)
    for number, fixed in enumerate(row.via, 1):
        name = f"{row.number}.{number}"
        yield name, "fixed", before, *_texts(system, (SX(x) for x in fixed))
        before = f"frame {name}"
    numbers = (row.gamma, row.b, row.alpha, row.d, row.theta, row.r)
    what = f"{row.motion} {row.name}"
    yield str(row.number), what, before, *_texts(system, (SX(x) for x in numbers))


def _inertias(system: System) -> PageTable:
    return PageTable(
        "Inertial parameters of the links",
        ("link", *TEN_PARAMETERS, "Ia", "Fv", "Fs"),
        tuple(_inertia(system, k, link) for k, link in enumerate(system.tree.links, start=1)),
        "Inertia [kg m²] and first moments [kg m] about the origin of the frame of the link and in"
        " its axes, mass [kg]; of the joint, inertia of the rotor, viscous and dry friction.",
    )


def _inertia(system: System, number: int, link: Link) -> tuple[str, ...]:
    ten = casadi.vertsplit(link.inertia.parameters)
    return (str(number), *_texts(system, (*ten, link.Ia, link.Fv, link.Fs)))


def _bodies(system: System) -> PageTable:
    rows = tuple(
        (row.name, _place(row.link - 1), "" if row.mass is None else f"{row.mass:.6g}")
        for row in system.bodies
    )
    return PageTable("Bodies", ("body", "carried by", "mass [kg]"), rows)


def _loops(system: System) -> PageTable:
    rows = tuple(
        (
            row.name,
            row.closing,
            ", ".join(row.joints),
            ", ".join(row.rows),
            ", ".join(row.dropped),
        )
        for row in system.loops
    )
    columns = ("closed at", "by", "through", "rows", "rows that depend on the others")
    return PageTable("Loops", columns, rows)


def _texts(system: System, values: Iterable[SX]) -> list[str]:
    """Numbers, or short expressions of symbols with their value."""
    every = list(values)
    found = casadi.Function("values", [system.p], [casadi.vertcat(*every)])
    numbers = casadi.DM(found(system.parameter_values())).full().ravel()
    return [
        f"{number:.6g}" if value.is_constant() else _symbolic(value, float(number))
        for value, number in zip(every, numbers, strict=True)
    ]


def _symbolic(value: SX, number: float) -> str:
    text = str(value)
    return f"{text} = {number:.6g}" if len(text) <= _LONGEST else f"{number:.6g}"
