"""An FMU as one file: sources, library, description and documentation, zipped."""

import hashlib
import html
import io
import os
import platform
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from mbs.errors import ExportError
from mbs.export.fmu.description import FmuModel
from mbs.export.fmu.tables import header, source
from mbs.export.fmu.xml import model_description
from mbs.files import path_of, write_bytes
from mbs.native.cache import cached_library
from mbs.native.compiler import LIBRARY_SUFFIX, flags_for

_CORE = (
    "core.c",
    "values.c",
    "closure.c",
    "exchange.c",
    "cosimulation.c",
    "saved.c",
    "fmi2.c",
)
_CORE_HEADERS = ("core.h", "internal.h", "closure.h")
_RUNTIME = ("stepper.c", "dopri5.c")
_RUNTIME_HEADERS = ("stepper.h", "dopri5.h")
_FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
SOURCES = ("model.c", *_CORE, *_RUNTIME)
"""C files to compile, in the folder `sources` of the FMU."""

_EPOCH = (1980, 1, 1, 0, 0, 0)  # equal models give equal files
_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title>
<style>p {{ white-space: pre-wrap }}</style></head>
<body>
<h1>{title}</h1>
{paragraphs}
<table>
<tr><th>variable</th><th>unit</th><th>what it is</th></tr>
{rows}
</table>
</body>
</html>
"""


def write_fmu(model: FmuModel, path: str | os.PathLike[str]) -> Path:
    """Write an FMU for model exchange and co-simulation, FMI 2.0, with sources and library.

    Args:
        model: what the FMU is.
        path: file to write; it is replaced as a whole, or left alone.

    Returns:
        the file.

    Raises:
        ExportError: the file cannot be written, or a function cannot be written as C.
        CompilerError: there is no C compiler.
    """
    target = path_of(path)
    _check_target(target)
    code = source(model)
    unnamed = model_description(model, "", SOURCES)
    guid = _guid(unnamed, code)
    texts = {"model.c": code, "model.h": header(model, guid), **_fixed_sources()}
    flags = (*flags_for(code), "-fvisibility=hidden", "-std=gnu99")
    library = cached_library(texts, flags)
    binary = f"binaries/{_platform()}/{model.identifier}{LIBRARY_SUFFIX}"
    files: dict[str, bytes] = {
        "modelDescription.xml": unnamed.replace('guid=""', f'guid="{guid}"', 1).encode(),
        "documentation/index.html": _documentation(model).encode(),
        binary: library.read_bytes(),
        **{f"sources/{name}": text.encode() for name, text in texts.items()},
    }
    write_bytes(_zipped(files), target)
    return target


def _fixed_sources() -> dict[str, str]:
    """The C files that every FMU shares: name to text."""
    c = resources.files("mbs.export.fmu") / "c"
    runtime = resources.files("mbs.native") / "runtime"
    fmi = resources.files("fmpy") / "c-code"
    folders = (
        (c, (*_CORE, *_CORE_HEADERS)),
        (runtime, (*_RUNTIME, *_RUNTIME_HEADERS)),
        (fmi, _FMI_HEADERS),
    )
    return {
        name: (folder / name).read_text(encoding="utf-8")
        for folder, names in folders
        for name in names
    }


def _guid(description: str, code: str) -> str:
    """An identity made of what the FMU says and computes, so that equal models share it."""
    h = hashlib.sha256((description + code).encode()).hexdigest()
    return "{" + "-".join((h[:8], h[8:12], h[12:16], h[16:20], h[20:32])) + "}"


def _platform() -> str:
    """Name that FMI 2.0 gives to this computer's kind of library."""
    bits = "64" if sys.maxsize > 2**32 else "32"
    if platform.machine().lower() not in ("x86_64", "amd64", "x86", "i386", "i686"):
        return f"{platform.machine()}-{sys.platform}"
    return {"win32": "win", "darwin": "darwin"}.get(sys.platform, "linux") + bits


def _documentation(model: FmuModel) -> str:
    text = model.documentation or model.description or model.name
    paragraphs = "\n".join(f"<p>{html.escape(part)}</p>" for part in text.split("\n\n"))
    rows = "\n".join(
        f"<tr><td>{html.escape(v.name)}</td><td>{html.escape(v.unit)}</td>"
        f"<td>{html.escape(v.description)}</td></tr>"
        for v in (entry.variable for entry in model.entries)
    )
    return _PAGE.format(title=html.escape(model.name), paragraphs=paragraphs, rows=rows)


def _check_target(target: Path) -> None:
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
