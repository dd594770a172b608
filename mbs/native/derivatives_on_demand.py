"""Derivatives of a compiled Function that are compiled at their first use.

CasADi looks up the derivatives of an external Function `f` by the names `jac_f`, `fwd1_f` and
`adj1_f` in the library of `f`: for a call of `jacobian`, in a solver or in a graph that calls `f`,
in this process or in another to which the Function was sent. Their code takes ten times as long to
generate and compile as `f`. The library therefore defines these names as stubs. At its first call,
a stub requests the derivative from Python. Python reads the Function from a file in the cache, or
builds it if this process has registered it with `promise`.
"""

from __future__ import annotations

import ctypes
import functools
import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import casadi

from mbs.errors import CompilerError, ExportError
from mbs.files import read_sealed, write_sealed
from mbs.native.compiler import cache_dir
from mbs.native.kernel import LoopCode

_SUFFIX = ".function"

_ENDS = {
    "": "int, (const double **arg, double **res, ll *iw, double *w, int mem),"
    " (arg, res, iw, w, mem)",
    "_n_in": "ll, (void), ()",
    "_n_out": "ll, (void), ()",
    "_default_in": "double, (ll i), (i)",
    "_name_in": "const char *, (ll i), (i)",
    "_name_out": "const char *, (ll i), (i)",
    "_sparsity_in": "const ll *, (ll i), (i)",
    "_sparsity_out": "const ll *, (ll i), (i)",
    "_work": "int, (ll *arg, ll *res, ll *iw, ll *w), (arg, res, iw, w)",
    "_checkout": "int, (void), ()",
    "_release": "void, (int mem), (mem)",
    "_incref": "void, (void), ()",
    "_decref": "void, (void), ()",
}
"""Suffixes of the functions of a derivative that CasADi may call: type, parameters, arguments."""

_PATTERN = "_sparsity_out"

_FAILS = ("", "_work")
"""Suffixes of functions that return 1 if there is no code; CasADi reports it. Others return 0."""

_LATE = ("_release", "_decref")
"""Suffixes of functions that are called last; they do not start a compilation."""


class Derivative(NamedTuple):
    """Unit that is compiled at once: the code of a derivative, or only its sparsity.

    Attributes:
        name: name of the C function, such as `jac_fwd1_f` for the Jacobian of `fwd1_f`.
        pattern: whether it is the sparsity only. CasADi reads the sparsity of `jac_f` even if it
            uses directional derivatives instead of the Jacobian.
    """

    name: str
    pattern: bool = False

    def symbols(self) -> list[tuple[str, str]]:
        """Return the names of its C functions as pairs (name of the derivative, suffix)."""
        if self.pattern:
            return [(self.name, _PATTERN)]
        apart = self.name.startswith("jac_")
        return [(self.name, end) for end in _ENDS if not (apart and end == _PATTERN)]

    def of(self, function: casadi.Function) -> casadi.Function:
        """Return this derivative of a Function.

        Args:
            function: Function that is differentiated.
        """
        return _derivative(function, self.name)


def _derivative(function: casadi.Function, name: str) -> casadi.Function:
    """Return the derivative of a Function with CasADi's name, such as jac_fwd1_f."""
    if name == function.name():
        return function
    way, _, rest = name.partition("_")
    inner = _derivative(function, rest)
    if way == _BY_PARAMETERS:
        return _by_parameters(inner, name)
    return inner.jacobian() if way == "jac" else getattr(inner, _WAYS[way])(1)


_WAYS = {"fwd1": "forward", "adj1": "reverse"}

_BY_PARAMETERS = "byp"


def by_parameters(function: str) -> Derivative:
    """Return the dense derivative of the first output of a Function by its last input.

    Args:
        function: name of the Function.

    Returns:
        Derivative with the prefix `byp_`.
    """
    return Derivative(f"{_BY_PARAMETERS}_{function}")


def _by_parameters(function: casadi.Function, name: str) -> casadi.Function:
    """Return the derivative of the first output by the last input as a Function with this name."""
    symbols: Any = function.sx_in() if function.is_a("SXFunction") else function.mx_in()
    slope = casadi.densify(casadi.jacobian(function.call(symbols)[0], symbols[-1]))
    return casadi.Function(name, symbols, [slope], function.name_in(), ["slope"], {"cse": True})


def derivatives_of(function: str, order: int) -> list[Derivative]:
    """Return the derivatives that CasADi may request, with the names that it uses.

    Args:
        function: name of the Function.
        order: number of times that it can be differentiated, 1 or 2.
    """
    first = [f"{way}_{function}" for way in _WAYS]
    jacobian = f"jac_{function}"
    every = [Derivative(jacobian), Derivative(jacobian, pattern=True), *map(Derivative, first)]
    if order == 2:
        every += [Derivative(f"{way}_{name}") for name in first for way in _WAYS]
        every += [Derivative(f"jac_{name}", pattern=True) for name in first]
    return every


