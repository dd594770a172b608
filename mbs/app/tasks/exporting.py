"""Files of a system for other programs, as bytes that a page sends or a command writes."""

from __future__ import annotations

import io
import re
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from casadi import Function

from mbs import export
from mbs.app.tasks.equations import entry
from mbs.app.tasks.options import keywords
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.export.c_options import CLibraryOptions
from mbs.export.fmu.options import FmuOptions
from mbs.export.robot_tables import robot_table
from mbs.formats import RobotTable, write_toml

MODELS = ("idm", "ddm")
"""Default keys of the models in a C library."""

_EPOCH = (1980, 1, 1, 0, 0, 0)  # fixed file time in zip archives: equal models give equal files
_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9_-]+")


def c_library(
    system: System,
    keys: Sequence[str] = MODELS,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    library: Mapping[str, Any] | None = None,
) -> bytes:
    """Return a zip file of C source of models, a header, CMakeLists.txt and an example.

    Args:
        system: open or closed system.
        keys: keys of the models, as in the menus.
        options: key to the options of that model. Default: the default options.
        library: options of `mbs.export.c_library` by name, see `mbs.app.tasks.options.keywords`.

    Raises:
        ModelError: a key is unknown, the system does not have the model, or `keys` is empty.
        ExportError: options of the library are invalid, see `mbs.export.c_library`.
    """
    name = file_stem(system)
    with tempfile.TemporaryDirectory(prefix="mbs-c-") as place:
        folder = write_c_library(system, Path(place) / name, keys, options, library)
        files = {f"{name}/{path.name}": path.read_bytes() for path in sorted(folder.iterdir())}
    return _zip(files)


def write_c_library(
    system: System,
    folder: Path,
    keys: Sequence[str] = MODELS,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    library: Mapping[str, Any] | None = None,
) -> Path:
    """Write the files of a C library to a folder and return the path of the folder.

    Args:
        system: open or closed system.
        folder: folder to write.
        keys: keys of the models.
        options: options of the models, by key.
        library: options of the library, as for `c_library`.

    Raises:
        ModelError: see `c_library`.
        ExportError: options of the library are invalid, or the folder cannot be written.
    """
    functions = c_functions(system, keys, options)
    return export.c_library(
        functions, folder, **keywords(CLibraryOptions, library or {}, system.name)
    )


def c_functions(
    system: System,
    keys: Sequence[str] = MODELS,
    options: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, Function]:
    """Return the models as Functions by their names in a C library.

    Args:
        system: open or closed system.
        keys: keys of the models.
        options: options of the models, by key.

    Raises:
        ModelError: a key is unknown, the system does not have the model, or `keys` is empty.
    """
    require_system(system)
    if not keys:
        raise ModelError(f"{system.name}: no model is chosen for the C library; choose one or more")
    functions = {}
    for key in dict.fromkeys(keys):
        chosen = entry(key)
        if reason := chosen.refusal(system):
            raise ModelError(f"{key}: {reason}; leave it out of the C library")
        given = (options or {}).get(key, {})
        functions[key.replace("-", "_")] = chosen.build_numeric(system, **given)
    return functions


def fmu(system: System, texts: Mapping[str, Any] | None = None) -> bytes:
    """Return an FMU of the system for Model Exchange and Co-Simulation.

    Args:
        system: open or closed system.
        texts: options of `mbs.export.fmu` by name, see `mbs.app.tasks.options.keywords`.

    Raises:
        ModelError, ExportError, ExpressionError, CompilerError: an option is invalid, or see
            `mbs.export.fmu`.
    """
    require_system(system)
    options = keywords(FmuOptions, texts or {}, system.name)
    return _write(lambda path: export.fmu(system, path, **options), f"{file_stem(system)}.fmu")


def par(system: System) -> bytes:
    """Return the content of a SYMORO file of the system; see `mbs.export.par`.

    Args:
        system: open or closed system.

    Raises:
        ModelError: the format cannot express the system.
    """
    return _write(lambda path: export.par(system, path), "robot.par")


def urdf(system: System) -> bytes:
    """Return the content of a URDF file of the system; see `mbs.export.urdf`.

    Args:
        system: system without loops.

    Raises:
        ModelError: the format cannot express the system.
    """
    return _write(lambda path: export.urdf(system, path), "robot.urdf")


def sdf(system: System) -> bytes:
    """Return the content of an SDFormat file of the system; see `mbs.export.sdf`.

    Args:
        system: open or closed system.

    Raises:
        ModelError: the format cannot express the system.
    """
    return _write(lambda path: export.sdf(system, path), "robot.sdf")


def toml(system: System) -> bytes:
    """Return the content of a TOML file of the system: a table of frames with joint names.

    Link j of the system is frame j. Bodies that are fixed to each other are a single link.

    Args:
        system: open or closed system.

    Raises:
        ModelError: a table of frames cannot express the system.
    """
    table = _named(robot_table(system, ".toml"), system)
    return _write(lambda path: write_toml(table, path), "robot.toml")


def _named(table: RobotTable, system: System) -> RobotTable:
    """Return a table with the names and limits of the joints of a system.

    The table also gets the name of the system and its assembled configuration as guess.
    """
    joints = zip(system.coordinates, system.velocity_coordinates, strict=True)
    frames = [
        replace(frame, name=c.name, limits=c.limits, velocity=s.limits, effort=s.effort)
        for frame, (c, s) in zip(table.frames, joints, strict=False)
    ]
    return replace(
        table,
        name=system.name,
        frames=(*frames, *table.frames[len(frames) :]),
        guess={
            c.name: x for c, x in zip(system.coordinates, system.configuration, strict=True) if x
        },
    )


def html(
    system: System,
    q: Sequence[float] | Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> bytes:
    """Return a picture of the system as a self-contained HTML file for any browser.

    Args:
        system: open or closed system.
        q: configuration [rad or m]. Default: the assembled configuration.
        parameters: values of symbols. Default: their default values.
    """
    from mbs import view

    return view.show(system, q, parameters=parameters).html.encode("utf-8")


def file_stem(system: System) -> str:
    """Return the name of the system as a file name without suffix: letters, digits, - and _."""
    return _NOT_IN_NAMES.sub("_", system.name).strip("_")[:60] or "robot"


def _write(write: Callable[[Path], object], name: str) -> bytes:
    """Return the bytes that the callable `write` writes to a file with this name."""
    with tempfile.TemporaryDirectory(prefix="mbs-export-") as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


def _zip(files: Mapping[str, bytes]) -> bytes:
    """Return a zip file of files by path; equal files give equal bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), content, zipfile.ZIP_DEFLATED)
    return stream.getvalue()
