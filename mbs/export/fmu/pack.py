"""An FMU as one file: sources, libraries, description and documentation, zipped."""

from __future__ import annotations

import hashlib
import io
import os
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from mbs.errors import ExportError
from mbs.export.fmu.contents import description, plain_files, standard_header
from mbs.export.fmu.description import FmuModel
from mbs.export.fmu.faces import FACES, folder_of, require_version
from mbs.export.fmu.reference import reference_files
from mbs.export.fmu.tables import header, source
from mbs.files import path_of, write_bytes
from mbs.native.cache import cached_library
from mbs.native.cross import Platform, cross_compiler, host_platform, platform_named
from mbs.native.plain_source import plain_flags

_EPOCH = (1980, 1, 1, 0, 0, 0)  # equal models give equal files


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
        model: what the FMU is.
        path: file to write; it is replaced as a whole, or left alone.
        fmi: version of the standard, "2.0" or "3.0".
        platforms: names of `mbs.native.cross.PLATFORMS`, made with ziglang; this computer when
            left out, with its own compiler.
        reference: whether to put in the results of the default experiment, see
            `mbs.export.fmu.reference`.

    Returns:
        the file.

    Raises:
        ExportError: the file cannot be written, a function cannot be written as C, there is no
            such version, or the default experiment does not reach its end.
        CompilerError: there is no C compiler, or no such platform.
    """
    require_version(f"FMU {model.name}", fmi)
    goals = None if platforms is None else _platforms(model, platforms)
    target = path_of(path)
    require_writable(target)
    results = reference_files(model) if reference else {}
    face = FACES[fmi]
    code, compiled = source(model, adjoint=face.adjoint), _compiled(model, fmi)
    unnamed = description(model, fmi, "", compiled)
    tables = header(model, "", adjoint=face.adjoint)
    guid = _guid(unnamed, tables, code, *(text for _, text in model.sources))
    named = header(model, guid, adjoint=face.adjoint)
    texts = {"model.c": code, "model.h": named, **face.fixed(model.solver)}
    texts.update(model.sources)
    files = {
        "modelDescription.xml": _identified(unnamed, guid).encode(),
        **plain_files(model, fmi, texts[standard_header(fmi)], compiled),
        **results,
        **_binaries(model, fmi, texts, goals),
        **{f"sources/{name}": text.encode() for name, text in texts.items()},
    }
    write_bytes(_zipped(files), target)
    return target


def _compiled(model: FmuModel, fmi: str) -> tuple[str, ...]:
    """The C files to compile, those of the user last."""
    own = (name for name, _ in model.sources if name.endswith(".c"))
    return (*FACES[fmi].compiled(model.solver), *own)


def _identified(unnamed: str, guid: str) -> str:
    """The model description with its identity: the first attribute that is empty."""
    return unnamed.replace('=""', f'="{guid}"', 1)


def _binaries(
    model: FmuModel, fmi: str, texts: Mapping[str, str], goals: Sequence[Platform] | None
) -> dict[str, bytes]:
    """The libraries: name in the FMU to content."""
    flags = (*plain_flags(texts["model.c"]), "-fvisibility=hidden", "-std=gnu99")
    libraries: dict[Platform, Path] = {}
    if goals is None:
        libraries[host_platform()] = cached_library(texts, flags)
    for goal in goals or ():
        stripped = (*flags, "-s")
        libraries[goal] = cached_library(
            texts, stripped, compiler=cross_compiler(goal), suffix=goal.suffix
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
    """An identity made of what the FMU says and computes, so that equal models share it."""
    h = hashlib.sha256("".join(texts).encode()).hexdigest()
    return "{" + "-".join((h[:8], h[8:12], h[12:16], h[16:20], h[20:32])) + "}"


def require_writable(target: Path) -> None:
    """Refuse a place where no FMU can be written.

    Raises:
        ExportError: its folder is missing or closed, or it is a folder itself.
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


def _zipped(files: Mapping[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for file in sorted(files):
            info = zipfile.ZipInfo(file, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[file])
    return stream.getvalue()
