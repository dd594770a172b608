"""Files of meshes that descriptions of robots name: where they are, and which may be read."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from mbs.components.shapes import is_mesh_file
from mbs.formats.notes import Notes
from mbs.text import quoted

_PACKAGE = re.compile(r"(?:package|model)://([^/\\]+)/+(.+)", re.DOTALL)
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")
_SEARCH = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "GAZEBO_MODEL_PATH")


@dataclass(slots=True)
class MeshFiles:
    """Finds the meshes of one description, and says once which were not found.

    A package is looked for in `packages`, then among the folders above the file and those in them,
    then where ROS has its packages. A path inside of a package stays there.

    Attributes:
        folder: that relative paths start at; None where no other file may be looked at.
        packages: folders of packages by name.
        missing: what was not found, and the line of the file that names it.
        folders: of the packages that were looked for.
    """

    folder: Path | None
    packages: Mapping[str, str | Path] = field(default_factory=dict)
    missing: dict[str, int | None] = field(default_factory=dict)
    folders: dict[str, list[Path]] = field(default_factory=dict)

    def find(self, name: str, line: int | None = None) -> Path | None:
        """The file that a name in the description stands for; None, remembered, if there is none.

        Args:
            name: package://package/path, file:///path, or a path.
            line: of the description.
        """
        found = None
        if self.folder is not None and is_mesh_file(name):
            try:
                found = next((p for p in self._candidates(name, self.folder) if p.is_file()), None)
            except (OSError, ValueError):  # names that no file can have
                found = None
        if found is None:
            self.missing.setdefault(name, line)
        return found

    def note(self, notes: Notes) -> None:
        """Take one note of all meshes that are missing."""
        if not self.missing:
            return
        first, line = next(iter(self.missing.items()))
        count = len(self.missing)
        what = f"{quoted(first)} and {count - 1} more are" if count > 1 else f"{quoted(first)} is"
        why = "it is not there, or no .stl, .obj or .dae file; put it where the description says"
        if self.folder is None:
            why = "files that were sent name no others"
        elif _PACKAGE.fullmatch(first):
            why = (
                "it is not there, or no .stl, .obj or .dae file; give its folder as packages={...}"
            )
        notes.add("ignored", "a mesh", f"{what} not drawn: {why}", line)

    def _candidates(self, name: str, folder: Path) -> list[Path]:
        package = _PACKAGE.fullmatch(name)
        if package is not None:
            inside = package[2]
            return [
                path
                for place in self._package(package[1], folder)
                if (path := _within(place, inside)) is not None
            ]
        if name.startswith("file://"):
            return [Path(unquote(name.removeprefix("file://").removeprefix("localhost")))]
        if _SCHEME.match(name) and not Path(name).is_absolute():
            return []
        return [folder / name.replace("\\", "/")]

    def _package(self, name: str, folder: Path) -> list[Path]:
        """Folders that may be the package of this name."""
        if name not in self.folders:
            found = [Path(self.packages[name])] if name in self.packages else []
            if not found and name not in (".", ".."):
                above = [folder, *folder.parents]
                found = [place for place in above if place.name == name]
                found += [place / name for place in above]
                for variable in _SEARCH:
                    for place in filter(None, os.environ.get(variable, "").split(os.pathsep)):
                        found += [Path(place) / name, Path(place) / "share" / name]
            self.folders[name] = [place for place in found if place.is_dir()]
        return self.folders[name]


def _within(folder: Path, name: str) -> Path | None:
    """A path in a folder; None where it leads out of it."""
    path = Path(os.path.normpath(folder / name))
    return path if path.is_relative_to(os.path.normpath(folder)) else None
