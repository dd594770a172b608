"""Help pages and errors keep every character: nothing is taken for markup of the terminal."""

import inspect
import re

import pytest
from typer.main import get_command

from mbs.app.cli.application import application
from mbs.text import install_command

_BRACKETS = re.compile(r"\S*\[[^\[\]]*\]\S*")


def pages() -> list[tuple[tuple[str, ...], object]]:
    """Words and command of every help page."""
    root = get_command(application)
    found = [((), root)]
    for name, command in root.commands.items():
        found.append(((name,), command))
        found += [((name, one), part) for one, part in getattr(command, "commands", {}).items()]
    return found


def told(answer) -> str:
    """The text of a page without the frames that a terminal draws, and without blanks."""
    return re.sub(r"[\s│╭╮╰╯─]", "", answer.mixed)


def test_there_is_a_page_for_every_command() -> None:
    names = {words for words, _ in pages()}
    assert {(), ("app",), ("export",), ("export", "fmu"), ("simulate",)} <= names
    assert len(names) > 15


@pytest.mark.parametrize(
    ("words", "page"), pages(), ids=lambda x: " ".join(x) if isinstance(x, tuple) else ""
)
def test_help_shows_every_bracket_of_its_texts(command, words, page) -> None:
    answer = command(*words, "--help")
    assert answer.code == 0
    shown = told(answer)
    callback = getattr(page, "callback", None)
    texts = [inspect.getdoc(inspect.unwrap(callback)) or ""] if callback else []
    texts += [getattr(option, "help", None) or "" for option in page.params]
    for text in texts:
        plain = text.replace(r"\[", "[")
        for part in _BRACKETS.findall(plain):
            assert part in shown, f"{part} is swallowed"
    assert "\\[" not in shown


def test_the_help_of_the_page_says_how_to_install_it(command) -> None:
    assert re.sub(r"\s", "", install_command("app")) in told(command("app", "--help"))


@pytest.mark.parametrize("word", ["x[red]y", "[bold]", "[/bold]", "[red]b[/]", "[not a tag]"])
@pytest.mark.parametrize(
    "line",
    [
        "{}",
        "show {}",
        "show rx90 {}",
        "show rx90 --{}",
        "show rx90 -p {}=1",
        "model puma560 {}",
        "model puma560 idm -l {}",
        "model puma560 idm --option {}",
        "simulate four_bar --q0 {}",
        "simulate four_bar --tau j1={}",
        "simulate four_bar -o {}/m.csv",
        "sweep four_bar --over {}=1:2",
        "solve-ik rx90 --method {} --xyz 0 0 1",
        "identify rx90 {}",
        "convert sr400 {}",
        "export {}",
        "export fmu four_bar {}/x.fmu",
    ],
)
def test_errors_show_the_words_of_the_user(command, line: str, word: str) -> None:
    words = [part.format(word) for part in line.split()]
    answer = command(*words)
    assert answer.code in (1, 2)
    assert re.sub(r"\s", "", word) in told(answer)
