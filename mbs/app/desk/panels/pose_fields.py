"""Fields in which a visitor types a pose: a place and three angles, or a matrix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from nicegui import ui

from mbs.app.desk.panels.form import FIELD
from mbs.app.tasks.postures import pose_from, pose_from_text, rpy_of
from mbs.app.tasks.postures_pose import Array

ANGLES, MATRIX = "place and angles", "matrix"
_NAMES = ("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]")
_FORMS = "12 or 16 numbers row by row, or x y z roll pitch yaw; pi/2 and the like are read"
_ROUNDED = 1e-12


class PoseFields:
    """The pose in two forms, of which one is shown; both say the same after `show`."""

    def __init__(self) -> None:
        self._form = ui.toggle([ANGLES, MATRIX], value=ANGLES, on_change=self._switch)
        self._form.props("dense flat no-caps").mark("pose form")
        grid = "display: grid; grid-template-columns: 1fr 1fr 1fr; gap: 8px; width: 100%"
        with ui.element("div").style(grid) as self._angles:
            self._fields = [_field(name) for name in _NAMES]
        self._matrix = ui.textarea("rows of the pose in the base").props(f"{FIELD} rows=4")
        self._matrix.style("width: 100%; font-family: var(--d-mono)").mark("matrix")
        self._matrix.tooltip(_FORMS).set_visibility(False)

    @property
    def T(self) -> Array:
        """(4, 4) the pose as typed.

        Raises:
            MbsError: a field has no value.
        """
        if self._form.value == MATRIX:
            return pose_from_text(str(self._matrix.value or ""))
        texts = [str(field.value or "0") for field in self._fields]
        return pose_from(texts[:3], texts[3:])

    def show(self, T: Array) -> None:
        """Write a pose (4, 4) into the fields."""
        values = [*np.asarray(T, dtype=float)[:3, 3].tolist(), *rpy_of(T)]
        for field, value in zip(self._fields, values, strict=True):
            field.set_value(_text(value))
        self._matrix.set_value("\n".join(_line(row) for row in np.asarray(T).tolist()))

    def _switch(self) -> None:
        self._angles.set_visibility(self._form.value == ANGLES)
        self._matrix.set_visibility(self._form.value == MATRIX)


def _field(name: str) -> ui.input:
    field = ui.input(name).props(FIELD)
    if "rad" in name:
        field.tooltip("R = Rz(yaw) Ry(pitch) Rx(roll)")
    return field.mark(name.split(" ")[0])


def _text(value: float) -> str:
    """A number that reads back to the same double, zeros without noise."""
    return "0" if abs(value) < _ROUNDED else repr(float(value))


def _line(row: Sequence[float]) -> str:
    return "  ".join(_text(value) for value in row)
