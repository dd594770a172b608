"""What the tables show of a mechanism that was composed: the links that it was assembled into."""

from __future__ import annotations

from casadi import SX, Function

from mbs.app.desk.document.cells import GEOMETRY_COLUMNS, INERTIA_COLUMNS, written
from mbs.app.desk.document.tables import Tables, Texts
from mbs.assembly import System
from mbs.assembly.tables import LinkRow
from mbs.formats.rows import GEOMETRY
from mbs.spatial.inertia import TEN_PARAMETERS

_DIGITS = 9


def shown_tables(system: System, tables: Tables) -> Tables:
    """The frames and inertias of the links, and the loops, as texts that are only read.

    Args:
        system: the assembled mechanism.
        tables: with its name and the values of its symbols.
    """
    return Tables(
        geometry=tuple(_geometry(system, row) for row in system.links),
        inertia=tuple(_inertia(system, j) for j in range(len(system.links))),
        loops=tuple((loop.name, "", loop.closing) for loop in system.loops),
        general=tables.general,
        values=tables.values,
        attached=((None, False),) * len(system.links),
    )


def _geometry(system: System, row: LinkRow) -> Texts:
    speeds = system.speeds[system.tree.links[row.number - 1].v]
    places = system.coordinates[system.tree.links[row.number - 1].q]
    cells = dict.fromkeys(GEOMETRY_COLUMNS, "")
    cells |= {key: _text(getattr(row, key)) for key in GEOMETRY}
    cells |= {
        "antecedent": " + ".join((str(row.antecedent), *map(_fixed_frame, row.via))),
        "joint": row.motion,
        "actuated": "yes" if any(speed.actuated for speed in speeds) else "no",
        "name": row.name,
    }
    if len(places) == 1 and places[0].limits is not None:
        cells["limits"] = ", ".join(map(_text, places[0].limits))
    return tuple(cells[column] for column in GEOMETRY_COLUMNS)


def _fixed_frame(six: tuple[float | SX, ...]) -> str:
    """A fixed frame on the way to a link, by its parameters that are not zero."""
    values = (f"{k} {_text(x)}" for k, x in zip(GEOMETRY, six, strict=True) if not _is_zero(x))
    return f"fixed frame ({', '.join(values)})"


def _is_zero(value: float | SX) -> bool:
    return not isinstance(value, SX) and value == 0


def _inertia(system: System, j: int) -> Texts:
    link = system.tree.links[j]
    values = dict(zip(TEN_PARAMETERS, (link.inertia.parameters[k] for k in range(10)), strict=True))
    cells = dict.fromkeys(INERTIA_COLUMNS, "")
    cells |= {name: _number(system, value) for name, value in values.items()}
    bodies = [body.name for body in system.bodies if body.link == j + 1]
    cells["name"] = ", ".join(bodies)
    return tuple(cells[column] for column in INERTIA_COLUMNS)


def _number(system: System, value: SX) -> str:
    """The number at the defaults of the symbols, or the expression where one has none."""
    at = float(Function("value", [system.p], [value])(system.p_default))
    return str(value) if at != at else _text(at)


def _text(value: float | SX) -> str:
    if isinstance(value, SX):
        return str(value)
    exact = written(float(value))
    return exact if "pi" in exact else f"{float(value):.{_DIGITS}g}"
