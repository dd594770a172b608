"""Generated C libraries, compiled here and called with arrays."""

import ctypes
import re
import subprocess

import numpy as np

from mbs.native import find_compiler
from mbs.native.compiler import LIBRARY_SUFFIX

EXACT = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")


def loaded(folder, flags=EXACT):
    """The library of the C files of a folder but its example."""
    output = folder / f"library{LIBRARY_SUFFIX}"
    files = [str(path) for path in sorted(folder.glob("*.c")) if path.name != "example.c"]
    command = [*find_compiler().command, *flags, *files, "-o", str(output), "-lm"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return ctypes.CDLL(str(output))


def header_number(folder, name):
    """A number that the header defines."""
    text = next(folder.glob("*.h")).read_text()
    return int(re.search(rf"#define {name} (\d+)", text)[1])


def called(folder, library, model, values, dtype=np.float64, name=None):
    """Status and outputs, columns of matrices after each other, of `NAME_eval`."""
    name = name or model.name()
    inputs = [np.asarray(v, dtype=dtype).ravel(order="F") for v in values]
    outputs = [np.zeros(max(1, model.numel_out(k)), dtype) for k in range(model.n_out())]
    w = np.zeros(header_number(folder, f"{name.upper()}_SZ_W"), dtype)
    arrays = [ctypes.c_void_p(a.ctypes.data) for a in (*inputs, *outputs, w)]
    return getattr(library, f"{name}_eval")(*arrays), outputs


class Motion:
    """`SYSTEM_start`, `SYSTEM_step` and `SYSTEM_motion` on one state."""

    def __init__(self, folder, library, system, dtype=np.float64, name=None):
        self.name, self.library, self.dtype = name or system.name, library, dtype
        self.real = ctypes.c_double if dtype == np.float64 else ctypes.c_float
        self.nq, self.nv = system.nq, system.nv
        self.w = np.zeros(header_number(folder, f"{self.name.upper()}_STEP_SZ_W"), dtype)
        self.state = np.zeros(4096, dtype)  # as large as any

    def start(self, x=None, guess=None, p=None):
        return self._call("start", *(None if a is None else self._array(a) for a in (x, guess, p)))

    def step(self, u, h):
        return self._call("step", self._array(u), self.real(h))

    def motion(self, u):
        seen = [np.zeros(n, self.dtype) for n in (self.nq, self.nv, self.nv)]
        return self._call("motion", self._array(u), *seen), seen

    @property
    def time(self):
        return self.state[0]

    def _array(self, values):
        return np.asarray([*values, 0.0], dtype=self.dtype)

    def _call(self, what, *arguments):
        given = [
            ctypes.c_void_p(a.ctypes.data) if isinstance(a, np.ndarray) else a
            for a in (self.state, *arguments, self.w)
        ]
        return getattr(self.library, f"{self.name}_{what}")(*given)
