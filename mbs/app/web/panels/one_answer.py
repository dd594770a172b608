"""Panel with the options of a model at the left and a single result at the right."""

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
    TaskButton,
    in_a_row,
    main_button,
    side_button,
    two_sides,
    waiting_note,
    warn_of_changes,
)


@dataclass(frozen=True, slots=True)
class PanelTexts:
    """Texts of a panel.

    Attributes:
        button: text of the button that computes the result.
        waiting: note that is shown before there is a result.
        label: label of the task while it runs.
        equations: text of the button that opens the equations of the model.
        explanation: tooltip of that button.
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
    """Open a panel and compute its result with the options that were last chosen.

    Args:
        app: app of the page.
        key: key of the model.
        texts: texts of the panel.
        task: callable `task(system, *arguments)` that returns the result.
        arguments: callable that returns the arguments of the task for given options.
        show: callable that displays a result at the present position of the page.
        title: title of the panel. Default: the title of the model.
        width: width of the left side.
        language: language in which the equations open. Default: the language that was last chosen.
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

    warn_of_changes(app, shown)

    async def ask() -> None:
        task_button = TaskButton(app, button, shown, partial(show, app))
        await task_button.run(texts.label, task, *arguments(form.given))

    button.on_click(ask)
    await form.fill()
    await ask()
