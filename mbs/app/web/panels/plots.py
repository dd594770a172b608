"""Line charts of signals over time, as options of ECharts, which is part of NiceGUI."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any
from weakref import WeakSet

import numpy as np
from nicegui import ui
from nicegui.client import Client
from numpy.typing import NDArray

Array = NDArray[np.float64]

COLOURS = (
    "#3b7dd8",
    "#e07a1f",
    "#2a9d6f",
    "#c94f6d",
    "#8a63d2",
    "#a8820a",
    "#1a9cb0",
    "#7d8590",
    "#c04bbb",
    "#5b8c2a",
)
"""Colours of lines, distinguishable on light and on dark backgrounds."""

_MOST_POINTS = 12_000
_GREY = "#868c96"
_FAINT = "rgba(134, 140, 150, 0.22)"


def line_chart(time: Array, series: Mapping[str, Array], unit: str) -> dict[str, Any]:
    """Return the ECharts options of a line chart.

    Args:
        time: (n,) times [s].
        series: name to values (n,), all in the same unit.
        unit: unit of the values; "1" for none.
    """
    rows = kept_rows(list(series.values()), max(_MOST_POINTS // max(len(series), 1), 200))
    x = time[rows]
    return {
        "animation": False,
        "color": list(COLOURS),
        "textStyle": {"color": _GREY, "fontFamily": "inherit"},
        "grid": {"left": 62, "right": 22, "top": 32, "bottom": 42},
        "legend": {
            "type": "scroll",
            "top": 2,
            "icon": "roundRect",
            "itemWidth": 14,
            "itemHeight": 3,
            "textStyle": {"color": _GREY},
        },
        "tooltip": {
            "trigger": "axis",
            "confine": True,
            "textStyle": {"fontSize": 12},
            ":valueFormatter": "v => Number(v).toPrecision(5)",
        },
        "dataZoom": [{"type": "inside", "filterMode": "none"}],
        "xAxis": _axis("time [s]", below=True),
        "yAxis": _axis("" if unit == "1" else f"[{unit}]"),
        "series": [_line(name, x, y[rows]) for name, y in series.items()],
    }


def kept_rows(columns: list[Array], most: int) -> NDArray[np.intp]:
    """Return the rows that a chart needs: the first, the last, and the extremes of each interval.

    Args:
        columns: signals, (n,) each.
        most: approximate number of rows to keep.

    Returns:
        increasing row indices; all rows if there are at most `most`.
    """
    n = len(columns[0]) if columns else 0
    if n <= most:
        return np.arange(n)
    count = max(most // (2 * len(columns)), 1)
    edges = np.linspace(0, n, count + 1).astype(int)
    found = {0, n - 1}
    for column in columns:
        for first, last in pairwise(edges):
            part = np.nan_to_num(column[first:last])
            found |= {int(first + part.argmin()), int(first + part.argmax())}
    return np.array(sorted(found), dtype=np.intp)


def _line(name: str, x: Array, y: Array) -> dict[str, Any]:
    """Return the ECharts options of a line of values y over x (n,); NaN makes a gap."""
    points = [[a, b if b == b else None] for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    return {
        "name": name,
        "type": "line",
        "showSymbol": False,
        "lineStyle": {"width": 1.6},  # [px] below the default 2, to separate many lines
        "emphasis": {"disabled": True},
        "data": points,
    }


def _axis(title: str, *, below: bool = False) -> dict[str, Any]:
    """Return the ECharts options of an axis; `below` is True for the time axis."""
    ends = {"min": "dataMin", "max": "dataMax"} if below else {"scale": True}
    return {
        "type": "value",
        "name": title,
        "nameLocation": "middle" if below else "end",
        "nameGap": 26 if below else 10,
        "nameTextStyle": {"color": _GREY, "align": "center" if below else "right"},
        "axisLine": {"onZero": False, "lineStyle": {"color": _GREY}},
        "axisLabel": {
            "color": _GREY,
            "hideOverlap": True,
            ":formatter": "v => String(+Number(v).toPrecision(4))",
        },
        "splitLine": {"lineStyle": {"color": _FAINT}},
        **ends,
    }


# Small fields of forms that report each change by a callback, without polling.


_PROPS = "dense outlined hide-bottom-space"
_MENU = f"{_PROPS} options-dense"

Take = Callable[[Any], object]


@dataclass(frozen=True, slots=True)
class FieldLook:
    """Appearance of a field, and its marker for tests.

    Attributes:
        label: label in the frame of the field; "" for none.
        width: width in CSS.
        marker: name of the field in the page.
    """

    label: str
    width: str
    marker: str


def text_field(look: FieldLook, value: str, take: Take) -> ui.input:
    """Create a field for a line of text.

    Args:
        look: appearance of the field.
        value: initial text.
        take: callable that is called with each new text.
    """
    field = ui.input(look.label or None, value=value, on_change=lambda e: take(e.value or ""))
    field.props(_PROPS).style(f"width: {look.width}").mark(look.marker)
    _named(field, look)
    return field


def choice_field(look: FieldLook, options: Mapping[str, str], value: str, take: Take) -> ui.select:
    """Create a field for the choice of a single value.

    Args:
        look: appearance of the field.
        options: value to its label.
        value: initial value.
        take: callable that is called with each new value.
    """
    field = ui.select(
        dict(options), label=look.label or None, value=value, on_change=lambda e: take(e.value)
    )
    field.props(_MENU).style(f"width: {look.width}").mark(look.marker)
    _named(field, look)
    return field


def several_field(
    look: FieldLook, options: Mapping[str, str], value: Sequence[str], take: Take
) -> ui.select:
    """Create a field for the choice of several values.

    Args:
        look: appearance of the field.
        options: value to its label.
        value: initial values.
        take: callable that is called with the list of values at each change.
    """
    field = ui.select(
        dict(options),
        label=look.label or None,
        value=list(value),
        multiple=True,
        on_change=lambda e: take(list(e.value)),
    )
    field.props(f"{_MENU} use-chips").style(f"width: {look.width}").mark(look.marker)
    return field


def _named(field: ui.element, look: FieldLook) -> None:
    """Add an accessible name for screen readers to a field without label."""
    if not look.label:
        field.props(f'aria-label="{look.marker}"')


# Styles of panels with forms and plots: small fields in rows and grids.


_CSS = """
.app-small .q-field__control, .app-small .q-field__marginal { height: 30px; min-height: 30px; }
.app-small .q-field__native { min-height: 30px; padding: 0; font-size: 13px;
  font-variant-numeric: tabular-nums; }
