"""The page on the command line: every command of it gives what the page shows."""

import re
import shlex
from pathlib import Path

import pytest

from mbs.app.cli.application import application

PAGE = Path(__file__).parents[3] / "docs" / "command_line.md"
_BLOCK = re.compile(r"```console\n(.*?)```", re.DOTALL)


def shown() -> list[tuple[str, str]]:
    """Commands of the page and what stands under them."""
    text = "".join(_BLOCK.findall(PAGE.read_text(encoding="utf-8")))
    parts = [part.partition("\n") for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]]
    return [(command, output) for command, _, output in parts]


def narrowed(line: str) -> str:
    """The line with at most two blanks in a row: versions of rich pad columns differently."""
    return re.sub("─{2,}", "──", re.sub(" {2,}", "  ", line.strip()))


def pattern(output: str) -> str:
    """What the output must match: "..." is any text, on a line of its own any lines."""
    lines = [narrowed(line) for line in output.strip().splitlines()]
    parts = (
        r"(?:[^\n]*\n)*?" if line == "..." else re.escape(line).replace(r"\.\.\.", ".*") + r"\n"
        for line in lines
    )
    return "".join(parts)


def tidy(output: str) -> str:
    lines = output.strip().splitlines()
    return "".join(f"{narrowed(line)}\n" for line in lines)


def test_every_command_gives_what_the_page_shows(command) -> None:
    commands = shown()
    assert len(commands) > 15
    for words, output in commands:
        first, *rest = shlex.split(words)
        assert first == "mbs"
        answer = command(*rest)
        assert answer.code == (1 if output.startswith("mbs: ") else 0), answer.mixed
        assert re.fullmatch(pattern(output), tidy(answer.mixed)), f"{words}\n{answer.mixed}"


def test_the_page_names_every_command() -> None:
    text = PAGE.read_text(encoding="utf-8")
    names = [info.name for info in application.registered_commands]
    names += [group.name for group in application.registered_groups]
    assert len(names) == 12
    assert [name for name in names if f"| `mbs {name}" not in text] == []


@pytest.mark.parametrize(
    ("output", "got", "same"),
    [
        ("a\n...\nd\n", "a\nb\nc\nd\n", True),
        ("a\n...\nd\n", "a\nb\nc\n", False),
        ("x is ... m\n", "x is 3 m\n", True),
        ("x is 4 m\n", "x is 3 m\n", False),
    ],
)
def test_dots_stand_for_what_is_left_out(output: str, got: str, same: bool) -> None:
    assert bool(re.fullmatch(pattern(output), tidy(got))) is same
