"""`mbs model`: source text of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mbs.app.cli import completion
from mbs.app.cli.arguments import Gravity, Json, Mount, Output, Parameters, Robot, examples
from mbs.app.cli.loading import system
from mbs.app.cli.printing import note, print_json

if TYPE_CHECKING:
    from mbs.app.tasks.equations import WrittenEquations
    from mbs.assembly import System
    from mbs.operations import Count

EXAMPLES = examples(
    "mbs model puma560 idm --language c",
    "mbs model rx90 jacobian --option frame=6 --option expressed_in=3 --language fortran",
    "mbs model sr400 base-parameters --language words",
    "mbs model two_branch_tree idm --no-optimise --output idm.c",
)

_ALWAYS = ("multiplication", "addition")
Key = Annotated[
    str,
    typer.Argument(
        metavar="KEY",
        help="Model, as `mbs models` lists them.",
        autocompletion=completion.keys,
        show_default=False,
    ),
]
Options = Annotated[
    list[str] | None,
    typer.Option(
        "--option",
        metavar="NAME=VALUE",
        help="Option of the model, as `mbs models ROBOT` lists them; may be repeated.",
        autocompletion=completion.options,
        show_default=False,
    ),
]
Optimise = Annotated[
    bool,
    typer.Option(
        "--optimise/--no-optimise", help="Whether the optimizer takes operations out of it."
    ),
]


def model(
    robot: Robot,
    key: Key,
    *,
    language: Annotated[
        str | None,
        typer.Option(
            "--language",
            "-l",
            metavar="LANGUAGE",
            help="c, fortran, matlab, octave, maple, mathematica, python, julia, rust, latex,"
            " symoro, or words where the model has some; c when left out, words where there is no"
            " function.",
            autocompletion=completion.languages,
            show_default=False,
        ),
    ] = None,
    option: Options = None,
    optimise: Optimise = True,
    parameter: Parameters = None,
    gravity: Gravity = "",
    mount: Mount = None,
    output: Output = None,
    json: Json = False,
) -> None:
    """Write a model as source text; its operation counts are printed on the standard error."""
    written = equations_of(
        system(robot, parameter, gravity, mount), key, option, language, optimise
    )
    if output is not None:
        from mbs.files import write_text

        write_text(written.text, output)
        note(f"wrote {output}")
    if json:
        print_json(_data(written))
        return
    if output is None:
        typer.echo(written.text, nl=not written.text.endswith("\n"))
    note(_count_text(written))


def equations_of(
    assembled: System,
    key: str,
    options: Sequence[str] | None = None,
    language: str | None = None,
    optimise: bool = True,
) -> WrittenEquations:
    """Return the equations of a model for the options of a command line.

    Args:
        assembled: the robot.
        key: key of the model.
        options: NAME=VALUE for some of the options of the model.
        language: language of the text; None for the default of the model.
        optimise: whether to apply the optimizer.

    Raises:
        MbsError: the model, an option or the language is unknown, or the robot lacks the model.
    """
    from mbs.app.tasks import equations as task
    from mbs.app.tasks.laws import assignments

    texts = assignments(options or (), "--option")
    values = task.parsed_options(assembled, task.entry(key), texts)
    passes = task.EVERY_PASS if optimise else ()
    return task.equations(assembled, key, values, language, passes)


def _count_text(written: WrittenEquations) -> str:
    """Return the operation counts of a model, before and after the optimizer, as a sentence."""
    if written.before is None or written.after is None:
        return f"{written.system} {written.key}: {written.title}"
    text = f"{written.system} {written.key}: {_operations_text(written.after)}"
    if written.steps:
        text += f"; before the optimizer {_operations_text(written.before)}"
    return text


def _operations_text(count: Count) -> str:
    """Return the counts as "3 multiplications, 2 additions, ...".

    Kinds that do not occur are omitted.
    """
    amounts = {
        "multiplication": count.mul,
        "addition": count.add,
        "division": count.div,
        "root": count.sqrt,
        "function of angles": count.trig,
        "other": count.other,
    }
    shown = [_plural(n, name) for name, n in amounts.items() if n or name in _ALWAYS]
    once = count.parameter_only
    if once is not None and once.total:
        shown.append(f"{_plural(once.total, 'operation')} on parameters alone")
    return ", ".join(shown)


def _plural(amount: int, name: str) -> str:
    """Return an amount with its noun in the plural, except for 1."""
    if amount == 1:
        return f"1 {name}"
    return f"{amount} {name.replace('function', 'functions') if ' ' in name else f'{name}s'}"


def _data(written: WrittenEquations) -> dict[str, Any]:
    """Return a written model as data for JSON."""
    return {
        "robot": written.system,
        "key": written.key,
        "title": written.title,
        "language": written.language,
        "options": dict(written.choices),
        "inputs": written.inputs,
        "outputs": written.outputs,
        "before": count_data(written.before),
        "after": count_data(written.after),
        "text": written.text,
    }


def count_data(count: Count | None) -> dict[str, Any] | None:
    """Return the counts by kind of operation and their "total", as a dict; None without counts.

    "parameter_only" contains the counts of operations on parameters alone in the same form.

    Args:
        count: operation counts of a model, or None.
    """
    if count is None:
        return None
    numbers: dict[str, Any] = {**asdict(count), "total": count.total}
    if count.parameter_only is None:
        del numbers["parameter_only"]
    else:
        numbers["parameter_only"] = count_data(count.parameter_only)
    return numbers
