"""The cases of a parameter study, and the folder that keeps their results."""

from __future__ import annotations

import itertools
import json
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mbs.errors import ExportError, ModelError
from mbs.files import path_of, write_text
from mbs.messages import quoted
from mbs.numbers import doubles
from mbs.result import Result

_INDEX = "study.json"

Case = dict[str, float]
Grid = Mapping[str, Iterable[float]] | Sequence[Mapping[str, float]]


def cases_of(grid: Grid) -> tuple[Case, ...]:
    """Every combination of the values of a grid, the last name fastest; or the cases as listed.

    Args:
        grid: name to its values, or one dict of names to values for each case.

    Raises:
        ModelError: there is no case, or a value is no number.
    """
    listed = list(_combinations(grid)) if isinstance(grid, Mapping) else [dict(c) for c in grid]
    if not grid or not listed:
        raise ModelError("sweep: the grid has no case; give at least one value for every name")
    return tuple({str(name): _number(name, x) for name, x in case.items()} for case in listed)


def _combinations(grid: Mapping[str, Iterable[float]]) -> Iterable[Case]:
    columns = [
        list(values) if isinstance(values, Iterable) else [values] for values in grid.values()
    ]
    for values in itertools.product(*columns):
        yield dict(zip(grid, values, strict=True))


def _number(name: str, value: object) -> float:
    array = doubles(value)
    if isinstance(array, str):
        raise ModelError(f"sweep: {name} {array}")
    if array.size != 1:
        raise ModelError(f"sweep: {name} is {quoted(value)}; give one number for each case")
    return float(array.item())


@dataclass(frozen=True, slots=True, weakref_slot=True)
class Folder:
    """Where the results of a study are kept, a file for each case.

    Attributes:
        path: the folder.
    """

    path: Path

    @staticmethod
    def opened(path: object, study: Mapping[str, object]) -> Folder:
        """The folder of a study: made, or found with the same study in it.

        Args:
            path: where.
            study: what is studied, as JSON knows it.

        Raises:
            ModelError: it holds another study, or results of an unknown one.
            ExportError: it cannot be written.
        """
        folder = Folder(_made(path_of(path)))
        index = folder.path / _INDEX
        text = json.dumps(study, indent=1, sort_keys=True) + "\n"
        known = index.read_bytes() if index.exists() else None
        if known == text.encode():
            return folder
        if known is not None or any(folder.path.glob("case_*.npz")):
            raise ModelError(
                f"sweep: folder {folder.path} holds another study; choose another folder, or delete"
                " it"
            )
        write_text(text, index)
        return folder

    def file(self, number: int) -> Path:
        """The file of a case."""
        return self.path / f"case_{number:06d}.npz"

    def part(self, number: int) -> Path:
        """The file of what a case that failed had reached."""
        return self.path / f"part_{number:06d}.npz"

    def keep(self, number: int, result: Result | None, complaint: str = "") -> None:
        """Write the result of a case; or why it failed, with what it had reached.

        Args:
            number: of the case.
            result: whole, or up to where it stopped; None where nothing was reached.
            complaint: why it failed; empty where it did not.

        Raises:
            ExportError: the folder cannot be written.
        """
        said, part = self._complaint(number), self.part(number)
        part.unlink(missing_ok=True)
        if complaint:
            write_text(complaint, said)
        else:
            said.unlink(missing_ok=True)
        if result is not None:
            result.save(part if complaint else self.file(number))

    def complained(self, number: int) -> str:
        """Why a case has no result."""
        said = self._complaint(number)
        return said.read_text(encoding="utf-8") if said.is_file() else "not simulated yet"

    def known(self) -> tuple[str, tuple[Case, ...]]:
        """The name of the model that is studied here, and the cases.

        Raises:
            ModelError: there is no study.
        """
        try:
            study = json.loads((self.path / _INDEX).read_text(encoding="utf-8"))
            return str(study["model"]), tuple(dict(case) for case in study["cases"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ModelError(
                f"sweep: {self.path} holds no study; give the folder that a sweep was given"
            ) from error

    def _complaint(self, number: int) -> Path:
        return self.path / f"case_{number:06d}.txt"

    def missing(self, count: int) -> list[int]:
        """The numbers of the cases, of so many, that have no whole result yet."""
        return [number for number in range(count) if not zipfile.is_zipfile(self.file(number))]


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(
            f"folder {folder} cannot be made ({error.strerror}); choose another one"
        ) from error
    return folder