.app-small .q-field__control { padding: 0 8px; }
.app-laws { display: grid; gap: 4px 8px; align-items: center; width: 100%;
  grid-template-columns: minmax(34px, auto) 82px 82px 112px minmax(170px, 1fr); }
.app-cards { display: grid; gap: 14px; width: 100%; align-items: start;
  grid-template-columns: repeat(auto-fit, minmax(330px, 1fr)); }
.app-card { border: 1px solid var(--d-line); border-radius: 10px; padding: 12px 14px; gap: 9px;
  display: flex; flex-direction: column; align-items: start; min-width: 0; }
.app-card-title { font-weight: 600; font-size: 14.5px; }
.app-halves { display: flex; align-items: flex-start; gap: 22px; width: 100%; }
.app-half { display: flex; flex-direction: column; gap: 8px; min-width: 0; }
.app-stays { flex: 1 1 0; align-self: flex-start; position: sticky; top: 12px; width: 100%; }
.app-result-head { display: flex; align-items: center; gap: 8px; width: 100%; flex-wrap: wrap; }
.app-residuals { display: grid; width: 100%; gap: 4px 12px;
  grid-template-columns: minmax(0, 3fr) minmax(0, 2fr); }
.app-panel .q-table__card { background: transparent; color: inherit; }
.app-player { display: flex; align-items: center; gap: 12px; width: 100%; }
.app-player .q-slider * { transition: none !important; }
@media (max-width: 1100px) { .app-halves { flex-direction: column; }
  .app-stays { position: static; flex: none; } }
"""

_DONE: WeakSet[Client] = WeakSet()


def add_look() -> None:
    """Add the styles of panels with forms and plots to the page, once."""
    client = ui.context.client
    if client not in _DONE:
        _DONE.add(client)
        ui.add_css(_CSS)


def come_into_view(element: ui.element) -> None:
    """Scroll to an element, for pages that are too narrow to show it next to the form.

    Args:
        element: element of the page.
    """
    ui.run_javascript(f"getHtmlElement({element.id})?.scrollIntoView({{block: 'nearest'}})")
