"""Check of output paths before a computation begins."""

from __future__ import annotations

from pathlib import Path

from mbs.errors import ExportError


def require_places(*paths: Path | None) -> None:
    """Raise if a file cannot be written, before a long computation starts.

    Args:
        *paths: paths of files to write; None for no file.

    Raises:
        ExportError: the folder of a file is missing, or the path is a folder.
    """
    for path in paths:
        if path is None:
            continue
        if not path.parent.is_dir():
            raise ExportError(
                f"folder {path.parent} does not exist; create it or choose another one"
            )
        if path.is_dir():
            raise ExportError(f"{path} is a folder; give the name of a file")
