"""Files of a system for other programs, as bytes that a page sends or a command writes."""

from __future__ import annotations

import io
import re
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, get_args

from casadi import Function

from mbs import export
from mbs.app.tasks.equations import entry
from mbs.app.tasks.simulation import number
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.export.fmu.description import Solver
from mbs.export.par import robot_table
from mbs.formats import RobotTable, write_toml
from mbs.text import did_you_mean

SOLVERS: tuple[str, ...] = get_args(Solver)
"""Methods of integration that an FMU may hold."""

MODELS = ("idm", "ddm")
"""Keys of the models of a C library by default."""

_EPOCH = (1980, 1, 1, 0, 0, 0)  # equal models give equal files
_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True)
class FmuSettings:
    """What an FMU holds, as `mbs.export.fmu` takes it.

    Attributes:
        fmi: "2.0" or "3.0".
        inputs: beside the efforts of motors, such as "j1.q" or "tool.wrench".
        outputs: beside the motion of all joints, such as "energy" or "closure".
        parameters: numbers that become parameters, such as "masses" or "M3".
        fixed: names of parameters that cannot be tuned during the motion.
        stop_time: default end [s].
        step_size: default communication step [s].
        tolerance: default relative tolerance.
        solver: for co-simulation, one of `SOLVERS`.
        internal_step: of "rk4" [s].
        max_step: the longest step of the other solvers [s]; none when empty.
        target: "hosted", or "bare" for microcontrollers.
        platforms: such as "x86_64-windows"; this computer when empty.
    """

    fmi: str = "2.0"
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    stop_time: float | str = 10.0
    step_size: float | str = 0.01
    tolerance: float | str = 1e-8
    solver: str = "dopri5"
    internal_step: float | str = 0.001
    max_step: float | str = ""
    target: str = "hosted"
    platforms: tuple[str, ...] = ()


def c_library(
    system: System,
    keys: Sequence[str] = MODELS,
    options: Mapping[str, Mapping[str, Any]] | None = None,
) -> bytes:
    """Models as a zip with one folder of C source, a header, CMakeLists.txt and an example.

    Args:
        system: open or closed.
        keys: of the models, as the menus have them.
        options: key to the options of that model, the others by default.

    Raises:
        ModelError: a key is unknown, the system does not have the model, or no key is given.
    """
    functions = c_functions(system, keys, options)
    name = file_stem(system)
    with tempfile.TemporaryDirectory(prefix="mbs-c-") as place:
        folder = export.c_library(functions, Path(place) / name)
        files = {f"{name}/{path.name}": path.read_bytes() for path in sorted(folder.iterdir())}
    return _zip(files)


def c_functions(
    system: System,
    keys: Sequence[str] = MODELS,
    options: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, Function]:
    """Models by their names in a C library; arguments and errors as for `c_library`."""
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


def fmu(system: System, settings: FmuSettings | None = None) -> bytes:
    """The system as an FMU for Model Exchange and Co-Simulation.

    Args:
        system: open or closed.
        settings: what it holds.

    Raises:
        ModelError, ExportError, CompilerError: as for `mbs.export.fmu`.
    """
    require_system(system)
    settings = settings or FmuSettings()
    if settings.solver not in SOLVERS:
        raise ModelError(
            f"{system.name}: there is no solver {settings.solver!r};"
            f" {did_you_mean(settings.solver, SOLVERS)}"
        )
    given = asdict(settings)
    for what in ("stop_time", "step_size", "tolerance", "internal_step"):
        given[what] = number(given[what], f"{system.name}: {what}")
    limit = given.pop("max_step")
    if limit != "":
        given["max_step"] = number(limit, f"{system.name}: max_step")
    given["platforms"] = list(settings.platforms) or None
    return _write(lambda path: export.fmu(system, path, **given), f"{file_stem(system)}.fmu")


def par(system: System) -> bytes:
    """The system as a robot file of SYMORO; see `mbs.export.par`.

    Raises:
        ModelError: the format cannot say it.
    """
    return _write(lambda path: export.par(system, path), "robot.par")


def urdf(system: System) -> bytes:
    """The system as a URDF file; see `mbs.export.urdf`.

    Raises:
        ModelError: the format cannot say it.
    """
    return _write(lambda path: export.urdf(system, path), "robot.urdf")


def sdf(system: System) -> bytes:
    """The system as an SDFormat file; see `mbs.export.sdf`.

    Raises:
        ModelError: the format cannot say it.
    """
    return _write(lambda path: export.sdf(system, path), "robot.sdf")


def toml(system: System) -> bytes:
    """The system as a table of frames in TOML, its joints under their names.

    Link j of the system is frame j; bodies that are welded together are one link.

    Raises:
        ModelError: a table of frames cannot say it.
    """
    table = _named(robot_table(system, ".toml"), system)
    return _write(lambda path: write_toml(table, path), "robot.toml")


def _named(table: RobotTable, system: System) -> RobotTable:
    """The table with names and ranges of the system's joints, its name and configuration."""
    joints = zip(system.coordinates, system.speeds, strict=True)
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
    """A picture of the system that any browser shows, in one file that loads nothing else.

    Args:
        system: open or closed.
        q: configuration; the assembled one when left out [rad or m].
        parameters: values of symbols, the others at their defaults.
    """
    from mbs import view

    return view.show(system, q, parameters=parameters).html.encode("utf-8")


def file_stem(system: System) -> str:
    """The name of the system as the beginning of a file's name: letters, digits, - and _."""
    return _NOT_IN_NAMES.sub("_", system.name).strip("_")[:60] or "robot"


def _write(write: Callable[[Path], object], name: str) -> bytes:
    """What a function writes into a file of this name."""
    with tempfile.TemporaryDirectory(prefix="mbs-export-") as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


def _zip(files: Mapping[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), content, zipfile.ZIP_DEFLATED)
    return stream.getvalue()
