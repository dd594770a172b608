"""Search for the mesh files that robot descriptions refer to."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from mbs.components.shapes import is_mesh_file
from mbs.formats.files import Notes
from mbs.text import quoted

_PACKAGE = re.compile(r"(?:package|model)://([^/\\]+)/+(.+)", re.DOTALL)
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")
_SEARCH = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "GAZEBO_MODEL_PATH")


@dataclass(slots=True)
class MeshFiles:
    """Search for the mesh files of a robot description; a note reports missing files.

    A package is searched in `packages`, then among the parent folders of the file and their
    subfolders, then in the package paths of ROS. Paths cannot leave the folder of their package.

    Attributes:
        folder: folder of relative paths; None if no other files may be read.
        packages: folder of each package, by package name.
        missing: names of files that were not found, with the line of the description.
        folders: cache of candidate folders by package name.
    """

    folder: Path | None
    packages: Mapping[str, str | Path] = field(default_factory=dict)
    missing: dict[str, int | None] = field(default_factory=dict)
    folders: dict[str, list[Path]] = field(default_factory=dict)

    def find(self, name: str, line: int | None = None) -> Path | None:
        """Return the path of a mesh file, or None if there is no such file.

        A missing name is recorded for `note`.

        Args:
            name: package://package/path, file:///path, or a path.
            line: line number of the name in the description.
        """
        found = None
        if self.folder is not None and is_mesh_file(name):
            try:
                found = next((p for p in self._candidates(name, self.folder) if p.is_file()), None)
            except (OSError, ValueError):  # names that are invalid as file names
                found = None
        if found is None:
            self.missing.setdefault(name, line)
        return found

    def note(self, notes: Notes) -> None:
        """Add one import note that lists the missing meshes; do nothing if all were found.

        Args:
            notes: notes of the robot file.
        """
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
        """Return the paths at which a mesh may be, in the order of the search.

        Args:
            name: name of the mesh in the description, as for `find`.
            folder: folder of relative paths.
        """
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
        """Return the existing folders that may contain the package `name`, in search order.

        `folder` is the folder of the description, whose parent folders are searched.
        """
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
    """Return the path of the file `name` in a folder; None if the path leaves the folder."""
    path = Path(os.path.normpath(folder / name))
    return path if path.is_relative_to(os.path.normpath(folder)) else None
