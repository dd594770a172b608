"""documentation/index.html of an FMU."""

from __future__ import annotations

import html
from collections.abc import Iterable

from mbs.export.fmu.about import PageTable
from mbs.export.fmu.description import WITH_START, FmuModel, FmuVariable, Kind
from mbs.expressions import MORE_THAN_ZERO
from mbs.operations import count
from mbs.units import UNITS
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
    """The page: the text of the model, its drawing and tables, its variables.

    Args:
        model: what the FMU is.

    Returns:
        HTML that needs no other file.
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
    """How many operations the equations take, where they are a graph of scalars."""
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
