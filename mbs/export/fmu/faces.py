"""The versions of FMI that are written, and the C files of each."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources

from mbs.errors import ExportError
from mbs.export.fmu.description import Solver
from mbs.messages import quoted
from mbs.native.cross import Platform

_CORE = (
    "core.c",
    "values.c",
    "inputs.c",
    "derivatives.c",
    "closure.c",
    "watch.c",
    "guard.c",
    "charts.c",
    "solver.c",
    "switching.c",
    "exchange.c",
    "cosimulation.c",
    "saved.c",
)
_CORE_HEADERS = (
    "core.h",
    "internal.h",
    "real.h",
    "closure.h",
    "watch.h",
    "guard.h",
    "charts.h",
    "solver.h",
)
_RUNTIME = ("stepper", "events", "dense", "passage")
_TABLEAU = "dopri5"
"""What steps through singular configurations take, whichever the solver is."""


@dataclass(frozen=True, slots=True)
class Face:
    """A version of FMI, as a thin face over the core.

    Attributes:
        sources: C files of the face.
        headers: its own.
        standard: headers of the standard, which fmpy brings with their licence inside.
        adjoint: it has calls for adjoint derivatives.
    """

    sources: tuple[str, ...]
    headers: tuple[str, ...]
    standard: tuple[str, ...]
    adjoint: bool

    def compiled(self, solver: Solver) -> tuple[str, ...]:
        """The C files to compile with a solver, in the folder `sources` of the FMU."""
        return ("model.c", *_CORE, *(f"{name}.c" for name in _runtime(solver)), *self.sources)

    def fixed(self, solver: Solver) -> dict[str, str]:
        """The files that do not depend on the equations: name to text."""
        own = resources.files("mbs.export.fmu") / "c"
        runtime = resources.files("mbs.native") / "runtime"
        standard = resources.files("fmpy") / "c-code"
        folders = (
            (own, (*_CORE, *_CORE_HEADERS, *self.sources, *self.headers)),
            (runtime, tuple(f"{name}.{end}" for name in _runtime(solver) for end in "ch")),
            (standard, self.standard),
        )
        return {
            name: (folder / name).read_text(encoding="utf-8")
            for folder, names in folders
            for name in names
        }


def _runtime(solver: Solver) -> tuple[str, ...]:
    return (*_RUNTIME, *dict.fromkeys((_TABLEAU, solver)))


FACES = {
    "2.0": Face(
        ("fmi2.c",),
        (),
        ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
        adjoint=False,
    ),
    "3.0": Face(
        ("fmi3.c", "fmi3_arrays.c", "fmi3_run.c", "fmi3_absent.c"),
        ("fmi3_face.h",),
        ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
        adjoint=True,
    ),
}


def require_version(name: str, fmi: object) -> None:
    """Refuse a version of FMI that is not written.

    Raises:
        ExportError: says which ones are.
    """
    if fmi not in FACES:
        known = " or ".join(f"fmi={version!r}" for version in FACES)
        raise ExportError(f"{name}: FMI version {quoted(fmi)} is not written; use {known}")


def folder_of(platform: Platform, fmi: str) -> str:
    """The folder of a platform's library among the binaries."""
    return platform.fmi2 if fmi == "2.0" else platform.name