def source(
    every: Sequence[Derivative], record: Path, own: Sequence[Derivative] | None = None
) -> str:
    """Return C code that defines the stubs of derivatives.

    Args:
        every: all derivatives of the Function.
        record: path of the file with the Function.
        own: derivatives whose stubs are defined. Default: all.
    """
    head = resources.files("mbs.native").joinpath("runtime/on_demand.c").read_text("utf-8")
    path = os.fspath(record).replace("\\", "\\\\").replace('"', '\\"').replace("?", "\\?")
    count = sum(len(part.symbols()) for part in every)
    start = [f"#define COUNT {count}", f"#define PARTS {len(every)}", f'#define RECORD "{path}"']
    return "\n".join([*start, head, *_lines(every, every if own is None else own)])


def _lines(every: Sequence[Derivative], own: Sequence[Derivative]) -> Iterator[str]:
    """Yield the C lines that define the stubs of the derivatives `own` among `every`."""
    symbols = [(k, name, end) for k, part in enumerate(every) for name, end in part.symbols()]
    for index, (part, name, end) in enumerate(symbols):
        if every[part] not in own:
            continue
        kind, rest = _ENDS[end].split(", ", 1)
        at = f"{name}{end}, {index}, {part}, {'there' if end in _LATE else 'fetched'}"
        if kind == "void":
            yield f"FORWARD_VOID({at}, {rest})"
        else:
            yield f"FORWARD({at}, {int(end in _FAILS)}, {kind}, {rest})"


def fill(table: int, library: Path, every: Sequence[Derivative], made: int) -> None:
    """Write the addresses of a compiled derivative to the table of the stubs.

    Args:
        table: address of the table. Entries remain zero for names that the library lacks.
        library: library of the derivative.
        every: all derivatives of the Function.
        made: index of the derivative in `every`.
    """
    code, symbols = ctypes.CDLL(os.fspath(library)), every[made].symbols()
    first = sum(len(part.symbols()) for part in every[:made])
    size = ctypes.sizeof(ctypes.c_void_p)
    addresses = (ctypes.c_void_p * len(symbols)).from_address(table + first * size)
    for k, (name, end) in enumerate(symbols):
        if hasattr(code, name + end):
            addresses[k] = ctypes.cast(code[name + end], ctypes.c_void_p).value


def write_record(
    key: str, text: str, every: Sequence[Derivative], fast: bool, loops: LoopCode | None = None
) -> Path | None:
    """Write the file of a Function whose derivatives are compiled later; None if that fails.

    Args:
        key: cache key; it is part of the file name.
        text: serialised Function.
        every: derivatives that may be requested.
        fast: True for vectorised code with fused multiply-add, False for bit-identical code.
        loops: code of a Jacobian that loops over the links; None for straight-line code.
    """
    record = cache_dir() / f"{key}{_SUFFIX}"
    parts = (part.name + _ONLY_PATTERN * part.pattern for part in every)
    content = f"{' '.join((str(int(fast)), *parts))}\n{json.dumps(loops)}\n{text}".encode()
    with suppress(OSError, ValueError):
        if read_sealed(record) == content:
            return record
    try:
        os.fspath(record).encode()  # the path becomes part of the C code
        write_sealed(content, record)
    except (ExportError, ValueError):
        return None
    return record


_ONLY_PATTERN = "*"


class DerivativeSource(NamedTuple):
    """Source of the derivatives of a Function.

    Attributes:
        function: callable that returns the Function to differentiate, for a derivative.
        every: all derivatives that may be requested.
        fast: True for vectorised code with fused multiply-add, False for bit-identical code.
        loops: code of a Jacobian that loops over the links; None for straight-line code.
    """

    function: Callable[[Derivative], casadi.Function]
    every: Sequence[Derivative]
    fast: bool
    loops: LoopCode | None = None


_PROMISED: dict[Path, DerivativeSource] = {}


def promise(record: Path, content: DerivativeSource) -> None:
    """Register the source of derivatives for this process, instead of a file with the equations.

    Args:
        record: path that the library passes to `read_record`; no file is written.
        content: source of the derivatives.
    """
    _PROMISED[record] = content


@functools.lru_cache(maxsize=1)  # several derivatives of a Function are often requested in a row
def read_record(record: Path) -> DerivativeSource:
    """Return the source of the derivatives of a Function, registered or from its file.

    Args:
        record: path of the file, or the path that was registered by `promise`.

    Raises:
        CompilerError: the file was deleted or is damaged.
    """
    if record in _PROMISED:
        return _PROMISED[record]
    try:
        options, code, text = read_sealed(record).decode().split("\n", 2)
        fast, *names = options.split()
        every = [
            Derivative(n.removesuffix(_ONLY_PATTERN), n.endswith(_ONLY_PATTERN)) for n in names
        ]
        function, loops = casadi.Function.deserialize(text), json.loads(code)
        by_loops = LoopCode(*loops) if loops else None
        return DerivativeSource(lambda _: function, every, bool(int(fast)), by_loops)
    except (OSError, ValueError, RuntimeError) as error:
        raise CompilerError(
            f"the derivatives of a compiled Function cannot be made: {record} has gone or is"
            " damaged; compile the Function again"
        ) from error
