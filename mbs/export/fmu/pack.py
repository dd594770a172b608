"""FMU file: zip archive of sources, libraries, model description and documentation."""

from __future__ import annotations

import hashlib
import io
import os
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from mbs.core import core_files
from mbs.errors import ExportError
from mbs.export.fmu.description import FmuModel, Solver
from mbs.export.fmu.documentation import documentation, licence_files
from mbs.export.fmu.reference import reference_files
from mbs.export.fmu.source import header, source
from mbs.export.fmu.xml import build_description, model_description, terminals_and_icons
from mbs.files import path_of, write_bytes
from mbs.native.compiler import (
    Platform,
    cached_library,
    cross_compiler,
    host_platform,
    platform_named,
)
from mbs.native.scalar_source import Target, plain_flags
from mbs.text import quoted
from mbs.view.drawing_files import icon, standalone

# Supported versions of FMI, and the C files of each version.


_CORE = (
    "message.c",
    "log.c",
    "inputs.c",
    "machine.c",
    "closure.c",
    "watch.c",
    "configuration.c",
    "guard.c",
    "solver.c",
    "tree_state.c",
    "calculated.c",
    "internal_step.c",
    "event_mode.c",
    "instance.c",
    "values.c",
    "derivatives.c",
    "model_exchange.c",
    "cosimulation.c",
    "saved.c",
)
_CORE_HEADERS = (
    "real.h",
    "references.h",
    "closure.h",
    "watch.h",
    "run.h",
    "message.h",
    "log.h",
    "inputs.h",
    "machine.h",
    "configuration.h",
    "guard.h",
    "solver.h",
    "tree_state.h",
    "charts.h",
    "calculated.h",
    "event_data.h",
    "internal_step.h",
    "event_mode.h",
    "chart_choice.h",
    "core.h",
)
"""Headers from the lowest part to the highest: a file includes only its own header and headers
before it."""

_HOSTED = ("charts.c", "chart_choice.c")
_RUNTIME = (
    "stepper",
    "events",
    "dense",
    "projection",
    "sparse_pattern",
    "sparse_qr",
    "skyline",
    "passage",
    "passage_chart",
    "passage_crossing",
    "passage_data",
    "passage_external",
    "passage_frame",
    "passage_near_miss",
    "passage_newton",
    "passage_origin",
    "passage_start",
    "passage_step",
)
_TABLEAU = "dopri5"
"""Integrator for steps through singular configurations, independent of the solver."""

_BARE_RUNTIME = ("stepper", "projection")
_MEMORY = "memory.c"
"""File that allocates instances and saved states on the C heap."""


@dataclass(frozen=True, slots=True)
class FmiVersion:
    """Version of FMI: the files of its interface to the common core.

    Attributes:
        sources: C files of the interface.
        headers: headers of the interface.
        standard: headers of the standard, from the package fmpy, with their licence inside.
        adjoint: whether the version has functions for adjoint derivatives.
        callbacks: whether importers pass memory allocation callbacks to each instance.
    """

    sources: tuple[str, ...]
    headers: tuple[str, ...]
    standard: tuple[str, ...]
    adjoint: bool
    callbacks: bool

    def compiled(self, solver: Solver, target: Target = "hosted") -> tuple[str, ...]:
        """Return the names of the C files to compile, in the folder `sources` of the FMU."""
        return ("model.c", *self._own(solver, target))

    def together(self, solver: Solver, target: Target = "hosted") -> tuple[str, ...]:
        """Return the C files that are compiled as one unit: all except model.c and the run-time."""
        runtime = {f"{name}.c" for name in _runtime(solver, target)}
        return tuple(name for name in self._own(solver, target) if name not in runtime)

    def _own(self, solver: Solver, target: Target) -> tuple[str, ...]:
        heap = () if target == "bare" and self.callbacks else (_MEMORY,)
        core = (*_CORE, *(_HOSTED if target == "hosted" else ()))
        runtime = (f"{name}.c" for name in _runtime(solver, target))
        return (*core, *runtime, *self.sources, *heap)

    def fixed(self, solver: Solver, target: Target = "hosted") -> dict[str, str]:
        """Return the files that do not depend on the equations: dict from name to text."""
        own = resources.files("mbs.export.fmu") / "c"
        standard = resources.files("fmpy") / "c-code"
        parts = tuple(f"{name}.{end}" for name in _runtime(solver, target) for end in "ch")
        written = [name for name in self._own(solver, target) if name not in parts]
        heap = ("memory.h",) if _MEMORY in written else ()
        folders = (
            (own, (*written, *_CORE_HEADERS, *self.headers, *heap)),
            (standard, self.standard),
        )
        texts = {
            name: (folder / name).read_text(encoding="utf-8")
            for folder, names in folders
            for name in names
        }
        return texts | core_files(parts)


