"""The command line in this process."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mbs.app.cli.application import application


@dataclass(frozen=True)
class Answer:
    """What a command left: exit code, both streams, and both as a terminal mixes them."""

    code: int
    out: str
    err: str
    mixed: str


Command = Callable[..., Answer]


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Runs `mbs` with some words, in an empty folder; anything but an exit is raised."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> Answer:
        got = CliRunner().invoke(application, list(words), prog_name="mbs")
        if got.exception is not None and not isinstance(got.exception, SystemExit):
            raise got.exception
        return Answer(got.exit_code, got.stdout, got.stderr, got.output)

    return run
