"""Parts of the C run-time on their own."""

import ctypes
from importlib import resources

import numpy as np

from mbs.native import cached_library


def runtime(*names):
    """The library of these files."""
    folder = resources.files("mbs.native") / "runtime"
    files = [name + end for name in names for end in (".c", ".h")]
    texts = {name: (folder / name).read_text(encoding="utf-8") for name in files}
    return ctypes.CDLL(str(cached_library(texts)))


def call(function, *arguments):
    """Arrays are handed over by their address."""
    return function(*(_handed(argument) for argument in arguments))


def _handed(argument):
    return ctypes.c_void_p(argument.ctypes.data) if isinstance(argument, np.ndarray) else argument