def _runtime(solver: Solver, target: Target) -> tuple[str, ...]:
    if target == "bare":
        return (*_BARE_RUNTIME, solver)
    return (*_RUNTIME, *dict.fromkeys((_TABLEAU, solver)))


FACES = {
    "2.0": FmiVersion(
        ("fmi2.c",),
        ("fmi2_face.h",),
        ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
        adjoint=False,
        callbacks=True,
    ),
    "3.0": FmiVersion(
        ("fmi3.c", "fmi3_arrays.c", "fmi3_run.c", "fmi3_absent.c"),
        ("fmi3_face.h",),
        ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
        adjoint=True,
        callbacks=False,
    ),
}


def require_version(name: str, fmi: object) -> None:
    """Check that a version of FMI is supported. name: name of the model, for the message.

    Raises:
        ExportError: the version is not supported. The message lists the supported versions.
    """
    if fmi not in FACES:
        known = " or ".join(f"fmi={version!r}" for version in FACES)
        raise ExportError(f"{name}: FMI version {quoted(fmi)} is not written; use {known}")


def folder_of(platform: Platform, fmi: str) -> str:
    """Return the folder of a platform's library in the folder `binaries`."""
    return platform.fmi2 if fmi == "2.0" else platform.name


# Files of an FMU that are not compiled: descriptions, documentation, icon, licences.


