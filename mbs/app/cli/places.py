"""Places where files are to be written, looked at before the work begins."""

from __future__ import annotations

from pathlib import Path

from mbs.errors import ExportError


def require_places(*paths: Path | None) -> None:
    """Refuse files that cannot be written, so that no long run is lost.

    Args:
        *paths: of files to write; None is no file.

    Raises:
        ExportError: the folder of a file is missing, or it is a folder itself.
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
