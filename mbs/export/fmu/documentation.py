"""documentation/index.html of an FMU."""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.tables import JointRow, LinkRow
from mbs.assembly.tree import Link
from mbs.export.fmu.description import (
    WITH_START,
    Documentation,
    FmuModel,
    FmuVariable,
    Kind,
    PageTable,
)
from mbs.expressions import MORE_THAN_ZERO
from mbs.operations import count
from mbs.spatial.inertia import TEN_PARAMETERS
from mbs.units import UNITS
from mbs.view.drawing import drawing
from mbs.view.drawing_files import svg

_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<main>
{content}
</main>
</body>
</html>
"""
_STYLE = """\
:root { color-scheme: light dark; --ink: #1c2530; --paper: #fbfbf8; --rule: #d5d8dc;
  --quiet: #5c6470; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #dde3ea; --paper: #14181d; --rule: #343b44; --quiet: #9aa3ae; }
}
body { margin: 0; color: var(--ink); background: var(--paper);
  font: 1rem/1.5 system-ui, sans-serif; }
main { max-width: 60rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2rem; }
p.report { white-space: pre-wrap; overflow-wrap: anywhere; }
.note, figcaption { color: var(--quiet); font-size: 0.9rem; }
figure { margin: 1rem 0; }
svg.drawing { display: block; width: 100%; max-height: 75vh; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.9rem; }
th, td { text-align: left; padding: 0.2rem 0.8rem 0.2rem 0; border-bottom: 1px solid var(--rule);
  vertical-align: top; }
