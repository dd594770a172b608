"""Folder of the results of a parameter sweep, which an interrupted sweep resumes from."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mbs.errors import ExportError, ModelError
from mbs.files import path_of, write_text
from mbs.result import Result
from mbs.simulate.sweep_cases import Case

_INDEX = "study.json"


@dataclass(frozen=True, slots=True, weakref_slot=True)
class ResultStore:
    """Folder of the results of a sweep, with one file per case.

    Attributes:
        path: absolute path, because threads that load FMUs change the working directory.
    """

    path: Path

    @staticmethod
    def opened(path: object, study: Mapping[str, object]) -> ResultStore:
        """Make the folder of a sweep, or open it if it contains the same sweep.

        Args:
            path: path of the folder.
            study: JSON description of the sweep, as returned by `study_of`.

        Raises:
            ModelError: the folder contains another sweep, or results without description.
            ExportError: the folder cannot be written.
        """
        folder = ResultStore(_make_folder(path_of(path).absolute()))
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
        """Return the path of the result of a case."""
        return self.path / f"case_{number:06d}.npz"

    def partial_file(self, number: int) -> Path:
        """Return the path of the partial result of a case that failed."""
        return self.path / f"part_{number:06d}.npz"

    def write(self, number: int, result: Result | None, error: str = "") -> None:
        """Write the result of a case, or its error message and partial result.

        Args:
            number: index of the case.
            result: complete result, or the rows before the stop; None if there are no rows.
            error: error message; empty if the case succeeded.

        Raises:
            ExportError: the folder cannot be written.
        """
        file, part = self._error_file(number), self.partial_file(number)
        part.unlink(missing_ok=True)
        if error:
            write_text(error, file)
        else:
            file.unlink(missing_ok=True)
        if result is not None:
            result.save(part if error else self.file(number))

    def error_of(self, number: int) -> str:
        """Return the error message of a case without complete result."""
        file = self._error_file(number)
        return file.read_text(encoding="utf-8") if file.is_file() else "not simulated yet"

    def model_and_cases(self) -> tuple[str, tuple[Case, ...]]:
        """Return the name of the model and the cases of the sweep in this folder.

        Raises:
            ModelError: the folder contains no sweep.
        """
        try:
            study = json.loads((self.path / _INDEX).read_text(encoding="utf-8"))
            return str(study["model"]), tuple(dict(case) for case in study["cases"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ModelError(
                f"sweep: {self.path} holds no study; give the folder that a sweep was given"
            ) from error

    def _error_file(self, number: int) -> Path:
        return self.path / f"case_{number:06d}.txt"

    def missing(self, count: int) -> list[int]:
        """Return the indices of the cases that have no complete result yet, in order.

        Args:
            count: number of cases of the sweep.
        """
        return [number for number in range(count) if not zipfile.is_zipfile(self.file(number))]


def _make_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(
            f"folder {folder} cannot be made ({error.strerror}); choose another one"
        ) from error
    return folder
