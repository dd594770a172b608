"""Line charts of signals over time, as options of ECharts, whose library comes with NiceGUI."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
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
        "lineStyle": {"width": 1.6},
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
