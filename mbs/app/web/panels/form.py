"""Form of the options of a model: frames, choices, flags and lists."""

from __future__ import annotations

from collections.abc import Callable, MutableMapping
from typing import Any

from nicegui import background_tasks, ui
from nicegui.events import ValueChangeEventArguments

from mbs.app.tasks.equations import OptionRow, option_values
from mbs.app.web.app import App
from mbs.assembly import System
from mbs.models.catalogue import Entry

FIELD = "dense outlined options-dense hide-bottom-space"

Given = MutableMapping[str, Any]


class OptionForm:
    """Form of the options of a model for the robot in the app.

    Options that the user did not change depend on the other options. For example, the rows of a
    Jacobian depend on the frame.
    """

    def __init__(
        self, app: App, entry: Entry, given: Given, on_change: Callable[[], Any] | None = None
    ) -> None:
        """Create an empty form at the present position; `fill` adds the options.

        Args:
            app: app of the page.
            entry: the model.
            given: chosen values by option; it is updated when the user chooses others.
            on_change: callable that is called after every change.
        """
        self._app, self._entry, self._given = app, entry, given
        self._on_change = on_change or (lambda: None)
        self._box = ui.element("div").classes("app-form")
        self._box.set_visibility(bool(entry.options))
        app.on_robot(self._robot_changed)

    @property
    def given(self) -> dict[str, Any]:
        """Chosen values, by the names of options."""
        return dict(self._given)

    async def fill(self) -> None:
        """Show the options of the present robot.

        Chosen values that it does not offer are dropped.
        """
        try:
            system = self._app.system()
            rows = await self._app.aside(_rows, system, self._entry, self._given)
        except Exception as error:
            self._app.complain(error)
            return
        if self._box.is_deleted:
            return
        self._box.clear()
        with self._box:
            for row in rows:
                self._field(system, row)
        self._box.set_visibility(bool(rows))

    def _robot_changed(self) -> None:
        """Show the options again after an assembly."""
        if not self._box.is_deleted:
            background_tasks.create(self.fill(), name=f"options of {self._entry.key}")

    def _field(self, system: System, row: OptionRow) -> None:
        """Create the field of an option."""

        async def changed(event: ValueChangeEventArguments[Any]) -> None:
            await self._take(row, event.value)

        if row.kind == "flag":
            ui.checkbox(row.title, value=row.chosen, on_change=changed).props("dense").mark(
                f"option.{row.name}"
            )
            return
        is_list = row.kind == "several"
        labels = {value: frame_label(system, value) for value in row.values}
        options = labels if row.kind == "frame" else list(row.values)
        value = list(row.chosen) if is_list else row.chosen
        field = ui.select(
            options, label=row.title, value=value, multiple=is_list, on_change=changed
        )
        width = 300 if is_list else 130
        field.props(FIELD).style(f"flex: 1 1 {width}px").mark(f"option.{row.name}")

    async def _take(self, row: OptionRow, value: Any) -> None:
        """Store the value of an option; lists that may depend on it are reset to their defaults."""
        self._given[row.name] = tuple(value) if row.kind == "several" else value
        names = [option.name for option in self._entry.options]
        later = self._entry.options[names.index(row.name) + 1 :]
        following = [option.name for option in later if option.kind == "several"]
        for name in following:
            self._given.pop(name, None)
        if following:
            await self.fill()
        self._on_change()


def frame_label(system: System, frame: object) -> str:
    """Return the label of a frame in a form, such as "0 (base)", "3 (q3)" or "tool".

    Args:
        system: the mechanism.
        frame: number of a link, or name of a frame.
    """
    if frame == 0:
        return "0 (base)"
    if isinstance(frame, int) and frame in system.numbered:
        return f"{frame} ({system.numbered[frame]})"
    if isinstance(frame, int) and frame <= len(system.links):
        name = system.links[frame - 1].name
        return str(frame) if name == f"q{frame}" else f"{frame} ({name})"
    return str(frame)


def _rows(system: System, entry: Entry, given: Given) -> tuple[OptionRow, ...]:
    """Return the options of a model.

    Chosen values that are not offered are removed from `given`.
    """
    for option in entry.options:
        if option.name in given:
            offered = option.values(system, given)
            value = given[option.name]
            own = value if option.kind == "several" else (value,)
            if any(one not in offered for one in own) or not own:
                del given[option.name]
    return option_values(system, entry, given)
