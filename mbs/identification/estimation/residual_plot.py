"""Pictures of measured and predicted efforts."""

from __future__ import annotations

import os
from typing import Any

from mbs.identification.estimation.residuals import Residuals
from mbs.result import _figure, _save


def plot_residuals(
    residuals: Residuals, path: str | os.PathLike[str] | None = None, title: str = ""
) -> Any:
    """Measured and predicted effort and their difference, a panel for each joint.

    Args:
        residuals: to draw.
        path: file to save the picture to, in the format that its ending names.
        title: above the panels.

    Returns:
        the matplotlib Figure.

    Raises:
        ModelError: matplotlib is missing.
        ExportError: the file cannot be written.
    """
    figure = _figure(len(residuals.efforts), shown=path is None)
    if title:
        figure.suptitle(title)
    panels = figure.subplots(len(residuals.efforts), 1, sharex=True, squeeze=False)[:, 0]
    for k, panel in enumerate(panels):
        panel.plot(residuals.time, residuals.measured[:, k], label="measured")
        panel.plot(residuals.time, residuals.predicted[:, k], "--", label="predicted")
        panel.plot(residuals.time, residuals.error[:, k], label="error")
        share = f"{residuals.percent[k]:.1f} %"
        panel.set_title(f"{residuals.efforts[k]}: error {share}", fontsize="small")
        panel.set_ylabel(f"[{residuals.effort_units[k]}]")
        panel.grid(True, alpha=0.3)
    panels[0].legend(loc="upper right", fontsize="small")
    panels[-1].set_xlabel("time [s]")
    if path is not None:
        _save(figure, path)
    return figure