th { font-weight: 600; white-space: nowrap; }
td { font-variant-numeric: tabular-nums; }
"""
_GROUPS: tuple[tuple[Kind, str], ...] = (
    ("input", "Inputs"),
    ("state", "States"),
    ("output", "Outputs"),
    ("parameter", "Parameters"),
    ("mode", "Modes, which change at events alone"),
    ("dependent", "Positions that the loops determine; the start values choose the branch"),
    ("indicator", "Event indicators"),
    ("derivative", "Derivatives of the states"),
    ("slot", "States in Model Exchange"),
    ("rate", "Their derivatives"),
    ("chart", "Indicator that asks for other states"),
    ("cut", "Positions of joints that are cut; the start values choose the branch"),
)
_FUNCTIONS = {
    "derivatives and outputs": "rhs",
    "one step that closes the loops": "closure",
}
_KEY = {"active": "Orange: driven joints", "loop": "Red: joints that close loops"}
_LICENCE = (
    "The headers fmi2*.h or fmi3*.h among the sources are those of the FMI standard, copyright"
    " Modelica Association, under the 2-clause BSD licence; the other C files but model.c are those"
    " of the package mbs, under the MIT licence. Both texts lie in documentation/licenses."
)


def documentation(model: FmuModel) -> str:
    """Return the HTML page of an FMU: text of the model, drawing, tables and variables.

    Args:
        model: description of the FMU.

    Returns:
        Self-contained HTML.
    """
    text = model.documentation or model.description or model.name
    tables = model.about.tables if model.about else ()
    content = [
        f"<h1>{html.escape(model.name)}</h1>",
        *_drawing(model),
        *(f'<p class="report">{html.escape(part)}</p>' for part in text.split("\n\n")),
        *(_table(table) for table in tables),
        *(_table(table) for table in _variables(model)),
        _table(_simulation(model)),
        _table(_operations(model)),
        f'<h2>Licences</h2>\n<p class="note">{html.escape(_LICENCE)}</p>',
    ]
    return _PAGE.format(title=html.escape(model.name), style=_STYLE, content="\n".join(content))


def _drawing(model: FmuModel) -> list[str]:
    if model.about is None or model.about.drawing is None:
        return []
    drawn = model.about.drawing
    caption = f"{model.name} at its start, {drawn.caption}."
    used = {stroke.colour for stroke in drawn.strokes}
    key = [words for colour, words in _KEY.items() if colour in used]
    words = f"{caption} {'; '.join(key)}." if key else caption
    return [
        f"<figure>\n{svg(drawn, caption)}",
        f"<figcaption>{html.escape(words)}</figcaption>",
        "</figure>",
    ]


def _table(table: PageTable) -> str:
    if not table.rows:
        return ""
    note = f'<p class="note">{html.escape(table.note)}</p>\n' if table.note else ""
    head = _row("th", table.columns)
    rows = "\n".join(_row("td", row) for row in table.rows)
    return (
        f"<h2>{html.escape(table.title)}</h2>\n{note}"
        f'<div class="wide"><table>\n{head}\n{rows}\n</table></div>'
    )


def _row(tag: str, cells: Iterable[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{html.escape(cell)}</{tag}>' for cell in cells)}</tr>"


def _variables(model: FmuModel) -> list[PageTable]:
    tables = []
    for kind, title in _GROUPS:
        rows = [entry.variable for entry in model.entries if entry.kind == kind]
        starts = kind in WITH_START
        columns = ("name", "unit", *(("start",) if starts else ()), "what it is")
        lines = tuple((v.name, v.unit, *_start(v, starts), _words(v)) for v in rows)
        tables.append(PageTable(title, columns, lines))
    return tables


def _start(v: FmuVariable, shown: bool) -> tuple[str, ...]:
    if not shown:
        return ()
    unit = UNITS[v.unit]
    text = f"{v.start:.6g}"
    if unit.display and v.start:
        text += f" ({unit.display_factor * v.start:.6g} {unit.display})"
    return (text,)


def _words(v: FmuVariable) -> str:
    bounds = ""
    if v.min is not None or v.max is not None:
        low = "" if v.min is None else "more than 0" if v.min == MORE_THAN_ZERO else f"{v.min:g}"
        high = "" if v.max is None else f"{v.max:g}"
        bounds = f" ({low} .. {high})"
    return f"{v.description}{bounds}{', fixed' if v.fixed else ''}"


def _simulation(model: FmuModel) -> PageTable:
    step = f", steps of {model.internal_step:g} s" if model.solver == "rk4" else ""
    rows = (
        ("stop time", f"{model.stop_time:g} s"),
        ("communication step", f"{model.step_size:g} s"),
        ("relative tolerance", f"{model.tolerance:g}"),
        ("solver of co-simulation", f"{model.solver}{step}"),
    )
    return PageTable("Default experiment", ("what", "value"), rows)


def _operations(model: FmuModel) -> PageTable:
    """Return a table of the scalar operations of the equations. Functions in MX are left out."""
    rows = []
    for title, attribute in _FUNCTIONS.items():
        function = getattr(model, attribute)
        if function is not None and function.is_a("SXFunction"):
            c = count(function, parameters=(function.name_in(function.n_in() - 1),))
            numbers = (c.mul, c.add, c.div, c.sqrt, c.trig, c.other)
            rows.append((title, *(str(number) for number in numbers)))
    columns = ("function", "×", "+ −", "÷", "√", "sin, cos, ..", "others")
    note = "What depends on parameters alone is left out."
    return PageTable("Operations of the equations", columns, tuple(rows), note)


# Drawing and tables of a mechanism for the documentation of its FMU.


_LONGEST = 24
"""Greatest length of an expression in a table cell, in characters."""


def about(system: System) -> Documentation:
    """Return the drawing at the assembled configuration and tables of joints, links and loops.

    Args:
        system: assembled mechanism, open or closed, in which every symbol has a value.
    """
    tables = (
        _joints(system),
        _geometry(system),
        _inertias(system),
        _bodies(system),
        _loops(system),
    )
    return Documentation(tuple(table for table in tables if table.rows), drawing(system))


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
        " or r. A fixed frame on the path to link 4 is numbered 4.1.",
    )


def _placements(system: System, row: LinkRow) -> Iterator[tuple[str, ...]]:
    """Yield the table rows of the fixed frames before a link, then the row of the link."""
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
        " its axes, mass [kg]; of the joint, inertia of the rotor, viscous and Coulomb friction.",
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
    """Format values as numbers, and short symbolic expressions as `expression = number`."""
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


# Licences of the files that an FMU contains in addition to its equations.


MBS = """\
MIT License

Copyright (c) 2026 mbs contributors

Permission is hereby granted, free of charge, to any person obtaining a copy
of this software and associated documentation files (the "Software"), to deal
in the Software without restriction, including without limitation the rights
to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
copies of the Software, and to permit persons to whom the Software is
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all
copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE
SOFTWARE.
"""
"""Licence of the C files of this package."""

_START, _END = "Copyright (C)", "*/"

_OVERVIEW = """\
The equations in model.c and model.h, the description and the documentation of this FMU belong to
its author. The other files of the folder sources are compiled into its libraries too:

mbs.txt            the C files of the package mbs
fmi-standard.txt   the headers fmi*.h of the FMI standard
{own}"""
_OWN = "                   {name}: see there, it came with the model\n"


def licence_files(standard_header: str, own: list[str]) -> dict[str, str]:
    """Return the files of the folder documentation/licenses: dict from name to text.

    Args:
        standard_header: text of a header of the FMI standard, which contains its licence.
        own: names of the C files that came with the model.
    """
    start = standard_header.index(_START)
    lines = standard_header[start : standard_header.index(_END, start)].rstrip()
    overview = _OVERVIEW.format(own="".join(_OWN.format(name=name) for name in own))
    return {"license.txt": overview, "mbs.txt": MBS, "fmi-standard.txt": lines + "\n"}