def plain_files(
    model: FmuModel, fmi: str, standard_header: str, compiled: Sequence[str]
) -> dict[str, bytes]:
    """Return documentation, licences, icons and other XML files: dict from path to content.

    Args:
        model: description of the FMU.
        fmi: version of the standard.
        standard_header: text of a header of the standard, which contains its licence.
        compiled: names of the C files to compile.
    """
    files = {"documentation/index.html": documentation(model).encode()}
    own = [name for name, _ in model.sources]
    for name, text in licence_files(standard_header, own).items():
        files[f"documentation/licenses/{name}"] = text.encode()
    drawn = model.about.drawing if model.about else None
    if fmi == "2.0":
        return files | ({"model.png": icon(drawn)} if drawn else {})
    build = build_description(model, compiled)
    files["sources/buildDescription.xml"] = build.encode()
    if drawn or model.terminals:
        files["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_and_icons(model).encode()
    if drawn:
        files["terminalsAndIcons/icon.png"] = icon(drawn)
        files["terminalsAndIcons/icon.svg"] = standalone(drawn, model.name).encode()
    return files


_EPOCH = (1980, 1, 1, 0, 0, 0)  # date of all files, so that equal models give equal archives


def write_fmu(
    model: FmuModel,
    path: str | os.PathLike[str],
    *,
    fmi: str = "2.0",
    platforms: Sequence[str] | None = None,
    reference: bool = False,
) -> Path:
    """Write an FMU for model exchange and co-simulation, with sources and libraries.

    Args:
        model: description of the FMU.
        path: file to write. An existing file is replaced only if the export succeeds.
        fmi: version of the standard, "2.0" or "3.0".
        platforms: names of `mbs.native.compiler.PLATFORMS`, compiled with ziglang. By default this
            computer, with its own compiler.
        reference: whether to include the results of the default experiment, see
            `mbs.export.fmu.reference`.

    Returns:
        Path of the file.

    Raises:
        ExportError: the file cannot be written, a function cannot be written as C, the version is
            not supported, or the default experiment fails before its end.
        CompilerError: no C compiler is installed, or a platform is unknown.
    """
    require_version(f"FMU {model.name}", fmi)
    goals = None if platforms is None else _platforms(model, platforms)
    target = path_of(path)
    require_writable(target)
    results = reference_files(model) if reference else {}
    face = FACES[fmi]
    (code, work), compiled = source(model, adjoint=face.adjoint), _compile(model, fmi)
    unnamed = model_description(model, fmi, "", compiled)
    tables = header(model, "", work, adjoint=face.adjoint)
    guid = _guid(unnamed, tables, code, *(text for _, text in model.sources))
    named = header(model, guid, work, adjoint=face.adjoint)
    fixed = face.fixed(model.solver, model.target)
    texts = {"model.c": code, "model.h": named, **fixed}
    texts.update(model.sources)
    files = {
        "modelDescription.xml": _identify(unnamed, guid).encode(),
        **plain_files(model, fmi, texts[face.standard[0]], compiled),
        **results,
        **_binaries(model, fmi, texts, goals),
        **{f"sources/{name}": text.encode() for name, text in texts.items()},
    }
    write_bytes(_zip(files), target)
    return target


def _compile(model: FmuModel, fmi: str) -> tuple[str, ...]:
    """Return the names of the C files to compile, the files of the user last."""
    own = (name for name, _ in model.sources if name.endswith(".c"))
    return (*FACES[fmi].compiled(model.solver, model.target), *own)


def _identify(unnamed: str, guid: str) -> str:
    """Insert the identifier into a model description, as the first empty attribute."""
    return unnamed.replace('=""', f'="{guid}"', 1)


def _binaries(
    model: FmuModel, fmi: str, texts: Mapping[str, str], goals: Sequence[Platform] | None
) -> dict[str, bytes]:
    """Compile the libraries. Returns dict from path in the FMU to content."""
    flags = (*plain_flags(texts["model.c"]), "-fvisibility=hidden", "-std=gnu99")
    common = tuple(f"{name}.c" for name in _runtime(model.solver, model.target))
    together = FACES[fmi].together(model.solver, model.target)
    libraries: dict[Platform, Path] = {}
    if goals is None:
        libraries[host_platform()] = cached_library(texts, flags, common=common, together=together)
    for goal in goals or ():
        stripped = (*flags, "-s")
        libraries[goal] = cached_library(
            texts,
            stripped,
            compiler=cross_compiler(goal),
            suffix=goal.suffix,
            common=common,
            together=together,
        )
    return {
        f"binaries/{folder_of(goal, fmi)}/{model.identifier}{goal.suffix}": library.read_bytes()
        for goal, library in libraries.items()
    }


def _platforms(model: FmuModel, names: Sequence[str]) -> list[Platform]:
    given = [names] if isinstance(names, str) else list(names)
    if not given:
        raise ExportError(
            f"FMU {model.name}: no platform was named; leave platforms out for this computer"
        )
    return list(dict.fromkeys(platform_named(name) for name in given))


def _guid(*texts: str) -> str:
    """Return an identifier from a hash of the contents, so that equal models have the same one."""
    h = hashlib.sha256("".join(texts).encode()).hexdigest()
    return "{" + "-".join((h[:8], h[8:12], h[12:16], h[16:20], h[20:32])) + "}"


def require_writable(target: Path) -> None:
    """Check that a file can be written.

    Raises:
        ExportError: the folder is missing or not writable, or the path is a folder.
    """
    if not target.parent.is_dir():
        raise ExportError(f"folder {target.parent} does not exist; create it or choose another one")
    if target.is_dir():
        raise ExportError(f"{target} is a folder; give the name of a file, such as model.fmu")
    try:
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise ExportError(
            f"folder {target.parent} cannot be written ({error.strerror}); choose another one"
        ) from error


def _zip(files: Mapping[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for file in sorted(files):
            info = zipfile.ZipInfo(file, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[file])
    return stream.getvalue()
