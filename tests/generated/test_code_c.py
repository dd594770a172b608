"""C and Fortran texts, compiled here, against the Functions they came from."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
from code_models import NAMES, assert_close, example, expected, states

import mbs
from mbs.native import compile_library

POINTER = ctypes.POINTER(ctypes.c_double)


def call(routine, function, values):
    """The outputs of a routine of pointers, matrices column by column."""
    given = [np.asfortranarray(value, dtype=float) for value in values]
    shapes = [function.size_out(k) for k in range(function.n_out())]
    outputs = [np.full(shape, np.nan, order="F") for shape in shapes]
    routine(*(array.ctypes.data_as(POINTER) for array in (*given, *outputs)))
    return outputs


def compare(library, spelling):
    for name in NAMES:
        function = example(name)
        routine = getattr(library, spelling.format(name.lower() if "_" in spelling else name))
        for values in states(function):
            theirs = expected(function, values)
            for ours, want in zip(call(routine, function, values), theirs, strict=True):
                assert_close(ours, want)


def test_c_text_runs(tmp_path):
    source = tmp_path / "models.c"
    texts = [mbs.export.code(example(name), "c", name=name) for name in NAMES]
    source.write_text("\n".join(texts))
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Wno-parentheses"]
    flags = [*strict, "-Werror", "-O1", "-fPIC", "-shared"]
    library = compile_library([source], flags=flags, output=tmp_path / "models.so")
    compare(ctypes.CDLL(str(library)), "{}")


@pytest.mark.skipif(not shutil.which("gfortran"), reason="no Fortran compiler")
def test_fortran_text_runs(tmp_path):
    source = tmp_path / "models.f90"
    texts = [mbs.export.code(example(name), "fortran", name=name) for name in NAMES]
    source.write_text("\n".join(texts))
    assert max(len(line) for line in source.read_text().splitlines()) <= 132
    flags = ["-std=f2008", "-Wall", "-Wno-unused-dummy-argument", "-Werror", "-O1", "-fPIC"]
    library = tmp_path / "models.so"
    command = ["gfortran", *flags, "-shared", str(source), "-o", str(library)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr[:2000]
    compare(ctypes.CDLL(str(library)), "{}_")
