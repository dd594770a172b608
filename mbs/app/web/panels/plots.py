"""Line charts of signals over time, as options of ECharts, whose library comes with NiceGUI."""

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
"""Of lines, told apart on light and on dark ground."""

_MOST_POINTS = 12_000
_GREY = "#868c96"
_FAINT = "rgba(134, 140, 150, 0.22)"


def line_chart(time: Array, series: Mapping[str, Array], unit: str) -> dict[str, Any]:
    """The options of a chart.

    Args:
        time: (n,) [s].
        series: name to (n,) values, all in one unit.
        unit: of the values, "1" for none.
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
    """Rows that a chart needs: the first, the last, and the extremes of every stretch.

    Args:
        columns: (n,) each.
        most: rows to keep about.

    Returns:
        increasing numbers of rows; all of them where there are no more than `most`.
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
    points = [[a, b if b == b else None] for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    return {
        "name": name,
        "type": "line",
        "showSymbol": False,
        "lineStyle": {"width": 1.6},  # [px] thinner than the usual 2: many lines stay apart
        "emphasis": {"disabled": True},
        "data": points,
    }


def _axis(title: str, *, below: bool = False) -> dict[str, Any]:
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


# Small fields of forms that hand on what is typed or chosen, without polling.


_PROPS = "dense outlined hide-bottom-space"
_MENU = f"{_PROPS} options-dense"

Take = Callable[[Any], object]


@dataclass(frozen=True, slots=True)
class FieldLook:
    """How a field looks, and what tests find it by.

    Attributes:
        label: in its frame, "" for none.
        width: of CSS.
        marker: its name in the page.
    """

    label: str
    width: str
    marker: str


def text_field(look: FieldLook, value: str, take: Take) -> ui.input:
    """A line of text.

    Args:
        look: of the field.
        value: at first.
        take: called with each text.
    """
    field = ui.input(look.label or None, value=value, on_change=lambda e: take(e.value or ""))
    field.props(_PROPS).style(f"width: {look.width}").mark(look.marker)
    _named(field, look)
    return field


def choice_field(look: FieldLook, options: Mapping[str, str], value: str, take: Take) -> ui.select:
    """One of some values.

    Args:
        look: of the field.
        options: value to what is shown for it.
        value: at first.
        take: called with each choice.
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
    """Some of several values.

    Args:
        look: of the field.
        options: value to what is shown for it.
        value: at first.
        take: called with a list at each choice.
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
    """A name for those who do not see the field, where it has no label."""
    if not look.label:
        field.props(f'aria-label="{look.marker}"')


# The look of panels with forms and plots: small fields in rows and grids.


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
    """Give the page these styles, once."""
    client = ui.context.client
    if client not in _DONE:
        _DONE.add(client)
        ui.add_css(_CSS)


def come_into_view(element: ui.element) -> None:
    """Scroll what was filled into sight, where the page is too narrow to show it beside a form."""
    ui.run_javascript(f"getHtmlElement({element.id})?.scrollIntoView({{block: 'nearest'}})")
