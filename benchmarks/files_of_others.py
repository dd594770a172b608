"""Comparing folders of robot files of others: what became of each file, and the table of them."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

SAME = 1e-9
"""Of the largest value: both compute in double precision along at most some ten links."""


@dataclass
class Outcome:
    """What became of a file.

    Attributes:
        kind: "equal", "different", "refused", "nothing moves" or "not read by" the other program.
        text: what differs, or why it was refused.
        notes: of the reader.
        seconds: of the processor, to read and assemble it, and for its inverse dynamics.
    """

    kind: str
    text: str = ""
    notes: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0


def relative_gap(one: Any, other: Any) -> float:
    """The largest difference, as a part of the largest value."""
    largest = float(np.max(np.abs(other), initial=0.0))
    return float(np.max(np.abs(one - other), initial=0.0)) / (largest or 1.0)


def folder_parser(summary: str | None, ending: str) -> argparse.ArgumentParser:
    """The options that every comparison has.

    Args:
        summary: docstring of the comparison, whose first line is shown.
        ending: of its files.
    """
    parser = argparse.ArgumentParser(description=(summary or "").splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path, help=f"with {ending} files in them")
    parser.add_argument("--wheels", nargs="*", default=[], help="packages to be downloaded")
    parser.add_argument("--each", action="store_true", help="print a line for every file")
    return parser


def compare_folders(
    options: argparse.Namespace,
    files: Callable[[Path], Iterable[Path]],
    compared: Callable[[Path], Outcome],
    program: str,
) -> None:
    """Compare the files and print a table.

    Args:
        options: of `folder_parser`.
        files: of a folder.
        compared: the outcome of a file.
        program: the other one, as in "not read by ...".
    """
    with tempfile.TemporaryDirectory() as scratch:
        total: list[Outcome] = []
        for folder in [*options.folders, *_unpack(options.wheels, Path(scratch))]:
            outcomes = []
            for path in sorted(files(folder)):
                outcome = compared(path)
                outcomes.append(outcome)
                if options.each or outcome.kind in ("refused", "different"):
                    spent = f"{outcome.seconds:.2f} s"
                    print(f"  {outcome.kind}: {path.relative_to(folder)} ({spent}) {outcome.text}")
            print(_line(folder.name, outcomes, program), flush=True)
            total += outcomes
        print(_line("all", total, program))


def _unpack(wheels: list[str], folder: Path) -> Iterator[Path]:
    """The folders of packages, downloaded."""
    for wheel in wheels:
        into = folder / wheel
        subprocess.run(
            [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", str(into), wheel],
            check=True,
        )
        for archive in into.glob("*.whl"):
            zipfile.ZipFile(archive).extractall(into)
        yield into


def _line(name: str, outcomes: list[Outcome], program: str) -> str:
    kinds = Counter(outcome.kind for outcome in outcomes)
    theirs = len(outcomes) - kinds[f"not read by {program}"]
    notes: Counter[str] = sum((outcome.notes for outcome in outcomes), Counter())
    spent = max((outcome.seconds for outcome in outcomes), default=0.0)
    still = f", in {kinds['nothing moves']} nothing moves" if kinds["nothing moves"] else ""
    return (
        f"{name}: {len(outcomes)} files, {theirs} read by {program}, {theirs - kinds['refused']}"
        f" of these here, {kinds['equal']} equal{still}; notes"
        f" {', '.join(f'{n} {kind}' for kind, n in sorted(notes.items())) or 'none'}; at most"
        f" {spent:.2f} s"
    )
