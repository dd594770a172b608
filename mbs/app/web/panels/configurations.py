"""Panel of inverse kinematics: a pose, and all configurations in which a frame has the pose."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, cast

import numpy as np
from nicegui import events, ui

from mbs.app.tasks.configurations import (
    Array,
    Configuration,
    ConfigurationList,
    configurations,
    locked_by_default,
    pose_from,
    pose_from_text,
    pose_of,
    rpy_of,
)
from mbs.app.tasks.csv_text import csv_text
from mbs.app.tasks.equations import entry
from mbs.app.web.app import App
from mbs.app.web.panels.equations import open_equations
from mbs.app.web.panels.form import FIELD, frame_label
from mbs.app.web.panels.layout import (
    TaskButton,
    in_a_row,
    main_button,
    side_button,
    two_sides,
    waiting_note,
    warn_of_changes,
)
from mbs.app.web.panels.text_view import column
from mbs.assembly import System
from mbs.errors import MbsError
from mbs.expressions import number as number_of
from mbs.models.catalogue.configurations import moving_joints, surplus_joints
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.options import PoseOptions
from mbs.options import option_fields

# Configurations that solve the inverse kinematics, as a table whose rows move the picture.


_PAGE = 32
_DEGREES = 180 / math.pi
RAD, DEG = "rad", "deg"


def show_configurations(app: App, made: ConfigurationList) -> None:
    """Show the configurations at the present position, or the reason why there are none.

    Args:
        app: app of the page.
        made: result of the inverse kinematics.
    """
    ui.label(_headline(made)).style("font-weight: 600").mark("headline")
    if not made.rows:
        _nothing(app, made)
        return
    with in_a_row():
        unit = ui.toggle([RAD, DEG], value=RAD).props("dense flat no-caps").mark("unit")
        ui.button(
            "CSV",
            icon="download",
            on_click=lambda: app.download(csv_of(made), f"{made.system}_configurations.csv"),
        ).props("flat dense no-caps")
        ui.label("Click a row to move the picture there.").classes("app-note")
    table = ui.table(
        columns=_columns(made),
        rows=_rows(made, RAD),
        row_key="number",
        pagination=_PAGE if len(made.rows) > _PAGE else 0,
    )
    few = "" if len(made.rows) > _PAGE else "hide-bottom"
    table.props(f"dense flat bordered {few}").classes("app-table").mark("configurations")
    table.props(f':table-row-style-fn="{_ROW_STYLE}"')
    table.add_slot("body-cell-limits", _LIMITS)

    shown = [0]

    def fill() -> None:
        rows = _rows(made, str(unit.value))
        table.update_rows([row | {"shown": row["number"] == shown[0]} for row in rows])

    async def clicked(event: events.GenericEventArguments) -> None:
        shown[0] = int(event.args[1]["number"])
        fill()
        await app.set_configuration(made.rows[shown[0] - 1].q)

    table.on("rowClick", clicked)
    unit.on_value_change(fill)
    ui.label(_COLUMN_MEANINGS).classes("app-note")


def csv_of(made: ConfigurationList) -> bytes:
    """Return the configurations as the content of a CSV file with a header; positions in rad or m.

    Args:
        made: result of the inverse kinematics.
    """
    units = zip(made.names, made.units, strict=True)
    head = [
        "number",
        *(f"{name} [{unit}]" for name, unit in units),
        *("residual", "sigma", "roots", "within_limits", "label", "family"),
    ]
    rows = (
        [number, *r.q, r.residual, r.sigma, r.multiplicity, r.within_limits, r.label, r.family]
        for number, r in enumerate(made.rows, 1)
    )
    return csv_text(head, rows).encode()


_ROW_STYLE = "row => 'cursor: pointer' + (row.shown ? '; background: var(--d-accent-soft)' : '')"
_COLUMN_MEANINGS = (
    "Residual: of the pose [m or 1]. Sigma: smallest singular value of the Jacobian, 0 at a"
    " singular configuration. Roots: how many solutions meet there, any along a self-motion."
)
_LIMITS = """
<q-td :props="props" :class="props.row.inside ? '' : 'app-bad'">{{ props.value }}</q-td>
"""


def _headline(made: ConfigurationList) -> str:
    """Return the sentence above the table: number of configurations, method and locked joints."""
    count = len(made.rows)
    if not count:
        return f"{made.system}: no configuration takes frame {made.frame} there"
    outside = sum(not row.within_limits for row in made.rows)
    text = f"{made.system}, frame {made.frame}: {count} configuration{'s' if count > 1 else ''}"
    text += f" by {made.method}"
    if made.locked:
        text += "; locked: " + ", ".join(f"{name} = {x:.4g}" for name, x in made.locked)
    for name, taken in made.redundant:
        text += f"; {taken} positions of {name}"
    return text + (f"; {outside} outside of limits" if outside else "")


def _nothing(app: App, made: ConfigurationList) -> None:
    """Show the reason why there is no configuration, and a button for the nearest pose."""
    ui.label(made.reason[:1].upper() + made.reason[1:] + ".").mark("reason")
    near = made.nearest
    if near is None:
        return
    angle = round(near.angle * _DEGREES, 6)
    away = f"{round(near.distance, 9):.4g} m away and rotated by {angle:.4g} degrees"
    with in_a_row():
        show = ui.button(
            "Show the nearest configuration", on_click=lambda: app.set_configuration(near.q)
        )
        show.props("outline no-caps dense").style("padding: 2px 12px").mark("nearest")
        ui.label(f"Its frame is {away}.").classes("app-note")


def _columns(made: ConfigurationList) -> list[dict[str, Any]]:
    """Return the column definitions of the table of configurations."""
    heads = [("number", "", "right"), ("label", "which one", "left")]
    heads += [(f"q{k}", name, "right") for k, name in enumerate(made.names)]
    heads += [("residual", "residual", "right"), ("sigma", "sigma", "right")]
    heads += [("roots", "roots", "right"), ("limits", "limits", "left")]
    columns = [column(*head) | {"sortable": True} for head in heads]
    columns[1]["style"] = "min-width: 210px; white-space: normal"
    return columns


def _rows(made: ConfigurationList, unit: str) -> list[dict[str, Any]]:
    """Return the rows of the table, with angles in `unit` ("rad" or "deg")."""
    return [_row(made, number, row, unit) for number, row in enumerate(made.rows, 1)]


def _row(made: ConfigurationList, number: int, row: Configuration, unit: str) -> dict[str, Any]:
    """Return a row of the table, with angles in `unit` ("rad" or "deg")."""
    factors = [_DEGREES if unit == DEG and u == "rad" else 1.0 for u in made.units]
    digits = 2 if unit == DEG else 4
    values = {
        f"q{k}": f"{round(x * factor, digits) + 0.0:.{digits if factor != 1 else 4}f}"
        for k, (x, factor) in enumerate(zip(row.q, factors, strict=True))
    }
    return {
        "number": number,
        "label": f"{row.label} ({row.family})" if row.family else row.label,
        **values,
        "residual": f"{row.residual:.1e}",
        "sigma": f"{row.sigma:.2g}",
        "roots": "any" if row.family else row.multiplicity,
        "limits": "within" if row.within_limits else _outside(row),
        "inside": row.within_limits,
    }


def _outside(row: Configuration) -> str:
    """Return the text of the joints that are outside their limits."""
    return f"outside: {', '.join(row.outside)}" if row.outside else "outside"


# Fields in which the user types a pose: a position and three angles, or a matrix.


ANGLES, MATRIX = "place and angles", "matrix"
_NAMES = ("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]")
_FORMS = "12 or 16 numbers row by row, or x y z roll pitch yaw; pi/2 and the like are read"
_ROUNDED = 1e-12
"""Element of a pose [m or cosine] below which it is shown as zero: rounding, such as sin(pi)."""


class PoseFields:
    """Fields in which the user types a pose, in one of two forms.

    The forms are a position with three angles, and a matrix; only the selected form is visible.
    """

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
        """Pose (4, 4) as typed.

        Raises:
            MbsError: a field has no value.
        """
        if self._form.value == MATRIX:
            return pose_from_text(str(self._matrix.value or ""))
        texts = [str(field.value or "0") for field in self._fields]
        return pose_from(texts[:3], texts[3:])

    def show(self, T: Array) -> None:
        """Write a pose into the fields of both forms.

        Args:
            T: (4, 4) homogeneous matrix.
        """
        values = [*np.asarray(T, dtype=float)[:3, 3].tolist(), *rpy_of(T)]
        for field, value in zip(self._fields, values, strict=True):
            field.set_value(_text(value))
        self._matrix.set_value(
            "\n".join("  ".join(map(_text, row)) for row in np.asarray(T).tolist())
        )

    def _switch(self) -> None:
        """Show the fields of the selected form."""
        self._angles.set_visibility(self._form.value == ANGLES)
        self._matrix.set_visibility(self._form.value == MATRIX)


def _field(name: str) -> ui.input:
    """Create the field of a coordinate of the pose."""
    field = ui.input(name).props(FIELD)
    if "rad" in name:
        field.tooltip("R = Rz(yaw) Ry(pitch) Rx(roll)")
    return field.mark(name.split(" ")[0])


def _text(value: float) -> str:
    """Return a number as text that is read back to the same double; 0 for rounding errors."""
    return "0" if abs(value) < _ROUNDED else repr(float(value))


KEY = "configurations"

_PRESENT, _GIVEN = "present", "given"
_POSITIONS = {
    _PRESENT: "stays as in the picture",
    _GIVEN: "stays at a position",
    "16": "takes 16 positions",
    "64": "takes 64 positions",
}


async def open_configurations(app: App, key: str = "igm-general") -> None:
    """Open the panel of inverse kinematics with the present pose of the frame.

    Args:
        app: app of the page.
        key: key of the model whose method is selected initially.
    """
    try:
        panel = _ConfigurationsPanel(app, key)
        await panel.take_present()
    except MbsError as error:
        app.complain(error)


class _ConfigurationsPanel:
    """Panel with frame, method and pose at the left and the configurations at the right."""

    def __init__(self, app: App, key: str) -> None:
        self._app = app
        system = app.system()
        kept = cast(dict[str, Any], app.session.notes.setdefault(KEY, {}))
        names = _frames(system)
        frame, self._last = kept.get("frame"), terminal_frame(system)
        with app.open("Inverse geometry", key=KEY):
            left, self._shown = two_sides()
        with left, ui.element("div").classes("app-form"):
            self._frame = ui.select(
                names,
                label="frame",
                value=frame if frame in names else self._last,
                on_change=self._framed,
            )
            self._frame.props(FIELD).style("flex: 1 1 90px").mark("frame")
            first, method = option_fields(PoseOptions)["method"]
            self._method = ui.select(
                dict(method.choices), label="method", value=entry(key).solver or first.default
            )
            self._method.props(FIELD).style("flex: 2 1 190px").mark("method")
        with left, ui.element("div").classes("app-form") as self._surplus:
            self._joint = ui.select([], label="joint", on_change=self._surplus_changed)
            self._joint.props(FIELD).style("flex: 1 1 90px").mark("redundant")
            self._joint.tooltip("A joint beyond the six that a pose determines")
            self._many = ui.select(_POSITIONS, value=_PRESENT, on_change=self._surplus_changed)
            self._many.props(FIELD).style("flex: 2 1 190px").mark("positions")
            self._at = ui.input().props(FIELD).mark("position").style("flex: 1 1 100%")
        self._offer_joints()
        with left:
            self._pose = PoseFields()
            with in_a_row():
                self._button = main_button("Solve", self.solve)
                side_button(
                    "Present pose", self.take_present, "The pose of the frame in the picture"
                )
                side_button("Equations", partial(self._equations, key), "Of the method, as text")
        with self._shown:
            waiting_note("Every configuration that takes the frame to the pose appears here.")
        warn_of_changes(app, self._shown)
        app.on_robot(self._robot_changed)

    def _robot_changed(self) -> None:
        """Offer the frames of the new robot; a selected terminal frame stays the terminal frame."""
        if self._frame.is_deleted:
            return
        system = self._app.system()
        names, last = _frames(system), terminal_frame(system)
        kept = self._frame.value in names and self._frame.value != self._last
        self._last = last
        self._frame.set_options(names, value=self._frame.value if kept else last)
        self._offer_joints()

    def _offer_joints(self) -> None:
        """Offer the joints that may be redundant; none if there are at most six joints."""
        system, frame = self._app.system(), self._frame.value
        surplus = surplus_joints(system, frame) if frame else ()
        joints = list(moving_joints(system, frame)) if surplus else []
        kept = self._joint.value
        self._joint.set_options(joints, value=kept if kept in joints else next(iter(surplus), None))
        self._surplus_changed()

    def _surplus_changed(self) -> None:
        """Show the position field if the redundant joint is locked at a given position."""
        joint = self._joint.value
        self._surplus.set_visibility(bool(joint))
        self._at.set_visibility(self._many.value == _GIVEN)
        if joint:
            self._many.props(f'label="redundant joint {joint}"')
            self._at.props(f'label="{joint} [{self._coordinate(joint)[1]}]"')

    def _coordinate(self, joint: str) -> tuple[int, str]:
        """Return the index and the unit of the coordinate of a joint."""
        coordinates = self._app.system().coordinates
        number = [coordinate.name for coordinate in coordinates].index(joint)
        return number, coordinates[number].unit

    def _redundant(self) -> dict[str, Any]:
        """Return the arguments of `configurations` for the redundant joint.

        Raises:
            MbsError: its position has no value.
        """
        joint, many = self._joint.value, self._many.value
        if not joint:
            return {}
        if many not in (_PRESENT, _GIVEN):
            return {"redundant": {joint: int(many)}}
        at = float(self._app.q[self._coordinate(joint)[0]])
        if many == _GIVEN:
            at = number_of(str(self._at.value or "0"), joint)
        locked = locked_by_default(self._app.system(), self._frame.value, self._app.q)
        locked.pop(joint if joint in locked else next(iter(locked)))
        return {"locked": {**locked, joint: at}}

    async def take_present(self) -> None:
        """Write the pose that the frame has in the picture into the fields."""
        try:
            T = await self._app.aside(pose_of, self._app.system(), self._app.q, self._frame.value)
        except MbsError as error:
            self._app.complain(error)
            return
        self._pose.show(T)

    async def solve(self) -> None:
        """Find and show all configurations in which the frame has the pose."""
        try:
            T, redundant = self._pose.T, self._redundant()
        except MbsError as error:
            self._app.complain(error)
            return
        task = partial(
            configurations,
            frame=self._frame.value,
            method=self._method.value,
            seed=self._app.q,
            **redundant,
        )
        show = partial(show_configurations, self._app)
        task_button = TaskButton(self._app, self._button, self._shown, show)
        await task_button.run("Solving the inverse geometry", task, T)

    async def _framed(self) -> None:
        """Store the selected frame and show its present pose."""
        notes = cast(dict[str, Any], self._app.session.notes[KEY])
        notes["frame"] = self._frame.value
        self._offer_joints()
        await self.take_present()

    async def _equations(self, key: str) -> None:
        """Open the equations of the selected method, or else of the model `key`."""
        named = {"pieper": "igm-pieper", "paul": "igm-paul", "general": "igm-general"}
        await open_equations(self._app, named.get(str(self._method.value), key))


def _frames(system: System) -> dict[str | int, str]:
    """Return the labels of the frames that can be selected, by frame."""
    numbers = system.numbered or range(1, len(system.tree.links) + 1)
    frames = (*numbers, *system.named_frames, terminal_frame(system))
    return {frame: frame_label(system, frame) for frame in frames}
