"""Parts of the C run-time on their own, and the run-time library with changed constants."""

import ctypes
import importlib
import importlib.machinery
import importlib.util
import re
import shutil

import numpy as np

from mbs.core import core_files, evaluations
from mbs.core.build import SOURCE, build
from mbs.native import cached_library

integrate_module = importlib.import_module("mbs.solvers._integrate")

INTEGRATION = (
    *("module", "model", "driver", "stepper", "dopri5", "rodas", "events", "dense"),
    *("least_squares", "array_call", "projection", "sparse_pattern", "sparse_qr", "skyline"),
    *(file.stem for file in sorted(SOURCE.glob("passage*.c"))),
)
"""C files of the extension without those of arms."""


def runtime(*names):
    """The library of these files."""
    files = [name + end for name in names for end in (".c", ".h")]
    return ctypes.CDLL(str(cached_library(core_files(files))))


def with_constant(folder, constant, change):
    """The run-time library in which `#define constant value` has the value change(value).

    Args:
        folder: an empty folder.
        constant: name, of one of the files of an integration.
        change: a function of the present value.
    """
    pattern = rf"(#define {constant}) (\S+)"

    def value(match):
        now = eval(match[2])
        return f"{match[1]} {type(now)(change(now))!r}"

    return changed_library(folder, pattern, value, INTEGRATION)


def integrate_with(monkeypatch, library):
    """Let another run-time library integrate."""

    def of_library(make):
        def made(*arguments):
            with monkeypatch.context() as patch:
                patch.setattr(evaluations, "core_library", lambda: library)
                return make(*arguments)

        return made

    for make in (evaluations.compiled_evaluation, evaluations.interpreted_evaluation):
        monkeypatch.setattr(integrate_module, make.__name__, of_library(make))
    monkeypatch.setattr(integrate_module, "core_library", lambda: library)


def changed_library(folder, pattern, replacement, names=None):
    """The run-time library with a change at the one place where a pattern is found.

    Args:
        folder: an empty folder.
        pattern: regular expression.
        replacement: of the text that is found, as for re.sub.
        names: of the C files that are compiled; all if left out.
    """
    source, found = folder / "source", 0
    shutil.copytree(SOURCE, source)
    for file in source.glob("*.[ch]"):
        text, count = re.subn(pattern, replacement, file.read_text())
        file.write_text(text)
        found += count
    assert found == 1
    chosen = sorted(source.glob("*.c")) if names is None else [source / f"{n}.c" for n in names]
    library = build(folder / "_core.so", chosen)
    loader = importlib.machinery.ExtensionFileLoader("mbs.core._core", str(library))
    spec = importlib.util.spec_from_file_location("mbs.core._core", library, loader=loader)
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def call(function, *arguments):
    """Arrays are handed over by their address."""
    return function(*(_handed(argument) for argument in arguments))


def _handed(argument):
    return ctypes.c_void_p(argument.ctypes.data) if isinstance(argument, np.ndarray) else argument
