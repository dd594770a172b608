"""Panel that writes the equations of a model as text, with their operation counts."""

from __future__ import annotations

from typing import cast

from nicegui import ui

from mbs.app.tasks.equations import EVERY_PASS, WORDS, WrittenEquations, entry, equations, languages
from mbs.app.web.app import App
from mbs.app.web.panels.form import FIELD, Given, OptionForm
from mbs.app.web.panels.layout import (
    in_a_row,
    main_button,
    new_answer,
    two_sides,
    warn_of_changes,
)
from mbs.app.web.panels.optimizer import passes_of
from mbs.app.web.panels.text_view import BEFORE, count_table, steps_table, text_view
from mbs.models.catalogue import Entry

TITLES = {
    WORDS: "in words",
    "c": "C",
    "fortran": "Fortran",
    "matlab": "MATLAB",
    "octave": "Octave",
    "maple": "Maple",
    "mathematica": "Mathematica",
    "python": "Python",
    "julia": "Julia",
    "rust": "Rust",
    "latex": "LaTeX",
    "symoro": "classic text",
}
"""Labels of the languages in a form."""

_SPOKEN = "language"
_OFF = "without the optimizer"


async def open_equations(app: App, key: str, language: str | None = None) -> None:
    """Open the panel of a model and write its equations with the options that were last chosen.

    Args:
        app: app of the page.
        key: key of the model.
        language: initial language. Default: the language that was last chosen.
    """
    one = entry(key)
    system = app.checked_system()
    if system is None:
        return
    refusal = one.refusal(system)
    if refusal:
        app.complain(refusal)
        return
    panel = _EquationsPanel(app, one)
    await panel.fill(language)
    await panel.write()


class _EquationsPanel:
    """Panel of the equations of a model, with the form at the left and the text at the right."""

    def __init__(self, app: App, one: Entry) -> None:
        self._app, self._entry = app, one
        self._busy = self._again = self._ready = False
        given = cast(Given, app.session.notes.setdefault(f"options {one.key}", {}))
        with app.open(one.title, key=f"equations {one.key}"):
            left, self._shown = two_sides()
        with left:
            self._head()
            self._form = OptionForm(app, one, given)
            self._language = ui.select([], label="language", on_change=self._language_changed)
            self._language.props(FIELD).style("width: 100%").mark("language")
            with in_a_row():
                self._button = main_button("Write", self.write)
                self._optimizer = ui.checkbox("optimizer", value=bool(passes_of(app.session)))
                self._optimizer.props("dense").mark("optimizer")
                self._optimizer.tooltip("With the passes that the menu Optimizer has chosen")
            warn_of_changes(app, self._shown)
            self._counts = ui.element("div").style(
                "display: flex; flex-direction: column; gap: 8px"
            )

    def _head(self) -> None:
        """Show title and symbol of the model."""
        with in_a_row():
            ui.label(self._entry.title).style("font-weight: 600; font-size: 15px")
            ui.label(self._entry.symbol).classes("app-note").style("font-family: var(--d-mono)")

    async def fill(self, language: str | None) -> None:
        """Show the options and languages of the present robot.

        Args:
            language: language to select; None for plain words if the model has them, else the last
                language.
        """
        await self._form.fill()
        offered = languages(self._entry, self._app.system())
        wanted = language or self._app.session.notes.get(_SPOKEN)
        if language is None and WORDS in offered:
            wanted = WORDS
        value = wanted if wanted in offered else offered[0]
        self._language.set_options({name: TITLES[name] for name in offered}, value=value)

    async def _language_changed(self) -> None:
        """Store the selected language and write the equations in it."""
        if self._language.value not in (None, WORDS):
            self._app.session.notes[_SPOKEN] = self._language.value
        if self._ready:
            await self.write()

    async def write(self) -> None:
        """Write the equations for the present form.

        A call during a computation makes the computation start again when it ends.
        """
        self._again = self._ready = True
        if self._busy:
            return
        self._busy = True
        self._button.disable()
        try:
            while self._again and not self._shown.is_deleted:
                self._again = False
                await self._write()
        finally:
            self._busy = False
            if not self._button.is_deleted:
                self._button.enable()

    async def _write(self) -> None:
        """Compute and show the equations once."""
        one, app = self._entry, self._app
        passes = (passes_of(app.session) or EVERY_PASS) if self._optimizer.value else ()
        args = (one.key, self._form.given, self._language.value, passes)
        document = app.document
        made = await app.run(f"Writing {one.title}", equations, *args)
        if made is None or self._shown.is_deleted:
            return
        self._counts.clear()
        with self._counts:
            _show_counts(made)
        with new_answer(app, self._shown, document):
            text_view(app, made.text, made.file_name)
            ui.label(_about(made)).classes("app-note")


def _show_counts(made: WrittenEquations) -> None:
    """Show the operation counts of a model and the passes of the optimizer."""
    if made.before is None or made.after is None:
        return
    counts = {"before": made.before, "after": made.after}
    count_table(counts if made.steps else {_OFF: made.after})
    if made.steps:
        ui.label(BEFORE).classes("app-note")
        with ui.expansion("Passes of the optimizer").props("dense").style("width: 100%"):
            steps_table(made.steps)


def _about(made: WrittenEquations) -> str:
    """Return a line with inputs, outputs, options and computing time of a model."""
    chosen = ", ".join(f"{name} {_option_text(value)}" for name, value in made.choices)
    ends = f"{', '.join(made.inputs)} -> {', '.join(made.outputs)}" if made.inputs else ""
    facts = "; ".join(part for part in (ends, chosen, f"{made.seconds:.2g} s") if part)
    return f"{made.system}: {facts}"


def _option_text(value: object) -> str:
    """Return the value of an option as text."""
    return "(" + " ".join(map(str, value)) + ")" if isinstance(value, tuple) else str(value)
