"""A panel with the options of a model at the left and one answer at the right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

from mbs.app.tasks.equations import entry
from mbs.app.web.app import App
from mbs.app.web.panels.equations import open_equations
from mbs.app.web.panels.form import Given, OptionForm
from mbs.app.web.panels.layout import (
    Asking,
    in_a_row,
    main_button,
    side_button,
    tell_of_changes,
    two_sides,
    waiting_note,
)


@dataclass(frozen=True, slots=True)
class PanelTexts:
    """What a panel says.

    Attributes:
        button: that asks for the answer.
        waiting: before there is one.
        label: of the task while it runs.
        equations: title of the button that opens the model's equations.
        explanation: of that button.
    """

    button: str
    waiting: str
    label: str
    equations: str
    explanation: str


async def open_one_answer(
    app: App,
    key: str,
    texts: PanelTexts,
    task: Callable[..., Any],
    arguments: Callable[[dict[str, Any]], tuple[Any, ...]],
    *,
    show: Callable[[App, Any], None],
    title: str | None = None,
    width: str = "330px",
    language: str | None = None,
) -> None:
    """Open the panel and ask with the options of last time.

    Args:
        app: of the page.
        key: of the model.
        texts: of the panel.
        task: `task(system, *arguments)` gives the answer.
        arguments: of the task, by the options.
        show: puts an answer where the slot is.
        title: of the panel; that of the model when left out.
        width: of the left side.
        language: in which the equations open; the one of last time when left out.
    """
    one = entry(key)
    given = cast(Given, app.session.notes.setdefault(f"options {key}", {}))
    if app.checked_system() is None:
        return
    with app.open(title or one.title, key=key):
        left, shown = two_sides(width)
    with left:
        form = OptionForm(app, one, given)
        with in_a_row():
            button = main_button(texts.button)
            act = partial(open_equations, app, key, language)
            side_button(texts.equations, act, texts.explanation)
    with shown:
        waiting_note(texts.waiting)

    tell_of_changes(app, shown)

    async def ask() -> None:
        asking = Asking(app, button, shown, partial(show, app))
        await asking.run(texts.label, task, *arguments(form.given))

    button.on_click(ask)
    await form.fill()
    await ask()
